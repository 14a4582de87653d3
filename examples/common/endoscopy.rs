//! A view of an organ from inside: the camera travels along a line, and carries the only light.

use crate::common::{light::Endoscope, studio::StatusLine};
use bevy::prelude::*;
use bevy_panorbit_camera::PanOrbitCamera;

/// The line through an organ, in the world, with its points at equal distances.
#[derive(Resource)]
pub struct Lumen {
    line: Vec<Vec3>,
    at: f32,
}

impl Lumen {
    /// Distance at which the camera looks ahead, as a share of the line's points.
    const AHEAD: f32 = 0.08;

    /// A line that begins at the point nearest to `start`.
    pub fn new(line: Vec<Vec3>, start: Vec3) -> Self {
        let nearest = line.iter().map(|point| point.distance(start)).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        Self { at: nearest.map_or(0.0, |(index, _)| index as f32), line }
    }

    fn point(&self, at: f32) -> Vec3 {
        let index = (at.max(0.0) as usize).min(self.line.len().saturating_sub(2));
        let next = self.line.get(index + 1).copied().unwrap_or_default();
        self.line.get(index).map_or(next, |point| point.lerp(next, at - index as f32))
    }

    /// Moves on by a share of the whole line, towards its start.
    fn travel(&mut self, share: f32) {
        let last = self.line.len() as f32 - 1.0;
        self.at = (self.at - share * last).clamp(last * (Self::AHEAD + 0.04), last);
    }
}

/// `I` enters and leaves, ↑ and ↓ travel. For organs with a [`Lumen`].
pub fn look_inside(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time>,
    lumen: Option<ResMut<Lumen>>,
    mut endoscope: ResMut<Endoscope>,
    mut status: ResMut<StatusLine>,
    camera: Single<(&mut Transform, &mut PanOrbitCamera)>,
) {
    let Some(mut lumen) = lumen else { return };
    let (mut transform, mut orbit) = camera.into_inner();
    if keys.just_pressed(KeyCode::KeyI) {
        endoscope.0 = !endoscope.0;
        orbit.enabled = !endoscope.0;
        orbit.force_update = true;
    }
    if endoscope.0 {
        let pressed = |key| if keys.pressed(key) { 1.0 } else { 0.0 };
        let direction: f32 = pressed(KeyCode::ArrowUp) - pressed(KeyCode::ArrowDown);
        lumen.travel(0.06 * direction * time.delta_secs());
        let (eye, ahead) = (lumen.point(lumen.at), lumen.point(lumen.at - Lumen::AHEAD * lumen.line.len() as f32));
        *transform = Transform::from_translation(eye).looking_at(ahead, transform.up());
        status.0.push_str(", inside");
    }
}
