//! Errors of roots.

use crate::synthesis::{mesh::MAX_COORDINATE, tree::VesselKind};
use bevy_math::Vec3;

/// The reason why roots cannot be placed as requested.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RootError {
    /// A coordinate that is NaN, infinite or beyond [`MAX_COORDINATE`].
    #[error("the {} root at {position} has a coordinate that is not finite and within ±{MAX_COORDINATE}", kind.name())]
    NotFinite {
        /// The kind whose root it is.
        kind: VesselKind,
        /// The requested position.
        position: Vec3,
    },
    /// A root out of reach of the tissue.
    #[error(
        "the {} root at {position} is {distance} from the tissue, further than the {reach} that it may be; move it closer or ask for the tissue's nearest point",
        kind.name()
    )]
    TooFar {
        /// The kind whose root it is.
        kind: VesselKind,
        /// The requested position.
        position: Vec3,
        /// Its distance from the tissue.
        distance: f32,
        /// The largest distance allowed.
        reach: f32,
    },
    /// Roots or a given tree of a kind that the generator doesn't grow.
    #[error("the generator grows no {} vessels; give them no roots and no tree, or choose another generator", kind.name())]
    NotGrown {
        /// The kind in question.
        kind: VesselKind,
    },
    /// Two roots at the same place.
    #[error("two roots, {} and {}, coincide at {position}; move one of them", kinds[0].name(), kinds[1].name())]
    Coincide {
        /// The kinds of the two roots.
        kinds: [VesselKind; 2],
        /// Where they are.
        position: Vec3,
    },
    /// More roots to be spread than [`Roots::MAX_SPREAD`](super::Roots::MAX_SPREAD).
    #[error("{count} {} roots are more than {limit}", kind.name())]
    TooMany {
        /// The kind in question.
        kind: VesselKind,
        /// The requested number.
        count: u32,
        /// The largest number.
        limit: u32,
    },
    /// A root in a no-go region of the tissue.
    #[error(
        "the {} root at {position} is in a no-go region; move it, or make the region smaller",
        kind.name()
    )]
    Forbidden {
        /// The kind of the root.
        kind: VesselKind,
        /// Its requested position.
        position: Vec3,
    },
    /// A tissue with too few places for the roots to be spread.
    #[error(
        "the tissue has room for {found} of {wanted} {} roots; ask for fewer, or leave more of it free of no-go regions",
        kind.name()
    )]
    NoRoom {
        /// The kind in question.
        kind: VesselKind,
        /// The requested number.
        wanted: u32,
        /// The number of places found.
        found: u32,
    },
    /// A reach of roots that is below [`Roots::LEAST_REACH`](super::Roots::LEAST_REACH), or NaN.
    #[error("{} roots are to reach {reach} equivalent diameters; it must be finite and at least {least}", kind.name())]
    Reach {
        /// The kind in question.
        kind: VesselKind,
        /// The value found.
        reach: f32,
        /// The least value.
        least: f32,
    },
    /// Arteries and veins are each placed beside the other.
    #[error("arterial and venous roots are each placed beside the other's; place one of them otherwise")]
    BesideEachOther,
    /// A given tree with such a coordinate.
    #[error("node {node} of the given {} tree is at {position}, which is not finite and within ±{MAX_COORDINATE}", kind.name())]
    GivenNotFinite {
        /// The kind whose tree it is.
        kind: VesselKind,
        /// The node.
        node: usize,
        /// Where it is.
        position: Vec3,
    },
    /// A given tree out of reach of the tissue.
    #[error(
        "the given {} tree comes no closer to the tissue than {distance}, further than the {reach} that it may be; is it in the organ's local space?",
        kind.name()
    )]
    GivenTooFar {
        /// The kind whose tree it is.
        kind: VesselKind,
        /// The smallest distance of a node from the tissue.
        distance: f32,
        /// The largest distance allowed.
        reach: f32,
    },
}
