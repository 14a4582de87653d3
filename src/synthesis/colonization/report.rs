//! Reports of steps.

/// Report of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u32,
    /// Candidates drawn from the tissue.
    pub sampled: u32,
    /// Candidates that became oxygen drains.
    pub born: u32,
    /// Report of the arteries.
    pub arterial: SystemReport,
    /// Report of the veins.
    pub venous: SystemReport,
}

/// Report of one step of one system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SystemReport {
    /// Nodes before the step: the first new node's index.
    pub first_new_node: u32,
    /// Number of new nodes.
    pub new_nodes: u32,
    /// Number of drains that were supplied and removed.
    pub supplied: u32,
    /// Number of remaining drains.
    pub drains_left: u32,
}
