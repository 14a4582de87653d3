//! Tissue: the part of space that vessels supply.
//!
//! A tissue answers four questions: how large it is, whether a point belongs to it, which of its points is closest to a
//! given one, and where the next attraction point is drawn. Points, normals and lengths are in the local space of the
//! organ's mesh ("tissue lengths").
//!
//! | kind | what it is |
//! |---|---|
//! | [`shape`] | disc, rectangle, ball, box and ellipsoid, exactly |
//! | [`surface`] | the triangles of an organ's mesh |
//! | [`volume`] | what an organ's mesh encloses, voxelised |
//! | [`mask`] | the set pixels or voxels of an image |
//! | [`path`] | guides: polylines with a deviation |
//! | [`density`] | any of these, with regions that ask for more or fewer vessels |
//! | [`no_go`] | any of these, with regions where no vessel may be |
//! | [`staged`] | one after the other |
//!
//! [`source`] says as data where the tissue of an organ comes from: its mesh, a shape or an image. What takes long is done
//! once, and gives a [`PreparedTissue`]; [`paint`], which is data too, is laid over that as often as one likes.

pub mod density;
mod error;
pub mod growth;
pub mod mask;
pub mod no_go;
pub mod paint;
pub mod path;
mod pieces;
mod prepared;
pub mod shape;
pub mod source;
pub mod staged;
pub mod surface;
pub mod volume;

pub use density::{DensityField, DensityTissue};
pub use error::TissueError;
pub use growth::TissueGrowth;
pub use mask::Mask;
pub use no_go::{NoGoField, NoGoRegion, NoGoTissue};
pub use paint::{Guide, NoGo, TissuePaint};
pub use path::GuidePath;
pub use pieces::TissuePiece;
pub use prepared::PreparedTissue;
pub use shape::{Ball, Cuboid, Disc, Ellipsoid, Rectangle};
pub use source::{
    ImageChannel, ImageTissue, MeshTissue, SourceData, TissueImage, TissueMode, TissueShape, TissueSource,
};
pub use staged::Staged;
pub use surface::MeshSurface;
pub use volume::MeshVolume;

use crate::synthesis::random::VesselRng;
use bevy_math::{Vec3, bounding::Aabb3d};
use std::fmt::Debug;

/// A point of a tissue, found from a point nearby.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TissuePoint {
    /// Where it is, in tissue lengths.
    pub position: Vec3,
    /// Unit normal of the tissue's surface there; `Vec3::ZERO` inside a volume, where none is defined.
    pub normal: Vec3,
}

/// How many dimensions a tissue extends in, with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// A curve, of this length.
    Length(f32),
    /// A surface, of this area in square tissue lengths.
    Area(f32),
    /// A solid, of this volume in cubic tissue lengths.
    Volume(f32),
}

impl Extent {
    /// Diameter of the segment, disc or ball of the same size, in tissue lengths.
    ///
    /// The settings of a preset are made for a tissue whose equivalent diameter is 1.
    pub fn equivalent_diameter(self) -> f32 {
        use std::f32::consts::PI;
        match self {
            Self::Length(length) => length,
            Self::Area(area) => 2.0 * (area / PI).sqrt(),
            Self::Volume(volume) => bevy_math::ops::cbrt(6.0 * volume / PI),
        }
    }
}

/// Space that vessels grow to supply.
pub trait Tissue: Debug + Send + Sync {
    /// A box that holds the whole tissue.
    fn bounds(&self) -> Aabb3d;

    /// Length, area or volume.
    fn extent(&self) -> Extent;

    /// Whether a point belongs to the tissue.
    ///
    /// A surface or a curve has no inside: for it this is true within a small tolerance. Every point that
    /// [`sample`](Self::sample) or [`closest_point`](Self::closest_point) gives is contained.
    fn contains(&self, point: Vec3) -> bool;

    /// The point of the tissue nearest to `point`: `point` itself where the tissue contains it.
    fn closest_point(&self, point: Vec3) -> TissuePoint;

    /// Draws one candidate for an attraction point, uniformly by length, area or volume.
    ///
    /// `None` when this draw fell on nothing: beside the tissue, on a spot that its density field turned down, or on a
    /// tissue of no size. The caller counts it as a sample all the same.
    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3>;

    /// Appends `count` candidates, less those that fell on nothing: as many calls of [`sample`](Self::sample), unless the
    /// tissue knows a faster way to draw many.
    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        candidates.extend((0..count).filter_map(|_| self.sample(rng)));
    }

    /// Appends pieces that make up the whole tissue, none of them larger than a ball of radius `reach`, as far as that can be
    /// arranged. `false`, and nothing appended, for a tissue that cannot be cut.
    ///
    /// A growth that knows which pieces are supplied draws its candidates from the others. Pieces of equal measure are drawn
    /// from faster.
    fn cut(&self, _reach: f32, _pieces: &mut Vec<TissuePiece>) -> bool {
        false
    }

    /// The point that three even numbers from 0 to below 1 choose from a piece that [`cut`](Self::cut) gave for this `reach`:
    /// uniformly, as [`sample`](Self::sample) would among those of its points that fall into the piece. `None` as there.
    fn point_of(&self, _reach: f32, _piece: [u32; 2], _numbers: [f32; 3]) -> Option<Vec3> {
        None
    }

    /// Where vessels enter the tissue of themselves, if there is such a place: the beginning of a guide.
    fn entrance(&self) -> Option<Vec3> {
        None
    }

    /// Where no vessel may be; `None` where vessels may be everywhere, so that nothing has to be asked.
    ///
    /// [`sample`](Self::sample), [`draw`](Self::draw), [`point_of`](Self::point_of) and [`entrance`](Self::entrance) give no
    /// point that this forbids. A generator places no node there; [`closest_point`](Self::closest_point) doesn't know of it.
    fn no_go(&self) -> Option<&NoGoField> {
        None
    }

    /// The tissue that takes the place of this one at a growth step, counted from 1; `None` where this one stays.
    ///
    /// Only tissues that change in stages have one. To ask for the tissue in force, call
    /// [`at_step`](trait@Tissue#method.at_step), which every `dyn Tissue` has.
    fn stage(&self, _step: u32) -> Option<&dyn Tissue> {
        None
    }
}

impl dyn Tissue + '_ {
    /// The tissue in force at a growth step, counted from 1: itself, unless it changes in [stages](Tissue::stage).
    pub fn at_step(&self, step: u32) -> &dyn Tissue {
        self.stage(step).unwrap_or(self)
    }
}
