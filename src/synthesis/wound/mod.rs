//! Cuts, clamps, ties and seals on a vessel tree.
//!
//! In: a [`VesselTree`](super::tree::VesselTree), a [`Blade`] in its space, and a
//! [`SegmentIndex`](super::segment_index::SegmentIndex). Out: a [`WoundReport`] for each action, with every end that it
//! opened or closed; and at any time [`Wounds`], which gives the flow how far blood may go ([`Wounds::interruptions`])
//! and a renderer the remaining pieces of a vessel ([`Wounds::pieces`]); their look is defined in
//! [`instances`](super::instances). [`Remains`] is the tree that is left.
//!
//! The tree itself is never changed: wounds are laid over it, each at a share of a segment. So growth, which only
//! appends, and deformation, which moves nodes, can continue, and undo is exact.
//!
//! # Rules
//!
//! - A vessel is severed where its centre line crosses a blade: see [`severed`] for the rules and their exactness.
//! - A ball or capsule removes all that lies within it, and severs what passes its boundary.
//! - Severed ends retract at once, by [`Retraction`], over as many segments as needed, but not past a branching. Where
//!   no vessel is left, a blade severs nothing and a clamp cannot be placed.
//! - An end is open if it is not sealed, and no clamp, tie or seal is on its piece of the segment.
//! - A clamp or tie is a place without length; a cut through it leaves it on the end towards the root. A cut through a
//!   sealed stretch opens nothing.
//! - An action that changes nothing does not count: undo skips it.
//!
//! # Example
//!
//! ```
//! use bevy_math::Vec3;
//! use bevy_vessels::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
//! use bevy_vessels::synthesis::{segment_index::Region, wound::{Blade, EndSide, Retraction, Wounds}};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let tree = VesselTree::from_arrays(vec![Vec3::ZERO, 4.0 * Vec3::X], vec![NO_PARENT, 0], vec![0.1; 2])?;
//! let every_segment = |_: &Region, visit: &mut dyn FnMut(NodeId)| visit(NodeId(1));
//! let mut wounds = Wounds::new(Retraction { radii: 2.0, length: 0.0 })?;
//!
//! let scalpel = Blade::sweep([-Vec3::Y - Vec3::Z, -Vec3::Y + Vec3::Z], [Vec3::Y - Vec3::Z, Vec3::Y + Vec3::Z])?;
//! let scalpel = scalpel.to_local(&bevy_math::Affine3A::from_translation(-Vec3::X))?;
//! let report = wounds.cut(&scalpel, &tree, every_segment);
//! let [proximal, distal] = report.opened[..] else { panic!("two ends") };
//! assert_eq!((proximal.side, distal.side), (EndSide::Proximal, EndSide::Distal));
//! // Cut at x = 1; each end retracted by two radii.
//! assert!((proximal.position.x - 0.8).abs() < 1e-6 && (distal.position.x - 1.2).abs() < 1e-6);
//! assert_eq!(wounds.undo(&tree).unwrap().closed, [proximal.id, distal.id]);
//! # Ok(())
//! # }
//! ```

mod actions;
mod blade;
mod crossing;
mod error;
mod history;
mod injury;
mod ledger;
mod pieces;
mod remains;
mod report;
mod retraction;
#[cfg(feature = "serialize")]
mod saved;
mod withdrawal;

pub use crate::synthesis::haemodynamics::EndSide;
pub use blade::{Blade, BladeError};
pub use crossing::{Severed, severed};
pub use error::WoundError;
pub use ledger::Wounds;
pub use pieces::{Blockage, PieceEnd, PieceKind, SegmentPiece};
pub use remains::Remains;
pub use report::{ClampId, EndId, SeveredEnd, WoundReport};
pub use retraction::Retraction;
