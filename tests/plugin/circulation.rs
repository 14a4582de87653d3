//! Blood flows in organs of a Bevy world, and is lost.

use super::operating_field::*;
use super::*;
use bevy_vessels::{
    plugin::{
        BleedingStarted, BleedingStopped, BloodLoss, CirculationFailed, CirculationState, Cuttable, CuttableVessels,
        GrowthStarted, OpenEnd, OrganSupply, Patient, Perfusion, SegmentSupply,
    },
    synthesis::{
        haemodynamics::{
            BedSettings, BleedingSettings, BloodVolumeSettings, EndState, FlowSettings, Pulse, RootPressure,
            ViscosityLaw,
        },
        preset::OrganBlood,
        tree::{NodeId, Place},
        units::{BLOOD_DENSITY, Flow, Pressure, Resistance, Scale, Viscosity, Volume},
        wound::{EndSide, Retraction},
    },
};

const FRAME: Duration = Duration::from_millis(16);

/// Ends that neither retract nor clot, in blood of constant viscosity.
fn plain() -> (Cuttable, Perfusion) {
    let perfusion = Perfusion {
        viscosity: ViscosityLaw::Constant(Viscosity::from_centipoise(3.5)),
        bleeding: BleedingSettings { clotting: None, ..BleedingSettings::default() },
        ..blood()
    };
    (Cuttable { retraction: Retraction { radii: 0.0, length: 0.0 }, ..default() }, perfusion)
}

fn loss(world: &World, organ: Entity) -> BloodLoss {
    *world.get::<BloodLoss>(organ).expect("an organ with blood has a loss")
}

fn artery(app: &App, organ: Entity) -> Entity {
    vessel_entity(app.world(), organ, VesselKind::Artery).expect("there are arteries")
}

/// Poiseuille's law and that of the orifice in series: Δp = R·Q + K·Q².
#[test]
fn a_cut_tube_bleeds_what_physics_says_on_the_entity_of_its_end() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(40.0, 0.5, 4))], plain());
    app.update();
    cut(&mut app, square(Vec3::X * 25.0, Vec3::X, 2.0));
    let ends = open_ends(&mut app);
    let proximal = ends.iter().find(|end| end.side == EndSide::Proximal).expect("the end towards the root");
    let (length, radius): (f64, f64) = (25e-3, 0.5e-3);
    let area = std::f64::consts::PI * radius * radius;
    let resistance = 8.0 * 3.5e-3 * length / (area * radius * radius);
    let passing = f64::from(FlowSettings::DEFAULT_DISCHARGE_COEFFICIENT) * area;
    let orifice = BLOOD_DENSITY / (2.0 * passing * passing);
    let pressure = Pressure::from_mmhg(FlowSettings::DEFAULT_ARTERIAL_PRESSURE).pascals();
    let expected = (-resistance + (resistance * resistance + 4.0 * orifice * pressure).sqrt()) / (2.0 * orifice);
    let flow = proximal.flow.cubic_metres_per_second();
    assert!((flow / expected - 1.0).abs() < 1e-6, "{flow:e} against {expected:e}");
    assert!((proximal.velocity * area / flow - 1.0).abs() < 1e-9);
    assert!((proximal.pressure.pascals() - orifice * flow * flow).abs() < 1e-3);
    assert_eq!(proximal.state, EndState::Bleeding);
    let loss = loss(app.world(), organ);
    let sum: f64 = ends.iter().map(|end| end.flow.cubic_metres_per_second()).sum();
    assert!((loss.rate.cubic_metres_per_second() / sum - 1.0).abs() < 1e-9);
    assert!((loss.total.cubic_metres() / (sum * FRAME.as_secs_f64()) - 1.0).abs() < 1e-9);
    assert_eq!(loss.bleeding_ends, 2, "the bed drives the far end");
}

#[test]
fn nothing_bleeds_behind_a_clamp_and_messages_say_so() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &fork(0.5))], plain());
    app.update();
    let (mut started, mut stopped) = (MessageCursor::default(), MessageCursor::default());
    cut(&mut app, square(Vec3::new(1.0, 0.5, 0.0), Vec3::Y, 0.5));
    let begun: Vec<BleedingStarted> = drain(app.world(), &mut started);
    assert_eq!(begun.len(), 2);
    for start in &begun {
        let end = app.world().get::<OpenEnd>(start.entity).expect("the end is an entity");
        assert_eq!((end.id, end.side, end.state), (start.end, start.side, EndState::Bleeding));
    }
    // On the stem: the proximal end is cut off from the root, and fed only by the other branch's bed.
    let stem = artery(&app, organ);
    operate(&mut app, |vessels| vessels.clamp_at(stem, Place::new(NodeId(1), 0.5)));
    operate(&mut app, |vessels| vessels.clamp_at(stem, Place::new(NodeId(3), 0.5)));
    let ends = open_ends(&mut app);
    let proximal = ends.iter().find(|end| end.side == EndSide::Proximal).unwrap();
    assert_eq!((proximal.state, proximal.flow.ml_per_min()), (EndState::Dry, 0.0));
    let ended: Vec<BleedingStopped> = drain(app.world(), &mut stopped);
    let proximal_start = begun.iter().find(|start| start.side == EndSide::Proximal).unwrap();
    assert!(matches!(ended[..], [stop] if stop.end == proximal.id && stop.entity == Some(proximal_start.entity)));
    // On the far piece: its end is closed, and its entity despawned.
    operate(&mut app, |vessels| vessels.clamp_at(stem, Place::new(NodeId(2), 0.9)));
    let ended: Vec<BleedingStopped> = drain(app.world(), &mut stopped);
    assert!(matches!(ended[..], [stop] if stop.side == EndSide::Distal && stop.entity.is_none()));
    assert_eq!((loss(app.world(), organ).rate.ml_per_min(), loss(app.world(), organ).bleeding_ends), (0.0, 0));
    let total = loss(app.world(), organ).total;
    (0..5).for_each(|_| app.update());
    assert_eq!(loss(app.world(), organ).total, total);
    operate(&mut app, CuttableVessels::undo_all);
    assert_eq!(loss(app.world(), organ).total, total, "what was lost stays lost");
    assert!(drain::<BleedingStarted>(app.world(), &mut started).is_empty());
}

#[test]
fn the_loss_hardly_depends_on_the_frame_rate() {
    let losses = [30, 60, 240].map(|rate| {
        let mut app = timed_app(Duration::from_secs_f64(1.0 / f64::from(rate)));
        let pulse = RootPressure::Pulsatile(Pulse::default());
        let organ = grown(&mut app, Perfusion { arterial_pressure: pulse, scale: Some(Scale::CENTIMETRES), ..blood() });
        app.update();
        cut(&mut app, square(Vec3::Y * 0.2, Vec3::Y, 3.0));
        (1..5 * rate).for_each(|_| app.update());
        loss(app.world(), organ).total.ml()
    });
    assert!(losses[0] > 0.0);
    for loss in losses {
        assert!((loss / losses[2] - 1.0).abs() < 0.01, "{losses:?}");
    }
}

#[test]
fn the_same_frames_lose_the_same_to_the_last_bit() {
    let run = || {
        let mut app = timed_app(FRAME);
        let organs = [(); 2].map(|()| grown(&mut app, blood()));
        cut(&mut app, square(Vec3::Y * 0.2, Vec3::Y, 3.0));
        (0..20).for_each(|_| app.update());
        (organs.map(|organ| loss(app.world(), organ)), open_ends(&mut app).len())
    };
    assert_eq!(run(), run());
}

#[test]
fn organs_below_a_patient_share_the_blood() {
    let mut app = timed_app(Duration::from_millis(200));
    let settings = BloodVolumeSettings { total: Volume::from_ml(20.0), ..BloodVolumeSettings::default() };
    let patient = app.world_mut().spawn((Transform::default(), Patient::new(settings).unwrap())).id();
    let organs = [(); 2].map(|()| {
        let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(40.0, 0.5, 4))], plain());
        app.world_mut().entity_mut(organ).insert(ChildOf(patient)).remove::<Patient>();
        organ
    });
    let alone = organ_of(&mut app, &[(VesselKind::Artery, &tube(40.0, 0.5, 4))], plain());
    app.update();
    cut(&mut app, square(Vec3::X * 25.0, Vec3::X, 2.0));
    let first = loss(app.world(), alone).rate.ml_per_min();
    (0..100).for_each(|_| app.update());
    let lost = app.world().get::<Patient>(patient).unwrap().blood().lost().ml();
    let sum: f64 = organs.iter().map(|&organ| loss(app.world(), organ).total.ml()).sum();
    assert!((lost / sum - 1.0).abs() < 1e-9, "{lost} of {sum} mL");
    assert!(lost > 0.4 * 20.0 && lost < 0.46 * 20.0, "{lost} mL: no pressure is left");
    assert!(loss(app.world(), organs[0]).rate.ml_per_min() < 0.2 * first);
    let patient = app.world().get::<Patient>(alone).expect("an organ without a patient gets one");
    assert!((patient.blood().lost().ml() / loss(app.world(), alone).total.ml() - 1.0).abs() < 1e-9);
    assert!(loss(app.world(), alone).rate.ml_per_min() > 0.99 * first);
}

#[test]
fn time_stands_still_while_paused() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(40.0, 0.5, 4))], plain());
    app.update();
    cut(&mut app, square(Vec3::X * 25.0, Vec3::X, 2.0));
    let before = loss(app.world(), organ).total;
    app.world_mut().get_mut::<Perfusion>(organ).unwrap().paused = true;
    (0..3).for_each(|_| app.update());
    assert_eq!(loss(app.world(), organ).total, before);
    app.world_mut().get_mut::<Perfusion>(organ).unwrap().paused = false;
    app.update();
    let rate = loss(app.world(), organ).rate.cubic_metres_per_second();
    let passed = loss(app.world(), organ).total.cubic_metres() - before.cubic_metres();
    assert!((passed / (rate * FRAME.as_secs_f64()) - 1.0).abs() < 1e-9);
}

#[test]
fn tissue_below_a_cut_lacks_blood_until_it_is_undone() {
    let mut app = timed_app(FRAME);
    let organ = grown(&mut app, blood());
    let supply = |app: &App| app.world().get::<OrganSupply>(organ).expect("an organ with blood has a supply").clone();
    run_until(&mut app, "a supply", |world| !world.get::<OrganSupply>(organ).unwrap().vertices.is_empty());
    let intact = supply(&app);
    assert_eq!(intact.ischaemic_share, 0.0);
    assert!(intact.vertices.iter().all(|&supply| supply == 1.0));
    let vertices = app.world().get::<Mesh3d>(organ).map(|mesh| mesh.id()).unwrap();
    let vertices = app.world().resource::<Assets<Mesh>>().get(vertices).unwrap().count_vertices();
    assert_eq!(intact.vertices.len(), vertices);

    let entity = artery(&app, organ);
    clamp_roots(&mut app, organ, VesselKind::Artery);
    run_until(&mut app, "no supply", |world| world.get::<OrganSupply>(organ).unwrap().ischaemic_share == 1.0);
    assert!(supply(&app).vertices.iter().all(|&supply| supply < 1e-3));
    let segments = |app: &App| app.world().get::<SegmentSupply>(entity).unwrap().segments.clone();
    assert!(segments(&app).iter().all(|&supply| supply < 1e-3));
    operate(&mut app, CuttableVessels::undo_all);
    run_until(&mut app, "all of the supply", |world| world.get::<OrganSupply>(organ).unwrap().ischaemic_share == 0.0);
    assert!(supply(&app).vertices.iter().chain(&segments(&app)).all(|&supply| (supply - 1.0).abs() < 1e-5));
}

/// Joined through the bed, veins lose supply when no artery brings blood; apart, they still have the pool's pressure.
#[test]
fn a_bed_with_resistance_joins_arteries_and_veins() {
    let venous_supply = |bed: BedSettings| {
        let mut app = timed_app(FRAME);
        let organ = grown(&mut app, Perfusion { bed: Some(bed), ..blood() });
        let veins = vessel_entity(app.world(), organ, VesselKind::Vein).unwrap();
        let supply = |world: &World| world.get::<SegmentSupply>(veins).unwrap().segments.first().copied();
        run_until(&mut app, "a supply", |world| supply(world) == Some(1.0));
        clamp_roots(&mut app, organ, VesselKind::Artery);
        (0..3).for_each(|_| app.update());
        supply(app.world()).unwrap()
    };
    let resistance = Some(Resistance::from_mmhg_min_per_ml(2e6));
    let (apart, joined) =
        (venous_supply(BedSettings::default()), venous_supply(BedSettings { resistance, ..default() }));
    assert!(apart > 0.99, "apart: {apart}");
    assert!(joined < 0.9, "joined: {joined}");
}

#[test]
fn a_regrowth_has_lost_nothing() {
    let mut app = timed_app(FRAME);
    let organ = grown(&mut app, blood());
    cut(&mut app, square(Vec3::Y * 0.2, Vec3::Y, 3.0));
    let (bleeding, mut stopped) = (loss(app.world(), organ).bleeding_ends, MessageCursor::default());
    assert!(bleeding > 0 && loss(app.world(), organ).total.ml() > 0.0);
    app.insert_resource(GrowthBudget::Steps(1));
    app.world_mut().get_mut::<Vasculature>(organ).unwrap().seed = 5;
    app.update();
    let mut ended = drain::<BleedingStopped>(app.world(), &mut stopped).len();
    app.update();
    ended += drain::<BleedingStopped>(app.world(), &mut stopped).len();
    assert_eq!(loss(app.world(), organ), BloodLoss::default());
    assert_eq!(app.world().get::<OrganSupply>(organ), Some(&OrganSupply::default()));
    assert!(app.world().get::<SegmentSupply>(artery(&app, organ)).is_some_and(|supply| supply.segments.is_empty()));
    assert_eq!(ended, bleeding);
}

#[test]
fn settings_that_cannot_be_are_named_and_can_be_mended() {
    let mut app = timed_app(FRAME);
    let wrong = Perfusion { discharge_coefficient: 1.5, ..plain().1 };
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(40.0, 0.5, 4))], (plain().0, wrong));
    let (mut failed, mut failures) = (MessageCursor::default(), Vec::<CirculationFailed>::new());
    for _ in 0..3 {
        failures.extend(drain(app.world(), &mut failed));
        app.update();
    }
    assert!(matches!(&failures[..], [failure] if failure.organ == organ && failure.error.to_string().contains("1.5")));
    assert!(app.world().get::<CirculationState>(organ).is_some_and(|state| state.error().is_some() && !state.flows()));
    cut(&mut app, square(Vec3::X * 25.0, Vec3::X, 2.0));
    assert_eq!(loss(app.world(), organ).total, Volume::ZERO);
    app.world_mut().get_mut::<Perfusion>(organ).unwrap().discharge_coefficient = 0.29;
    run_until(&mut app, "blood", |world| loss(world, organ).bleeding_ends == 2);
}

#[test]
fn ends_are_dry_while_the_blood_cannot_flow() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(40.0, 0.5, 4))], plain());
    cut(&mut app, square(Vec3::X * 25.0, Vec3::X, 2.0));
    for _ in 0..2 {
        run_until(&mut app, "blood", |world| loss(world, organ).bleeding_ends == 2);
        assert!(open_ends(&mut app).iter().all(|end| end.state == EndState::Bleeding && end.flow.ml_per_min() > 0.0));
        let good = app.world().get::<Perfusion>(organ).unwrap().clone();
        app.world_mut().get_mut::<Perfusion>(organ).unwrap().discharge_coefficient = 1.5;
        run_until(&mut app, "a failure", |world| {
            world.get::<CirculationState>(organ).is_some_and(|state| state.error().is_some())
        });
        app.update();
        assert!(open_ends(&mut app).iter().all(|end| end.state == EndState::Dry && end.flow.ml_per_min() == 0.0));
        *app.world_mut().get_mut::<Perfusion>(organ).unwrap() = good;
    }
}

#[test]
fn an_organ_without_perfusion_does_not_bleed_any_more() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(40.0, 0.5, 4))], plain());
    app.update();
    cut(&mut app, square(Vec3::X * 25.0, Vec3::X, 2.0));
    run_until(&mut app, "blood", |world| loss(world, organ).bleeding_ends == 2);
    let mut stopped = MessageCursor::default();
    drain::<BleedingStopped>(app.world(), &mut stopped);
    app.world_mut().entity_mut(organ).remove::<Perfusion>();
    assert_eq!(drain::<BleedingStopped>(app.world(), &mut stopped).len(), 2);
    app.update();
    assert!(app.world().get::<BloodLoss>(organ).is_none());
    let ends = open_ends(&mut app);
    assert_eq!(ends.len(), 2, "they are still open");
    assert!(ends.iter().all(|end| end.state == EndState::Dry && end.flow.ml_per_min() == 0.0));
}

#[test]
fn whatever_despawns_vessels_they_are_said_to_bleed_no_longer() {
    for is_organ in [false, true] {
        let mut app = timed_app(FRAME);
        let tree = tube(40.0, 0.5, 4);
        let both = [(VesselKind::Artery, &tree), (VesselKind::Vein, &tree)];
        let organ = organ_of(&mut app, &both, plain());
        app.update();
        cut(&mut app, square(Vec3::X * 25.0, Vec3::X, 2.0));
        run_until(&mut app, "blood", |world| loss(world, organ).bleeding_ends == 4);
        let arteries = artery(&app, organ);
        let mut stopped = MessageCursor::default();
        drain::<BleedingStopped>(app.world(), &mut stopped);
        app.world_mut().despawn(if is_organ { organ } else { arteries });
        let mut told = drain::<BleedingStopped>(app.world(), &mut stopped);
        app.update();
        told.extend(drain::<BleedingStopped>(app.world(), &mut stopped));
        let stopped = told;
        let of_arteries = stopped.iter().filter(|message| message.vessels == arteries).count();
        assert_eq!(of_arteries, 2, "{stopped:?}");
        assert!(stopped.iter().all(|message| message.organ == organ));
        assert!(!is_organ || stopped.len() == 4, "{stopped:?}");
        run_until(&mut app, "the veins bleed on", |world| is_organ || loss(world, organ).bleeding_ends == 2);
    }
}

#[test]
fn a_preset_that_knows_its_blood_gives_scale_and_bed_unless_they_are_given() {
    let own = Scale::METRES;
    let bare = Some(FlowSettings::arterial().bed);
    let wishes = [
        Perfusion::default(),
        Perfusion { scale: Some(own), ..default() },
        Perfusion { bed: bare, ..default() },
        Perfusion { scale: Some(own), bed: bare, ..default() },
    ];
    let preset = PresetName::Retina.load();
    let known = preset.blood.expect("the preset knows its blood");
    assert_eq!(Vasculature::from_preset(preset).blood, Some(known));
    // The few vessels of these tests let through little.
    let known = OrganBlood { flow: Flow::from_ml_per_min(1e-7), ..known };
    let results = wishes.map(|perfusion| {
        let mut app = timed_app(FRAME);
        let organ = spawn(&mut app, Vasculature { blood: Some(known), ..quick() });
        app.world_mut().entity_mut(organ).insert(perfusion);
        run_until(&mut app, "a supply", |world| !world.get::<OrganSupply>(organ).unwrap().vertices.is_empty());
        cut(&mut app, square(0.2 * Vec3::Y, Vec3::Y, 3.0));
        run_until(&mut app, "a loss", |world| loss(world, organ).bleeding_ends > 0);
        let extent = app.world().get::<GrowthState>(organ).and_then(GrowthState::tissue).expect("a tissue").extent();
        let scale = app.world().get::<CirculationState>(organ).and_then(CirculationState::scale).expect("a scale");
        let fitting = known.scale(extent).expect("a scale");
        let distal = open_ends(&mut app).into_iter().filter(|end| end.side == EndSide::Distal);
        (scale == fitting, scale == own, distal.map(|end| end.flow.ml_per_min()).sum::<f64>())
    });
    let [both, bed_alone, scale_alone, none] = results;
    assert_eq!([both, bed_alone, scale_alone, none].map(|(fits, ..)| fits), [true, false, true, false]);
    assert_eq!([both, bed_alone, scale_alone, none].map(|(_, own, _)| own), [false, true, false, true]);
    // From the far ends flows what comes back through the bed: without a resistance, far more.
    assert!(both.2 < 0.5 * scale_alone.2, "{} of {} mL/min", both.2, scale_alone.2);
    assert!(bed_alone.2 < 0.5 * none.2, "{} of {} mL/min", bed_alone.2, none.2);
}

#[test]
fn other_blood_makes_no_other_vessels() {
    let mut app = timed_app(FRAME);
    let organ = grown(&mut app, Perfusion::default());
    let scale = |app: &App| app.world().get::<CirculationState>(organ).and_then(CirculationState::scale);
    assert_eq!(scale(&app), Some(Perfusion::DEFAULT_SCALE));
    let mut started = MessageCursor::default();
    drain::<GrowthStarted>(app.world(), &mut started);
    app.world_mut().get_mut::<Vasculature>(organ).unwrap().blood = PresetName::Retina.load().blood;
    (0..2).for_each(|_| app.update());
    assert_eq!(drain::<GrowthStarted>(app.world(), &mut started), []);
    assert_ne!(scale(&app), Some(Perfusion::DEFAULT_SCALE), "it is followed at once");
}

#[test]
fn a_large_organ_bleeds_once_its_network_is_made() {
    let mut app = timed_app(FRAME);
    let tree = tube(400.0, 0.5, 20_000);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], plain());
    cut(&mut app, square(Vec3::X * 25.005, Vec3::X, 2.0));
    run_until(&mut app, "blood", |world| loss(world, organ).bleeding_ends == 2);
    let entity = artery(&app, organ);
    run_until(&mut app, "a supply", |world| {
        world.get::<SegmentSupply>(entity).is_some_and(|supply| supply.segments.last().is_some_and(|&last| last < 0.5))
    });
}
