//! Procedural organs by name.

use super::{Failure, Options};
use bevy_vessels::synthesis::{
    mesh::{ShadedMesh, TriangleMesh},
    organ::{ColonSettings, EyeSettings, KidneySettings, LiverSettings, OrganSettingsError, RootSites},
    preset::{Preset, PresetName},
    roots::{RootPlacement, RootPlacements},
    tissue::TissueMode,
};
use std::path::Path;

/// A procedural organ, in metres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Procedural {
    Colon,
    Eye,
    Kidney,
    Liver,
}

impl Procedural {
    /// The organ that `--tissue` names, if any.
    pub fn named(tissue: &Path) -> Option<Self> {
        match tissue.to_str()? {
            "colon" => Some(Self::Colon),
            "eye" => Some(Self::Eye),
            "kidney" => Some(Self::Kidney),
            "liver" => Some(Self::Liver),
            _ => None,
        }
    }

    /// The seed of the organ that `--tissue` names, if any.
    pub fn seed(options: &Options) -> Option<u64> {
        Self::named(&options.tissue).map(|_| options.organ_seed.unwrap_or(0))
    }

    /// The preset that is made for it.
    pub fn preset(self) -> PresetName {
        match self {
            Self::Colon => PresetName::Colon,
            Self::Eye => PresetName::Conjunctiva,
            Self::Kidney => PresetName::Kidney,
            Self::Liver => PresetName::Liver,
        }
    }

    /// The organ of `--organ-seed` as the mesh for a mode. Vessels of a built-in preset get their roots where they enter
    /// it; kinds that the preset leaves out stay out.
    pub fn make(self, options: &Options, mode: TissueMode, preset: &mut Preset) -> Result<TriangleMesh, Failure> {
        let (mesh, sites) = self.parts(options, mode).map_err(Failure::usage)?;
        if options.settings.is_none() {
            let own = RootPlacements::from(&sites);
            let roots = &mut preset.roots;
            for (placed, own) in [
                (&mut roots.artery, own.artery),
                (&mut roots.vein, own.vein),
                (&mut roots.portal_vein, own.portal_vein),
                (&mut roots.duct, own.duct),
            ] {
                if *placed != RootPlacement::None && own != RootPlacement::None {
                    *placed = own;
                }
            }
        }
        mesh.triangle_mesh().map_err(Failure::run)
    }

    /// On a surface that is the side on which vessels are seen: the outside of a colon, the white of an eye.
    fn parts(self, options: &Options, mode: TissueMode) -> Result<(ShadedMesh, RootSites), OrganSettingsError> {
        let (seed, is_surface) = (options.organ_seed.unwrap_or(0), mode == TissueMode::Surface);
        Ok(match self {
            Self::Colon if mode == TissueMode::Lining => {
                let colon = ColonSettings { seed, ..ColonSettings::default() }.generate()?;
                (colon.mesh.part(colon.inner), colon.inner_roots)
            }
            Self::Colon => {
                let colon = ColonSettings { seed, ..ColonSettings::default() }.generate()?;
                (if is_surface { colon.mesh.part(colon.outer) } else { colon.mesh }, colon.roots)
            }
            Self::Eye => {
                let eye = EyeSettings { seed, ..EyeSettings::default() }.generate()?;
                match options.preset {
                    Some(PresetName::Retina) => (eye.globe, eye.retinal_roots),
                    _ if is_surface => (eye.globe.part(eye.conjunctiva), eye.roots),
                    _ => (eye.globe, eye.roots),
                }
            }
            Self::Kidney => {
                let kidney = KidneySettings { seed, ..KidneySettings::default() }.generate()?;
                (kidney.mesh, kidney.roots)
            }
            Self::Liver => {
                let liver = LiverSettings { seed, ..LiverSettings::default() }.generate()?;
                (liver.mesh, liver.roots)
            }
        })
    }
}
