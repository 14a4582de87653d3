//! Volumes of meshes with a known inside.

use super::{Outcome, assert_moments, ball_soup, grid, in_cube, random_mesh, rng, samples};
use bevy_math::{DVec3, Vec3};
use bevy_vessels::synthesis::{
    mesh::{TriangleMesh, VoxelError},
    tissue::{Extent, MeshVolume, Tissue, TissueError},
};
use rand::RngExt;

pub type Mesh = Result<TriangleMesh, Box<dyn std::error::Error>>;

/// A box of twelve triangles, facing outwards.
pub fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let positions =
        (0..8u8).map(|i| Vec3::select(bevy_math::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), max, min)).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Ok(TriangleMesh::new(positions, triangles, None)?)
}

fn unit_cube() -> Mesh {
    cuboid(Vec3::ZERO, Vec3::ONE)
}

pub fn joined(meshes: &[TriangleMesh]) -> Mesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for mesh in meshes {
        let first = positions.len() as u32;
        positions.extend_from_slice(mesh.positions());
        triangles.extend(mesh.triangles().iter().map(|corners| corners.map(|vertex| vertex + first)));
    }
    Ok(TriangleMesh::new(positions, triangles, None)?)
}

pub fn without(mesh: &TriangleMesh, triangle: usize) -> Mesh {
    let mut triangles = mesh.triangles().to_vec();
    triangles.remove(triangle);
    Ok(TriangleMesh::new(mesh.positions().to_vec(), triangles, None)?)
}

fn soup(mesh: &TriangleMesh) -> Mesh {
    let positions = (0..mesh.triangles().len()).flat_map(|triangle| mesh.corners(triangle)).collect();
    let triangles = (0..mesh.triangles().len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Ok(TriangleMesh::new(positions, triangles, None)?)
}

pub fn moved(mesh: &TriangleMesh, place: impl Fn(Vec3) -> Vec3) -> Mesh {
    let positions = mesh.positions().iter().map(|&position| place(position)).collect();
    Ok(TriangleMesh::new(positions, mesh.triangles().to_vec(), None)?)
}

pub fn volume_of(tissue: &MeshVolume) -> f32 {
    match tissue.extent() {
        Extent::Volume(volume) | Extent::Sheet { volume, .. } => volume,
        other => panic!("a volume has the extent {other:?}"),
    }
}

#[track_caller]
fn assert_volume(mesh: &TriangleMesh, expected: f32) -> MeshVolume {
    let volume = MeshVolume::new(mesh, 64).unwrap_or_else(|error| panic!("{error}"));
    let found = volume_of(&volume);
    assert!((found / expected - 1.0).abs() < 0.02, "volume {found}, expected {expected}");
    samples(&volume, 2000, 3);
    volume
}

/// Winding number of a mesh around a point, by the solid angles of its triangles (van Oosterom & Strackee 1983).
pub fn winding(mesh: &TriangleMesh, point: Vec3) -> f64 {
    let solid_angle = |triangle| {
        let [a, b, c]: [DVec3; 3] = mesh.corners(triangle).map(|corner| corner.as_dvec3() - point.as_dvec3());
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let above = a.dot(b.cross(c));
        2.0 * above.atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    (0..mesh.triangles().len()).map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[test]
fn a_cube_is_a_cube_however_its_mesh_is_made() -> Outcome {
    let cube = unit_cube()?;
    for resolution in [1, 2, 3, 10, 32] {
        let volume = volume_of(&MeshVolume::new(&cube, resolution)?);
        assert!((volume - 1.0).abs() < 0.01, "{volume} with {resolution} voxels");
    }
    assert_volume(&soup(&cube)?, 1.0);
    assert_volume(&cube.clone().with_flipped(|_| true), 1.0);
    assert_volume(&cube.clone().with_flipped(|triangle| triangle % 3 == 0), 1.0);
    assert_volume(&soup(&cube)?.with_flipped(|triangle| triangle == 5), 1.0);
    assert_volume(&joined(&[cube.clone(), cube.clone()])?, 1.0);
    assert_volume(&joined(&[cube.clone(), cube.clone().with_flipped(|_| true)])?, 1.0);
    for triangle in 0..12 {
        let volume = assert_volume(&without(&cube, triangle)?, 1.0);
        assert!(volume.contains(Vec3::splat(0.5)) && !volume.contains(Vec3::new(0.5, 0.5, -0.2)));
    }
    Ok(())
}

#[test]
fn size_and_place_do_not_matter() -> Outcome {
    let cube = unit_cube()?;
    assert_volume(&moved(&cube, |p| p * 1e-6)?, 1e-18);
    assert_volume(&moved(&cube, |p| p * 1e6)?, 1e18);
    assert_volume(&moved(&cube, |p| p + Vec3::new(1000.0, -500.0, 200.0))?, 1.0);
    assert_volume(&moved(&cube, |p| p * Vec3::new(1.0, 0.01, 0.3))?, 0.003);
    Ok(())
}

#[test]
fn shells_unite_unless_one_is_a_cavity() -> Outcome {
    let cube = unit_cube()?;
    let core = cuboid(Vec3::splat(0.25), Vec3::splat(0.75))?;
    let inward = |mesh: &TriangleMesh| mesh.clone().with_flipped(|_| true);
    assert_volume(&joined(&[cube.clone(), core.clone()])?, 1.0);
    let hollow = assert_volume(&joined(&[cube.clone(), inward(&core)])?, 0.875);
    assert!(!hollow.contains(Vec3::splat(0.5)) && hollow.contains(Vec3::splat(0.1)));
    assert_volume(&joined(&[inward(&cube), core.clone()])?, 0.875);
    assert_volume(&joined(&[inward(&cube), inward(&core)])?, 1.0);
    // A cavity with a core of its own.
    let seed = cuboid(Vec3::splat(0.4), Vec3::splat(0.6))?;
    assert_volume(&joined(&[cube.clone(), inward(&core), seed])?, 0.883);

    let aside = cuboid(Vec3::new(0.5, 0.1, 0.2), Vec3::new(1.5, 0.8, 0.9))?;
    let union = 1.0 + 0.49 - 0.245;
    for other in [aside.clone(), inward(&aside), soup(&aside)?] {
        assert_volume(&joined(&[cube.clone(), other.clone()])?, union);
        assert_volume(&joined(&[inward(&cube), other])?, union);
    }
    let apart = cuboid(Vec3::splat(2.0), Vec3::splat(3.0))?;
    let both = assert_volume(&joined(&[cube, inward(&apart)])?, 2.0);
    assert!(both.contains(Vec3::splat(2.5)) && both.contains(Vec3::splat(0.5)) && !both.contains(Vec3::splat(1.5)));
    Ok(())
}

#[test]
fn a_ball_matches_its_mesh_point_for_point() -> Outcome {
    for mesh in [ball_soup(16, false)?, ball_soup(16, true)?] {
        let volume = assert_volume(&mesh, mesh.signed_volume().abs() as f32);
        let mut rng = rng(8);
        for _ in 0..2000 {
            let point = in_cube(&mut rng, 1.1);
            assert_eq!(volume.contains(point), winding(&mesh, point).abs() > 0.5, "at {point}");
        }
    }
    let mesh = ball_soup(40, false)?;
    let volume = mesh.signed_volume() as f32;
    let spread = (volume / std::f32::consts::PI * 0.75).cbrt().powi(2) / 5.0;
    assert_moments(&MeshVolume::new(&mesh, 24)?, Vec3::ZERO, Vec3::splat(spread));
    Ok(())
}

#[test]
fn samples_fill_a_volume_evenly() -> Outcome {
    // Three unit cubes in an L, two of them overlapping: as a union, 3 wide cells of equal volume.
    let mesh = joined(&[
        cuboid(Vec3::ZERO, Vec3::new(2.0, 1.0, 1.0))?,
        cuboid(Vec3::new(0.5, 0.2, 0.2), Vec3::new(1.5, 0.9, 0.8))?,
        cuboid(Vec3::new(0.0, 0.9, 0.0), Vec3::new(1.0, 2.0, 1.0))?,
    ])?;
    for resolution in [3, 11, 50] {
        let volume = MeshVolume::new(&mesh, resolution)?;
        let points = samples(&volume, 30_000, 5);
        assert_eq!(points.len(), 30_000);
        // 24 half cubes: chi-square over 23 degrees of freedom, 99.9 % below 49.7.
        let mut counts = std::collections::BTreeMap::new();
        for point in points {
            *counts.entry((point * 2.0).floor().as_ivec3().to_array()).or_insert(0.0) += 1.0;
        }
        assert_eq!(counts.len(), 24);
        let chi: f64 = counts.values().map(|count: &f64| (count - 1250.0).powi(2) / 1250.0).sum();
        assert!(chi < 49.7, "chi-square {chi} with {resolution} voxels");
    }
    Ok(())
}

#[test]
fn closest_points_are_inside_and_near() -> Outcome {
    let mesh = joined(&[
        ball_soup(20, false)?,
        moved(&ball_soup(12, false)?, |p| p * 0.4 + Vec3::X * 1.2)?,
        cuboid(Vec3::new(-0.1, -2.0, -0.1), Vec3::new(0.1, -1.5, 0.1))?,
    ])?;
    let volume = MeshVolume::new(&mesh, 48)?;
    let surface = bevy_vessels::synthesis::mesh::TriangleIndex::new(&mesh);
    let mut rng = rng(17);
    for _ in 0..3000 {
        let point = in_cube(&mut rng, 3.0);
        let found = volume.closest_point(point);
        assert!(volume.contains(found.position), "{found:?} is outside");
        assert_eq!(found.normal, Vec3::ZERO);
        if volume.contains(point) {
            assert_eq!(found.position, point);
        } else {
            let distance = surface.closest(point).map_or(0.0, |p| p.distance_squared.sqrt());
            let excess = found.position.distance(point) - distance;
            assert!(excess < 0.6 * volume.voxel_size(), "{excess} too far from {point}");
        }
    }
    assert!(volume.closest_point(Vec3::splat(1e30)).position.is_finite());
    assert!(!volume.contains(Vec3::NAN) && volume.closest_point(Vec3::NAN).position.is_nan());
    Ok(())
}

#[test]
fn what_encloses_nothing_is_refused() -> Outcome {
    let triangle = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]], None)?;
    let tilted = moved(&grid(5, 1.0)?, |p| p + Vec3::Z * (0.3 * p.x - 0.2 * p.y))?;
    for sheet in [triangle, grid(5, 1.0)?, tilted] {
        for resolution in [1, 16, 64] {
            assert_eq!(MeshVolume::new(&sheet, resolution).err(), Some(TissueError::NoInside { resolution }));
        }
    }
    let cube = unit_cube()?;
    assert_eq!(MeshVolume::new(&cube, 0).err(), Some(TissueError::Voxels(VoxelError::NoResolution)));
    for resolution in [1000, u32::MAX] {
        assert!(matches!(
            MeshVolume::new(&cube, resolution),
            Err(TissueError::Voxels(VoxelError::TooManyVoxels { .. }))
        ));
    }
    Ok(())
}

#[test]
fn any_heap_of_triangles_is_a_volume_or_an_error() -> Outcome {
    let mut rng = rng(23);
    for seed in 0..60 {
        let mesh = random_mesh(4 + 3 * seed as usize, seed)?;
        let Ok(volume) = MeshVolume::new(&mesh, 1 + seed as u32 / 2) else { continue };
        for point in samples(&volume, 50, seed) {
            assert!(point.is_finite());
        }
        for _ in 0..20 {
            let point = in_cube(&mut rng, 2.0);
            assert!(volume.closest_point(point).position.is_finite());
        }
    }
    // A triangle as long as the mesh, in a thousand slightly different copies: one non-manifold fan.
    let mut positions = vec![Vec3::ZERO, Vec3::X];
    positions.extend((0..1000).map(|_| Vec3::new(0.5, rng.random(), rng.random())));
    let fan = TriangleMesh::new(positions, (2..1002).map(|i| [0, 1, i]).collect(), None)?;
    drop(MeshVolume::new(&fan, 64));
    Ok(())
}
