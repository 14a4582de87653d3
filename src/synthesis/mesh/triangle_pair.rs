//! Whether two triangles intersect, exact despite rounding.
//!
//! In: two triangles with an area, by vertices and corners. Out: whether they share a point beyond the vertices that
//! both use. A touch counts.
//!
//! Most pairs are told apart by a [proof](super::separation) in f32. The others are decided by the signs of
//! [`exact_side`](crate::synthesis::space::exact_side), as by Guigue and Devillers, "Fast and Robust Triangle-Triangle
//! Overlap Test Using Orientation Predicates" (2003): two triangles intersect if an edge of one meets the other.

use crate::synthesis::{
    mesh::separation::{are_apart, are_spread, open_from},
    space::exact_side::{orientation, orientation_2d},
};
use bevy_math::{Vec2, Vec3, Vec3A};

/// Bound of the rounding error of a component of a cross product of two differences, as a multiple of their sizes: 8 ε
/// are enough, ε = 2⁻⁵³.
const CROSS_ERROR: f64 = 8.0 * f64::EPSILON;

/// The edges of a triangle by its corners. The last is opposite the first corner.
const EDGES: [[usize; 2]; 3] = [[0, 1], [2, 0], [1, 2]];

/// A triangle of a mesh, in one line of the processor's cache.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    /// The positions of its vertices.
    corners: [Vec3A; 3],
    /// Their numbers.
    vertices: [u32; 3],
}

impl Face {
    /// A triangle with the given numbers and positions of vertices.
    pub fn new(vertices: [u32; 3], [a, b, c]: [Vec3; 3]) -> Self {
        Self { corners: [a.into(), b.into(), c.into()], vertices }
    }
}

/// Whether corners are finite and not on one line: exact.
pub(crate) fn has_area(corners: [Vec3; 3]) -> bool {
    if !corners.iter().all(|corner| corner.is_finite()) {
        return false;
    }
    let [a, b, c] = corners;
    let (u, v) = (b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3());
    let size = u.abs().max_element().max(v.abs().max_element());
    u.cross(v).abs().max_element() > CROSS_ERROR * size * size || projection(corners).is_some()
}

/// Whether two triangles share a point beyond the vertices and edges that both use. Both must have an
/// [area](has_area).
///
/// Triangles with one common vertex intersect if they meet anywhere else. Those with a common edge intersect if one is
/// folded onto the other. Those with the same three vertices intersect.
pub(crate) fn intersect(first: &Face, second: &Face) -> bool {
    let (of_first, of_second) = common(first.vertices, second.vertices);
    let count = of_first.count_ones();
    let (first, second) = (rotated(first.corners, of_first), rotated(second.corners, of_second));
    match count {
        0 => !are_apart(first, second) && meet(first, second, 0),
        1 => !open_from(first, second) && meet(first, second, 1),
        2 => !are_spread(first, second) && is_folded(first, second),
        _ => true,
    }
}

/// The corners that two triangles have in common, as bits, in each of them.
fn common(first: [u32; 3], second: [u32; 3]) -> (u32, u32) {
    let (mut of_first, mut of_second) = (0, 0);
    for (a, vertex) in first.iter().enumerate() {
        for (b, other) in second.iter().enumerate() {
            let is_same = u32::from(vertex == other);
            of_first |= is_same << a;
            of_second |= is_same << b;
        }
    }
    (of_first, of_second)
}

/// The corners, rotated so that the common ones are the first.
fn rotated(corners: [Vec3A; 3], common: u32) -> [Vec3A; 3] {
    let [a, b, c] = corners;
    match common {
        0b010 | 0b110 => [b, c, a],
        0b100 | 0b101 => [c, a, b],
        _ => [a, b, c],
    }
}

/// Whether one of two triangles with a common edge, that of their first two corners, lies on the other.
pub(super) fn is_folded(first: [Vec3A; 3], second: [Vec3A; 3]) -> bool {
    let (first, d) = (first.map(Vec3::from), Vec3::from(second[2]));
    let [a, b, c] = first;
    if orientation(a, b, c, d) != 0.0 {
        return false;
    }
    let Some(flat) = projection(first) else { return false };
    let [a, b, c, d] = [a, b, c, d].map(flat);
    same_side(&[orientation_2d(a, b, c), orientation_2d(a, b, d)])
}

/// Whether two triangles share a point beyond the first corner, if that is common, or any.
///
/// What they share is convex. A ray in it, from the common corner, leaves one of them by the opposite edge.
pub(super) fn meet(first: [Vec3A; 3], second: [Vec3A; 3], common: usize) -> bool {
    let (first, second) = (first.map(Vec3::from), second.map(Vec3::from));
    edges_meet(first, second, common) || edges_meet(second, first, common)
}

/// Whether an edge of one triangle meets the other. With a common corner, which is the first, only the opposite edge
/// counts.
fn edges_meet(edges_of: [Vec3; 3], other: [Vec3; 3], common: usize) -> bool {
    let [a, b, c] = other;
    let mut sides = [0.0; 3];
    for (side, corner) in sides.iter_mut().zip(edges_of).skip(common) {
        *side = orientation(a, b, c, corner);
    }
    let edges = if common == 0 { &EDGES[..] } else { &EDGES[2..] };
    edges.iter().any(|edge| edge_meets(edge.map(|end| edges_of[end]), edge.map(|end| sides[end]), other))
}

/// Whether a segment, whose ends are on the given sides of a triangle's plane, meets the triangle.
fn edge_meets([p, q]: [Vec3; 2], sides: [f64; 2], triangle: [Vec3; 3]) -> bool {
    if same_side(&sides) {
        return false;
    }
    if sides == [0.0; 2] {
        return edge_meets_in_plane([p, q], triangle);
    }
    let [a, b, c] = triangle;
    let around = [orientation(p, q, a, b), orientation(p, q, b, c), orientation(p, q, c, a)];
    !(around.iter().any(|&side| side > 0.0) && around.iter().any(|&side| side < 0.0))
}

/// Whether a segment in the plane of a triangle meets it.
fn edge_meets_in_plane(ends: [Vec3; 2], triangle: [Vec3; 3]) -> bool {
    let Some(flat) = projection(triangle) else { return false };
    let ([p, q], [a, b, c]) = (ends.map(flat), triangle.map(flat));
    let around = [(a, b), (b, c), (c, a)];
    // If it crosses no edge, it is inside or outside as a whole.
    let sides = around.map(|(from, to)| orientation_2d(from, to, p));
    let is_inside = !(sides.iter().any(|&side| side > 0.0) && sides.iter().any(|&side| side < 0.0));
    is_inside || around.iter().any(|&(from, to)| segments_meet([p, q], [from, to]))
}

/// Whether two segments in a plane share a point.
fn segments_meet([p, q]: [Vec2; 2], [a, b]: [Vec2; 2]) -> bool {
    let of_first = [orientation_2d(a, b, p), orientation_2d(a, b, q)];
    if of_first == [0.0; 2] {
        // They are on one line, so they meet if their boxes do.
        return p.min(q).cmple(a.max(b)).all() && a.min(b).cmple(p.max(q)).all();
    }
    !same_side(&of_first) && !same_side(&[orientation_2d(p, q, a), orientation_2d(p, q, b)])
}

/// A projection along an axis under which a triangle keeps an area. `None` if it has none.
fn projection(corners: [Vec3; 3]) -> Option<fn(Vec3) -> Vec2> {
    let along: [fn(Vec3) -> Vec2; 3] =
        [|point| point.truncate(), |point| Vec2::new(point.y, point.z), |point| Vec2::new(point.z, point.x)];
    along.into_iter().find(|&flat| {
        let [a, b, c] = corners.map(flat);
        orientation_2d(a, b, c) != 0.0
    })
}

/// Whether two numbers are both positive, or both negative.
fn same_side(sides: &[f64; 2]) -> bool {
    sides.iter().all(|&side| side > 0.0) || sides.iter().all(|&side| side < 0.0)
}

#[cfg(test)]
mod tests {
    use crate::synthesis::{mesh::triangle_pair::*, random::Stream};
    use bevy_math::{I64Vec3, vec3};
    use rand::{Rng, RngExt};

    type Whole = [i128; 3];

    fn minus(u: Whole, v: Whole) -> Whole {
        [u[0] - v[0], u[1] - v[1], u[2] - v[2]]
    }

    fn cross(u: Whole, v: Whole) -> Whole {
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    }

    fn dot(u: Whole, v: Whole) -> i128 {
        u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    }

    fn normal([a, b, c]: [Whole; 3]) -> Whole {
        cross(minus(b, a), minus(c, a))
    }

    /// Whether a triangle and a triangle or segment share no point: by separating axes, which are complete for them.
    fn are_separate(triangle: [Whole; 3], other: &[Whole]) -> bool {
        let sides = |points: &[Whole]| -> Vec<Whole> {
            (0..points.len()).map(|at| minus(points[(at + 1) % points.len()], points[at])).collect()
        };
        let (first, second, across) = (sides(&triangle), sides(other), normal(triangle));
        let mut axes = vec![across];
        axes.extend(first.iter().chain(&second).map(|&side| cross(across, side)));
        axes.extend(first.iter().flat_map(|&u| second.iter().map(move |&v| cross(u, v))));
        if let &[a, b, c] = other {
            axes.push(normal([a, b, c]));
        }
        axes.into_iter().any(|axis| {
            let range = |points: &[Whole]| {
                let along = points.iter().map(|&point| dot(axis, point));
                (along.clone().min().unwrap_or(0), along.max().unwrap_or(0))
            };
            let ((low, high), (other_low, other_high)) = (range(&triangle), range(other));
            low > other_high || other_low > high
        })
    }

    /// Whether triangles, whose first so many corners are common, meet beyond them: in whole numbers.
    fn by_whole_numbers(first: [I64Vec3; 3], second: [I64Vec3; 3], common: usize) -> bool {
        let [first, second] = [first, second].map(|corners| corners.map(|corner| corner.to_array().map(i128::from)));
        let [a, b, c] = first;
        match common {
            0 => !are_separate(first, &second),
            // They meet elsewhere if the opposite edge of one meets the other enlarged. The factor is above all areas
            // in the grid, so that it stands for one beyond all bounds.
            1 => {
                let large = second.map(|corner| [0, 1, 2].map(|axis| a[axis] + (corner[axis] - a[axis]) * 1_000_000));
                !are_separate(large, &[b, c])
            }
            2 => {
                let (one, other) = (normal(first), normal([a, b, second[2]]));
                cross(one, other) == [0; 3] && dot(one, other) > 0
            }
            _ => true,
        }
    }

    /// Vertices of two triangles with so many in common. They are rotated and reversed, too.
    fn numbered(common: usize, rng: &mut impl Rng) -> ([usize; 3], [usize; 3]) {
        let mut orders = [[0, 1, 2]; 2];
        for order in &mut orders {
            order.rotate_left(rng.random_range(0..3));
            if rng.random_bool(0.5) {
                order.swap(0, 2);
            }
        }
        let second = orders[1].map(|place: usize| if place < common { place } else { place + 3 });
        (orders[0], second)
    }

    /// Compares random triangles in a grid with whole numbers. Returns how many met.
    fn compare(common: usize, limit: i64, rounds: usize, rng: &mut impl Rng) -> usize {
        let mut met = 0;
        for _ in 0..rounds {
            let mut points: [I64Vec3; 6] =
                std::array::from_fn(|_| I64Vec3::from_array(std::array::from_fn(|_| rng.random_range(0..=limit))));
            if rng.random_bool(0.3) {
                // In the plane of the first triangle, or a step off it.
                let step = I64Vec3::new(0, 0, rng.random_range(-1..=1));
                points[4] = points[3] + (points[1] - points[0]) + step;
                points[5] = points[3] + (points[2] - points[0]) * rng.random_range(-1..=1);
            }
            if rng.random_bool(0.2) {
                points[rng.random_range(3..6)] = points[rng.random_range(0..3)];
            }
            let (first, second) = numbered(common, rng);
            let corners = |numbers: [usize; 3]| numbers.map(|number| points[number].as_vec3());
            let face = |numbers: [usize; 3]| Face::new(numbers.map(|number| number as u32), corners(numbers));
            if !has_area(corners(first)) || !has_area(corners(second)) {
                continue;
            }
            let in_order = |from: usize| {
                std::array::from_fn(|place| if place < common { points[place] } else { points[place + from] })
            };
            let expected = by_whole_numbers(in_order(0), in_order(3), common);
            met += usize::from(expected);
            assert_eq!(intersect(&face(first), &face(second)), expected, "{first:?}, {second:?} of {points:?}");
            assert_eq!(intersect(&face(second), &face(first)), expected, "{second:?}, {first:?} of {points:?}");
        }
        met
    }

    #[test]
    fn pairs_meet_as_they_do_in_whole_numbers() {
        let mut rng = Stream::Statistics.rng(5);
        for common in 0..=3 {
            for limit in [1, 2, 4, 9, 100] {
                let met = compare(common, limit, 15_000, &mut rng);
                assert!(met > 100, "only {met} pairs met, {common} common, limit {limit}");
            }
            // All bits of an f32, with room for the offsets above; an enlarged triangle would be too large.
            if common != 1 {
                compare(common, (1 << 22) - 1, 5_000, &mut rng);
            }
        }
    }

    /// Whether two triangles of the same list of positions intersect.
    fn meets(positions: &[Vec3], first: [u32; 3], second: [u32; 3]) -> bool {
        let [first, second] =
            [first, second].map(|vertices| Face::new(vertices, vertices.map(|vertex| positions[vertex as usize])));
        assert_eq!(intersect(&first, &second), intersect(&second, &first));
        intersect(&first, &second)
    }

    #[test]
    fn touches_count_beyond_common_vertices_only() {
        let third = vec3(0.25, 0.25, 0.0);
        // The triangle 0 1 2 in the plane z = 0, and others around it.
        let around = [
            (third, Vec3::Z, vec3(1.0, 0.0, 1.0), true, "a vertex inside"),
            (third.with_z(f32::MIN_POSITIVE), Vec3::Z, vec3(1.0, 0.0, 1.0), false, "a vertex just above"),
            (vec3(0.5, 0.5, 0.0), vec3(2.0, 2.0, 1.0), vec3(2.0, 3.0, 0.0), true, "a vertex on an edge: a T-junction"),
            (vec3(1.0, 0.0, 0.0), vec3(2.0, 0.0, 1.0), vec3(3.0, 0.0, 0.0), true, "two vertices in one place"),
            (vec3(0.5, -1.0, -1.0), vec3(0.5, 1.0, 1.0), vec3(3.0, 0.0, 0.0), true, "an edge through an edge"),
            (third - Vec3::Z, third + Vec3::Z, vec3(3.0, 3.0, 0.0), true, "an edge through the inside"),
            (vec3(0.1, 0.1, 0.0), third, vec3(0.1, 0.2, 0.0), true, "one inside the other"),
            (vec3(-9.0, -9.0, 0.0), vec3(9.0, -9.0, 0.0), vec3(0.0, 99.0, 0.0), true, "one around the other"),
            (vec3(1.0, 1.0, 0.0), vec3(2.0, 1.0, 0.0), vec3(1.0, 2.0, 0.0), false, "in the same plane, beside it"),
            (vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 1.0), vec3(0.0, 1.0, 1.0), false, "in a parallel plane"),
        ];
        for (a, b, c, expected, what) in around {
            let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, a, b, c];
            assert_eq!(meets(&positions, [0, 1, 2], [3, 4, 5]), expected, "{what}");
        }
    }

    #[test]
    fn neighbours_meet_if_one_pokes_through_or_lies_on_the_other() {
        let positions = [
            Vec3::ZERO,
            Vec3::X,
            Vec3::Y,
            vec3(0.5, 0.5, 1.0),
            vec3(0.25, 0.25, -1.0),
            vec3(0.5, 0.25, 0.0),
            vec3(-1.0, 0.0, 0.0),
            vec3(0.0, -1.0, 0.0),
            vec3(2.0, 2.0, 0.0),
        ];
        let of = |first, second| meets(&positions, first, second);
        assert!(of([0, 1, 2], [0, 3, 4]), "pokes through from a common vertex");
        assert!(of([0, 1, 2], [0, 5, 3]), "touches with an edge from a common vertex");
        assert!(!of([0, 1, 2], [0, 3, 7]), "rises from a common vertex");
        assert!(of([0, 1, 2], [0, 5, 8]), "overlaps in the plane from a common vertex");
        assert!(!of([0, 1, 2], [0, 6, 7]), "the other way in the plane");
        assert!(!of([0, 1, 2], [0, 3, 1]) && !of([0, 1, 2], [1, 0, 7]), "edges, raised and flat");
        assert!(of([0, 1, 2], [0, 1, 5]) && of([0, 1, 2], [8, 1, 0]), "folded over an edge");
        assert!(of([0, 1, 2], [2, 1, 0]), "the same vertices");
    }

    #[test]
    fn area_is_exact_and_finite() {
        let [a, b] = [vec3(1.0, 2.0, 3.0), vec3(3.0, 6.0, 9.0)];
        assert!(!has_area([a, b, a.midpoint(b)]) && !has_area([a, b, b]) && !has_area([a, a, a]));
        assert!(has_area([a, b, a.midpoint(b).with_x(2.0f32.next_up())]));
        assert!(
            has_area([Vec3::ZERO, Vec3::X * 1e-44, Vec3::Y * 1e-44]) && has_area([Vec3::ZERO, Vec3::X * 3e38, Vec3::Y])
        );
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(!has_area([a, b.with_y(bad), Vec3::ZERO]));
        }
    }
}
