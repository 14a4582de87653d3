//! Where a canvas has texels: its charts, the borders of these, and how large a texel is on the surface.

use super::canvas::{Canvas, has_no_area};
use super::error::BakeWarning;
use super::settings::BakeSettings;
use crate::synthesis::{mesh::disjoint_sets::DisjointSets, pace::Pace};
use bevy_math::{Vec2, Vec3};

/// Texels that a chart should be wide.
const WIDE_ENOUGH: f32 = 8.0;

/// A symmetric tensor: xx, yy, zz, xy, xz, yz.
pub(super) type Tensor = [f32; 6];

/// A triangle at its place in the texture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub triangle: u32,
    /// Whole textures by which its coordinates are moved.
    pub shift: [i16; 2],
    /// Whether it has an edge at the border of its chart.
    pub is_border: bool,
}

/// An edge that two charts share, or one chart with itself, with the two corners of each side's triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Seam {
    /// Triangle and first corner on either side; the second corner is the next.
    pub sides: [[u32; 2]; 2],
}

/// The charts of a canvas.
#[derive(Debug)]
pub(super) struct Atlas {
    /// All triangles with texels, chart by chart.
    pub placements: Vec<Placement>,
    /// Unit normal of every vertex, the same for all vertices at one position.
    pub smooth: Vec<Vec3>,
    /// Variance of the blur of a texel of a texture of size 1, the same for all vertices at one position.
    pub footprints: Vec<Tensor>,
    pub seams: Vec<Seam>,
    /// Where seams meet: for each position, in rising order, the vertices there that differ in texture coordinates.
    pub seam_corners: Vec<[u32; 2]>,
    /// Number of charts.
    pub charts: usize,
    /// For each chart, how wide it is, in textures.
    pub widths: Vec<f32>,
    /// Whether the texture goes on beyond its right and its lower edge: a chart crosses it.
    pub repeats: [bool; 2],
    /// A typical length of the side of a texture on the surface.
    pub side: f32,
}

impl Atlas {
    /// The charts of a canvas.
    pub async fn of(canvas: &Canvas, pace: &Pace) -> Self {
        let edges = Edges::of(canvas, &pace.part(0.0..0.4)).await;
        let (chart_of, charts) = edges.charts(canvas);
        let placements = placements(canvas, &edges, &chart_of, charts);
        let (smooth, footprints, side) = surface(canvas, &pace.part(0.5..0.9)).await;
        let widths = widths(canvas, &edges, &chart_of, charts);
        let repeats = repeats(canvas, &placements, &edges.seams);
        let seam_corners = seam_corners(canvas, &edges.seams);
        pace.rest(1.0).await;
        Self { placements, smooth, footprints, seams: edges.seams, seam_corners, charts, widths, repeats, side }
    }

    /// Warns of charts too thin for a size.
    pub fn warn(&self, size: u32) -> Option<BakeWarning> {
        let is_thin = |width: &&f32| **width * (size as f32) < WIDE_ENOUGH;
        let charts = self.widths.iter().filter(is_thin).count();
        let thinnest = self.widths.iter().copied().fold(f32::INFINITY, f32::min);
        let suffices = (WIDE_ENOUGH / thinnest).min(1.0e9) as u32;
        let suffices = Some((suffices + 1).next_power_of_two()).filter(|&size| size <= BakeSettings::MOST_SIZE);
        (charts > 0).then_some(BakeWarning::ThinCharts { charts, thinnest: thinnest * size as f32, suffices })
    }
}

/// The edges of all triangles: which lie at the border of a chart.
struct Edges {
    /// For each triangle, a bit for each edge at a border, that from corner k to the next.
    borders: Vec<u8>,
    /// Pairs of triangles of one chart.
    inner: Vec<[u32; 2]>,
    seams: Vec<Seam>,
}

/// An edge: its two vertices, the lower first, then triangle and corner.
type Edge = ([u32; 2], u32, u8);

impl Edges {
    async fn of(canvas: &Canvas, pace: &Pace) -> Self {
        let triangles = canvas.mesh.triangles();
        let mut borders = vec![0u8; triangles.len()];
        let mut edges: Vec<Edge> = Vec::with_capacity(3 * triangles.len());
        let list = |triangle: usize| {
            let corners = triangles[triangle];
            if is_placed(canvas, triangle) {
                for corner in 0..3 {
                    edges.push(edge(&canvas.welds.chart, corners, triangle, corner));
                }
            }
        };
        pace.part(0.0..0.2).each(triangles.len(), list).await;
        sort_by_vertex(&mut edges, canvas.uvs.len());
        pace.rest(0.5).await;
        let (mut inner, mut open): (Vec<[u32; 2]>, Vec<Edge>) = (Vec::new(), Vec::new());
        let match_up = |group: &[Edge]| match group {
            [one, other] => inner.push([one.1, other.1]),
            others => open.extend(others),
        };
        edges.chunk_by(|a, b| a.0 == b.0).for_each(match_up);
        // Edges of three triangles hold a chart together, and are borders all the same.
        for group in open.chunk_by(|a, b| a.0 == b.0) {
            inner.extend(group.windows(2).map(|pair| [pair[0].1, pair[1].1]));
        }
        let mut seams = Vec::new();
        let mut by_position: Vec<Edge> = open
            .iter()
            .map(|&(_, triangle, corner)| {
                let (triangle, corner) = (triangle as usize, usize::from(corner));
                borders[triangle] |= 1 << corner;
                edge(&canvas.welds.position, triangles[triangle], triangle, corner)
            })
            .collect();
        by_position.sort_unstable();
        for group in by_position.chunk_by(|a, b| a.0 == b.0) {
            let side = |edge: &Edge| [edge.1, u32::from(edge.2)];
            seams.extend(group.windows(2).map(|pair| Seam { sides: [side(&pair[0]), side(&pair[1])] }));
        }
        pace.rest(1.0).await;
        Self { borders, inner, seams }
    }

    /// The chart of each triangle, numbered by their first triangles. Triangles without texels have one of their own,
    /// which is not counted.
    fn charts(&self, canvas: &Canvas) -> (Vec<u32>, usize) {
        let count = canvas.mesh.triangles().len();
        let mut sets = DisjointSets::new(count);
        self.inner.iter().for_each(|&[a, b]| sets.unite(a, b));
        let mut numbers = vec![u32::MAX; count];
        let mut charts = 0;
        for triangle in 0..count {
            let first = sets.first(triangle as u32) as usize;
            if first == triangle && is_placed(canvas, triangle) {
                numbers[triangle] = charts;
                charts += 1;
            } else {
                numbers[triangle] = numbers[first];
            }
        }
        (numbers, charts as usize)
    }
}

fn edge(weld: &[u32], corners: [u32; 3], triangle: usize, corner: usize) -> Edge {
    let [a, b] = [corners[corner], corners[(corner + 1) % 3]].map(|vertex| weld[vertex as usize]);
    ([a.min(b), a.max(b)], triangle as u32, corner as u8)
}

/// Sorts edges by their vertices. Those of one lower vertex are few, so that they are sorted among themselves.
fn sort_by_vertex(edges: &mut Vec<Edge>, vertices: usize) {
    let mut starts = vec![0u32; vertices + 1];
    edges.iter().for_each(|edge| starts[edge.0[0] as usize + 1] += 1);
    (0..vertices).for_each(|vertex| starts[vertex + 1] += starts[vertex]);
    let (mut sorted, mut next) = (vec![([0; 2], 0, 0); edges.len()], starts.clone());
    for &edge in edges.iter() {
        let place = &mut next[edge.0[0] as usize];
        sorted[*place as usize] = edge;
        *place += 1;
    }
    for bounds in starts.windows(2) {
        sorted[bounds[0] as usize..bounds[1] as usize].sort_unstable();
    }
    *edges = sorted;
}

/// Whether a triangle has texels, in a texture that is large enough.
fn is_placed(canvas: &Canvas, triangle: usize) -> bool {
    !has_no_area(corner_uvs(canvas, triangle)) && !canvas.mesh.is_degenerate(triangle)
}

/// Texture coordinates of a triangle's corners.
pub(super) fn corner_uvs(canvas: &Canvas, triangle: usize) -> [Vec2; 3] {
    canvas.mesh.triangles()[triangle].map(|corner| canvas.uvs[corner as usize])
}

/// The triangles of all charts, each as often as it lies in another texture.
fn placements(canvas: &Canvas, edges: &Edges, chart_of: &[u32], charts: usize) -> Vec<Placement> {
    let mut starts = vec![0u32; charts + 1];
    let placed = || chart_of.iter().enumerate().filter(|(_, chart)| **chart != u32::MAX);
    placed().for_each(|(_, &chart)| starts[chart as usize + 1] += 1);
    (0..charts).for_each(|chart| starts[chart + 1] += starts[chart]);
    let mut ordered = vec![0u32; starts[charts] as usize];
    for (triangle, &chart) in placed() {
        let place = &mut starts[chart as usize];
        ordered[*place as usize] = triangle as u32;
        *place += 1;
    }
    let mut placements = Vec::with_capacity(ordered.len());
    for triangle in ordered {
        let [a, b, c] = corner_uvs(canvas, triangle as usize);
        let (low, high) = (a.min(b).min(c).floor().as_i16vec2(), a.max(b).max(c).ceil().as_i16vec2());
        let is_border = edges.borders[triangle as usize] != 0;
        for down in low.y..high.y.max(low.y + 1) {
            for right in low.x..high.x.max(low.x + 1) {
                placements.push(Placement { triangle, shift: [-right, -down], is_border });
            }
        }
    }
    placements
}

/// Smooth normals and footprints of all vertices, and the side of a texture on the surface.
async fn surface(canvas: &Canvas, pace: &Pace) -> (Vec<Vec3>, Vec<Tensor>, f32) {
    let (mesh, welds) = (&canvas.mesh, &canvas.welds.position);
    let mut sums = vec![(Vec3::ZERO, [0.0f32; 6], 0.0f32); welds.len()];
    let (mut whole, mut chart) = (0.0f64, 0.0f64);
    let add = |triangle: usize| {
        let corners = mesh.triangles()[triangle];
        let [a, b, c] = mesh.corners(triangle);
        let doubled = (b - a).cross(c - a);
        let area = doubled.length();
        let uvs = corner_uvs(canvas, triangle);
        let tensor = footprint([a, b, c], uvs).filter(|_| is_placed(canvas, triangle));
        if tensor.is_some() {
            whole += f64::from(area);
            chart += f64::from((uvs[1] - uvs[0]).perp_dot(uvs[2] - uvs[0]).abs());
        }
        for corner in corners {
            let (normal, sum, weight) = &mut sums[welds[corner as usize] as usize];
            *normal += doubled;
            if let Some(tensor) = tensor {
                (0..6).for_each(|k| sum[k] += area * tensor[k]);
                *weight += area;
            }
        }
    };
    pace.part(0.0..0.7).each(mesh.triangles().len(), add).await;
    let side = if chart > 0.0 { (whole / chart).sqrt() as f32 } else { 0.0 };
    let mut smooth = Vec::with_capacity(welds.len());
    let mut footprints = Vec::with_capacity(welds.len());
    let mean = |vertex: usize| {
        let (normal, sum, weight) = sums[welds[vertex] as usize];
        smooth.push(normal.try_normalize().unwrap_or(canvas.normals[vertex]));
        let plain = 0.25 * side * side;
        let mean = if weight > 0.0 { sum.map(|sum| sum / weight) } else { [plain, plain, plain, 0.0, 0.0, 0.0] };
        footprints.push(mean);
    };
    pace.part(0.7..1.0).each(welds.len(), mean).await;
    (smooth, footprints, side)
}

/// Variance of a Gaussian whose standard deviation is half a texel along each side of it, for a texture of size 1.
fn footprint([a, b, c]: [Vec3; 3], [ta, tb, tc]: [Vec2; 3]) -> Option<Tensor> {
    let (across, down) = (tb - ta, tc - ta);
    let doubled = across.perp_dot(down);
    let right = ((b - a) * down.y - (c - a) * across.y) / (2.0 * doubled);
    let lower = ((c - a) * across.x - (b - a) * down.x) / (2.0 * doubled);
    let tensor = [
        right.x * right.x + lower.x * lower.x,
        right.y * right.y + lower.y * lower.y,
        right.z * right.z + lower.z * lower.z,
        right.x * right.y + lower.x * lower.y,
        right.x * right.z + lower.x * lower.z,
        right.y * right.z + lower.y * lower.z,
    ];
    tensor.iter().all(|value| value.is_finite()).then_some(tensor)
}

/// How wide each chart is: as a rectangle of its area and circumference.
fn widths(canvas: &Canvas, edges: &Edges, chart_of: &[u32], charts: usize) -> Vec<f32> {
    let mut measures = vec![(0.0f64, 0.0f64); charts];
    for (triangle, &chart) in chart_of.iter().enumerate().filter(|(_, chart)| **chart != u32::MAX) {
        let uvs = corner_uvs(canvas, triangle);
        let (area, circumference) = &mut measures[chart as usize];
        *area += 0.5 * f64::from((uvs[1] - uvs[0]).perp_dot(uvs[2] - uvs[0]).abs());
        for corner in (0..3).filter(|corner| edges.borders[triangle] >> corner & 1 == 1) {
            *circumference += f64::from(uvs[corner].distance(uvs[(corner + 1) % 3]));
        }
    }
    let width = |(area, circumference): (f64, f64)| {
        let half = 0.25 * circumference;
        let squared = half * half - area;
        // A circle is wider than any rectangle of its circumference.
        (if squared > 0.0 { area / (half + squared.sqrt()) } else { area.sqrt() }) as f32
    };
    measures.into_iter().map(width).collect()
}

/// Whether charts go on beyond the right and the lower edge: by coordinates outside of 0 to 1, or by a seam whose sides
/// lie a whole texture apart.
fn repeats(canvas: &Canvas, placements: &[Placement], seams: &[Seam]) -> [bool; 2] {
    let mut repeats = [false; 2];
    for placement in placements.iter().filter(|placement| placement.shift != [0; 2]) {
        (0..2).for_each(|axis| repeats[axis] |= placement.shift[axis] != 0);
    }
    for seam in seams {
        let [one, other] = seam.vertices(canvas).map(|side| side.map(|vertex| canvas.uvs[vertex]));
        for axis in 0..2 {
            let apart = [0, 1].map(|end| (one[end][axis] - other[end][axis]).abs());
            repeats[axis] |= apart.into_iter().all(|apart| (apart - 1.0).abs() < 1.0e-4);
        }
    }
    repeats
}

fn seam_corners(canvas: &Canvas, seams: &[Seam]) -> Vec<[u32; 2]> {
    let ends = seams.iter().flat_map(|seam| seam.vertices(canvas)).flatten();
    let mut corners: Vec<[u32; 2]> =
        ends.map(|vertex| [canvas.welds.position[vertex], canvas.welds.chart[vertex]]).collect();
    corners.sort_unstable();
    corners.dedup();
    corners
}

impl Seam {
    /// The vertices of both ends of the edge on either side, in the same order.
    pub fn vertices(&self, canvas: &Canvas) -> [[usize; 2]; 2] {
        let side = |[triangle, corner]: [u32; 2]| {
            let corners = canvas.mesh.triangles()[triangle as usize];
            [corners[corner as usize], corners[(corner as usize + 1) % 3]].map(|vertex| vertex as usize)
        };
        let [one, mut other] = self.sides.map(side);
        if canvas.welds.position[one[0]] != canvas.welds.position[other[0]] {
            other.swap(0, 1);
        }
        [one, other]
    }
}
