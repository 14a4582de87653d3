//! Vessels that have grown get closed meshes, which follow cuts, growths and soft bodies, and are saved.

use super::operating_field::*;
use super::*;
use bevy::camera::primitives::Aabb;
use bevy_vessels::{
    plugin::{
        Cuttable, CuttableVessels, FollowsMesh, GrowthControl, SegmentColoring, SurfaceCommand, SurfaceCommandsExt,
        SurfaceFailed, SurfaceLevel, SurfaceMoment, SurfaceNotSaved, SurfaceReady, SurfaceSaveError, SurfaceSaved,
        SurfaceShown, VesselAppearance, VesselMesh, VesselSurface, triangle_mesh,
    },
    synthesis::{
        io::{SurfaceOptions, SurfacePart, load_mesh},
        surface::SurfaceSettings,
    },
};
use std::path::PathBuf;

const FRAME: Duration = Duration::from_millis(16);

/// Asks for surfaces without levels of detail, which are quickest.
fn plain() -> VesselSurface {
    VesselSurface { detail: None, ..default() }
}

fn mesh_of(world: &World, organ: Entity, kind: VesselKind) -> &VesselMesh {
    let vessels = vessel_entity(world, organ, kind).expect("the kind has vessels");
    world.get::<VesselMesh>(vessels).expect("an organ with surfaces")
}

fn is_shown(world: &World, organ: Entity) -> bool {
    let Some(vessels) = world.get::<OrganVessels>(organ) else { return false };
    let shown = |&entity: &Entity| world.get::<VesselMesh>(entity).is_some_and(VesselMesh::is_shown);
    !vessels.entities().is_empty() && vessels.entities().iter().all(shown)
}

#[track_caller]
fn run_until_shown(app: &mut App, organ: Entity) {
    run_until(app, "surfaces", |world| is_shown(world, organ));
}

/// Asserts that a surface is closed, with a tree for each of so many roots.
#[track_caller]
fn assert_closed(mesh: &VesselMesh, trees: i64) {
    let surface = mesh.surface().expect("a surface");
    let closure = surface.mesh.closure();
    assert!(closure.is_closed(), "{closure:?}");
    assert_eq!(closure.euler(), 2 * trees, "{closure:?}");
}

fn level_count(app: &mut App) -> usize {
    app.world_mut().query::<&SurfaceLevel>().iter(app.world()).count()
}

fn roots(tree: &VesselTree) -> i64 {
    tree.roots().count() as i64
}

/// The vertices that an entity draws, in the space of its vessels.
fn vertices(world: &World, entity: Entity) -> Vec<Vec3> {
    let at = world.get::<Transform>(entity).expect("a place").translation;
    let mesh = world.get::<Mesh3d>(entity).expect("a mesh");
    let mesh = world.resource::<Assets<Mesh>>().get(mesh.id()).expect("an asset");
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3()).expect("positions");
    positions.iter().map(|&position| Vec3::from(position) + at).collect()
}

#[test]
fn a_mesh_appears_when_the_vessels_have_grown() {
    let mut app = timed_app(FRAME);
    app.insert_resource(GrowthBudget::Steps(2));
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert(VesselSurface::default());
    let mut ready = MessageCursor::<SurfaceReady>::default();
    while progress(app.world(), organ).phase != GrowthPhase::Finished {
        assert!(!is_shown(app.world(), organ) && level_count(&mut app) == 0, "not while they grow");
        app.update();
        thread::sleep(Duration::from_millis(1));
    }
    let mut news = Vec::new();
    run_until(&mut app, "surfaces", |world| {
        news.extend(drain(world, &mut ready));
        is_shown(world, organ)
    });
    assert!(
        KINDS.iter().all(|&kind| news.iter().filter(|ready| (ready.organ, ready.kind) == (organ, kind)).count() == 1)
    );
    for kind in KINDS {
        let (vessels, mesh) = (published(app.world(), organ, kind), mesh_of(app.world(), organ, kind));
        assert_closed(mesh, roots(vessels.tree()));
        let counts: Vec<usize> = mesh.levels().map(|level| level.mesh.triangle_count()).collect();
        assert!(counts.len() == 3 && counts[0] > counts[1] && counts[1] >= counts[2], "{counts:?}");
        assert_eq!((mesh.is_ready(), mesh.progress(), mesh.error()), (true, None, None));
        for (&entity, level) in mesh.entities().iter().zip(mesh.levels()) {
            let drawn = vertices(app.world(), entity);
            assert!(drawn.iter().zip(&level.mesh.positions).all(|(a, b)| a.distance(*b) < 1e-5));
            let aabb = app.world().get::<Aabb>(entity).expect("a box");
            let from = app.world().get::<Transform>(entity).expect("a place").translation;
            assert!(
                drawn.iter().all(|&at| (Vec3A::from(at - from) - aabb.center).abs().cmple(aabb.half_extents).all())
            );
            assert_eq!(app.world().get::<Visibility>(entity), Some(&Visibility::Inherited));
        }
    }
    assert_eq!(level_count(&mut app), 6);
}

#[test]
fn a_switch_keeps_the_segments() {
    let mut app = timed_app(FRAME);
    let tree = fork(0.2);
    let surface = VesselSurface { shows: SurfaceShown::Preview, ..plain() };
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], (surface, VesselAppearance::default()));
    run_until(&mut app, "a surface", |world| mesh_of(world, organ, VesselKind::Artery).is_ready());
    let entity = mesh_of(app.world(), organ, VesselKind::Artery).entities()[0];
    let visibility = |app: &App| *app.world().get::<Visibility>(entity).expect("it is drawn");
    let shows = |app: &mut App, shows| {
        app.world_mut().get_mut::<VesselSurface>(organ).expect("asked for").shows = shows;
        app.update();
    };
    assert_eq!((is_shown(app.world(), organ), visibility(&app)), (false, Visibility::Hidden));
    shows(&mut app, SurfaceShown::Mesh);
    assert_eq!((is_shown(app.world(), organ), visibility(&app)), (true, Visibility::Inherited));
    // Only segments have the colours of a measure.
    app.world_mut().get_mut::<VesselAppearance>(organ).expect("a look").coloring = SegmentColoring::Radius;
    app.update();
    assert_eq!((is_shown(app.world(), organ), visibility(&app)), (false, Visibility::Hidden));
    app.world_mut().get_mut::<VesselAppearance>(organ).expect("a look").coloring = SegmentColoring::Kind;
    shows(&mut app, SurfaceShown::Preview);
    assert!(!is_shown(app.world(), organ));
}

#[test]
fn a_cut_shows_the_segments_until_the_mesh_has_its_stumps() {
    let mut app = timed_app(FRAME);
    let tree = tube(10.0, 0.2, 10);
    let organ = organ_of(&mut app, &[(VesselKind::Vein, &tree)], (plain(), Cuttable::default()));
    run_until_shown(&mut app, organ);
    let artery = VesselKind::Vein;
    let whole = mesh_of(app.world(), organ, artery).surface().expect("a surface").clone();
    assert_closed(mesh_of(app.world(), organ, artery), 1);
    cut(&mut app, square(Vec3::X * 4.5, Vec3::X, 3.0));
    assert!(IN_SLICES.then(|| is_shown(app.world(), organ)) != Some(true), "the old mesh has no gap");
    run_until_shown(&mut app, organ);
    let mesh = mesh_of(app.world(), organ, artery);
    assert_closed(mesh, 2);
    let surface = &mesh.surface().expect("a surface").mesh;
    // Each end retracts by one and a half radii.
    assert!(surface.positions.iter().all(|at| (at.x - 4.5).abs() > 0.28), "the gap is as wide as the ledger says");
    let near = |x: f32| surface.positions.iter().any(|at| (at.x - x).abs() < 0.06);
    assert!(near(4.5 - 0.3) && near(4.5 + 0.3), "and no wider");
    assert!(surface.nodes.iter().all(|&node| (node as usize) < tree.len()), "nodes are those of the whole tree");
    for (at, &node) in surface.positions.iter().zip(&surface.nodes).filter(|(at, _)| at.x > 5.5) {
        assert!(node >= 5, "{at} belongs to node {node}");
    }
    operate(&mut app, CuttableVessels::undo);
    run_until_shown(&mut app, organ);
    assert_eq!(mesh_of(app.world(), organ, artery).surface(), Some(&whole), "undo leaves no trace");
}

#[test]
fn a_clamp_leaves_the_mesh_alone() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Vein, &fork(0.2))], (plain(), Cuttable::default()));
    run_until_shown(&mut app, organ);
    let mut ready = MessageCursor::<SurfaceReady>::default();
    drain(app.world(), &mut ready);
    clamp_roots(&mut app, organ, VesselKind::Vein);
    for _ in 0..5 {
        assert!(is_shown(app.world(), organ));
        app.update();
    }
    assert_eq!(drain(app.world(), &mut ready), []);
}

#[test]
fn vessels_that_grow_again_are_segments_until_they_have_grown() {
    let mut app = timed_app(FRAME);
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert(plain());
    run_until_shown(&mut app, organ);
    let before = mesh_of(app.world(), organ, VesselKind::Artery).surface().expect("a surface").clone();
    app.insert_resource(GrowthBudget::Steps(1));
    app.world_mut().get_mut::<Vasculature>(organ).expect("a wish").seed = 99;
    run_until(&mut app, "a new growth", |world| progress(world, organ).phase == GrowthPhase::Growing);
    (0..2).for_each(|_| app.update());
    for kind in KINDS {
        assert!(!mesh_of(app.world(), organ, kind).is_shown() && !mesh_of(app.world(), organ, kind).is_ready());
        for &entity in mesh_of(app.world(), organ, kind).entities() {
            assert_eq!(app.world().get::<Visibility>(entity), Some(&Visibility::Hidden));
        }
    }
    run_until_shown(&mut app, organ);
    assert_ne!(mesh_of(app.world(), organ, VesselKind::Artery).surface(), Some(&before));
    assert_eq!(level_count(&mut app), 2, "the same entities show the new mesh");
}

#[test]
fn meshes_turn_with_their_organ() {
    let mut app = timed_app(FRAME);
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert((VesselSurface::default(), FollowsMesh, Cuttable::default()));
    run_until_shown(&mut app, organ);
    cut(&mut app, square(Vec3::Y * 0.1, Vec3::Y, 0.3));
    run_until_shown(&mut app, organ);
    // The vessels have to be bound, too.
    (0..50).for_each(|_| {
        app.update();
        thread::sleep(Duration::from_millis(1));
    });
    let entities: Vec<Entity> =
        KINDS.iter().flat_map(|&kind| mesh_of(app.world(), organ, kind).entities().to_vec()).collect();
    assert_eq!(entities.len(), 6);
    let before: Vec<Vec<Vec3>> = entities.iter().map(|&entity| vertices(app.world(), entity)).collect();
    let turn = Quat::from_euler(EulerRot::XYZ, 0.9, -0.4, 2.0);
    let by = Vec3::new(3.0, -1.0, 0.5);
    let move_organ = |app: &mut App, to: &dyn Fn(Vec3) -> Vec3| {
        let id = app.world().get::<Mesh3d>(organ).expect("an organ").id();
        let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
        let mut mesh = meshes.get_mut(id).expect("a mesh");
        let moved: Vec<[f32; 3]> =
            triangle_mesh(&mesh).expect("triangles").positions().iter().map(|&at| to(at).to_array()).collect();
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, moved);
        drop(mesh);
        app.update();
    };
    move_organ(&mut app, &|at| turn * at + by);
    assert!(is_shown(app.world(), organ), "moved vessels need no new mesh");
    for (&entity, before) in entities.iter().zip(&before) {
        let now = vertices(app.world(), entity);
        for (now, before) in now.iter().zip(before) {
            assert!(now.distance(turn * *before + by) < 1e-4, "{now} for {}", turn * *before + by);
        }
        let (aabb, at) = (app.world().get::<Aabb>(entity).expect("a box"), app.world().get::<Transform>(entity));
        let at = at.expect("a place").translation;
        assert!(
            now.iter().all(|&now| (Vec3A::from(now - at) - aabb.center).abs().cmple(aabb.half_extents + 1e-3).all())
        );
    }
    // The mesh's change is heard of a frame later; without the component it would be another organ.
    app.update();
    app.world_mut().entity_mut(organ).remove::<FollowsMesh>();
    app.update();
    assert!(is_shown(app.world(), organ));
    for (&entity, before) in entities.iter().zip(&before) {
        let now = vertices(app.world(), entity);
        assert!(now.iter().zip(before).all(|(now, before)| now.distance(*before) < 1e-5), "back at rest");
    }
}

#[test]
fn on_demand_means_when_asked_for() {
    let mut app = timed_app(FRAME);
    let organ = spawn(&mut app, quick());
    let surface = VesselSurface { when: SurfaceMoment::OnDemand, ..plain() };
    app.world_mut().entity_mut(organ).insert((surface, GrowthControl::Paused));
    send(&mut app, organ, GrowthAction::Step(10));
    run_until(&mut app, "steps", |world| progress(world, organ).step == 10);
    (0..10).for_each(|_| app.update());
    assert_eq!(level_count(&mut app), 0);
    app.world_mut().write_message(SurfaceCommand::make(organ));
    run_until_shown(&mut app, organ);
    send(&mut app, organ, GrowthAction::Step(1));
    run_until(&mut app, "a step", |world| progress(world, organ).step == 11);
    (0..10).for_each(|_| app.update());
    assert!(!is_shown(app.world(), organ), "another tree, for which nobody has asked");
    app.world_mut().commands().entity(organ).make_surface();
    app.world_mut().flush();
    run_until_shown(&mut app, organ);
}

#[test]
fn organs_that_ask_for_nothing_get_nothing() {
    let mut app = timed_app(FRAME);
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    (0..5).for_each(|_| app.update());
    assert_eq!(app.world_mut().query::<&VesselMesh>().iter(app.world()).count(), 0);
    app.world_mut().entity_mut(organ).insert(plain());
    run_until_shown(&mut app, organ);
    let assets = |app: &App| app.world().resource::<Assets<Mesh>>().len();
    let with = assets(&app);
    app.world_mut().entity_mut(organ).remove::<VesselSurface>();
    (0..3).for_each(|_| app.update());
    assert_eq!(app.world_mut().query::<&VesselMesh>().iter(app.world()).count(), 0);
    assert_eq!((level_count(&mut app), assets(&app)), (0, with - 2));
}

#[test]
fn removal_stops_what_is_under_way() {
    let mut app = timed_app(FRAME);
    app.insert_resource(JobSettings { mode: JobMode::Slices, at_once: 0, slice_time: Duration::ZERO });
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(100.0, 0.1, 2000))], plain());
    (0..3).for_each(|_| app.update());
    let progress = mesh_of(app.world(), organ, VesselKind::Artery).progress();
    assert!(progress.is_some_and(|progress| progress < 1.0), "{progress:?}");
    app.world_mut().entity_mut(organ).remove::<VesselSurface>();
    let mut ready = MessageCursor::<SurfaceReady>::default();
    (0..5).for_each(|_| app.update());
    assert_eq!((drain(app.world(), &mut ready), level_count(&mut app)), (Vec::new(), 0));
}

#[test]
fn settings_out_of_their_limits_are_told_once_and_mended() {
    let mut app = timed_app(FRAME);
    let surface = VesselSurface { settings: SurfaceSettings { most_sides: 7, ..default() }, ..plain() };
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &fork(0.2))], surface);
    let mut failed = MessageCursor::<SurfaceFailed>::default();
    let mut told = drain(app.world(), &mut failed);
    for _ in 0..20 {
        app.update();
        told.extend(drain(app.world(), &mut failed));
        thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(mesh_of(app.world(), organ, VesselKind::Artery).error().is_some());
    app.world_mut().get_mut::<VesselSurface>(organ).expect("asked for").settings.most_sides = 8;
    run_until_shown(&mut app, organ);
    assert!(mesh_of(app.world(), organ, VesselKind::Artery).error().is_none());
}

/// A file in a folder that no other test has.
fn file(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("bevy_vessels_surfaces_{}_{}", std::process::id(), IN_SLICES));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join(name)
}

#[test]
fn surfaces_are_saved_in_the_background_and_read_back() {
    let mut app = timed_app(FRAME);
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert(VesselSurface { when: SurfaceMoment::OnDemand, ..plain() });
    // Asked for while the vessels grow: they are saved once they have.
    app.insert_resource(GrowthBudget::Steps(3));
    run_until(&mut app, "a start", |world| progress(world, organ).step > 3);
    let mut saved = MessageCursor::<SurfaceSaved>::default();
    for name in ["vessels.obj", "vessels.glb"] {
        app.world_mut().commands().entity(organ).save_surface(file(name));
        app.world_mut().flush();
    }
    let mut told = Vec::new();
    run_until(&mut app, "files", |world| {
        told.extend(drain(world, &mut saved));
        told.len() == 2
    });
    let triangles: usize = KINDS
        .iter()
        .map(|&kind| mesh_of(app.world(), organ, kind).surface().expect("a surface").mesh.triangle_count())
        .sum();
    for SurfaceSaved { organ: of, path } in told {
        assert_eq!(of, organ);
        let read = load_mesh(&path).expect("a mesh");
        assert_eq!(read.triangles().len(), triangles, "{}", path.display());
    }
}

#[test]
fn what_cannot_be_saved_is_told() {
    let mut app = timed_app(FRAME);
    let mut failed = MessageCursor::<SurfaceNotSaved>::default();
    let bare = organ_of(&mut app, &[(VesselKind::Artery, &fork(0.2))], ());
    let empty = organ_of(&mut app, &[], plain());
    let blank = organ_of(&mut app, &[(VesselKind::Artery, &VesselTree::new())], plain());
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &fork(0.2))], plain());
    for (organ, path) in [
        (bare, file("a.ply")),
        (blank, file("e.ply")),
        (empty, file("b.ply")),
        (organ, file("c.blend")),
        (organ, file("no/d.ply")),
    ] {
        app.world_mut().commands().entity(organ).save_surface_with(path, SurfaceOptions::default());
    }
    app.world_mut().flush();
    let mut told = Vec::new();
    run_until(&mut app, "answers", |world| {
        told.extend(drain(world, &mut failed));
        told.len() == 5
    });
    let errors_of =
        |of: Entity| told.iter().filter(|failed| failed.organ == of).map(|failed| &failed.error).collect::<Vec<_>>();
    assert!(matches!(errors_of(bare)[..], [SurfaceSaveError::NoSurface]));
    assert!(matches!(errors_of(empty)[..], [SurfaceSaveError::NoVessels]));
    assert!(matches!(errors_of(blank)[..], [SurfaceSaveError::NoVessels]));
    assert!(matches!(errors_of(organ)[..], [SurfaceSaveError::Write(_), SurfaceSaveError::Write(_)]), "{told:?}");
}

#[test]
fn files_have_the_colours_in_which_vessels_are_drawn() {
    for kind in VesselKind::ALL {
        let drawn = VesselAppearance::DEFAULT_COLORS[kind].to_linear();
        let written = SurfacePart::DEFAULT_COLORS[kind];
        for (a, b) in [drawn.red, drawn.green, drawn.blue].into_iter().zip(written) {
            assert!((a - b).abs() < 1e-5, "{kind:?}: {drawn:?} is drawn, {written:?} written");
        }
    }
}
