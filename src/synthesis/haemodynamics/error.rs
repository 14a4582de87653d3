//! Errors of the blood flow.

use crate::synthesis::tree::TreeError;
use crate::synthesis::units::ScaleError;

/// Why a network could not be made, changed or solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub enum FlowError {
    /// The tree is not well formed.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// A tissue length without a valid size.
    #[error(transparent)]
    Scale(#[from] ScaleError),
    /// A number that is infinite or NaN.
    #[error("{what} is {value}; it must be a finite number")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// The value found.
        value: f64,
    },
    /// A number that must be above zero.
    #[error("{what} is {value}; it must be finite and above 0")]
    NotPositive {
        /// Which number.
        what: &'static str,
        /// The value found.
        value: f64,
    },
    /// A haematocrit that is not a valid share.
    #[error("the haematocrit is {haematocrit}; give a share from 0 to 0.95, such as 0.45")]
    Haematocrit {
        /// The value found.
        haematocrit: f32,
    },
    /// A systolic pressure below the diastolic one.
    #[error(
        "the systolic pressure of {systolic} mmHg is below the diastolic one of {diastolic} mmHg; exchange them, or use a constant pressure"
    )]
    SystolicBelowDiastolic {
        /// The highest pressure of a beat, in mmHg.
        systolic: f64,
        /// The lowest pressure of a beat, in mmHg.
        diastolic: f64,
    },
    /// A flow that no bed gives.
    #[error(
        "{flow} mL/min are to enter the organ, but at most about {nearest} do with any bed; check the scale and the radii, \
        or ask for another flow"
    )]
    OutOfReach {
        /// The flow asked for, in mL/min.
        flow: f64,
        /// The nearest one found, in mL/min.
        nearest: f64,
    },
    /// A share outside 0 to 1.
    #[error("{what} is {value}; it must be a share from 0 to 1")]
    Share {
        /// Which number.
        what: &'static str,
        /// The value found.
        value: f64,
    },
    /// An interruption that ends before it begins.
    #[error("the interruption of the segment that ends in node {node} lasts from share {first} to {last}; order them")]
    InterruptionBackwards {
        /// The segment's end.
        node: u32,
        /// Share up to which the vessel is intact.
        first: f32,
        /// Share from which the vessel is intact again.
        last: f32,
    },
    /// A list of interruptions out of order.
    #[error("in a list of interruptions node {node} comes after node {before}; sort it by node, with each node once")]
    InterruptionsUnordered {
        /// The node that comes first.
        before: u32,
        /// The one after it, not above it.
        node: u32,
    },
    /// An interruption of a root.
    #[error("node {node} is a root, which has no segment; interrupt the segments that end in its children")]
    NoSegment {
        /// The root.
        node: u32,
    },
    /// A node that is not in the network.
    #[error("node {node} is not in this network of {nodes} nodes; update the network after its tree has grown")]
    NoSuchNode {
        /// The node.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// Joining vessels through a bed without resistance.
    #[error(
        "the bed has no resistance; give it one, that of each link, before arteries and veins are joined through it"
    )]
    BedWithoutResistance,
    /// A step of an invalid duration.
    #[error(
        "a step of {seconds} s can't be made; give a number of seconds from 0 to a day, and longer times in several steps"
    )]
    Step {
        /// The time given.
        seconds: f64,
    },
    /// An iteration that did not converge.
    #[error(
        "{what} did not converge in {passes} passes: {residual:e} of the flow is out of balance; check for resistances that differ by more than ten orders of magnitude"
    )]
    NotConverged {
        /// Which iteration.
        what: &'static str,
        /// Passes made.
        passes: usize,
        /// The remaining imbalance, relative to the flow.
        residual: f64,
    },
}

impl FlowError {
    pub(crate) fn check_finite(what: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() { Ok(()) } else { Err(Self::NotFinite { what, value }) }
    }

    pub(crate) fn check_positive(what: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() && value > 0.0 { Ok(()) } else { Err(Self::NotPositive { what, value }) }
    }

    pub(crate) fn check_share(what: &'static str, value: f64) -> Result<(), Self> {
        if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(Self::Share { what, value }) }
    }
}
