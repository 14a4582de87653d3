//! Schedules the measurements of an organ's supply.

use crate::plugin::{
    circulation::{
        messages::CirculationError,
        organ_flow::{Measured, SupplyGauge},
    },
    job::{Job, JobPanic},
};
use crate::synthesis::haemodynamics::FlowError;

/// A gauge with its measurement.
pub(super) type Outcome = Result<(Box<SupplyGauge>, Measured), FlowError>;

/// Schedules the measurements of an organ's supply.
#[derive(Debug, Default)]
pub(crate) struct Gauge {
    /// `None` before the first measurement, and while the job owns it.
    gauge: Option<Box<SupplyGauge>>,
    pub(super) job: Option<Job<Outcome>>,
    /// Whether the organ's vessels have grown, so that there is something to measure.
    pub(super) is_ready: bool,
    /// Whether the vessels were operated on since the last measurement.
    is_due: bool,
    /// Seconds since the last measurement.
    age: f64,
    /// Whether blood was lost since then.
    bled: bool,
    /// [`Perfusion::ischaemic_below`](crate::plugin::Perfusion::ischaemic_below) when it was measured.
    ischaemic_below: f32,
}

impl Gauge {
    /// A gauge that is to measure as soon as possible.
    pub(crate) fn ready() -> Self {
        Self { is_ready: true, is_due: true, ..Self::default() }
    }

    /// Demands a measurement after an action.
    pub(crate) fn demand(&mut self) {
        self.is_due = true;
    }

    /// Adds time that has passed.
    pub(crate) fn pass(&mut self, seconds: f64, bled: bool) {
        self.age += seconds;
        self.bled |= bled;
    }

    pub(super) fn is_to_begin(&self, interval: f32, ischaemic_below: f32) -> bool {
        let is_old = self.bled && self.age >= f64::from(interval);
        let is_other = self.ischaemic_below.to_bits() != ischaemic_below.to_bits();
        self.is_ready && self.job.is_none() && (self.is_due || is_old || is_other)
    }

    /// Hands out the gauge, and restarts the count.
    pub(super) fn begin(&mut self, ischaemic_below: f32) -> Option<Box<SupplyGauge>> {
        let gauge = self.gauge.take();
        *self = Self { is_ready: true, ischaemic_below, ..Self::default() };
        gauge
    }

    /// Returns the measurement, and keeps the gauge.
    pub(super) fn accept(&mut self, outcome: Result<Outcome, JobPanic>) -> Result<Measured, CirculationError> {
        let (gauge, measured) = outcome??;
        self.gauge = Some(gauge);
        Ok(measured)
    }
}
