//! Paint: what is laid over the tissue of an organ, as data. Where more vessels grow and where fewer, where none may be, and
//! along which lines large ones are led.
//!
//! [`PreparedTissue::painted`](super::PreparedTissue::painted) lays it over a tissue that has been prepared, which is cheap:
//! a stroke of a brush prepares nothing again.

use super::{GuidePath, NoGoRegion, TissueError, no_go::NoGoField};
use crate::synthesis::{mesh::IndexedMesh, pace::Pace};
use bevy_math::Vec3;

/// What is laid over the tissue of an organ. The default is nothing.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct TissuePaint {
    /// Probability with which attraction points are kept, at every vertex of the mesh, and between them in proportion.
    /// Guides are not concerned.
    ///
    /// Higher values make for more vessels.
    ///
    /// Limits: one value per vertex; those outside 0 to 1 are clamped. Only for tissues made of a mesh. Default: 1 everywhere.
    pub density: Option<Vec<f32>>,
    /// Where no vessel may be.
    ///
    /// Default: nowhere.
    pub no_go: NoGo,
    /// Lines along which large vessels are led before the rest grows. They keep to the surface, or to the inside where
    /// vessels grow through it from the start.
    ///
    /// Default: none.
    pub guides: Vec<Guide>,
}

impl TissuePaint {
    /// Whether it changes nothing.
    pub fn is_blank(&self) -> bool {
        self.density.is_none() && self.no_go.is_empty() && self.guides.is_empty()
    }

    /// Whether some of it is painted on the vertices of a mesh.
    pub(super) fn is_on_vertices(&self) -> bool {
        self.density.is_some() || self.no_go.vertices.is_some()
    }

    /// How much work it is to lay it over a tissue that has been prepared, in items: vertices, and pieces of guides.
    pub fn work(&self) -> usize {
        /// A value costs a small part of what an item of other work does.
        const VALUES_OF_AN_ITEM: usize = 16;
        let vertices = [self.density.as_ref().map(Vec::len), self.no_go.vertices.as_ref().map(Vec::len)];
        let values: usize = vertices.into_iter().flatten().sum();
        let guides: usize = self.guides.iter().map(|guide| GuidePath::work(guide.points.len())).sum();
        values / VALUES_OF_AN_ITEM + guides
    }
}

/// Where no vessel may be: no attraction point is drawn there, no root put, no node placed, along guides neither.
///
/// Vessels find their way round, and supply the other side if tissue leads there. A region narrower than half a step may
/// still be crossed by a segment between two nodes outside it. Nodes of a given tree stay where they are. Tissue that is
/// forbidden as a whole has no place for a root, which is an error; vessels of a given tree don't grow there.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct NoGo {
    /// Which vertices of the mesh are painted. Between a painted and a free one the line is halfway; what lies below
    /// painted surface is forbidden, too.
    ///
    /// Limits: one entry per vertex. Only for tissues made of a mesh. Default: none.
    pub vertices: Option<Vec<bool>>,
    /// Balls and boxes.
    ///
    /// Default: none.
    pub regions: Vec<NoGoRegion>,
}

impl NoGo {
    /// Whether nothing is forbidden.
    pub fn is_empty(&self) -> bool {
        self.regions.is_empty() && self.vertices.as_ref().is_none_or(|vertices| !vertices.contains(&true))
    }

    /// The field of these regions, `None` where nothing is forbidden. `mesh` is asked for where vertices are painted.
    pub(super) async fn field<'a>(
        &self,
        mesh: impl FnOnce() -> Result<&'a IndexedMesh, TissueError>,
        pace: &Pace,
    ) -> Result<Option<NoGoField>, TissueError> {
        let mut field = NoGoField::regions(self.regions.iter().copied())?;
        if let Some(painted) = &self.vertices {
            field = field.or(NoGoField::on_vertices_paced(mesh()?, painted, pace).await?);
        }
        Ok((!self.is_empty()).then_some(field))
    }
}

/// A line along which large vessels are led.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Guide {
    /// Its points in order. They are brought to the nearest points of the tissue. A root that is put automatically is put
    /// at the first.
    ///
    /// Units: tissue lengths, in the organ's local space. Limits: at least 2.
    pub points: Vec<Vec3>,
    /// How far from the line attraction points are drawn.
    ///
    /// Higher values make for more vessels along the guide, and more wayward ones.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: 0.
    pub deviation: f32,
    /// Steps for which attraction points are drawn along this guide only. Guides follow each other.
    ///
    /// Too few leave the guide's end without a vessel: about its length over the step length is right.
    ///
    /// Default: [`Self::DEFAULT_STEPS`].
    pub steps: u32,
}

impl Guide {
    /// Steps along a guide.
    pub const DEFAULT_STEPS: u32 = 20;
}

impl Default for Guide {
    fn default() -> Self {
        Self { points: Vec::new(), deviation: 0.0, steps: Self::DEFAULT_STEPS }
    }
}
