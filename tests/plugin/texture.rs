//! Vessels that have grown are painted into the texture of their organ.

use super::operating_field::timed_app;
use super::*;
use bevy_vessels::{
    plugin::{
        TextureBase, TextureFailed, TextureReady, TextureShown, VesselAppearance, VesselMaps, VesselTexture,
        VesselTextureError,
    },
    synthesis::{
        texture::{BakeError, BakeSettings, MapKind, Maps, VesselLook},
        tree::ByKind,
    },
};

const FRAME: Duration = Duration::from_millis(16);

/// Small maps of all kinds.
fn small() -> VesselTexture {
    let settings = BakeSettings { size: 64, maps: MapKind::ALL.into_iter().collect::<Maps>(), ..default() };
    VesselTexture { settings, ..default() }
}

fn textured(app: &mut App, texture: VesselTexture) -> Entity {
    app.init_asset::<Image>();
    let organ = spawn(app, quick());
    app.world_mut().entity_mut(organ).insert(texture);
    organ
}

fn maps(world: &World, organ: Entity) -> &VesselMaps {
    world.get::<VesselMaps>(organ).expect("an organ with a texture")
}

#[track_caller]
fn run_until_ready(app: &mut App, organ: Entity) {
    run_until(app, "maps", |world| maps(world, organ).is_ready() && maps(world, organ).progress().is_none());
}

fn visibility(world: &World, organ: Entity, kind: VesselKind) -> Visibility {
    let vessels = vessel_entity(world, organ, kind).expect("the kind has vessels");
    *world.get::<Visibility>(vessels).expect("vessels can be hidden")
}

fn data(world: &World, organ: Entity, kind: MapKind) -> Vec<u8> {
    let image = maps(world, organ).image(kind).expect("a map");
    world.resource::<Assets<Image>>().get(image).expect("an asset").data.clone().expect("its data")
}

#[test]
fn maps_are_there_when_the_vessels_have_grown_and_hide_them() {
    let mut app = timed_app(FRAME);
    let organ = textured(&mut app, small());
    let mut ready = MessageCursor::<TextureReady>::default();
    while progress(app.world(), organ).phase != GrowthPhase::Finished {
        assert!(!maps(app.world(), organ).is_shown(), "not while they grow");
        app.update();
        thread::sleep(Duration::from_millis(1));
    }
    let mut news = Vec::new();
    run_until(&mut app, "maps", |world| {
        news.extend(drain(world, &mut ready));
        maps(world, organ).is_shown()
    });
    assert_eq!(news, [TextureReady { organ }]);
    for kind in MapKind::ALL {
        let levels = if kind.has_levels() { 64 * 64 + (64 * 64 - 1) / 3 } else { 64 * 64 };
        assert_eq!(data(app.world(), organ, kind).len(), levels * kind.format().bytes(), "{kind:?}");
    }
    assert!(maps(app.world(), organ).report().is_some_and(|report| report.texels > 3000));
    for kind in KINDS {
        assert_eq!(visibility(app.world(), organ, kind), Visibility::Hidden);
    }
    // What an app shows anew stays hidden; switched off, it comes back as the app wants it.
    let look = VesselAppearance { shown: ByKind::from_fn(|kind| kind == VesselKind::Artery), ..default() };
    app.world_mut().entity_mut(organ).insert(look);
    app.update();
    assert_eq!(visibility(app.world(), organ, VesselKind::Artery), Visibility::Hidden);
    app.world_mut().get_mut::<VesselTexture>(organ).expect("a texture").shows = TextureShown::Vessels;
    app.update();
    assert!(maps(app.world(), organ).is_ready() && !maps(app.world(), organ).is_shown());
    assert_eq!(visibility(app.world(), organ, VesselKind::Artery), Visibility::Inherited);
    assert_eq!(visibility(app.world(), organ, VesselKind::Vein), Visibility::Hidden);
}

#[test]
fn old_maps_stay_until_those_of_a_new_look_are_ready() {
    let mut app = timed_app(FRAME);
    let organ = textured(&mut app, small());
    run_until_ready(&mut app, organ);
    let before = data(app.world(), organ, MapKind::Albedo);
    let look = VesselLook { thin_color: [0.0, 1.0, 0.0], wide_color: [0.0, 1.0, 0.0], ..default() };
    app.world_mut().get_mut::<VesselTexture>(organ).expect("a texture").looks.insert(VesselKind::Artery, look);
    run_until(&mut app, "new maps", |world| {
        assert!(maps(world, organ).is_shown() && maps(world, organ).image(MapKind::Albedo).is_some());
        data(world, organ, MapKind::Albedo) != before
    });
    // The same again is no change.
    let made = maps(app.world(), organ).image(MapKind::Albedo).cloned();
    app.world_mut().get_mut::<VesselTexture>(organ).expect("a texture").set_changed();
    (0..5).for_each(|_| app.update());
    assert_eq!(maps(app.world(), organ).image(MapKind::Albedo).cloned(), made);
}

#[test]
fn new_vessels_are_shown_until_their_own_maps_are_ready() {
    let mut app = timed_app(FRAME);
    let organ = textured(&mut app, small());
    run_until_ready(&mut app, organ);
    let before = data(app.world(), organ, MapKind::Albedo);
    app.insert_resource(GrowthBudget::Steps(1));
    app.world_mut().get_mut::<Vasculature>(organ).expect("an organ").seed += 1;
    run_to_phase(&mut app, organ, GrowthPhase::Growing);
    run_until(&mut app, "a step", |world| progress(world, organ).step > 1);
    assert!(!maps(app.world(), organ).is_shown());
    assert_eq!(visibility(app.world(), organ, VesselKind::Artery), Visibility::Inherited);
    app.insert_resource(GrowthBudget::Steps(1000));
    run_until_ready(&mut app, organ);
    assert_ne!(data(app.world(), organ, MapKind::Albedo), before);
    app.world_mut().entity_mut(organ).remove::<VesselTexture>();
    app.update();
    assert!(app.world().get::<VesselMaps>(organ).is_none());
    assert_eq!(visibility(app.world(), organ, VesselKind::Vein), Visibility::Inherited);
}

#[test]
fn what_lies_between_the_vessels_is_the_base() {
    let mut app = timed_app(FRAME);
    let organ = textured(&mut app, small());
    let blue = Image::new_fill(
        bevy::render::render_resource::Extent3d { width: 2, height: 2, depth_or_array_layers: 1 },
        bevy::render::render_resource::TextureDimension::D2,
        &[0, 0, 255, 255],
        bevy::render::render_resource::TextureFormat::Rgba8UnormSrgb,
        default(),
    );
    let image = app.world_mut().resource_mut::<Assets<Image>>().add(blue);
    let base = TextureBase { image: Some(image), color: [1.0; 3], roughness: 0.2 };
    app.world_mut().entity_mut(organ).insert(base);
    run_until_ready(&mut app, organ);
    let albedo = data(app.world(), organ, MapKind::Albedo);
    let blue = albedo[..4 * 64 * 64].chunks_exact(4).filter(|texel| texel[0] == 0 && texel[2] == 255).count();
    assert!(blue > 1000, "only {blue} texels of the base");
}

#[test]
fn what_has_no_texture_says_so_once() {
    let mut app = timed_app(FRAME);
    app.init_asset::<Image>();
    let mesh = sphere().with_removed_attribute(Mesh::ATTRIBUTE_UV_0);
    let mesh = add_mesh(&mut app, mesh);
    let organ = app.world_mut().spawn((Mesh3d(mesh), quick(), small())).id();
    let mut failed = MessageCursor::<TextureFailed>::default();
    let mut news = Vec::new();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    run_until(&mut app, "a failure", |world| {
        news.extend(drain(world, &mut failed));
        maps(world, organ).error().is_some()
    });
    for _ in 0..5 {
        app.update();
        news.extend(drain(app.world(), &mut failed));
    }
    assert_eq!(news, [TextureFailed { organ, error: VesselTextureError::Bake(BakeError::NoUvs) }]);
    assert_eq!(visibility(app.world(), organ, VesselKind::Artery), Visibility::Inherited);
}

#[test]
fn settings_out_of_their_limits_name_the_value_and_good_ones_try_again() {
    let mut app = timed_app(FRAME);
    let mut texture = small();
    texture.settings.size = 100;
    let organ = textured(&mut app, texture);
    run_until(&mut app, "a failure", |world| maps(world, organ).error().is_some());
    let error = maps(app.world(), organ).error().map(ToString::to_string).unwrap_or_default();
    assert!(error.contains("100"), "{error}");
    app.world_mut().get_mut::<VesselTexture>(organ).expect("a texture").settings.size = 64;
    run_until_ready(&mut app, organ);
    assert!(maps(app.world(), organ).error().is_none());
}
