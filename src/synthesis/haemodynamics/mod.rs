//! Blood flow: pressure, flow, velocity and wall shear stress in every segment of a tree.
//!
//! In: a [`VesselTree`](crate::synthesis::tree::VesselTree), [`FlowSettings`] and the [`Interruption`]s of cuts and
//! clamps. Out: a [`Network`] that holds pressures and flows by node, and the flow at every [`NetworkEnd`].
//!
//! # Model
//!
//! Flow is steady and laminar: a segment of length L and radius r drops the pressure by Δp = R·Q with R = 8µL/(πr⁴)
//! (the law of Hagen and Poiseuille), and flow is conserved at every node. A segment has one radius, stored in the tree
//! for its end node. Roots are held at the root pressure, terminals drain into the bed.
//!
//! A tree of resistances is solved exactly in two sweeps. At its upper end, everything below a segment draws the
//! current Y·p − S at the pressure p. From the tips to the roots these add up: with Y and S the sums at a node, the
//! segment above it passes on Y/(1 + R·Y) and S/(1 + R·Y). From the roots to the tips, they give the node the pressure
//! (p + R·S)/(1 + R·Y). Pressures are relative to the bed's, so S is zero except for wounds and links, and every step
//! adds and divides positive numbers: nothing cancels, for any range of radii.
//!
//! # Wounds
//!
//! A cut or a clamp never changes a tree. It is an [`Interruption`] laid over it: the segment doesn't conduct, and each
//! of its ends is closed, or open to the outside through an [`Outlet`]. The flow of an open end results from the
//! network's resistance and the orifice's in series: with Δp from the node before it to the outside, R the resistance
//! of the piece between, C the discharge coefficient and A the open area,
//!
//! Δp = R·Q + K·Q², K = ρ/(2·C²·A²).
//!
//! The second term alone is the orifice law Q = C·A·√(2Δp/ρ), the first alone is Poiseuille's: the flow exceeds
//! neither, and is near the smaller one if they differ much. Nothing is drawn in from outside: if the pressure in the
//! vessel is lower, the end collapses. Ends that share vessels lower each other's pressure; `open_ends.rs` solves for
//! all of them together.
//!
//! # Cost
//!
//! A change of one segment updates only its path to the root. Pressures at open ends need no sweep over the tree,
//! either.
//!
//! Source: Poiseuille networks as in Pries et al. (1994) and Rauch & Harders (2021); the orifice law with the
//! coefficient of PMID 22166236.

pub mod bleeding;
pub mod blood_volume;
mod circuit;
mod closeness;
pub mod clotting;
mod demand;
mod error;
mod gaps;
mod gradients;
mod interruption;
pub mod ischaemia;
mod joined;
mod network;
mod open_ends;
mod quotient;
#[cfg(feature = "serialize")]
mod saved;
mod settings;
mod side;
mod skeleton;
mod solution;
mod star_mesh;
mod sweeps;
mod viscosity;
mod whole;

pub use bleeding::{Bleeding, BleedingChange, BleedingEnd, BleedingSettings, EndState};
pub use blood_volume::{BloodVolume, BloodVolumeSettings};
pub use clotting::Clotting;
pub use error::FlowError;
pub use interruption::{Interruption, Outlet};
pub use ischaemia::{Supply, TissueSupply};
pub use joined::Circulation;
pub use network::{Network, NetworkUpdate};
pub use open_ends::{EndSide, NetworkEnd};
pub use settings::{BedSettings, FlowSettings, Pulse, RootPressure};
pub use viscosity::{ViscosityLaw, relative_viscosity};
