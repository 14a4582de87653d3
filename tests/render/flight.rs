//! A flight from afar to just above a colon with all its vessels, and back the same way.
//!
//! At the same place a chunk may be drawn at two levels of detail, a coarser one on the way there and a finer one on
//! the way back: the two pictures differ only by the change of level.

use crate::stage::*;
use bevy::{
    camera::RenderTarget,
    prelude::*,
    render::render_resource::{TextureFormat, TextureUsages},
};
use bevy_vessels::{
    plugin::{Vasculature, VesselAppearance},
    render::SegmentChunk,
    synthesis::{
        organ::{Colon, ColonSettings},
        preset::PresetName,
        roots::RootPlacement,
        tissue::TissueMode,
    },
};

/// Pixels of a picture.
const PICTURE: UVec2 = UVec2::new(200, 150);

/// The view at a place.
struct View {
    picture: Image,
    /// Levels of all chunks, in the order of the entities.
    levels: Vec<usize>,
}

/// A colon with arteries and veins on both sides of its wall, one unit large.
fn spawn_colon(stage: &mut Stage) -> (Colon, Transform) {
    let colon = ColonSettings { triangles: 40_000, ..default() }.generate().expect("a colon");
    let (low, high) = colon.mesh.bounds();
    let scale = 1.0 / (high - low).max_element();
    let place = Transform::from_translation(-0.5 * (low + high) * scale).with_scale(Vec3::splat(scale));
    for (side, roots) in [(&colon.outer, &colon.roots), (&colon.inner, &colon.inner_roots)] {
        let mut wish = Vasculature::new(PresetName::Colon);
        wish.roots.artery = RootPlacement::Nearest(roots.arterial.clone());
        wish.roots.vein = RootPlacement::Nearest(roots.venous.clone());
        wish.tissue = TissueMode::Surface.into();
        let settings = wish.generator.colonization_mut().expect("presets colonize");
        settings.arterial.terminal_radius *= 1.4;
        settings.venous.terminal_radius *= 1.4;
        let mesh: Mesh = colon.mesh.part(side.clone()).into();
        stage.spawn_organ(mesh, Color::srgb(0.8, 0.55, 0.5), (place, wish, VesselAppearance::default()));
    }
    (colon, place)
}

/// Camera positions above the transverse colon: `count` places at distances from the wall from the first to the second,
/// in a geometric series. The organ is one unit large.
fn places(colon: &Colon, organ: &Transform, [far, near]: [f32; 2], count: usize) -> Vec<Transform> {
    let front = (colon.front.eye - colon.front.target).normalize();
    let target = organ.transform_point(colon.centre_line[colon.centre_line.len() / 2]);
    let radius = colon.radii[colon.radii.len() / 2] * organ.scale.x;
    let distance = |place: usize| far * (near / far).powf(place as f32 / (count - 1) as f32);
    let place = |place| Transform::from_translation(target + front * (radius + distance(place)));
    (0..count).map(|at| place(at).looking_at(target, colon.front.up)).collect()
}

/// The views of places, in their order.
fn fly(stage: &mut Stage, camera: Entity, target: &Handle<Image>, places: &[Transform]) -> Vec<View> {
    let mut views = Vec::new();
    for place in places {
        stage.app.world_mut().entity_mut(camera).insert(*place);
        let picture = stage.picture_of(target.clone());
        let world = stage.app.world_mut();
        let mut chunks: Vec<(Entity, usize)> = world
            .query::<(Entity, &SegmentChunk)>()
            .iter(world)
            .map(|(entity, chunk)| (entity, chunk.level()))
            .collect();
        chunks.sort_unstable();
        views.push(View { picture, levels: chunks.into_iter().map(|(_, level)| level).collect() });
    }
    views
}

/// The views of all places on the way there and on the way back.
fn fly_there_and_back(stage: &mut Stage, distances: [f32; 2], count: usize) -> Vec<[View; 2]> {
    let (colon, organ) = spawn_colon(stage);
    let mut target = Image::new_target_texture(PICTURE.x, PICTURE.y, TextureFormat::Rgba8UnormSrgb, None);
    target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let target = stage.app.world_mut().resource_mut::<Assets<Image>>().add(target);
    let lens = PerspectiveProjection { fov: 0.7, near: 0.002, ..default() };
    let camera = stage.use_camera((Camera3d::default(), RenderTarget::from(target.clone()), Projection::from(lens)));
    let mut places = places(&colon, &organ, distances, count);
    let there = fly(stage, camera, &target, &places);
    places.reverse();
    let mut back = fly(stage, camera, &target, &places);
    back.reverse();
    there.into_iter().zip(back).map(|(there, back)| [there, back]).collect()
}

/// Number of chunks drawn at different levels.
fn switched([a, b]: &[View; 2]) -> usize {
    a.levels.iter().zip(&b.levels).filter(|(a, b)| a != b).count()
}

/// Sum over all pixels of the largest difference of a channel.
fn change(a: &Image, b: &Image) -> u64 {
    let [a, b] = [a, b].map(|image| image.data.as_deref().expect("a picture on the CPU").chunks(4));
    let most = |(a, b): (&[u8], &[u8])| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    a.zip(b).map(|pixels| u64::from(most(pixels))).sum()
}

#[test]
fn a_flight_from_afar_to_close_shows_no_change_of_level() {
    on_stage("flight", |stage| {
        stage.set_shadows(false);
        let views = fly_there_and_back(stage, [5.0, 0.15], 12);
        let switches: Vec<usize> = views.iter().map(switched).collect();
        assert!(switches.iter().sum::<usize>() >= 8, "{switches:?} changes of level are too few to tell");
        let levels = |view: usize| views[view][0].levels.iter().max();
        assert!(levels(0) >= Some(&3) && levels(11) <= Some(&1), "{:?} to {:?}", levels(0), levels(11));
        let changes: Vec<u64> = views.iter().map(|[there, back]| change(&there.picture, &back.picture)).collect();
        assert!(changes.iter().all(|&change| change == 0), "{changes:?} at {switches:?} changes of level");
    });
}
