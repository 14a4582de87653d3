//! Tangents of a mesh with texture coordinates, as renderers compute them.
//!
//! Mikkelsen, "Simulation of Wrinkled Surfaces Revisited" (2008), known as `MikkTSpace`: the tangent of a corner is the
//! direction in which u grows on its triangle; tangents of corners with the same position, normal, texture coordinates
//! and orientation are averaged in the plane of the normal, by the angle of the corner. The bitangent is the fourth
//! component times normal × tangent, and points up in the picture, as in glTF.

use super::welds::Welds;
use crate::synthesis::{mesh::TriangleMesh, pace::Pace, parallel};
use bevy_math::{Vec2, Vec3, Vec4, ops};

/// Fewest triangles worth a thread of their own.
const WORTH_SHARING: usize = 1024;

/// What a triangle adds to the tangents of its corners, with the angle as length; and whether it is mirrored.
type Share = ([Vec3; 3], Option<bool>);

/// Tangents of all vertices. A vertex that belongs to mirrored triangles as well as to others has the tangent of the
/// last of them, as an indexed mesh has only one; one without any has a tangent of its own across the normal.
pub(super) async fn tangents(
    mesh: &TriangleMesh,
    (uvs, normals): (&[Vec2], &[Vec3]),
    welds: &Welds,
    pace: &Pace,
) -> Vec<Vec4> {
    let triangles = mesh.triangles();
    let mut shares: Vec<Share> = Vec::new();
    let share = |_: usize, corners: &[u32; 3]| share_of(*corners, mesh.positions(), uvs, normals);
    shares.resize(triangles.len(), ([Vec3::ZERO; 3], None));
    let groups: Vec<usize> = (0..triangles.len()).step_by(16 * WORTH_SHARING).collect();
    for &start in &groups {
        let end = triangles.len().min(start + 16 * WORTH_SHARING);
        parallel::map_all(&triangles[start..end], &mut shares[start..end], WORTH_SHARING, share);
        pace.part(0.0..0.6).rest(end as f32 / triangles.len() as f32).await;
    }
    let mut sums = vec![[Vec3::ZERO; 2]; normals.len()];
    let add = |triangle: usize| {
        let (vectors, Some(is_mirrored)) = shares[triangle] else { return };
        for (corner, vector) in triangles[triangle].into_iter().zip(vectors) {
            sums[welds.whole[corner as usize] as usize][usize::from(is_mirrored)] += vector;
        }
    };
    pace.part(0.6..0.8).each(triangles.len(), add).await;
    let mut tangents: Vec<Vec4> = normals.iter().map(|normal| normal.any_orthonormal_vector().extend(-1.0)).collect();
    let set = |triangle: usize| {
        let Some(is_mirrored) = shares[triangle].1 else { return };
        for corner in triangles[triangle] {
            let sum = sums[welds.whole[corner as usize] as usize][usize::from(is_mirrored)];
            if let Some(tangent) = sum.try_normalize() {
                tangents[corner as usize] = tangent.extend(if is_mirrored { 1.0 } else { -1.0 });
            }
        }
    };
    pace.part(0.8..1.0).each(triangles.len(), set).await;
    tangents
}

fn share_of(corners: [u32; 3], positions: &[Vec3], uvs: &[Vec2], normals: &[Vec3]) -> Share {
    let [a, b, c] = corners.map(|corner| positions[corner as usize]);
    let [ta, tb, tc] = corners.map(|corner| uvs[corner as usize]);
    let (across, down) = (tb - ta, tc - ta);
    let doubled = across.perp_dot(down);
    if doubled == 0.0 {
        return ([Vec3::ZERO; 3], None);
    }
    let sign = doubled.signum();
    let along = ((b - a) * down.y - (c - a) * across.y) * sign;
    let points = [a, b, c];
    let vectors = std::array::from_fn(|corner| {
        let normal = normals[corners[corner] as usize];
        let flat = |vector: Vec3| (vector - normal * normal.dot(vector)).normalize_or_zero();
        let next = flat(points[(corner + 1) % 3] - points[corner]);
        let last = flat(points[(corner + 2) % 3] - points[corner]);
        flat(along) * ops::acos(next.dot(last).clamp(-1.0, 1.0))
    });
    (vectors, Some(sign < 0.0))
}
