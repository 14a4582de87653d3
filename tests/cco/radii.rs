//! Flows and radii are exact after every step, also after terminals that had no room: in comparison with the paper's
//! equations, applied to the finished tree from its terminals to its roots.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::{Cco, CcoSettings},
    roots::{RootPlacement, RootPlacements},
    tissue::{Ball, Disc, Extent, Tissue},
    tree::{NO_PARENT, VesselKind, VesselTree},
};
use std::{f64::consts::PI, sync::Arc};

/// Radii in tissue lengths by Eq. 3 to 6 of the paper, if the domain has grown for the terminals that are there.
fn radii_anew(growth: &Cco, tree: &VesselTree, dimension: i32) -> Vec<f64> {
    let settings = growth.settings();
    let (flow, gamma) = (settings.flow.artery, f64::from(settings.bifurcation_exponent));
    let share = tree.tips().len() as f64 / f64::from(settings.terminals);
    let millimetres = growth.millimetres() * share.powf(1.0 / f64::from(dimension));
    let terminal_flow = flow.rate.cubic_metres_per_second() * 1e9 / f64::from(settings.terminals);
    let drop = flow.root_pressure.pascals() - flow.terminal_pressure.pascals();
    let mut children = vec![Vec::new(); tree.len()];
    tree.segments().for_each(|(node, parent)| children[parent].push(node));
    // Flows and reduced resistances, from the tips up; then the ratios of radii.
    let (mut flows, mut reduced, mut ratios) = (vec![0.0; tree.len()], vec![0.0; tree.len()], vec![1.0; tree.len()]);
    for (node, parent) in tree.segments().collect::<Vec<_>>().into_iter().rev() {
        let below = &children[node];
        flows[node] = if below.is_empty() { terminal_flow } else { below.iter().map(|&child| flows[child]).sum() };
        let fourth = |child: usize| flows[child] * reduced[child];
        for &child in below {
            let others: f64 = below.iter().map(|&other| (fourth(other) / fourth(child)).powf(gamma / 4.0)).sum();
            ratios[child] = others.powf(-1.0 / gamma);
        }
        let through: f64 = below.iter().map(|&child| ratios[child].powi(4) / reduced[child]).sum();
        let length = f64::from(tree.positions()[node].distance(tree.positions()[parent])) * millimetres;
        let own = 8.0 * flow.viscosity.pascal_seconds() * length / PI;
        reduced[node] = own + if below.is_empty() { 0.0 } else { 1.0 / through };
    }
    let mut radii = vec![0.0; tree.len()];
    for (node, parent) in tree.segments() {
        radii[node] = match tree.parents()[parent] {
            NO_PARENT => (flows[node] * reduced[node] / drop).powf(0.25),
            _ => radii[parent] * ratios[node],
        };
    }
    radii.into_iter().map(|radius| radius / millimetres).collect()
}

#[test]
fn radii_are_those_of_a_tree_computed_anew_after_every_step() {
    let (mut refused, mut compared) = (0, 0);
    let tissues: [Arc<dyn Tissue>; 2] =
        [Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball")), Arc::new(Disc::flat(0.5).expect("a disc"))];
    for tissue in tissues {
        let dimension = if matches!(tissue.extent(), Extent::Area(_)) { 2 } else { 3 };
        // Vessels so thick that there is not room for all, and two trees that share the flow.
        let perfusion = if dimension == 2 { 400.0 } else { 150.0 };
        let settings = CcoSettings { perfusion, terminals: 400, ..CcoSettings::default() };
        let artery = RootPlacement::Nearest(vec![Vec3::Y * 0.5, Vec3::Y * -0.5]);
        let roots = RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() };
        let mut growth = Cco::new(tissue, settings, &roots.into(), 3).expect("a growth");
        let mut rejected = 0;
        while !growth.is_finished() {
            growth.advance();
            growth.settle();
            let tree = growth.tree(VesselKind::Artery);
            let now = growth.reports().next().expect("arteries").rejected;
            refused += usize::from(std::mem::replace(&mut rejected, now) < now);
            let anew = radii_anew(&growth, tree, dimension);
            for (node, _) in tree.segments() {
                let (own, anew) = (f64::from(tree.radii()[node]), anew[node]);
                assert!((own / anew - 1.0).abs() < 1e-5, "{node}: {own} instead of {anew}");
                compared += 1;
            }
        }
    }
    assert!(refused > 50 && compared > 1000, "{refused} steps with refusals, {compared} radii");
}
