//! The large intestine: a procedural colon with haustra, three taeniae coli and a lumen, different for every seed.
//!
//! The course (caecum with its appendix, ascending colon, hepatic flexure, transverse colon, splenic flexure,
//! descending colon, sigmoid, rectum) is a spline that avoids itself; the wall is swept along it. Between three
//! longitudinal bands, the taeniae coli, the wall bulges into haustra; between two haustra a semilunar fold reaches
//! into the lumen. The wall has a thickness. It ends blind in the caecum and is cut open at the rectum, so the lumen is
//! visible.
//!
//! The mesh is one closed surface of the topology of a sphere: from the blind end along the outside to the rim, and back
//! along the inside. In the texture, that way is cut into strips side by side: `u` runs around the tube from the
//! mesenteric border, `v` along it. So charts don't overlap, and texels are about as long as wide. Vertices along the
//! borders of strips, and those of the two poles, are duplicated.
//!
//! ```
//! use bevy_vessels::synthesis::organ::ColonSettings;
//!
//! let colon = ColonSettings { seed: 7, triangles: 20_000, ..Default::default() }.generate()?;
//! assert!(colon.haustra > 30);
//! assert!(colon.mesh.signed_volume() > 0.0);
//! # Ok::<(), bevy_vessels::synthesis::organ::OrganSettingsError>(())
//! ```

mod haustra;
mod path;
mod settings;
mod wall;

pub use settings::ColonSettings;

use crate::synthesis::random::Stream;
use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{OrganSettingsError, RootSites, Viewpoint},
};
use bevy_math::{Vec2, Vec3, ops};
use std::{f32::consts::TAU, ops::Range};
use wall::{Side, Wall};

/// A procedural colon.
///
/// Axes: x to the patient's left (right in a picture from the front), y up, z to the front.
#[derive(Clone, Debug, PartialEq)]
pub struct Colon {
    /// The closed surface: outer side, rim, inner side, in this order.
    pub mesh: ShadedMesh,
    /// The triangles of the outer side, from the blind end to the rim.
    pub outer: Range<usize>,
    /// The triangles of the inner side, from the rim to the blind end of the lumen.
    pub inner: Range<usize>,
    /// Points of the centre line from the appendix or caecum to the cut end, at equal distances, in metres.
    pub centre_line: Vec<Vec3>,
    /// Mean outer radius at each point of the centre line, in metres.
    pub radii: Vec<f32>,
    /// Number of haustra: three rows together.
    pub haustra: usize,
    /// Where vasa recta reach the outer side, along the mesenteric border.
    pub roots: RootSites,
    /// Where vessels reach the inner side: under the taenia at the mesenteric border.
    pub inner_roots: RootSites,
    /// From the front, the whole organ in view of a camera with a vertical field of view of 45°.
    pub front: Viewpoint,
    /// From before the cut end into the lumen.
    pub rim: Viewpoint,
    /// From within the lumen, along its straightest part: the view of an endoscope.
    pub lumen: Viewpoint,
}

impl ColonSettings {
    /// Makes the colon.
    ///
    /// # Errors
    /// A setting outside its limits, by name.
    pub fn generate(&self) -> Result<Colon, OrganSettingsError> {
        self.validate()?;
        Ok(build(self))
    }
}

/// A ring of vertices.
struct Ring {
    side: Side,
    arc: f32,
    /// Across the rim: 0 on the outer side, 1 on the inner.
    across_rim: f32,
}

/// Rings across the rim, between the last of the outer side and the first of the inner.
const RIM_RINGS: usize = 5;

/// Thicknesses of the wall between two rings from which on a chord of one side may cut the other, if their rings are
/// not at the same places.
const COARSE: f32 = 2.0;

fn build(settings: &ColonSettings) -> Colon {
    let wall = Wall::new(settings, &mut Stream::Organ.rng(settings.seed));
    let outer = profile(&wall, Side::Outer);
    let inner = profile(&wall, Side::Inner);
    let length = outer.length + inner.length;
    // Nearly square cells: rings as far apart as columns on average, but a little closer for the folds.
    let columns = (0.5 * TAU * 0.5 * settings.calibre * settings.triangles as f32 / length).sqrt() / 3.0;
    let columns = (columns.round() as usize * 3).max(12);
    let rings = settings.triangles as usize / (2 * columns);
    let outer_rings = ((rings as f32 * outer.length / length) as usize).max(8);
    let inner_rings = rings.saturating_sub(outer_rings + RIM_RINGS).max(8);

    let inner_arcs: Vec<f32> = inner.arcs(inner_rings).collect();
    let is_coarse = length > COARSE * settings.wall_thickness * rings as f32;
    let outer_arcs =
        if is_coarse { beside(&outer, &inner_arcs, outer_rings) } else { outer.arcs(outer_rings).collect() };
    let outer_rings = outer_arcs.len();
    let mut sequence: Vec<Ring> =
        outer_arcs.into_iter().map(|arc| Ring { side: Side::Outer, arc, across_rim: 0.0 }).collect();
    sequence.extend((1..=RIM_RINGS).map(|k| Ring {
        side: Side::Inner,
        arc: wall.end,
        across_rim: k as f32 / (RIM_RINGS + 1) as f32,
    }));
    let mut inward: Vec<Ring> =
        inner_arcs.into_iter().map(|arc| Ring { side: Side::Inner, arc, across_rim: 1.0 }).collect();
    inward.reverse();
    sequence.append(&mut inward);

    let mesh = sweep(&wall, &sequence, columns, is_coarse);
    let strip = |rings: usize| columns + (rings - 2) * 2 * columns;
    let outer = 0..strip(outer_rings);
    let inner = mesh.triangles.len() - strip(inner_rings)..mesh.triangles.len();
    describe(&wall, mesh, outer, inner)
}

/// Arc lengths of about so many rings of the outer side: those of the inner one, and before the lumen begins, at equal
/// distances.
fn beside(outer: &Profile, inner: &[f32], rings: usize) -> Vec<f32> {
    let lumen = inner.get(1).copied().unwrap_or(0.0);
    outer.arcs(rings).take_while(|&arc| arc < lumen).chain(inner.iter().copied().skip(1)).collect()
}

/// Arc length of the centre line as a function of the length along one side of the wall.
struct Profile {
    /// Arc length of the centre line and length along the wall from the blind end, both ascending.
    samples: Vec<(f32, f32)>,
    length: f32,
}

impl Profile {
    /// Arc lengths of rings at equal distances along the wall, from the blind end to the cut one.
    fn arcs(&self, rings: usize) -> impl Iterator<Item = f32> + '_ {
        let mut from = 0;
        (0..rings).map(move |ring| {
            let walked = self.length * ring as f32 / (rings - 1) as f32;
            while from + 2 < self.samples.len() && self.samples[from + 1].1 < walked {
                from += 1;
            }
            let ((arc, start), (next, end)) = (self.samples[from], self.samples[from + 1]);
            arc + (next - arc) * ((walked - start) / (end - start).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0)
        })
    }
}

fn profile(wall: &Wall, side: Side) -> Profile {
    const SAMPLES: usize = 3000;
    let start = wall.start(side);
    let mut walked = 0.0;
    let mut last = (start, 0.0);
    let samples = (0..=SAMPLES)
        .map(|index| {
            // Squared: the samples are dense at the pole, where the radius rises steeply.
            let share = index as f32 / SAMPLES as f32;
            let arc = start + (wall.end - start) * share * share;
            let radius = wall.mean_radius(side, arc);
            let (along, across): (f32, f32) = (arc - last.0, radius - last.1);
            walked += (along * along + across * across).sqrt();
            last = (arc, radius);
            (arc, walked)
        })
        .collect();
    Profile { samples, length: walked }
}

/// Sweeps the wall along the rings. If `turned`, cells of the inner side are divided as those of the outer one beside
/// them are; otherwise, as they lie in the texture.
fn sweep(wall: &Wall, rings: &[Ring], columns: usize, turned: bool) -> ShadedMesh {
    let angles: Vec<f32> = (0..=columns).map(|column| column_angle(column, columns)).collect();
    let row = columns + 1;
    let mut mesh = ShadedMesh::default();
    let mut shared: Vec<u32> = Vec::with_capacity(rings.len() * row);
    let mut walked = Vec::with_capacity(rings.len());
    let mut last: Option<Vec3> = None;
    for (index, ring) in rings.iter().enumerate() {
        let pole = index == 0 || index + 1 == rings.len();
        let vertices = ring_vertices(wall, ring, &angles, pole);
        let first = mesh.positions.len();
        let step = last.map_or(0.0, |last: Vec3| last.distance(vertices[columns / 2].0));
        walked.push(walked.last().copied().unwrap_or(0.0) + step);
        last = Some(vertices[columns / 2].0);
        for (column, (position, colour)) in vertices.into_iter().enumerate() {
            mesh.positions.push(position);
            mesh.colors.push(colour);
            let owner = if pole { 0 } else { column % columns };
            shared.push((first + owner) as u32);
        }
    }
    let girth = TAU * wall.mean_radius(Side::Outer, 0.5 * (wall.start(Side::Outer) + wall.end));
    let strips = Strips::of(&walked, girth);
    let share = |column: usize| column as f32 / columns as f32;
    mesh.uvs = (0..rings.len())
        .flat_map(|ring| (0..row).map(move |column| (ring, column)))
        .map(|(ring, column)| strips.uv(strips.at(ring), walked[ring], share(column)))
        .collect();
    // A ring between two strips has its vertices once more, as the end of the strip before.
    let mut ends = vec![None; rings.len()];
    for (strip, &ring) in strips.starts.iter().enumerate().skip(1) {
        ends[ring] = Some(mesh.positions.len());
        for column in 0..row {
            let vertex = ring * row + column;
            mesh.positions.push(mesh.positions[vertex]);
            mesh.colors.push(mesh.colors[vertex]);
            mesh.uvs.push(strips.uv(strip - 1, walked[ring], share(column)));
            shared.push(shared[vertex]);
        }
    }
    for ring in 0..rings.len() - 1 {
        let (below, above) = (ring * row, ends[ring + 1].unwrap_or((ring + 1) * row));
        for column in 0..columns {
            let [a, b] = [below + column, below + column + 1].map(|vertex| vertex as u32);
            let [c, d] = [above + column, above + column + 1].map(|vertex| vertex as u32);
            if ring + 2 < rings.len() && ring > 0 && turned && rings[ring].across_rim == 1.0 {
                mesh.triangles.extend([[a, b, c], [b, d, c]]);
                continue;
            }
            if ring + 2 < rings.len() {
                mesh.triangles.push([a, d, c]);
            }
            if ring > 0 {
                mesh.triangles.push([a, b, d]);
            }
        }
    }
    // At the last pole c and d coincide, so there the triangle is a, b and that pole; it is the [a, b, d] above.
    mesh.compute_normals(&shared);
    mesh
}

/// The strips into which the way along the wall is cut in the texture.
struct Strips {
    /// The first ring of each strip.
    starts: Vec<usize>,
    /// The way along the wall at which each begins, and the whole.
    ways: Vec<f32>,
}

impl Strips {
    /// Width of the gap beside each strip, as a share of the texture.
    const MARGIN: f32 = 0.004;

    /// As many strips as make them together about as wide as they are long, given the way along the wall at each ring,
    /// and how far it is around the wall.
    fn of(walked: &[f32], girth: f32) -> Self {
        let last = walked.len() - 1;
        let length = walked[last].max(f32::MIN_POSITIVE);
        let count = (length / girth).sqrt().round().clamp(1.0, 16.0);
        let mut starts = vec![0];
        for strip in 1..count as usize {
            let ring = walked.partition_point(|&way| way < strip as f32 * length / count);
            if ring > starts[strip - 1] + 1 && ring + 1 < last {
                starts.push(ring);
            } else {
                break;
            }
        }
        let ways = starts.iter().map(|&ring| walked[ring]).chain([length]).collect();
        Self { starts, ways }
    }

    /// The strip that a ring begins or lies in.
    fn at(&self, ring: usize) -> usize {
        self.starts.partition_point(|&start| start <= ring) - 1
    }

    /// Texture coordinates of a place in a strip: a way along the wall, and a share of the way around it.
    fn uv(&self, strip: usize, walked: f32, around: f32) -> Vec2 {
        let longest = self.ways.windows(2).map(|ends| ends[1] - ends[0]).fold(f32::MIN_POSITIVE, f32::max);
        let width = 1.0 / self.starts.len() as f32;
        let u = strip as f32 * width + Self::MARGIN + (width - 2.0 * Self::MARGIN) * around;
        let v = Self::MARGIN + (1.0 - 2.0 * Self::MARGIN) * (walked - self.ways[strip]) / longest;
        Vec2::new(u.clamp(0.0, 1.0), v.clamp(0.0, 1.0))
    }
}

/// Angle of a column, in radians: columns are closer at the taeniae, whose edges are the sharpest feature around the tube.
fn column_angle(column: usize, columns: usize) -> f32 {
    let sectors = haustra::ROWS as f32;
    let turn = sectors * column as f32 / columns as f32;
    TAU / sectors * (turn - 0.45 / TAU * ops::sin(TAU * turn))
}

/// Positions and colours of a ring; the last repeats the first.
fn ring_vertices(wall: &Wall, ring: &Ring, angles: &[f32], pole: bool) -> Vec<(Vec3, [f32; 4])> {
    let section = wall.section(ring.side, ring.arc);
    let outer = (ring.across_rim > 0.0 && ring.across_rim < 1.0).then(|| wall.section(Side::Outer, ring.arc));
    let mut vertices: Vec<(Vec3, [f32; 4])> = angles
        .iter()
        .map(|&angle| {
            let angle = if pole { 0.0 } else { angle };
            let mut radius = if pole { 0.0 } else { wall.radius(ring.side, &section, angle) };
            let mut colour = wall.colour(ring.side, &section, angle);
            let mut along = 0.0;
            if let Some(outer) = &outer {
                // A half circle over the wall's edge.
                let outer_radius = wall.radius(Side::Outer, outer, angle);
                let half = 0.5 * (outer_radius - radius);
                let turn = std::f32::consts::PI * ring.across_rim;
                radius += half * (1.0 + ops::cos(turn));
                along = half * ops::sin(turn);
                colour = super::mix(wall.colour(Side::Outer, outer, angle), colour, ring.across_rim);
            }
            let frame = &section.frame;
            (frame.centre + frame.direction(angle) * radius + frame.tangent * along, colour)
        })
        .collect();
    if let Some(first) = vertices.first().copied()
        && let Some(last) = vertices.last_mut()
    {
        *last = first;
    }
    vertices
}

/// Adds data for a scene to a mesh.
fn describe(wall: &Wall, mesh: ShadedMesh, outer: Range<usize>, inner: Range<usize>) -> Colon {
    let (low, high) = mesh.bounds();
    let centre = 0.5 * (low + high);
    let height = high.y - low.y;
    let end = wall.line.at(wall.end);
    Colon {
        outer,
        inner,
        centre_line: wall.line.frames().iter().map(|frame| frame.centre).collect(),
        radii: wall.line.arcs().map(|arc| wall.mean_radius(Side::Outer, arc)).collect(),
        haustra: wall.rows.iter().map(haustra::Row::len).sum(),
        roots: root_sites(wall, Side::Outer, 12),
        inner_roots: root_sites(wall, Side::Inner, 24),
        front: Viewpoint { eye: centre + Vec3::new(0.12, 0.1, 1.5) * height, target: centre, up: Vec3::Y },
        rim: Viewpoint {
            eye: end.centre + end.tangent * (3.2 * end.radius),
            target: end.centre - end.tangent * end.radius,
            up: Vec3::Y,
        },
        lumen: lumen_view(wall),
        mesh,
    }
}

/// The view along the straightest and widest part of the lumen.
fn lumen_view(wall: &Wall) -> Viewpoint {
    const CANDIDATES: usize = 60;
    let ahead = 0.15 * (wall.end - wall.apex);
    let candidates = (1..CANDIDATES).map(|index| {
        let arc = wall.apex + ahead + (wall.end - wall.apex - ahead) * index as f32 / CANDIDATES as f32;
        let (here, there) = (wall.line.at(arc), wall.line.at(arc - ahead));
        let straight = here.centre.distance(there.centre) / ahead;
        (straight * straight * straight * here.radius, here.centre, there.centre)
    });
    let best = candidates.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, Vec3::ZERO, Vec3::Y));
    // In a vertical limb the front of the body is at the top of the picture.
    let level = (best.2 - best.1).normalize_or(Vec3::X).y.abs() < 0.8;
    Viewpoint { eye: best.1, target: best.2, up: if level { Vec3::Y } else { Vec3::Z } }
}

/// Places along the mesenteric border, arteries and veins beside each other; two of them on the appendix, whose artery
/// accompanies it in a mesentery of its own.
fn root_sites(wall: &Wall, side: Side, count: usize) -> RootSites {
    let mut sites = RootSites::default();
    let first = wall.apex + 0.04 * (wall.end - wall.apex);
    let step = (wall.end - first) / count as f32;
    let appendix = wall.apex - wall.start(side);
    let shares = if appendix > 0.0 { &[0.3, 0.7][..] } else { &[] };
    let own = shares.iter().map(|share| (wall.start(side) + share * appendix, 0.5 * appendix));
    let along = (0..count).map(|index| (first + (index as f32 + 0.4) * step, step));
    for (arc, room) in own.chain(along) {
        for (shift, points) in [(-0.04, &mut sites.arterial), (0.04, &mut sites.venous)] {
            let section = wall.section(side, arc + shift * room);
            let radius = wall.radius(side, &section, 0.0);
            points.push(section.frame.centre + section.frame.direction(0.0) * radius);
        }
    }
    sites
}
