//! Orients the triangles of a mesh as winding numbers need it.

use crate::synthesis::{
    mesh::{TriangleIndex, TriangleMesh, crossing::crossing, tetrahedron_volume, topology::Patches},
    pace::Pace,
    space::bvh::Bounds,
};
use bevy_math::{DVec2, Vec3};

/// Points of a shell, all of which must be enclosed for it to count as a cavity.
const PROBES: usize = 9;

/// Flips triangles that are oriented against those around them, and closed shells that are oriented against the
/// largest, unless they are cavities in it. `index` is that of the mesh.
///
/// Also returns which triangles have missing or inconsistent neighbours: none if the result is closed.
pub(crate) async fn oriented(mesh: TriangleMesh, index: &TriangleIndex, pace: &Pace) -> (TriangleMesh, Vec<bool>) {
    let topology = mesh.topology_paced(&pace.part(0.0..0.5)).await;
    let misoriented = topology.misoriented_paced(&mesh, &pace.part(0.5..0.7)).await;
    let mesh = mesh.with_flipped_paced(|triangle| misoriented[triangle], &pace.part(0.7..0.72)).await;
    let (patches, closed) = topology.manifold_patches(&pace.part(0.72..0.8)).await;
    let volumes = shell_volumes(&mesh, &patches, &pace.part(0.8..0.9)).await;
    let flip = shells_against(&mesh, &patches, &closed, &volumes, index, &pace.part(0.9..0.92)).await;
    let pace = pace.part(0.92..1.0);
    let turned = |triangle: usize| patches.of_triangle[triangle].is_some_and(|patch| flip[patch as usize]);
    let was_turned = |triangle: usize| misoriented[triangle] != turned(triangle);
    let loose = topology.unbalanced_paced(was_turned, &pace.part(0.0..0.7)).await;
    (mesh.with_flipped_paced(turned, &pace.part(0.7..1.0)).await, loose)
}

/// Which parts of a surface are closed and oriented against the largest one, and no cavities in it. `mesh` is oriented
/// alike within each part; `index` may be that of the mesh before.
pub(super) async fn shells_against(
    mesh: &TriangleMesh,
    patches: &Patches,
    closed: &[bool],
    volumes: &[f64],
    index: &TriangleIndex,
    pace: &Pace,
) -> Vec<bool> {
    let largest = largest_of(volumes.iter().copied());
    let mut against: Vec<bool> =
        volumes.iter().zip(closed).map(|(volume, &closed)| closed && volume * largest < 0.0).collect();
    if !against.contains(&true) {
        return against;
    }
    let mut members = vec![Vec::new(); patches.count];
    let enter = |triangle: usize| {
        if let Some(patch) = patches.of_triangle[triangle] {
            members[patch as usize].push(triangle);
        }
    };
    pace.part(0.0..0.2).each(patches.of_triangle.len(), enter).await;
    let turns = against.clone();
    let facing_right = |triangle: usize| patches.of_triangle[triangle].is_some_and(|patch| !turns[patch as usize]);
    for patch in (0..patches.count).filter(|&patch| turns[patch]) {
        let step = members[patch].len().div_ceil(PROBES).max(1);
        let mut probes = members[patch].iter().step_by(step).map(|&triangle| mesh.corners(triangle)[0]);
        against[patch] = !probes.all(|probe| is_enclosed(probe, mesh, index, facing_right));
        pace.rest(0.2).await;
    }
    against
}

/// The number of the largest amount.
pub(super) fn largest_of(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0f64, |largest, number| if number.abs() > largest.abs() { number } else { largest })
}

/// Signed volume of every part of the surface.
async fn shell_volumes(mesh: &TriangleMesh, patches: &Patches, pace: &Pace) -> Vec<f64> {
    let mut volumes = vec![0.0; patches.count];
    let origin = mesh.corners(0)[0];
    let add = |triangle: usize| {
        if let Some(patch) = patches.of_triangle[triangle] {
            volumes[patch as usize] += tetrahedron_volume(mesh.corners(triangle), origin);
        }
    };
    pace.each(patches.of_triangle.len(), add).await;
    volumes
}

/// Whether the triangles that `counts` accepts wind around a point, seen along z.
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
