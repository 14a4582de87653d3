//! Tissue: the part of space that vessels supply.
//!
//! A tissue gives four things: its size, whether it contains a point, its closest point to a given one, and random
//! attraction points. Points, normals and lengths are in the local space of the organ's mesh ("tissue lengths").
//!
//! | kind | what it is |
//! |---|---|
//! | [`shape`] | disc, rectangle, ball, box and ellipsoid, exactly |
//! | [`surface`] | the triangles of an organ's mesh |
//! | [`volume`] | what an organ's mesh encloses, voxelised |
//! | [`mask`] | the set pixels or voxels of an image |
//! | [`path`] | guides: polylines with a deviation |
//! | [`density`] | any of these, with regions of more or fewer vessels |
//! | [`no_go`] | any of these, with regions where no vessel may be |
//! | [`staged`] | several of these, one after the other |
//!
//! [`source`] describes, as data, where the tissue of an organ comes from: its mesh, a shape or an image. The slow work
//! is done once, and gives a [`PreparedTissue`]. [`paint`], which is also data, can be laid over that any number of
//! times.

pub mod density;
mod derived;
mod error;
pub mod growth;
pub mod mask;
mod mask_border;
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
pub(crate) mod web;

pub use density::{DensityField, DensityTissue};
pub use derived::Derived;
pub(crate) use derived::{Links, Web};
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

/// A flat piece of a tissue's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// The tissue's own number of it.
    pub number: u32,
    /// Its unit normal. Beside an edge it differs from the normal of the surface, which is smooth.
    pub normal: Vec3,
}

/// A point of a tissue, found from a point nearby.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TissuePoint {
    /// Its position, in tissue lengths.
    pub position: Vec3,
    /// Unit normal of the tissue's surface there; `Vec3::ZERO` inside a volume, where none is defined.
    pub normal: Vec3,
    /// The flat piece on which it lies, if the tissue is a surface made of such: directions at the point are those along
    /// it.
    pub facet: Option<Facet>,
}

impl TissuePoint {
    /// A point on no facet.
    pub const fn new(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal, facet: None }
    }
}

/// The dimension of a tissue, with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// A curve, of this length.
    Length(f32),
    /// A surface, of this area in square tissue lengths.
    Area(f32),
    /// A solid, of this volume in cubic tissue lengths.
    Volume(f32),
    /// A solid so thin for its width that usual spacings of vessels leave room for one layer of them.
    Sheet {
        /// Its volume in cubic tissue lengths.
        volume: f32,
        /// Its mean thickness in tissue lengths: twice the volume over the area of its surface.
        thickness: f32,
    },
}

impl Extent {
    /// Thickness below which a solid is a sheet, in diameters of the ball of the same volume: about the distance between
    /// drains in the paper's ball.
    pub const SHEET: f32 = 1.0 / 32.0;

    /// The extent of a solid with this volume and area of its surface.
    pub fn solid(volume: f32, area: f32) -> Self {
        let (whole, thickness) = (Self::Volume(volume), 2.0 * volume / area);
        if thickness < Self::SHEET * whole.equivalent_diameter() { Self::Sheet { volume, thickness } } else { whole }
    }

    /// Whether it is that of a solid, thick or thin.
    pub fn is_solid(self) -> bool {
        matches!(self, Self::Volume(_) | Self::Sheet { .. })
    }

    /// Diameter of the segment, disc or ball of the same size, in tissue lengths. A sheet takes as many vessels as a ball
    /// of this diameter, with the same distances between them.
    ///
    /// The settings of a preset are made for a tissue whose equivalent diameter is 1.
    pub fn equivalent_diameter(self) -> f32 {
        use std::f32::consts::PI;
        match self {
            Self::Length(length) => length,
            Self::Area(area) => 2.0 * (area / PI).sqrt(),
            Self::Volume(volume) => bevy_math::ops::cbrt(6.0 * volume / PI),
            // Points `s` apart are V/s³ in a ball and V/(t·s²) in a sheet: s² = s_ball³/t, with s = SHEET · d.
            Self::Sheet { volume, thickness } => {
                let ball = Self::Volume(volume).equivalent_diameter();
                ball * (Self::SHEET * ball / thickness).sqrt()
            }
        }
    }
}

/// The space that vessels supply.
pub trait Tissue: Debug + Send + Sync {
    /// The tissue whose shape this one keeps, with something laid over it; `None` for a tissue with a shape of its own.
    ///
    /// What is said of the shape, and what this tissue doesn't say itself, is then what that one says. Its samples are
    /// this tissue's own: a tissue that can be [cut](Self::cut) says so itself, as its pieces must be sampled alike.
    fn laid_over(&self) -> Option<&dyn Tissue> {
        None
    }

    /// A box that holds the whole tissue.
    fn bounds(&self) -> Aabb3d;

    /// Length, area or volume.
    fn extent(&self) -> Extent;

    /// Whether a point belongs to the tissue.
    ///
    /// A surface or a curve has no inside, so it contains points within a small tolerance. Every point from
    /// [`sample`](Self::sample) or [`closest_point`](Self::closest_point) is contained.
    fn contains(&self, point: Vec3) -> bool;

    /// The point of the tissue nearest to `point`: `point` itself if the tissue contains it.
    fn closest_point(&self, point: Vec3) -> TissuePoint;

    /// Whether points of the tissue lie on [facets](TissuePoint::facet).
    fn has_facets(&self) -> bool {
        self.laid_over().is_some_and(|tissue| tissue.has_facets())
    }

    /// Goes a `length` from a point of the tissue in a unit direction, keeping to the tissue. Calls `arrive` for each
    /// place where the way bends, then for its end.
    ///
    /// Straight lines between these places stay within `tolerance` of the way. On a bent surface, the way is straight
    /// along it, and may end early at its border; `arrive` is not called if there is no way in this direction. In other
    /// tissues, and from a point that lies on no [facet](TissuePoint::facet), the way doesn't bend, and ends at the point
    /// nearest to its straight end.
    fn walk(
        &self,
        from: &TissuePoint,
        direction: Vec3,
        length: f32,
        tolerance: f32,
        arrive: &mut dyn FnMut(TissuePoint),
    ) {
        match self.laid_over() {
            Some(tissue) => tissue.walk(from, direction, length, tolerance, arrive),
            None => arrive(self.closest_point(from.position + direction * length)),
        }
    }

    /// Distance of a point from the border of an area or a volume: positive inside, negative outside.
    ///
    /// It may be less than the distance, never more, and changes by no more than the way between two points. `None` for
    /// a tissue without an inside, such as a curved surface or a curve, and for one that doesn't know its border.
    fn depth(&self, point: Vec3) -> Option<f32> {
        self.laid_over().and_then(|tissue| tissue.depth(point))
    }

    /// Whether [`depth`](Self::depth) searches, so that a caller with many points should keep a grid of it.
    fn depth_is_searched(&self) -> bool {
        self.laid_over().is_some_and(|tissue| tissue.depth_is_searched())
    }

    /// Draws one candidate for an attraction point, uniformly by length, area or volume.
    ///
    /// `None` if this draw failed: it fell beside the tissue, its density field rejected it, or the tissue has no size.
    /// The caller still counts it as a sample.
    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3>;

    /// Relative density of attraction points or terminals at a point, from 0 to 1: the probability with which
    /// [`sample`](Self::sample) keeps it.
    fn density(&self, point: Vec3) -> f32 {
        self.laid_over().map_or(1.0, |tissue| tissue.density(point))
    }

    /// Whether [`density`](Self::density) is 1 everywhere.
    fn is_uniform(&self) -> bool {
        self.laid_over().is_none_or(|tissue| tissue.is_uniform())
    }

    /// Appends `count` candidates, less those that failed, as by `count` calls of [`sample`](Self::sample). A tissue
    /// may have a faster way to draw many.
    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        candidates.extend((0..count).filter_map(|_| self.sample(rng)));
    }

    /// Appends pieces that make up the whole tissue, each within a ball of radius `reach` if possible. Returns `false`,
    /// and appends nothing, for a tissue that cannot be cut.
    ///
    /// A growth can then draw candidates only from pieces that are not supplied. Pieces of equal measure are drawn from
    /// faster.
    fn cut(&self, _reach: f32, _pieces: &mut Vec<TissuePiece>) -> bool {
        false
    }

    /// The point of a piece from [`cut`](Self::cut) for this `reach`, chosen by three uniform numbers from 0 to below
    /// 1: distributed as the points of [`sample`](Self::sample) in the piece. `None` as there.
    fn point_of(&self, _reach: f32, _piece: [u32; 2], _numbers: [f32; 3]) -> Option<Vec3> {
        None
    }

    /// Where the tissue keeps what is derived from it and takes long: what starts of growths need to place roots. `None` for
    /// a tissue that keeps nothing; then each growth keeps its own.
    fn derived(&self) -> Option<&Derived> {
        None
    }

    /// The natural entrance of vessels to the tissue, if there is one: the beginning of a guide.
    fn entrance(&self) -> Option<Vec3> {
        self.laid_over().and_then(|tissue| tissue.entrance())
    }

    /// Where no vessel may be; `None` if vessels may be everywhere.
    ///
    /// [`sample`](Self::sample), [`draw`](Self::draw), [`point_of`](Self::point_of) and [`entrance`](Self::entrance)
    /// give no point that this forbids. A generator places no node there; [`closest_point`](Self::closest_point)
    /// ignores it.
    fn no_go(&self) -> Option<&NoGoField> {
        self.laid_over().and_then(|tissue| tissue.no_go())
    }

    /// The tissue that replaces this one at a growth step, counted from 1; `None` if this one stays.
    ///
    /// Only tissues that change in stages have one. For the tissue in force, call
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

    /// A position that is kept as it is, with the normal at the nearest point, and with its facet if the tissue contains
    /// it.
    pub(crate) fn point_at(&self, position: Vec3) -> TissuePoint {
        let closest = self.closest_point(position);
        let facet = closest.facet.filter(|_| self.contains(position));
        TissuePoint { position, facet, ..closest }
    }
}
