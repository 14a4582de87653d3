//! The vessels that a user asks for on an organ.
//!
//! An organ is an entity with a [`Vasculature`], and a mesh or an image unless its tissue is a plain shape. The plugin
//! adds everything else. Each kind of vessels that has roots gets one vessel entity, a child of the organ, which carries
//! the whole tree in [`Vessels`](crate::plugin::Vessels).

use crate::plugin::{
    growth::{
        progress::{GrowthControl, GrowthProgress},
        state::GrowthState,
    },
    vessels::appearance::VesselAppearance,
};
use crate::synthesis::{
    generator::Generator,
    preset::{OrganBlood, Preset, PresetName},
    roots::RootPlacements,
    tissue::TissueSource,
};
use bevy::{
    camera::visibility::Visibility,
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
    transform::components::Transform,
};

/// The vessels to grow on an organ. Put it beside the organ's `Mesh3d`; if its [`tissue`](Self::tissue) is an image,
/// beside an [`OrganImage`](crate::plugin::OrganImage). A plain shape needs neither.
///
/// Changing any field that vessels depend on starts the growth again. The slow part, preparing the tissue, is repeated
/// only if [`tissue`](Self::tissue), the mesh or the image changed; all organs with the same mesh and tissue share one.
/// Roots that the seed chooses are placed in a job, and until then the old vessels stay. Removing the component removes
/// the vessels.
///
/// With [`fit`](Self::fit) off, all lengths are in the local space of the mesh. With `fit` on, they are shares of the
/// organ's size.
///
/// ```
/// # use bevy_vessels::{plugin::Vasculature, synthesis::preset::PresetName};
/// let vasculature = Vasculature::new(PresetName::Colon).with_seed(7);
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(GrowthState, GrowthProgress, GrowthControl, VesselAppearance, Transform, Visibility)]
pub struct Vasculature {
    /// Chooses one of the many networks that the same settings can give. The same seed gives the same network, on any
    /// machine and at any frame rate.
    ///
    /// Default: 0.
    pub seed: u64,
    /// The generator of the vessels, with its settings. Default: that of [`PresetName::Paper`].
    pub generator: Generator,
    /// Where vessels enter the organ, in the local space of its mesh.
    pub roots: RootPlacements,
    /// The tissue to supply: the surface of the organ's mesh, its inside or both; a plain shape; or what an image
    /// shows.
    pub tissue: TissueSource,
    /// Whether to fit the lengths of the [`generator`](Self::generator) to this organ ([`Generator::fit`]). They must
    /// be made for a tissue of equivalent diameter 1, as those of all presets are.
    ///
    /// If off, they are lengths in the mesh's local space. Default: true.
    pub fit: bool,
    /// The blood of an organ of this kind, as its preset knows it: what a [`Perfusion`](crate::plugin::Perfusion) that
    /// doesn't say otherwise lets through, and the size of the organ.
    ///
    /// Changing it leaves the vessels as they are. Default: unknown.
    pub blood: Option<OrganBlood>,
}

impl Vasculature {
    /// The vessels of a named preset, with seed 0, fitted to the organ.
    pub fn new(preset: PresetName) -> Self {
        Self::from_preset(preset.load())
    }

    /// The vessels of a preset, such as one read from a file, with seed 0, fitted to the organ.
    pub fn from_preset(preset: Preset) -> Self {
        let Preset { version: _, source: _, fit, tissue, roots, generator, blood } = preset;
        Self { seed: 0, generator, roots, tissue, fit, blood }
    }

    /// Chooses another network.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Uses another generator or other settings, with the same tissue and roots.
    #[must_use]
    pub fn with_generator(mut self, generator: impl Into<Generator>) -> Self {
        self.generator = generator.into();
        self
    }

    /// Grows on another tissue: another [mode](crate::synthesis::tissue::TissueMode) of the mesh, a shape, an image.
    #[must_use]
    pub fn with_tissue(mut self, tissue: impl Into<TissueSource>) -> Self {
        self.tissue = tissue.into();
        self
    }

    /// Puts the roots elsewhere.
    #[must_use]
    pub fn with_roots(mut self, roots: RootPlacements) -> Self {
        self.roots = roots;
        self
    }
}

/// The preset of these vessels, without the seed: for a file.
impl From<&Vasculature> for Preset {
    fn from(vasculature: &Vasculature) -> Self {
        let Vasculature { seed: _, generator, roots, tissue, fit, blood } = vasculature.clone();
        Self { fit, tissue, roots, generator, blood, ..Self::default() }
    }
}

impl Default for Vasculature {
    fn default() -> Self {
        Self::new(PresetName::Paper)
    }
}
