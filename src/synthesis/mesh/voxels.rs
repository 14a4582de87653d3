//! A voxel grid over a mesh: the voxels that its surface touches, and the voxel centres that it encloses.
//!
//! In a closed mesh, every point has an integer winding number, which a single ray gives: each triangle that it crosses
//! counts up or down, for any shells of the mesh. In an open mesh, rays disagree. Then six rays vote, along the axes in
//! both directions, and four must find a point enclosed: a sample of the generalised winding number (Jacobson, Kavan &
//! Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers", 2013).

use crate::synthesis::{
    mesh::{TriangleMesh, crossing::crossing},
    pace::{Pace, STRETCH, Stretch},
};
use bevy_math::{DVec2, DVec3, Vec3, bounding::Aabb3d};
use std::ops::{Range, RangeInclusive};

/// Why a mesh has no voxels.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum VoxelError {
    /// A voxel grid without voxels.
    #[error("the resolution is 0; it must be at least 1 voxel along the longest side, 128 is usual")]
    NoResolution,
    /// More voxels than fit into memory.
    #[error("a resolution of {resolution} takes {voxels} voxels, more than {}; lower it", Grid::MAX_VOXELS)]
    TooManyVoxels {
        /// Voxels along the longest side.
        resolution: u32,
        /// All voxels.
        voxels: f64,
    },
    /// Too many large triangles, which fill space instead of surrounding it.
    #[error("the triangles touch the voxels in more than {limit} places; lower the resolution, or repair the mesh")]
    TooManyTouches {
        /// The largest number of places.
        limit: usize,
    },
}

/// Margin of the grid before the mesh's box, in voxels. The fractions differ along each axis, so that no voxel centre
/// lies in a face of a mesh whose sides are whole numbers of voxels.
const PADDING: DVec3 = DVec3::new(0.31, 0.37, 0.43);
/// Margin around a triangle for rounding, in voxels.
const SLACK: f64 = 1.0e-6;
/// Number of rays, of six, that must find a point enclosed.
pub(crate) const MAJORITY: u8 = 4;
/// Cost of beginning a layer of a triangle, in voxels.
const LAYER: usize = 4;
/// Most pairs of a triangle and a voxel that it touches.
const MAX_TOUCHES: usize = 1 << 25;

/// The result of the rays from a point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Finding {
    /// Winding number of the point by the first ray.
    pub winding: i16,
    /// Number of rays, of six, that find it enclosed.
    votes: u8,
    /// Number of rays, of six, that agree with the first.
    agreeing: u8,
}

impl Finding {
    /// Whether the point is inside.
    pub fn is_inside(self) -> bool {
        self.votes >= MAJORITY
    }

    /// Whether the winding number is certain.
    pub fn is_unanimous(self) -> bool {
        self.agreeing == 6
    }
}

/// Cubic voxels over a box. A voxel's number counts along x first, then y, then z.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    origin: DVec3,
    cell: f64,
    size: [usize; 3],
}

impl Grid {
    /// Most voxels of a grid.
    pub const MAX_VOXELS: usize = 1 << 26;

    /// A grid with `resolution` voxels along the longest side of a box.
    pub fn over(bounds: &Aabb3d, resolution: u32) -> Result<Self, VoxelError> {
        if resolution == 0 {
            return Err(VoxelError::NoResolution);
        }
        let (min, max) = (Vec3::from(bounds.min).as_dvec3(), Vec3::from(bounds.max).as_dvec3());
        let cell = (max - min).max_element() / f64::from(resolution);
        // Enough that the last centre along each axis lies behind the mesh.
        let size = ((max - min) / cell + PADDING + 0.5).floor() + 1.0;
        let voxels = size.element_product();
        if voxels > Self::MAX_VOXELS as f64 {
            return Err(VoxelError::TooManyVoxels { resolution, voxels });
        }
        Ok(Self { origin: min - PADDING * cell, cell, size: size.to_array().map(|count| count as usize) })
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Length of a voxel's side.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Position of a point in voxels from the grid's corner.
    pub fn local(&self, point: Vec3) -> DVec3 {
        (point.as_dvec3() - self.origin) / self.cell
    }

    /// The point at `local` voxels from the grid's corner.
    pub fn global(&self, local: DVec3) -> Vec3 {
        (self.origin + local * self.cell).as_vec3()
    }

    /// The voxel around a local point.
    pub fn voxel(&self, local: DVec3) -> Option<usize> {
        let inside = local.cmpge(DVec3::ZERO).all() && (0..3).all(|axis| local[axis] < self.size[axis] as f64);
        inside.then(|| self.number(local.to_array().map(|value| value as usize)))
    }

    /// Lowest corner of a voxel, in local coordinates.
    pub fn corner(&self, voxel: usize) -> DVec3 {
        let [x, y, _] = self.size;
        DVec3::new((voxel % x) as f64, (voxel / x % y) as f64, (voxel / (x * y)) as f64)
    }

    fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// First and last voxel along an axis that an interval touches.
    fn span(&self, axis: usize, min: f64, max: f64) -> RangeInclusive<usize> {
        let last = self.size[axis] - 1;
        ((min - SLACK).max(0.0) as usize).min(last)..=((max + SLACK).max(0.0) as usize).min(last)
    }

    /// Every pair of a voxel and a triangle that touches it, in the order of the triangles.
    pub async fn touches(&self, mesh: &TriangleMesh, pace: &Pace) -> Result<Vec<(u32, u32)>, VoxelError> {
        let mut pairs = Vec::new();
        let mut stretch = Stretch::default();
        let count = mesh.triangles().len();
        for triangle in 0..count {
            let reach = self.reach(mesh.corners(triangle));
            for z in reach.spans[2].clone() {
                self.touch_layer(&reach, z, |voxel| pairs.push((voxel, triangle as u32)));
                if stretch.ends_after(LAYER + reach.layer()) {
                    pace.rest(triangle as f32 / count as f32).await;
                }
            }
            if pairs.len() > MAX_TOUCHES {
                return Err(VoxelError::TooManyTouches { limit: MAX_TOUCHES });
            }
        }
        Ok(pairs)
    }

    /// The voxels that a triangle may touch.
    fn reach(&self, corners: [Vec3; 3]) -> Reach {
        let corners = corners.map(|corner| self.local(corner));
        let (min, max) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        let spans = [0, 1, 2].map(|axis| self.span(axis, min[axis], max[axis]));
        let single = spans.iter().all(|span| span.start() == span.end());
        Reach { slabs: if single { Vec::new() } else { slabs(corners) }, spans }
    }

    /// Visits the voxels of a layer that a triangle touches.
    fn touch_layer(&self, reach: &Reach, z: usize, mut visit: impl FnMut(u32)) {
        let [xs, ys, _] = &reach.spans;
        for y in ys.clone() {
            for x in xs.clone() {
                let center = DVec3::new(x as f64, y as f64, z as f64) + 0.5;
                if reach.slabs.iter().all(|slab| slab.holds(center)) {
                    visit(self.number([x, y, z]) as u32);
                }
            }
        }
    }

    /// Findings at the centre of every voxel: by one ray each for a closed mesh, by six for an open one.
    pub async fn findings(&self, mesh: &TriangleMesh, closed: bool, pace: &Pace) -> Vec<Finding> {
        let mut findings = pace.part(0.0..0.1).collect(self.len(), |_| Finding::default()).await;
        let axes = if closed { 1 } else { 3 };
        for axis in 0..axes {
            let pace = pace.part(0.1 + 0.8 * axis as f32 / axes as f32..0.1 + 0.8 * (axis + 1) as f32 / axes as f32);
            let steps = self.steps(mesh, axis, &pace.part(0.0..0.4)).await;
            let see = |voxel: usize, below: i16, above: i16| {
                let finding = &mut findings[voxel];
                if axis == 0 {
                    finding.winding = below;
                }
                for seen in [below, above] {
                    finding.votes += u8::from(seen != 0);
                    finding.agreeing += u8::from(seen == finding.winding);
                }
            };
            self.walk_columns(axis, &steps, see, &pace.part(0.4..1.0)).await;
        }
        let scale = |stretch: Range<usize>| {
            for finding in &mut findings[stretch] {
                finding.votes *= 3 / axes as u8;
                finding.agreeing *= 3 / axes as u8;
            }
        };
        pace.part(0.9..1.0).stretches(self.len(), STRETCH, scale).await;
        findings
    }

    /// Crossings of the mesh with the columns of voxel centres along an axis: the change of the winding number, at the
    /// first voxel behind each crossing.
    async fn steps(&self, mesh: &TriangleMesh, axis: usize, pace: &Pace) -> Vec<i16> {
        let mut steps = vec![0i16; self.len()];
        let mut stretch = Stretch::default();
        let count = mesh.triangles().len();
        for triangle in 0..count {
            let columns = self.cross_columns(mesh.corners(triangle), axis, &mut steps);
            if stretch.ends_after(1 + columns) {
                pace.rest(triangle as f32 / count as f32).await;
            }
        }
        steps
    }

    /// Adds the crossings of one triangle. Returns the number of columns tested.
    fn cross_columns(&self, corners: [Vec3; 3], axis: usize, steps: &mut [i16]) -> usize {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let local = corners.map(|corner| self.local(corner) - 0.5);
        let flat = local.map(|corner| DVec2::new(corner[u], corner[v]));
        let (min, max) = (flat[0].min(flat[1]).min(flat[2]), flat[0].max(flat[1]).max(flat[2]));
        let range = |min: f64, max: f64, size: usize| {
            // Empty if the triangle lies between two centres.
            min.ceil().max(0.0) as usize..((max.floor() + 1.0).max(0.0) as usize).min(size)
        };
        let (columns_u, columns_v) = (range(min.x, max.x, self.size[u]), range(min.y, max.y, self.size[v]));
        for column_v in columns_v.clone() {
            for column_u in columns_u.clone() {
                let point = DVec2::new(column_u as f64, column_v as f64);
                let Some((facing, height)) = crossing(point, flat, local.map(|corner| corner[axis])) else { continue };
                let behind = height.ceil().max(0.0) as usize;
                let mut voxel = [0; 3];
                (voxel[u], voxel[v], voxel[axis]) = (column_u, column_v, behind.min(self.size[axis] - 1));
                // The grid extends behind the mesh, but rounding might prevent this.
                if behind < self.size[axis] {
                    let step = &mut steps[self.number(voxel)];
                    *step = step.saturating_sub(facing);
                }
            }
        }
        columns_u.len() * columns_v.len()
    }

    /// Visits every voxel with the winding numbers of its centre along an axis, downwards and upwards.
    async fn walk_columns(&self, axis: usize, steps: &[i16], mut visit: impl FnMut(usize, i16, i16), pace: &Pace) {
        // Neighbours along the axis are `inner` apart in the list.
        let inner: usize = self.size[..axis].iter().product();
        let slab = inner * self.size[axis];
        // Rows between two rests.
        let some = inner * (STRETCH / inner).max(1);
        let mut stretch = Stretch::default();
        let mut total = vec![0i16; inner];
        let mut running = vec![0i16; inner];
        for (number, steps) in steps.chunks_exact(slab).enumerate() {
            let done = (number * slab) as f32 / self.len() as f32;
            total.fill(0);
            running.fill(0);
            for rows in steps.chunks(some) {
                for row in rows.chunks_exact(inner) {
                    for (total, step) in total.iter_mut().zip(row) {
                        *total = total.saturating_add(*step);
                    }
                }
                if stretch.ends_after(rows.len()) {
                    pace.rest(done).await;
                }
            }
            let mut first = number * slab;
            for rows in steps.chunks(some) {
                for row in rows.chunks_exact(inner) {
                    for (place, ((running, total), step)) in running.iter_mut().zip(&total).zip(row).enumerate() {
                        *running = running.saturating_add(*step);
                        visit(first + place, *running, running.saturating_sub(*total));
                    }
                    first += inner;
                }
                if stretch.ends_after(rows.len()) {
                    pace.rest(done).await;
                }
            }
        }
    }
}

/// The voxels around a triangle.
struct Reach {
    spans: [RangeInclusive<usize>; 3],
    /// Tests that separate voxels from the triangle; empty for a single voxel.
    slabs: Vec<Slab>,
}

impl Reach {
    /// Number of voxels in a layer.
    fn layer(&self) -> usize {
        self.spans[..2].iter().map(|span| span.end() - span.start() + 1).product()
    }
}

/// A direction that can separate a triangle from a voxel, with the triangle's extent widened by that of a voxel.
struct Slab {
    axis: DVec3,
    min: f64,
    max: f64,
}

impl Slab {
    fn holds(&self, center: DVec3) -> bool {
        let at = self.axis.dot(center);
        self.min <= at && at <= self.max
    }
}

/// All separating directions of a triangle and a unit cube except the axes (Akenine-Möller, "Fast 3D Triangle-Box
/// Overlap Testing", 2001): the normal, and those perpendicular to an edge and an axis.
fn slabs(corners: [DVec3; 3]) -> Vec<Slab> {
    let edges = [corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]];
    let across = edges.into_iter().flat_map(|edge| DVec3::AXES.map(|axis| axis.cross(edge)));
    std::iter::once(edges[0].cross(edges[1]))
        .chain(across)
        .map(|axis| {
            let [a, b, c] = corners.map(|corner| axis.dot(corner));
            let reach = axis.abs().element_sum() * (0.5 + SLACK);
            Slab { axis, min: a.min(b).min(c) - reach, max: a.max(b).max(c) + reach }
        })
        .collect()
}
