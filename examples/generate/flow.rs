//! The blood flow in an organ's vessels, each kind on its own between its root and the bed.

use bevy_vessels::synthesis::{
    haemodynamics::{FlowError, FlowSettings, Network},
    tree::{ByKind, VesselKind, VesselTree},
    units::Scale,
};

/// Solves the flow in all kinds of vessels that carry blood.
pub fn flows(trees: &[(VesselKind, &VesselTree)], scale: Scale) -> Result<ByKind<Option<Network>>, FlowError> {
    let mut flows = ByKind::from_fn(|_| None);
    for &(kind, tree) in trees {
        let Some(settings) = settings(kind) else { continue };
        let mut network = Network::new(tree, FlowSettings { scale, ..settings })?;
        network.solve()?;
        flows[kind] = Some(network);
    }
    Ok(flows)
}

/// The default pressures of a kind; `None` for one that carries no blood.
fn settings(kind: VesselKind) -> Option<FlowSettings> {
    match kind {
        VesselKind::Artery => Some(FlowSettings::arterial()),
        VesselKind::Vein => Some(FlowSettings::venous()),
        VesselKind::PortalVein => Some(FlowSettings::portal()),
        VesselKind::Duct => None,
    }
}
