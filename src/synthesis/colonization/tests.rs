//! Tests of a growth's internals: exact association, and edge cases.

use super::*;
use crate::synthesis::roots::{RootPlacement, RootPlacements};
use crate::synthesis::tissue::TissueGrowth;
use crate::synthesis::tissue::shape::{Ball, Disc};

fn disc() -> Arc<dyn Tissue> {
    Arc::new(Disc::flat(0.5).expect("a disc of radius 0.5"))
}

fn roots() -> Roots {
    RootPlacements {
        artery: RootPlacement::Exact(vec![Vec3::new(-0.5, 0.0, 0.0)]),
        vein: RootPlacement::Exact(vec![Vec3::new(-0.495, 0.05, 0.0)]),
        ..RootPlacements::default()
    }
    .into()
}

/// The same without arteries.
fn no_arteries() -> Roots {
    let mut roots = roots();
    roots.placed.artery = RootPlacement::None;
    roots
}

fn growth(settings: ColonizationSettings) -> Colonization {
    Colonization::new(disc(), settings, &roots(), 3).expect("valid settings")
}

/// Invariants of both trees after every step.
fn assert_sound(growth: &Colonization) {
    for kind in Colonization::KINDS {
        let tree = growth.tree(kind);
        tree.validate().expect("a well-formed tree");
        let residual = tree.murray_residual(growth.settings().system(kind).expect("grown").bifurcation_exponent);
        assert!(residual <= 1e-5, "{} residual {residual}", kind.name());
        assert_eq!(growth.normals(kind).len(), tree.len());
        assert_eq!(growth.birth_steps(kind).len(), tree.len());
    }
}

#[test]
fn association_equals_its_brute_force_twin_at_every_step() {
    let ball: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball of radius 0.5"));
    // Lengths that shrink and grow again, and open nodes of every kind.
    let swinging = TissueGrowth::from_fn(30, |step| if step % 7 < 4 { 1.0 + 0.1 * step as f32 } else { 1.0 });
    for (case, tissue) in [disc(), disc(), ball].into_iter().enumerate() {
        let mut settings = ColonizationSettings { steps: 30, samples: 300, ..ColonizationSettings::default() };
        if case == 2 {
            settings = settings.scaled(2.0);
        }
        if case == 1 {
            settings.arterial.tissue_growth = swinging.clone();
            settings.arterial.lateral_sprouts = false;
            settings.venous.root_children = 5;
        }
        let mut growth = Colonization::new(tissue, settings, &roots(), 5).expect("valid settings");
        while !growth.is_finished() {
            growth.step();
            for system in &mut growth.systems {
                system.assert_association_exact();
            }
        }
        assert!(growth.tree(VesselKind::Artery).len() > 20, "case {case}: {}", growth.tree(VesselKind::Artery).len());
    }
}

#[test]
fn a_growth_without_samples_or_drains_rests() {
    let mut growth = growth(ColonizationSettings { samples: 0, ..ColonizationSettings::default() });
    growth.run();
    assert_eq!(growth.tree(VesselKind::Artery).len(), 1);
    assert_eq!(growth.steps_done(), 100);
    assert!(growth.is_finished());
    let report = growth.step();
    assert_eq!([report.arterial, report.venous], [SystemReport::default(); 2]);
}

#[test]
fn a_full_tissue_ends_growth_early_and_loses_nothing_by_it() {
    let mut settings = ColonizationSettings { steps: 3000, ..ColonizationSettings::default() };
    for system in [&mut settings.arterial, &mut settings.venous] {
        system.tissue_growth = TissueGrowth::None;
    }
    let mut ended = growth(settings.clone());
    ended.run();
    let steps = ended.steps_done();
    assert!((50..1500).contains(&steps), "ended after {steps} steps");
    let mut stepped = growth(settings.clone());
    while !stepped.is_finished() {
        stepped.step();
    }
    let mut whole = growth(ColonizationSettings { idle_steps: 0, ..settings.clone() });
    whole.run();
    assert_eq!((stepped.steps_done(), whole.steps_done()), (steps, 3000));
    for kind in Colonization::KINDS {
        assert_eq!(ended.tree(kind), stepped.tree(kind));
        // The last gaps are too small for the samples of the idle steps.
        let (nodes, all) = (ended.tree(kind).len(), whole.tree(kind).len());
        assert!(nodes * 100 >= all * 95, "{} has {nodes} nodes of {all}", kind.name());
    }
    // Growing tissue always needs further vessels.
    settings.steps = 60;
    settings.arterial.tissue_growth = TissueGrowth::Table(vec![1.0; 60]);
    let mut growing =
        Colonization::new(disc(), ColonizationSettings { samples: 0, ..settings }, &roots(), 3).expect("valid");
    growing.run();
    assert_eq!(growing.steps_done(), 60);
}

/// A growth whose only drains are these.
fn pulled_by(drains: &[Vec3], change: impl Fn(&mut ColonizationSettings)) -> Colonization {
    let mut settings =
        ColonizationSettings { samples: 0, steps: 40, confine: false, ..ColonizationSettings::default() };
    change(&mut settings);
    let mut growth = growth(settings);
    drains
        .iter()
        .for_each(|&drain| _ = growth.systems[0].drains.add(drains::Attraction { position: drain, side: Vec3::ZERO }));
    while !growth.is_finished() {
        growth.step();
        assert_sound(&growth);
    }
    growth
}

#[test]
fn drains_in_awkward_places_do_no_harm() {
    let root = Vec3::new(-0.5, 0.0, 0.0);
    let beside = |x: f32, y: f32| root + Vec3::new(x, y, 0.0);
    // On the root; opposite each other; in a row with the root; many at one point.
    for drains in [
        vec![root],
        vec![beside(0.03, 0.0), beside(-0.03, 0.0)],
        vec![beside(0.02, 0.0), beside(0.04, 0.0), beside(0.06, 0.0)],
        vec![beside(0.05, 0.01); 50],
    ] {
        for weight in [0.0, 0.5, 1.0] {
            for angle in [0.0, 90.0, 360.0] {
                pulled_by(&drains, |settings| {
                    settings.arterial.direction_weight = weight;
                    settings.arterial.perception_angle = angle;
                });
            }
        }
    }
}

#[test]
fn opposite_drains_leave_a_root_at_rest() {
    let root = Vec3::new(-0.5, 0.0, 0.0);
    let growth = pulled_by(&[root + Vec3::Y * 0.04, root - Vec3::Y * 0.04], |_| {});
    assert_eq!(growth.tree(VesselKind::Artery).len(), 1);
}

#[test]
fn a_node_that_would_lie_on_another_is_not_made() {
    // A drain on either side makes the tip bifurcate repeatedly around the same place.
    let growth = pulled_by(&[Vec3::new(-0.45, 0.02, 0.0), Vec3::new(-0.45, -0.02, 0.0)], |settings| {
        settings.arterial.kill_distance = 1e-4;
        settings.arterial.perception_angle = 360.0;
        settings.arterial.tissue_growth = TissueGrowth::None;
    });
    let positions = growth.tree(VesselKind::Artery).positions();
    for (i, a) in positions.iter().enumerate() {
        assert!(positions[..i].iter().all(|b| a.distance(*b) > 1e-5));
    }
}

#[test]
fn leaf_only_development_never_sprouts_sideways() {
    let mut settings = ColonizationSettings::default();
    settings.arterial.lateral_sprouts = false;
    let mut growth = growth(settings);
    growth.run();
    let tree = growth.tree(VesselKind::Artery);
    let births = growth.birth_steps(VesselKind::Artery);
    let children = tree.children();
    for node in 0..tree.len() {
        // A root is not an inter-node: its vessels may leave it at any time.
        if let [a, b] = *children.of(node)
            && tree.parent(NodeId(node as u32)).is_some()
        {
            assert_eq!(births[a as usize], births[b as usize], "node {node} sprouted sideways");
        }
    }
    assert!(tree.len() > 100);
}

#[test]
fn growth_goes_on_from_a_given_tree() {
    let mut first = growth(ColonizationSettings { steps: 30, ..ColonizationSettings::default() });
    first.run();
    let given = first.tree(VesselKind::Artery).clone();
    let mut roots = no_arteries();
    roots.given.artery = Some(given.clone());
    let mut second = Colonization::new(disc(), ColonizationSettings::default(), &roots, 9).expect("valid settings");
    assert_eq!(second.tree(VesselKind::Artery).positions(), given.positions());
    for (radius, expected) in second.tree(VesselKind::Artery).radii().iter().zip(given.radii()) {
        assert!((radius / expected - 1.0).abs() < 1e-4, "{radius} against {expected}");
    }
    second.run();
    assert_sound(&second);
    let tree = second.tree(VesselKind::Artery);
    assert!(tree.len() > 2 * given.len());
    assert_eq!(tree.parents()[..given.len()], *given.parents());
}

#[test]
fn growth_needs_an_arterial_root_and_names_it() {
    let error = Colonization::new(disc(), ColonizationSettings::default(), &no_arteries(), 1).expect_err("no root");
    assert!(error.to_string().contains("no root"));
    let wrong = ColonizationSettings { steps: 0, ..ColonizationSettings::default() };
    let error = Colonization::new(disc(), wrong, &roots(), 1).expect_err("no steps");
    assert!(error.to_string().contains("steps is 0"));
}

#[test]
fn a_failed_restart_leaves_the_growth_as_it_was() {
    let mut growth = growth(ColonizationSettings { steps: 20, ..ColonizationSettings::default() });
    growth.run();
    let before = growth.tree(VesselKind::Artery).clone();
    assert!(growth.restart(ColonizationSettings::default(), &no_arteries(), 1).is_err());
    assert_eq!(growth.tree(VesselKind::Artery), &before);
}

#[test]
fn changed_radii_are_those_that_changed() {
    let mut growth = growth(ColonizationSettings::default());
    let mut before: [Vec<f32>; 2] = Default::default();
    while !growth.is_finished() {
        growth.step();
        for kind in Colonization::KINDS {
            let radii = growth.tree(kind).radii();
            let old = &mut before[kind.index()];
            let mut changed: Vec<u32> = growth.changed_radii(kind).to_vec();
            changed.reverse();
            let expected = (0..radii.len() as u32).filter(|&i| old.get(i as usize) != Some(&radii[i as usize]));
            let expected: Vec<u32> = if growth.steps_done() == 1 {
                expected.filter(|&i| growth.birth_steps(kind)[i as usize] > 0 || changed.contains(&i)).collect()
            } else {
                expected.collect()
            };
            // A radius may be written again with the same value, but no changed one may be missing.
            assert!(expected.iter().all(|node| changed.binary_search(node).is_ok()));
            assert!(changed.len() <= expected.len() + radii.len() / 10);
            old.clear();
            old.extend_from_slice(radii);
        }
    }
}

#[test]
fn blood_comes_over_where_both_systems_supplied_a_drain() {
    let mut growth = growth(ColonizationSettings::default());
    growth.run();
    let (arteries, veins) = (growth.tree(VesselKind::Artery).positions(), growth.tree(VesselKind::Vein).positions());
    let reach = SystemSettings::DEFAULT_INFLUENCE_DISTANCE * 3.5;
    assert!(growth.bed_links().len() > veins.len() / 4, "{} links", growth.bed_links().len());
    for link in growth.bed_links() {
        let gap = arteries[link.arterial.index()].distance(veins[link.venous.index()]);
        assert!(gap <= reach, "{link:?} spans {gap}");
    }
    growth.restart(ColonizationSettings { steps: 1, ..Default::default() }, &roots(), 1).expect("valid settings");
    assert!(growth.bed_links().is_empty());
}

#[test]
fn lengths_and_given_radii_whose_powers_overflow_are_refused() {
    let mut settings = ColonizationSettings::default();
    settings.arterial.terminal_radius = 1e38;
    let error = Colonization::new(disc(), settings, &roots(), 3).expect_err("a radius beyond all limits");
    assert!(error.to_string().contains("terminal_radius"), "{error}");
    for radius in [1e30, 1e-30] {
        let mut given = VesselTree::new();
        given.push_root(Vec3::new(-0.4, 0.0, 0.0), radius);
        let mut roots = no_arteries();
        roots.given.artery = Some(given);
        let error =
            Colonization::new(disc(), ColonizationSettings::default(), &roots, 3).expect_err("a radius of any size");
        assert!(matches!(error, ColonizationError::GivenRadius { node: 0, .. }), "{error}");
    }
}
