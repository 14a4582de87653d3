//! Settings and meshes that change while vessels grow, or come late; and readers of the changes in vessels.

use super::operating_field::*;
use super::*;
use bevy_vessels::{
    plugin::{ChangeCursor, ChangeLog, Changes, Cuttable, GrowthStarted, VesselsOf},
    synthesis::tissue::{Extent, Tissue},
};
use std::ptr;

/// Address of the tissue, which shows whether it was prepared again.
fn tissue(world: &World, organ: Entity) -> *const () {
    let state = world.get::<GrowthState>(organ).expect("an organ has a state");
    state.tissue().map_or(ptr::null(), |tissue: &dyn Tissue| ptr::from_ref(tissue).cast())
}

fn change(app: &mut App, organ: Entity, change: impl FnOnce(&mut Vasculature)) {
    change(&mut app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes"));
}

#[test]
fn another_seed_or_setting_restarts_at_the_next_frame_on_the_same_tissue() {
    let mut app = headless(GrowthBudget::Steps(2));
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let (before, prepared) = (trees(app.world(), organ), tissue(app.world(), organ));
    change(&mut app, organ, |wish| wish.seed = 8);
    app.update();
    assert_eq!(progress(app.world(), organ).step, 2);
    assert_published(app.world(), organ);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_ne!(before, trees(app.world(), organ));
    change(&mut app, organ, |wish| {
        wish.seed = 0;
        settings_of(wish).arterial.step_length *= 0.9;
    });
    app.update();
    assert_eq!(progress(app.world(), organ).step, 2);
    change(&mut app, organ, |wish| *wish = quick());
    app.update();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(before, trees(app.world(), organ), "what came between leaves no trace");
    assert_eq!(prepared, tissue(app.world(), organ));
}

#[test]
fn a_change_to_the_same_values_restarts_nothing() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    run_until(&mut app, "step 3", |world| progress(world, organ).step == 3);
    change(&mut app, organ, |wish| *wish = quick());
    app.update();
    assert_eq!(progress(app.world(), organ).step, 4);
}

#[test]
fn a_mesh_that_comes_late_is_waited_for() {
    let mut app = headless(GrowthBudget::default());
    let handle = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let organ = app.world_mut().spawn((Mesh3d(handle.clone()), quick())).id();
    for _ in 0..5 {
        app.update();
        assert_eq!(progress(app.world(), organ).phase, GrowthPhase::WaitingForMesh);
    }
    let inserted = app.world_mut().resource_mut::<Assets<Mesh>>().insert(handle.id(), sphere());
    assert!(inserted.is_ok());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let mut started = MessageCursor::default();
    assert!(drain::<GrowthStarted>(app.world(), &mut started).len() <= 1);
}

#[test]
fn a_replaced_mesh_is_prepared_again() {
    let mut app = headless(GrowthBudget::Steps(5));
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let before = trees(app.world(), organ);

    let cube = add_mesh(&mut app, Cuboid::new(1.0, 0.5, 0.8));
    app.world_mut().entity_mut(organ).insert(Mesh3d(cube));
    app.update();
    assert_ne!(progress(app.world(), organ).phase, GrowthPhase::Finished, "vessels of the old mesh are gone");
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_ne!(before, trees(app.world(), organ));
    let state = app.world().get::<GrowthState>(organ).expect("an organ has a state");
    let Some(Extent::Area(area)) = state.tissue().map(|tissue| tissue.extent()) else { panic!("a surface") };
    assert!((area - 3.4).abs() < 1e-5, "the cuboid's surface is {area}");
}

/// Meshes and settings that change while a tissue is being prepared: the last ones decide the result.
#[test]
fn an_outdated_tissue_never_arrives() {
    let wish = || quick().with_seed(5);
    let mut app = headless(GrowthBudget::Steps(100));
    let large = add_mesh(&mut app, Sphere::new(0.5).mesh().uv(256, 256));
    let cube = add_mesh(&mut app, Cuboid::new(1.0, 0.5, 0.8));
    let organ = app.world_mut().spawn((Mesh3d(large), quick())).id();
    app.update();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::PreparingTissue);
    app.world_mut().entity_mut(organ).insert(Mesh3d(cube.clone()));
    app.update();
    app.world_mut().entity_mut(organ).insert(wish());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let other = app.world_mut().spawn((Mesh3d(cube), wish())).id();
    run_to_phase(&mut app, other, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), trees(app.world(), other));
}

#[test]
fn a_mesh_asset_that_is_modified_is_prepared_again() {
    let mut app = headless(GrowthBudget::Steps(5));
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let before = trees(app.world(), organ);
    let id = app.world().get::<Mesh3d>(organ).map(|mesh| mesh.id()).expect("the organ has a mesh");
    let scaled = sphere().scaled_by(Vec3::new(1.0, 2.0, 1.0));
    *app.world_mut().resource_mut::<Assets<Mesh>>().get_mut(id).expect("the mesh is there") = scaled;
    run_until(&mut app, "a restart", |world| progress(world, organ).phase != GrowthPhase::Finished);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_ne!(before, trees(app.world(), organ));
    (0..5).for_each(|_| app.update());
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished, "once is enough");
}

#[test]
fn taking_the_mesh_away_waits_for_another() {
    let mut app = headless(GrowthBudget::default());
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.world_mut().entity_mut(organ).remove::<Mesh3d>();
    app.update();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::WaitingForMesh);
    assert!(published(app.world(), organ, VesselKind::Artery).tree().is_empty());
    let mesh = add_mesh(&mut app, sphere());
    app.world_mut().entity_mut(organ).insert(Mesh3d(mesh));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_published(app.world(), organ);
}

/// A reader that copies the changes, as a renderer does, once in a number of frames.
#[derive(Default)]
struct Copier {
    period: usize,
    cursor: ChangeCursor,
    copy: Vec<[f32; 8]>,
}

impl Copier {
    /// Copies the changes, and checks that the copy is right and that no unchanged segment was marked.
    #[track_caller]
    fn read(&mut self, log: &ChangeLog, tree: &VesselTree) {
        let now: Vec<_> = (0..tree.len()).map(|node| segment(tree, node)).collect();
        self.copy.resize(tree.len(), [f32::NAN; 8]);
        for node in self.cursor.read(log).dirty_ranges(tree.len()).flatten() {
            assert_ne!(self.copy[node], now[node], "segment {node} has not changed in {} frames", self.period);
            self.copy[node] = now[node];
        }
        assert_eq!(self.copy, now, "every {} frames", self.period);
    }
}

/// Readers at different frame rates: each gets exactly the changes that its copy needs, whatever the others have read.
#[test]
fn each_reader_gets_exactly_what_its_copy_needs() {
    [1, 7].into_iter().for_each(assert_changes_exact);
}

/// Grows with so many steps per frame.
fn assert_changes_exact(steps: u32) {
    let mut app = headless(GrowthBudget::Steps(steps));
    let mut wish = quick();
    wish.generator = wish.generator.scaled(0.6);
    let settings = settings_of(&mut wish);
    settings.steps = 150;
    settings.samples = 4000;
    let organ = spawn(&mut app, wish);
    let mut readers = [1, 2, 5].map(|period| Copier { period, ..Copier::default() });
    let mut frame = 0;
    run_until(&mut app, "the end", |world| {
        frame += 1;
        if let Some(entity) = vessel_entity(world, organ, VesselKind::Artery) {
            let tree = published(world, organ, VesselKind::Artery).tree().clone();
            let log = world.get::<ChangeLog>(entity).expect("vessels keep their changes");
            readers.iter_mut().filter(|reader| frame % reader.period == 0).for_each(|reader| reader.read(log, &tree));
        }
        progress(world, organ).is_finished()
    });
    app.update();
    let entity = vessel_entity(app.world(), organ, VesselKind::Artery).expect("the kind has vessels");
    let log = app.world().get::<ChangeLog>(entity).expect("vessels keep their changes");
    assert!(readers[0].cursor.is_current(log), "all is at rest");
    let tree = published(app.world(), organ, VesselKind::Artery).tree().clone();
    assert!(tree.len() > 2500, "{} segments are too few to tell", tree.len());
    for mut reader in readers {
        reader.read(log, &tree);
        assert!(reader.cursor.read(log).is_empty());
    }
}

/// The changes for a reader that has seen everything before.
fn changes_since(app: &App, cursor: &mut ChangeCursor, entity: Entity) -> Changes {
    cursor.read(app.world().get::<ChangeLog>(entity).expect("vessels keep their changes"))
}

#[test]
fn other_vessels_are_changed_throughout() {
    let mut app = headless(GrowthBudget::Steps(5));
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let entity = vessel_entity(app.world(), organ, VesselKind::Artery).expect("the kind has vessels");
    let mut cursor = ChangeCursor::default();
    assert!(changes_since(&app, &mut cursor, entity).is_all(), "to a reader that comes late");
    app.update();
    assert!(changes_since(&app, &mut cursor, entity).is_empty());
    change(&mut app, organ, |wish| wish.seed = 3);
    app.update();
    assert!(changes_since(&app, &mut cursor, entity).is_all(), "after a restart");
    // Changed by the test without marks: on another entity, inserted, and overwritten in place.
    let other = tube(1.0, 0.1, 100);
    let vessels = || Vessels::from_tree(VesselKind::Artery, &other, &[]);
    let entity = app.world_mut().spawn((VesselsOf(organ), vessels())).id();
    assert!(changes_since(&app, &mut cursor, entity).is_all(), "of another entity");
    assert!(changes_since(&app, &mut cursor, entity).is_empty());
    app.world_mut().entity_mut(entity).insert(vessels());
    assert!(changes_since(&app, &mut cursor, entity).is_all(), "inserted");
    let same = app.world().get::<Vessels>(entity).cloned().expect("it has vessels");
    app.world_mut().entity_mut(entity).insert(same);
    assert!(changes_since(&app, &mut cursor, entity).is_all(), "even the same");
    *app.world_mut().get_mut::<Vessels>(entity).expect("it has vessels") = vessels();
    app.update();
    assert!(changes_since(&app, &mut cursor, entity).is_all(), "written over");
    app.update();
    assert!(changes_since(&app, &mut cursor, entity).is_empty());
}

#[test]
fn vessels_updated_by_hand_mark_what_differs() {
    let mut app = headless(GrowthBudget::default());
    let tree = tube(1.0, 0.1, 100);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default());
    let entity = vessel_entity(app.world(), organ, VesselKind::Artery).expect("the organ has an artery");
    cut(&mut app, square(Vec3::X * 0.205, Vec3::X, 1.0));
    let mut cursor = ChangeCursor::default();
    assert!(!changes_since(&app, &mut cursor, entity).is_empty());
    let mut update = |app: &mut App, tree: &VesselTree| {
        let mut query = app.world_mut().query::<(&mut Vessels, &mut ChangeLog)>();
        let (mut vessels, mut log) = query.get_mut(app.world_mut(), entity).expect("vessels keep their changes");
        vessels.update_from_tree(tree, &[], &mut log);
        assert_eq!(vessels.tree(), tree);
        app.update();
        changes_since(app, &mut cursor, entity)
    };
    let is_cut = |app: &App| !wounds(app.world(), organ, VesselKind::Artery).is_empty();
    assert!(update(&mut app, &tree).is_empty());
    let grown = edited(&tree, |positions, parents, radii| {
        positions[40].y += 0.001;
        radii[70] *= 0.5;
        positions.push(Vec3::X * 1.01);
        parents.push(100);
        radii.push(0.1);
    });
    let changes = update(&mut app, &grown);
    assert_eq!(changes.dirty_nodes(0..grown.len()).collect::<Vec<_>>(), [40, 41, 70, 71, 101]);
    assert!(is_cut(&app), "they are the same vessels");
    let shorter = tube(1.0, 0.1, 50);
    assert!(update(&mut app, &shorter).is_all());
    assert!(!is_cut(&app), "they are others");
}

fn segment(tree: &VesselTree, node: usize) -> [f32; 8] {
    let parent = tree.parents().get(tree.parents()[node] as usize).map_or(node, |_| tree.parents()[node] as usize);
    let (from, to) = (tree.positions()[parent], tree.positions()[node]);
    [from.x, from.y, from.z, tree.radii()[parent], to.x, to.y, to.z, tree.radii()[node]]
}
