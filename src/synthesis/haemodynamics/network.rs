//! A tree as a network of resistances, kept up to date with the tree.

use super::{
    EndSide, FlowError, FlowSettings, Interruption, NetworkEnd,
    circuit::{CLOSED, Circuit, FIRST, REFERENCE, SOURCE, Shunt, node_slot, slot_of},
    open_ends::OpenEnds,
};
use crate::synthesis::pace::{Pace, at_once};
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
use crate::synthesis::units::Pressure;

/// Conductance of a bed that holds its terminal at its own pressure, in conductances of the terminal's segment. Large
/// enough that 1 + HELD is HELD in `f64`: it acts like infinity, without a case of its own.
const HELD: f64 = (1u64 << 60) as f64;

/// Least length of a segment, in its radii, which keeps the conductance of a segment of zero length finite.
const LEAST_LENGTH: f64 = 1e-6;

/// The result of [`Network::update`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NetworkUpdate {
    /// Number of new nodes.
    pub appended: usize,
    /// Number of segments whose radius or length changed.
    pub changed: usize,
    /// Whether the tree is another one, rather than the old one grown further. Then the network was made again, without
    /// interruptions.
    pub replaced: bool,
}

/// The network of resistances of one tree, with its interruptions and its solution.
#[derive(Clone, Debug)]
pub struct Network {
    pub(super) settings: FlowSettings,
    pub(super) radii: Vec<f32>,
    pub(super) lengths: Vec<f64>,
    /// 8µ/(πr⁴) of every node's segment.
    pub(super) per_length: Vec<f64>,
    pub(super) circuit: Circuit,
    /// Number of links that join each node to another network; empty without links.
    pub(super) link_counts: Vec<u32>,
    /// Root pressure relative to the bed's, in Pa.
    pub(super) source: f64,
    /// Pressure of the bed, in Pa.
    pub(super) bed: f64,
    /// In the order of their nodes.
    pub(super) interruptions: Vec<(u32, Interruption)>,
    pub(super) ends: OpenEnds,
    pub(super) pressures: Vec<f64>,
    pub(super) flows: Vec<f64>,
    /// Whether `below` and `through` must be summed again from all tips.
    pub(super) sums_stale: bool,
    pub(super) path: Vec<u32>,
    /// Rises with every change of the tree, its gaps and its beds.
    pub(super) revision: u64,
}

impl Network {
    /// The network of a tree, not solved yet, at the mean of the root pressure.
    ///
    /// # Errors
    /// If the tree is not well formed, or a setting is outside its limits.
    pub fn new(tree: &VesselTree, settings: FlowSettings) -> Result<Self, FlowError> {
        at_once(Self::new_paced(tree, settings, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(tree: &VesselTree, settings: FlowSettings, pace: &Pace) -> Result<Self, FlowError> {
        settings.validate()?;
        tree.validate()?;
        let mut network = Self {
            source: 0.0,
            bed: settings.bed.pressure.pascals(),
            settings,
            radii: Vec::new(),
            lengths: Vec::new(),
            per_length: Vec::new(),
            circuit: Circuit::default(),
            link_counts: Vec::new(),
            interruptions: Vec::new(),
            ends: OpenEnds::default(),
            pressures: Vec::new(),
            flows: Vec::new(),
            sums_stale: true,
            path: Vec::new(),
            revision: 0,
        };
        network.clear();
        network.set_root_pressure(network.settings.root.mean())?;
        network.append(tree, pace).await;
        Ok(network)
    }

    /// Follows a tree that grew, whose radii changed or whose nodes moved. Only changes are computed again.
    ///
    /// # Errors
    /// If a number of the tree is not finite, or a radius not above 0. The network is unchanged then.
    pub fn update(&mut self, tree: &VesselTree) -> Result<NetworkUpdate, FlowError> {
        tree.validate()?;
        let before = self.len();
        let goes_on = before <= tree.len()
            && (0..before).all(|node| slot_of(tree.parents()[node]) == self.circuit.links[node + FIRST].parent);
        if !goes_on {
            self.clear();
            at_once(self.append(tree, &Pace::default()));
            return Ok(NetworkUpdate { appended: tree.len(), changed: 0, replaced: true });
        }
        let mut changed = 0;
        for node in 0..before {
            let (radius, length) = (tree.radii()[node], self.length_in(tree, node));
            let is_wider = radius.to_bits() != self.radii[node].to_bits();
            if is_wider || length.to_bits() != self.lengths[node].to_bits() {
                self.lengths[node] = length;
                if is_wider {
                    self.set_radius(node, radius);
                }
                self.set_resistance(node);
                changed += 1;
            }
        }
        at_once(self.append(tree, &Pace::default()));
        let appended = tree.len() - before;
        if changed + appended > 0 {
            self.sums_stale = true;
            self.revision += 1;
            self.measure_ends();
        }
        Ok(NetworkUpdate { appended, changed, replaced: false })
    }

    /// Forgets the tree.
    fn clear(&mut self) {
        self.radii.clear();
        self.lengths.clear();
        self.per_length.clear();
        self.interruptions.clear();
        self.ends.clear();
        self.link_counts.clear();
        self.circuit.clear();
    }

    /// Adds the tree's new nodes.
    async fn append(&mut self, tree: &VesselTree, pace: &Pace) {
        let before = self.len();
        let add = |number: usize| {
            let node = before + number;
            self.circuit.push(slot_of(tree.parents()[node]));
            self.radii.push(0.0);
            self.per_length.push(0.0);
            let length = self.length_in(tree, node);
            self.lengths.push(length);
            self.set_radius(node, tree.radii()[node]);
        };
        pace.part(0.0..0.8).each(tree.len() - before, add).await;
        // After all links of nodes, which decide whether a node is a terminal.
        let measure = |number: usize| {
            let node = before + number;
            self.set_resistance(node);
            if let Some(parent) = (self.circuit.links[node + FIRST].parent as usize).checked_sub(FIRST) {
                self.set_bed(parent);
            }
        };
        pace.part(0.8..1.0).each(tree.len() - before, measure).await;
        self.pressures.resize(tree.len(), 0.0);
        self.flows.resize(tree.len(), 0.0);
        self.sums_stale = true;
        self.revision += 1;
    }

    /// Length of a segment in metres, 0 for a root.
    fn length_in(&self, tree: &VesselTree, node: usize) -> f64 {
        if tree.parents()[node] == NO_PARENT {
            return 0.0;
        }
        tree.segment_length(node) * self.settings.scale.metres()
    }

    fn set_radius(&mut self, node: usize, radius: f32) {
        self.radii[node] = radius;
        let metres = self.settings.scale.to_metres(radius);
        let viscosity = self.settings.viscosity.in_vessel(2.0 * metres);
        let square = metres * metres;
        self.per_length[node] = 8.0 * viscosity / (std::f64::consts::PI * square * square);
    }

    /// Resistance of a node's segment while it is whole, in Pa·s/m³; 0 for a root.
    pub(super) fn whole_resistance(&self, node: usize) -> f64 {
        if self.circuit.links[node + FIRST].parent == SOURCE {
            return 0.0;
        }
        let least = LEAST_LENGTH * self.settings.scale.to_metres(self.radii[node]);
        // At least large enough for a finite inverse, at most the resistance that lets nothing through.
        (self.per_length[node] * self.lengths[node].max(least)).clamp(1.0 / CLOSED, CLOSED)
    }

    fn set_resistance(&mut self, node: usize) {
        let is_whole = self.circuit.links[node + FIRST].upstream != REFERENCE;
        self.circuit.slots[node + FIRST].resistance = if is_whole { self.whole_resistance(node) } else { CLOSED };
        self.set_bed(node);
    }

    /// Sets a node's bed: its links, or the pool if it is a terminal without links. A root without children is no
    /// terminal.
    pub(super) fn set_bed(&mut self, node: usize) {
        let link = self.circuit.links[node + FIRST];
        let is_terminal = link.first_child == REFERENCE && link.parent != SOURCE;
        let links = self.link_counts.get(node).copied().map_or(0.0, f64::from);
        let y = match self.settings.bed.conductance() {
            Some(conductance) if links > 0.0 => links * conductance,
            _ if !is_terminal => 0.0,
            Some(conductance) => conductance,
            None => HELD / self.whole_resistance(node),
        };
        self.circuit.beds[node + FIRST] = Shunt { y, s: 0.0 };
        self.circuit.shunts[node + FIRST] = self.circuit.beds[node + FIRST];
    }

    /// Measures all ends again, after segments changed.
    pub(super) fn measure_ends(&mut self) {
        for index in 0..self.ends.all().len() {
            self.measure_end(index);
        }
        self.ends.is_untraced = true;
    }

    /// Measures the ends of one segment.
    pub(super) fn measure_ends_of(&mut self, node: NodeId) {
        for index in self.ends.indices_of(node) {
            self.measure_end(index);
        }
    }

    fn measure_end(&mut self, index: usize) {
        let NetworkEnd { node, side, along, .. } = self.ends.all()[index];
        let whole = self.whole_resistance(node.index());
        let slot = node_slot(node.index());
        let (attached, share) = match side {
            EndSide::Proximal => (self.circuit.links[slot].parent, along),
            EndSide::Distal => (slot as u32, 1.0 - along),
        };
        let discharge = f64::from(self.settings.discharge_coefficient);
        self.ends.all_mut()[index].measure(attached, whole * f64::from(share), self.settings.scale, discharge);
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.radii.len()
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.radii.is_empty()
    }

    /// The settings that it was made with.
    pub fn settings(&self) -> &FlowSettings {
        &self.settings
    }

    /// Holds all roots at a pressure from now on.
    ///
    /// # Errors
    /// If the pressure is not finite.
    pub fn set_root_pressure(&mut self, pressure: Pressure) -> Result<(), FlowError> {
        FlowError::check_finite("the root pressure in mmHg", pressure.mmhg())?;
        self.source = pressure.pascals() - self.bed;
        self.ends.is_unsolved = true;
        Ok(())
    }

    /// Holds the bed's pool at a pressure from now on, other than that of the settings.
    ///
    /// # Errors
    /// If the pressure is not finite.
    pub fn set_bed_pressure(&mut self, pressure: Pressure) -> Result<(), FlowError> {
        FlowError::check_finite("the bed's pressure in mmHg", pressure.mmhg())?;
        self.source += self.bed - pressure.pascals();
        self.bed = pressure.pascals();
        self.ends.is_unsolved = true;
        Ok(())
    }

    /// The pressure of the bed's pool.
    pub fn bed_pressure(&self) -> Pressure {
        Pressure::from_pascals(self.bed)
    }

    /// The pressure of all roots.
    pub fn root_pressure(&self) -> Pressure {
        Pressure::from_pascals(self.source + self.bed)
    }

    /// Pressure outside, relative to the bed's.
    pub(super) fn ambient(&self) -> f64 {
        self.settings.ambient.pascals() - self.bed
    }

    /// Checks that a node exists.
    pub(super) fn check(&self, node: NodeId) -> Result<(), FlowError> {
        if node.index() < self.len() { Ok(()) } else { Err(FlowError::NoSuchNode { node: node.0, nodes: self.len() }) }
    }
}
