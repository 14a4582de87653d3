//! Every answer of the index against brute force, and the limits of its cells.

use crate::synthesis::random::Stream;
use crate::synthesis::space::point_grid::*;
use rand::RngExt;

fn unit_box() -> Aabb3d {
    Aabb3d::new(Vec3::splat(0.5), Vec3::splat(0.5))
}

/// Random points, one in five of them outside the box, some of them equal, and some removed.
fn grid(seed: u64, flat: bool) -> (PointGrid, Vec<Option<Vec3>>) {
    let mut rng = Stream::Statistics.rng(seed);
    let mut grid = PointGrid::new(&unit_box(), 0.07);
    let mut twin: Vec<Option<Vec3>> = Vec::new();
    for i in 0..600u32 {
        let mut point = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.1..1.1)));
        if flat {
            point.z = 0.0;
        }
        if i % 50 == 7 {
            point = grid.point(i / 2);
        }
        assert_eq!(grid.push(point), i);
        twin.push(Some(point));
    }
    for id in (0..600u32).step_by(7) {
        grid.remove(id);
        twin[id as usize] = None;
    }
    for id in (0..600u32).step_by(21) {
        let point = Vec3::splat(rng.random_range(0.0..1.0));
        grid.replace(id, point);
        twin[id as usize] = Some(point);
    }
    (grid, twin)
}

fn brute_nearest(twin: &[Option<Vec3>], center: Vec3, radius: f32, step: u32) -> Option<(u32, f32)> {
    let candidates = twin.iter().enumerate().filter_map(|(id, p)| p.map(|p| (id as u32, p.distance_squared(center))));
    candidates
        .filter(|&(id, distance)| id % step == 0 && distance <= radius * radius)
        .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
}

#[test]
fn answers_equal_brute_force() {
    for seed in 0..6 {
        let (mut grid, twin) = grid(seed, seed % 2 == 0);
        let mut rng = Stream::Roots.rng(seed);
        let (mut marked, mut some_marked) = (0, 0);
        for cell in [0.07, 0.021, 0.4] {
            grid.resize_cells(cell);
            for _ in 0..200 {
                let center = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.2..1.2)));
                let radius = rng.random_range(0.0..0.3);
                let expected = brute_nearest(&twin, center, radius, 1);
                assert_eq!(grid.nearest_within(center, radius, |_| true), expected);
                assert_eq!(grid.any_within(center, radius), expected.is_some());
                let mut marks = [false, true];
                grid.mark_beside(&[center, center], radius, &mut marks);
                assert!(marks[1] && (!marks[0] || expected.is_some()));
                marked += u32::from(marks[0]);
                let odd = brute_nearest(&twin, center, radius, 3);
                assert_eq!(grid.nearest_within(center, radius, |id| id % 3 == 0), odd);
                assert_eq!(grid.any_of_within(center, radius, |id| id % 3 == 0), odd.is_some());
                let mut marks = [false, true];
                grid.mark_beside_of(&[center, center], radius, &mut marks, |id, at| id % 3 == 0 && at == center);
                assert!(marks[1] && (!marks[0] || odd.is_some()));
                some_marked += u32::from(marks[0]);
                let mut count = 0;
                grid.for_each_within(center, radius, |_, _| count += 1);
                let all = twin.iter().flatten().filter(|p| p.distance_squared(center) <= radius * radius).count();
                assert_eq!(count, all);
            }
        }
        assert!(marked > 20, "only {marked} were found in their own cells");
        assert!(some_marked > 5, "only {some_marked} of every third were found in their own cells");
    }
}

#[test]
fn extreme_cells_and_queries_neither_overflow_nor_hang() {
    for cell in [0.0, 1e-30, f32::NAN, f32::INFINITY, 1e30] {
        let mut grid = PointGrid::new(&unit_box(), cell);
        grid.push(Vec3::splat(0.3));
        assert!(grid.any_within(Vec3::splat(0.31), 0.1), "cell {cell}");
        assert!(!grid.any_within(Vec3::splat(9.0), 0.1));
    }
    let flat = Aabb3d::new(Vec3::ZERO, Vec3::new(1.0, 0.0, 0.0));
    let grid = PointGrid::new(&flat, 0.1);
    assert!(!grid.any_within(Vec3::ZERO, 1.0));
}

#[test]
fn answers_equal_brute_force_in_boxes_of_any_proportions() {
    for x in 1..=9 {
        for (y, z) in [(1, 1), (2, 7), (5, 3), (8, 2), (9, 9), (16, 4), (24, 2)] {
            let size = Vec3::new(x as f32, y as f32, z as f32);
            let mut grid = PointGrid::new(&Aabb3d { min: Vec3::ZERO.into(), max: size.into() }, 0.26);
            let mut rng = Stream::Roots.rng(u64::from(x as u32 * 100 + y as u32));
            let mut place = || size * Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.02..1.02)));
            let points: Vec<Vec3> = (0..40 * x * y * z / 9).map(|_| place()).collect();
            points.iter().for_each(|&point| _ = grid.push(point));
            for number in 0..200 {
                let center = place();
                let radius = [0.05, 0.12, 0.129][number % 3];
                let expected = points.iter().any(|point| point.distance_squared(center) <= radius * radius);
                assert_eq!(grid.any_within(center, radius), expected, "{size}: {center} {radius}");
            }
        }
    }
}
