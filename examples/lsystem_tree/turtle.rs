//! The turtle: it reads a text symbol by symbol, walks, and leaves a tree behind it.
//!
//! | symbol | |
//! |---|---|
//! | `F` | forward by its length: a segment |
//! | `+` `-` | turn left, right |
//! | `&` `^` | pitch down, up |
//! | `\` `/` | roll left, right |
//! | `[` `]` | remember the present state; return to it |
//! | `!` | multiply the diameter by its ratio |
//! | `"` | multiply the length by its ratio |
//!
//! Letters and white space do nothing. The turtle begins at the origin, upwards along y, with z above its back.

use super::error::LSystemError;
use bevy_math::{Quat, Vec3};
use bevy_vessels::synthesis::tree::{NO_PARENT, VesselTree};

/// Settings of a turtle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turtle {
    /// Angle of each turn, pitch and roll, in degrees.
    pub angle: f32,
    /// Length of the first segments, in tissue lengths. Limits: above 0.
    pub length: f32,
    /// Factor of `"`. Limits: above 0.
    pub length_ratio: f32,
    /// Diameter of the first segments, in tissue lengths. Limits: above 0.
    pub diameter: f32,
    /// Factor of `!`. Limits: above 0.
    pub diameter_ratio: f32,
}

/// What `[` remembers.
#[derive(Clone, Copy)]
struct State {
    node: u32,
    /// From the turtle's own directions, heading y, left −x and up z, to the world's.
    frame: Quat,
    length: f32,
    diameter: f32,
}

impl Turtle {
    /// Draws a text: one node for the root and one for every `F`, in the order of the text.
    ///
    /// # Errors
    /// Brackets that do not match, characters that mean nothing, and settings out of their limits.
    pub fn draw(&self, text: &str) -> Result<VesselTree, LSystemError> {
        let mut state = State { node: 0, frame: Quat::IDENTITY, length: self.length, diameter: self.diameter };
        let (mut positions, mut parents, mut radii) = (vec![Vec3::ZERO], vec![NO_PARENT], vec![0.5 * self.diameter]);
        let mut open: Vec<(usize, State)> = Vec::new();
        for (position, symbol) in (1..).zip(text.chars()) {
            match symbol {
                'F' => {
                    let step = state.frame * Vec3::Y * state.length;
                    positions.push(positions[state.node as usize] + step);
                    parents.push(state.node);
                    radii.push(0.5 * state.diameter);
                    state.node = radii.len() as u32 - 1;
                }
                '[' => open.push((position, state)),
                ']' => (_, state) = open.pop().ok_or(LSystemError::Unopened { position })?,
                '!' => state.diameter *= self.diameter_ratio,
                '"' => state.length *= self.length_ratio,
                letter if letter.is_alphabetic() || letter.is_whitespace() => {}
                symbol => {
                    let turn = self.turn(symbol).ok_or(LSystemError::Unknown { symbol, position })?;
                    // Rounding would stretch the steps after some thousand turns.
                    state.frame = (state.frame * turn).normalize();
                }
            }
        }
        if let Some(&(position, _)) = open.last() {
            return Err(LSystemError::Unclosed { position });
        }
        Ok(VesselTree::from_arrays(positions, parents, radii)?)
    }

    /// The rotation of a symbol, in the turtle's own directions.
    fn turn(&self, symbol: char) -> Option<Quat> {
        let (axis, sign) = match symbol {
            '+' => (Vec3::Z, 1.0),
            '-' => (Vec3::Z, -1.0),
            '&' => (Vec3::NEG_X, 1.0),
            '^' => (Vec3::NEG_X, -1.0),
            '/' => (Vec3::Y, 1.0),
            '\\' => (Vec3::Y, -1.0),
            _ => return None,
        };
        Some(Quat::from_axis_angle(axis, sign * self.angle.to_radians()))
    }
}
