//! Tissues against oracles: analytic moments, brute force, and meshes of known volume.

mod awkward;
mod crossed;
mod fields;
mod no_go;
mod sources;
mod thin;
mod volume;

use bevy_math::{
    Vec3,
    bounding::{Aabb3d, BoundingVolume},
};
use bevy_vessels::synthesis::{
    mesh::{TriangleIndex, TriangleMesh},
    random::{Stream, VesselRng},
    tissue::*,
};
use rand::RngExt;
use std::f32::consts::PI;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn rng(seed: u64) -> VesselRng {
    Stream::Attraction.rng(seed)
}

fn in_cube(rng: &mut VesselRng, half: f32) -> Vec3 {
    Vec3::from_array([0; 3].map(|_| rng.random_range(-half..half)))
}

/// Triangles of random shape and place, degenerate ones among them.
fn random_mesh(triangles: usize, seed: u64) -> Result<TriangleMesh, Box<dyn std::error::Error>> {
    let mut rng = rng(seed);
    let mut positions = Vec::new();
    for i in 0..triangles {
        let corner = in_cube(&mut rng, 1.0);
        let size = if i % 7 == 0 { 1.0 } else { 0.05 };
        positions.push(corner);
        positions.push(corner + in_cube(&mut rng, size));
        positions.push(if i % 11 == 3 { corner } else { corner + in_cube(&mut rng, size) });
    }
    let indices = (0..triangles as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Ok(TriangleMesh::new(positions, indices, None)?)
}

/// Draws samples, checks that the tissue contains them, and returns them.
fn samples(tissue: &dyn Tissue, count: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = rng(seed);
    let points: Vec<Vec3> = (0..count).filter_map(|_| tissue.sample(&mut rng)).collect();
    let bounds = tissue.bounds().grow(bevy_math::Vec3A::splat(1e-4));
    for &point in &points {
        assert!(tissue.contains(point), "{tissue:?} does not contain its sample {point}");
        assert!(bounds.contains(&Aabb3d { min: point.into(), max: point.into() }), "{point} is out of bounds");
    }
    points
}

/// Mean and second central moments.
fn moments(points: &[Vec3]) -> (Vec3, Vec3) {
    let mean = points.iter().sum::<Vec3>() / points.len() as f32;
    let squares = points.iter().map(|p| (p - mean) * (p - mean)).sum::<Vec3>();
    (mean, squares / points.len() as f32)
}

fn assert_moments(tissue: &dyn Tissue, center: Vec3, variance: Vec3) {
    let points = samples(tissue, 40_000, 7);
    assert_eq!(points.len(), 40_000);
    let (mean, spread) = moments(&points);
    let size = variance.max_element().sqrt();
    assert!((mean - center).abs().max_element() < 0.02 * size, "{tissue:?}: mean {mean}, expected {center}");
    let error = (spread - variance).abs().max_element();
    assert!(error < 0.03 * variance.max_element(), "{tissue:?}: variance {spread}, expected {variance}");
}

#[test]
fn shapes_are_sampled_evenly() -> Outcome {
    let center = Vec3::new(1.0, -2.0, 0.5);
    let radius = 0.4f32;
    let flat = radius * radius / 4.0;
    assert_moments(&Disc::new(center, Vec3::Z * 3.0, radius)?, center, Vec3::new(flat, flat, 0.0));
    assert_moments(&Disc::new(center, Vec3::NEG_X, radius)?, center, Vec3::new(0.0, flat, flat));
    let rectangle = Rectangle::new(center, Vec3::X * 3.0, Vec3::Z * 0.5)?;
    assert_moments(&rectangle, center, Vec3::new(3.0, 0.0, 1.0 / 12.0));
    assert_moments(&Ball::new(center, radius)?, center, Vec3::splat(radius * radius / 5.0));
    let size = Vec3::new(1.0, 2.0, 0.1);
    assert_moments(&Cuboid::new(center, size)?, center, size * size / 12.0);
    let half = Vec3::new(0.2, 3.0, 1.0);
    assert_moments(&Ellipsoid::new(center, half)?, center, half * half / 5.0);
    Ok(())
}

#[test]
fn rings_of_a_disc_and_shells_of_a_ball_hold_their_share() -> Outcome {
    let disc = samples(&Disc::flat(1.0)?, 50_000, 3);
    let ball = samples(&Ball::new(Vec3::ZERO, 1.0)?, 50_000, 4);
    // Ten rings of equal area, ten shells of equal volume: chi-square over 9 degrees of freedom, 99.9 % below 27.9.
    for (points, power) in [(disc, 2), (ball, 3)] {
        let mut counts = [0.0; 10];
        for point in &points {
            counts[((point.length().powi(power) * 10.0) as usize).min(9)] += 1.0;
        }
        let expected = points.len() as f64 / 10.0;
        let chi: f64 = counts.iter().map(|count: &f64| (count - expected).powi(2) / expected).sum();
        assert!(chi < 27.9, "chi-square {chi}: {counts:?}");
    }
    Ok(())
}

/// Nearest of many samples: an upper bound that the closest point must not exceed.
fn assert_closest(tissue: &dyn Tissue, seed: u64) {
    let points = samples(tissue, 3000, seed);
    let mut rng = rng(seed + 1);
    let size = tissue.bounds().half_size().max_element();
    for _ in 0..200 {
        let query = Vec3::from(tissue.bounds().center()) + in_cube(&mut rng, 3.0 * size);
        let found = tissue.closest_point(query);
        assert!(tissue.contains(found.position), "{tissue:?} does not contain {found:?}, nearest to {query}");
        let distance = found.position.distance(query);
        let brute = points.iter().map(|p| p.distance(query)).fold(f32::INFINITY, f32::min);
        assert!(distance <= brute + 1e-5 * size, "{tissue:?}: {distance} from {query}, but a sample is {brute} away");
        // No point of the tissue is on the way to the nearest one.
        let before = query.lerp(found.position, 0.9);
        assert!(distance < 1e-3 * size || !tissue.contains(before), "{tissue:?}: {before} is nearer to {query}");
        assert!(found.normal == Vec3::ZERO || found.normal.is_normalized());
    }
    for &point in &points {
        let moved = tissue.closest_point(point).position.distance(point);
        assert!(moved <= 1e-4 * size, "{tissue:?} moves its own {point} by {moved}");
    }
}

#[test]
fn closest_points_of_shapes_are_closest() -> Outcome {
    let center = Vec3::new(1.0, -2.0, 0.5);
    assert_closest(&Disc::new(center, Vec3::new(1.0, 1.0, -0.5), 0.7)?, 1);
    assert_closest(&Rectangle::new(center, Vec3::new(0.0, 0.3, 0.4), Vec3::X * 2.0)?, 2);
    assert_closest(&Ball::new(center, 0.7)?, 3);
    assert_closest(&Cuboid::new(center, Vec3::new(0.1, 2.0, 1.0))?, 4);
    assert_closest(&Ellipsoid::new(center, Vec3::new(0.5, 1.5, 1.0))?, 5);
    assert_closest(&Ellipsoid::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.05))?, 6);
    Ok(())
}

#[test]
fn the_ellipsoids_closest_point_stands_on_its_normal() -> Outcome {
    let half = Vec3::new(0.05, 3.0, 1.0);
    let tissue = Ellipsoid::new(Vec3::ZERO, half)?;
    let mut rng = rng(11);
    for scale in [0.1, 1.0, 30.0, 1e4] {
        for _ in 0..200 {
            let query = in_cube(&mut rng, scale);
            if tissue.contains(query) {
                continue;
            }
            let on = tissue.closest_point(query).position;
            assert!(((on / half).length() - 1.0).abs() < 1e-4, "{on} is not on the ellipsoid");
            let normal = (on / (half * half)).normalize();
            let offset = query - on;
            assert!(offset.length() < 1e-3 || offset.normalize().dot(normal) > 0.9999, "{query} to {on}");
        }
    }
    Ok(())
}

#[test]
fn the_index_answers_as_brute_force_does() -> Outcome {
    for (triangles, seed) in [(1, 1), (2, 2), (5, 3), (40, 4), (900, 5)] {
        let mesh = random_mesh(triangles, seed)?;
        let index = TriangleIndex::new(&mesh);
        let alone: Vec<Option<TriangleIndex>> = (0..triangles)
            .map(|i| TriangleMesh::new(mesh.corners(i).to_vec(), vec![[0, 1, 2]], None).ok())
            .map(|mesh| mesh.map(|mesh| TriangleIndex::new(&mesh)))
            .collect();
        let mut rng = rng(seed);
        for _ in 0..300 {
            let query = in_cube(&mut rng, 1.5);
            let mut brute: Option<(f32, usize)> = None;
            for (triangle, index) in alone.iter().enumerate() {
                let distance = index.as_ref().and_then(|index| index.closest(query)).map(|p| p.distance_squared);
                if let Some(distance) = distance.filter(|&d| brute.is_none_or(|(best, _)| d < best)) {
                    brute = Some((distance, triangle));
                }
            }
            let found = index.closest(query).ok_or("nothing found")?;
            assert_eq!(Some((found.distance_squared, found.triangle)), brute);
            let (radius, near) = (found.distance_squared.sqrt(), query);
            assert!(index.any_within(near, radius * 1.001) && !index.any_within(near, radius * 0.999));
            assert_eq!(index.closest_within(near, radius * 1.001), Some(found));
            assert_eq!(index.closest_within(near, radius * 0.999), None);

            let target = in_cube(&mut rng, 1.5);
            let hits = alone.iter().flatten().filter_map(|index| index.first_hit(query, target));
            let brute = hits.map(|hit| hit.distance_squared).fold(f32::INFINITY, f32::min);
            let found = index.first_hit(query, target).map_or(f32::INFINITY, |hit| hit.distance_squared);
            assert_eq!(found, brute);
        }
    }
    Ok(())
}

#[test]
fn lines_along_the_axes_and_within_planes_hit_what_they_meet() -> Outcome {
    let index = TriangleIndex::new(&grid(8, 1.0)?);
    let found = index.first_hit(Vec3::new(0.3, 0.3, 2.0), Vec3::new(0.3, 0.3, -2.0)).ok_or("missed")?;
    assert_eq!(found.position, Vec3::new(0.3, 0.3, 0.0));
    assert!(index.first_hit(Vec3::new(0.3, 0.3, 2.0), Vec3::new(0.3, 0.3, 0.5)).is_none());
    assert!(index.first_hit(Vec3::new(0.25, 0.25, 1.0), Vec3::new(0.25, 0.25, -1.0)).is_some(), "through a vertex");
    assert!(index.first_hit(Vec3::new(-1.0, 0.5, 0.0), Vec3::new(2.0, 0.5, 0.0)).is_none(), "within the plane");
    assert!(index.first_hit(Vec3::NAN, Vec3::ONE).is_none());
    assert!(index.closest(Vec3::NAN).is_none() && !index.any_within(Vec3::INFINITY, 1.0));
    Ok(())
}

/// A square of side `size` in the plane z = 0, from the origin, of n × n × 2 triangles.
fn grid(n: u32, size: f32) -> Result<TriangleMesh, Box<dyn std::error::Error>> {
    let at = |i: u32, j: u32| Vec3::new(i as f32, j as f32, 0.0) * (size / n as f32);
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| at(i, j))).collect();
    let vertex = |i: u32, j: u32| j * (n + 1) + i;
    let mut triangles = Vec::new();
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        triangles.push([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
        triangles.push([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
    }
    Ok(TriangleMesh::new(positions, triangles, None)?)
}

#[test]
fn a_mesh_surface_is_sampled_by_area() -> Outcome {
    // Fine triangles on one side, coarse ones on the other, slivers and degenerate ones between.
    let fine = grid(40, 1.0)?;
    let mut positions = fine.positions().to_vec();
    let mut triangles = fine.triangles().to_vec();
    let first = positions.len() as u32;
    positions.extend([Vec3::X, Vec3::new(3.0, 0.0, 0.0), Vec3::new(3.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)]);
    triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3], [first, first, first + 1]]);
    let surface = MeshSurface::new(TriangleMesh::new(positions, triangles, None)?)?;
    let Extent::Area(area) = surface.extent() else { return Err("no area".into()) };
    assert!((area - 3.0).abs() < 1e-5);
    assert_moments(&surface, Vec3::new(1.5, 0.5, 0.0), Vec3::new(9.0 / 12.0, 1.0 / 12.0, 0.0));
    // 6 × 2 cells of equal area: chi-square over 11 degrees of freedom, 99.9 % below 31.3.
    let points = samples(&surface, 60_000, 9);
    let mut counts = [0.0; 12];
    for point in &points {
        counts[((point.x * 2.0) as usize).min(5) * 2 + usize::from(point.y > 0.5)] += 1.0;
    }
    let chi: f64 = counts.iter().map(|count: &f64| (count - 5000.0).powi(2) / 5000.0).sum();
    assert!(chi < 31.3, "chi-square {chi}: {counts:?}");
    Ok(())
}

#[test]
fn closest_points_of_mesh_surfaces_are_closest() -> Outcome {
    for seed in 1..4 {
        assert_closest(&MeshSurface::new(random_mesh(60, seed)?)?, seed);
    }
    Ok(())
}

/// A ball of unit radius as a mesh, by longitude and latitude, with separate vertices for each triangle.
fn ball_soup(rings: u32, inward: bool) -> Result<TriangleMesh, Box<dyn std::error::Error>> {
    let at = |i: u32, j: u32| {
        let (polar, around) = (PI * i as f32 / rings as f32, PI * (j % (2 * rings)) as f32 / rings as f32);
        let pole = if i == 0 || i == rings { 0.0 } else { polar.sin() };
        Vec3::new(pole * around.cos(), pole * around.sin(), polar.cos())
    };
    let mut positions = Vec::new();
    for (i, j) in (0..rings).flat_map(|i| (0..2 * rings).map(move |j| (i, j))) {
        let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        positions.extend([quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]]);
    }
    let order = if inward { [0, 2, 1] } else { [0, 1, 2] };
    let triangles = (0..positions.len() as u32 / 3).map(|i| order.map(|corner| 3 * i + corner)).collect();
    Ok(TriangleMesh::new(positions, triangles, None)?)
}

#[test]
fn normals_are_smooth_across_seams_and_point_out() -> Outcome {
    for inward in [false, true] {
        let surface = MeshSurface::new(ball_soup(24, inward)?)?;
        let mut rng = rng(5);
        for _ in 0..500 {
            let query = in_cube(&mut rng, 2.0).normalize() * 1.3;
            let found = surface.closest_point(query);
            let outward = found.position.normalize();
            assert!(found.normal.dot(outward) > 0.999, "{} at {}", found.normal, found.position);
        }
    }
    Ok(())
}

#[test]
fn impossible_shapes_are_refused_by_name() {
    let message = |result: Result<(), TissueError>| result.err().map(|error| error.to_string()).unwrap_or_default();
    assert!(message(Disc::flat(f32::NAN).map(drop)).contains("radius is NaN"));
    assert!(message(Disc::flat(0.0).map(drop)).contains("above 0"));
    assert!(message(Disc::flat(-2.0).map(drop)).contains("radius is -2"));
    assert!(message(Disc::new(Vec3::ZERO, Vec3::ZERO, 1.0).map(drop)).contains("normal"));
    assert!(message(Ball::new(Vec3::splat(f32::INFINITY), 1.0).map(drop)).contains("centre is inf"));
    assert!(message(Cuboid::new(Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0)).map(drop)).contains("side"));
    assert!(message(Ellipsoid::new(Vec3::ZERO, Vec3::new(1.0, 1.0, -1.0)).map(drop)).contains("half axis"));
    assert!(message(Rectangle::new(Vec3::ZERO, Vec3::X, Vec3::ONE).map(drop)).contains("perpendicular"));
}
