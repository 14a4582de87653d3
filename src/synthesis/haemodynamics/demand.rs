//! The bed that lets through the blood that an organ asks for.
//!
//! In: a solved network or circulation, and the flow into the whole organ, as measured. Out: the resistance of its bed.
//! Without one, the vessels alone limit the flow, and let through many times what an organ takes.
//!
//! The flow falls as the resistance rises, so halving the logarithm of a range that holds it finds the one.

use super::{Circulation, FlowError, Network};
use crate::synthesis::{
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
        let before = self.settings.bed.resistance;
        let fitted = fit(flow, self.source, |resistance| {
            self.set_bed_resistance(Some(resistance))?;
            Ok(self.inflow())
        });
        if fitted.is_err() {
            self.set_bed_resistance(before)?;
        }
        fitted
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
        let before = self.bed_resistance();
        let fitted = fit(flow, self.arterial().source, |resistance| {
            self.set_bed_resistance(resistance)?;
            Ok(self.arterial().inflow())
        });
        if fitted.is_err() {
            self.set_bed_resistance(before)?;
        }
        fitted
    }
}

/// The resistance at which `inflow` gives a flow, that falls as the resistance rises. `drop` is the pressure between
/// roots and bed.
fn fit(
    flow: Flow,
    drop: f64,
    mut inflow: impl FnMut(Resistance) -> Result<Flow, FlowError>,
) -> Result<Resistance, FlowError> {
    let wanted = flow.cubic_metres_per_second();
    FlowError::check_positive("the flow into the organ in mL/min", flow.ml_per_min())?;
    let mut at = |resistance: f64| {
        let resistance = Resistance::from_pascal_seconds_per_cubic_metre(resistance);
        inflow(resistance).map(Flow::cubic_metres_per_second)
    };
    // From above, since joined trees are harder to solve the less the bed resists. The first is far more than a bed of a
    // million terminals needs.
    let mut high = MOST_TERMINALS * (drop.abs() / wanted).max(f64::MIN_POSITIVE);
    let mut low = high;
    let mut most = at(low)?;
    for _ in 0..STRIDES {
        if most >= wanted {
            break;
        }
        (low, high) = (low / STRIDE, low);
        most = at(low)?;
    }
    if !(most >= wanted) {
        let most = Flow::from_cubic_metres_per_second(most).ml_per_min();
        return Err(FlowError::OutOfReach { flow: flow.ml_per_min(), nearest: most });
    }
    while high > low * (1.0 + ACCURACY) {
        let middle = (low * high).sqrt();
        if at(middle)? < wanted {
            high = middle;
        } else {
            low = middle;
        }
    }
    at(high)?;
    Ok(Resistance::from_pascal_seconds_per_cubic_metre(high))
}
