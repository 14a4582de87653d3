//! Open ends and their flow.

use super::{
    FlowError, Outlet,
    circuit::{Circuit, Shunt},
    skeleton::Skeleton,
};
use crate::synthesis::pace::{Pace, at_once};
use crate::synthesis::tree::NodeId;
use crate::synthesis::units::{BLOOD_DENSITY, Flow, Pressure, Scale};
use std::ops::Range;

/// Which end of a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum EndSide {
    /// The end towards the root: the root drives its bleeding.
    Proximal,
    /// The end towards the terminals: the bed drives its back-bleeding.
    Distal,
}

/// One open end of a severed vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkEnd {
    /// End node of the severed segment.
    pub node: NodeId,
    /// Which end of the gap.
    pub side: EndSide,
    /// Place on the segment, as a share of the way from its parent.
    pub along: f32,
    /// The hole.
    pub outlet: Outlet,
    /// Share of the hole's area that clotting has left open.
    pub opening: f64,
    /// Flow through it, in m³/s.
    pub(super) flow: f64,
    /// Pressure in the vessel before the hole, in Pa.
    pressure: f64,
    /// Area of the hole in m², before clotting.
    area: f64,
    /// Slot of the node that feeds the end.
    pub(super) attached: u32,
    /// Resistance of the vessel between that node and the hole.
    piece: f64,
    /// K of the whole hole: Δp = K·Q².
    orifice: f64,
    /// The joint of the skeleton at the node.
    joint: u32,
    /// The end's draw from the node, as of the last solution.
    pub(super) stump: Shunt,
}

impl NetworkEnd {
    /// An end that has not been measured.
    pub(super) fn new(node: NodeId, side: EndSide, along: f32, outlet: Outlet) -> Self {
        Self {
            node,
            side,
            along,
            outlet,
            opening: 1.0,
            flow: 0.0,
            pressure: 0.0,
            area: 0.0,
            attached: 0,
            piece: 0.0,
            orifice: 0.0,
            joint: 0,
            stump: Shunt::default(),
        }
    }

    /// Flow through it; never negative.
    pub fn flow(&self) -> Flow {
        Flow::from_cubic_metres_per_second(self.flow)
    }

    /// Pressure in the vessel before the hole.
    pub fn pressure(&self) -> Pressure {
        Pressure::from_pascals(self.pressure)
    }

    /// Mean velocity in the hole, in m/s; 0 if it has closed.
    pub fn velocity(&self) -> f64 {
        if self.flow > 0.0 { self.flow / (self.area * self.opening) } else { 0.0 }
    }

    pub(super) fn is_proximal(&self) -> bool {
        self.side == EndSide::Proximal
    }

    /// Whether it is the same hole, not that of a later cut of the same segment.
    fn is_same(&self, other: &Self) -> bool {
        (self.node, self.side, self.along, self.outlet) == (other.node, other.side, other.along, other.outlet)
    }

    /// Sets the values that depend on the segment and the hole.
    pub(super) fn measure(&mut self, attached: u32, piece: f64, scale: Scale, discharge: f64) {
        let radius = scale.to_metres(self.outlet.radius);
        self.area = std::f64::consts::PI * radius * radius;
        let passing = discharge * self.area;
        self.orifice = BLOOD_DENSITY / (2.0 * passing * passing);
        self.attached = attached;
        self.piece = piece;
    }

    /// Adds its draw to the shunt of its node.
    fn draw_from(&self, circuit: &mut Circuit) {
        let shunt = &mut circuit.shunts[self.attached as usize];
        shunt.y += self.stump.y;
        shunt.s += self.stump.s;
    }

    /// K of the open part of the hole.
    fn narrowed(&self) -> f64 {
        self.orifice / (self.opening * self.opening)
    }

    /// The next flow from that of the tangent. One that rounding loses beside the last falls only to a share of it.
    fn next_flow(&self, next: f64) -> f64 {
        let least = 1e-9 * self.flow;
        if next.abs() < least { least } else { next.max(0.0) }
    }

    /// The flow through piece and hole at a difference of pressure: Δ = R·Q + K·Q².
    fn driven(&self, difference: f64) -> f64 {
        if !(difference > 0.0 && self.opening > 0.0) {
            return 0.0;
        }
        let root = (self.piece * self.piece + 4.0 * self.narrowed() * difference).sqrt();
        2.0 * difference / (self.piece + root)
    }
}

/// All open ends of a network.
#[derive(Clone, Debug, Default)]
pub(super) struct OpenEnds {
    /// In the order of their nodes, proximal before distal.
    list: Vec<NetworkEnd>,
    skeleton: Skeleton,
    /// Whether the skeleton must be traced again.
    pub is_untraced: bool,
    /// Whether flows must be solved again.
    pub is_unsolved: bool,
    /// Whether the flows are missing in the network's sums.
    is_unloaded: bool,
}

impl OpenEnds {
    /// Passes after which the iteration is damped, in case it cycles.
    const UNDAMPED: usize = 20;
    /// Passes after which the iteration counts as failed; some five are usual.
    const MOST_PASSES: usize = 200;
    /// Relative change of a flow below which the iteration ends. It converges quadratically, so the law then holds to
    /// the square of this.
    pub const ACCURACY: f64 = 1e-8;
    /// Flow that counts as zero, relative to the largest.
    const NEGLIGIBLE: f64 = 1e-14;

    pub fn all(&self) -> &[NetworkEnd] {
        &self.list
    }

    pub fn all_mut(&mut self) -> &mut [NetworkEnd] {
        &mut self.list
    }

    pub fn clear(&mut self) {
        self.list.clear();
        self.is_untraced = true;
    }

    /// Replaces all ends of a segment. An unchanged end keeps its state.
    pub fn replace(&mut self, node: NodeId, ends: [Option<NetworkEnd>; 2]) {
        let indices = self.indices_of(node);
        let kept = |end: NetworkEnd| {
            let before = self.list[indices.clone()].iter().find(|before| before.is_same(&end));
            let mut end = before.copied().unwrap_or(end);
            // The network at the end has changed.
            end.stump = Shunt::default();
            end
        };
        let ends = ends.map(|end| end.map(kept));
        self.list.splice(indices.clone(), ends.into_iter().flatten());
        self.is_untraced = true;
    }

    /// Positions of a segment's ends in the list.
    pub fn indices_of(&self, node: NodeId) -> Range<usize> {
        self.list.partition_point(|end| end.node < node)..self.list.partition_point(|end| end.node <= node)
    }

    /// Replaces all ends, in the order of their nodes, proximal before distal. An unchanged end keeps its state; those
    /// of `changed` segments, which are in rising order, draw nothing until they are solved.
    pub fn replace_all(&mut self, ends: Vec<NetworkEnd>, changed: &[NodeId]) {
        let mut before = std::mem::replace(&mut self.list, ends).into_iter().peekable();
        let mut changed = changed.iter().peekable();
        for end in &mut self.list {
            let key = (end.node, end.side);
            while before.next_if(|old| (old.node, old.side) < key).is_some() {}
            while changed.next_if(|&&node| node < end.node).is_some() {}
            if let Some(old) = before.next_if(|old| old.is_same(end)) {
                *end = old;
            }
            if changed.peek() == Some(&&end.node) {
                end.stump = Shunt::default();
            }
        }
        self.is_untraced = true;
    }

    pub fn set_opening(&mut self, index: usize, share: f64) {
        self.is_unsolved |= self.list[index].opening.to_bits() != share.to_bits();
        self.list[index].opening = share;
    }

    /// Traces the skeleton again if needed. The circuit's sums must be up to date.
    pub fn trace(&mut self, circuit: &Circuit) {
        if !std::mem::take(&mut self.is_untraced) {
            return;
        }
        let attached = self.list.iter().map(|end| end.attached);
        at_once(self.skeleton.trace(circuit, attached, &Pace::default()));
        for end in &mut self.list {
            end.joint = self.skeleton.joint_at(end.attached);
        }
        self.is_unsolved = true;
    }

    /// Finds the flows of all ends at once.
    ///
    /// Newton's method on Δ = R·Q + K·Q² in the flows, in which the law is convex: from a larger flow it falls to the
    /// solution without passing it. Each pass solves the skeleton exactly. `source` and `ambient` are relative to the
    /// bed's pressure `bed`.
    pub fn solve(&mut self, source: f64, ambient: f64, bed: f64) -> Result<(), FlowError> {
        if !std::mem::take(&mut self.is_unsolved) {
            return Ok(());
        }
        self.is_unloaded = true;
        if self.list.is_empty() {
            return Ok(());
        }
        self.start(source, ambient);
        let mut residual = f64::INFINITY;
        for pass in 0..Self::MOST_PASSES {
            residual = self.pass(source, ambient, pass >= Self::UNDAMPED);
            if residual <= 1.0 {
                let skeleton = std::mem::take(&mut self.skeleton);
                self.finish(|end| skeleton.pressure(end.joint), ambient + bed);
                self.skeleton = skeleton;
                self.count_from(-ambient);
                return Ok(());
            }
        }
        self.is_unsolved = true;
        let residual = residual * Self::ACCURACY;
        Err(FlowError::NotConverged { what: "the flow through open ends", passes: Self::MOST_PASSES, residual })
    }

    /// First guess: the last flow, or that of an end alone. An end with too little pressure while all are closed has no
    /// flow, since others can only lower its pressure.
    fn start(&mut self, source: f64, ambient: f64) {
        self.skeleton.begin(ambient);
        self.skeleton.solve(source, ambient);
        for end in &mut self.list {
            let alone = end.driven(self.skeleton.pressure(end.joint));
            end.flow = if end.flow > 0.0 { end.flow.min(alone) } else { alone };
        }
    }

    /// One pass. Returns the largest change of a flow, in units of the tolerance.
    fn pass(&mut self, source: f64, ambient: f64, damped: bool) -> f64 {
        self.linearise();
        self.skeleton.begin(ambient);
        for end in &self.list {
            self.skeleton.draw(end.joint, end.stump);
        }
        self.skeleton.solve(source, ambient);
        let skeleton = std::mem::take(&mut self.skeleton);
        let residual = self.accept(|end| skeleton.pressure(end.joint), 0.0, damped);
        self.skeleton = skeleton;
        residual
    }

    /// Lowers all flows to what flows if each end alone has a pressure before it that none can exceed.
    pub fn start_below(&mut self, pressure: f64) {
        for end in &mut self.list {
            end.flow = end.flow.min(end.driven(pressure));
        }
    }

    /// Whether a flow is known no better than to its `share`, if pressures are exact to `rounding`.
    pub fn is_blurred(&self, rounding: f64, share: f64) -> bool {
        self.list.iter().any(|end| rounding * end.stump.y > share * end.flow)
    }

    /// Sets every end's draw to the tangent of its law at its flow, for pressures relative to that outside.
    pub fn linearise(&mut self) {
        for end in &mut self.list {
            end.stump = Shunt::default();
            if end.opening == 0.0 {
                end.flow = 0.0;
            }
            if end.flow > 0.0 {
                let slope = end.piece + 2.0 * end.narrowed() * end.flow;
                let y = 1.0 / slope.max(f64::MIN_POSITIVE.sqrt());
                end.stump = Shunt { y, s: -y * end.narrowed() * end.flow * end.flow };
            }
        }
    }

    /// Converts the ends' draw to pressures relative to `pressure`.
    pub fn count_from(&mut self, pressure: f64) {
        for end in &mut self.list {
            end.stump = end.stump.counted_from(pressure);
        }
    }

    /// Takes the flows from the pressures of a linearised solution, which are relative to that outside and exact to
    /// `rounding`. Returns the largest change of a flow, in units of the tolerance.
    pub fn accept(&mut self, pressure: impl Fn(&NetworkEnd) -> f64, rounding: f64, damped: bool) -> f64 {
        let largest = self.list.iter().map(|end| end.flow).fold(0.0, f64::max);
        let mut residual = 0.0_f64;
        for end in &mut self.list {
            let pressure = pressure(end);
            let new = match end.flow > 0.0 {
                true => end.next_flow(end.stump.y * pressure - end.stump.s),
                false => end.driven(pressure),
            };
            let tolerated = Self::ACCURACY * new + Self::NEGLIGIBLE * largest.max(new) + rounding * end.stump.y;
            let change = (new - end.flow).abs();
            if !(change <= tolerated) {
                residual = if change.is_nan() { f64::INFINITY } else { residual.max(change / tolerated) };
            }
            // Only a flow that rises can pass the solution.
            end.flow = if damped && new > end.flow { 0.5 * (new + end.flow) } else { new };
        }
        residual
    }

    /// Sets pressures, and the ends' draw as conductances to the outside. The pressures of the solution are relative to
    /// that outside, which is `ambient`.
    pub fn finish(&mut self, pressure: impl Fn(&NetworkEnd) -> f64, ambient: f64) {
        for end in &mut self.list {
            let difference = pressure(end);
            let is_open = end.flow > 0.0 && difference > 0.0;
            end.stump = Shunt::default();
            if is_open {
                end.stump.y = end.flow / difference;
            } else {
                end.flow = 0.0;
            }
            end.pressure = ambient + difference - end.piece * end.flow;
        }
    }

    /// Adds the flows to the sums of the circuit if needed.
    pub fn add_to_sums(&mut self, circuit: &mut Circuit) {
        if !std::mem::take(&mut self.is_unloaded) {
            return;
        }
        self.load(circuit);
        for &slot in self.skeleton.active() {
            circuit.sum_at(slot);
        }
    }

    /// Adds the draw of the ends to the shunts of their nodes.
    pub fn load(&self, circuit: &mut Circuit) {
        for end in &self.list {
            circuit.shunts[end.attached as usize] = circuit.beds[end.attached as usize];
        }
        for end in &self.list {
            end.draw_from(circuit);
        }
    }

    /// Sets the shunts of some slots, in rising order: all that leaves their nodes except children, that is, the bed,
    /// and the ends as of the last solution.
    pub fn load_at(&self, slots: &[u32], circuit: &mut Circuit) {
        for &slot in slots {
            circuit.shunts[slot as usize] = circuit.beds[slot as usize];
        }
        for end in self.list.iter().filter(|end| slots.binary_search(&end.attached).is_ok()) {
            end.draw_from(circuit);
        }
    }
}
