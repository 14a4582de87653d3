//! One layer of a recipe.

use crate::synthesis::{
    preset::Preset,
    texture::VesselLook,
    tissue::{DensityField, DensityTissue, MeshSurface, Tissue, TissueError},
};
use std::sync::Arc;

/// One layer of a recipe: one tree, or several of the same kind, grown apart from all others.
#[derive(Clone, Debug, PartialEq)]
pub struct RecipeLayer {
    /// What kind of vessels they are, for a person: `episcleral artery 3`.
    pub name: String,
    /// Generator and roots. Lengths are those of the organ as it is: nothing is fitted.
    pub preset: Preset,
    /// How much of the tissue grows these vessels: from 0 to 1 for each vertex of the surface that the recipe is for.
    pub density: Vec<f32>,
    /// Seed of the growth.
    pub seed: u64,
    /// How they look in a texture.
    pub look: VesselLook,
}

impl RecipeLayer {
    /// The tissue of this layer: the recipe's surface, with the layer's density.
    ///
    /// # Errors
    /// A surface with another number of vertices than the one that the recipe is for.
    pub fn tissue(&self, surface: &Arc<MeshSurface>) -> Result<Arc<dyn Tissue>, TissueError> {
        let field = DensityField::on_indexed(surface.indexed(), &self.density)?;
        Ok(Arc::new(DensityTissue::new(Arc::clone(surface) as _, field)?))
    }
}
