//! Vessels grow on and in real organs, including awkward files.
//!
//! The organs are stored beside the checkout, as `CONTRIBUTING.md` says; without them these tests are skipped.

#![cfg(feature = "mesh_files")]

#[path = "common/shared.rs"]
mod shared;

use bevy_math::{DVec2, DVec3, Mat3, Vec3};
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    io::load_mesh,
    mesh::TriangleMesh,
    roots::Roots,
    tissue::{MeshSurface, MeshVolume, Tissue, TissueError},
    tree::VesselKind,
};
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

/// Awkward files with an open surface, whose inside is not defined.
const OPEN: [&str; 2] = ["colon_vhf_original", "pancreas_vhf_v2_original"];

/// All organs in a folder, by name.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a readable folder");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "glb"));
    paths.sort();
    assert!(!paths.is_empty(), "no organ in {}", folder.display());
    paths
}

/// All organs with their names: the good ones first, then the awkward ones.
fn organs() -> impl Iterator<Item = (String, TriangleMesh)> {
    let folders = ["data/organs", "data/organs/awkward"].into_iter().filter_map(shared::folder);
    folders.flat_map(|folder| files(&folder)).map(|path| {
        let name = path.file_stem().expect("a file name").to_string_lossy().into_owned();
        let mesh = load_mesh(&path).unwrap_or_else(|error| panic!("{error}"));
        (name, mesh)
    })
}

/// Grows a few steps with default settings, fitted to the organ, and checks invariants of any growth.
fn grow(name: &str, tissue: Arc<dyn Tissue>, steps: u32, samples: u32) -> Colonization {
    let settings = ColonizationSettings { steps, samples, ..ColonizationSettings::default() }.fit(tissue.extent());
    let mut growth =
        Colonization::new(tissue, settings, &Roots::default(), 5).unwrap_or_else(|error| panic!("{name}: {error}"));
    growth.run();
    for kind in Colonization::KINDS {
        let tree = growth.tree(kind);
        tree.validate().unwrap_or_else(|error| panic!("{name}, {}: {error}", kind.name()));
        let residual = tree.murray_residual(growth.settings().system(kind).expect("it is grown").bifurcation_exponent);
        assert!(residual <= 1e-5, "{name}, {}: Murray's residual is {residual}", kind.name());
    }
    growth
}

fn nodes(growth: &Colonization) -> impl Iterator<Item = Vec3> + '_ {
    Colonization::KINDS.into_iter().flat_map(|kind| growth.tree(kind).positions().iter().copied())
}

/// Distance of a point from a triangle by its definition: the plane's foot if it lies within, else the nearest edge.
fn distance_to_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let edges = [(a, b), (b, c), (c, a)];
    let within = edges.iter().all(|&(from, to)| (to - from).cross(point - from).dot(normal) >= 0.0);
    if within && normal.length_squared() > 0.0 {
        return (point - a).dot(normal.normalize()).abs();
    }
    let to_edge = |(from, to): (DVec3, DVec3)| {
        let along = to - from;
        let share = if along == DVec3::ZERO { 0.0 } else { (point - from).dot(along) / along.length_squared() };
        point.distance(from + share.clamp(0.0, 1.0) * along)
    };
    edges.map(to_edge).into_iter().fold(f64::INFINITY, f64::min)
}

#[test]
fn vessels_grow_on_the_surface_of_every_organ() {
    for (name, mesh) in organs() {
        let triangles: Vec<[DVec3; 3]> = (0..mesh.triangles().len())
            .map(|triangle| mesh.corners(triangle).map(|corner| corner.as_dvec3()))
            .collect();
        let tissue = Arc::new(MeshSurface::new(mesh).unwrap_or_else(|error| panic!("{name}: {error}")));
        let diameter = f64::from(tissue.extent().equivalent_diameter());
        let growth = grow(&name, tissue, 100, 1000);
        let arterial = growth.tree(VesselKind::Artery).len();
        assert!(arterial > 100, "{name}: only {arterial} arterial nodes grew");
        let every = nodes(&growth).count().div_ceil(60);
        for node in nodes(&growth).step_by(every) {
            let distance = triangles.iter().map(|&corners| distance_to_triangle(node.as_dvec3(), corners));
            let distance = distance.fold(f64::INFINITY, f64::min);
            assert!(distance <= 1e-5 * diameter, "{name}: a node lies {distance} beside the surface");
        }
        println!("{name}: {arterial} arterial, {} venous nodes", growth.tree(VesselKind::Vein).len());
    }
}

/// Winding number of the surface around each point, counted along a ray.
///
/// The ray's direction differs from all axes of the mesh, so that it hits no edge.
fn windings(mesh: &TriangleMesh, points: &[Vec3]) -> Vec<i32> {
    let turn = Mat3::from_rotation_x(0.713_248) * Mat3::from_rotation_y(1.137_519);
    let turned = |point: Vec3| turn.as_dmat3() * point.as_dvec3();
    let points: Vec<DVec3> = points.iter().map(|&point| turned(point)).collect();
    let mut windings = vec![0; points.len()];
    for triangle in 0..mesh.triangles().len() {
        let corners = mesh.corners(triangle).map(turned);
        let [a, b, c] = corners.map(DVec3::truncate);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let area = (b - a).perp_dot(c - a);
        for (point, winding) in points.iter().zip(&mut windings) {
            let at = point.truncate();
            if at.cmplt(low).any() || at.cmpgt(high).any() || area == 0.0 {
                continue;
            }
            let share = |from: DVec2, to: DVec2| (to - from).perp_dot(at - from) / area;
            let (of_a, of_b, of_c) = (share(b, c), share(c, a), share(a, b));
            let height = of_a * corners[0].z + of_b * corners[1].z + of_c * corners[2].z;
            if of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0 && height > point.z {
                *winding += if area > 0.0 { 1 } else { -1 };
            }
        }
    }
    windings
}

#[test]
fn vessels_grow_inside_every_organ() {
    for (name, mesh) in organs() {
        let volume = match MeshVolume::new(&mesh, 96) {
            Ok(volume) => volume,
            Err(TissueError::NoInside { .. }) if OPEN.contains(&name.as_str()) => continue,
            Err(error) => panic!("{name}: {error}"),
        };
        let growth = grow(&name, Arc::new(volume), 30, 3000);
        let arterial = growth.tree(VesselKind::Artery).len();
        assert!(arterial > 100, "{name}: only {arterial} arterial nodes grew");
        let positions: Vec<Vec3> = nodes(&growth).collect();
        let outside = windings(&mesh, &positions).into_iter().filter(|&winding| winding == 0).count();
        println!("{name}: {outside} of {} nodes outside", positions.len());
        let closed = !OPEN.contains(&name.as_str());
        assert!(!closed || outside * 200 <= positions.len(), "{name}: {outside} of {} nodes outside", positions.len());
    }
}

#[test]
fn the_oracles_are_right_about_a_tetrahedron() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let mesh = TriangleMesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], None).expect("a mesh");
    let points = [Vec3::splat(0.1), Vec3::splat(0.4), Vec3::new(0.3, 0.3, -0.01), Vec3::new(0.8, 0.1, 0.05)];
    assert_eq!(windings(&mesh, &points), [1, 0, 0, 1]);
    let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
    for (point, distance) in [
        (DVec3::new(0.2, 0.2, 0.7), 0.7),
        (DVec3::new(0.5, -2.0, 0.0), 2.0),
        (DVec3::new(-3.0, -4.0, 0.0), 5.0),
        (DVec3::new(1.0, 1.0, 0.0), 0.5_f64.sqrt()),
    ] {
        assert!((distance_to_triangle(point, triangle) - distance).abs() < 1e-12, "{point}");
    }
}
