//! To be written.
pub mod settings;

pub use settings::{AngleSpread, ColonizationSettings, SettingsError, SettingsWarning, SystemSettings};

use crate::synthesis::{
    roots::Roots,
    tissue::Tissue,
    tree::{System, VesselTree},
};
use bevy_math::Vec3;
use std::sync::Arc;

/// What one step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u32,
    /// Candidates drawn from the tissue.
    pub sampled: u32,
    /// Candidates that became oxygen drains.
    pub born: u32,
    /// What the arteries did, and the veins.
    pub systems: [SystemReport; 2],
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

/// Why growth could not start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GrowthError {
    /// A setting outside its limits.
    #[error(transparent)]
    Settings(#[from] SettingsError),
}

/// A growth under way.
#[derive(Debug)]
pub struct Growth {
    settings: ColonizationSettings,
    trees: [VesselTree; 2],
}

impl Growth {
    /// Prepares a growth. Settings are in the tissue's lengths: see [`ColonizationSettings::fit`].
    pub fn new(
        _tissue: Arc<dyn Tissue>,
        settings: ColonizationSettings,
        _roots: &Roots,
        _seed: u64,
    ) -> Result<Self, GrowthError> {
        settings.validate()?;
        Ok(Self { settings, trees: Default::default() })
    }
    /// Starts again, keeping buffers.
    pub fn restart(&mut self, _settings: ColonizationSettings, _roots: &Roots, _seed: u64) -> Result<(), GrowthError> {
        Ok(())
    }
    /// One step.
    pub fn step(&mut self) -> StepReport {
        StepReport::default()
    }
    /// All remaining steps.
    pub fn run(&mut self) {
        while !self.is_finished() {
            self.step();
        }
    }
    /// Whether all steps are done.
    pub fn is_finished(&self) -> bool {
        true
    }
    /// Steps done so far.
    pub fn steps_done(&self) -> u32 {
        0
    }
    /// The settings in force.
    pub fn settings(&self) -> &ColonizationSettings {
        &self.settings
    }
    /// Centre lines, on the tissue.
    pub fn tree(&self, system: System) -> &VesselTree {
        &self.trees[system.index()]
    }
    /// Surface normal of the tissue at every node of `tree(system)`, zero in a volume.
    pub fn normals(&self, _system: System) -> &[Vec3] {
        &[]
    }
    /// The step in which each node was born, 0 for roots.
    pub fn birth_steps(&self, _system: System) -> &[u32] {
        &[]
    }
    /// Nodes, new ones included, whose radius changed in the last step.
    pub fn changed_radii(&self, _system: System) -> &[u32] {
        &[]
    }
    /// Living drains of a system.
    pub fn drains(&self, _system: System) -> usize {
        0
    }
    /// The finished product: centre lines lifted off a surface by their radius when `stand_off` says so.
    pub fn vessels(&self, system: System) -> VesselTree {
        self.trees[system.index()].clone()
    }
}
