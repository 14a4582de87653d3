//! Paint on organs: its effect on growth, and that a stroke neither prepares a tissue again nor removes vessels.

use super::errors::failure;
use super::*;
use bevy_vessels::{
    plugin::{
        EntityCommandsExt, GrowthControl, GrowthFailed, GrowthFinished, GrowthStarted, OrganGrowthError, OrganPaint,
    },
    synthesis::{
        growth::Growth,
        tissue::{Guide, MeshTissue, NoGo, NoGoRegion, Tissue, TissueError, TissueMode, TissuePaint, TissueShape},
        tree::hash_trees,
    },
};
use std::{any::Any, ptr};

/// The no-go region of these tests: a ball around a point of the organ, whose radius is 0.5.
const REGION: NoGoRegion = NoGoRegion::Ball { center: Vec3::new(0.5, 0.0, 0.0), radius: 0.25 };

fn forbidden() -> TissuePaint {
    TissuePaint { no_go: NoGo { regions: vec![REGION], ..NoGo::default() }, ..TissuePaint::default() }
}

/// Positions of the organ's vertices.
fn vertices() -> Vec<Vec3> {
    let mesh = sphere();
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3());
    positions.expect("a sphere has positions").iter().map(|&position| position.into()).collect()
}

/// Tissue on the side of negative x only.
fn half() -> TissuePaint {
    let density = vertices().iter().map(|position| if position.x < 0.0 { 1.0 } else { 0.0 }).collect();
    TissuePaint { density: Some(density), ..TissuePaint::default() }
}

/// From the root, which is at the top, over the surface to the bottom.
fn guided() -> TissuePaint {
    let points = (0..=12).map(|i| 0.5 * Quat::from_rotation_z(0.22 * i as f32).mul_vec3(Vec3::Y)).collect();
    TissuePaint { guides: vec![Guide { points, deviation: 0.0, steps: 15 }], ..TissuePaint::default() }
}

fn spawn_with(app: &mut App, wish: Vasculature, paint: TissuePaint) -> Entity {
    let organ = spawn(app, wish);
    app.world_mut().entity_mut(organ).insert(OrganPaint(paint));
    organ
}

/// A stroke of a brush.
fn paint(app: &mut App, organ: Entity, paint: TissuePaint) {
    app.world_mut().entity_mut(organ).insert(OrganPaint(paint));
}

/// The result for an organ that was painted before it grew.
fn painted_from_the_start(wish: Vasculature, paint: TissuePaint) -> [VesselTree; 2] {
    let mut app = headless(GrowthBudget::Steps(1000));
    let organ = spawn_with(&mut app, wish, paint);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    trees(app.world(), organ)
}

fn hash(world: &World, organ: Entity) -> u64 {
    hash_trees(&trees(world, organ))
}

/// Runs frames until the successors have taken over. Meanwhile the drawn vessels stay, on the same entities, and no
/// tissue is prepared.
#[track_caller]
fn regrow(app: &mut App, organ: Entity) {
    let before = trees(app.world(), organ);
    let entities = KINDS.map(|kind| vessel_entity(app.world(), organ, kind));
    let mut frames = 0;
    app.update();
    run_until(app, "successors", |world| {
        assert_eq!(KINDS.map(|kind| vessel_entity(world, organ, kind)), entities, "entities stay");
        let phase = progress(world, organ).phase;
        if phase != GrowthPhase::Regrowing {
            assert!(matches!(phase, GrowthPhase::Growing | GrowthPhase::Finished), "{phase:?}");
            return true;
        }
        frames += 1;
        assert_eq!(trees(world, organ), before, "what is drawn stays");
        false
    });
    assert!(frames > 0, "nobody saw them grow");
    assert_ne!(trees(app.world(), organ), before, "the successors are there");
    assert_published(app.world(), organ);
}

/// Address of the tissue of the growth.
fn tissue(world: &World, organ: Entity) -> *const () {
    let state = world.get::<GrowthState>(organ).expect("an organ has a state");
    state.tissue().map_or(ptr::null(), |tissue: &dyn Tissue| ptr::from_ref(tissue).cast())
}

#[test]
fn a_stroke_leaves_tissue_and_vessels_until_others_have_grown() {
    let mut app = headless(GrowthBudget::Steps(4));
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let (blank, prepared) = (trees(app.world(), organ), tissue(app.world(), organ));
    let (mut started, mut finished) = (MessageCursor::default(), MessageCursor::default());
    drain::<GrowthStarted>(app.world(), &mut started);
    drain::<GrowthFinished>(app.world(), &mut finished);
    for stroke in [forbidden(), half(), guided()] {
        paint(&mut app, organ, stroke.clone());
        regrow(&mut app, organ);
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        assert_eq!(trees(app.world(), organ), painted_from_the_start(quick(), stroke), "as if painted before");
        assert_eq!(drain::<GrowthFinished>(app.world(), &mut finished).len(), 1);
        // Messages live for two frames or a little longer, so this one may be gone.
        assert!(drain::<GrowthStarted>(app.world(), &mut started).len() <= 1);
    }
    // The same address, since the tissue was kept.
    app.world_mut().entity_mut(organ).remove::<OrganPaint>();
    regrow(&mut app, organ);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), blank, "as if never painted");
    assert_eq!(hash(app.world(), organ), hash_trees(&blank));
    assert_eq!(tissue(app.world(), organ), prepared, "nothing was prepared again");
    assert_eq!(drain::<GrowthFinished>(app.world(), &mut finished).len(), 1);
    assert!(drain::<GrowthStarted>(app.world(), &mut started).len() <= 1);
}

#[test]
fn paint_that_changes_nothing_starts_nothing() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    run_until(&mut app, "step 3", |world| progress(world, organ).step == 3);
    paint(&mut app, organ, TissuePaint::default());
    app.update();
    assert_eq!((progress(app.world(), organ).phase, progress(app.world(), organ).step), (GrowthPhase::Growing, 4));
    app.world_mut().entity_mut(organ).remove::<OrganPaint>();
    app.update();
    assert_eq!((progress(app.world(), organ).phase, progress(app.world(), organ).step), (GrowthPhase::Growing, 5));
}

/// Asserts that no node and no drain of a growth is at a forbidden point.
#[track_caller]
fn assert_outside(growth: &dyn Growth, forbids: &dyn Fn(Vec3) -> bool) {
    let colonization = (growth as &dyn Any).downcast_ref::<Colonization>().expect("presets colonize");
    for kind in KINDS {
        let node = colonization.tree(kind).positions().iter().find(|&&node| forbids(node));
        assert_eq!(node, None, "a node of the {kind:?}s");
        assert_eq!(colonization.drains(kind).find(|&drain| forbids(drain)), None, "a drain of the {kind:?}s");
    }
}

/// Steps through a growth, and asserts after each step that nothing is at a forbidden point.
fn grow_outside(app: &mut App, organ: Entity, forbids: impl Fn(Vec3) -> bool) {
    run_until(app, "the end", |world| {
        let state = world.get::<GrowthState>(organ).expect("an organ has a state");
        let phase = progress(world, organ).phase;
        let growth = if phase == GrowthPhase::Regrowing { state.successor() } else { state.growth() };
        growth.into_iter().for_each(|growth| assert_outside(growth, &forbids));
        phase == GrowthPhase::Finished
    });
}

#[test]
fn nothing_grows_in_no_go_regions_of_surfaces_and_volumes() {
    let staged = TissueMode::Staged { surface_steps: 45 };
    for (mode, steps) in [(TissueMode::Surface, STEPS), (TissueMode::Volume, STEPS), (staged, 60)] {
        let mut wish = quick().with_tissue(MeshTissue { mode, resolution: 20 });
        settings_of(&mut wish).steps = steps;
        let mut app = headless(GrowthBudget::Steps(1));
        let organ = spawn(&mut app, wish);
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        let there = trees(app.world(), organ)[0].positions().iter().filter(|&&node| REGION.contains(node)).count();
        assert!(there > 5, "{mode:?}: {there} nodes are too few to tell");
        paint(&mut app, organ, forbidden());
        app.update();
        assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Regrowing);
        grow_outside(&mut app, organ, |point| REGION.contains(point));
        assert!(trees(app.world(), organ).iter().all(|tree| tree.len() > 50), "{mode:?}: the rest is supplied");
        // Points nearest to a painted vertex are forbidden, too; an edge is 0.1 long.
        let vertices = vertices().iter().map(|&vertex| REGION.contains(vertex)).collect();
        let no_go = NoGo { vertices: Some(vertices), ..NoGo::default() };
        paint(&mut app, organ, TissuePaint { no_go, ..TissuePaint::default() });
        app.update();
        assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Regrowing);
        grow_outside(&mut app, organ, |point| point.length() > 0.2 && point.normalize().distance(Vec3::X) < 0.3);
    }
}

#[test]
fn density_and_guides_lead_vessels() {
    let share = |tree: &VesselTree, is_there: &dyn Fn(Vec3) -> bool| {
        let there = tree.positions().iter().filter(|&&node| is_there(node)).count();
        there as f32 / tree.len() as f32
    };
    let [blank, thinned] = [TissuePaint::default(), half()].map(|paint| painted_from_the_start(quick(), paint));
    let is_there = |node: Vec3| node.x > 0.1;
    let [before, after] = [&blank, &thinned].map(|trees| share(&trees[0], &is_there));
    assert!(before > 0.3 && after < 0.1 * before, "{after} of the nodes where nothing is wanted, {before} before");

    let line = guided().guides.remove(0);
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn_with(&mut app, quick(), guided());
    run_until(&mut app, "the guide's steps", |world| progress(world, organ).step == line.steps);
    let tree = trees(app.world(), organ)[0].clone();
    let is_near = |node: Vec3| line.points.iter().any(|point| point.distance(node) < 0.1);
    let near = share(&tree, &is_near);
    let elsewhere = share(&blank[0], &is_near);
    assert!(tree.len() > 8 && near > 0.95 && elsewhere < 0.5, "{near} of {} nodes, {elsewhere} without", tree.len());
}

#[test]
fn a_stroke_during_growth_keeps_what_is_drawn_until_as_many_steps_are_done() {
    const DRAWN: u32 = 12;
    let mut app = headless(GrowthBudget::Steps(3));
    let organ = spawn(&mut app, quick());
    run_until(&mut app, "some steps", |world| progress(world, organ).step == DRAWN);
    paint(&mut app, organ, forbidden());
    regrow(&mut app, organ);
    assert_eq!(progress(app.world(), organ).step, DRAWN, "successors come as soon as they can");
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Growing);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), painted_from_the_start(quick(), forbidden()));
}

/// Drawn vessels pause while a job lays paint, and requested steps are done afterwards.
#[test]
fn a_growth_waits_for_the_paint_that_is_laid_and_can_be_finished_meanwhile() {
    for drawn in [12, STEPS] {
        let mut app = headless(GrowthBudget::Steps(3));
        app.insert_resource(JobSettings { mode: JobMode::Slices, at_once: 0, slice_time: Duration::ZERO });
        let organ = spawn(&mut app, quick());
        run_until(&mut app, "some steps", |world| progress(world, organ).step == drawn);
        let before = trees(app.world(), organ);
        paint(&mut app, organ, half());
        app.update();
        send(&mut app, organ, GrowthAction::Finish);
        run_until(&mut app, "the end", |world| {
            if progress(world, organ).phase == GrowthPhase::Finished {
                return true;
            }
            let state = world.get::<GrowthState>(organ).expect("an organ has a state");
            assert_eq!(progress(world, organ).phase, GrowthPhase::Regrowing, "{drawn} steps");
            assert!(state.successor().is_none(), "once the paint is there, all is done in one frame");
            assert_eq!(trees(world, organ), before, "{drawn} steps");
            false
        });
        assert_eq!(trees(app.world(), organ), painted_from_the_start(quick(), half()), "{drawn} steps");
    }
}

/// With other settings, too, all waits for the paint: nothing more grows with the old ones.
#[test]
fn a_growth_with_other_settings_waits_for_its_paint_and_can_be_finished_meanwhile() {
    let mut app = headless(GrowthBudget::Steps(3));
    app.insert_resource(JobSettings { mode: JobMode::Slices, at_once: 0, slice_time: Duration::ZERO });
    let organ = spawn(&mut app, quick());
    run_until(&mut app, "some steps", |world| progress(world, organ).step == 12);
    let (before, other) = (trees(app.world(), organ), quick().with_seed(8));
    app.world_mut().entity_mut(organ).insert(other.clone());
    paint(&mut app, organ, half());
    app.update();
    send(&mut app, organ, GrowthAction::Finish);
    run_until(&mut app, "the end", |world| {
        let phase = progress(world, organ).phase;
        if phase == GrowthPhase::PreparingTissue {
            assert_eq!(trees(world, organ), before, "nothing grows with the old seed");
        } else {
            assert_eq!(phase, GrowthPhase::Finished, "once the paint is there, all is done in one frame");
        }
        phase == GrowthPhase::Finished
    });
    assert_eq!(trees(app.world(), organ), painted_from_the_start(other, half()));
}

#[test]
fn a_stroke_before_the_first_step_starts_at_once() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert(GrowthControl::Paused);
    run_to_phase(&mut app, organ, GrowthPhase::Growing);
    paint(&mut app, organ, forbidden());
    send(&mut app, organ, GrowthAction::Resume);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), painted_from_the_start(quick(), forbidden()));
}

#[test]
fn of_strokes_that_follow_quickly_the_last_counts() {
    let last = painted_from_the_start(quick(), half());
    // Frames between the strokes: one while the first is laid, then while its successors grow.
    for frames in [0, 1, 2, 4] {
        let mut app = headless(GrowthBudget::Steps(4));
        let organ = spawn(&mut app, quick());
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        let before = trees(app.world(), organ);
        for stroke in [forbidden(), guided(), half()] {
            paint(&mut app, organ, stroke);
            (0..frames).for_each(|_| app.update());
            assert_eq!(trees(app.world(), organ), before, "{frames} frames between strokes");
        }
        regrow(&mut app, organ);
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        assert_eq!(trees(app.world(), organ), last, "{frames} frames between strokes");
    }
}

#[test]
fn strokes_while_the_tissue_is_prepared_are_laid_when_it_is_there() {
    let mut app = headless(GrowthBudget::Steps(4));
    let organ = spawn_with(&mut app, quick(), guided());
    app.update();
    paint(&mut app, organ, forbidden());
    app.update();
    paint(&mut app, organ, half());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), painted_from_the_start(quick(), half()));
}

/// A bad stroke that is corrected before its failure is noticed does no harm.
#[test]
fn a_bad_stroke_that_is_followed_by_a_good_one_fails_nothing() {
    let (bad, ..) = bad_paints().remove(0);
    for has_grown in [false, true] {
        // A job lays the bad stroke, so the good one comes before its failure.
        let mut app = headless(GrowthBudget::Steps(10));
        app.insert_resource(JobSettings { mode: JobMode::Slices, at_once: 0, slice_time: Duration::ZERO });
        let organ = spawn(&mut app, quick());
        if has_grown {
            run_to_phase(&mut app, organ, GrowthPhase::Finished);
        }
        paint(&mut app, organ, bad.clone());
        app.update();
        paint(&mut app, organ, half());
        let mut failed = MessageCursor::<GrowthFailed>::default();
        app.update();
        run_until(&mut app, "the end", |world| {
            assert_eq!(drain(world, &mut failed), [], "{has_grown}");
            progress(world, organ).phase == GrowthPhase::Finished
        });
        assert_eq!(trees(app.world(), organ), painted_from_the_start(quick(), half()));
    }
}

#[test]
fn a_stroke_that_is_taken_back_leaves_the_vessels_as_they_are() {
    for frames in 0..4 {
        let mut app = headless(GrowthBudget::Steps(4));
        let organ = spawn(&mut app, quick());
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        let before = trees(app.world(), organ);
        paint(&mut app, organ, forbidden());
        (0..frames).for_each(|_| app.update());
        app.world_mut().entity_mut(organ).remove::<OrganPaint>();
        app.update();
        assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished, "after {frames} frames");
        assert_eq!(trees(app.world(), organ), before);
        (0..5).for_each(|_| app.update());
        assert_eq!(trees(app.world(), organ), before, "nothing comes late");
    }
}

/// Invalid paint, and its error: the value, and the remedy.
fn bad_paints() -> Vec<(TissuePaint, &'static str, &'static str)> {
    let count = vertices().len();
    let density = |values: Vec<f32>| TissuePaint { density: Some(values), ..TissuePaint::default() };
    let no_go = |no_go: NoGo| TissuePaint { no_go, ..TissuePaint::default() };
    let ball = |center, radius| no_go(NoGo { regions: vec![NoGoRegion::Ball { center, radius }], ..NoGo::default() });
    let guide = |points: Vec<Vec3>, deviation| TissuePaint {
        guides: vec![Guide { points, deviation, ..Guide::default() }],
        ..TissuePaint::default()
    };
    let mut with_nan = vec![1.0; count];
    with_nan[77] = f32::NAN;
    let side = NoGoRegion::Cuboid { center: Vec3::ZERO, size: Vec3::new(1.0, 0.0, 1.0) };
    vec![
        (density(vec![0.5; 3]), "3 values", "one for each vertex"),
        (density(vec![]), "0 values", "one for each vertex"),
        (density(with_nan), "value 77", "0 to 1"),
        (no_go(NoGo { vertices: Some(vec![true; 5]), ..NoGo::default() }), "5 vertices", "one mark for each"),
        (ball(Vec3::ZERO, -0.5), "-0.5", "above 0"),
        (ball(Vec3::ZERO, f32::NAN), "NaN", "finite"),
        (ball(Vec3::new(0.0, f32::INFINITY, 0.0), 1.0), "inf", "finite"),
        (no_go(NoGo { regions: vec![side], ..NoGo::default() }), "is 0", "above 0"),
        (guide(vec![Vec3::X], 0.0), "1 points", "2 to"),
        (guide(vec![Vec3::X; 4], 0.0), "0 long", "must not all coincide"),
        (guide(vec![Vec3::X, Vec3::NAN], 0.0), "NaN", "finite"),
        (guide(vec![Vec3::X, Vec3::Y], -1.0), "-1", "at least 0"),
    ]
}

#[test]
fn bad_paint_is_named_and_the_vessels_stay() {
    for (stroke, value, remedy) in bad_paints() {
        let mut app = headless(GrowthBudget::Steps(10));
        let organ = spawn(&mut app, quick());
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        let before = trees(app.world(), organ);
        paint(&mut app, organ, stroke.clone());
        let error = failure(&mut app, organ).error;
        let told = error.to_string();
        assert!(matches!(error, OrganGrowthError::Tissue(_)), "{told}");
        assert!(told.contains(value) && told.contains(remedy), "{told}");
        assert_eq!(trees(app.world(), organ), before, "{told}");
        // Taking it back is enough.
        app.world_mut().entity_mut(organ).remove::<OrganPaint>();
        app.update();
        assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished, "{told}");
        assert_eq!(trees(app.world(), organ), before, "{told}");
        // So is other paint.
        paint(&mut app, organ, stroke);
        failure(&mut app, organ);
        paint(&mut app, organ, half());
        regrow(&mut app, organ);
    }
}

#[test]
fn an_organ_that_is_badly_painted_from_the_start_has_no_vessels_until_it_is_repaired() {
    for (stroke, value, remedy) in bad_paints() {
        let mut app = headless(GrowthBudget::Steps(10));
        let organ = spawn_with(&mut app, quick(), stroke);
        let told = failure(&mut app, organ).error.to_string();
        assert!(told.contains(value) && told.contains(remedy), "{told}");
        assert_eq!(vessel_entity(app.world(), organ, VesselKind::Artery), None);
        paint(&mut app, organ, half());
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        assert_eq!(trees(app.world(), organ), painted_from_the_start(quick(), half()), "{told}");
    }
}

#[test]
fn vertices_of_an_organ_without_a_mesh_cannot_be_painted() {
    let mut app = headless(GrowthBudget::default());
    let wish = quick().with_tissue(TissueShape::ball(0.5));
    let organ = app.world_mut().spawn((wish, OrganPaint(half()))).id();
    let error = failure(&mut app, organ).error;
    assert!(matches!(error, OrganGrowthError::Tissue(TissueError::NoVertices { .. })), "{error}");
    assert!(error.to_string().contains("balls and boxes"), "{error}");
    paint(&mut app, organ, forbidden());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert!(trees(app.world(), organ)[0].positions().iter().all(|&node| !REGION.contains(node)));
}

/// A large tissue is painted a little in each frame, with the same result.
#[test]
fn a_stroke_on_a_large_organ_holds_up_no_frame() {
    let wish = quick().with_tissue(MeshTissue { mode: TissueMode::Volume, resolution: 16 });
    let mesh = || Sphere::new(0.5).mesh().uv(160, 90);
    let count = mesh().count_vertices();
    let density = (0..count).map(|vertex| (vertex % 2) as f32).collect();
    let stroke = TissuePaint { density: Some(density), ..guided() };
    let grown = [0, usize::MAX].map(|at_once| {
        let mut app = headless(GrowthBudget::Steps(10));
        app.insert_resource(JobSettings { mode: JobMode::Slices, at_once, slice_time: Duration::ZERO });
        let mesh = add_mesh(&mut app, mesh());
        let organ = app.world_mut().spawn((Mesh3d(mesh), wish.clone())).id();
        app.world_mut().commands().entity(organ).grow_now();
        app.update();
        paint(&mut app, organ, stroke.clone());
        let mut told = Vec::new();
        app.update();
        run_until(&mut app, "successors", |world| {
            let state = world.get::<GrowthState>(organ).expect("an organ has a state");
            told.push(progress(world, organ).prepared);
            state.successor().is_some()
        });
        let frames = told.len();
        assert!(told.is_sorted() && told.iter().all(|share| (0.0..=1.0).contains(share)), "{told:?}");
        assert_eq!(frames > 1, at_once == 0, "{frames} frames");
        if at_once == 0 {
            // Some 29 thousand triangles are indexed, 15 thousand values checked, and a guide laid.
            assert!(frames > 40 && told.iter().filter(|share| (0.05..0.95).contains(*share)).count() > 20, "{told:?}");
        }
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        hash(app.world(), organ)
    });
    assert_eq!(grown[0], grown[1]);
}
