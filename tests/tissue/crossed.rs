//! Volumes of meshes that are no proper surface: they touch or cross themselves, or are open.

use super::{
    Outcome, in_cube, rng,
    volume::{Mesh, cuboid, joined, moved, winding, without},
};
use bevy_math::{Quat, Vec3};
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    mesh::TriangleMesh,
    roots::{RootPlacement, RootPlacements},
    tissue::{MeshVolume, Tissue},
    tree::{VesselKind, statistics::coverage},
};
use std::sync::Arc;

/// A tube along a closed curve that may cross itself, of square section.
fn tube(curve: impl Fn(f32) -> Vec3, width: f32, parts: u32) -> Mesh {
    let mut positions = Vec::new();
    for part in 0..parts {
        let at = |k: u32| curve(std::f32::consts::TAU * (k % parts) as f32 / parts as f32);
        let along = (at(part + 1) - at(part + parts - 1)).normalize();
        let side = along.cross(Vec3::Z).normalize();
        let up = side.cross(along);
        positions.extend(
            [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[u, v]| at(part) + (side * u + up * v) * width),
        );
    }
    let corner = |part: u32, k: u32| 4 * (part % parts) + k % 4;
    let quads = (0..parts).flat_map(|part| (0..4).map(move |k| (part, k)));
    let triangles = quads.flat_map(|(part, k)| {
        let [a, b, c, d] = [corner(part, k), corner(part, k + 1), corner(part + 1, k + 1), corner(part + 1, k)];
        [[a, b, c], [a, c, d]]
    });
    Ok(TriangleMesh::new(positions, triangles.collect(), None)?)
}

/// Merges vertices at the same place, so that edges and corners are shared.
fn welded(mesh: &TriangleMesh) -> Mesh {
    let mut positions: Vec<Vec3> = Vec::new();
    let place = |position: &Vec3, positions: &mut Vec<Vec3>| {
        positions.iter().position(|other| other == position).unwrap_or_else(|| {
            positions.push(*position);
            positions.len() - 1
        }) as u32
    };
    let of: Vec<u32> = mesh.positions().iter().map(|position| place(position, &mut positions)).collect();
    let triangles = mesh.triangles().iter().map(|corners| corners.map(|corner| of[corner as usize])).collect();
    Ok(TriangleMesh::new(positions, triangles, None)?)
}

fn meshes() -> Result<Vec<(&'static str, TriangleMesh)>, Box<dyn std::error::Error>> {
    let cube = cuboid(Vec3::ZERO, Vec3::ONE)?;
    let beside = |offset: Vec3| welded(&joined(&[cube.clone(), moved(&cube, |p| p + offset)?])?);
    let eight = tube(|t| Vec3::new(t.sin(), (2.0 * t).sin(), 0.0), 0.2, 40)?;
    let flap = |from: Vec3, to: Vec3| TriangleMesh::new(vec![from, to, to + Vec3::Z], vec![[0, 1, 2]], None);
    Ok(vec![
        ("two cubes at an edge", beside(Vec3::new(1.0, 1.0, 0.0))?),
        ("two cubes at a corner", beside(Vec3::ONE)?),
        ("two cubes at a face", beside(Vec3::X)?),
        ("two cubes, half a face", beside(Vec3::new(1.0, 0.5, 0.0))?),
        ("two cubes across a slit", joined(&[cube.clone(), moved(&cube, |p| p + Vec3::X * 1.02)?])?),
        ("a tube that crosses itself", eight.clone()),
        ("the same, turned", moved(&eight, |p| Quat::from_rotation_x(0.9) * Quat::from_rotation_y(0.4) * p)?),
        ("a box without a triangle", without(&cube, 7)?),
        ("a box with a flap", joined(&[cube.clone(), flap(Vec3::ONE, Vec3::splat(2.5))?])?),
        ("a box with a flap at an edge", welded(&joined(&[cube.clone(), flap(Vec3::X, Vec3::X * 2.0 + Vec3::Y)?])?)?),
        ("a box with an inner wall", welded(&joined(&[cube, cuboid(Vec3::ZERO, Vec3::new(0.5, 1.0, 1.0))?])?)?),
    ])
}

#[test]
fn closest_points_are_inside_whatever_the_mesh() -> Outcome {
    for (name, mesh) in meshes()? {
        let volume = MeshVolume::new(&mesh, 24).map_err(|error| format!("{name}: {error}"))?;
        let mut rng = rng(11);
        let mut tests = Vec::new();
        // Anywhere around, and near the triangles, edges and corners, where more than two may meet.
        tests.extend((0..800).map(|_| in_cube(&mut rng, 3.0)));
        for triangle in 0..mesh.triangles().len() {
            let [a, b, c] = mesh.corners(triangle);
            for place in [a, a.midpoint(b), (a + b + c) / 3.0] {
                tests.extend([1e-6, 1e-3, 0.1].map(|offset| place + in_cube(&mut rng, offset)));
                tests.push(place);
            }
        }
        for point in tests {
            let closest = volume.closest_point(point).position;
            assert!(volume.contains(closest), "{name}: {closest}, nearest to {point}, is outside");
        }
    }
    Ok(())
}

/// Every node is inside, by the solid angle of the mesh, no step is longer than the step length, and both parts of a
/// volume are reached that hang together.
#[test]
fn vessels_stay_inside_and_never_jump() -> Outcome {
    for (name, mesh) in meshes()? {
        let volume = Arc::new(MeshVolume::new(&mesh, 24)?);
        let settings = ColonizationSettings { samples: 600, ..ColonizationSettings::default() };
        let settings = settings.fit(volume.extent()).scaled(1.5);
        let step = settings.arterial.step_length;
        let roots = RootPlacements { artery: RootPlacement::Spread(2), ..RootPlacements::default() };
        let mut growth = Colonization::new(Arc::clone(&volume) as Arc<dyn Tissue>, settings, &roots.into(), 4)?;
        growth.run();
        for kind in Colonization::KINDS {
            let tree = growth.tree(kind);
            for (node, parent) in tree.segments() {
                let length = tree.positions()[node].distance(tree.positions()[parent]);
                assert!(length <= step * 1.0001, "{name}: a step of {length} instead of {step}");
            }
            for (node, &position) in tree.positions().iter().enumerate() {
                assert!(volume.contains(position), "{name}: node {node} at {position} is outside");
            }
            let angles = tree.positions().iter().step_by(7).map(|&position| winding(&mesh, position).abs());
            let outside = angles.clone().filter(|&angle| angle < 0.2).count();
            assert!(outside * 200 <= angles.count(), "{name}: {outside} nodes have no mesh around them");
        }
        let mut rng = rng(5);
        let probes: Vec<Vec3> = (0..500).filter_map(|_| volume.sample(&mut rng)).collect();
        let covered = coverage(growth.tree(VesselKind::Artery), &probes, 3.0 * step).ok_or("samples")?;
        println!("{name}: {covered} covered by {} nodes", growth.tree(VesselKind::Artery).len());
        assert!(covered > 0.95, "{name}: {covered} covered");
    }
    Ok(())
}
