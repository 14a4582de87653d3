//! The meshes that chunks draw: copies of a cone with round ends, shaped on the GPU, at several levels of detail.
//!
//! In: a [`Level`] and a number of slots. Out: a [`Mesh`] whose attributes are read by `segments.wgsl` alone:
//!
//! | attribute | holds |
//! |---|---|
//! | position | cosine and sine around the axis, and the end: 0 at the start, 1 at the far one |
//! | normal | first goal of the vertex, as its segment gets small: cosine, sine, latitude |
//! | texture coordinate | slot within the chunk; latitude within the round end, 0 at its rim and 1 at its pole |
//! | [`ATTRIBUTE_DETAIL`] | radius in pixels below which it has arrived; [`Level::most_kept`], [`Level::least_width`] |
//! | [`ATTRIBUTE_SECOND_GOAL`], [`ATTRIBUTE_THIRD_GOAL`] | its next goals: cosine, sine, latitude, radius |
//!
//! Slid to the next coarser level, a level's vertices equal that level's, vertex for vertex, and slide on as those do.
//! So a chunk can switch from one mesh to the next without a visible change, whatever the thickness of its segments.

use super::levels::{Goal, Level, Shape, corner_reach};
use bevy::{
    asset::RenderAssetUsages,
    math::ops,
    mesh::{Indices, Mesh, MeshVertexAttribute, PrimitiveTopology, VertexFormat},
};
use std::f32::consts::TAU;

/// The vertex stage's data about the level of a vertex.
pub(super) const ATTRIBUTE_DETAIL: MeshVertexAttribute =
    MeshVertexAttribute::new("SegmentDetail", 0x7e55_e15d_e7a1, VertexFormat::Float32x3);

/// The second goal of a vertex.
pub(super) const ATTRIBUTE_SECOND_GOAL: MeshVertexAttribute =
    MeshVertexAttribute::new("SegmentSecondGoal", 0x7e55_e15d_e7a2, VertexFormat::Float32x4);

/// The third goal of a vertex.
pub(super) const ATTRIBUTE_THIRD_GOAL: MeshVertexAttribute =
    MeshVertexAttribute::new("SegmentThirdGoal", 0x7e55_e15d_e7a3, VertexFormat::Float32x4);

/// Builds a mesh of those of `slots` segments that a level of detail keeps.
///
/// The near end has a plain cap: it sits in the round end of the parent segment, and is visible only at roots.
pub(super) fn chunk_mesh(level: &Level, slots: usize) -> Mesh {
    let mut template = Template::new(level);
    for slot in (0..slots).filter(|&slot| level.keeps(slot)) {
        template.push_segment(slot as f32);
    }
    let [first, second, third] = template.goals;
    let coarse: Vec<[f32; 3]> = first.iter().map(|&[cos, sin, latitude, _]| [cos, sin, latitude]).collect();
    let detail: Vec<[f32; 3]> =
        first.iter().map(|&[.., slid_below]| [slid_below, level.most_kept(), level.least_width]).collect();
    // the shapes exist only on the GPU: a copy in the main world would mislead picking and bounding boxes
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, template.around)
        // the shader knows the true normals, but Bevy's normal prepass expects the attribute
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, coarse)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, template.place)
        .with_inserted_attribute(ATTRIBUTE_DETAIL, detail)
        .with_inserted_attribute(ATTRIBUTE_SECOND_GOAL, second)
        .with_inserted_attribute(ATTRIBUTE_THIRD_GOAL, third)
        .with_inserted_indices(Indices::U32(template.indices))
}

struct Template<'a> {
    level: &'a Level,
    around: Vec<[f32; 3]>,
    /// The goals of the vertices, with the radius in pixels below which they have arrived.
    goals: [Vec<[f32; 4]>; MOST_GOALS],
    place: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl<'a> Template<'a> {
    fn new(level: &'a Level) -> Self {
        Self { level, around: Vec::new(), goals: Default::default(), place: Vec::new(), indices: Vec::new() }
    }

    fn push_segment(&mut self, slot: f32) {
        let rings = self.level.shape.cap_rings;
        let near_pole = self.push_pole(slot, 0.0);
        let near_rim = self.push_ring(slot, 0.0, 0);
        let mut ring = self.push_ring(slot, 1.0, 0);
        self.fan(near_pole, near_rim, true);
        self.band(near_rim, ring);
        for cap_ring in 1..=rings {
            let next = self.push_ring(slot, 1.0, cap_ring);
            self.band(ring, next);
            ring = next;
        }
        let far_pole = self.push_pole(slot, 1.0);
        self.fan(far_pole, ring, false);
    }

    fn push_pole(&mut self, slot: f32, end: f32) -> u32 {
        let goals =
            std::array::from_fn(|goal| [1.0, 0.0, 1.0, self.level.goals.get(goal).map_or(0.0, |goal| goal.slid_below)]);
        self.push_vertex(slot, [1.0, 0.0, end], 1.0, goals)
    }

    /// A ring of vertices, counter-clockwise seen from the far end; returns its first index.
    fn push_ring(&mut self, slot: f32, end: f32, cap_ring: u32) -> u32 {
        let first = self.around.len() as u32;
        let own = self.level.shape;
        for side in 0..own.sides {
            let place = RingPlace { side, cap_ring };
            let [cos, sin, latitude] = place.on(own);
            self.push_vertex(slot, [cos, sin, end], latitude, place.goals(own, &self.level.goals));
        }
        first
    }

    fn push_vertex(&mut self, slot: f32, around: [f32; 3], latitude: f32, goals: [[f32; 4]; MOST_GOALS]) -> u32 {
        let index = self.around.len() as u32;
        self.around.push(around);
        self.goals.iter_mut().zip(goals).for_each(|(all, goal)| all.push(goal));
        self.place.push([slot, latitude]);
        index
    }

    /// Two triangles per side between a ring and the next one towards the far end.
    fn band(&mut self, near: u32, far: u32) {
        let sides = self.level.shape.sides;
        for side in 0..sides {
            let next = (side + 1) % sides;
            let (a, b, c, d) = (near + side, near + next, far + next, far + side);
            self.indices.extend([a, b, c, a, c, d]);
        }
    }

    /// One triangle per side between a pole and its ring.
    fn fan(&mut self, pole: u32, ring: u32, near_end: bool) {
        let sides = self.level.shape.sides;
        for side in 0..sides {
            let (a, b) = (ring + side, ring + (side + 1) % sides);
            self.indices.extend(if near_end { [pole, b, a] } else { [pole, a, b] });
        }
    }
}

/// Coarser shapes that a level can have.
const MOST_GOALS: usize = 3;

/// A corner of a ring.
#[derive(Clone, Copy)]
struct RingPlace {
    side: u32,
    cap_ring: u32,
}

impl RingPlace {
    /// Cosine, sine and latitude.
    fn on(self, shape: Shape) -> [f32; 3] {
        let [cos, sin] = corner(self.side, shape.sides);
        [cos, sin, self.cap_ring as f32 / (shape.cap_rings + 1) as f32]
    }

    /// The nearest corner of a coarser polygon, on the ring of its cap at or below this one. Each corner of that
    /// polygon is the goal of some corner, in the same order.
    fn goal(self, own: Shape, next: Shape) -> Self {
        Self {
            side: (2 * self.side * next.sides + own.sides) / (2 * own.sides) % next.sides,
            cap_ring: self.cap_ring * (next.cap_rings + 1) / (own.cap_rings + 1),
        }
    }

    /// Its goals, from shape to shape. It stays at the last.
    fn goals(mut self, mut own: Shape, goals: &[Goal]) -> [[f32; 4]; MOST_GOALS] {
        std::array::from_fn(|goal| {
            let mut slid_below = 0.0;
            if let Some(goal) = goals.get(goal) {
                (self, own, slid_below) = (self.goal(own, goal.shape), goal.shape, goal.slid_below);
            }
            let [cos, sin, latitude] = self.on(own);
            [cos, sin, latitude, slid_below]
        })
    }
}

/// A corner of the polygon for a circle of radius 1, with the circle's width on average over all directions.
fn corner(side: u32, sides: u32) -> [f32; 2] {
    let (sin, cos) = ops::sin_cos(TAU * side as f32 / sides as f32);
    let reach = corner_reach(sides);
    [reach * cos, reach * sin]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::levels::Detail;
    use bevy::{math::Vec3, mesh::VertexAttributeValues};
    use std::collections::BTreeSet;

    const SLOTS: usize = 8;

    fn levels() -> Vec<Level> {
        let detail = |sides, cap_rings| Detail { shape: Shape { sides, cap_rings }, tolerance: 0.25, least_width: 1.0 };
        [detail(3, 0), detail(8, 1), detail(13, 3)].iter().flat_map(Detail::levels).collect()
    }

    fn indices(mesh: &Mesh) -> &[u32] {
        let Some(Indices::U32(indices)) = mesh.indices() else { panic!("32-bit indices") };
        indices
    }

    fn attribute(mesh: &Mesh, attribute: MeshVertexAttribute) -> Vec<Vec3> {
        match mesh.attribute(attribute) {
            Some(VertexAttributeValues::Float32x4(values)) => {
                values.iter().map(|v| Vec3::new(v[0], v[1], v[2])).collect()
            }
            Some(VertexAttributeValues::Float32x3(values)) => values.iter().copied().map(Vec3::from).collect(),
            Some(VertexAttributeValues::Float32x2(values)) => {
                values.iter().map(|v| Vec3::new(v[0], v[1], 0.0)).collect()
            }
            _ => panic!("two to four floats"),
        }
    }

    /// Directed edges of the first segment's triangles.
    fn first_segment_edges(mesh: &Mesh, vertices: u32) -> Vec<(u32, u32)> {
        let triangles = indices(mesh).chunks(3).filter(|triangle| triangle[0] < vertices);
        triangles.flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]).collect()
    }

    #[test]
    fn every_segment_is_a_closed_oriented_surface() {
        for level in levels() {
            let mesh = chunk_mesh(&level, SLOTS);
            let vertices = level.shape.vertices();
            assert_eq!(mesh.count_vertices(), vertices * (0..SLOTS).filter(|&slot| level.keeps(slot)).count());
            let edges = first_segment_edges(&mesh, vertices as u32);
            let unique: BTreeSet<_> = edges.iter().copied().collect();
            assert_eq!(unique.len(), edges.len(), "no edge is used twice in one direction");
            assert!(edges.iter().all(|&(a, b)| unique.contains(&(b, a))), "every edge has its twin");
            let (v, e, f) = (vertices as isize, edges.len() as isize / 2, edges.len() as isize / 3);
            assert_eq!(v - e + f, 2);
        }
    }

    #[test]
    fn triangles_face_outwards() {
        for level in levels() {
            let mesh = chunk_mesh(&level, SLOTS);
            let (around, place) = (attribute(&mesh, Mesh::ATTRIBUTE_POSITION), attribute(&mesh, Mesh::ATTRIBUTE_UV_0));
            // the template as a cylinder: sides only, where normals are radial
            let sides = indices(&mesh).chunks(3).filter(|t| t.iter().all(|&i| place[i as usize].y == 0.0));
            for triangle in sides {
                let [a, b, c] = [0, 1, 2].map(|k| around[triangle[k] as usize]);
                let outwards = (a + b + c) * Vec3::new(1.0, 1.0, 0.0);
                assert!((b - a).cross(c - a).dot(outwards) > 0.0);
            }
        }
    }

    /// A triangle as three points in the space of the template: around, latitude, slot. Those without area are left out.
    type Corner = [i32; 5];
    /// The mesh's triangles after so many slides.
    fn surface(mesh: &Mesh, slides: usize, kept: impl Fn(usize) -> bool) -> BTreeSet<[Corner; 3]> {
        let [around, place] = [Mesh::ATTRIBUTE_POSITION, Mesh::ATTRIBUTE_UV_0].map(|a| attribute(mesh, a));
        let goals = [Mesh::ATTRIBUTE_NORMAL, ATTRIBUTE_SECOND_GOAL, ATTRIBUTE_THIRD_GOAL].map(|a| attribute(mesh, a));
        let corner = |i: u32| {
            let i = i as usize;
            let goal = slides.checked_sub(1).map(|slide| goals[slide][i]);
            let (across, latitude) = goal.map_or((around[i], place[i].y), |goal| (goal, goal.z));
            // all points of a cap with latitude 1 are its pole
            let across = if latitude == 1.0 { Vec3::ZERO } else { across };
            let exact = |x: f32| (x * 1e4).round() as i32;
            [exact(across.x), exact(across.y), around[i].z as i32, exact(latitude), place[i].x as i32]
        };
        let triangles = indices(mesh).chunks(3).map(|t| [corner(t[0]), corner(t[1]), corner(t[2])]);
        triangles
            .filter(|[a, b, c]| a != b && b != c && c != a && kept(a[4] as usize))
            .map(|mut corners| {
                // the same triangle begins at any of its corners
                let first = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
                corners.rotate_left(first);
                corners
            })
            .collect()
    }

    #[test]
    fn a_level_after_a_slide_is_the_next_level() {
        let levels = levels();
        for (at, fine) in levels.iter().enumerate() {
            let mesh = chunk_mesh(fine, 16 * SLOTS);
            for (slides, coarse) in levels[at..].iter().enumerate().take(fine.goals.len() + 1) {
                let coarse_mesh = chunk_mesh(coarse, 16 * SLOTS);
                assert_eq!(
                    surface(&mesh, slides, |_| true),
                    surface(&coarse_mesh, 0, |_| true),
                    "{fine:?} to {coarse:?}"
                );
            }
        }
    }

    #[test]
    fn a_level_without_what_drops_out_is_the_next_level() {
        for pair in levels().windows(2).filter(|pair| pair[1].stride > pair[0].stride) {
            let [fine, coarse] = [&pair[0], &pair[1]].map(|level| chunk_mesh(level, 16 * SLOTS));
            let kept = surface(&fine, 0, |slot| pair[1].keeps(slot));
            assert!(!kept.is_empty());
            assert_eq!(kept, surface(&coarse, 0, |_| true), "{:?} to {:?}", pair[0], pair[1]);
        }
    }

    #[test]
    fn polygons_are_as_wide_as_the_circle_on_the_mean() {
        for sides in [3, 5, 8, 16] {
            let directions = 3600;
            let width = |direction: i32| {
                let (sin, cos) = ops::sin_cos(TAU * direction as f32 / directions as f32);
                let along = (0..sides).map(|side| corner(side, sides)).map(|[x, y]| x * cos + y * sin);
                let (low, high) = along.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
                high - low
            };
            let mean = (0..directions).map(width).sum::<f32>() / directions as f32;
            assert!((mean - 2.0).abs() < 1e-3, "{sides} sides are {mean} wide");
        }
    }
}
