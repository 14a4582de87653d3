//! The blood of one organ, without an ECS: its networks, their gaps, and the supply of its tissue.
//!
//! In: its trees at rest, settings of their flow and the ledgers of wounds. Out: bleeding over time, and the supply of
//! segments and vertices.

use crate::synthesis::{
    haemodynamics::{
        Bleeding, BloodVolume, Circulation, FlowError, FlowSettings, Interruption, Network, Outlet, Supply,
        TissueSupply,
    },
    pace::Pace,
    tree::{BedLink, ByKind, NodeId, VesselKind, VesselTree},
    units::{Flow, Pressure, Resistance},
    wound::{Blockage, EndId, EndSide, Wounds},
};
use bevy::math::Vec3;
use std::sync::Arc;

/// The trees of an organ; `None` for a kind without vessels.
pub(crate) type Trees = ByKind<Option<VesselTree>>;

/// What determines the flow in an organ, besides its vessels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Hydraulics {
    /// Settings of each kind of vessels; `None` for a kind that carries no blood.
    pub(crate) settings: ByKind<Option<FlowSettings>>,
    /// The flow into the arteries that the bed is to let through; `None` if the bed is as the settings say.
    pub(crate) flow: Option<Flow>,
}

/// Gives the bed between arteries and veins a resistance.
fn give_bed(settings: &mut ByKind<Option<FlowSettings>>, resistance: Option<Resistance>) {
    for settings in [&mut settings.artery, &mut settings.vein].into_iter().flatten() {
        settings.bed.resistance = resistance;
    }
}

/// An open end in the flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FlowingEnd {
    pub(crate) node: NodeId,
    pub(crate) side: EndSide,
    pub(crate) id: EndId,
}

/// The networks of an organ.
#[derive(Clone, Debug, Default)]
struct Networks {
    /// Arteries and veins, if the bed joins them.
    joined: Option<Box<Circulation>>,
    /// All other kinds, each on its own.
    apart: ByKind<Option<Network>>,
}

impl Networks {
    async fn new(trees: &Trees, hydraulics: &Hydraulics, links: &[BedLink], pace: &Pace) -> Result<Self, FlowError> {
        let mut settings = hydraulics.settings.clone();
        let Some(flow) = hydraulics.flow else { return Self::of_bed(trees, &settings, links, pace).await };
        // A joined bed needs a resistance to begin with; this one is replaced.
        give_bed(&mut settings, Some(Resistance::from_pascal_seconds_per_cubic_metre(1.0)));
        let mut networks = Self::of_bed(trees, &settings, links, &pace.part(0.0..0.3)).await?;
        let fitted = networks.fit_bed(flow, &pace.part(0.3..0.7)).await;
        match (&networks.joined, fitted) {
            (Some(_), Ok(_)) => Ok(networks),
            // Trees that nothing joins each have a bed of their own: that of the arteries serves all.
            (None, Ok(resistance)) => {
                give_bed(&mut settings, resistance);
                Self::of_bed(trees, &settings, &[], &pace.part(0.7..1.0)).await
            }
            (_, Err(_)) => Self::of_bed(trees, &hydraulics.settings, &[], &pace.part(0.7..1.0)).await,
        }
    }

    /// The networks for a bed as the settings say.
    async fn of_bed(
        trees: &Trees,
        settings: &ByKind<Option<FlowSettings>>,
        links: &[BedLink],
        pace: &Pace,
    ) -> Result<Self, FlowError> {
        let mut networks = Self::default();
        for (kind, pace) in each_kind(&pace.part(0.0..0.8)) {
            if let Some((tree, settings)) = trees[kind].as_ref().zip(settings[kind].clone()) {
                networks.apart[kind] = Some(Network::new_paced(tree, settings, &pace).await?);
            }
        }
        if !links.is_empty() {
            networks.join(links, &pace.part(0.8..1.0)).await?;
        }
        Ok(networks)
    }

    /// Gives the bed the resistance at which a flow enters the arteries; `None` if there are none.
    async fn fit_bed(&mut self, flow: Flow, pace: &Pace) -> Result<Option<Resistance>, FlowError> {
        match (&mut self.joined, &mut self.apart.artery) {
            (Some(joined), _) => joined.fit_bed_paced(flow, pace).await.map(Some),
            (None, Some(arteries)) => arteries.fit_bed_paced(flow, pace).await.map(Some),
            (None, None) => Ok(None),
        }
    }

    /// Joins arteries and veins through the bed, if there are both.
    async fn join(&mut self, links: &[BedLink], pace: &Pace) -> Result<(), FlowError> {
        let Self { joined, apart } = self;
        match (apart.artery.take(), apart.vein.take()) {
            (Some(arteries), Some(veins)) => {
                // The growth may have added links since the trees were published.
                let is_there =
                    |link: &&BedLink| link.arterial.index() < arteries.len() && link.venous.index() < veins.len();
                let links: Vec<BedLink> = links.iter().filter(is_there).copied().collect();
                *joined = Some(Box::new(Circulation::new_paced(arteries, veins, &links, pace).await?));
            }
            (arteries, veins) => (apart.artery, apart.vein) = (arteries, veins),
        }
        Ok(())
    }

    fn get(&self, kind: VesselKind) -> Option<&Network> {
        match (&self.joined, kind) {
            (Some(joined), VesselKind::Artery) => Some(joined.arterial()),
            (Some(joined), VesselKind::Vein) => Some(joined.venous()),
            _ => self.apart[kind].as_ref(),
        }
    }

    fn get_mut(&mut self, kind: VesselKind) -> Option<&mut Network> {
        match (&mut self.joined, kind) {
            (Some(joined), VesselKind::Artery) => Some(joined.arterial_mut()),
            (Some(joined), VesselKind::Vein) => Some(joined.venous_mut()),
            _ => self.apart[kind].as_mut(),
        }
    }

    /// Holds bed and roots at a share of their pressure in the settings, of its mean for a pulse.
    fn hold_at(&mut self, share: f64) -> Result<(), FlowError> {
        let lowered = |pressure: Pressure| Pressure::from_pascals(pressure.pascals() * share);
        for kind in VesselKind::ALL {
            let Some(network) = self.get_mut(kind) else { continue };
            let (bed, root) = (network.settings().bed.pressure, network.settings().root.mean());
            network.set_bed_pressure(lowered(bed))?;
            network.set_root_pressure(lowered(root))?;
        }
        Ok(())
    }

    async fn solve(&mut self, pace: &Pace) -> Result<(), FlowError> {
        if let Some(joined) = &mut self.joined {
            joined.solve_paced(&pace.part(0.0..0.5)).await?;
        }
        for (kind, pace) in each_kind(&pace.part(0.5..1.0)) {
            if let Some(network) = &mut self.apart[kind] {
                network.solve_paced(&pace).await?;
            }
        }
        Ok(())
    }
}

/// The flow in an organ's vessels.
#[derive(Debug)]
pub(crate) struct OrganFlow {
    networks: Networks,
    trees: Arc<Trees>,
}

impl OrganFlow {
    /// The flow in the intact vessels. `links` join arteries and veins; without links they stay separate.
    pub(crate) async fn new(
        trees: Trees,
        hydraulics: &Hydraulics,
        links: &[BedLink],
        pace: &Pace,
    ) -> Result<Self, FlowError> {
        Ok(Self { networks: Networks::new(&trees, hydraulics, links, pace).await?, trees: Arc::new(trees) })
    }

    /// Lays the gaps of an earlier flow of the same vessels over this one, so that its holes stay as they are.
    pub(crate) fn keep_gaps_of(&mut self, before: &Self) -> Result<(), FlowError> {
        for kind in VesselKind::ALL {
            let (Some(network), Some(before)) = (self.networks.get_mut(kind), before.networks.get(kind)) else {
                continue;
            };
            let gaps: Vec<_> = before.interruptions().filter(|(node, _)| node.index() < network.len()).collect();
            network.set_interruptions(&gaps)?;
        }
        Ok(())
    }

    /// Lays the gaps of a ledger over a kind's network, in place of the old ones.
    ///
    /// Returns its open ends, in the order of the network's. Segments that grew since are skipped.
    pub(crate) fn lay(&mut self, kind: VesselKind, wounds: &Wounds) -> Result<Vec<FlowingEnd>, FlowError> {
        let (Some(tree), Some(network)) = (&self.trees[kind], self.networks.get_mut(kind)) else {
            return Ok(Vec::new());
        };
        let (mut gaps, mut ends) = (Vec::new(), Vec::new());
        for blockage in wounds.blockages().filter(|blockage| blockage.node.index() < network.len()) {
            let node = blockage.node;
            gaps.push((node, interruption(&blockage, tree.radii()[node.index()], network.interruption(node))));
            let end = |side, id: Option<EndId>| id.map(|id| FlowingEnd { node, side, id });
            ends.extend(end(EndSide::Proximal, blockage.proximal));
            ends.extend(end(EndSide::Distal, blockage.distal));
        }
        network.set_interruptions(&gaps)?;
        Ok(ends)
    }

    /// Bleeds for a time. With 0 seconds only the rates are computed.
    pub(crate) fn step(
        &mut self,
        bleeding: &mut ByKind<Bleeding>,
        seconds: f64,
        blood: &mut BloodVolume,
    ) -> Result<(), FlowError> {
        let Networks { joined, apart } = &mut self.networks;
        if let Some(joined) = joined {
            Bleeding::step_joined([&mut bleeding.artery, &mut bleeding.vein], joined, seconds, blood)?;
        }
        for (network, bleeding) in apart.values_mut().zip(bleeding.values_mut()) {
            if let Some(network) = network {
                bleeding.step(network, seconds, blood)?;
            }
        }
        Ok(())
    }

    /// Number of nodes of all networks.
    pub(crate) fn nodes(&self) -> usize {
        VesselKind::ALL.iter().filter_map(|&kind| self.networks.get(kind)).map(Network::len).sum()
    }

    /// A copy for measuring.
    pub(crate) fn copy(&self) -> Self {
        Self { networks: self.networks.clone(), trees: Arc::clone(&self.trees) }
    }

    /// The present condition of the vessels, to be applied to a copy. Its size is that of the gaps, not of the vessels.
    pub(crate) fn condition(&self, blood: &BloodVolume) -> Condition {
        let of_kinds = ByKind::from_fn(|kind| match self.networks.get(kind) {
            Some(network) => {
                let openings = network.open_ends().iter().map(|end| end.opening).collect();
                (network.interruptions().collect(), openings)
            }
            None => <(Vec<_>, Vec<_>)>::default(),
        });
        Condition { of_kinds, pressure_share: blood.pressure_share() }
    }

    /// Applies a condition to this copy, at the mean of the pulse, and solves it.
    async fn solve_in(&mut self, condition: &Condition, pace: &Pace) -> Result<(), FlowError> {
        for (kind, (gaps, openings)) in condition.of_kinds.iter() {
            let Some(network) = self.networks.get_mut(kind) else { continue };
            network.set_interruptions(gaps)?;
            openings.iter().enumerate().try_for_each(|(end, &share)| network.set_opening(end, share))?;
        }
        self.networks.hold_at(condition.pressure_share)?;
        self.networks.solve(pace).await
    }
}

/// Everything that the flow in an organ depends on besides its intact vessels.
#[derive(Clone, Debug)]
pub(crate) struct Condition {
    /// Gaps of each kind, and how far each of its open ends is open.
    of_kinds: ByKind<(Vec<(NodeId, Interruption)>, Vec<f64>)>,
    /// Share of the root pressure that the patient has left.
    pressure_share: f64,
}

/// Measures the supply of an organ's tissue, relative to the intact organ.
#[derive(Debug)]
pub(crate) struct SupplyGauge {
    /// A copy of its own, so that measuring blocks no frame.
    flow: OrganFlow,
    of_kinds: ByKind<Supply>,
    tissue: Option<TissueSupply>,
}

/// A measurement of the supply.
#[derive(Debug)]
pub(crate) struct Measured {
    /// By segment, of each kind.
    pub(crate) segments: ByKind<Vec<f32>>,
    /// By vertex of the organ.
    pub(crate) vertices: Vec<f32>,
    pub(crate) ischaemic_share: f32,
}

impl SupplyGauge {
    /// Measures relative to the flow in the intact vessels of `flow`, without its gaps. `vertices` are the organ's, at
    /// rest.
    pub(crate) async fn new(mut flow: OrganFlow, vertices: &[Vec3], pace: &Pace) -> Result<Self, FlowError> {
        let intact = Condition { of_kinds: ByKind::default(), pressure_share: 1.0 };
        flow.solve_in(&intact, &pace.part(0.0..0.3)).await?;
        let mut of_kinds = ByKind::<Supply>::default();
        for (kind, pace) in each_kind(&pace.part(0.3..0.4)) {
            if let Some((tree, network)) = flow.trees[kind].as_ref().zip(flow.networks.get(kind)) {
                of_kinds[kind] = Supply::against_paced(tree, network, &pace).await;
            }
        }
        let tissue = match &flow.trees.artery {
            Some(tree) if !vertices.is_empty() => {
                Some(TissueSupply::new_paced(tree, vertices, &pace.part(0.4..1.0)).await)
            }
            _ => None,
        };
        Ok(Self { of_kinds, tissue, flow })
    }

    /// Measures the vessels in a condition.
    pub(crate) async fn measure(
        &mut self,
        condition: &Condition,
        ischaemic_below: f32,
        pace: &Pace,
    ) -> Result<Measured, FlowError> {
        let flow = &mut self.flow;
        flow.solve_in(condition, &pace.part(0.0..0.7)).await?;
        let mut share = 0.0;
        for (kind, pace) in each_kind(&pace.part(0.7..1.0)) {
            let (Some(tree), Some(network)) = (&flow.trees[kind], flow.networks.get(kind)) else { continue };
            let supply = &mut self.of_kinds[kind];
            supply.update_paced(tree, network, &pace).await;
            if kind == VesselKind::Artery {
                share = supply.ischaemic_share(tree, ischaemic_below);
            }
        }
        if let Some(tissue) = &mut self.tissue {
            tissue.update(self.of_kinds.artery.segments());
        }
        Ok(Measured {
            segments: self.of_kinds.as_ref().map(|_, supply| supply.segments().to_vec()),
            vertices: self.tissue.as_ref().map_or_else(Vec::new, |tissue| tissue.vertices().to_vec()),
            ischaemic_share: share,
        })
    }
}

/// The kinds of vessels, each with its part of the progress.
fn each_kind(pace: &Pace) -> impl Iterator<Item = (VesselKind, Pace)> {
    let share = 1.0 / VesselKind::ALL.len() as f32;
    let part = move |index: usize| pace.part(index as f32 * share..(index + 1) as f32 * share);
    VesselKind::ALL.into_iter().enumerate().map(move |(index, kind)| (kind, part(index)))
}

/// The interruption of the flow by a blockage in the ledger.
///
/// A hole keeps the radius that it was laid with, even if its vessel has widened since, so that a clot in it stays.
fn interruption(blockage: &Blockage, radius: f32, laid: Option<Interruption>) -> Interruption {
    let new = blockage.interruption(radius);
    let keep = |now: Option<Outlet>, before: Option<Outlet>| now.and(before.or(now));
    match laid {
        Some(laid) if (laid.first, laid.last) == (new.first, new.last) => {
            Interruption { proximal: keep(new.proximal, laid.proximal), distal: keep(new.distal, laid.distal), ..new }
        }
        _ => new,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::{pace::at_once, tree::NO_PARENT};

    /// A stem that forks.
    fn fork() -> VesselTree {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 0.0)];
        VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, 1], vec![0.05; 4]).expect("a tree")
    }

    fn flow_for(flow: Option<Flow>, links: &[BedLink]) -> OrganFlow {
        let settings =
            ByKind { artery: Some(FlowSettings::arterial()), vein: Some(FlowSettings::venous()), ..ByKind::default() };
        let trees = ByKind { artery: Some(fork()), vein: Some(fork()), ..Trees::default() };
        let hydraulics = Hydraulics { settings, flow };
        at_once(OrganFlow::new(trees, &hydraulics, links, &Pace::default())).expect("a flow")
    }

    /// Flow into the arteries of the intact organ, in mL/min.
    fn inflow(flow: &mut OrganFlow) -> f64 {
        at_once(flow.networks.solve(&Pace::default())).expect("it converges");
        flow.networks.get(VesselKind::Artery).expect("there are arteries").inflow().ml_per_min()
    }

    #[test]
    fn the_bed_lets_through_the_known_flow_apart_and_joined() {
        let links = [2, 3].map(|node| BedLink { arterial: NodeId(node), venous: NodeId(node) });
        let free = inflow(&mut flow_for(None, &[]));
        for links in [&[][..], &links] {
            let known = Flow::from_ml_per_min(1e-3 * free);
            let mut flow = flow_for(Some(known), links);
            assert_eq!(flow.networks.joined.is_some(), !links.is_empty());
            assert!((inflow(&mut flow) / known.ml_per_min() - 1.0).abs() < 1e-6);
            let bed = |kind| flow.networks.get(kind).map(|network| network.settings().bed.resistance.is_some());
            assert_eq!([VesselKind::Artery, VesselKind::Vein].map(bed), [Some(true); 2], "on both sides");
        }
        let mut narrow = flow_for(Some(Flow::from_ml_per_min(10.0 * free)), &links);
        assert!((inflow(&mut narrow) / free - 1.0).abs() < 1e-9, "vessels that let through less limit alone");
    }
}
