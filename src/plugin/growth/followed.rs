//! The inputs of a growth (an organ's [`Vasculature`], paint and assets), and the work that a change of them needs.

use crate::plugin::organ::image::OrganImage;
use crate::synthesis::{
    preset::Preset,
    tissue::{TissuePaint, TissueSource},
};
use bevy::{
    asset::AssetId,
    image::Image,
    mesh::{Mesh, Mesh3d},
};
use std::sync::Arc;

/// Work to do before an organ can grow on. Each variant includes those before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Need {
    /// Nothing.
    #[default]
    Nothing,
    /// Lay the new paint over the tissue, and grow successors there.
    Paint,
    /// Grow with other settings or another seed, on the same tissue: from the roots, or as successors.
    Settings,
    /// Start the growth again, on the same tissue.
    Growth,
    /// Prepare the tissue, then start the growth.
    Tissue,
}

/// The assets that a tissue may be made from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct SourceAssets {
    pub(crate) mesh: Option<AssetId<Mesh>>,
    pub(crate) image: Option<AssetId<Image>>,
}

impl SourceAssets {
    /// The assets of an organ.
    pub(crate) fn of(mesh: Option<&Mesh3d>, image: Option<&OrganImage>) -> Self {
        Self { mesh: mesh.map(|mesh| mesh.id()), image: image.map(|image| image.id()) }
    }

    /// The assets that a source needs.
    pub(crate) fn needed_by(self, source: &TissueSource) -> Self {
        Self { mesh: self.mesh.filter(|_| source.needs_mesh()), image: self.image.filter(|_| source.image().is_some()) }
    }
}

/// The inputs that a growth follows, or is about to.
#[derive(Clone, Debug)]
pub(crate) struct Followed {
    /// The settings of the organ's [`Vasculature`](crate::plugin::Vasculature), without its seed.
    pub(crate) settings: Preset,
    pub(crate) seed: u64,
    pub(crate) paint: Arc<TissuePaint>,
    pub(crate) assets: SourceAssets,
}

impl Followed {
    /// The work needed to follow other inputs.
    pub(crate) fn need(&self, settings: &Preset, seed: u64, paint: &TissuePaint, assets: SourceAssets) -> Need {
        let needed = |assets: SourceAssets| assets.needed_by(&settings.tissue);
        if self.settings.tissue != settings.tissue || needed(self.assets) != needed(assets) {
            Need::Tissue
        } else if self.settings != *settings || self.seed != seed {
            Need::Settings
        } else if *self.paint != *paint {
            Need::Paint
        } else {
            Need::Nothing
        }
    }

    /// Whether the tissue is made from this mesh asset.
    pub(crate) fn is_of_mesh(&self, mesh: AssetId<Mesh>) -> bool {
        self.assets.needed_by(&self.settings.tissue).mesh == Some(mesh)
    }

    /// Whether the tissue is made from this image asset.
    pub(crate) fn is_of_image(&self, image: AssetId<Image>) -> bool {
        self.assets.needed_by(&self.settings.tissue).image == Some(image)
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::growth::followed::*;
    use crate::synthesis::{
        preset::PresetName,
        tissue::{TissueMode, TissueShape},
    };

    const MESH: SourceAssets = SourceAssets { mesh: Some(AssetId::invalid()), image: None };

    fn following(tissue: impl Into<TissueSource>) -> Followed {
        let settings = Preset { tissue: tissue.into(), ..PresetName::Paper.load() };
        Followed { settings, seed: 0, paint: Arc::default(), assets: MESH }
    }

    #[test]
    fn only_sources_and_what_they_are_made_of_need_a_new_tissue() {
        let (followed, blank) = (following(TissueMode::Surface), TissuePaint::default());
        let same = followed.settings.clone();
        assert_eq!(followed.need(&same, 0, &blank, MESH), Need::Nothing);
        assert_eq!(followed.need(&same, 0, &blank, SourceAssets::default()), Need::Tissue);
        assert_eq!(followed.need(&same, 1, &blank, MESH), Need::Settings);
        assert_eq!(followed.need(&following(TissueMode::Volume).settings, 0, &blank, MESH), Need::Tissue);
        let unfitted = Preset { fit: false, ..same.clone() };
        assert_eq!(followed.need(&unfitted, 0, &blank, MESH), Need::Settings);
        let painted = TissuePaint { density: Some(vec![1.0]), ..blank };
        assert_eq!(followed.need(&same, 0, &painted, MESH), Need::Paint);
        assert_eq!(followed.need(&same, 1, &painted, MESH), Need::Settings);
    }

    #[test]
    fn assets_that_a_source_does_not_need_make_no_difference() {
        let (ball, blank) = (following(TissueShape::ball(1.0)), TissuePaint::default());
        assert_eq!(ball.need(&ball.settings, 0, &blank, SourceAssets::default()), Need::Nothing);
        assert!(!ball.is_of_mesh(AssetId::invalid()));
        assert!(following(TissueMode::Surface).is_of_mesh(AssetId::invalid()));
    }
}
