//! What is drawn takes over the layers and shadow switches of its organ, and the opacity of its colour.

use crate::{
    bar, bar_of,
    stage::{Picture, Stage, on_stage},
};
use bevy::{
    camera::visibility::RenderLayers,
    light::{NotShadowCaster, NotShadowReceiver},
    prelude::*,
};
use bevy_vessels::{
    plugin::{Cuttable, CuttableVessels, VesselMesh, VesselSurface},
    render::SegmentBuffer,
    synthesis::{tree::VesselKind, wound::Blade},
};

/// Everything that draws the vessels of an organ.
fn drawn(stage: &Stage, organ: Entity) -> Vec<Entity> {
    let (world, vessels) = (stage.app.world(), stage.vessels(organ));
    let segments = world.get::<SegmentBuffer>(vessels).expect("drawn");
    let mesh = world.get::<VesselMesh>(vessels).map_or(&[][..], VesselMesh::entities);
    segments.chunks().iter().chain(segments.stump_chunks()).chain(mesh).copied().collect()
}

fn all_have<C: Component>(stage: &Stage, organ: Entity) -> bool {
    let drawn = drawn(stage, organ);
    assert!(!drawn.is_empty());
    drawn.iter().all(|&entity| stage.app.world().get::<C>(entity).is_some())
}

/// Lets the camera see some layers. They are never removed again, since Bevy's shadows don't come back then.
fn see_layers(stage: &mut Stage, layers: RenderLayers) {
    let world = stage.app.world_mut();
    let cameras: Vec<Entity> = world.query_filtered::<Entity, With<Camera3d>>().iter(world).collect();
    cameras.into_iter().for_each(|camera| _ = world.entity_mut(camera).insert(layers.clone()));
}

fn cut_in_half(stage: &mut Stage, organ: Entity) {
    stage.app.world_mut().entity_mut(organ).insert(Cuttable::default());
    stage.app.update();
    let edge = |y: f32| [Vec3::new(0.0, y, -50.0), Vec3::new(0.0, y, 50.0)];
    let blade = Blade::sweep(edge(-200.0), edge(200.0)).expect("a blade");
    stage.app.world_mut().resource_mut::<CuttableVessels>().cut(blade);
}

#[test]
fn vessels_are_on_the_layers_of_their_organ() {
    on_stage("layers", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar_of(4.0, 40.0));
        assert!(stage.picture().is_vessel(40, 64));
        stage.app.world_mut().entity_mut(organ).insert(RenderLayers::layer(1));
        assert_eq!(stage.picture().vessel_pixels(), 0, "the camera does not see the second layer");
        // What is drawn later takes it over, too: stumps, and closed meshes.
        cut_in_half(stage, organ);
        stage.app.world_mut().entity_mut(organ).insert(VesselSurface::default());
        for _ in 0..200 {
            stage.app.update();
        }
        assert_eq!(stage.picture().vessel_pixels(), 0);
        assert!(drawn(stage, organ).len() >= 3, "chunks, stumps and a mesh");
        assert!(all_have::<RenderLayers>(stage, organ));
        see_layers(stage, RenderLayers::from_layers(&[0, 1]));
        let picture = stage.picture();
        see_layers(stage, RenderLayers::layer(0));
        assert!(picture.is_vessel(30, 64) && picture.is_vessel(98, 64) && picture.is_background(64, 64));
        let vessels = stage.vessels(organ);
        stage.app.world_mut().entity_mut(vessels).insert(RenderLayers::layer(0));
        assert!(stage.picture().is_vessel(30, 64), "a vessel entity's own layers count");
        *stage.app.world_mut().get_mut::<RenderLayers>(vessels).expect("inserted") = RenderLayers::layer(2);
        assert_eq!(stage.picture().vessel_pixels(), 0);
        stage.app.world_mut().entity_mut(vessels).remove::<RenderLayers>();
        stage.app.world_mut().entity_mut(organ).remove::<RenderLayers>();
        assert!(stage.picture().is_vessel(30, 64));
        assert!(!all_have::<RenderLayers>(stage, organ));
    });
}

#[test]
fn shadows_are_cast_and_received_as_the_organ_says() {
    on_stage("shadow switches", |stage| {
        stage.spawn_wall();
        let lit = stage.picture();
        let organ = stage.spawn(VesselKind::Artery, &bar());
        let darkest = |stage: &mut Stage| {
            let picture = stage.picture();
            (64 + 10..64 + 40).map(|y| picture.brightness(64, y) / lit.brightness(64, y)).fold(1.0, f32::min)
        };
        assert!(darkest(stage) < 0.7);
        stage.app.world_mut().entity_mut(organ).insert(NotShadowCaster);
        let without = darkest(stage);
        assert!(without > 0.95, "{without}");
        stage.app.world_mut().entity_mut(organ).remove::<NotShadowCaster>();
        assert!(darkest(stage) < 0.7);
        stage.app.world_mut().entity_mut(organ).insert(NotShadowReceiver);
        stage.app.update();
        assert!(all_have::<NotShadowReceiver>(stage, organ) && !all_have::<NotShadowCaster>(stage, organ));
    });
}

#[test]
fn a_translucent_colour_shows_what_is_behind() {
    on_stage("opacity", |stage| {
        stage.set_shadows(false);
        let organ = stage.spawn(VesselKind::Artery, &bar());
        let opaque = stage.picture();
        let opacity = |stage: &mut Stage, alpha: f32| {
            stage.appearance(organ, |look| look.colors.artery.set_alpha(alpha));
            stage.picture()
        };
        let green = |picture: &Picture| picture.at(64, 64)[1];
        let half = opacity(stage, 0.5);
        assert!(green(&half) > green(&opaque) + 40, "{} behind {}", green(&half), green(&opaque));
        assert!(half.is_vessel(64, 64));
        assert_eq!(opacity(stage, 1.0).differing(&opaque), 0, "opaque again");
        stage.app.world_mut().entity_mut(organ).insert(VesselSurface::default());
        for _ in 0..100 {
            stage.app.update();
        }
        assert_eq!(stage.visible_chunks(), 0, "a mesh is shown");
        let opaque = stage.picture();
        let half = opacity(stage, 0.5);
        assert!(green(&half) > green(&opaque) + 40, "{} behind {}", green(&half), green(&opaque));
    });
}

/// Bevy's translucent meshes cast the shadows of opaque ones, in which vessels inside would be dark.
#[test]
fn vessels_in_a_translucent_organ_are_lit_if_it_casts_no_shadow() {
    on_stage("glass", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar());
        let alone = stage.picture();
        let world = stage.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Sphere::new(40.0));
        let base_color = Color::srgba(0.85, 0.6, 0.55, 0.25);
        let glass = StandardMaterial { base_color, alpha_mode: AlphaMode::Blend, ..default() };
        let glass = world.resource_mut::<Assets<StandardMaterial>>().add(glass);
        world.entity_mut(organ).insert((Mesh3d(mesh), MeshMaterial3d(glass)));
        let shaded = stage.picture();
        stage.app.world_mut().entity_mut(organ).insert(NotShadowCaster);
        let lit = stage.picture();
        stage.app.world_mut().entity_mut(organ).remove::<NotShadowCaster>();
        stage.picture();
        let [alone, shaded, lit] = [alone, shaded, lit].map(|picture| picture.at(64, 64));
        assert!(lit[0] > 9 * (alone[0] / 10), "as bright as alone: {lit:?} of {alone:?}");
        assert!(lit[0] > lit[1] + 60, "and red: {lit:?}");
        assert!(shaded[0] < lit[0] - 30, "{shaded:?} in the shadow of the organ");
    });
}
