//! Who has the pointer and the keys: the panel, or the world behind it.

use super::state::{PanelTool, VesselPanel};
use bevy::prelude::*;
use bevy_egui::{
    EguiContext,
    egui::{Context, Order},
};

/// Whether the pointer and the keys belong to the panel.
///
/// A drag belongs to where it began until all buttons are up, wherever it goes: one that began in the panel moves no
/// camera outside, and one that began outside turns no slider. Without a drag, the pointer belongs to what it is over, so
/// that the wheel scrolls the panel there. Let cameras and tools ask before they act:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_vessels::ui::PanelFocus;
/// fn turn_camera(focus: Res<PanelFocus>) {
///     if !focus.has_pointer() { /* … */ }
/// }
/// # bevy::ecs::system::assert_is_system(turn_camera);
/// ```
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PanelFocus {
    pointer: bool,
    keys: bool,
    /// Whether a drag, or the pointer without one, is in the panel itself.
    in_panel: bool,
    /// Whether a button is held down.
    drag: bool,
}

impl PanelFocus {
    /// Whether presses, drags and the wheel of the pointer belong to the panel, or to the [tool](super::VesselPanel::tool)
    /// that it gave out.
    pub fn has_pointer(self) -> bool {
        self.pointer
    }

    /// Whether typed keys belong to the panel.
    pub fn has_keys(self) -> bool {
        self.keys
    }

    /// Whether the pointer, or the drag that it is on, is in the panel.
    pub(super) fn is_over_panel(self) -> bool {
        self.in_panel
    }

    /// The focus in the next frame. `is_over_panel` and `cuts` tell where the pointer is, and whether it holds a tool down.
    fn next(self, is_over_panel: bool, is_down: bool, cuts: bool, types: bool) -> Self {
        // A press and what follows belong to what is pressed.
        let in_panel = if self.drag { self.in_panel } else { is_over_panel };
        let pointer = if self.drag { self.pointer } else { in_panel || cuts };
        Self { pointer, keys: types, in_panel, drag: is_down }
    }
}

/// Notes where the pointer is, and whether something is typed into the panel.
pub(super) fn note_focus(
    mut contexts: Query<&mut EguiContext>,
    buttons: Res<ButtonInput<MouseButton>>,
    touches: Res<Touches>,
    panel: Res<VesselPanel>,
    mut focus: ResMut<PanelFocus>,
) {
    let (mut is_over, mut types) = (false, false);
    for mut context in &mut contexts {
        let context = context.get_mut();
        is_over |= is_over_window(context) || context.egui_is_using_pointer();
        types |= context.egui_wants_keyboard_input();
    }
    let is_down = buttons.get_pressed().next().is_some() || touches.iter().next().is_some();
    let cuts = panel.tool != PanelTool::Hand && buttons.pressed(MouseButton::Left);
    let next = focus.next(is_over, is_down, cuts, types);
    focus.set_if_neq(next);
}

/// Whether the pointer is over a window, or what one has opened.
fn is_over_window(context: &Context) -> bool {
    let layer = context.pointer_interact_pos().and_then(|pointer| context.layer_id_at(pointer));
    layer.is_some_and(|layer| layer.order != Order::Background)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The focus after frames of (over the panel, button down).
    fn after(frames: &[(bool, bool)]) -> bool {
        frames
            .iter()
            .fold(PanelFocus::default(), |focus, &(over, down)| focus.next(over, down, false, false))
            .has_pointer()
    }

    const IN: bool = true;
    const OUT: bool = false;

    #[test]
    fn a_drag_belongs_to_where_it_began() {
        assert!(after(&[(IN, false), (IN, true), (OUT, true), (OUT, true)]), "out of the panel");
        assert!(!after(&[(OUT, false), (OUT, true), (IN, true), (IN, true)]), "into the panel");
        assert!(!after(&[(IN, true), (OUT, true), (OUT, false), (OUT, false)]), "and ends when it is released");
        assert!(after(&[(OUT, true), (IN, true), (IN, false), (IN, false)]));
    }

    #[test]
    fn the_frame_of_the_release_still_belongs_to_the_drag() {
        assert!(after(&[(IN, true), (OUT, true), (OUT, false)]));
        assert!(!after(&[(OUT, true), (IN, true), (IN, false)]));
    }

    #[test]
    fn a_tool_that_is_held_down_has_the_pointer_but_is_not_in_the_panel() {
        let focus = PanelFocus::default().next(OUT, true, true, false);
        assert!(focus.has_pointer() && !focus.is_over_panel());
        let focus = focus.next(IN, true, true, false);
        assert!(focus.has_pointer() && !focus.is_over_panel(), "it works on, over the panel, too");
        assert!(PanelFocus::default().next(IN, true, true, false).is_over_panel());
    }

    #[test]
    fn without_a_drag_the_pointer_belongs_to_what_it_is_over() {
        assert!(after(&[(OUT, false), (IN, false)]));
        assert!(!after(&[(IN, false), (OUT, false)]));
    }
}
