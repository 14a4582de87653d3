//! Where vessels enter the tissue. To be written.

use crate::synthesis::tree::VesselTree;
use bevy_math::Vec3;

/// Where the roots of one system are put.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum RootPlacement {
    /// No root: this system does not grow.
    None,
    /// This many roots, spread over the tissue, chosen by the seed.
    Spread(u32),
    /// One root beside each of the other system's, a step length away.
    #[default]
    Beside,
    /// The tissue's nearest point to each of these.
    Nearest(Vec<Vec3>),
    /// Exactly these points.
    Exact(Vec<Vec3>),
}

/// How both systems begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Roots {
    /// Roots of the arteries.
    pub arterial: RootPlacement,
    /// Roots of the veins.
    pub venous: RootPlacement,
    /// Trees to go on growing from, beside the roots: arterial, venous.
    pub given: [Option<VesselTree>; 2],
}

/// Why roots could not be placed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RootError {}

impl Roots {
    /// Resolves.
    pub fn resolve(
        &self,
        _tissue: &dyn crate::synthesis::tissue::Tissue,
        _settings: &crate::synthesis::colonization::ColonizationSettings,
        _seed: u64,
    ) -> Result<[Vec<crate::synthesis::tissue::TissuePoint>; 2], RootError> {
        let f = |p: &RootPlacement| match p {
            RootPlacement::Exact(v) => v
                .iter()
                .map(|&position| crate::synthesis::tissue::TissuePoint { position, normal: Vec3::ZERO })
                .collect(),
            _ => vec![],
        };
        Ok([f(&self.arterial), f(&self.venous)])
    }
}
