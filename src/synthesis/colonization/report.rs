//! What a step did, in numbers.

/// What one step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u32,
    /// Candidates drawn from the tissue.
    pub sampled: u32,
    /// Candidates that became oxygen drains.
    pub born: u32,
    /// What the arteries did.
    pub arterial: SystemReport,
    /// What the veins did.
    pub venous: SystemReport,
}

/// What one step did to one system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SystemReport {
    /// Nodes before the step: the first new node's index.
    pub first_new_node: u32,
    /// Nodes that were added.
    pub new_nodes: u32,
    /// Drains that were supplied and removed.
    pub supplied: u32,
    /// Drains that are left.
    pub drains_left: u32,
}
