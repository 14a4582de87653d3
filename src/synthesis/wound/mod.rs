//! Wounds: what cuts open, how it bleeds and stops, and what tissue it leaves without blood.
//!
//! A wound never changes a tree. It is laid over it, as the interruptions of a
//! [`Network`](super::haemodynamics::Network).

pub mod bleeding;
pub mod blood_volume;
pub mod clotting;
pub mod ischaemia;

pub use bleeding::{Bleeding, BleedingChange, BleedingEnd, BleedingSettings, EndState};
pub use blood_volume::{BloodVolume, BloodVolumeSettings};
pub use clotting::Clotting;
pub use ischaemia::{Supply, TissueSupply};
