//! Making the triangles of a mesh face the way that winding numbers need.

use crate::synthesis::mesh::{TriangleMesh, topology::Patches};
use crate::synthesis::{
    mesh::{triangle_index::TriangleIndex, voxels::crossing},
    space::bvh::Bounds,
};
use bevy_math::{DVec2, Vec3};

/// Points of a shell that must all be enclosed for it to count as a cavity.
const PROBES: usize = 9;

/// Turns triangles that face the other way than those around them, and closed shells that face the other way than the
/// largest, unless they are cavities in it. `index` is that of the mesh.
///
/// Also tells of which triangles the neighbours are missing or out of order: of none if the result is closed.
pub(crate) fn oriented(mesh: TriangleMesh, index: &TriangleIndex) -> (TriangleMesh, Vec<bool>) {
    let topology = mesh.topology();
    let misoriented = topology.misoriented(&mesh);
    let mesh = mesh.with_flipped(|triangle| misoriented[triangle]);
    let (patches, closed) = topology.manifold_patches();
    let volumes = shell_volumes(&mesh, &patches);
    let largest =
        volumes.iter().fold(0.0f64, |largest, volume| if volume.abs() > largest.abs() { *volume } else { largest });
    let against: Vec<bool> =
        volumes.iter().zip(closed).map(|(volume, closed)| closed && volume * largest < 0.0).collect();
    let loose =
        |turned: &dyn Fn(usize) -> bool| topology.unbalanced(|triangle| misoriented[triangle] != turned(triangle));
    if !against.contains(&true) {
        return (mesh, loose(&|_| false));
    }
    let mut members = vec![Vec::new(); patches.count];
    for (triangle, patch) in patches.of_triangle.iter().enumerate() {
        if let Some(patch) = patch {
            members[*patch as usize].push(triangle);
        }
    }
    let facing_right = |triangle: usize| patches.of_triangle[triangle].is_some_and(|patch| !against[patch as usize]);
    let flip: Vec<bool> = (0..patches.count)
        .map(|patch| {
            let step = members[patch].len().div_ceil(PROBES).max(1);
            let mut probes = members[patch].iter().step_by(step).map(|&triangle| mesh.corners(triangle)[0]);
            against[patch] && !probes.all(|probe| is_enclosed(probe, &mesh, index, facing_right))
        })
        .collect();
    let turned = |triangle: usize| patches.of_triangle[triangle].is_some_and(|patch| flip[patch as usize]);
    let loose = loose(&turned);
    (mesh.with_flipped(turned), loose)
}

/// Signed volume of every part of the surface.
fn shell_volumes(mesh: &TriangleMesh, patches: &Patches) -> Vec<f64> {
    let mut volumes = vec![0.0; patches.count];
    let origin = mesh.corners(0)[0];
    for (triangle, patch) in patches.of_triangle.iter().enumerate() {
        if let Some(patch) = patch {
            volumes[*patch as usize] += crate::synthesis::mesh::tetrahedron_volume(mesh.corners(triangle), origin);
        }
    }
    volumes
}

/// Whether the triangles that `counts` lets through wind around a point, seen along z.
fn is_enclosed(point: Vec3, mesh: &TriangleMesh, index: &TriangleIndex, counts: impl Fn(usize) -> bool) -> bool {
    let region = Bounds { min: point.into(), max: point.with_z(f32::INFINITY).into() };
    let mut winding = 0;
    index.overlapping(&region, |_, triangle| {
        // The mesh's own corners: it was reoriented after it was indexed.
        let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let flat = corners.map(|corner| corner.truncate());
        if let Some((facing, height)) = crossing(DVec2::new(point.x.into(), point.y.into()), flat, corners.map(|c| c.z))
            && height > f64::from(point.z)
            && counts(triangle)
        {
            winding += i32::from(facing);
        }
    });
    winding != 0
}
