//! The outline of a union of round cones within a ball, by marching tetrahedra.
//!
//! In: round cones and a ball. Out: triangles around the union, as far as tetrahedra reach that have a corner in the
//! ball. Every triangle lies in one tetrahedron of a lattice and cuts its edges between their ends, so that no two
//! triangles meet and none is without area.
//!
//! Source: Doi & Koide, "An efficient method of triangulating equi-valued surfaces by using tetrahedral cells" (1991).

use super::ball::Ball;
use super::tubes::Cone;
use bevy_math::{UVec3, Vec3};

/// The most points of a lattice.
const MOST_POINTS: f32 = (1 << 20) as f32;
/// Steps beyond a round cone up to which distances are known.
const BEYOND: f32 = 2.0;
/// The nearest that a vertex comes to a point of the lattice, as a share of the edge that it lies on.
const LEAST_SHARE: f32 = 0.08;
/// The corners of the six tetrahedra of a cube, as bits of x, y and z: each a way from the first corner to the last.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// Triangles, anticlockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub(super) struct Outline {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// Distances at the points of a lattice.
struct Lattice {
    origin: Vec3,
    step: f32,
    size: UVec3,
    values: Vec<f32>,
}

/// The outline of the union of some round cones in a ball, from tetrahedra of about this size. `None` if they take too
/// much memory.
pub(super) fn outline(cones: &[Cone], ball: &Ball, step: f32) -> Option<Outline> {
    let lattice = Lattice::of(cones, ball, step)?;
    let mut keys: Vec<[u64; 3]> = Vec::new();
    for z in 0..lattice.size.z - 1 {
        for y in 0..lattice.size.y - 1 {
            for x in 0..lattice.size.x - 1 {
                lattice.cut_cube(UVec3::new(x, y, z), ball, &mut keys);
            }
        }
    }
    Some(lattice.mesh(&keys))
}

impl Lattice {
    fn of(cones: &[Cone], ball: &Ball, step: f32) -> Option<Self> {
        let half = ball.radius + 2.0 * step;
        let origin = ball.center - half;
        let side = (2.0 * half / step).ceil() + 1.0;
        if !(side.powi(3) <= MOST_POINTS) {
            return None;
        }
        let size = UVec3::splat(side as u32);
        let mut lattice = Self { origin, step, size, values: vec![f32::MAX; (size.x * size.y * size.z) as usize] };
        for cone in cones {
            lattice.draw(cone);
        }
        Some(lattice)
    }

    fn index(&self, point: UVec3) -> usize {
        ((point.z * self.size.y + point.y) * self.size.x + point.x) as usize
    }

    fn position(&self, point: UVec3) -> Vec3 {
        self.origin + point.as_vec3() * self.step
    }

    /// Lowers the distances around a round cone to those from it.
    fn draw(&mut self, cone: &Cone) {
        let [low, high] = cone.bounds().map(|corner| (corner - self.origin) / self.step);
        let last = (self.size - 1).as_vec3();
        let (from, to) = ((low - BEYOND).floor().max(Vec3::ZERO), (high + BEYOND).ceil().min(last));
        if !from.cmple(to).all() {
            return;
        }
        let (from, to) = (from.as_uvec3(), to.as_uvec3());
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    let point = UVec3::new(x, y, z);
                    let distance = cone.distance(self.position(point)).0;
                    let value = &mut self.values[((z * self.size.y + y) * self.size.x + x) as usize];
                    *value = value.min(distance);
                }
            }
        }
    }

    /// Adds the triangles of a cube that has a corner in the ball.
    fn cut_cube(&self, cube: UVec3, ball: &Ball, keys: &mut Vec<[u64; 3]>) {
        let corner = |bits: u32| cube + UVec3::new(bits & 1, bits >> 1 & 1, bits >> 2);
        let corners: [usize; 8] = std::array::from_fn(|bits| self.index(corner(bits as u32)));
        let inside = corners.map(|point| self.values[point] < 0.0);
        if inside == [inside[0]; 8] {
            return;
        }
        if (0..8).any(|bits| ball.height(self.position(corner(bits))) < 0.0) {
            for tetrahedron in TETRAHEDRA {
                cut(tetrahedron, &corners, &inside, keys);
            }
        }
    }

    fn mesh(&self, keys: &[[u64; 3]]) -> Outline {
        let mut edges: Vec<u64> = keys.iter().flatten().copied().collect();
        edges.sort_unstable();
        edges.dedup();
        let point = |index: u64| {
            let (row, x) = (index as u32 / self.size.x, index as u32 % self.size.x);
            (self.position(UVec3::new(x, row % self.size.y, row / self.size.y)), self.values[index as usize])
        };
        let vertex = |&edge: &u64| {
            let [(a, from), (b, to)] = [edge >> 32, edge & u64::from(u32::MAX)].map(point);
            // Beyond what is known, an edge is cut in its middle.
            let share = if from.max(to) < f32::MAX { from / (from - to) } else { 0.5 };
            a.lerp(b, share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE))
        };
        let number = |edge: u64| edges.partition_point(|&other| other < edge) as u32;
        Outline {
            positions: edges.iter().map(vertex).collect(),
            triangles: keys.iter().map(|corners| corners.map(number)).collect(),
        }
    }
}

/// Adds the triangles of a tetrahedron, each corner as the edge of the lattice on which it lies.
fn cut(tetrahedron: [usize; 4], corners: &[usize; 8], inside: &[bool; 8], keys: &mut Vec<[u64; 3]>) {
    let edge = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|place| corners[tetrahedron[place]] as u64);
        (a.min(b) << 32) | a.max(b)
    };
    // Places of the corners within first. All tetrahedra turn the same way, so the parity of this order decides which
    // way a triangle faces.
    let mut order = [0, 1, 2, 3];
    order.sort_by_key(|&place| !inside[tetrahedron[place]]);
    let is_even = is_even(order);
    let mut add = |[a, b, c]: [u64; 3]| keys.push(if is_even { [a, b, c] } else { [a, c, b] });
    let [a, b, c, d] = order;
    match order.iter().filter(|&&place| inside[tetrahedron[place]]).count() {
        1 => add([edge(a, b), edge(a, c), edge(a, d)]),
        2 => {
            add([edge(a, c), edge(a, d), edge(b, d)]);
            add([edge(a, c), edge(b, d), edge(b, c)]);
        }
        3 => add([edge(d, a), edge(d, b), edge(d, c)]),
        _ => {}
    }
}

fn is_even(order: [usize; 4]) -> bool {
    let inversions = (0..4).flat_map(|second| (0..second).map(move |first| (first, second)));
    inversions.filter(|&(first, second)| order[first] > order[second]).count() % 2 == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::mesh::{Closure, self_intersections};

    fn cone(centers: [Vec3; 2], radii: [f32; 2]) -> Cone {
        Cone { trunk: 0, lengths: [0.0, 1.0], centers, radii }
    }

    fn volume(outline: &Outline) -> f32 {
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| outline.positions[vertex as usize]);
        outline.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn the_outline_of_a_ball_and_of_a_cross_is_closed_around_their_volume() {
        let all = Ball { center: Vec3::ZERO, radius: 2.0 };
        let ball = [cone([Vec3::ZERO; 2], [1.0; 2])];
        let tube = |axis: Vec3| cone([-axis, axis], [0.25; 2]);
        // Two tubes: each a cylinder with two half balls; both share a Steinmetz solid.
        let alone = std::f32::consts::PI * 0.25f32.powi(2) * (2.0 + 4.0 / 3.0 * 0.25);
        let cases = [
            (&ball[..], 4.0 / 3.0 * std::f32::consts::PI),
            (&[tube(Vec3::X), tube(Vec3::Y)], 2.0 * alone - 16.0 / 3.0 * 0.25f32.powi(3)),
        ];
        for (cones, expected) in cases {
            let outline = outline(cones, &all, 0.05).unwrap();
            let closure = Closure::of(&outline.positions, &outline.triangles);
            assert!(closure.is_closed() && closure.is_oriented() && closure.is_manifold(), "{closure:?}");
            assert_eq!((closure.euler(), closure.degenerate_faces), (2, 0));
            assert!(self_intersections(&outline.positions, &outline.triangles).is_empty());
            assert!((volume(&outline) / expected - 1.0).abs() < 0.02, "{} of {expected}", volume(&outline));
        }
    }

    #[test]
    fn a_lattice_of_too_many_points_is_refused() {
        let ball = Ball { center: Vec3::ZERO, radius: 2.0 };
        assert!(outline(&[cone([Vec3::ZERO; 2], [1.0; 2])], &ball, 1e-3).is_none());
    }
}
