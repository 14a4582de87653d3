//! The results for points and rays, compared with a search of all segments one by one, at any state of the index.

use super::operating_field::*;
use super::*;
use bevy::{
    ecs::system::SystemId,
    math::{DAffine3, DVec3},
};
use bevy_vessels::{
    plugin::{ChangeLog, Cuttable, VesselIndex, VesselPicker, VesselPlace, VesselWounds},
    synthesis::{
        instances::MAX_FLARE,
        random::{Stream, VesselRng},
        segment_index::SegmentIndex,
        tree::{NO_PARENT, NodeId, Place},
        wound::Blade,
    },
};
use rand::RngExt;

const FRAME: Duration = Duration::from_millis(16);

/// Queries a picker for the nearest place and for the first on a ray.
struct Questions {
    nearest: SystemId<In<(Vec3, f32)>, Option<VesselPlace>>,
    ray: SystemId<In<(Ray3d, f32)>, Option<VesselPlace>>,
}

impl Questions {
    fn new(app: &mut App) -> Self {
        let world = app.world_mut();
        Self {
            nearest: world.register_system(|In((point, reach)): In<(Vec3, f32)>, picker: VesselPicker| {
                picker.nearest(point, reach)
            }),
            ray: world
                .register_system(|In((ray, reach)): In<(Ray3d, f32)>, picker: VesselPicker| picker.ray(ray, reach)),
        }
    }

    fn nearest(&self, app: &mut App, point: Vec3, reach: f32) -> Option<VesselPlace> {
        app.world_mut().run_system_with(self.nearest, (point, reach)).expect("a picker needs no plugin")
    }

    fn ray(&self, app: &mut App, ray: Ray3d, reach: f32) -> Option<VesselPlace> {
        app.world_mut().run_system_with(self.ray, (ray, reach)).expect("a picker needs no plugin")
    }
}

fn any_point(rng: &mut VesselRng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

fn any_ray(to: Vec3, rng: &mut VesselRng) -> Ray3d {
    let from = 3.0 * any_point(rng);
    Ray3d::new(from, Dir3::new(to - from).expect("points at random are apart"))
}

/// Random branches in a cube, some thinner than their parents, some without length.
fn random_tree(nodes: usize, rng: &mut VesselRng) -> VesselTree {
    let (mut positions, mut parents, mut radii) = (Vec::<Vec3>::new(), Vec::new(), Vec::new());
    for node in 0..nodes {
        let is_root = node % 100 == 0;
        let parent = if is_root { NO_PARENT } else { rng.random_range(node - node % 100..node) as u32 };
        let step = if node % 37 == 5 { Vec3::ZERO } else { 0.15 * any_point(rng) };
        positions.push(if is_root { any_point(rng) } else { positions[parent as usize] + step });
        parents.push(parent);
        radii.push(rng.random_range(0.004..0.02));
    }
    VesselTree::from_arrays(positions, parents, radii).expect("parents come first")
}

/// A random transform, with a different scale along each axis, or mirrored.
fn any_transform(rng: &mut VesselRng) -> Transform {
    let turn = Quat::from_scaled_axis(2.0 * any_point(rng));
    let scale = Vec3::from_array(std::array::from_fn(|_| rng.random_range(0.6..1.6)));
    let mirrored = if rng.random() { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
    Transform { translation: 0.5 * any_point(rng), rotation: turn, scale: scale * mirrored }
}

/// A vessel entity for the search of all segments.
struct Twin {
    entity: Entity,
    tree: VesselTree,
    to_world: DAffine3,
    /// The remaining parts of each segment.
    pieces: Vec<Vec<[f64; 2]>>,
}

/// All vessel entities, in rising order.
fn twins(app: &mut App) -> Vec<Twin> {
    app.update();
    let world = app.world_mut();
    let mut query = world.query::<(Entity, &Vessels, &GlobalTransform, Option<&VesselWounds>)>();
    let twin = |(entity, vessels, place, wounds): (Entity, &Vessels, &GlobalTransform, Option<&VesselWounds>)| {
        let left = |node: usize| match wounds.filter(|wounds| wounds.is_severed(NodeId(node as u32))) {
            None => vec![[0.0, 1.0]],
            Some(wounds) => wounds.pieces(NodeId(node as u32)).map(|left| [left.from.into(), left.to.into()]).collect(),
        };
        let pieces = (0..vessels.tree().len()).map(left).collect();
        let to_world = place.affine();
        let to_world = DAffine3 { matrix3: to_world.matrix3.as_dmat3(), translation: to_world.translation.as_dvec3() };
        Twin { entity, tree: vessels.tree().clone(), to_world, pieces }
    };
    let mut twins: Vec<Twin> = query.iter(world).map(twin).collect();
    twins.sort_by_key(|twin| twin.entity);
    twins
}

impl Twin {
    /// World position of a random node.
    fn any_node(&self, rng: &mut VesselRng) -> Vec3 {
        let node = rng.random_range(0..self.tree.len());
        self.to_world.transform_point3(self.tree.positions()[node].as_dvec3()).as_vec3()
    }

    /// Nodes with their parents, and the remaining parts of their segments.
    fn segments(&self) -> impl Iterator<Item = (usize, usize, &[f64; 2])> {
        self.tree.segments().flat_map(|(node, parent)| self.pieces[node].iter().map(move |piece| (node, parent, piece)))
    }

    /// Distance to the nearest wall.
    fn nearest(&self, point: Vec3) -> f64 {
        let (point, scale) = (point.as_dvec3(), self.to_world.matrix3.determinant().abs().cbrt());
        let distance = |(node, parent, &[from, to]): (usize, usize, &[f64; 2])| {
            let at = |node: usize| self.to_world.transform_point3(self.tree.positions()[node].as_dvec3());
            let (a, b) = (at(parent), at(node));
            let share = (point - a).dot(b - a) / (b - a).length_squared();
            let share = if share.is_nan() { from } else { share.clamp(from, to) };
            a.lerp(b, share).distance(point) - scale * f64::from(self.tree.radii()[node])
        };
        self.segments().map(distance).fold(f64::INFINITY, f64::min)
    }

    /// Distance along a ray to the first wall, with all walls shrunk by a length: found in steps that enter none of
    /// them.
    fn first(&self, ray: Ray3d, reach: f64, shrunk: f64) -> f64 {
        let to_local = self.to_world.inverse();
        let from = to_local.transform_point3(ray.origin.as_dvec3());
        let direction = to_local.transform_vector3(ray.direction.as_dvec3());
        let (stretch, unit) = (direction.length(), direction.normalize());
        let first = |(node, parent, piece): (usize, usize, &[f64; 2])| {
            let mut along = 0.0;
            for _ in 0..300 {
                let room = self.outside(from + along * unit, [parent, node], *piece) + shrunk;
                if room < 0.0 {
                    return along / stretch;
                }
                along += room.max(1e-7);
                if along > reach * stretch {
                    break;
                }
            }
            f64::INFINITY
        };
        self.segments().map(first).fold(f64::INFINITY, f64::min)
    }

    /// Lower bound of a point's distance to a remaining part of a segment, in the vessels' space.
    fn outside(&self, point: DVec3, [parent, node]: [usize; 2], [from, to]: [f64; 2]) -> f64 {
        let [a, b] = [parent, node].map(|node| self.tree.positions()[node].as_dvec3());
        let radius = self.tree.radii()[node];
        let start_radius = self.tree.radii()[parent].min(MAX_FLARE * radius);
        let ball = |share: f64| {
            let radius = f64::from(start_radius) + share * f64::from(radius - start_radius);
            a.lerp(b, share).distance(point) - radius
        };
        // The least over all balls, whose distances are a convex function of the share.
        let (mut low, mut high) = (from, to);
        for _ in 0..50 {
            let (first, second) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if ball(first) < ball(second) { high = second } else { low = first }
        }
        let axis = (b - a).normalize_or_zero();
        let before = if from > 0.0 { axis.dot(a.lerp(b, from) - point) } else { f64::NEG_INFINITY };
        let behind = if to < 1.0 { axis.dot(point - a.lerp(b, to)) } else { f64::NEG_INFINITY };
        ball(low).max(before).max(behind)
    }

    /// Asserts that a place is on a remaining part of these vessels.
    fn check(&self, found: &VesselPlace, world: &World, what: &str) {
        let (node, along) = (found.place.node.index(), f64::from(found.place.along));
        let left = &self.pieces[node];
        assert!(
            left.iter().any(|&[from, to]| (from - 1e-6..=to + 1e-6).contains(&along)),
            "{what}: {found:?} of {left:?}"
        );
        let position = self.to_world.transform_point3(self.tree.position_at(found.place).as_dvec3());
        assert!(position.distance(found.position.as_dvec3()) < 1e-4, "{what}: {found:?} is at {position}");
        let vessels = world.get::<Vessels>(found.vessels).expect("a vessel entity has vessels");
        assert_eq!((found.kind, Some(found.organ)), (vessels.kind(), organ_of_vessels(world, found.vessels)), "{what}");
    }
}

fn organ_of_vessels(world: &World, vessels: Entity) -> Option<Entity> {
    world.get::<ChildOf>(vessels).map(ChildOf::parent)
}

/// Queries random points and rays. Returns how many of each found something.
fn check_questions(app: &mut App, questions: &Questions, rng: &mut VesselRng, count: usize, what: &str) -> [usize; 2] {
    const ROOM: f64 = 1e-4;
    let twins = twins(app);
    let of = |found: &VesselPlace| twins.iter().find(|twin| twin.entity == found.vessels).expect("a twin of each");
    let mut found = [0; 2];
    for question in 0..count {
        let near = twins[rng.random_range(0..twins.len())].any_node(rng) + 0.05 * any_point(rng);
        let (point, reach) = (near, rng.random_range(0.0..0.1));
        let what = format!("{what}, question {question}");
        let nearest = twins.iter().map(|twin| twin.nearest(point)).fold(f64::INFINITY, f64::min);
        match questions.nearest(app, point, reach) {
            Some(place) => {
                of(&place).check(&place, app.world(), &what);
                assert!((f64::from(place.distance) - nearest).abs() < ROOM, "{what}: {place:?}, not {nearest}");
                found[0] += 1;
            }
            None => assert!(nearest > f64::from(reach) - ROOM, "{what}: nothing, not {nearest} within {reach}"),
        }
        let (ray, reach) = (any_ray(near, rng), rng.random_range(0.0..8.0));
        // The nearest possible hit, and the nearest certain one.
        let [may, must] = [-1e-5, 1e-5]
            .map(|shrunk| twins.iter().map(|twin| twin.first(ray, reach.into(), shrunk)).fold(f64::INFINITY, f64::min));
        match questions.ray(app, ray, reach) {
            Some(place) => {
                of(&place).check(&place, app.world(), &what);
                let distance = f64::from(place.distance);
                assert!((may - ROOM..=must + ROOM).contains(&distance), "{what}: {place:?}, not {may} to {must}");
                found[1] += 1;
            }
            None => assert!(must > f64::from(reach) - ROOM, "{what}: nothing, not {must} within {reach}"),
        }
    }
    found
}

#[test]
fn all_organs_are_searched_cuttable_or_not() {
    let mut found = [0; 2];
    for seed in 0..2 {
        let mut rng = Stream::Statistics.rng(seed);
        let mut app = timed_app(FRAME);
        let questions = Questions::new(&mut app);
        let [artery, vein, other] = [300, 200, 250].map(|nodes| random_tree(nodes, &mut rng));
        let whole = organ_of(&mut app, &[(VesselKind::Artery, &artery), (VesselKind::Vein, &vein)], ());
        let cut_up = organ_of(&mut app, &[(VesselKind::PortalVein, &other)], Cuttable::default());
        for organ in [whole, cut_up] {
            app.world_mut().entity_mut(organ).insert(any_transform(&mut rng));
        }
        let before = check_questions(&mut app, &questions, &mut rng, 50, &format!("seed {seed}, whole"));
        for _ in 0..8 {
            let ball = Blade::ball(any_point(&mut rng), 0.3).expect("a ball");
            let plane = square(any_point(&mut rng), any_point(&mut rng), 4.0);
            operate(&mut app, |vessels| [ball, plane].into_iter().for_each(|blade| vessels.cut(blade)));
        }
        let severed = wounds(app.world(), cut_up, VesselKind::PortalVein).severed_segments().count();
        assert!(severed > 20, "{severed} of 250 are severed");
        let after = check_questions(&mut app, &questions, &mut rng, 50, &format!("seed {seed}, cut up"));
        for organ in [whole, cut_up] {
            app.world_mut().entity_mut(organ).insert(any_transform(&mut rng));
        }
        let moved = check_questions(&mut app, &questions, &mut rng, 50, &format!("seed {seed}, moved"));
        for counts in [before, after, moved] {
            found = [found[0] + counts[0], found[1] + counts[1]];
        }
    }
    assert!(found.iter().all(|count| (80..290).contains(count)), "{found:?} of 300 are too few or too many to tell");
}

#[test]
fn answers_are_complete_while_vessels_move_and_a_large_index_is_under_way() {
    let mut rng = Stream::Statistics.rng(9);
    let mut app = timed_app(FRAME);
    let questions = Questions::new(&mut app);
    let mut tree = random_tree(30_000, &mut rng);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], ());
    let entity = vessel_entity(app.world(), organ, VesselKind::Artery).expect("the organ has an artery");
    (0..5).for_each(|_| app.update());
    assert_eq!(indexed(&app, entity), 0, "nobody has asked");
    let mut frames_under_way = 0;
    let start = Instant::now();
    loop {
        let moved = rng.random_range(0..tree.len());
        let step = 0.1 * any_point(&mut rng);
        tree = edited(&tree, |positions, _, radii| {
            positions[moved] += step;
            radii[moved] *= 1.5;
        });
        update(&mut app, entity, &tree);
        for _ in 0..3 {
            let aim = tree.positions()[rng.random_range(0..tree.len())] + 0.02 * any_point(&mut rng);
            let ray = any_ray(aim, &mut rng);
            let expected = SegmentIndex::new(&tree).first_hit(&tree, ray.origin, *ray.direction, 10.0);
            let found = questions.ray(&mut app, ray, 10.0);
            let (place, distance) = expected.unzip();
            assert_eq!(found.map(|found| found.place), place, "{} indexed", indexed(&app, entity));
            assert!(found.map(|found| (found.distance - distance.unwrap()).abs()).unwrap_or(0.0) < 1e-6);
            let found = questions.nearest(&mut app, aim, 0.05).map(|found| found.place);
            assert_eq!(found, nearest_of(&tree, aim, 0.05), "{} indexed", indexed(&app, entity));
        }
        if indexed(&app, entity) == tree.len() {
            break;
        }
        frames_under_way += 1;
        assert!(start.elapsed() < Duration::from_secs(60), "the index never comes");
        app.update();
    }
    assert!(frames_under_way > 0, "the index of a large tree is not made at once");
}

/// The first of the nearest places, in the picker's arithmetic.
fn nearest_of(tree: &VesselTree, point: Vec3, reach: f32) -> Option<Place> {
    let places = tree.segments().map(|(node, parent)| {
        let [a, b] = [parent, node].map(|node| tree.positions()[node]);
        let share = (point - a).dot(b - a) / (b - a).length_squared();
        let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        (a.lerp(b, share).distance(point) - tree.radii()[node], node, share)
    });
    let nearest =
        places.filter(|&(distance, ..)| distance <= reach).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    nearest.map(|(_, node, share)| Place::new(NodeId(node as u32), share))
}

fn update(app: &mut App, vessels: Entity, tree: &VesselTree) {
    let mut query = app.world_mut().query::<(&mut Vessels, &mut ChangeLog)>();
    let (mut vessels, mut log) = query.get_mut(app.world_mut(), vessels).expect("the vessels have a log");
    vessels.update_from_tree(tree, &[], &mut log);
}

fn indexed(app: &App, vessels: Entity) -> usize {
    app.world().get::<VesselIndex>(vessels).expect("all vessels have an index").indexed()
}

#[test]
fn vessels_out_of_reach_are_not_indexed() {
    let mut app = timed_app(FRAME);
    let questions = Questions::new(&mut app);
    let tree = tube(1.0, 0.01, 10);
    let [near, far] = [0.0, 10.0].map(|x| {
        let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], ());
        app.world_mut().entity_mut(organ).insert(Transform::from_xyz(x, 0.0, 0.0));
        vessel_entity(app.world(), organ, VesselKind::Artery).expect("the organ has an artery")
    });
    let found = questions.nearest(&mut app, Vec3::new(0.55, 0.02, 0.0), 0.1).expect("the wall is near");
    assert_eq!((found.vessels, found.place.node), (near, NodeId(6)));
    let down = Ray3d::new(Vec3::new(0.25, 1.0, 0.0), Dir3::NEG_Y);
    let found = questions.ray(&mut app, down, f32::INFINITY).expect("the vessel is in the way");
    assert_eq!((found.vessels, found.place.node), (near, NodeId(3)));
    assert!((found.distance - 0.99).abs() < 1e-5, "{found:?}");
    assert_eq!([near, far].map(|vessels| indexed(&app, vessels)), [11, 0]);
    for bad in [f32::NAN, -1.0] {
        assert_eq!(questions.ray(&mut app, down, bad), None);
    }
    assert_eq!(questions.nearest(&mut app, Vec3::NAN, 1.0), None);
}

#[test]
fn light_passes_through_a_gap() {
    let mut app = timed_app(FRAME);
    let questions = Questions::new(&mut app);
    let tree = tube(10.0, 0.5, 1);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default());
    let down = |x: f32| Ray3d::new(Vec3::new(x, 5.0, 0.0), Dir3::NEG_Y);
    let found = questions.ray(&mut app, down(5.0), 10.0).expect("the vessel is whole");
    assert!((found.distance - 4.5).abs() < 1e-5 && (found.place.along - 0.5).abs() < 1e-5, "{found:?}");
    let ball = Blade::ball(Vec3::X * 5.0, 1.0).expect("a ball");
    cut(&mut app, ball);
    assert_eq!(questions.ray(&mut app, down(5.0), 10.0), None);
    let pieces: Vec<_> = wounds(app.world(), organ, VesselKind::Artery).pieces(NodeId(1)).collect();
    let [before, after] = pieces[..] else { panic!("two pieces, not {pieces:?}") };
    // Along the axis, out of the gap: each face is hit at the end of its piece.
    for (direction, along) in [(Dir3::X, after.from), (Dir3::NEG_X, before.to)] {
        let found = questions.ray(&mut app, Ray3d::new(Vec3::X * 5.0, direction), 10.0).expect("a face");
        assert!((found.place.along - along).abs() < 1e-6, "{found:?} at {along}");
        assert!((found.distance - (10.0 * along - 5.0).abs()).abs() < 1e-5, "{found:?} at {along}");
    }
    let inside = questions.ray(&mut app, Ray3d::new(Vec3::X * 9.0, Dir3::Y), 10.0).expect("within a vessel");
    assert_eq!(inside.distance, 0.0);
}
