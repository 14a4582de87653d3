//! The inputs of a growth (an organ's [`Vasculature`], paint and assets), and the work that a change of them needs.

use crate::plugin::growth::vasculature::Vasculature;
use crate::synthesis::tissue::{TissuePaint, TissueSource};
use bevy::{asset::AssetId, image::Image, mesh::Mesh};
use std::sync::Arc;

/// Work to do before an organ can grow on. Each variant includes those before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Need {
    /// Nothing.
    #[default]
    Nothing,
    /// Lay the new paint over the tissue, and grow successors there.
    Paint,
    /// Start the growth again, on the same tissue.
    Growth,
    /// Prepare the tissue, then start the growth.
    Tissue,
}

/// The assets that a tissue may be made from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SourceAssets {
    pub(crate) mesh: Option<AssetId<Mesh>>,
    pub(crate) image: Option<AssetId<Image>>,
}

impl SourceAssets {
    /// The assets that a source needs.
    fn needed_by(self, source: &TissueSource) -> Self {
        Self { mesh: self.mesh.filter(|_| source.needs_mesh()), image: self.image.filter(|_| source.image().is_some()) }
    }
}

/// The inputs that a growth follows, or is about to.
#[derive(Clone, Debug)]
pub(crate) struct Followed {
    pub(crate) wish: Vasculature,
    pub(crate) paint: Arc<TissuePaint>,
    pub(crate) assets: SourceAssets,
}

impl Followed {
    /// The work needed to follow other inputs.
    pub(crate) fn need(&self, wish: &Vasculature, paint: &TissuePaint, assets: SourceAssets) -> Need {
        let needed = |assets: SourceAssets| assets.needed_by(&wish.tissue);
        if self.wish.tissue != wish.tissue || needed(self.assets) != needed(assets) {
            Need::Tissue
        } else if self.wish != *wish {
            Need::Growth
        } else if *self.paint != *paint {
            Need::Paint
        } else {
            Need::Nothing
        }
    }

    /// Whether the tissue is made from this mesh asset.
    pub(crate) fn is_of_mesh(&self, mesh: AssetId<Mesh>) -> bool {
        self.assets.needed_by(&self.wish.tissue).mesh == Some(mesh)
    }

    /// Whether the tissue is made from this image asset.
    pub(crate) fn is_of_image(&self, image: AssetId<Image>) -> bool {
        self.assets.needed_by(&self.wish.tissue).image == Some(image)
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::growth::followed::*;
    use crate::synthesis::tissue::{TissueMode, TissueShape};

    const MESH: SourceAssets = SourceAssets { mesh: Some(AssetId::invalid()), image: None };

    fn following(wish: &Vasculature) -> Followed {
        Followed { wish: wish.clone(), paint: Arc::default(), assets: MESH }
    }

    #[test]
    fn only_sources_and_what_they_are_made_of_need_a_new_tissue() {
        let (old, blank) = (Vasculature::default(), TissuePaint::default());
        let followed = following(&old);
        assert_eq!(followed.need(&old, &blank, MESH), Need::Nothing);
        assert_eq!(followed.need(&old, &blank, SourceAssets::default()), Need::Tissue);
        assert_eq!(followed.need(&old.clone().with_seed(1), &blank, MESH), Need::Growth);
        assert_eq!(followed.need(&old.clone().with_tissue(TissueMode::Volume), &blank, MESH), Need::Tissue);
        let unfitted = Vasculature { fit: false, ..old.clone() };
        assert_eq!(followed.need(&unfitted, &blank, MESH), Need::Growth);
        let painted = TissuePaint { density: Some(vec![1.0]), ..blank };
        assert_eq!(followed.need(&old, &painted, MESH), Need::Paint);
        assert_eq!(followed.need(&old.with_seed(1), &painted, MESH), Need::Growth);
    }

    #[test]
    fn assets_that_a_source_does_not_need_make_no_difference() {
        let (shape, blank) = (Vasculature::default().with_tissue(TissueShape::ball(1.0)), TissuePaint::default());
        let followed = following(&shape);
        assert_eq!(followed.need(&shape, &blank, SourceAssets::default()), Need::Nothing);
        assert!(
            !followed.is_of_mesh(AssetId::invalid())
                && following(&Vasculature::default()).is_of_mesh(AssetId::invalid())
        );
    }
}
