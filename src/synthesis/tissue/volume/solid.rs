//! A voxelised mesh: which points it encloses.
//!
//! The mesh is voxelised once. Voxels that its surface does not touch are inside or outside as a whole. In the others
//! the mesh itself decides: a point is on the same side as the voxel's centre if the triangles between them cancel out.
//! If an open mesh leaves the centre uncertain, six rays from the point vote. So the boundary is that of the mesh, not
//! that of the voxels.

use crate::synthesis::{
    mesh::{
        TriangleIndex, TriangleMesh,
        bit_grid::BitGrid,
        crossing::crossing,
        voxels::{Finding, Grid, MAJORITY},
        winding::oriented,
    },
    pace::Pace,
    space::bvh::Bounds,
    tissue::error::{TissueError, rounding_within},
};
use bevy_math::{DVec2, DVec3, Vec3, bounding::Aabb3d};

/// Steps whose multiples fill the unit cube uniformly: powers of 1/g, where g⁴ = g + 1 (Roberts, "The Unreasonable
/// Effectiveness of Quasirandom Sequences", 2018).
pub(super) const EVEN_STEPS: DVec3 =
    DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_2);

/// The voxels of a mesh, and its triangles in those that it touches.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    pub grid: Grid,
    /// The index over the mesh's triangles, welded and without repeats.
    pub index: TriangleIndex,
    pub bounds: Aabb3d,
    /// Whether the mesh is closed.
    pub closed: bool,
    /// Corners of every triangle.
    pub corners: Vec<[Vec3; 3]>,
    /// The voxels that are inside as a whole.
    pub whole: Vec<u32>,
    /// The same voxels, to look up.
    inside: BitGrid,
    /// Voxels that the surface touches.
    touched: BitGrid,
    /// The data of each touched voxel, in order, and one more entry for the end of the last.
    cells: Vec<Cell>,
    /// Triangles in the touched voxels, voxel by voxel.
    triangles: Vec<u32>,
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

impl Solid {
    /// Voxelises a mesh with `resolution` voxels along the longest side of its box.
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
        Ok(Self {
            whole: inside.list(&pace.part(0.86..0.88)).await,
            corners,
            bounds: mesh.bounds_paced(&pace.part(0.88..0.89)).await,
            closed,
            grid,
            index,
            inside,
            touched,
            cells,
            triangles,
        })
    }

    /// Number of voxels that the surface touches.
    pub fn touched_voxels(&self) -> usize {
        self.cells.len() - 1
    }

    /// The voxel of each slot, in order: those that the surface touches.
    pub fn touched_voxel(&self, slot: usize) -> usize {
        self.cells[slot].voxel as usize
    }

    /// Whether a point is inside.
    pub fn contains(&self, point: Vec3) -> bool {
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

    /// Whether a point is inside, in a voxel that the surface touches.
    pub fn is_inside(&self, slot: usize, point: Vec3) -> bool {
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
