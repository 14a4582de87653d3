//! Bleeding over time: the loss of each open end, until it stops.
//!
//! In: a [`Network`] with its interruptions, and the blood of the patient. Out: for every open end its flow, pressure,
//! velocity, loss and state; the loss of the organ; ends that began or stopped bleeding.
//!
//! A step evaluates openings, root and bed pressure at its middle, solves for the flow of all ends together and keeps
//! it for the whole step. This is second order in the step, and the loss is exactly the time integral of the reported
//! flow. A long step is divided into shorter ones, so that a fast pulse is followed and a simulator may skip minutes.
//! So is one in which much of the patient's blood flows. Blood that isn't there doesn't flow: the last part of a step gives
//! what is left, whatever drives it.

use crate::synthesis::haemodynamics::{BloodVolume, Clotting};
use crate::synthesis::haemodynamics::{Circulation, EndSide, FlowError, Network, NetworkEnd, RootPressure};
use crate::synthesis::tree::NodeId;
use crate::synthesis::units::{Flow, Pressure, Volume};

/// Settings of the bleeding.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BleedingSettings {
    /// How open ends clot. With `None` they never do.
    pub clotting: Option<Clotting>,
    /// Longest step that is not divided. A pulsatile pressure is always sampled at least [`Self::SAMPLES_PER_BEAT`]
    /// times per beat.
    ///
    /// Lower values follow a pulse more closely and cost more.
    ///
    /// Units: seconds. Limits: finite, > 0. Default: [`Self::DEFAULT_LONGEST_STEP`].
    pub longest_step: f32,
}

impl BleedingSettings {
    /// Default of the longest step: that of a game at 20 frames a second.
    pub const DEFAULT_LONGEST_STEP: f32 = 0.05;
    /// Least number of steps in a beat of the heart.
    pub const SAMPLES_PER_BEAT: f64 = 16.0;

    fn validate(&self) -> Result<(), FlowError> {
        FlowError::check_positive("the longest step of the bleeding in s", f64::from(self.longest_step))?;
        self.clotting.map_or(Ok(()), |clotting| clotting.validate())
    }
}

impl Default for BleedingSettings {
    fn default() -> Self {
        Self { clotting: Some(Clotting::default()), longest_step: Self::DEFAULT_LONGEST_STEP }
    }
}

/// The state of an open end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum EndState {
    /// Blood leaves it.
    Bleeding,
    /// It is open, but has too little pressure to bleed: behind a clamp, or with a low bed pressure.
    Dry,
    /// It has clotted.
    Clotted,
}

/// The bleeding of one open end.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BleedingEnd {
    /// End node of the severed segment.
    pub node: NodeId,
    /// Which end of the gap.
    pub side: EndSide,
    /// Place on the segment, as a share of the way from its parent.
    pub along: f32,
    /// Seconds since it was opened.
    pub age: f64,
    /// Mean flow during the last step.
    pub flow: Flow,
    /// Pressure in the vessel before the hole, at the end of the last step.
    pub pressure: Pressure,
    /// Mean velocity in the hole in m/s, at the end of the last step: the speed at which a drop leaves.
    pub velocity: f64,
    /// Volume lost since it was opened.
    pub lost: Volume,
    /// Its state after the last step.
    pub state: EndState,
    /// Radius of its hole before clotting, in tissue lengths. A later cut makes a new hole.
    radius: f32,
    /// Loss during this step, in m³.
    #[cfg_attr(feature = "serialize", serde(skip))]
    lost_in_step: f64,
    /// Whether it bled before this step.
    #[cfg_attr(feature = "serialize", serde(skip))]
    bled: bool,
}

impl BleedingEnd {
    fn new(end: &NetworkEnd) -> Self {
        Self {
            node: end.node,
            side: end.side,
            along: end.along,
            age: 0.0,
            flow: Flow::ZERO,
            pressure: Pressure::ZERO,
            velocity: 0.0,
            lost: Volume::ZERO,
            state: EndState::Dry,
            radius: end.outlet.radius,
            lost_in_step: 0.0,
            bled: false,
        }
    }

    fn key(&self) -> (NodeId, EndSide) {
        (self.node, self.side)
    }

    fn is_of(&self, end: &NetworkEnd) -> bool {
        self.key() == (end.node, end.side) && self.along == end.along && self.radius == end.outlet.radius
    }
}

/// An end that began or stopped bleeding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BleedingChange {
    /// End node of the severed segment.
    pub node: NodeId,
    /// Which end of the gap.
    pub side: EndSide,
    /// Whether it bleeds now.
    pub bleeds: bool,
}

/// The bleeding of one tree.
///
/// To undo, keep a clone: it takes about a hundred bytes per open end, and holds nothing of the tree.
#[derive(Clone, Debug, Default)]
pub struct Bleeding {
    pub(super) settings: BleedingSettings,
    /// In the order of the network's open ends.
    pub(super) ends: Vec<BleedingEnd>,
    changes: Vec<BleedingChange>,
    /// Seconds since the beginning.
    pub(super) time: f64,
    /// Loss of all present and past ends, in m³.
    pub(super) lost: f64,
    /// Flow of all ends in the last part of a step, in m³/s.
    pub(super) rate: f64,
    /// The same, as a mean over the last step.
    mean_rate: f64,
}

impl Bleeding {
    /// The longest time that a step may last, in seconds: a day.
    pub const LONGEST_TIME: f64 = 86_400.0;

    /// The bleeding of a tree that has lost nothing.
    ///
    /// # Errors
    /// If a setting is outside its limits.
    pub fn new(settings: BleedingSettings) -> Result<Self, FlowError> {
        settings.validate()?;
        Ok(Self { settings, ..Self::default() })
    }

    /// Bleeds for a time. With 0 seconds, only the present rates are computed.
    ///
    /// Sets the network's root and bed pressure to those of its settings at this time, lowered by the patient's loss,
    /// and the openings of its ends. Then the open ends are solved; call [`Network::solve`] for all pressures.
    ///
    /// # Errors
    /// If the time is negative, NaN or above [`Self::LONGEST_TIME`], or the flow did not converge.
    pub fn step(&mut self, network: &mut Network, seconds: f64, blood: &mut BloodVolume) -> Result<(), FlowError> {
        let parts = self.begin(network, seconds)?;
        for _ in 0..parts {
            let mut left = seconds / f64::from(parts);
            loop {
                let mut part = left;
                self.prepare(network, part, self.rate, blood)?;
                network.solve_ends()?;
                if let Some(shorter) = blood.shorter(flow_of(network), part) {
                    part = shorter;
                    self.prepare(network, part, flow_of(network), blood)?;
                    network.solve_ends()?;
                }
                let share = blood.share_there(flow_of(network), part);
                self.collect(network, part, share, blood);
                left -= part;
                if !(left > 0.0) {
                    break;
                }
            }
        }
        self.end(seconds);
        Ok(())
    }

    /// Bleeds joined arteries and veins together: the first of the pair is the arteries'. Both networks are completely
    /// solved afterwards.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_joined(
        [arteries, veins]: [&mut Self; 2],
        circulation: &mut Circulation,
        seconds: f64,
        blood: &mut BloodVolume,
    ) -> Result<(), FlowError> {
        let parts = arteries.begin(circulation.arterial(), seconds)?.max(veins.begin(circulation.venous(), seconds)?);
        for _ in 0..parts {
            let mut left = seconds / f64::from(parts);
            loop {
                let mut part = left;
                let rate = arteries.rate + veins.rate;
                Self::solve_joined([arteries, veins], circulation, part, rate, blood)?;
                let rate = |joined: &Circulation| flow_of(joined.arterial()) + flow_of(joined.venous());
                if let Some(shorter) = blood.shorter(rate(circulation), part) {
                    part = shorter;
                    Self::solve_joined([arteries, veins], circulation, part, rate(circulation), blood)?;
                }
                let share = blood.share_there(rate(circulation), part);
                arteries.collect(circulation.arterial(), part, share, blood);
                veins.collect(circulation.venous(), part, share, blood);
                left -= part;
                if !(left > 0.0) {
                    break;
                }
            }
        }
        arteries.end(seconds);
        veins.end(seconds);
        Ok(())
    }

    fn solve_joined(
        [arteries, veins]: [&mut Self; 2],
        circulation: &mut Circulation,
        part: f64,
        rate: f64,
        blood: &BloodVolume,
    ) -> Result<(), FlowError> {
        arteries.prepare(circulation.arterial_mut(), part, rate, blood)?;
        veins.prepare(circulation.venous_mut(), part, rate, blood)?;
        circulation.solve()
    }

    /// Every open end, in the order of [`Network::open_ends`].
    pub fn ends(&self) -> &[BleedingEnd] {
        &self.ends
    }

    /// The ends that began or stopped bleeding in the last step, including ends that were closed.
    pub fn changes(&self) -> &[BleedingChange] {
        &self.changes
    }

    /// Loss of the tree through all present and past ends.
    pub fn lost(&self) -> Volume {
        Volume::from_cubic_metres(self.lost)
    }

    /// Mean flow of all ends during the last step.
    pub fn rate(&self) -> Flow {
        Flow::from_cubic_metres_per_second(self.mean_rate)
    }

    /// Seconds since the beginning.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The settings that it was made with.
    pub fn settings(&self) -> &BleedingSettings {
        &self.settings
    }

    /// The same state, to continue in another world or with other readers: bleeding ends are dry until the next step,
    /// which reports that they begin to bleed.
    #[must_use]
    pub fn resumed(mut self) -> Self {
        self.changes.clear();
        for end in self.ends.iter_mut().filter(|end| end.state == EndState::Bleeding) {
            end.state = EndState::Dry;
        }
        self
    }

    /// Begins a step: adds new ends and drops closed ones. Returns the number of parts of the step.
    fn begin(&mut self, network: &Network, seconds: f64) -> Result<u32, FlowError> {
        if !(0.0..=Self::LONGEST_TIME).contains(&seconds) {
            return Err(FlowError::Step { seconds });
        }
        self.changes.clear();
        let open = network.open_ends();
        if self.ends.len() != open.len() || !self.ends.iter().zip(open).all(|(end, open)| end.is_of(open)) {
            self.take_over(open);
        }
        for end in &mut self.ends {
            end.lost_in_step = 0.0;
            end.bled = end.state == EndState::Bleeding;
        }
        let longest = match network.settings().root {
            RootPressure::Constant(_) => f64::from(self.settings.longest_step),
            RootPressure::Pulsatile(pulse) => {
                f64::from(self.settings.longest_step).min(pulse.period() / BleedingSettings::SAMPLES_PER_BEAT)
            }
        };
        // A tiny excess over a whole number of parts is a rounding error.
        Ok(((seconds / longest * (1.0 - 1e-9)).ceil() as u32).max(1))
    }

    /// Adds new ends and drops closed ones; both lists are in the order of their segments.
    fn take_over(&mut self, open: &[NetworkEnd]) {
        let mut before = std::mem::take(&mut self.ends).into_iter().peekable();
        for end in open {
            while let Some(gone) = before.next_if(|old| old.key() < (end.node, end.side)) {
                self.close(&gone);
            }
            let kept = before.next_if(|old| old.key() == (end.node, end.side));
            match kept {
                Some(kept) if kept.is_of(end) => self.ends.push(kept),
                other => {
                    other.iter().for_each(|gone| self.close(gone));
                    self.ends.push(BleedingEnd::new(end));
                }
            }
        }
        before.for_each(|gone| self.close(&gone));
    }

    fn close(&mut self, end: &BleedingEnd) {
        if end.state == EndState::Bleeding {
            self.changes.push(BleedingChange { node: end.node, side: end.side, bleeds: false });
        }
    }

    /// Sets pressures and openings at the middle of a part of a step. `rate` is the patient's loss in m³/s.
    fn prepare(&self, network: &mut Network, part: f64, rate: f64, blood: &BloodVolume) -> Result<(), FlowError> {
        let middle = 0.5 * part;
        let left = blood.pressure_share_after(rate * middle);
        let lowered = |pressure: Pressure| Pressure::from_pascals(pressure.pascals() * left);
        network.set_bed_pressure(lowered(network.settings().bed.pressure))?;
        network.set_root_pressure(lowered(network.settings().root.at(self.time + middle)))?;
        for (index, end) in self.ends.iter().enumerate() {
            network.set_opening(index, self.opening(network, end, end.age + middle))?;
        }
        Ok(())
    }

    fn opening(&self, network: &Network, end: &BleedingEnd, age: f64) -> f64 {
        let diameter = 2.0 * network.settings().scale.to_metres(end.radius);
        self.settings.clotting.map_or(1.0, |clotting| clotting.opening(diameter, age))
    }

    /// Takes the flows of a part of a step over, once the network has solved for them. Only a `share` of the blood that
    /// would flow is there.
    fn collect(&mut self, network: &Network, part: f64, share: f64, blood: &mut BloodVolume) {
        self.rate = 0.0;
        for (end, open) in self.ends.iter_mut().zip(network.open_ends()) {
            let flow = share * open.flow().cubic_metres_per_second();
            self.rate += flow;
            end.flow = Flow::from_cubic_metres_per_second(flow);
            end.pressure = open.pressure();
            end.velocity = if flow > 0.0 { open.velocity() } else { 0.0 };
            end.lost_in_step += flow * part;
            end.age += part;
            end.state = match (flow > 0.0, open.opening > 0.0) {
                (true, _) => EndState::Bleeding,
                (false, true) => EndState::Dry,
                (false, false) => EndState::Clotted,
            };
        }
        self.time += part;
        blood.lose(Volume::from_cubic_metres(self.rate * part));
    }

    /// Ends a step: means and losses from the sums of its parts.
    fn end(&mut self, seconds: f64) {
        let mut lost = 0.0;
        for end in &mut self.ends {
            if seconds > 0.0 {
                end.flow = Flow::from_cubic_metres_per_second(end.lost_in_step / seconds);
            }
            end.lost = Volume::from_cubic_metres(end.lost.cubic_metres() + end.lost_in_step);
            lost += end.lost_in_step;
            let bleeds = end.state == EndState::Bleeding;
            if bleeds != end.bled {
                self.changes.push(BleedingChange { node: end.node, side: end.side, bleeds });
            }
        }
        self.lost += lost;
        self.mean_rate = if seconds > 0.0 { lost / seconds } else { self.rate };
    }
}

/// Flow of all open ends, in m³/s.
fn flow_of(network: &Network) -> f64 {
    network.open_ends().iter().map(|end| end.flow().cubic_metres_per_second()).sum()
}
