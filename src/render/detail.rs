//! Levels of detail: the mesh that a chunk of segments draws, chosen by the size of its thickest segment in the
//! picture.
//!
//! In: the chunks' boxes and thickest radii, and the cameras. Out: each chunk's mesh.
//!
//! Nothing pops, by construction. As a segment gets small, the vertex stage slides the corners of its cross-section to
//! those of the next coarser polygon, and from there to those of the one after it, each vertex by the size of its own
//! end. A chunk switches to the coarser mesh when all its vertices have slid at least that far, so that both meshes are
//! the same surface. Below a pixel, segments drop out one by one, and the others are widened, so that vessels cover the
//! same area (Cook, Halstead, Planck & Ryu, "Stochastic simplification of aggregate detail", 2007). A chunk's mesh
//! leaves out segments whose width has become zero. Multiples of the golden ratio decide which slots drop first: they
//! spread evenly over any run of slots, and over every second one.
//!
//! A chunk is as fine as the most demanding camera needs. Prepasses and shadow maps draw the same meshes. In a shadow
//! map vertices slide by their size there: one much finer than the picture may show a change of level as slightly
//! changed shading on vessels of a few pixels, within the [tolerance](super::SegmentRenderPlugin::tolerance).

use super::{
    chunk::SegmentChunk,
    levels::{Detail, Level},
    template::chunk_mesh,
};
use bevy::{
    camera::primitives::Aabb,
    math::{Affine3A, Vec3A, Vec4},
    platform::collections::HashMap,
    prelude::*,
};

/// A chunk becomes coarser a little later than it could, so that one at the limit doesn't change all the time.
const HYSTERESIS: f32 = 0.9;

/// The meshes that chunks share, made when first needed.
#[derive(Resource, Debug)]
pub(super) struct ChunkMeshes {
    levels: Vec<Level>,
    slots: usize,
    made: HashMap<(usize, usize), Handle<Mesh>>,
}

impl ChunkMeshes {
    pub(super) fn new(detail: &Detail) -> Self {
        Self { levels: detail.levels(), slots: detail.slots(), made: HashMap::default() }
    }

    /// Slots of a full chunk.
    pub(super) fn slots(&self) -> usize {
        self.slots
    }

    /// The level of a chunk that was at `level` before and whose thickest radius has so many pixels.
    fn level(&self, level: usize, radius: f32) -> usize {
        let coarsest = |radius: f32| self.levels.iter().rposition(|level| radius < level.drawn_below).unwrap_or(0);
        coarsest(radius).min(coarsest(radius / HYSTERESIS).max(level))
    }

    /// The mesh of a level, with room for so many slots.
    pub(super) fn mesh(&mut self, level: usize, slots: usize, meshes: &mut Assets<Mesh>) -> Handle<Mesh> {
        let make = || meshes.add(chunk_mesh(&self.levels[level], slots));
        self.made.entry((level, slots)).or_insert_with(make).clone()
    }
}

/// Gives every chunk the mesh for its size in the picture.
pub(super) fn choose_detail(
    cameras: Query<(&Camera, &GlobalTransform), With<Camera3d>>,
    mut chunks: Query<(&mut SegmentChunk, &mut Mesh3d, &Aabb, &GlobalTransform)>,
    mut templates: ResMut<ChunkMeshes>,
    mut meshes: ResMut<Assets<Mesh>>,
) {
    let eyes: Vec<Eye> = cameras.iter().filter_map(|(camera, place)| Eye::new(camera, place)).collect();
    for (mut chunk, mut mesh, aabb, place) in &mut chunks {
        let place = place.affine();
        let most = eyes.iter().map(|eye| eye.pixels_per_length(&place, aabb)).reduce(f32::max);
        let level = most.map_or(chunk.level, |most| templates.level(chunk.level, most * chunk.thickest));
        if (level, chunk.slots) != chunk.drawn {
            mesh.0 = templates.mesh(level, chunk.slots, &mut meshes);
            (chunk.level, chunk.drawn) = (level, (level, chunk.slots));
        }
    }
}

/// The part of a camera that decides the size of things in its picture.
struct Eye {
    /// Dot product with a point in the world: its depth, by which sizes are divided. 1 without perspective.
    depth: Vec4,
    /// Pixels of a unit length at depth 1.
    focal_length: f32,
}

impl Eye {
    /// `None` for cameras that draw nothing.
    fn new(camera: &Camera, place: &GlobalTransform) -> Option<Self> {
        let height = camera.physical_viewport_size().filter(|_| camera.is_active)?.y as f32;
        let clip_from_view = camera.clip_from_view();
        let depth = (clip_from_view * place.affine().inverse()).row(3);
        Some(Self { depth, focal_length: 0.5 * height * clip_from_view.y_axis.y.abs() })
    }

    /// The most pixels that a unit length may have, anywhere in a box. Huge if the box reaches behind the camera.
    fn pixels_per_length(&self, place: &Affine3A, aabb: &Aabb) -> f32 {
        let direction = Vec3A::from(self.depth.truncate());
        let across = place.matrix3.transpose() * direction;
        let centre = direction.dot(place.transform_point3a(aabb.center)) + self.depth.w;
        let nearest = centre - across.abs().dot(aabb.half_extents);
        self.focal_length * largest_scale(place) / nearest.max(f32::MIN_POSITIVE)
    }
}

/// The greatest scale along an axis. `segments.wgsl` computes the same.
fn largest_scale(place: &Affine3A) -> f32 {
    let axes = place.matrix3;
    axes.x_axis.length_squared().max(axes.y_axis.length_squared()).max(axes.z_axis.length_squared()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::levels::Shape;
    use bevy::math::ops;
    use std::f32::consts::PI;

    const DETAIL: Detail = Detail { shape: Shape { sides: 8, cap_rings: 1 }, tolerance: 0.25, least_width: 1.0 };

    #[test]
    fn without_tolerance_and_least_width_there_is_one_level() {
        let meshes = ChunkMeshes::new(&Detail { tolerance: 0.0, least_width: 0.0, ..DETAIL });
        assert!([0.0, 1e-9, 1.0, 1e9, f32::INFINITY].iter().all(|&radius| meshes.level(0, radius) == 0));
        assert!(meshes.levels.iter().flat_map(|level| &level.goals).all(|goal| goal.slid_below == 0.0));
    }

    #[test]
    fn a_chunk_is_never_too_coarse_and_rests_at_the_limit() {
        let meshes = ChunkMeshes::new(&DETAIL);
        let mut level = 0;
        for step in 0..2000 {
            let radius = ops::exp2(6.0 * ops::cos(step as f32 * 0.01) - 2.0);
            level = meshes.level(level, radius);
            assert!(radius < meshes.levels[level].drawn_below, "{radius} pixels at level {level}");
            let ideal = meshes.levels.iter().rposition(|level| radius / HYSTERESIS < level.drawn_below);
            assert!(level >= ideal.unwrap_or(0));
        }
        let limit = meshes.levels[1].drawn_below;
        let levels: Vec<_> = (0..20)
            .scan(0, |level, step| {
                *level = meshes.level(*level, limit * if step % 2 == 0 { 0.97 } else { 0.93 });
                Some(*level)
            })
            .collect();
        assert!(levels.iter().all(|&level| level == levels[0]), "{levels:?}");
    }

    #[test]
    fn nearer_and_larger_is_more_pixels() {
        // 90° upwards: a unit at depth 1 is half the picture's height
        let view = Mat4::perspective_infinite_reverse_rh(PI / 2.0, 1.0, 0.1);
        let eye = Eye { depth: view.row(3), focal_length: 50.0 };
        let aabb = Aabb { center: Vec3A::new(0.0, 0.0, -10.0), half_extents: Vec3A::splat(2.0) };
        let pixels = |place: Transform| eye.pixels_per_length(&place.compute_affine(), &aabb);
        assert!((pixels(Transform::IDENTITY) - 50.0 / 8.0).abs() < 1e-3, "the near side is 8 away");
        let stretched = Transform::from_scale(Vec3::new(3.0, 1.0, 1.0));
        assert!((pixels(stretched) - 3.0 * 50.0 / 8.0).abs() < 1e-3);
        assert!(pixels(Transform::from_xyz(0.0, 0.0, 9.0)) > 1e9, "reaching behind the camera");
        let flat = Eye { depth: Vec4::W, focal_length: 50.0 };
        assert!((flat.pixels_per_length(&Affine3A::IDENTITY, &aabb) - 50.0).abs() < 1e-3);
    }
}
