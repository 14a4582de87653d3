//! Undo and redo of an organ's settings: one step for each drag, choice or typed value.

use crate::plugin::Vasculature;
use bevy::{ecs::entity::Entity, platform::collections::HashMap};
use bevy_egui::egui::{self, Key, Modifiers, Ui, util::undoer::Undoer};

/// The settings that organs had before.
#[derive(Debug, Default)]
pub(super) struct History(HashMap<Entity, Undoer<Vasculature>>);

impl History {
    /// Notes an organ's settings. What changes while `busy`, during a drag, becomes one step with its end.
    pub(super) fn note(&mut self, organ: Entity, wish: &Vasculature, busy: bool) {
        let steps = self.0.entry(organ).or_default();
        if !busy {
            // This forgets what was undone, if the settings have gone another way since.
            steps.feed_state(0.0, wish);
            steps.add_undo(wish);
        }
    }

    /// Forgets organs that are gone.
    pub(super) fn retain(&mut self, lives: impl Fn(Entity) -> bool) {
        self.0.retain(|&organ, _| lives(organ));
    }

    /// The settings before the last step, or those after it again.
    pub(super) fn go(&mut self, organ: Entity, wish: &Vasculature, back: bool) -> Option<Vasculature> {
        let steps = self.0.get_mut(&organ)?;
        if back { steps.undo(wish) } else { steps.redo(wish) }.cloned()
    }

    /// Shows the buttons, hears the keys, and goes back or forth.
    pub(super) fn show(&mut self, ui: &mut Ui, organ: Entity, wish: &mut Vasculature) {
        let Some(steps) = self.0.get(&organ) else { return };
        let (can_undo, can_redo) = (steps.has_undo(wish), steps.has_redo(wish));
        let undo = ui.add_enabled(can_undo, egui::Button::new("undo")).on_hover_text("Ctrl Z").clicked();
        let redo = ui.add_enabled(can_redo, egui::Button::new("redo")).on_hover_text("Ctrl Shift Z").clicked();
        let key = |modifiers, key| ui.input_mut(|input| input.consume_key(modifiers, key));
        // The longer chord first: the shorter one would take it, too.
        let redo = key(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || key(Modifiers::COMMAND, Key::Y) || redo;
        let undo = key(Modifiers::COMMAND, Key::Z) || undo;
        if (undo || redo)
            && let Some(other) = self.go(organ, wish, undo)
        {
            *wish = other;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drag_is_one_step_and_redo_ends_with_another_change() {
        let organ = Entity::PLACEHOLDER;
        let mut history = History::default();
        let seed = |seed| Vasculature::default().with_seed(seed);
        history.note(organ, &seed(0), false);
        for dragged in 1..=5 {
            history.note(organ, &seed(dragged), true);
        }
        history.note(organ, &seed(5), false);
        history.note(organ, &seed(5), false);
        let back = history.go(organ, &seed(5), true).expect("a step");
        assert_eq!(back.seed, 0, "the whole drag");
        assert!(history.go(organ, &seed(0), true).is_none(), "there was nothing before");
        assert_eq!(history.go(organ, &back, false).expect("again").seed, 5);
        history.go(organ, &seed(5), true);
        history.note(organ, &seed(9), false);
        assert!(history.go(organ, &seed(9), false).is_none(), "another way was taken");
        assert_eq!(history.go(organ, &seed(9), true).expect("a step").seed, 0);
    }
}
