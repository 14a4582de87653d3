//! Tissues of simple shape.

use crate::synthesis::tissue::{Ball, Cuboid, Disc, Ellipsoid, Rectangle, Tissue, TissueError};
use bevy_math::Vec3;
use std::sync::Arc;

/// A tissue of simple shape, in tissue lengths and the organ's local space. It needs no mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueShape {
    /// A flat disc, which is a surface.
    Disc {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// The direction that it faces, of any length except 0. Default in files: z.
        #[cfg_attr(feature = "serialize", serde(default = "upwards"))]
        normal: Vec3,
        /// Its radius. Limits: `> 0`.
        radius: f32,
    },
    /// A flat rectangle, which is a surface. It faces `half_x` × `half_y`.
    Rectangle {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// From the centre to the middle of a side.
        half_x: Vec3,
        /// From the centre to the middle of a neighbouring side, perpendicular to `half_x`.
        half_y: Vec3,
    },
    /// A solid ball.
    Ball {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// Its radius. Limits: `> 0`.
        radius: f32,
    },
    /// A solid box along the axes.
    Cuboid {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// Its full side lengths. Limits: each `> 0`.
        size: Vec3,
    },
    /// A solid ellipsoid along the axes.
    Ellipsoid {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// Its half axes. Limits: each `> 0`.
        half_axes: Vec3,
    },
}

#[cfg(feature = "serialize")]
fn upwards() -> Vec3 {
    Vec3::Z
}

impl TissueShape {
    /// A disc in the plane z = 0 around the origin.
    pub fn disc(radius: f32) -> Self {
        Self::Disc { center: Vec3::ZERO, normal: Vec3::Z, radius }
    }

    /// A ball around the origin.
    pub fn ball(radius: f32) -> Self {
        Self::Ball { center: Vec3::ZERO, radius }
    }

    /// A box around the origin, of these full side lengths.
    pub fn cuboid(size: Vec3) -> Self {
        Self::Cuboid { center: Vec3::ZERO, size }
    }

    /// The shape as a tissue.
    ///
    /// # Errors
    /// A coordinate that is not finite, a size that is not above 0, sides of a rectangle that are not perpendicular.
    pub fn build(&self) -> Result<Arc<dyn Tissue>, TissueError> {
        Ok(match *self {
            Self::Disc { center, normal, radius } => Arc::new(Disc::new(center, normal, radius)?),
            Self::Rectangle { center, half_x, half_y } => Arc::new(Rectangle::new(center, half_x, half_y)?),
            Self::Ball { center, radius } => Arc::new(Ball::new(center, radius)?),
            Self::Cuboid { center, size } => Arc::new(Cuboid::new(center, size)?),
            Self::Ellipsoid { center, half_axes } => Arc::new(Ellipsoid::new(center, half_axes)?),
        })
    }
}
