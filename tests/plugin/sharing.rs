//! Organs that share a mesh share the tissue that is prepared from it, until the last of them goes.

use super::*;
use bevy::diagnostic::DiagnosticsStore;
use bevy_vessels::{
    plugin::{EntityCommandsExt, GrowthControl, OrganPaint, diagnostics},
    synthesis::tissue::{NoGoRegion, Tissue, TissueMode},
};
use std::ptr;

/// Prepared tissues, as measured in the last frame.
fn tissues(app: &App) -> usize {
    let measured = app.world().resource::<DiagnosticsStore>().get_measurement(&diagnostics::TISSUES);
    measured.expect("they are counted").value as usize
}

/// Address of the tissue that an organ grows on.
fn tissue(world: &World, organ: Entity) -> *const () {
    let state = world.get::<GrowthState>(organ).expect("an organ has a state");
    state.tissue().map_or(ptr::null(), |tissue: &dyn Tissue| ptr::from_ref(tissue).cast())
}

/// Organs with one mesh whose growth is paused.
fn organs_of(app: &mut App, mesh: &Handle<Mesh>, wishes: impl IntoIterator<Item = Vasculature>) -> Vec<Entity> {
    let organ = |wish| (Mesh3d(mesh.clone()), wish, GrowthControl::Paused);
    wishes.into_iter().map(|wish| app.world_mut().spawn(organ(wish)).id()).collect()
}

#[track_caller]
fn run_until_started(app: &mut App, organs: &[Entity]) {
    run_until(app, "all starts", |world| {
        organs.iter().all(|&organ| progress(world, organ).phase == GrowthPhase::Growing)
    });
}

#[test]
fn a_thousand_organs_of_a_mesh_have_one_tissue() {
    let mut app = headless(GrowthBudget::Steps(1));
    let mesh = add_mesh(&mut app, sphere());
    let organs = organs_of(&mut app, &mesh, (0..1000).map(|seed| quick().with_seed(seed)));
    run_until_started(&mut app, &organs);
    assert_eq!(tissues(&app), 1);
    let shared = tissue(app.world(), organs[0]);
    assert!(!shared.is_null() && organs.iter().all(|&organ| tissue(app.world(), organ) == shared));
    for &organ in &organs[1..] {
        app.world_mut().despawn(organ);
    }
    app.update();
    assert_eq!((tissues(&app), tissue(app.world(), organs[0])), (1, shared), "one organ is left");
    app.world_mut().despawn(organs[0]);
    app.update();
    assert_eq!(tissues(&app), 0, "nobody uses it");
}

#[test]
fn a_shared_tissue_gives_the_vessels_of_one_of_its_own() {
    let grown = |wishes: &[Vasculature]| {
        let mut app = headless(GrowthBudget::Steps(100));
        let mesh = add_mesh(&mut app, sphere());
        let organs = organs_of(&mut app, &mesh, wishes.iter().cloned());
        for &organ in &organs {
            send(&mut app, organ, GrowthAction::Resume);
        }
        for &organ in &organs {
            run_to_phase(&mut app, organ, GrowthPhase::Finished);
        }
        organs.into_iter().map(|organ| trees(app.world(), organ)).collect::<Vec<_>>()
    };
    let wishes = [quick(), quick().with_seed(5), quick().with_tissue(TissueMode::Lining)];
    let apart: Vec<_> = wishes.iter().flat_map(|wish| grown(std::slice::from_ref(wish))).collect();
    assert_eq!(grown(&wishes), apart);
}

#[test]
fn other_meshes_and_other_tissues_are_prepared_apart() {
    let mut app = headless(GrowthBudget::Steps(1));
    let [mesh, same] = [(); 2].map(|()| add_mesh(&mut app, sphere()));
    let wishes = [quick(), quick().with_tissue(TissueMode::Volume), quick().with_tissue(TissueMode::Volume)];
    let mut organs = organs_of(&mut app, &mesh, wishes);
    organs.extend(organs_of(&mut app, &same, [quick()]));
    run_until_started(&mut app, &organs);
    app.update();
    assert_eq!(tissues(&app), 3);
    let [surface, volume, again, other] = organs[..] else { panic!("four organs") };
    let tissue = |organ| tissue(app.world(), organ);
    assert_eq!(tissue(volume), tissue(again));
    assert!(tissue(surface) != tissue(volume) && tissue(surface) != tissue(other));
}

#[test]
fn a_changed_mesh_is_prepared_again_once_for_all() {
    let mut app = headless(GrowthBudget::Steps(1));
    let mesh = add_mesh(&mut app, sphere());
    let mut organs = organs_of(&mut app, &mesh, (0..5).map(|seed| quick().with_seed(seed)));
    run_until_started(&mut app, &organs);
    let before = app.world().get::<GrowthState>(organs[0]).and_then(GrowthState::mesh).map(|mesh| mesh.positions()[0]);
    let larger = sphere().scaled_by(Vec3::splat(2.0));
    *app.world_mut().resource_mut::<Assets<Mesh>>().get_mut(&mesh).expect("the mesh is there") = larger;
    app.update();
    // An organ that comes later shares the new one.
    organs.extend(organs_of(&mut app, &mesh, [quick()]));
    app.update();
    run_until_started(&mut app, &organs);
    app.update();
    assert_eq!(tissues(&app), 1);
    for &organ in &organs {
        let now = app.world().get::<GrowthState>(organ).and_then(GrowthState::mesh).map(|mesh| mesh.positions()[0]);
        assert_eq!(now, before.map(|position| 2.0 * position));
        assert_eq!(tissue(app.world(), organ), tissue(app.world(), organs[0]));
    }
}

#[test]
fn paint_on_one_organ_leaves_the_others_as_they_are() {
    let mut app = headless(GrowthBudget::Steps(1));
    let mesh = add_mesh(&mut app, sphere());
    let organs = organs_of(&mut app, &mesh, [quick(), quick()]);
    let mut paint = OrganPaint::default();
    paint.no_go.regions.push(NoGoRegion::Ball { center: 0.5 * Vec3::X, radius: 0.2 });
    app.world_mut().entity_mut(organs[0]).insert(paint);
    run_until_started(&mut app, &organs);
    app.update();
    assert_eq!(tissues(&app), 1, "they share what is below the paint");
    let forbids = |organ: Entity| {
        let tissue = app.world().get::<GrowthState>(organ).and_then(GrowthState::tissue).expect("a tissue");
        tissue.no_go().is_some()
    };
    assert_eq!([organs[0], organs[1]].map(forbids), [true, false]);
}

#[test]
fn grow_now_does_not_wait_for_a_tissue_that_others_wait_for() {
    let mut app = headless(GrowthBudget::Steps(1));
    app.insert_resource(JobSettings { at_once: 0, ..jobs() });
    let mesh = add_mesh(&mut app, Sphere::new(0.5).mesh().ico(40).expect("fewer than 80 subdivisions"));
    let organs = organs_of(&mut app, &mesh, [quick(), quick()]);
    app.update();
    app.world_mut().commands().entity(organs[1]).grow_now();
    app.world_mut().flush();
    assert_eq!(progress(app.world(), organs[1]).phase, GrowthPhase::Finished);
    run_until_started(&mut app, &organs[..1]);
    assert_eq!(tissue(app.world(), organs[0]), tissue(app.world(), organs[1]));
}
