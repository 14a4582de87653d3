//! Bleeding over time: the loss of each open end, until it stops.
//!
//! In: a [`Network`](super::Network) with its interruptions, and the blood of the patient. Out: for every open end its
//! flow, pressure, velocity, loss and state; the loss of the organ; ends that began or stopped bleeding.
//!
//! A step evaluates openings, root and bed pressure at its middle, solves for the flow of all ends together and keeps
//! it for the whole step. This is second order in the step, and the loss is exactly the time integral of the reported
//! flow. A long step is divided into shorter ones, so that a fast pulse is followed and a simulator may skip minutes.
//! So is one in which much of the patient's blood flows. Blood that isn't there doesn't flow: the last part of a step gives
//! what is left, whatever drives it.

mod end;
mod settings;
mod state;
mod step;

pub use end::{BleedingChange, BleedingEnd, EndState};
pub use settings::BleedingSettings;
pub use state::Bleeding;
