//! A generator outside the crate, which splits segments and grows more than two kinds: all data that refers to a
//! replaced tree follows it or is cleared.

use super::operating_field::*;
use super::*;
use bevy::ecs::system::RunSystemOnce;
use bevy_vessels::{
    plugin::{
        BloodLoss, Cuttable, CuttableVessels, FollowsMesh, GrowthControl, OpenEnd, VesselPicker, VesselPlace,
        VesselWounds, WoundedGrowth,
    },
    synthesis::{
        generator::{CustomGenerator, Generator, GrowthMaker},
        growth::{GrownTree, Growth, StepCount, TreeUpdate},
        roots::{RootPlacements, RootSpacing, Roots},
        tissue::Tissue,
        tree::{ByKind, NO_PARENT},
    },
};
use std::sync::Arc;

const FRAME: Duration = Duration::from_millis(16);

/// Kinds that the splitter grows, unlike those of colonization.
const KINDS: [VesselKind; 3] = [VesselKind::Artery, VesselKind::PortalVein, VesselKind::Duct];

/// Grows a straight vessel of each kind through the organ, and splits its longest segment in each step.
#[derive(Debug)]
struct Splitter;

impl GrowthMaker for Splitter {
    fn root_spacing(&self, scale: f32) -> ByKind<Option<RootSpacing>> {
        ByKind::from_fn(|kind| KINDS.contains(&kind).then_some(RootSpacing { step: 0.01 * scale, reach: scale }))
    }

    fn start(&self, tissue: Arc<dyn Tissue>, roots: &Roots, scale: f32, seed: u64) -> Result<Box<dyn Growth>, String> {
        let placed = roots.resolve(tissue.as_ref(), &self.root_spacing(scale), seed);
        let placed = placed.map_err(|error| error.to_string())?;
        let lines = placed.map(|_, roots| {
            roots.first().map(|root| Line {
                points: vec![root.position, -root.position],
                births: vec![0, 0],
                tree: VesselTree::new(),
            })
        });
        let mut growth = Splitting { lines, step: 0 };
        growth.settle();
        Ok(Box::new(growth))
    }
}

#[derive(Debug)]
struct Line {
    points: Vec<Vec3>,
    births: Vec<u32>,
    tree: VesselTree,
}

#[derive(Debug)]
struct Splitting {
    lines: ByKind<Option<Line>>,
    step: u32,
}

impl Splitting {
    const STEPS: u32 = 6;
}

impl Growth for Splitting {
    fn advance(&mut self) {
        if self.is_finished() {
            return;
        }
        self.step += 1;
        for line in self.lines.values_mut().flatten() {
            let length = |i: &usize| line.points[*i].distance(line.points[i - 1]);
            let longest = (1..line.points.len()).max_by(|a, b| length(a).total_cmp(&length(b))).expect("a segment");
            let between = line.points[longest - 1].lerp(line.points[longest], 0.4);
            line.points.insert(longest, between);
            line.births.insert(longest, self.step);
        }
    }

    fn settle(&mut self) {
        for Line { points, tree, .. } in self.lines.values_mut().flatten() {
            let parents = (0..points.len()).map(|node| if node == 0 { NO_PARENT } else { node as u32 - 1 }).collect();
            let radii = vec![0.01; points.len()];
            *tree = VesselTree::from_arrays(points.clone(), parents, radii).expect("a line is a tree");
        }
    }

    fn is_finished(&self) -> bool {
        self.step >= Self::STEPS
    }

    fn progress(&self) -> StepCount {
        StepCount { done: self.step, all: Self::STEPS }
    }

    fn trees(&self) -> ByKind<Option<GrownTree<'_>>> {
        self.lines.as_ref().map(|_, line| {
            line.as_ref().map(|line| GrownTree { birth_steps: &line.births, ..GrownTree::of(&line.tree) })
        })
    }

    fn update(&self, _: VesselKind) -> TreeUpdate<'_> {
        TreeUpdate::Replaced
    }
}

/// An organ on which the splitter has started, and which waits.
fn paused(app: &mut App, components: impl Bundle) -> Entity {
    // Blood flows in vessels that grow only where their network is made at once.
    app.insert_resource(JobSettings::default());
    let at = |x: f32| RootPlacement::Nearest(vec![Vec3::new(x, 0.5, 0.0)]);
    let roots = RootPlacements {
        artery: at(0.0),
        vein: RootPlacement::None,
        portal_vein: at(0.2),
        duct: RootPlacement::Beside,
    };
    let splitter = Generator::Custom(CustomGenerator::new(Splitter));
    let organ = spawn(app, Vasculature::default().with_generator(splitter).with_roots(roots));
    let goes_on = Cuttable { growth: WoundedGrowth::GoesOn, ..default() };
    app.world_mut().entity_mut(organ).insert((GrowthControl::Paused, goes_on, components));
    run_to_phase(app, organ, GrowthPhase::Growing);
    (0..2).for_each(|_| app.update());
    organ
}

fn grown_tree(world: &World, organ: Entity, kind: VesselKind) -> VesselTree {
    let state = world.get::<GrowthState>(organ).expect("an organ has a state");
    state.growth().and_then(|growth| growth.tree(kind).cloned()).expect("the kind has a tree")
}

fn lossless(world: &World, organ: Entity) -> bool {
    world.get::<BloodLoss>(organ).is_some_and(|loss| loss.bleeding_ends == 0)
}

#[test]
fn every_kind_is_published_anew_after_each_step() {
    let mut app = timed_app(FRAME);
    let organ = paused(&mut app, ());
    assert_eq!(vessel_entity(app.world(), organ, VesselKind::Vein), None);
    let entities = KINDS.map(|kind| vessel_entity(app.world(), organ, kind));
    for step in 1..=Splitting::STEPS {
        send(&mut app, organ, GrowthAction::Step(1));
        app.update();
        for kind in KINDS {
            let vessels = published(app.world(), organ, kind);
            assert_eq!(vessels.tree(), &grown_tree(app.world(), organ, kind), "{} in step {step}", kind.name());
            assert_eq!(vessels.tree().len(), 2 + step as usize);
            assert_eq!(vessels.birth_steps().iter().copied().max(), Some(step));
            assert_eq!(progress(app.world(), organ).nodes[kind], vessels.tree().len());
        }
    }
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
    assert_eq!(KINDS.map(|kind| vessel_entity(app.world(), organ, kind)), entities, "entities stay");
}

#[test]
fn a_replaced_tree_has_no_wounds_and_nothing_of_them_is_left() {
    let mut app = timed_app(FRAME);
    let organ = paused(&mut app, blood());
    cut(&mut app, square(Vec3::new(0.0, 0.1, 0.0), Vec3::Y, 3.0));
    assert!(KINDS.iter().all(|&kind| severed(app.world(), organ, kind).len() == 1));
    assert_eq!(open_ends(&mut app).len(), 6);
    app.update();
    let bleeding = |app: &mut App, kind| {
        let of_kind = open_ends(app).into_iter().filter(|end| end.kind == kind);
        of_kind.map(|end| end.flow.ml_per_min()).fold(0.0, f64::max)
    };
    let rates = KINDS.map(|kind| bleeding(&mut app, kind));
    assert!(rates[0] > rates[1] && rates[1] > 0.0, "arteries bleed more than portal veins: {rates:?}");
    assert_eq!(rates[2], 0.0, "a duct carries no blood");
    send(&mut app, organ, GrowthAction::Step(1));
    app.update();
    for kind in KINDS {
        let entity = vessel_entity(app.world(), organ, kind).expect("the entity stays");
        assert!(app.world().get::<VesselWounds>(entity).is_some_and(|wounds| wounds.is_empty()), "{}", kind.name());
    }
    assert_eq!(open_ends(&mut app).len(), 0, "no end is left");
    assert_eq!(app.world_mut().query::<&OpenEnd>().iter(app.world()).count(), 0);
    assert_eq!(app.world().resource::<CuttableVessels>().actions(), 0, "nothing is left to undo");
    app.update();
    assert!(lossless(app.world(), organ));
}

#[test]
fn a_replaced_tree_can_be_cut_and_bleeds_again() {
    let mut app = timed_app(FRAME);
    let organ = paused(&mut app, blood());
    for _ in 0..3 {
        send(&mut app, organ, GrowthAction::Step(1));
        app.update();
        cut(&mut app, square(Vec3::new(0.0, -0.2, 0.0), Vec3::Y, 3.0));
        app.update();
        assert!(!lossless(app.world(), organ), "the cut vessels bleed");
        let tree = grown_tree(app.world(), organ, VesselKind::Artery);
        let crossed = tree
            .segments()
            .find(|&(node, parent)| (tree.positions()[node].y + 0.2) * (tree.positions()[parent].y + 0.2) < 0.0);
        let severed = severed(app.world(), organ, VesselKind::Artery);
        assert_eq!(severed.first().map(|node| node.index()), crossed.map(|(node, _)| node));
    }
}

#[test]
fn picking_finds_places_of_the_new_tree() {
    let mut app = timed_app(FRAME);
    let organ = paused(&mut app, ());
    let point = Vec3::new(0.02, -0.31, 0.0);
    let pick = move |picker: VesselPicker| -> Option<VesselPlace> { picker.nearest(point, 0.2) };
    for _ in 0..Splitting::STEPS {
        let found = app.world_mut().run_system_once(pick).expect("a system").expect("the artery is near");
        assert_eq!((found.organ, found.kind), (organ, VesselKind::Artery));
        let tree = grown_tree(app.world(), organ, VesselKind::Artery);
        assert!(found.position.distance(tree.position_at(found.place)) < 1e-6);
        assert!(found.position.distance(Vec3::new(0.0, -0.31, 0.0)) < 0.01, "{found:?}");
        send(&mut app, organ, GrowthAction::Step(1));
        app.update();
    }
}

#[test]
fn replaced_vessels_follow_a_deformed_organ() {
    let mut app = timed_app(FRAME);
    let organ = paused(&mut app, FollowsMesh);
    let mesh = app.world().get::<Mesh3d>(organ).map(|mesh| mesh.id()).expect("a mesh");
    let away = Vec3::new(3.0, 0.0, -1.0);
    let moved: Vec<Vec3> = {
        let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
        let mut mesh = meshes.get_mut(mesh).expect("the mesh is there");
        mesh.translate_by(away);
        vec![away]
    };
    for _ in 0..3 {
        send(&mut app, organ, GrowthAction::Step(1));
        app.update();
        for kind in KINDS {
            let (shown, rest) = (published(app.world(), organ, kind), grown_tree(app.world(), organ, kind));
            assert_eq!(shown.tree().len(), rest.len());
            for (shown, rest) in shown.tree().positions().iter().zip(rest.positions()) {
                assert!((*shown - *rest - moved[0]).length() < 1e-4, "{shown} against {rest}");
            }
        }
    }
}

#[test]
fn a_restart_begins_with_the_first_line_again() {
    let mut app = timed_app(FRAME);
    let organ = paused(&mut app, ());
    send(&mut app, organ, GrowthAction::Finish);
    app.update();
    assert_eq!(published(app.world(), organ, VesselKind::Duct).tree().len(), 2 + Splitting::STEPS as usize);
    send(&mut app, organ, GrowthAction::Restart);
    app.update();
    app.update();
    assert_eq!(published(app.world(), organ, VesselKind::Duct).tree().len(), 2);
}
