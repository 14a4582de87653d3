//! To be written.
use super::VesselTree;

/// A broken invariant of a tree.
#[derive(Debug, thiserror::Error)]
pub enum TreeError {}

impl VesselTree {
    /// Checks every invariant.
    pub fn validate(&self) -> Result<(), TreeError> {
        Ok(())
    }
}
