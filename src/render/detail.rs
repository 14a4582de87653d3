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
    segments::SegmentChunk,
    template::{chunk_mesh, corner_reach},
};
use bevy::{
    camera::primitives::Aabb,
    math::{Affine3A, Vec3A, Vec4, ops},
    platform::collections::HashMap,
    prelude::*,
};
use std::f32::consts::PI;

/// The least number of slots in a mesh, for small vessel trees.
pub(super) const FEWEST_SLOTS: usize = 256;
/// The most slots in a mesh: few chunks for the CPU, with meshes small enough to be made in a frame.
const MOST_SLOTS: usize = 4096;
/// Most vertices in a mesh of the finest level, unless [`FEWEST_SLOTS`] very round segments need more.
const MOST_VERTICES: usize = 1 << 17;
/// Sides of the levels below the finest.
const COARSER_SIDES: [u32; 3] = [8, 5, 3];
/// Strides of the levels that leave slots out.
const STRIDES: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Share beyond its threshold at which a slot is gone: it gets thinner up to there. Also in `segments.wgsl`.
const FADE: f32 = 0.25;
/// A chunk becomes coarser a little later than it could, so that one at the limit doesn't change all the time.
const HYSTERESIS: f32 = 0.9;

/// How round a segment is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) sides: u32,
    pub(super) cap_rings: u32,
}

impl Shape {
    /// Vertices of one segment.
    pub(super) fn vertices(self) -> usize {
        (2 + self.sides * (2 + self.cap_rings)) as usize
    }

    /// The greatest distance between this cross-section's outline and a circle of radius 1.
    fn error(self) -> f32 {
        let reach = corner_reach(self.sides);
        (reach - 1.0).max(1.0 - reach * ops::cos(PI / self.sides as f32))
    }
}

/// One level of detail.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    pub(super) shape: Shape,
    /// The shapes to which the level's vertices slide, one after the other.
    pub(super) goals: Vec<Goal>,
    /// One of about this many slots is in the mesh.
    pub(super) stride: usize,
    /// Radius in pixels below which a chunk may be drawn at this level.
    pub(super) drawn_below: f32,
    /// Width in pixels below which segments drop out. 0: they don't.
    pub(super) least_width: f32,
}

/// A coarser shape that vertices slide to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Goal {
    pub(super) shape: Shape,
    /// Radius in pixels below which vertices have arrived; they set out at twice that. 0: they don't.
    pub(super) slid_below: f32,
}

impl Level {
    /// Whether a slot is in the mesh.
    pub(super) fn keeps(&self, slot: usize) -> bool {
        u64::from(threshold(slot)) * (self.stride as u64) < 1 << 32
    }

    /// The largest share of all segments that may be kept, so that no segment missing in the mesh should be drawn.
    pub(super) fn most_kept(&self) -> f32 {
        if self.stride == 1 { 1.0 } else { 1.0 / (self.stride as f32 * (1.0 + FADE)) }
    }
}

/// The share of kept segments below which a slot drops out, times 2³². `segments.wgsl` computes the same.
fn threshold(slot: usize) -> u32 {
    (slot as u32).wrapping_mul(0x9e37_79b9)
}

/// The checked settings of the plugin, which determine the levels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detail {
    /// The finest shape.
    pub(super) shape: Shape,
    /// See [`SegmentRenderPlugin::tolerance`](super::SegmentRenderPlugin::tolerance).
    pub(super) tolerance: f32,
    /// See [`SegmentRenderPlugin::least_width`](super::SegmentRenderPlugin::least_width).
    pub(super) least_width: f32,
}

impl Detail {
    /// All levels, from the finest.
    pub(super) fn levels(&self) -> Vec<Level> {
        let finest = self.shape;
        let coarser = COARSER_SIDES.into_iter().filter(|&sides| sides < finest.sides);
        let coarser = coarser.map(|sides| Shape { sides, cap_rings: finest.cap_rings.min(u32::from(sides >= 8)) });
        let shapes: Vec<Shape> = std::iter::once(finest).chain(coarser).collect();
        let level = |shape: Shape, stride, drawn_below| {
            let least_width = self.least_width;
            Level { shape, goals: Vec::new(), stride, drawn_below, least_width }
        };
        let mut levels: Vec<Level> =
            shapes.iter().map(|&shape| level(shape, 1, self.tolerance / shape.error())).collect();
        levels[0].drawn_below = f32::INFINITY;
        let last = shapes[shapes.len() - 1];
        levels.extend(STRIDES.map(|stride| level(last, stride, self.dropped_below(stride))));
        for finer in 0..levels.len() - 1 {
            levels[finer + 1].drawn_below = levels[finer + 1].drawn_below.min(levels[finer].drawn_below);
        }
        for finer in 0..shapes.len() {
            let coarser = &levels[finer + 1..shapes.len()];
            let goals = coarser.iter().map(|level| Goal { shape: level.shape, slid_below: level.drawn_below });
            levels[finer].goals = goals.collect();
        }
        levels
    }

    /// Radius in pixels below which all slots but one of `stride` have width zero.
    fn dropped_below(&self, stride: usize) -> f32 {
        0.5 * self.least_width / (stride as f32 * (1.0 + FADE))
    }

    /// Slots of a full chunk: a power of two.
    pub(super) fn slots(&self) -> usize {
        let most = (MOST_VERTICES / self.shape.vertices()).clamp(FEWEST_SLOTS, MOST_SLOTS);
        1 << most.ilog2()
    }
}

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

    const DETAIL: Detail = Detail { shape: Shape { sides: 8, cap_rings: 1 }, tolerance: 0.25, least_width: 1.0 };

    #[test]
    fn levels_get_coarser_one_by_one() {
        for shape in [(3, 0), (4, 0), (8, 1), (64, 16)].map(|(sides, cap_rings)| Shape { sides, cap_rings }) {
            let levels = Detail { shape, ..DETAIL }.levels();
            assert_eq!((levels[0].shape, levels[0].drawn_below), (shape, f32::INFINITY));
            for pair in levels.windows(2) {
                assert!(pair[0].drawn_below > pair[1].drawn_below, "{pair:?}");
                if pair[0].shape != pair[1].shape {
                    assert_eq!(pair[0].goals[0], Goal { shape: pair[1].shape, slid_below: pair[1].drawn_below });
                    assert_eq!(pair[0].goals[1..], pair[1].goals, "from there on they go together");
                }
                // vertices set out at twice the size at which they arrive, and not before they reached the previous
                // goal
                assert!(pair[0].goals.windows(2).all(|goals| 2.0 * goals[1].slid_below <= goals[0].slid_below));
                let [fine, coarse] = [0, 1].map(|i| pair[i].shape.vertices() * 1000 / pair[i].stride);
                assert!(coarse < fine, "{pair:?}");
            }
        }
    }

    #[test]
    fn outlines_differ_from_circles_by_the_tolerance_at_most() {
        for level in DETAIL.levels().iter().skip(1).filter(|level| level.stride == 1) {
            let corner = corner_reach(level.shape.sides);
            let edge = corner * ops::cos(PI / level.shape.sides as f32);
            for distance in [corner, edge] {
                assert!((distance - 1.0).abs() * level.drawn_below <= DETAIL.tolerance * 1.001);
            }
        }
    }

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
    fn full_chunks_have_room_for_a_power_of_two() {
        assert_eq!(DETAIL.slots(), 4096);
        let round = Detail { shape: Shape { sides: 64, cap_rings: 16 }, ..DETAIL };
        assert_eq!(round.slots(), FEWEST_SLOTS);
        let rounder = Detail { shape: Shape { sides: 16, cap_rings: 1 }, ..DETAIL };
        assert_eq!(rounder.slots(), 2048);
    }

    #[test]
    fn what_is_kept_is_spread_evenly() {
        for level in DETAIL.levels() {
            for (first, step) in [(0, 1), (1, 2), (100, 3)] {
                let slots = 1024;
                let kept = (0..slots).filter(|slot| level.keeps(first + step * slot)).count();
                let expected = slots / level.stride;
                assert!(kept.abs_diff(expected) <= 4 + expected / 8, "{kept} of {slots}, not {expected}");
            }
        }
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
