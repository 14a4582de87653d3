//! The blood of one organ, without an ECS: its networks, their gaps, and what its tissue gets.
//!
//! In: the trees of its arteries and veins at rest, a [`Perfusion`] and the ledgers of wounds. Out: bleeding over time,
//! and the supply of segments and vertices.

use crate::plugin::perfusion::Perfusion;
use crate::synthesis::{
    haemodynamics::{BedLink, Circulation, FlowError, Interruption, Network, Outlet},
    tree::{NodeId, System, VesselTree},
    units::Pressure,
    wound::{Bleeding, Blockage, BloodVolume, EndId, EndSide, Supply, TissueSupply, Wounds},
};
use bevy::math::Vec3;
use std::sync::Arc;

/// The trees of an organ's systems; `None` for one without vessels.
pub(crate) type Trees = [Option<VesselTree>; 2];

/// An open end that the flow knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FlowingEnd {
    pub(crate) node: NodeId,
    pub(crate) side: EndSide,
    pub(crate) id: EndId,
}

/// The networks of an organ.
#[derive(Clone, Debug)]
enum Networks {
    Apart(Box<[Option<Network>; 2]>),
    Joined(Box<Circulation>),
}

impl Networks {
    fn new(trees: &Trees, perfusion: &Perfusion, links: &[BedLink]) -> Result<Self, FlowError> {
        let network = |system: System| {
            let tree = trees[system.index()].as_ref();
            tree.map(|tree| Network::new(tree, perfusion.flow_settings(system))).transpose()
        };
        let [arteries, veins] = [network(System::Arterial)?, network(System::Venous)?];
        match (arteries, veins) {
            (Some(arteries), Some(veins)) if perfusion.bed.resistance.is_some() && !links.is_empty() => {
                // The growth may have gone on since the trees were published.
                let is_there =
                    |link: &&BedLink| link.arterial.index() < arteries.len() && link.venous.index() < veins.len();
                let links: Vec<BedLink> = links.iter().filter(is_there).copied().collect();
                Ok(Self::Joined(Box::new(Circulation::new(arteries, veins, &links)?)))
            }
            (arteries, veins) => Ok(Self::Apart(Box::new([arteries, veins]))),
        }
    }

    fn get(&self, system: System) -> Option<&Network> {
        match (self, system) {
            (Self::Apart(networks), system) => networks[system.index()].as_ref(),
            (Self::Joined(circulation), System::Arterial) => Some(circulation.arterial()),
            (Self::Joined(circulation), System::Venous) => Some(circulation.venous()),
        }
    }

    fn get_mut(&mut self, system: System) -> Option<&mut Network> {
        match (self, system) {
            (Self::Apart(networks), system) => networks[system.index()].as_mut(),
            (Self::Joined(circulation), System::Arterial) => Some(circulation.arterial_mut()),
            (Self::Joined(circulation), System::Venous) => Some(circulation.venous_mut()),
        }
    }

    /// Holds bed and roots at a share of the pressure that the settings give them, that of a pulse in the mean.
    fn hold_at(&mut self, share: f64) -> Result<(), FlowError> {
        let lowered = |pressure: Pressure| Pressure::from_pascals(pressure.pascals() * share);
        for system in System::ALL {
            let Some(network) = self.get_mut(system) else { continue };
            let (bed, root) = (network.settings().bed.pressure, network.settings().root.mean());
            network.set_bed_pressure(lowered(bed))?;
            network.set_root_pressure(lowered(root))?;
        }
        Ok(())
    }

    fn solve(&mut self) -> Result<(), FlowError> {
        match self {
            Self::Apart(networks) => networks.iter_mut().flatten().try_for_each(Network::solve),
            Self::Joined(circulation) => circulation.solve(),
        }
    }
}

/// The flow in an organ's vessels.
#[derive(Debug)]
pub(crate) struct OrganFlow {
    networks: Networks,
    trees: Arc<Trees>,
}

impl OrganFlow {
    /// The flow in the intact vessels.
    pub(crate) fn new(trees: Trees, perfusion: &Perfusion, links: &[BedLink]) -> Result<Self, FlowError> {
        Ok(Self { networks: Networks::new(&trees, perfusion, links)?, trees: Arc::new(trees) })
    }

    /// Lays the gaps of an earlier flow of the same vessels over this one, so that its holes stay as they are.
    pub(crate) fn keep_gaps_of(&mut self, before: &Self) -> Result<(), FlowError> {
        for system in System::ALL {
            let (Some(network), Some(before)) = (self.networks.get_mut(system), before.networks.get(system)) else {
                continue;
            };
            let gaps: Vec<_> = before.interruptions().filter(|(node, _)| node.index() < network.len()).collect();
            network.set_interruptions(&gaps)?;
        }
        Ok(())
    }

    /// Lays the gaps of a ledger over a system's network, in place of those that were.
    ///
    /// Returns its open ends in the order of the network's. Segments that grew since are passed over.
    pub(crate) fn lay(&mut self, system: System, wounds: &Wounds) -> Result<Vec<FlowingEnd>, FlowError> {
        let (Some(tree), Some(network)) = (&self.trees[system.index()], self.networks.get_mut(system)) else {
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

    /// Bleeds for a time. 0 seconds only tell how fast.
    pub(crate) fn step(
        &mut self,
        bleeding: &mut [Bleeding; 2],
        seconds: f64,
        blood: &mut BloodVolume,
    ) -> Result<(), FlowError> {
        match &mut self.networks {
            Networks::Apart(networks) => networks
                .iter_mut()
                .zip(bleeding)
                .filter_map(|(network, bleeding)| Some((network.as_mut()?, bleeding)))
                .try_for_each(|(network, bleeding)| bleeding.step(network, seconds, blood)),
            Networks::Joined(circulation) => Bleeding::step_joined(bleeding.each_mut(), circulation, seconds, blood),
        }
    }

    /// Number of nodes of both networks.
    pub(crate) fn nodes(&self) -> usize {
        System::ALL.iter().filter_map(|&system| self.networks.get(system)).map(Network::len).sum()
    }

    /// A copy to measure with.
    pub(crate) fn copy(&self) -> Self {
        Self { networks: self.networks.clone(), trees: Arc::clone(&self.trees) }
    }

    /// How the vessels are now, for a copy to be made equal: as much as there are gaps, however many vessels.
    pub(crate) fn condition(&self, blood: &BloodVolume) -> Condition {
        let of_systems = System::ALL.map(|system| match self.networks.get(system) {
            Some(network) => {
                let openings = network.open_ends().iter().map(|end| end.opening).collect();
                (network.interruptions().collect(), openings)
            }
            None => <(Vec<_>, Vec<_>)>::default(),
        });
        Condition { of_systems, pressure_share: blood.pressure_share() }
    }

    /// Makes this copy equal to the flow that a condition is of, at the mean of the pulse, and solves it altogether.
    fn solve_in(&mut self, condition: &Condition) -> Result<(), FlowError> {
        for (system, (gaps, openings)) in System::ALL.into_iter().zip(&condition.of_systems) {
            let Some(network) = self.networks.get_mut(system) else { continue };
            network.set_interruptions(gaps)?;
            openings.iter().enumerate().try_for_each(|(end, &share)| network.set_opening(end, share))?;
        }
        self.networks.hold_at(condition.pressure_share)?;
        self.networks.solve()
    }
}

/// What the flow in an organ depends on, its intact vessels aside.
#[derive(Clone, Debug)]
pub(crate) struct Condition {
    /// Gaps of each system, and how far each of its open ends is open.
    of_systems: [(Vec<(NodeId, Interruption)>, Vec<f64>); 2],
    /// How much of their pressure the patient's roots have left.
    pressure_share: f64,
}

/// What an organ's tissue gets, against the intact organ.
#[derive(Debug)]
pub(crate) struct SupplyGauge {
    /// A copy of its own, so that measuring holds up no frame.
    flow: OrganFlow,
    of_systems: [Supply; 2],
    tissue: Option<TissueSupply>,
}

/// A measurement of the supply.
#[derive(Debug)]
pub(crate) struct Measured {
    /// By segment, of each system.
    pub(crate) segments: [Vec<f32>; 2],
    /// By vertex of the organ.
    pub(crate) vertices: Vec<f32>,
    pub(crate) ischaemic_share: f32,
}

impl SupplyGauge {
    /// Measures from now on against what flows in the intact vessels of `flow`, whose gaps don't count. `vertices` are
    /// the organ's, at rest.
    pub(crate) fn new(mut flow: OrganFlow, vertices: &[Vec3]) -> Result<Self, FlowError> {
        flow.solve_in(&Condition { of_systems: Default::default(), pressure_share: 1.0 })?;
        let supply = |system: System| {
            let (tree, network) = (flow.trees[system.index()].as_ref(), flow.networks.get(system));
            tree.zip(network).map_or_else(Supply::default, |(tree, network)| Supply::against(tree, network))
        };
        let arteries = flow.trees[System::Arterial.index()].as_ref();
        let tissue = arteries.filter(|_| !vertices.is_empty()).map(|tree| TissueSupply::new(tree, vertices));
        Ok(Self { of_systems: System::ALL.map(supply), tissue, flow })
    }

    /// Measures the vessels in a condition.
    pub(crate) fn measure(&mut self, condition: &Condition, ischaemic_below: f32) -> Result<Measured, FlowError> {
        let flow = &mut self.flow;
        flow.solve_in(condition)?;
        let mut share = 0.0;
        for system in System::ALL {
            let supply = &mut self.of_systems[system.index()];
            let (Some(tree), Some(network)) = (&flow.trees[system.index()], flow.networks.get(system)) else {
                continue;
            };
            supply.update(tree, network);
            if system == System::Arterial {
                share = supply.ischaemic_share(tree, ischaemic_below);
            }
        }
        if let Some(tissue) = &mut self.tissue {
            tissue.update(self.of_systems[System::Arterial.index()].segments());
        }
        Ok(Measured {
            segments: self.of_systems.each_ref().map(|supply| supply.segments().to_vec()),
            vertices: self.tissue.as_ref().map_or_else(Vec::new, |tissue| tissue.vertices().to_vec()),
            ischaemic_share: share,
        })
    }
}

/// What a blockage in the ledger is to the flow.
///
/// A hole keeps the radius that it was laid with, however its vessel has widened since, so that a clot in it stays.
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
