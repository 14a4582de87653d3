//! Masks: the set pixels of an image, or the set voxels of a volume image, as a tissue.

use crate::synthesis::random::VesselRng;
use crate::synthesis::{
    mesh::bit_grid::BitGrid,
    pace::{Pace, Stretch, at_once},
    space::bvh::{Bounds, BoxTree},
    tissue::{
        Derived, Extent, Tissue, TissuePoint,
        error::{TissueError, finite_point, positive},
        mask_border::MaskBorder,
    },
};
use bevy_math::{UVec2, UVec3, Vec2, Vec3, Vec3A, bounding::Aabb3d};
use rand::RngExt;
use std::sync::OnceLock;

/// Distance within which a point counts as part of a cell, as a share of the cell's longest side.
const TOLERANCE: f32 = 1.0e-4;

/// Cells of a regular grid, set or not.
///
/// Cells are listed along x first, then y, then z, each axis upwards: flip an image whose first row is its top. Every
/// set cell belongs to the tissue as a whole, as a rectangle or a box.
#[derive(Clone, Debug)]
pub struct Mask {
    size: [usize; 3],
    spacing: Vec3,
    origin: Vec3,
    /// Whether it is an image, which lies in the plane of its origin.
    flat: bool,
    cells: BitGrid,
    /// The set cells as a list.
    set: Vec<u32>,
    /// Runs of set cells along x, in the order of the index over them.
    runs: Vec<Bounds>,
    index: BoxTree,
    bounds: Bounds,
    /// Made when the first depth is asked for, since only some generators need it.
    border: OnceLock<MaskBorder>,
    derived: Derived,
}

impl Mask {
    /// Most cells of a mask.
    pub const MAX_CELLS: usize = 1 << 30;

    /// The set pixels of an image of `size` pixels, each `spacing` wide and high.
    ///
    /// `origin` is the lowest corner of the first pixel. The image lies in the plane z = `origin.z` and faces up.
    ///
    /// # Errors
    /// A list without exactly one entry per pixel, or without a set pixel; a spacing that is not above 0; coordinates
    /// that are not finite.
    pub fn image(size: UVec2, spacing: Vec2, origin: Vec3, inside: &[bool]) -> Result<Self, TissueError> {
        at_once(Self::image_paced(size, spacing, origin, inside, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`image`](Self::image).
    pub async fn image_paced(
        size: UVec2,
        spacing: Vec2,
        origin: Vec3,
        inside: &[bool],
        pace: &Pace,
    ) -> Result<Self, TissueError> {
        // The thickness of a pixel doesn't matter.
        Self::new(size.extend(1), [spacing.extend(1.0), origin], inside, true, pace).await
    }

    /// The pixels of a grey image that are at least `threshold`. See [`image`](Self::image).
    ///
    /// # Errors
    /// Those of [`image`](Self::image).
    pub fn image_from_grey(
        size: UVec2,
        spacing: Vec2,
        origin: Vec3,
        grey: &[u8],
        threshold: u8,
    ) -> Result<Self, TissueError> {
        Self::image(size, spacing, origin, &above(grey, threshold))
    }

    /// The set voxels of a volume image of `size` voxels, each as large as `spacing`.
    ///
    /// `origin` is the lowest corner of the first voxel.
    ///
    /// # Errors
    /// A list without exactly one entry per voxel, or without a set voxel; a spacing that is not above 0; coordinates
    /// that are not finite.
    pub fn voxels(size: UVec3, spacing: Vec3, origin: Vec3, inside: &[bool]) -> Result<Self, TissueError> {
        at_once(Self::voxels_paced(size, spacing, origin, inside, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`voxels`](Self::voxels).
    pub async fn voxels_paced(
        size: UVec3,
        spacing: Vec3,
        origin: Vec3,
        inside: &[bool],
        pace: &Pace,
    ) -> Result<Self, TissueError> {
        Self::new(size, [spacing, origin], inside, false, pace).await
    }

    /// The voxels of a grey volume image that are at least `threshold`. See [`voxels`](Self::voxels).
    ///
    /// # Errors
    /// Those of [`voxels`](Self::voxels).
    pub fn voxels_from_grey(
        size: UVec3,
        spacing: Vec3,
        origin: Vec3,
        grey: &[u8],
        threshold: u8,
    ) -> Result<Self, TissueError> {
        Self::voxels(size, spacing, origin, &above(grey, threshold))
    }

    async fn new(
        size: UVec3,
        [spacing, origin]: [Vec3; 2],
        inside: &[bool],
        flat: bool,
        pace: &Pace,
    ) -> Result<Self, TissueError> {
        let size = size.to_array().map(|count| count as usize);
        let expected = size[0].saturating_mul(size[1]).saturating_mul(size[2]);
        if expected != inside.len() || expected > Self::MAX_CELLS {
            return Err(TissueError::MaskSize { size, cells: inside.len(), limit: Self::MAX_CELLS });
        }
        for side in spacing.to_array() {
            positive("the spacing of the mask", side)?;
        }
        finite_point("the origin of the mask", origin)?;
        finite_point(
            "the far corner of the mask",
            origin + spacing * Vec3::from_array(size.map(|count| count as f32)),
        )?;
        let is_set = |cell: usize| inside[cell].then_some(cell);
        let cells = BitGrid::new(expected, expected, is_set, &pace.part(0.0..0.3)).await;
        let set = cells.list(&pace.part(0.3..0.5)).await;
        let mut mask = Self {
            size,
            spacing,
            origin,
            flat,
            cells,
            set,
            runs: Vec::new(),
            index: BoxTree::default(),
            bounds: Bounds::EMPTY,
            border: OnceLock::new(),
            derived: Derived::default(),
        };
        if mask.set.is_empty() {
            return Err(TissueError::EmptyMask);
        }
        let (runs, bounds) = mask.list_runs(&pace.part(0.5..0.6)).await;
        mask.bounds = bounds;
        mask.index = BoxTree::new_paced(runs.len(), |run| runs[run], &pace.part(0.6..0.95)).await;
        let run = |slot: usize| runs[mask.index.order()[slot] as usize];
        mask.runs = pace.part(0.95..1.0).collect(runs.len(), run).await;
        Ok(mask)
    }

    /// Number of set cells.
    pub fn set_cells(&self) -> usize {
        self.set.len()
    }

    /// Runs of set cells along x, and the box around all of them.
    async fn list_runs(&self, pace: &Pace) -> (Vec<Bounds>, Bounds) {
        let mut bounds = Bounds::EMPTY;
        let goes_on = |a: u32, b: u32| b == a + 1 && !(b as usize).is_multiple_of(self.size[0]);
        // Full capacity, since growing a list copies it without a rest.
        let mut count = 1;
        let compare = |pair: usize| count += usize::from(!goes_on(self.set[pair], self.set[pair + 1]));
        pace.part(0.0..0.3).each(self.set.len() - 1, compare).await;
        let pace = pace.part(0.3..1.0);
        let (mut runs, mut stretch, mut done) = (Vec::with_capacity(count), Stretch::default(), 0);
        for run in self.set.chunk_by(|&a, &b| goes_on(a, b)) {
            let min = self.corner(run[0] as usize, Vec3::ZERO);
            let max = self.corner(run[run.len() - 1] as usize, Vec3::ONE);
            let run_bounds = Bounds { min: min.into(), max: max.into() };
            bounds = bounds.with(run_bounds);
            runs.push(run_bounds);
            done += run.len();
            if stretch.ends_after(run.len()) {
                pace.rest(done as f32 / self.set.len() as f32).await;
            }
        }
        (runs, bounds)
    }

    /// The point at a position within a cell, from 0 to 1 along each axis.
    fn corner(&self, cell: usize, within: Vec3) -> Vec3 {
        let [x, y, _] = self.size;
        let first = Vec3::new((cell % x) as f32, (cell / x % y) as f32, (cell / (x * y)) as f32);
        let point = self.origin + self.spacing * (first + within);
        if self.flat { point.with_z(self.origin.z) } else { point }
    }

    /// The cell around a point, at any height over an image.
    fn cell(&self, point: Vec3) -> Option<usize> {
        let local = (point - self.origin) / self.spacing;
        let local = if self.flat { local.with_z(0.0) } else { local };
        let inside = local.cmpge(Vec3::ZERO).all() && (0..3).all(|axis| local[axis] < self.size[axis] as f32);
        let [x, y, z] = local.to_array().map(|value| value as usize);
        inside.then_some((z * self.size[1] + y) * self.size[0] + x).filter(|&cell| cell < self.size.iter().product())
    }

    fn tolerance(&self) -> f32 {
        let spacing = if self.flat { self.spacing.truncate().max_element() } else { self.spacing.max_element() };
        // Far from the origin, rounding exceeds that.
        let rounding = f32::EPSILON * self.bounds.min.abs().max(self.bounds.max.abs()).max_element();
        (TOLERANCE * spacing).max(4.0 * rounding)
    }

    /// The nearest point of all set cells.
    fn nearest(&self, point: Vec3, limit: f32) -> Option<Vec3> {
        let point = Vec3A::from(point);
        let mut found = None;
        self.index.nearest(point.into(), limit * limit, |slot, best| {
            let candidate = point.clamp(self.runs[slot].min, self.runs[slot].max);
            let distance = candidate.distance_squared(point);
            if distance < best || found.is_none() && distance <= best {
                found = Some(candidate.into());
                return distance;
            }
            best
        });
        found
    }
}

impl Tissue for Mask {
    fn bounds(&self) -> Aabb3d {
        Aabb3d { min: self.bounds.min, max: self.bounds.max }
    }

    fn derived(&self) -> Option<&Derived> {
        Some(&self.derived)
    }

    fn extent(&self) -> Extent {
        let cells = self.set.len() as f32;
        if self.flat {
            Extent::Area(cells * self.spacing.x * self.spacing.y)
        } else {
            Extent::Volume(cells * self.spacing.element_product())
        }
    }

    fn contains(&self, point: Vec3) -> bool {
        let tolerance = self.tolerance();
        let in_plane = !self.flat || (point.z - self.origin.z).abs() <= tolerance;
        in_plane
            && (self.cell(point).is_some_and(|cell| self.cells.contains(cell))
                || self.nearest(point, tolerance).is_some())
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        let inside = !self.flat && self.contains(point);
        let position =
            if inside || !point.is_finite() { point } else { self.nearest(point, f32::INFINITY).unwrap_or(point) };
        TissuePoint::new(position, if self.flat { Vec3::Z } else { Vec3::ZERO })
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        let border = self.border.get_or_init(|| {
            let axes = if self.flat { 2 } else { 3 };
            let (is_set, corner) = (|cell| self.cells.contains(cell), |cell, within| self.corner(cell, within));
            MaskBorder::new(self.size, axes, &self.set, is_set, corner)
        });
        let point = if self.flat { point.with_z(self.origin.z) } else { point };
        let distance = border.distance(point);
        let is_inside = self.cell(point).is_some_and(|cell| self.cells.contains(cell));
        Some(if is_inside { distance } else { -distance })
    }

    fn depth_is_searched(&self) -> bool {
        true
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        let cell = self.set[rng.random_range(0..self.set.len() as u32) as usize];
        let (x, y) = (rng.random(), rng.random());
        let z = if self.flat { 0.0 } else { rng.random() };
        Some(self.corner(cell as usize, Vec3::new(x, y, z)))
    }
}

fn above(grey: &[u8], threshold: u8) -> Vec<bool> {
    grey.iter().map(|&value| value >= threshold).collect()
}
