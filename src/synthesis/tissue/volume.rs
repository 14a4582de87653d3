//! The inside of an organ's mesh as a tissue.
//!
//! The mesh is voxelised once. Voxels that its surface does not touch are inside or outside as a whole. In the others
//! the mesh itself decides: a point is on the same side as the voxel's centre if the triangles between them cancel out.
//! If an open mesh leaves the centre uncertain, six rays from the point vote. So the boundary is that of the mesh, not
//! that of the voxels.
//!
//! The inside is where the winding number is not zero. That tolerates duplicated vertices, small holes, overlapping and
//! nested shells, and triangles that face the wrong way.

use crate::synthesis::{
    mesh::{
        TriangleIndex, TriangleMesh,
        bit_grid::BitGrid,
        crossing::crossing,
        voxels::{Finding, Grid, MAJORITY},
        winding::oriented,
    },
    pace::{Pace, SHORT_STRETCH, at_once},
    random::VesselRng,
    space::bvh::Bounds,
    tissue::{
        Derived, Extent, Tissue, TissuePoint,
        error::{TissueError, rounding_within},
    },
};
use bevy_math::{DVec2, DVec3, Vec3, bounding::Aabb3d};
use rand::RngExt;
use std::ops::Range;

/// Steps whose multiples fill the unit cube uniformly: powers of 1/g, where g⁴ = g + 1 (Roberts, "The Unreasonable
/// Effectiveness of Quasirandom Sequences", 2018).
const EVEN_STEPS: DVec3 = DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_2);

/// The space that a mesh encloses.
#[derive(Clone, Debug)]
pub struct MeshVolume {
    grid: Grid,
    index: TriangleIndex,
    bounds: Aabb3d,
    volume: f32,
    /// Whether the mesh is closed.
    closed: bool,
    /// Corners of every triangle.
    corners: Vec<[Vec3; 3]>,
    /// Voxels that are inside as a whole.
    inside: BitGrid,
    /// The same voxels as a list.
    whole: Vec<u32>,
    /// Voxels that the surface touches.
    touched: BitGrid,
    /// The data of each touched voxel, in order, and one more entry for the end of the last.
    cells: Vec<Cell>,
    /// Triangles in the touched voxels, voxel by voxel.
    triangles: Vec<u32>,
    derived: Derived,
}

/// A voxel that the surface touches.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    voxel: u32,
    /// Its first triangle.
    first: u32,
    /// Winding number of its centre.
    winding: i16,
    /// Whether that is certain, so that points of the voxel can be compared with the centre.
    certain: bool,
}

impl MeshVolume {
    /// Default number of voxels along the longest side of the mesh's box.
    pub const DEFAULT_RESOLUTION: u32 = 128;

    /// Points in the touched voxels that measure the volume.
    const PROBES: usize = 1 << 16;
    /// Most draws for a sample. More than a tenth of the space of the sampled voxels is inside.
    const TRIES: u32 = 128;
    /// Depths to which a point is brought inside, in voxels: the first that is inside is used.
    const DEPTHS: [f64; 6] = [0.01, 0.05, 0.2, 0.5, 0.001, 0.0001];
    /// Voxels around a point in which it is searched for the inside where no direction leads in, along each axis and way.
    const AROUND: i32 = 3;
    /// Points that are tried along each side of one of these.
    const SIEVE: i32 = 4;
    /// Least share of the voxels that are inside or touched which the inside must fill: with less, samples miss it.
    const LEAST_SHARE: f64 = 1.0 / 128.0;

    /// Voxelises a mesh with `resolution` voxels along the longest side of its box.
    ///
    /// More voxels take more memory and make drawing samples a little faster; the boundary is that of the mesh at any
    /// resolution. Holes in the mesh are closed best when they are smaller than the organ is thick.
    ///
    /// # Errors
    /// [`TissueError::Voxels`] for a resolution that cannot be used with this mesh, [`TissueError::NoInside`] for a
    /// mesh that encloses nothing.
    pub fn new(mesh: &TriangleMesh, resolution: u32) -> Result<Self, TissueError> {
        at_once(Self::new_paced(mesh, resolution, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(mesh: &TriangleMesh, resolution: u32, pace: &Pace) -> Result<Self, TissueError> {
        let bounds = mesh.bounds_paced(&pace.part(0.0..0.01)).await;
        rounding_within(&bounds)?;
        let grid = Grid::over(&bounds, resolution)?;
        let mesh = mesh.welded_paced(&pace.part(0.01..0.1)).await;
        let index = TriangleIndex::new_paced(&mesh, &pace.part(0.1..0.25)).await;
        let (mesh, loose) = oriented(mesh, &index, &pace.part(0.25..0.4)).await;
        let closed = !loose.contains(&true);
        let touches = grid.touches(&mesh, &pace.part(0.4..0.55)).await?;
        let findings = grid.findings(&mesh, closed, &pace.part(0.55..0.75)).await;
        let touched = |touch: usize| Some(touches[touch].0 as usize);
        let touched = BitGrid::new(grid.len(), touches.len(), touched, &pace.part(0.75..0.77)).await;
        let enclosed = |voxel: usize| (findings[voxel].is_inside() && !touched.contains(voxel)).then_some(voxel);
        let inside = BitGrid::new(grid.len(), grid.len(), enclosed, &pace.part(0.77..0.8)).await;
        let (cells, triangles) = cells(&touched, &touches, &findings, &loose, &pace.part(0.8..0.85)).await;
        let corners = pace.part(0.85..0.86).collect(mesh.triangles().len(), |triangle| mesh.corners(triangle)).await;
        let mut volume = Self {
            whole: inside.list(&pace.part(0.86..0.88)).await,
            corners,
            bounds: mesh.bounds_paced(&pace.part(0.88..0.89)).await,
            volume: 0.0,
            closed,
            grid,
            index,
            inside,
            touched,
            cells,
            triangles,
            derived: Derived::default(),
        };
        volume.volume = volume.measure(&pace.part(0.89..1.0)).await;
        let voxels = (volume.whole.len() + volume.touched_voxels()) as f64 * volume.grid.cell().powi(3);
        let share = f64::from(volume.volume) / voxels;
        if !(volume.volume > 0.0) {
            Err(TissueError::NoInside { resolution })
        } else if share < Self::LEAST_SHARE {
            Err(TissueError::TooThin { share: share as f32, resolution })
        } else {
            Ok(volume)
        }
    }

    /// Length of a voxel's side, in tissue lengths.
    pub fn voxel_size(&self) -> f32 {
        self.grid.cell() as f32
    }

    /// The index over the mesh's triangles, welded and without repeats.
    pub fn index(&self) -> &TriangleIndex {
        &self.index
    }

    /// Number of voxels that the surface touches.
    fn touched_voxels(&self) -> usize {
        self.cells.len() - 1
    }

    /// Volume: whole voxels, plus touched ones by the share of their points that are inside.
    async fn measure(&self, pace: &Pace) -> f32 {
        let is_inside = |probe: &usize| {
            let slot = probe * self.touched_voxels() / Self::PROBES;
            let corner = self.grid.corner(self.cells[slot].voxel as usize);
            self.is_inside(slot, self.grid.global(corner + (EVEN_STEPS * (*probe as f64)).fract()))
        };
        let mut inside = 0;
        let count = |probes: Range<usize>| inside += probes.filter(is_inside).count();
        pace.stretches(Self::PROBES, SHORT_STRETCH, count).await;
        let share = inside as f64 / Self::PROBES as f64;
        let cell = self.grid.cell();
        ((self.whole.len() as f64 + share * self.touched_voxels() as f64) * cell * cell * cell) as f32
    }

    /// Whether a point is inside, in a voxel that the surface touches.
    fn is_inside(&self, slot: usize, point: Vec3) -> bool {
        let [cell, next] = [self.cells[slot], self.cells[slot + 1]];
        if !cell.certain {
            return self.is_voted_inside(point);
        }
        let center = self.grid.global(self.grid.corner(cell.voxel as usize) + 0.5);
        let triangles = &self.triangles[cell.first as usize..next.first as usize];
        let crossed: i32 =
            triangles.iter().map(|&triangle| winding_step(center, point, self.corners[triangle as usize])).sum();
        i32::from(cell.winding) + crossed != 0
    }

    /// Whether most of six rays along the axes find a point enclosed.
    fn is_voted_inside(&self, point: Vec3) -> bool {
        let mut votes = 0;
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let (mut min, mut max) = (point, point);
            (min[axis], max[axis]) = (f32::NEG_INFINITY, f32::INFINITY);
            let flat = |point: Vec3| DVec2::new(point[u].into(), point[v].into());
            let (mut below, mut above) = (0, 0);
            self.index.overlapping(&Bounds { min: min.into(), max: max.into() }, |_, triangle| {
                let corners = self.corners[triangle];
                let heights = corners.map(|corner| f64::from(corner[axis]));
                match crossing(flat(point), corners.map(flat), heights) {
                    Some((facing, height)) if height > f64::from(point[axis]) => above += i32::from(facing),
                    Some((facing, _)) => below += i32::from(facing),
                    None => (),
                }
            });
            votes += u8::from(below != 0) + u8::from(above != 0);
        }
        votes >= MAJORITY
    }

    /// Brings a point outside to the nearest point a little inside.
    fn bring_in(&self, point: Vec3) -> Option<Vec3> {
        let nearest = self.index.closest(point)?;
        let on = nearest.position.as_dvec3();
        let [a, b, c] = self.corners[nearest.triangle].map(|corner| corner.as_dvec3());
        // Further in the same direction, and inwards by the triangle's normal, or outwards if that faces the wrong way.
        let onwards = (on - point.as_dvec3()).normalize_or_zero();
        let inwards = -(b - a).cross(c - a).normalize_or_zero();
        let corner_to_middle = ((a + b + c) / 3.0 - on).normalize_or_zero();
        let candidates = Self::DEPTHS.iter().flat_map(|&depth| {
            [inwards, onwards, inwards + corner_to_middle, -inwards]
                .map(|direction| (on + direction * (depth * self.grid.cell())).as_vec3())
        });
        let candidate = candidates.into_iter().find(|&candidate| self.contains(candidate));
        candidate.or_else(|| self.nearest_around(on.as_vec3())).or_else(|| self.nearest_whole(on.as_vec3()))
    }

    /// The nearest of a sieve of points around one that are inside: next to edges where more than two triangles meet, and
    /// in sheets.
    fn nearest_around(&self, point: Vec3) -> Option<Vec3> {
        let spacing = 1.0 / f64::from(Self::SIEVE);
        let first = ((self.grid.local(point) / spacing).floor() + 0.5) * spacing;
        let reach = Self::AROUND * Self::SIEVE;
        let line = || -reach..=reach;
        let offsets = line().flat_map(|x| line().flat_map(move |y| line().map(move |z| [x, y, z].map(f64::from))));
        let at = |offset: [f64; 3]| self.grid.global(first + DVec3::from_array(offset) * spacing);
        let mut nearest: Option<(f32, Vec3)> = None;
        for candidate in offsets.map(at) {
            let distance = candidate.distance_squared(point);
            if nearest.is_none_or(|(least, _)| distance < least) && self.contains(candidate) {
                nearest = Some((distance, candidate));
            }
        }
        nearest.map(|(_, candidate)| candidate)
    }

    /// Centre of the nearest voxel that is inside as a whole, for points near a flap that encloses nothing.
    fn nearest_whole(&self, point: Vec3) -> Option<Vec3> {
        let centers = self.whole.iter().map(|&voxel| self.grid.global(self.grid.corner(voxel as usize) + 0.5));
        centers.min_by(|a, b| a.distance_squared(point).total_cmp(&b.distance_squared(point)))
    }
}

impl Tissue for MeshVolume {
    fn bounds(&self) -> Aabb3d {
        self.bounds
    }

    fn derived(&self) -> Option<&Derived> {
        Some(&self.derived)
    }

    fn extent(&self) -> Extent {
        Extent::Volume(self.volume)
    }

    fn contains(&self, point: Vec3) -> bool {
        // In a hole of an open mesh, a voxel that is inside as a whole may extend beyond the mesh's box.
        let [min, max] = [self.bounds.min, self.bounds.max].map(Vec3::from);
        if !(point.cmpge(min).all() && point.cmple(max).all()) {
            return false;
        }
        let Some(voxel) = self.grid.voxel(self.grid.local(point)) else { return false };
        if self.touched.contains(voxel) {
            return self.is_inside(self.touched.rank(voxel), point);
        }
        self.inside.contains(voxel)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        let position = if self.contains(point) { point } else { self.bring_in(point).unwrap_or(point) };
        TissuePoint::new(position, Vec3::ZERO)
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        let distance = self.index.closest(point)?.distance_squared.sqrt();
        Some(if self.contains(point) { distance } else { -distance })
    }

    fn depth_is_searched(&self) -> bool {
        true
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        let voxels = self.whole.len() + self.touched_voxels();
        for _ in 0..Self::TRIES {
            let pick = rng.random_range(0..voxels as u32) as usize;
            let voxel = match pick.checked_sub(self.whole.len()) {
                None => self.whole[pick],
                Some(slot) => self.cells[slot].voxel,
            };
            let within = DVec3::new(rng.random(), rng.random(), rng.random());
            let point = self.grid.global(self.grid.corner(voxel as usize) + within);
            if self.closed && pick < self.whole.len() || self.contains(point) {
                return Some(point);
            }
        }
        None
    }
}

/// Sorts the pairs of voxel and triangle by voxel. The voxels of a `loose` triangle are not certain.
async fn cells(
    touched: &BitGrid,
    touches: &[(u32, u32)],
    findings: &[Finding],
    loose: &[bool],
    pace: &Pace,
) -> (Vec<Cell>, Vec<u32>) {
    let voxels = touched.list(&pace.part(0.0..0.1)).await;
    let cell = |slot: usize| {
        let Some(&voxel) = voxels.get(slot) else { return Cell::default() };
        let finding = findings[voxel as usize];
        Cell { voxel, first: 0, winding: finding.winding, certain: finding.is_unanimous() }
    };
    let mut cells: Vec<Cell> = pace.part(0.1..0.2).collect(voxels.len() + 1, cell).await;
    let count = |touch: usize| {
        let (voxel, triangle) = touches[touch];
        let slot = touched.rank(voxel as usize);
        cells[slot].certain &= !loose[triangle as usize];
        // Counted one entry further, so that the running sum gives each voxel's beginning.
        cells[slot + 1].first += 1;
    };
    pace.part(0.2..0.4).each(touches.len(), count).await;
    pace.part(0.4..0.45).each(voxels.len(), |slot| cells[slot + 1].first += cells[slot].first).await;
    let mut next: Vec<u32> = pace.part(0.45..0.5).collect(cells.len(), |slot| cells[slot].first).await;
    let mut triangles = vec![0; touches.len()];
    let place = |touch: usize| {
        let (voxel, triangle) = touches[touch];
        let place = &mut next[touched.rank(voxel as usize)];
        triangles[*place as usize] = triangle;
        *place += 1;
    };
    pace.part(0.5..1.0).each(touches.len(), place).await;
    (cells, triangles)
}

/// Change of the winding number on the way between two points, through one triangle.
fn winding_step(from: Vec3, to: Vec3, corners: [Vec3; 3]) -> i32 {
    let start = from.as_dvec3();
    let way = to.as_dvec3() - start;
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - start);
    let normal = (b - a).cross(c - a);
    let (before, after) = (normal.dot(-a) > 0.0, normal.dot(way - a) > 0.0);
    if before == after {
        return 0;
    }
    let sides = [side_of_edge(way, a, b), side_of_edge(way, b, c), side_of_edge(way, c, a)];
    if sides[0] != sides[1] || sides[1] != sides[2] {
        return 0;
    }
    // From the front to the back is inwards.
    if before { 1 } else { -1 }
}

/// The side of a directed edge on which a line from the origin passes. It is computed for one direction of the edge
/// only, so that its two triangles disagree, and a line between them passes through exactly one.
fn side_of_edge(way: DVec3, from: DVec3, to: DVec3) -> bool {
    if from.to_array() < to.to_array() { way.dot(from.cross(to)) >= 0.0 } else { way.dot(to.cross(from)) < 0.0 }
}
