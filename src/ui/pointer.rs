//! The pointer as tools see it: whether its button works in the world, and the ray under it.

use super::focus::PanelFocus;
use bevy::{ecs::system::SystemParam, prelude::*};

/// The pointer in the window of the app.
#[derive(SystemParam)]
pub(super) struct Pointer<'w, 's> {
    focus: Res<'w, PanelFocus>,
    buttons: Res<'w, ButtonInput<MouseButton>>,
    windows: Query<'w, 's, &'static Window>,
    cameras: Query<'w, 's, (&'static Camera, &'static GlobalTransform), With<Camera3d>>,
}

impl Pointer<'_, '_> {
    /// Whether the primary button is held down, and was pressed outside the panel.
    pub(super) fn works(&self) -> bool {
        self.buttons.pressed(MouseButton::Left) && !self.focus.is_over_panel()
    }

    /// The ray from the camera through the pointer.
    pub(super) fn ray(&self) -> Option<Ray3d> {
        let (camera, place) = self.cameras.iter().find(|(camera, _)| camera.is_active)?;
        let cursor = self.windows.iter().find_map(Window::cursor_position)?;
        camera.viewport_to_world(place, cursor).ok()
    }
}
