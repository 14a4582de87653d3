//! A voxel grid over a mesh: which voxels its surface touches, and which voxel centres it encloses.
//!
//! A closed mesh encloses every point a whole number of times, which a single ray tells: each triangle that it crosses
//! counts up or down, whatever shells the mesh consists of. Where a mesh is open, rays disagree. Then six vote, along the
//! axes both ways, and four must find a point enclosed: a sample of the generalised winding number (Jacobson, Kavan &
//! Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers", 2013).

use crate::synthesis::mesh::TriangleMesh;
use bevy_math::{DVec2, DVec3, Vec3, bounding::Aabb3d};

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
    /// Large triangles in numbers that fill space instead of surrounding it.
    #[error("the triangles touch the voxels in more than {limit} places; lower the resolution, or repair the mesh")]
    TooManyTouches {
        /// The largest number of places.
        limit: usize,
    },
}

/// Where the grid begins, in voxels before the mesh's box. Odd fractions, different along each axis, so that no voxel
/// centre lies in a face of a mesh whose sides are whole numbers of voxels.
const PADDING: DVec3 = DVec3::new(0.31, 0.37, 0.43);
/// What a triangle's surroundings are widened by against rounding, in voxels.
const SLACK: f64 = 1.0e-6;
/// Of six rays, how many must find a point enclosed.
pub(crate) const MAJORITY: u8 = 4;
/// Most pairs of a triangle and a voxel that it touches.
const MAX_TOUCHES: usize = 1 << 25;

/// What the rays from a point say.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Finding {
    /// How often the first ray finds the point enclosed.
    pub winding: i16,
    /// How many of six rays find it enclosed.
    votes: u8,
    /// How many of six rays find the same as the first.
    agreeing: u8,
}

impl Finding {
    /// Whether the point is inside.
    pub fn is_inside(self) -> bool {
        self.votes >= MAJORITY
    }

    /// Whether there is no doubt about the winding number.
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
        // So many that the last centre along each axis lies behind the mesh.
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

    /// A point in voxels from the grid's corner.
    pub fn local(&self, point: Vec3) -> DVec3 {
        (point.as_dvec3() - self.origin) / self.cell
    }

    /// The point that lies `local` voxels from the grid's corner.
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
    fn span(&self, axis: usize, min: f64, max: f64) -> std::ops::RangeInclusive<usize> {
        let last = self.size[axis] - 1;
        ((min - SLACK).max(0.0) as usize).min(last)..=((max + SLACK).max(0.0) as usize).min(last)
    }

    /// Every pair of a voxel and a triangle that touches it, in the order of the triangles.
    pub fn touches(&self, mesh: &TriangleMesh) -> Result<Vec<(u32, u32)>, VoxelError> {
        let mut pairs = Vec::new();
        for triangle in 0..mesh.triangles().len() {
            let corners = mesh.corners(triangle).map(|corner| self.local(corner));
            let (min, max) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
            let [xs, ys, zs] = [0, 1, 2].map(|axis| self.span(axis, min[axis], max[axis]));
            let single = xs.start() == xs.end() && ys.start() == ys.end() && zs.start() == zs.end();
            let slabs = if single { Vec::new() } else { slabs(corners) };
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        let center = DVec3::new(x as f64, y as f64, z as f64) + 0.5;
                        if slabs.iter().all(|slab| slab.holds(center)) {
                            pairs.push((self.number([x, y, z]) as u32, triangle as u32));
                        }
                    }
                }
            }
            if pairs.len() > MAX_TOUCHES {
                return Err(VoxelError::TooManyTouches { limit: MAX_TOUCHES });
            }
        }
        Ok(pairs)
    }

    /// What rays from the centre of every voxel say: for a closed mesh one each, for an open one six.
    pub fn findings(&self, mesh: &TriangleMesh, closed: bool) -> Vec<Finding> {
        let mut findings = vec![Finding::default(); self.len()];
        let axes = if closed { 1 } else { 3 };
        for axis in 0..axes {
            let steps = self.steps(mesh, axis);
            self.walk_columns(axis, &steps, |voxel, below, above| {
                let finding = &mut findings[voxel];
                if axis == 0 {
                    finding.winding = below;
                }
                for seen in [below, above] {
                    finding.votes += u8::from(seen != 0);
                    finding.agreeing += u8::from(seen == finding.winding);
                }
            });
        }
        for finding in &mut findings {
            finding.votes *= 3 / axes as u8;
            finding.agreeing *= 3 / axes as u8;
        }
        findings
    }

    /// Where the columns of voxel centres along an axis cross the mesh: at the first voxel behind each crossing the
    /// change of the winding number.
    fn steps(&self, mesh: &TriangleMesh, axis: usize) -> Vec<i16> {
        let mut steps = vec![0i16; self.len()];
        for triangle in 0..mesh.triangles().len() {
            self.cross_columns(mesh.corners(triangle), axis, &mut steps);
        }
        steps
    }

    /// Adds the crossings of one triangle.
    fn cross_columns(&self, corners: [Vec3; 3], axis: usize, steps: &mut [i16]) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let local = corners.map(|corner| self.local(corner) - 0.5);
        let flat = local.map(|corner| DVec2::new(corner[u], corner[v]));
        let (min, max) = (flat[0].min(flat[1]).min(flat[2]), flat[0].max(flat[1]).max(flat[2]));
        let range = |min: f64, max: f64, size: usize| {
            // Empty where the triangle lies between two centres.
            min.ceil().max(0.0) as usize..((max.floor() + 1.0).max(0.0) as usize).min(size)
        };
        for column_v in range(min.y, max.y, self.size[v]) {
            for column_u in range(min.x, max.x, self.size[u]) {
                let point = DVec2::new(column_u as f64, column_v as f64);
                let Some((facing, height)) = crossing(point, flat, local.map(|corner| corner[axis])) else { continue };
                let behind = height.ceil().max(0.0) as usize;
                let mut voxel = [0; 3];
                (voxel[u], voxel[v], voxel[axis]) = (column_u, column_v, behind.min(self.size[axis] - 1));
                // The grid reaches on behind the mesh; by rounding it might just not.
                if behind < self.size[axis] {
                    let step = &mut steps[self.number(voxel)];
                    *step = step.saturating_sub(facing);
                }
            }
        }
    }

    /// Visits every voxel with the windings that its centre sees along an axis, downwards and upwards.
    fn walk_columns(&self, axis: usize, steps: &[i16], mut visit: impl FnMut(usize, i16, i16)) {
        // Voxels side by side across the axis are `inner` apart along it.
        let inner: usize = self.size[..axis].iter().product();
        let slab = inner * self.size[axis];
        let mut total = vec![0i16; inner];
        let mut running = vec![0i16; inner];
        for (number, steps) in steps.chunks_exact(slab).enumerate() {
            total.fill(0);
            running.fill(0);
            for row in steps.chunks_exact(inner) {
                for (total, step) in total.iter_mut().zip(row) {
                    *total = total.saturating_add(*step);
                }
            }
            for (level, row) in steps.chunks_exact(inner).enumerate() {
                let first = number * slab + level * inner;
                for (place, ((running, total), step)) in running.iter_mut().zip(&total).zip(row).enumerate() {
                    *running = running.saturating_add(*step);
                    visit(first + place, *running, running.saturating_sub(*total));
                }
            }
        }
    }
}

/// Where the line through `point`, upright on the plane of `flat`, crosses a triangle: whether the triangle faces up (1)
/// or down (−1) there, and the height.
///
/// A line through an edge or a vertex counts as moved aside by an infinitesimal amount, the same for all triangles, so
/// that a closed surface is crossed once in each place.
pub(crate) fn crossing(point: DVec2, flat: [DVec2; 3], heights: [f64; 3]) -> Option<(i16, f64)> {
    let [a, b, c] = flat;
    // Twice the areas of the triangles between the point and the edges opposite a, b and c.
    let (areas_a, areas_b, areas_c) = (side(b, c, point), side(c, a, point), side(a, b, point));
    let facing = areas_a.1;
    if areas_b.1 != facing || areas_c.1 != facing {
        return None;
    }
    let area = areas_a.0 + areas_b.0 + areas_c.0;
    if area == 0.0 {
        return None;
    }
    let height = (areas_a.0 * heights[0] + areas_b.0 * heights[1] + areas_c.0 * heights[2]) / area;
    Some((facing, height))
}

/// Twice the signed area between a directed edge and a point, and the side of the edge on which the point is: 1 for left.
fn side(from: DVec2, to: DVec2, point: DVec2) -> (f64, i16) {
    // Always computed for the same direction of an edge, so that both of its triangles see the same rounding.
    let ordered = (from.x, from.y) < (to.x, to.y);
    let (low, high) = if ordered { (from, to) } else { (to, from) };
    let edge = high - low;
    let area = edge.perp_dot(point - low);
    // On the edge, the point counts as moved by (ε, ε²).
    let left = if area != 0.0 {
        area > 0.0
    } else if edge.y != 0.0 {
        edge.y < 0.0
    } else {
        edge.x > 0.0
    };
    let sign = if left == ordered { 1 } else { -1 };
    (if ordered { area } else { -area }, sign)
}

/// A direction in which a triangle and a voxel can be told apart: the triangle's extent, widened by that of a voxel.
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

/// All directions in which a triangle and a unit cube can be apart, but for the axes (Akenine-Möller, "Fast 3D
/// Triangle-Box Overlap Testing", 2001): the normal, and those across an edge and an axis.
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

/// One bit per voxel, and the number of bits set before each.
#[derive(Clone, Debug, Default)]
pub(crate) struct BitGrid {
    words: Vec<u64>,
    ranks: Vec<u32>,
}

impl BitGrid {
    /// A grid in which the given voxels are set.
    pub fn new(len: usize, set: impl Iterator<Item = usize>) -> Self {
        let mut words = vec![0u64; len.div_ceil(64)];
        for voxel in set {
            words[voxel / 64] |= 1 << (voxel % 64);
        }
        let mut before = 0;
        let ranks = words.iter().map(|word| {
            let rank = before;
            before += word.count_ones();
            rank
        });
        Self { ranks: ranks.collect(), words }
    }

    /// Whether a voxel is set.
    pub fn contains(&self, voxel: usize) -> bool {
        self.words[voxel / 64] >> (voxel % 64) & 1 == 1
    }

    /// How many voxels before this one are set.
    pub fn rank(&self, voxel: usize) -> usize {
        let below = self.words[voxel / 64] & ((1u64 << (voxel % 64)) - 1);
        self.ranks[voxel / 64] as usize + below.count_ones() as usize
    }

    /// The voxels that are set, in order.
    pub fn iter(&self) -> impl Iterator<Item = usize> {
        self.words.iter().enumerate().flat_map(|(index, &word)| {
            let mut left = word;
            std::iter::from_fn(move || {
                let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
                left &= left - 1;
                Some(index * 64 + bit)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::mesh::voxels::*;

    #[test]
    fn bits_are_counted_and_listed() {
        let set = [0usize, 1, 63, 64, 70, 129];
        let bits = BitGrid::new(130, set.into_iter());
        assert_eq!(bits.iter().collect::<Vec<_>>(), set);
        for (rank, voxel) in set.into_iter().enumerate() {
            assert!(bits.contains(voxel));
            assert_eq!(bits.rank(voxel), rank);
        }
        assert!(!bits.contains(2) && !bits.contains(128));
        assert_eq!(bits.rank(128), 5);
    }

    #[test]
    fn lines_through_edges_and_vertices_cross_once() {
        // A fan around the origin: each line must cross exactly one of its triangles.
        let around: Vec<DVec2> = [(2.0, 0.0), (2.0, 1.0), (0.0, 2.0), (-1.0, 0.0), (-1.0, -1.0), (0.0, -3.0)]
            .into_iter()
            .map(DVec2::from)
            .collect();
        for point in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-0.5, -0.5), (0.0, -1.5), (0.1, 0.2), (1.0, 0.5)] {
            let crossed = (0..around.len())
                .filter_map(|i| {
                    let fan = [DVec2::ZERO, around[i], around[(i + 1) % around.len()]];
                    crossing(point.into(), fan, [1.0; 3])
                })
                .collect::<Vec<_>>();
            assert_eq!(crossed.len(), 1, "at {point:?}");
            assert_eq!(crossed[0].0, 1);
        }
    }
}
