//! Organs whose whole surface is seen from one inner point: one distance along each ray.
//!
//! In: a surface as a function of the ray's direction. Out: a closed mesh of triangles of about equal size. It cannot
//! meet itself, since no two of its triangles lie on the same ray.

use super::icosphere::Icosphere;
use crate::synthesis::{mesh::ShadedMesh, parallel};
use bevy_math::Vec3;

/// Most parts of an icosahedron's edge in the sphere on which rays are evened out: finer ones lie between its rays.
const COARSE: usize = 20;
/// Rounds of evening out: more change little.
const ROUNDS: usize = 6;
/// Share of the way to its new place that a ray goes in a round.
const PACE: f32 = 0.7;
/// Fewest rays worth handing to another thread.
const WORTH_SHARING: usize = 512;

/// Parts with which a mesh has about so many triangles.
pub(super) fn parts_for(triangles: u32) -> usize {
    (triangles as f32 / Icosphere::FACES as f32).sqrt().round().max(1.0) as usize
}

/// A mesh of a surface: `surface` gives its point on the ray from `middle` along a unit vector, and its colour there.
///
/// There are `parts`² triangles in each of the [`Icosphere`]'s charts.
pub(super) fn mesh(
    parts: usize,
    middle: Vec3,
    surface: impl Fn(Vec3) -> Vec3 + Sync,
    colour: impl Fn(Vec3) -> [f32; 4] + Sync,
) -> ShadedMesh {
    let mut rays = Icosphere::new(parts.min(COARSE));
    even_out(&mut rays, middle, &surface);
    let sphere = if rays.parts < parts { rays.divided(parts) } else { rays };
    let mut points = vec![(Vec3::ZERO, [0.0; 4]); sphere.directions.len()];
    parallel::map_all(&sphere.directions, &mut points, WORTH_SHARING, |_, direction| {
        let point = surface(*direction);
        (point, colour(point))
    });
    let (positions, colors) = points.into_iter().unzip();
    let mut mesh = ShadedMesh { positions, normals: Vec::new(), uvs: sphere.uvs, colors, triangles: sphere.triangles };
    mesh.compute_normals(&sphere.shared);
    mesh
}

/// Turns the rays so that the triangles on the surface become more equal, by Laplacian smoothing.
fn even_out(rays: &mut Icosphere, middle: Vec3, surface: &(impl Fn(Vec3) -> Vec3 + Sync)) {
    let mut points = vec![Vec3::ZERO; rays.directions.len()];
    let mut sums = vec![(Vec3::ZERO, 0.0f32); rays.directions.len()];
    for _ in 0..ROUNDS {
        parallel::map_all(&rays.directions, &mut points, WORTH_SHARING, |_, direction| surface(*direction));
        sums.fill((Vec3::ZERO, 0.0));
        for corners in &rays.triangles {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            let area = (b - a).cross(c - a).length();
            for corner in corners {
                let sum = &mut sums[rays.shared[*corner as usize] as usize];
                sum.0 += (a + b + c) / 3.0 * area;
                sum.1 += area;
            }
        }
        for (vertex, &owner) in rays.shared.iter().enumerate() {
            let (sum, weight) = sums[owner as usize];
            let target = points[vertex].lerp(sum / weight.max(f32::MIN_POSITIVE), PACE);
            rays.directions[vertex] = (target - middle).normalize_or(rays.directions[vertex]);
        }
    }
}
