//! The bed that lets through the blood that an organ asks for.
//!
//! In: a solved network or circulation, and the flow into the whole organ, as measured. Out: the resistance of its bed.
//! Without one, the vessels alone limit the flow, and let through many times what an organ takes.
//!
//! The flow falls as the resistance rises, so halving the logarithm of a range that holds it finds the one.

use super::{Circulation, FlowError, Network};
use crate::synthesis::{
    exponential::ln,
    pace::{Pace, at_once},
    units::{Flow, Resistance},
};

/// Terminals of an organ with which the search for a resistance begins.
const MOST_TERMINALS: f64 = 1e7;
/// Factor between two resistances that are tried while the flow is too low.
const STRIDE: f64 = 4.0;
/// Such strides after which the flow counts as out of reach.
const STRIDES: u32 = 32;
/// Largest error of the resistance, as a share.
const ACCURACY: f64 = 1e-9;

impl Network {
    /// Gives the bed the resistance with which this flow enters all roots, and solves. Returns it.
    ///
    /// # Errors
    /// A flow that isn't above 0, or that the vessels don't let through at any resistance; the bed is as before then.
    pub fn fit_bed(&mut self, flow: Flow) -> Result<Resistance, FlowError> {
        at_once(self.fit_bed_paced(flow, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`fit_bed`](Self::fit_bed).
    pub async fn fit_bed_paced(&mut self, flow: Flow, pace: &Pace) -> Result<Resistance, FlowError> {
        let before = self.settings.bed.resistance;
        let mut search = Search::new(flow, self.source)?;
        while let Some(resistance) = search.trial() {
            if let Err(error) = self.set_bed_resistance(Some(resistance)) {
                self.set_bed_resistance(before)?;
                return Err(error);
            }
            search.learn(self.inflow());
            pace.rest(search.progress()).await;
        }
        if search.outcome().is_err() {
            self.set_bed_resistance(before)?;
        }
        search.outcome()
    }

    fn set_bed_resistance(&mut self, resistance: Option<Resistance>) -> Result<(), FlowError> {
        self.settings.bed.resistance = resistance;
        at_once(self.set_beds(&Pace::default()));
        self.solve()
    }
}

impl Circulation {
    /// Gives the bed the resistance with which this flow enters all arterial roots, and solves. Returns it.
    ///
    /// # Errors
    /// As [`Network::fit_bed`], and an iteration that did not converge.
    pub fn fit_bed(&mut self, flow: Flow) -> Result<Resistance, FlowError> {
        at_once(self.fit_bed_paced(flow, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`fit_bed`](Self::fit_bed).
    pub async fn fit_bed_paced(&mut self, flow: Flow, pace: &Pace) -> Result<Resistance, FlowError> {
        let before = self.bed_resistance();
        let mut search = Search::new(flow, self.arterial().source)?;
        while let Some(resistance) = search.trial() {
            if let Err(error) = self.set_bed_resistance(resistance) {
                self.set_bed_resistance(before)?;
                return Err(error);
            }
            search.learn(self.arterial().inflow());
            pace.rest(search.progress()).await;
        }
        if search.outcome().is_err() {
            self.set_bed_resistance(before)?;
        }
        search.outcome()
    }
}

/// A search for the resistance that gives a flow, which falls as the resistance rises.
struct Search {
    /// The wanted flow, and the one at `low`, in m³/s.
    wanted: f64,
    most: f64,
    /// The resistance is between these, once the flow at `low` is enough.
    low: f64,
    high: f64,
    trial: Option<f64>,
    /// Strides that are left, down from a resistance that is too high.
    strides: u32,
}

impl Search {
    /// From above, since joined trees are harder to solve the less the bed resists. The first trial is far more than a
    /// bed of a million terminals needs. `drop` is the pressure between roots and bed.
    fn new(flow: Flow, drop: f64) -> Result<Self, FlowError> {
        let wanted = flow.cubic_metres_per_second();
        FlowError::check_positive("the flow into the organ in mL/min", flow.ml_per_min())?;
        let high = MOST_TERMINALS * (drop.abs() / wanted).max(f64::MIN_POSITIVE);
        Ok(Self { wanted, most: 0.0, low: high, high, trial: Some(high), strides: STRIDES })
    }

    /// The resistance to try next; `None` at the end.
    fn trial(&self) -> Option<Resistance> {
        self.trial.map(Resistance::from_pascal_seconds_per_cubic_metre)
    }

    /// Takes note of the flow at the trial, and chooses the next one.
    fn learn(&mut self, inflow: Flow) {
        let Some(tried) = self.trial else { return };
        let inflow = inflow.cubic_metres_per_second();
        if !self.has_enough() {
            (self.low, self.most) = (tried, inflow);
            if !self.has_enough() {
                self.trial = (self.strides > 0).then_some(tried / STRIDE);
                self.strides = self.strides.saturating_sub(1);
                self.high = tried;
                return;
            }
        } else if tried == self.high {
            // The resistance that was found has been set.
            self.trial = None;
            return;
        } else if inflow < self.wanted {
            self.high = tried;
        } else {
            self.low = tried;
        }
        let is_found = self.high <= self.low * (1.0 + ACCURACY);
        self.trial = Some(if is_found { self.high } else { (self.low * self.high).sqrt() });
    }

    /// Whether the vessels let through enough at the lowest resistance so far.
    fn has_enough(&self) -> bool {
        self.most >= self.wanted
    }

    /// Share of the search that is done, from 0 to 1: each trial halves what is left.
    fn progress(&self) -> f32 {
        if !self.has_enough() {
            return 0.0;
        }
        let left = (self.high / self.low - 1.0).clamp(ACCURACY, STRIDE);
        (1.0 - ln(left / ACCURACY) / ln(STRIDE / ACCURACY)) as f32
    }

    /// The resistance, or the reason why there is none.
    fn outcome(&self) -> Result<Resistance, FlowError> {
        if self.has_enough() {
            return Ok(Resistance::from_pascal_seconds_per_cubic_metre(self.high));
        }
        let [flow, nearest] =
            [self.wanted, self.most].map(|flow| Flow::from_cubic_metres_per_second(flow).ml_per_min());
        Err(FlowError::OutOfReach { flow, nearest })
    }
}
