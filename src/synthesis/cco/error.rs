//! Why constrained constructive optimisation cannot start, or ended early.

use crate::synthesis::{roots::RootError, tree::VesselKind};
use bevy_math::Vec3;

/// A setting with which growth cannot start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CcoSettingsError {
    /// A value outside its limits.
    #[error("{name} is {value}; it must be {limits}")]
    OutOfRange {
        /// Name of the field.
        name: &'static str,
        /// The value found.
        value: f64,
        /// What it may be.
        limits: &'static str,
    },
    /// A count outside its limits.
    #[error("{name} is {value}; it must be from {least} to {most}")]
    Count {
        /// Name of the field.
        name: &'static str,
        /// The value found.
        value: u32,
        /// The least count.
        least: u32,
        /// The largest count.
        most: u32,
    },
    /// A number of a kind's flow that is not above 0.
    #[error("{name} of the {} vessels is {value}; it must be above 0", kind.name())]
    Flow {
        /// The kind in question.
        kind: VesselKind,
        /// Name of the field.
        name: &'static str,
        /// The value found.
        value: f64,
    },
    /// Pressures between which nothing flows.
    #[error(
        "root_pressure of the {} vessels is {root} Pa and terminal_pressure {terminal} Pa; the root's must be above \
         the terminals'",
        kind.name()
    )]
    Pressures {
        /// The kind in question.
        kind: VesselKind,
        /// Pressure at the root, in pascals.
        root: f64,
        /// Pressure at the terminals, in pascals.
        terminal: f64,
    },
}

/// What is wrong with a node of a given tree, from which constrained constructive optimisation cannot continue.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GivenTreeError {
    /// The tree itself is not valid.
    #[error("cannot be used, since the tree is not valid: {reason}")]
    Invalid {
        /// What is wrong.
        reason: String,
    },
    /// More children than this generator knows.
    #[error(
        "has more than {most} children; vessels must bifurcate, and a root must have one child: divide it in two \
         nodes, or give each root vessel its own root"
    )]
    TooManyChildren {
        /// Most children that it may have.
        most: u32,
    },
    /// A root without a vessel.
    #[error("is a root without a vessel; remove it, and place a root there")]
    NoVessel,
    /// A segment without length.
    #[error("is where its parent is; merge the two")]
    NoLength,
    /// A vessel that overlaps another one.
    #[error(
        "ends a vessel that overlaps another one at a radius of {radius} tissue lengths; raise perfusion, lower the \
         flow or move it"
    )]
    Overlaps {
        /// The radius that it would have.
        radius: f32,
    },
}

/// Why constrained constructive optimisation cannot start, or could not place all terminals.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CcoError {
    /// A setting outside its limits.
    #[error(transparent)]
    Settings(#[from] CcoSettingsError),
    /// Roots that do not fit the tissue.
    #[error(transparent)]
    Roots(#[from] RootError),
    /// A tissue without an inside, or one that changes.
    #[error(
        "constrained constructive optimisation needs a flat area or a volume with a border, and {tissue} is neither; \
         use the organ's volume, a shape or a mask, or space colonization"
    )]
    NoInside {
        /// What the tissue is.
        tissue: &'static str,
    },
    /// A tissue so far from the origin that coordinates are too coarse for its vessels.
    #[error(
        "the tissue is {distance} tissue lengths from the origin and only {size} large; coordinates are too coarse \
         there: move it nearer to the origin"
    )]
    TooFarAway {
        /// The largest coordinate.
        distance: f32,
        /// The tissue's diagonal.
        size: f32,
    },
    /// No kind of vessels has a root.
    #[error("there is no root; place at least one")]
    NoRoot,
    /// A given tree from which growth cannot continue.
    #[error("node {node} of the given {} tree {reason}", kind.name())]
    GivenTree {
        /// The kind in question.
        kind: VesselKind,
        /// The node in the given tree.
        node: u32,
        /// What is wrong with it.
        reason: GivenTreeError,
    },
    /// Fewer terminals than roots.
    #[error(
        "{terminals} terminals are too few for the {} vessels, whose roots and given trees need {needed}; \
         raise terminals",
        kind.name()
    )]
    TooFewTerminals {
        /// The kind in question.
        kind: VesselKind,
        /// Terminals wanted.
        terminals: u32,
        /// One for each root, and those of given trees.
        needed: usize,
    },
    /// A root from which no first vessel fits into the tissue.
    #[error(
        "no vessel fits into the tissue from the {} root at {position}: it would have a radius of about \
         {radius} tissue lengths; move the root, raise perfusion, or lower flow or border_distance",
        kind.name()
    )]
    NoFirstVessel {
        /// The kind in question.
        kind: VesselKind,
        /// The root.
        position: Vec3,
        /// Radius of the last vessel tried.
        radius: f32,
    },
    /// Growth ended since no place for another terminal was found.
    #[error(
        "only {reached} of {wanted} {} terminals have room: the last {refused} places could not be connected; \
         ask for fewer terminals, raise perfusion, or lower flow or border_distance",
        kind.name()
    )]
    NoRoom {
        /// The kind in question.
        kind: VesselKind,
        /// Terminals that were placed.
        reached: u32,
        /// Terminals wanted.
        wanted: u32,
        /// Places refused in a row.
        refused: u32,
    },
}
