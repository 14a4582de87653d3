//! Triangles of a mesh that intersect each other.
//!
//! In: positions and triangles. Out: every pair that meets beyond the vertices and edges that both use; exact, despite
//! rounding. A touch counts. Nothing is welded: vertices are the same if their numbers are.
//!
//! Triangles without an area, and those with a corner that isn't finite, intersect nothing.
//! [`Closure::degenerate_faces`](super::Closure::degenerate_faces) counts them.

use crate::synthesis::{
    mesh::triangle_pair::{Face, has_area, intersect},
    pace::{Pace, at_once},
    space::{box_pairs::BoxPairs, bvh::Bounds},
};
use bevy_math::Vec3;

/// All pairs of triangles that intersect, the lower number first, in order.
///
/// Triangles that share a vertex or an edge intersect if they meet anywhere else. So two triangles that share an edge do
/// if one is folded onto the other, in the same plane. A closed mesh without any pair is the boundary of a solid.
///
/// Takes less than a microsecond for each triangle of a smooth mesh. Memory is linear in triangles and pairs.
///
/// # Panics
/// If a triangle has a vertex that does not exist.
pub fn self_intersections(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    at_once(self_intersections_paced(positions, triangles, &Pace::default()))
}

/// The same as [paced](crate::synthesis::pace) work.
///
/// # Panics
/// If a triangle has a vertex that does not exist.
pub async fn self_intersections_paced(positions: &[Vec3], triangles: &[[u32; 3]], pace: &Pace) -> Vec<[u32; 2]> {
    let corners = |number: u32| corners(positions, triangles[number as usize]);
    let mut numbers: Vec<u32> = Vec::with_capacity(triangles.len());
    let take = |number: usize| {
        if has_area(corners(number as u32)) {
            numbers.push(number as u32);
        }
    };
    pace.part(0.0..0.05).each(triangles.len(), take).await;
    let box_of = |id: usize| Bounds::around(&corners(numbers[id]));
    let boxes = BoxPairs::new_paced(numbers.len(), box_of, &pace.part(0.05..0.4)).await;
    let order = boxes.order();
    let number = |slot: usize| numbers[order[slot] as usize];
    // Made when they are compared: kept, they would take as much memory as all the rest.
    let face = |slot: usize| Face::new(triangles[number(slot) as usize], corners(number(slot)));
    let mut found = Vec::new();
    let compare = |a: usize, b: usize| {
        if intersect(&face(a), &face(b)) {
            found.push(ascending([number(a), number(b)]));
        }
    };
    boxes.each_paced(compare, &pace.part(0.4..0.95)).await;
    pace.part(0.95..1.0).sort(&mut found).await;
    found
}

/// The same among some of the triangles, given by their numbers: for up to a few hundred.
///
/// # Panics
/// If there is no such triangle, or it has a vertex that does not exist.
#[cfg_attr(not(test), expect(dead_code, reason = "a part of this room's interface; nothing calls it yet"))]
pub(crate) fn self_intersections_within(positions: &[Vec3], triangles: &[[u32; 3]], chosen: &[u32]) -> Vec<[u32; 2]> {
    let mut faces: Vec<(Bounds, Face, u32)> = Vec::with_capacity(chosen.len());
    for &number in chosen {
        let vertices = triangles[number as usize];
        let corners = corners(positions, vertices);
        if has_area(corners) {
            faces.push((Bounds::around(&corners), Face::new(vertices, corners), number));
        }
    }
    faces.sort_unstable_by(|(a, _, number), (b, _, other)| a.min.x.total_cmp(&b.min.x).then(number.cmp(other)));
    // A triangle chosen twice is one triangle.
    faces.dedup_by_key(|(_, _, number)| *number);
    let mut found = Vec::new();
    for (at, (bounds, face, number)) in faces.iter().enumerate() {
        let near = faces[at + 1..].iter().take_while(|(other, ..)| other.min.x <= bounds.max.x);
        for (_, other, second) in near.filter(|(other, ..)| other.overlaps(bounds)) {
            if intersect(face, other) {
                found.push(ascending([*number, *second]));
            }
        }
    }
    found.sort_unstable();
    found
}

fn corners(positions: &[Vec3], [a, b, c]: [u32; 3]) -> [Vec3; 3] {
    [positions[a as usize], positions[b as usize], positions[c as usize]]
}

fn ascending([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use crate::synthesis::{
        mesh::{
            intersections::*,
            test_shapes::{Shape, cube, joined, torus},
        },
        random::Stream,
    };
    use rand::{Rng, RngExt};

    /// Every pair with an area, by number.
    fn by_brute_force((positions, triangles): &Shape) -> Vec<[u32; 2]> {
        let corners = |number: usize| corners(positions, triangles[number]);
        let face = |number: usize| Face::new(triangles[number], corners(number));
        let mut found = Vec::new();
        for a in (0..triangles.len()).filter(|&number| has_area(corners(number))) {
            for b in (a + 1..triangles.len()).filter(|&number| has_area(corners(number))) {
                if intersect(&face(a), &face(b)) {
                    found.push([a as u32, b as u32]);
                }
            }
        }
        found
    }

    /// Random triangles between few places of a grid: many share vertices and edges, lie in one plane, or have no area.
    fn soup(places: usize, count: usize, side: i32, rng: &mut impl Rng) -> Shape {
        let mut place = || Vec3::from_array(std::array::from_fn(|_| rng.random_range(0..side) as f32));
        let positions = (0..places).map(|_| place()).collect();
        let mut corner = || rng.random_range(0..places as u32);
        (positions, (0..count).map(|_| [corner(), corner(), corner()]).collect())
    }

    fn check(shape: &Shape) -> usize {
        let expected = by_brute_force(shape);
        let (positions, triangles) = shape;
        assert_eq!(self_intersections(positions, triangles), expected);
        let all: Vec<u32> = (0..triangles.len() as u32).rev().chain([0]).collect();
        assert_eq!(self_intersections_within(positions, triangles, &all), expected);
        let third = |number: &u32| number.is_multiple_of(3);
        let some: Vec<u32> = (0..triangles.len() as u32).filter(third).collect();
        let among: Vec<[u32; 2]> = expected.iter().copied().filter(|pair| pair.iter().all(third)).collect();
        assert_eq!(self_intersections_within(positions, triangles, &some), among);
        expected.len()
    }

    #[test]
    fn soups_have_the_pairs_of_brute_force() {
        let mut rng = Stream::Statistics.rng(7);
        let mut pairs = 0;
        for (places, count, side) in [(3, 1, 2), (5, 20, 2), (30, 60, 3), (200, 80, 9), (600, 300, 60)] {
            for _ in 0..10 {
                pairs += check(&soup(places, count, side, &mut rng));
            }
        }
        assert!(pairs > 5_000, "only {pairs} pairs");
    }

    #[test]
    fn closed_shapes_have_none_until_they_meet() {
        for (around, across) in [(3, 3), (24, 12), (150, 80)] {
            let (positions, triangles) = torus(around, across);
            assert_eq!(self_intersections(&positions, &triangles), [[0; 2]; 0], "{around} by {across}");
        }
        assert_eq!(check(&cube(Vec3::ZERO)), 0);
        // Joined at a corner or along an edge they share vertices; a step away they don't meet.
        for at in [Vec3::splat(2.0), Vec3::new(2.0, 2.0, 0.0), Vec3::splat(2.0f32.next_up())] {
            assert_eq!(check(&joined(cube(Vec3::ZERO), cube(at))), 0, "at {at}");
        }
        for at in [Vec3::ONE, Vec3::new(2.0, 2.0, 1.0), Vec3::new(1.0, 0.0, 0.0)] {
            assert!(check(&joined(cube(Vec3::ZERO), cube(at))) > 0, "at {at}");
        }
    }

    #[test]
    fn a_torus_pulled_through_itself_has_the_pairs_of_brute_force() {
        let (mut positions, triangles) = torus(24, 12);
        positions[5] *= -1.3;
        let found = check(&(positions, triangles));
        assert!(found > 10, "only {found} pairs");
    }

    #[test]
    fn triangles_without_an_area_meet_nothing() {
        let (mut positions, mut triangles) = cube(Vec3::ZERO);
        positions.extend([Vec3::ONE, Vec3::splat(5.0), Vec3::NAN, Vec3::INFINITY]);
        triangles.extend([[0, 8, 9], [8, 8, 9], [0, 8, 10], [1, 8, 11], [10, 11, 10]]);
        assert_eq!(check(&(positions, triangles)), 0);
        assert!(self_intersections(&[], &[]).is_empty() && self_intersections_within(&[], &[], &[]).is_empty());
    }

    #[test]
    fn pauses_change_nothing_and_progress_ends_at_one() {
        let (positions, triangles) = soup(800, 3000, 40, &mut Stream::Statistics.rng(8));
        let pace = Pace::new(|| true);
        let found = at_once(self_intersections_paced(&positions, &triangles, &pace));
        assert!(found.len() > 1000 && found == self_intersections(&positions, &triangles));
        assert_eq!(pace.progress(), 1.0);
    }
}
