//! Bleeding over time against published figures and laws for any wound.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{
        BedSettings, Bleeding, BleedingSettings, BloodVolume, BloodVolumeSettings, Circulation, EndSide, EndState,
        FlowSettings, Interruption, Network, Outlet, Pulse, RootPressure, ViscosityLaw,
    },
    tree::{BedLink, NO_PARENT, NodeId, VesselTree},
    units::{Flow, Pressure, Resistance, Viscosity, Volume},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// A straight vessel along x, in millimetres.
fn tube(segments: usize, length: f32, radius: f32) -> VesselTree {
    let step = length / segments as f32;
    let positions = (0..=segments).map(|i| Vec3::X * (step * i as f32)).collect();
    let parents = (0..=segments as u32).map(|i| i.checked_sub(1).unwrap_or(NO_PARENT)).collect();
    VesselTree::from_arrays(positions, parents, vec![radius; segments + 1]).expect("a well-formed tree")
}

/// A tree of vessels of 2 mm to 0.1 mm in which each node's parent is any earlier one.
fn tree(seed: u64, nodes: usize) -> VesselTree {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let positions = (0..nodes).map(|_| Vec3::from(std::array::from_fn(|_| rng.random_range(-9.0..9.0_f32)))).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 1000);
    let parents = (0..nodes as u32).map(|i| if i == 0 { NO_PARENT } else { rng.random_range(i / 3..i) }).collect();
    let radii = (0..nodes).map(|i| 1.0 / (1.0 + i as f32 / 10.0)).collect();
    VesselTree::from_arrays(positions, parents, radii).expect("a well-formed tree")
}

fn at(mmhg: f64) -> FlowSettings {
    FlowSettings {
        viscosity: ViscosityLaw::Constant(Viscosity::from_centipoise(3.5)),
        root: RootPressure::Constant(Pressure::from_mmhg(mmhg)),
        ..FlowSettings::default()
    }
}

/// Cuts a segment in its middle and closes the distal end.
fn cut_off(radius: f32) -> Interruption {
    Interruption { distal: None, ..Interruption::cut(0.5, radius) }
}

fn patient(lowers_pressure: bool) -> BloodVolume {
    BloodVolume::new(BloodVolumeSettings { lowers_pressure, ..BloodVolumeSettings::default() }).expect("valid numbers")
}

fn bleeding() -> Bleeding {
    Bleeding::new(BleedingSettings::default()).expect("valid numbers")
}

/// The initial flow out of one proximal end of a network.
fn rate(tree: &VesselTree, settings: FlowSettings, node: u32, gap: Interruption) -> Flow {
    let mut network = Network::new(tree, settings).expect("valid numbers");
    network.set_interruption(NodeId(node), Some(gap)).expect("valid numbers");
    let mut bleeding = bleeding();
    bleeding.step(&mut network, 0.0, &mut patient(true)).expect("flow that converges");
    bleeding.rate()
}

#[test]
fn a_sheeps_carotid_bleeds_as_measured() {
    let tree = tube(4, 100.0, 3.5);
    let mut network = Network::new(&tree, at(90.0)).unwrap();
    network.set_interruption(NodeId(3), Some(cut_off(1.25))).unwrap();
    let (mut bleeding, mut blood) = (bleeding(), patient(false));
    bleeding.step(&mut network, 1.0 / 60.0, &mut blood).unwrap();
    let first = bleeding.rate().ml_per_min();
    assert!((first / 400.0 - 1.0).abs() < 0.15, "{first} mL/min at first");
    bleeding.step(&mut network, 300.0, &mut blood).unwrap();
    bleeding.step(&mut network, 0.0, &mut blood).unwrap();
    let later = bleeding.rate().ml_per_min();
    assert!(later < 100.0 && later > 50.0, "{later} mL/min after 5 min");
    while bleeding.ends()[0].state == EndState::Bleeding {
        bleeding.step(&mut network, 1.0, &mut blood).unwrap();
        assert!(bleeding.time() < 3600.0);
    }
    let stopped = bleeding.time() / 60.0;
    assert!((stopped / 17.0 - 1.0).abs() < 0.15, "stops after {stopped} min");
}

#[test]
fn small_vessels_bleed_what_their_own_resistance_lets_through() {
    for (diameter, mmhg, expected) in [(0.1_f32, 50.0, 0.14), (0.2, 60.0, 1.35)] {
        // Twice the length, cut in the middle.
        let tree = tube(1, 40.0 * diameter, 0.5 * diameter);
        // Out of a wide hole, only the resistance limits the flow.
        let free = rate(&tree, at(mmhg), 1, cut_off(5.0 * diameter)).ml_per_min();
        assert!((free / expected - 1.0).abs() < 0.02, "{diameter} mm: {free} mL/min");
        // Out of its own end, neither limit is exceeded, and the flow is that of both in series.
        let found = rate(&tree, at(mmhg), 1, cut_off(0.5 * diameter)).ml_per_min();
        let area = PI * (0.5e-3 * f64::from(diameter)).powi(2);
        let orifice = 0.29 * area * (2.0 * Pressure::from_mmhg(mmhg).pascals() / 1060.0).sqrt();
        let limit = Flow::from_cubic_metres_per_second(orifice).ml_per_min();
        assert!(found < free && found < limit, "{diameter} mm: {found} mL/min");
        let sum = found / free + (found / limit).powi(2);
        assert!((sum - 1.0).abs() < 1e-3, "{diameter} mm: shares of the pressure add up to {sum}");
    }
}

#[test]
fn a_wider_vessel_and_a_higher_pressure_bleed_more() {
    let mut before = 0.0;
    for radius in [0.01_f32, 0.03, 0.1, 0.3, 1.0, 3.0] {
        let now = rate(&tube(4, 20.0, radius), at(90.0), 2, cut_off(radius)).ml_per_min();
        assert!(now > before, "radius {radius}: {now} mL/min after {before}");
        before = now;
    }
    let mut before = 0.0;
    for mmhg in [1.0, 5.0, 20.0, 60.0, 95.0, 150.0, 300.0] {
        let now = rate(&tube(4, 20.0, 0.5), at(mmhg), 2, cut_off(0.5)).ml_per_min();
        assert!(now > before, "{mmhg} mmHg: {now} mL/min after {before}");
        before = now;
    }
    let against = FlowSettings { ambient: Pressure::from_mmhg(30.0), ..at(90.0) };
    assert!(
        rate(&tube(4, 20.0, 0.5), against.clone(), 2, cut_off(0.5))
            < rate(&tube(4, 20.0, 0.5), at(90.0), 2, cut_off(0.5))
    );
    let outside = FlowSettings { ambient: Pressure::from_mmhg(91.0), ..against };
    assert_eq!(rate(&tube(4, 20.0, 0.5), outside, 2, cut_off(0.5)), Flow::ZERO);
}

#[test]
fn nothing_bleeds_behind_a_clamp_and_all_of_it_once_released() {
    // The bed has atmospheric pressure, so that nothing bleeds back.
    let mut settings = at(95.0);
    settings.bed.pressure = Pressure::ZERO;
    for seed in 0..20 {
        let tree = tree(seed, 80);
        let mut network = Network::new(&tree, settings.clone()).unwrap();
        for node in [30, 40, 50, 60, 70] {
            network.set_interruption(NodeId(node), Some(Interruption::cut(0.5, 0.2))).unwrap();
        }
        let (mut bleeding, mut blood) = (bleeding(), patient(true));
        bleeding.step(&mut network, 1.0, &mut blood).unwrap();
        assert!(bleeding.rate() > Flow::ZERO);
        let lost = bleeding.lost();
        for root in tree.segments().filter(|&(_, parent)| parent == 0).map(|(node, _)| node as u32) {
            network.set_interruption(NodeId(root), Some(Interruption::clamp(0.1))).unwrap();
        }
        bleeding.step(&mut network, 10.0, &mut blood).unwrap();
        assert_eq!(bleeding.rate(), Flow::ZERO, "seed {seed}");
        assert_eq!(bleeding.lost(), lost, "seed {seed}");
        assert!(bleeding.ends().iter().all(|end| end.state == EndState::Dry), "seed {seed}");
        for root in tree.segments().filter(|&(_, parent)| parent == 0).map(|(node, _)| node as u32) {
            network.set_interruption(NodeId(root), None).unwrap();
        }
        bleeding.step(&mut network, 1.0, &mut blood).unwrap();
        assert!(bleeding.rate() > Flow::ZERO, "seed {seed}");
    }
}

#[test]
fn the_distal_end_bleeds_back_only_if_the_bed_has_pressure() {
    let flow = |bed: f64| {
        let mut settings = at(95.0);
        settings.bed.pressure = Pressure::from_mmhg(bed);
        let only_distal = Interruption { proximal: None, ..Interruption::cut(0.5, 0.5) };
        rate(&tube(4, 20.0, 0.5), settings, 2, only_distal).ml_per_min()
    };
    assert!(flow(20.0) > 0.0);
    assert!(flow(40.0) > flow(20.0));
    assert_eq!(flow(0.0), 0.0);
    assert_eq!(flow(-5.0), 0.0);
}

/// A pulsatile artery cut in three places, with clotting and falling pressure: loss after 20 s in steps of `step`.
fn loss(step: f64, seed: u64) -> f64 {
    let tree = tree(seed, 60);
    let settings = FlowSettings { root: RootPressure::Pulsatile(Pulse::default()), ..at(0.0) };
    let mut network = Network::new(&tree, settings).expect("valid numbers");
    for node in [2, 9, 25] {
        network
            .set_interruption(NodeId(node), Some(Interruption::cut(0.3, tree.radii()[node as usize])))
            .expect("valid numbers");
    }
    let blood = BloodVolumeSettings { total: Volume::from_ml(300.0), ..BloodVolumeSettings::default() };
    let (mut bleeding, mut blood) = (bleeding(), BloodVolume::new(blood).expect("valid numbers"));
    for _ in 0..(20.0 / step).round() as usize {
        bleeding.step(&mut network, step, &mut blood).expect("flow that converges");
    }
    assert!(blood.pressure_share() < 0.95, "{} mL lost: a test of falling pressure", blood.lost().ml());
    bleeding.lost().ml()
}

#[test]
fn the_loss_does_not_depend_on_the_time_step() {
    for seed in 0..4 {
        let fine = loss(1.0 / 960.0, seed);
        for step in [1.0 / 240.0, 1.0 / 60.0, 1.0 / 30.0, 1.0, 20.0] {
            let found = loss(step, seed);
            assert!((found / fine - 1.0).abs() < 0.01, "seed {seed}, {step} s: {found} mL, not {fine}");
        }
    }
}

#[test]
fn the_loss_is_the_integral_of_the_flow() {
    let tree = tree(5, 100);
    let settings = FlowSettings { root: RootPressure::Pulsatile(Pulse::default()), ..at(0.0) };
    let mut network = Network::new(&tree, settings).unwrap();
    let (mut bleeding, mut blood) = (bleeding(), patient(true));
    let (mut total, mut ends) = (0.0, [0.0; 100]);
    for frame in 0..2000u32 {
        if frame % 100 == 0 && frame < 1000 {
            let node = 10 + frame / 100 * 7;
            network.set_interruption(NodeId(node), Some(Interruption::cut(0.5, 0.1))).unwrap();
        }
        let seconds = f64::from(1 + frame % 7) / 60.0;
        bleeding.step(&mut network, seconds, &mut blood).unwrap();
        total += bleeding.rate().cubic_metres_per_second() * seconds;
        for end in bleeding.ends().iter().filter(|end| end.side == EndSide::Proximal) {
            ends[end.node.index()] += end.flow.cubic_metres_per_second() * seconds;
        }
    }
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-10 * b;
    assert!(close(bleeding.lost().cubic_metres(), total), "{:?}, not {total}", bleeding.lost());
    assert!(close(blood.lost().cubic_metres(), total));
    for end in bleeding.ends().iter().filter(|end| end.side == EndSide::Proximal) {
        assert!(close(end.lost.cubic_metres(), ends[end.node.index()]), "{end:?}");
    }
}

#[test]
fn arteries_spurt_and_veins_ooze() {
    let tree = tube(4, 40.0, 1.0);
    let course = |settings: FlowSettings, gap: Interruption| -> Vec<f64> {
        let mut network = Network::new(&tree, settings).unwrap();
        network.set_interruption(NodeId(2), Some(gap)).unwrap();
        let (mut bleeding, mut blood) = (bleeding(), patient(true));
        let mut step = || {
            bleeding.step(&mut network, 1.0 / 60.0, &mut blood).unwrap();
            bleeding.rate().ml_per_min()
        };
        (0..60).map(|_| step()).collect()
    };
    let extremes =
        |flows: &[f64]| flows.iter().fold((f64::MAX, 0.0_f64), |(low, high), &flow| (low.min(flow), high.max(flow)));
    let artery = FlowSettings { root: RootPressure::Pulsatile(Pulse::default()), ..FlowSettings::arterial() };
    let (low, high) = extremes(&course(artery, cut_off(1.0)));
    // Between the roots of 80 and 120 mmHg.
    assert!(high / low > 1.15, "an artery bleeds {low} to {high} mL/min");
    let (trickle, most) = extremes(&course(FlowSettings::venous(), cut_off(1.0)));
    assert!(most / trickle < 1.05 && most < 0.5 * low, "a vein bleeds {trickle} to {most} mL/min");
}

#[test]
fn a_patient_bleeds_out_and_no_further() {
    let tree = tube(2, 40.0, 4.0);
    let mut network = Network::new(&tree, FlowSettings::arterial()).unwrap();
    network.set_interruption(NodeId(1), Some(Interruption::cut(0.5, 4.0))).unwrap();
    let settings = BleedingSettings { clotting: None, ..BleedingSettings::default() };
    let (mut bleeding, mut blood) = (Bleeding::new(settings).unwrap(), patient(true));
    bleeding.step(&mut network, 3600.0, &mut blood).unwrap();
    assert!((0.40..=0.4501).contains(&blood.lost_share()), "{}", blood.lost_share());
    assert!(bleeding.rate().ml_per_min() < 100.0 && blood.pressure_share() < 0.01);
}

/// An artery and a vein with a resisting bed, cut in three places each.
fn cut_pair(resistance: f64) -> [Network; 2] {
    let resisting = Some(Resistance::from_mmhg_min_per_ml(resistance));
    let pulse = RootPressure::Pulsatile(Pulse::default());
    [(1, FlowSettings { root: pulse, ..at(0.0) }), (2, FlowSettings::venous())].map(|(seed, mut settings)| {
        settings.bed.resistance = resisting;
        let tree = tree(seed, 50);
        let mut network = Network::new(&tree, settings).expect("valid settings");
        for node in [4, 20, 40] {
            let gap = Interruption::cut(0.4, tree.radii()[node]);
            network.set_interruption(NodeId(node as u32), Some(gap)).expect("a valid gap");
        }
        network
    })
}

#[test]
fn arteries_and_veins_without_links_bleed_as_each_alone() {
    let [mut artery, mut vein] = cut_pair(2.0);
    let mut circulation = Circulation::new(artery.clone(), vein.clone(), &[]).unwrap();
    let (mut arteries, mut veins, mut blood) = (bleeding(), bleeding(), patient(false));
    let (mut alone, mut other, mut its_blood) = (bleeding(), bleeding(), patient(false));
    for _ in 0..20 {
        Bleeding::step_joined([&mut arteries, &mut veins], &mut circulation, 0.04, &mut blood).unwrap();
        alone.step(&mut artery, 0.04, &mut its_blood).unwrap();
        other.step(&mut vein, 0.04, &mut its_blood).unwrap();
    }
    for (joined, alone) in [(&arteries, &alone), (&veins, &other)] {
        assert!(
            (joined.lost().ml() / alone.lost().ml() - 1.0).abs() < 1e-6,
            "{:?}, not {:?}",
            joined.lost(),
            alone.lost()
        );
        assert!(joined.lost() > Volume::ZERO);
    }
}

#[test]
fn a_cut_vein_bleeds_what_its_artery_brings_until_that_is_clamped() {
    let [mut artery, mut vein] = cut_pair(0.5);
    // Links without a pool: all blood in the vein comes from the artery.
    for network in [&mut artery, &mut vein] {
        network.set_interruptions(&[]).unwrap();
    }
    let trees = [tree(1, 50), tree(2, 50)];
    let tips = trees.each_ref().map(|tree| tree.tips());
    let most = tips[0].len().max(tips[1].len());
    let link =
        |i: usize| BedLink { arterial: NodeId(tips[0][i % tips[0].len()]), venous: NodeId(tips[1][i % tips[1].len()]) };
    let links: Vec<BedLink> = (0..most).map(link).collect();
    let mut circulation = Circulation::new(artery, vein, &links).unwrap();
    // The veins' root is closed, so that the cut is their only outlet.
    for node in trees[1].segments().filter(|&(_, parent)| parent == 0).map(|(node, _)| node as u32) {
        let outlet = Some(Outlet { radius: 1.0 });
        let gap = Interruption { distal: outlet, ..Interruption::clamp(0.5) };
        circulation.venous_mut().set_interruption(NodeId(node), Some(gap)).unwrap();
    }
    let (mut arteries, mut veins, mut blood) = (bleeding(), bleeding(), patient(false));
    Bleeding::step_joined([&mut arteries, &mut veins], &mut circulation, 0.01, &mut blood).unwrap();
    let inflow = circulation.arterial().inflow().ml_per_min();
    assert!((veins.rate().ml_per_min() / inflow - 1.0).abs() < 1e-6, "{:?}, not {inflow} mL/min", veins.rate());
    for node in trees[0].segments().filter(|&(_, parent)| parent == 0).map(|(node, _)| node as u32) {
        circulation.arterial_mut().set_interruption(NodeId(node), Some(Interruption::clamp(0.5))).unwrap();
    }
    Bleeding::step_joined([&mut arteries, &mut veins], &mut circulation, 0.01, &mut blood).unwrap();
    assert!(veins.rate().ml_per_min() < 1e-6 * inflow, "{:?}", veins.rate());
}

#[test]
fn severed_small_vessels_lose_little_before_they_clot() {
    // A tree of vessels of 130 to 5 µm with all segments severed at once (Tsiklidis 2019: below 100 mL in 2 min with
    // normal clotting).
    let mut small = tree(3, 400);
    small = VesselTree::from_arrays(
        small.positions().to_vec(),
        small.parents().to_vec(),
        (0..400).map(|i| 0.065 / (1.0 + i as f32 / 32.0)).collect(),
    )
    .unwrap();
    let mut network = Network::new(
        &small,
        FlowSettings { root: RootPressure::Constant(Pressure::from_mmhg(60.0)), ..FlowSettings::arterial() },
    )
    .unwrap();
    for (node, _) in small.segments() {
        network.set_interruption(NodeId(node as u32), Some(Interruption::cut(0.5, small.radii()[node]))).unwrap();
    }
    let (mut bleeding, mut blood) = (bleeding(), patient(true));
    bleeding.step(&mut network, 120.0, &mut blood).unwrap();
    let lost = bleeding.lost().ml();
    assert!(lost > 0.1 && lost < 100.0, "{lost} mL");
    // All have stopped within the bleeding time.
    bleeding.step(&mut network, 7.0 * 60.0, &mut blood).unwrap();
    assert!(bleeding.ends().iter().all(|end| end.state == EndState::Clotted));
}

#[test]
fn what_begins_and_stops_is_told_once() {
    let tree = tube(4, 20.0, 0.5);
    let mut network = Network::new(&tree, at(95.0)).unwrap();
    let (mut bleeding, mut blood) = (bleeding(), patient(true));
    let mut step = |network: &mut Network, seconds: f64| -> Vec<(u32, bool)> {
        bleeding.step(network, seconds, &mut blood).unwrap();
        bleeding.changes().iter().map(|change| (change.node.0, change.bleeds)).collect()
    };
    assert_eq!(step(&mut network, 0.1), []);
    network.set_interruption(NodeId(2), Some(cut_off(0.5))).unwrap();
    assert_eq!(step(&mut network, 0.1), [(2, true)]);
    assert_eq!(step(&mut network, 0.1), []);
    // Another cut nearer to the root removes the pressure.
    network.set_interruption(NodeId(1), Some(cut_off(0.5))).unwrap();
    let mut changes = step(&mut network, 0.1);
    changes.sort_unstable();
    assert_eq!(changes, [(1, true), (2, false)]);
    network.set_interruption(NodeId(1), Some(Interruption::clamp(0.5))).unwrap();
    assert_eq!(step(&mut network, 0.1), [(1, false)]);
    network.set_interruption(NodeId(1), None).unwrap();
    assert_eq!(step(&mut network, 0.1), [(2, true)]);
    assert_eq!(step(&mut network, 3600.0), [(2, false)]);
}

#[test]
fn a_later_cut_on_a_stump_is_a_fresh_wound() {
    let tree = tube(4, 20.0, 0.5);
    let mut network = Network::new(&tree, at(95.0)).unwrap();
    let (mut bleeding, mut blood) = (bleeding(), patient(true));
    network.set_interruption(NodeId(2), Some(cut_off(0.5))).unwrap();
    bleeding.step(&mut network, 3600.0, &mut blood).unwrap();
    assert_eq!(bleeding.ends()[0].state, EndState::Clotted);
    let lost = bleeding.lost();
    let nearer = Interruption { first: 0.25, last: 0.5, proximal: Some(Outlet { radius: 0.5 }), distal: None };
    network.set_interruption(NodeId(2), Some(nearer)).unwrap();
    bleeding.step(&mut network, 1.0, &mut blood).unwrap();
    assert_eq!(bleeding.ends()[0].state, EndState::Bleeding);
    assert!((bleeding.ends()[0].age - 1.0).abs() < 1e-9 && bleeding.lost() > lost);
}

#[test]
fn a_clone_takes_bleeding_back_in_time() {
    let tree = tree(8, 60);
    let mut network = Network::new(&tree, at(95.0)).unwrap();
    network.set_interruption(NodeId(20), Some(Interruption::cut(0.5, 0.3))).unwrap();
    let (mut bleeding, mut blood) = (bleeding(), patient(true));
    bleeding.step(&mut network, 5.0, &mut blood).unwrap();
    let gaps: Vec<_> = network.interruptions().collect();
    let kept = (bleeding.clone(), blood);
    let run = |network: &mut Network, bleeding: &mut Bleeding, blood: &mut BloodVolume| {
        bleeding.step(network, 5.0, blood).unwrap();
        bleeding.lost().ml()
    };
    let first = run(&mut network, &mut bleeding, &mut blood);
    network.set_interruption(NodeId(5), Some(Interruption::cut(0.5, 0.3))).unwrap();
    run(&mut network, &mut bleeding, &mut blood);
    network.set_interruptions(&gaps).unwrap();
    (bleeding, blood) = kept;
    let again = run(&mut network, &mut bleeding, &mut blood);
    assert!((again / first - 1.0).abs() < 1e-9, "{again} mL, not {first}");
}

#[test]
fn a_step_of_no_possible_time_is_refused() {
    let tree = tube(1, 1.0, 1.0);
    let mut network = Network::new(&tree, at(95.0)).unwrap();
    for seconds in [-1.0, f64::NAN, f64::INFINITY] {
        let error = bleeding().step(&mut network, seconds, &mut patient(true)).unwrap_err();
        assert!(error.to_string().contains(&seconds.to_string()), "{error}");
    }
    let resisting =
        BedSettings { resistance: Some(Resistance::from_mmhg_min_per_ml(f64::NAN)), ..BedSettings::default() };
    assert!(Network::new(&tree, FlowSettings { bed: resisting, ..at(95.0) }).is_err());
    assert!(Bleeding::new(BleedingSettings { longest_step: 0.0, ..BleedingSettings::default() }).is_err());
}
