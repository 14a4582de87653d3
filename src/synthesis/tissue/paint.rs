//! Paint over the tissue of an organ, as data: where more or fewer vessels grow, where none may be, and guide lines for
//! large ones.
//!
//! [`PreparedTissue::painted`](super::PreparedTissue::painted) lays it over a prepared tissue, which is cheap: a brush
//! stroke prepares nothing again.

use super::{GuidePath, NoGoRegion, TissueError, no_go::NoGoField};
use crate::synthesis::{mesh::IndexedMesh, pace::Pace};
use bevy_math::Vec3;

/// The paint over the tissue of an organ. The default is blank.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct TissuePaint {
    /// Probability with which attraction points are kept, at every vertex of the mesh, interpolated in between. Guides
    /// are not affected.
    ///
    /// Higher values give more vessels.
    ///
    /// Limits: one value per vertex; those outside 0 to 1 are clamped. Only for tissues made from a mesh. Default: 1
    /// everywhere.
    pub density: Option<Vec<f32>>,
    /// Where no vessel may be.
    ///
    /// Default: nowhere.
    pub no_go: NoGo,
    /// Lines along which large vessels grow before the rest. They keep to the surface, or to the inside if vessels grow
    /// through it from the start.
    ///
    /// Default: none.
    pub guides: Vec<Guide>,
}

impl TissuePaint {
    /// Whether this is blank.
    pub fn is_blank(&self) -> bool {
        self.density.is_none() && self.no_go.is_empty() && self.guides.is_empty()
    }

    /// Whether any of it is on the vertices of a mesh.
    pub(super) fn is_on_vertices(&self) -> bool {
        self.density.is_some() || self.no_go.vertices.is_some()
    }

    /// Work of laying it over a prepared tissue, in items: vertices, and pieces of guides.
    pub fn work(&self) -> usize {
        /// A value costs a small part of an item of other work.
        const VALUES_OF_AN_ITEM: usize = 16;
        let vertices = [self.density.as_ref().map(Vec::len), self.no_go.vertices.as_ref().map(Vec::len)];
        let values: usize = vertices.into_iter().flatten().sum();
        let guides: usize = self.guides.iter().map(|guide| GuidePath::work(guide.points.len())).sum();
        values / VALUES_OF_AN_ITEM + guides
    }
}

/// Where no vessel may be: no attraction point, root or node is placed there, not even along guides.
///
/// Vessels grow around it, and supply the other side if tissue leads there. A segment between two nodes outside may
/// still cross a region narrower than half a step. Nodes of a given tree stay where they are. If the whole tissue is
/// forbidden, roots have no place, which is an error; vessels of a given tree don't grow there.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct NoGo {
    /// Which vertices of the mesh are painted. The boundary is halfway between a painted and a free one. Tissue below
    /// painted surface is forbidden, too.
    ///
    /// Limits: one entry per vertex. Only for tissues made from a mesh. Default: none.
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

    /// The field of these regions, `None` if nothing is forbidden. `mesh` is only called if vertices are painted.
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

/// A guide line for large vessels.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Guide {
    /// Its points in order. They are moved to the nearest points of the tissue. An automatic root is placed at the
    /// first.
    ///
    /// Units: tissue lengths, in the organ's local space. Limits: at least 2.
    pub points: Vec<Vec3>,
    /// Distance from the line within which attraction points are drawn.
    ///
    /// Higher values give more vessels along the guide, which follow it less closely.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: 0.
    pub deviation: f32,
    /// Steps for which attraction points are drawn along this guide only. Guides follow each other.
    ///
    /// With too few, no vessel reaches the guide's end. A good value is its length divided by the step length.
    ///
    /// Default: [`Self::DEFAULT_STEPS`].
    pub steps: u32,
}

impl Guide {
    /// Default of [`steps`](Self::steps).
    pub const DEFAULT_STEPS: u32 = 20;
}

impl Default for Guide {
    fn default() -> Self {
        Self { points: Vec::new(), deviation: 0.0, steps: Self::DEFAULT_STEPS }
    }
}
