//! What a user chooses of a surface, and what is wrong with a choice.

use crate::synthesis::tree::{NodeId, TreeError};

/// How fine a surface is.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct SurfaceSettings {
    /// Number of Catmull–Clark subdivisions of the cage. Each makes four times as many faces, and a smoother surface.
    ///
    /// Limits: at most [`Self::MOST_LEVEL`]. 0 gives the cage itself, whose vertices lie outside of the vessels, so that
    /// later subdivisions shrink onto them. Default: [`Self::DEFAULT_LEVEL`].
    pub level: u32,
    /// Sides of the cage around the widest vessels. Vessels of half that radius have half as many sides, and so on.
    ///
    /// More make wide vessels rounder, and let thin branches leave them without a funnel.
    ///
    /// Limits: 4, 8, 16, 32 or 64. 4 gives the four-sided cages of Skjermo & Eidheim, if
    /// [`least_sides`](Self::least_sides) is 4, too. Default: [`Self::DEFAULT_MOST_SIDES`].
    pub most_sides: u32,
    /// Sides of the cage around the thinnest vessels.
    ///
    /// Limits: 4, 8, 16, 32 or 64, at most [`most_sides`](Self::most_sides). Default: [`Self::DEFAULT_LEAST_SIDES`].
    pub least_sides: u32,
    /// How vessels end at tips.
    ///
    /// Default: [`TipCap::Round`].
    pub tips: TipCap,
}

/// The end of a vessel at a tip of the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TipCap {
    /// Half a ball, as the segments themselves have.
    #[default]
    Round,
    /// A cone of three radii with a blunt point, as in plants and in vessels that vanish in tissue.
    Pointed,
}

impl SurfaceSettings {
    /// The most subdivisions: each node of a tree then has some ten thousand faces.
    pub const MOST_LEVEL: u32 = 4;
    /// Subdivisions for a smooth look.
    pub const DEFAULT_LEVEL: u32 = 1;
    /// The most sides of a cage.
    pub const LIMIT_SIDES: u32 = 64;
    /// Sides that make a trunk round after one subdivision, to 0.5 % of its radius.
    pub const DEFAULT_MOST_SIDES: u32 = 16;
    /// Sides of a twig.
    pub const DEFAULT_LEAST_SIDES: u32 = 4;

    /// Checks all settings.
    ///
    /// # Errors
    /// The first value out of its limits.
    pub fn validate(&self) -> Result<(), SurfaceError> {
        if self.level > Self::MOST_LEVEL {
            return Err(SurfaceError::Level { level: self.level });
        }
        for sides in [self.most_sides, self.least_sides] {
            if !(4..=Self::LIMIT_SIDES).contains(&sides) || !sides.is_power_of_two() {
                return Err(SurfaceError::Sides { sides });
            }
        }
        if self.least_sides > self.most_sides {
            return Err(SurfaceError::LeastAboveMost { least: self.least_sides, most: self.most_sides });
        }
        Ok(())
    }
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self {
            level: Self::DEFAULT_LEVEL,
            most_sides: Self::DEFAULT_MOST_SIDES,
            least_sides: Self::DEFAULT_LEAST_SIDES,
            tips: TipCap::default(),
        }
    }
}

/// Why there is no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// More subdivisions than any machine has memory for.
    #[error("a surface of level {level} is too fine; set level to {most} or less", most = SurfaceSettings::MOST_LEVEL)]
    Level {
        /// The level given.
        level: u32,
    },
    /// A number of sides that cannot be halved down to 4.
    #[error("a surface cannot have {sides} sides around a vessel; set 4, 8, 16, 32 or 64")]
    Sides {
        /// The number given.
        sides: u32,
    },
    /// More sides around thin vessels than around wide ones.
    #[error("least_sides = {least} is above most_sides = {most}; lower it, or raise most_sides")]
    LeastAboveMost {
        /// The least number of sides.
        least: u32,
        /// The most sides.
        most: u32,
    },
    /// More vertices than 32-bit indices can count.
    #[error("a surface of {faces} faces has too many vertices; lower level or most_sides, or split the tree")]
    TooManyFaces {
        /// Number of faces.
        faces: u64,
    },
    /// A vessel that closes a loop, at a node that isn't there.
    #[error("a vessel that closes a loop ends at node {}, but the tree has {nodes} nodes; count from 0", node.0)]
    ClosingNode {
        /// The node given.
        node: NodeId,
        /// Number of nodes.
        nodes: usize,
    },
    /// A loop whose nodes lie at one place.
    #[error("the loop closed between nodes {} and {} has no length; leave it out", ends[0].0, ends[1].0)]
    ClosingLength {
        /// The nodes given.
        ends: [NodeId; 2],
    },
    /// A network that cannot be hung up as a tree.
    #[error(transparent)]
    Network(#[from] TreeError),
    /// A vessel that closes a loop, without a radius.
    #[error("the vessel that closes a loop between nodes {} and {} has radius {radius}; set it above 0", ends[0].0, ends[1].0)]
    ClosingRadius {
        /// The nodes given.
        ends: [NodeId; 2],
        /// The radius given.
        radius: f32,
    },
}
