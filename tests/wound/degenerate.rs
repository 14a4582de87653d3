//! Blades of triangles on whole numbers, where edges, corners and planes are hit exactly, against rational arithmetic.

use crate::common::{all, rng, tree};
use bevy_math::{I64Vec3, Vec3, vec3};
use bevy_vessels::synthesis::random::VesselRng;
use bevy_vessels::synthesis::tree::{NO_PARENT, VesselTree};
use bevy_vessels::synthesis::wound::{Blade, Severed, severed};
use rand::RngExt;

type Exact = [i128; 3];

fn exact(point: I64Vec3) -> Exact {
    point.to_array().map(i128::from)
}

fn minus(a: Exact, b: Exact) -> Exact {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn cross(a: Exact, b: Exact) -> Exact {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: Exact, b: Exact) -> i128 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

/// The share at which a segment without its start meets a triangle, as a fraction: it solves the plane's equation, then
/// tests the point, times the denominator, against the edges within the plane.
fn fraction(start: I64Vec3, end: I64Vec3, corners: [I64Vec3; 3]) -> Option<(i128, i128)> {
    let (start, end, [a, b, c]) = (exact(start), exact(end), corners.map(exact));
    let normal = cross(minus(b, a), minus(c, a));
    let (mut over, mut under) = (dot(normal, minus(a, start)), dot(normal, minus(end, start)));
    if under < 0 {
        (over, under) = (-over, -under);
    }
    if under == 0 || over <= 0 || over > under {
        return None;
    }
    let along = minus(end, start);
    let point: Exact = std::array::from_fn(|axis| start[axis] * under + along[axis] * over);
    let inside = |u: Exact, v: Exact| {
        let from_u: Exact = std::array::from_fn(|axis| point[axis] - u[axis] * under);
        dot(cross(minus(v, u), from_u), normal) >= 0
    };
    (inside(a, b) && inside(b, c) && inside(c, a)).then_some((over, under))
}

/// All shares at which a segment is severed, without repeats.
fn shares(start: I64Vec3, end: I64Vec3, triangles: &[[I64Vec3; 3]]) -> Vec<f64> {
    let mut found: Vec<(i128, i128)> = triangles.iter().filter_map(|&corners| fraction(start, end, corners)).collect();
    found.sort_by(|a, b| (a.0 * b.1).cmp(&(b.0 * a.1)));
    found.dedup_by(|a, b| a.0 * b.1 == b.0 * a.1);
    found.into_iter().map(|(over, under)| over as f64 / under as f64).collect()
}

fn whole_point(rng: &mut VesselRng, limit: i64) -> I64Vec3 {
    I64Vec3::from_array(std::array::from_fn(|_| rng.random_range(-limit..=limit)))
}

/// A random tree and a random soup, both on whole numbers.
fn case(rng: &mut VesselRng, limit: i64) -> (VesselTree, Vec<I64Vec3>, Vec<[I64Vec3; 3]>) {
    let nodes: Vec<I64Vec3> = (0..12).map(|_| whole_point(rng, limit)).collect();
    let parents = (0..12u32).map(|node| if node % 6 == 0 { NO_PARENT } else { rng.random_range(0..node) }).collect();
    let vertices: Vec<I64Vec3> = (0..5).map(|_| whole_point(rng, limit)).collect();
    // Few vertices and many triangles: most share edges, some have no area.
    let mut pick = || vertices[rng.random_range(0..vertices.len())];
    let triangles = (0..4).map(|_| [pick(), pick(), pick()]).collect();
    let tree = tree(nodes.iter().map(|node| node.as_vec3()).collect(), parents, vec![0.1; 12]);
    (tree, nodes, triangles)
}

#[test]
fn soups_on_whole_numbers_sever_what_rational_arithmetic_says() {
    let mut rng = rng(11);
    let (mut total, mut at_nodes) = (0, 0);
    for round in 0..12_000 {
        // The largest numbers use 15 bits, so that the reference's products of seven fit in 128 bits.
        let limit = [2, 3, 6, 1000, 1 << 15][round % 5];
        let (tree, nodes, triangles) = case(&mut rng, limit);
        let Ok(blade) = Blade::triangles(triangles.iter().map(|corners| corners.map(|c| c.as_vec3())).collect()) else {
            continue;
        };
        let mut found = Vec::new();
        severed(&blade, &tree, all(&tree), &mut found);
        let mut found = found.into_iter();
        for (node, parent) in tree.segments() {
            for expected in shares(nodes[parent], nodes[node], &triangles) {
                let hit = found.next().unwrap_or_else(|| panic!("round {round}: {node} at {expected} not found"));
                assert_eq!(hit.node.index(), node, "round {round}, share {expected}");
                assert!((f64::from(hit.from) - expected).abs() < 1e-7, "round {round}: {hit:?}, not {expected}");
                assert!(hit.from == hit.to && hit.enters && hit.leaves);
                total += 1;
                at_nodes += u32::from(hit.from == 1.0);
            }
        }
        assert_eq!(found.next(), None, "round {round}: more than there is");
    }
    assert!(total > 20_000 && at_nodes > 500, "{total} crossings, {at_nodes} of them at nodes");
}

/// A sheet over a grid of 8 × 8 cells, with random heights, diagonals and windings.
fn sheet(rng: &mut VesselRng, height: i32) -> Blade {
    let heights: Vec<f32> = (0..81).map(|_| rng.random_range(-height..=height) as f32).collect();
    let corner = |x: usize, y: usize| vec3(x as f32, y as f32, heights[9 * y + x]);
    let mut triangles = Vec::new();
    for (x, y) in (0..64).map(|cell| (cell % 8, cell / 8)) {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        let halves = if rng.random() { [[a, b, c], [a, c, d]] } else { [[a, b, d], [d, b, c]] };
        triangles.extend(halves.map(|[a, b, c]| if rng.random() { [a, b, c] } else { [b, a, c] }));
    }
    Blade::triangles(triangles).expect("a sheet")
}

#[test]
fn a_closed_sheet_is_passed_exactly_once_anywhere() {
    let mut rng = rng(12);
    for height in [0, 1, 5] {
        let blade = sheet(&mut rng, height);
        let (mut positions, mut parents) = (Vec::new(), Vec::new());
        // Vertical lines through corners, edges, diagonals and in between.
        for (x, y) in (0..33 * 33).map(|at| (at % 33, at / 33)) {
            let foot = vec3(x as f32 / 4.0, y as f32 / 4.0, 0.0);
            positions.extend([foot - 7.0 * Vec3::Z, foot + 9.0 * Vec3::Z]);
            parents.extend([NO_PARENT, positions.len() as u32 - 2]);
        }
        let lines = positions.len() / 2;
        let tree = tree(positions, parents, vec![0.1; 2 * lines]);
        let mut found = Vec::new();
        severed(&blade, &tree, all(&tree), &mut found);
        let nodes: Vec<usize> = found.iter().map(|hit: &Severed| hit.node.index()).collect();
        let expected: Vec<usize> = (0..lines).map(|line| 2 * line + 1).collect();
        assert_eq!(nodes, expected, "height {height}");
    }
}

#[test]
fn a_blade_through_a_node_severs_one_segment_of_every_way_through_it() {
    // A fork: the trunk 0–1, the node 1, and daughters above, below and beside the blade.
    let ends = [vec3(1.0, 0.0, 1.0), vec3(1.0, 1.0, -1.0), vec3(2.0, 0.0, 0.0)];
    let positions = [vec![vec3(0.0, 0.0, -1.0), vec3(0.5, 0.0, 0.0)], ends.to_vec()].concat();
    let tree = tree(positions, vec![NO_PARENT, 0, 1, 1, 1], vec![0.1; 5]);
    let flat = Blade::rectangle(Vec3::ZERO, 5.0 * Vec3::X, 5.0 * Vec3::Y).unwrap();
    let disc = Blade::disc(Vec3::ZERO, Vec3::Z, 5.0).unwrap();
    for blade in [flat, disc] {
        let mut found = Vec::new();
        severed(&blade, &tree, all(&tree), &mut found);
        let hits: Vec<_> = found.iter().map(|hit| (hit.node.0, hit.from)).collect();
        assert_eq!(hits, [(1, 1.0)], "the trunk, at its node, and no daughter; the one within the plane neither");
    }
}

#[test]
fn successive_sweeps_leave_no_slit_between_them() {
    let mut rng = rng(13);
    // A vessel that the edge shared by two frames' sweeps meets exactly, on a grid where this is exact.
    for _ in 0..2_000 {
        let edges: [[Vec3; 2]; 3] = std::array::from_fn(|frame| {
            let mut end =
                |y: f32| vec3(frame as f32 * 4.0 + rng.random_range(-1..=1) as f32, y, rng.random_range(-1..=1) as f32);
            [end(-4.0), end(4.0)]
        });
        let [low, high] = edges[1];
        let on_edge = low + (high - low) * 0.25 * rng.random_range(1..4) as f32;
        let tree = tree(vec![on_edge - 8.0 * Vec3::Z, on_edge + 8.0 * Vec3::Z], vec![NO_PARENT, 0], vec![0.1; 2]);
        let mut shares = Vec::new();
        for frame in 0..2 {
            let blade = Blade::sweep(edges[frame], edges[frame + 1]).unwrap();
            let mut found = Vec::new();
            severed(&blade, &tree, all(&tree), &mut found);
            assert_eq!(found.len(), 1, "the edge belongs to both sweeps: {edges:?}");
            shares.push(found[0].from);
        }
        assert_eq!(shares[0], shares[1], "and is met at one place: {edges:?}");
    }
}
