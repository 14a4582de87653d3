//! The bleeding of one tree: its open ends and what they have lost.

use super::{BleedingChange, BleedingEnd, BleedingSettings, EndState};
use crate::synthesis::{
    haemodynamics::{FlowError, Network, NetworkEnd, RootPressure},
    units::{Flow, Volume},
};

/// The bleeding of one tree.
///
/// To undo, keep a clone: it takes about a hundred bytes per open end, and holds nothing of the tree.
#[derive(Clone, Debug, Default)]
pub struct Bleeding {
    pub(in crate::synthesis::haemodynamics) settings: BleedingSettings,
    /// In the order of the network's open ends.
    pub(in crate::synthesis::haemodynamics) ends: Vec<BleedingEnd>,
    changes: Vec<BleedingChange>,
    /// Seconds since the beginning.
    pub(in crate::synthesis::haemodynamics) time: f64,
    /// Loss of all present and past ends, in m³.
    pub(in crate::synthesis::haemodynamics) lost: f64,
    /// Flow of all ends in the last part of a step, in m³/s.
    pub(in crate::synthesis::haemodynamics) rate: f64,
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
    pub(super) fn begin(&mut self, network: &Network, seconds: f64) -> Result<u32, FlowError> {
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

    /// Ends a step: means and losses from the sums of its parts.
    pub(super) fn end(&mut self, seconds: f64) {
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
