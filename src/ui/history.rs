//! Undo and redo of an organ's settings, roots and paint: one step for each drag, stroke, choice or typed value.

use crate::plugin::{OrganPaint, Vasculature};
use bevy::{ecs::entity::Entity, platform::collections::HashMap};
use bevy_egui::egui::{self, Key, Modifiers, Ui, util::undoer::Undoer};

/// What a step may change of an organ.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Work {
    pub(super) wish: Vasculature,
    pub(super) paint: OrganPaint,
}

/// The work that organs had before.
#[derive(Debug, Default)]
pub(super) struct History(HashMap<Entity, Undoer<Work>>);

impl History {
    /// Notes an organ's work. What changes while `busy`, during a drag, becomes one step with its end.
    pub(super) fn note(&mut self, organ: Entity, work: &Work, busy: bool) {
        let steps = self.0.entry(organ).or_default();
        if !busy {
            // This forgets what was undone, if the work has gone another way since.
            steps.feed_state(0.0, work);
            steps.add_undo(work);
        }
    }

    /// Forgets organs that are gone.
    pub(super) fn retain(&mut self, lives: impl Fn(Entity) -> bool) {
        self.0.retain(|&organ, _| lives(organ));
    }

    /// The work before the last step, or that after it again.
    pub(super) fn go(&mut self, organ: Entity, work: &Work, back: bool) -> Option<Work> {
        let steps = self.0.get_mut(&organ)?;
        if back { steps.undo(work) } else { steps.redo(work) }.cloned()
    }

    /// Shows the buttons, hears the keys, and goes back or forth.
    pub(super) fn show(&mut self, ui: &mut Ui, organ: Entity, work: &mut Work) {
        let Some(steps) = self.0.get(&organ) else { return };
        let (can_undo, can_redo) = (steps.has_undo(work), steps.has_redo(work));
        let undo = ui.add_enabled(can_undo, egui::Button::new("undo")).on_hover_text("Ctrl Z").clicked();
        let redo = ui.add_enabled(can_redo, egui::Button::new("redo")).on_hover_text("Ctrl Shift Z").clicked();
        let key = |modifiers, key| ui.input_mut(|input| input.consume_key(modifiers, key));
        // The longer chord first: the shorter one would take it, too.
        let redo = key(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || key(Modifiers::COMMAND, Key::Y) || redo;
        let undo = key(Modifiers::COMMAND, Key::Z) || undo;
        if (undo || redo)
            && let Some(other) = self.go(organ, work, undo)
        {
            *work = other;
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
        let seed = |seed| Work { wish: Vasculature::default().with_seed(seed), ..Work::default() };
        history.note(organ, &seed(0), false);
        for dragged in 1..=5 {
            history.note(organ, &seed(dragged), true);
        }
        history.note(organ, &seed(5), false);
        history.note(organ, &seed(5), false);
        let back = history.go(organ, &seed(5), true).expect("a step");
        assert_eq!(back.wish.seed, 0, "the whole drag");
        assert!(history.go(organ, &seed(0), true).is_none(), "there was nothing before");
        assert_eq!(history.go(organ, &back, false).expect("again").wish.seed, 5);
        history.go(organ, &seed(5), true);
        history.note(organ, &seed(9), false);
        assert!(history.go(organ, &seed(9), false).is_none(), "another way was taken");
        assert_eq!(history.go(organ, &seed(9), true).expect("a step").wish.seed, 0);
    }

    #[test]
    fn strokes_and_settings_are_undone_in_one_order() {
        let (organ, mut history, mut work) = (Entity::PLACEHOLDER, History::default(), Work::default());
        history.note(organ, &work, false);
        let mut painted = Vec::new();
        for stroke in [0.25, 0.5] {
            for dab in 0..3 {
                work.paint.density = Some(vec![stroke + 0.1 * dab as f32]);
                history.note(organ, &work, true);
            }
            history.note(organ, &work, false);
            painted.push(work.clone());
            work.wish.seed += 1;
            history.note(organ, &work, false);
        }
        let back = |history: &mut History, work: &Work| history.go(organ, work, true).expect("a step");
        let first = back(&mut history, &work);
        assert_eq!(first, painted[1], "the last seed");
        let second = back(&mut history, &first);
        assert_eq!((second.wish.seed, &second.paint), (1, &painted[0].paint), "the whole stroke");
    }
}
