//! Reduced sums of a subtree: what an insertion needs to know of it.
//!
//! OpenCCO keeps for each segment i its reduced resistance R*ᵢ (Eq. 6) and the ratios β of its children (Eq. 3 and 4).
//! With the product Xᵢ = fᵢ·R*ᵢ of flow and reduced resistance, both become simple. Xᵢ^¼ is the radius that the segment
//! has if blood loses one unit of pressure on the way through its subtree. Children lose the same pressure, so their
//! radii at a bifurcation are in the ratio of their X^¼ (Eq. 4), and by Murray's law
//!
//! - Yᵢ = (`X_a^(γ/4)` + `X_b^(γ/4))^(4/γ`) is what the bifurcation below the segment adds,
//! - Xᵢ = fᵢ·lᵢ + Yᵢ,
//! - `β_a = (X_a / Yᵢ)^¼`.
//!
//! The volume of the subtree over π at this loss of pressure is `Wᵢ = √Xᵢ·(lᵢ + (W_a + W_b)/√Yᵢ)`. So a changed segment
//! changes two numbers in each segment on its path to the root, and the tree is never copied.
//!
//! Flows are in numbers of terminals, lengths in tissue lengths.

use super::power::Exponent;

/// The sums of a segment with all below it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sums {
    /// X: flow times reduced resistance.
    pub load: f64,
    /// X^(γ/4), which adds up at a bifurcation.
    pub power: f64,
    /// W: volume over π at a pressure loss of 1.
    pub volume: f64,
}

/// The sums of all below a segment, without itself; zero for a terminal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Below {
    /// Y: what it adds to the load.
    pub load: f64,
    /// Y^(γ/4).
    pub power: f64,
    /// Volume over π·r², where r is the segment's radius.
    pub span: f64,
}

impl Below {
    /// Two children of one segment.
    pub(super) fn join(a: &Sums, b: &Sums, exponent: Exponent) -> Self {
        let power = a.power + b.power;
        let load = exponent.fourth(power);
        Self { load, power, span: (a.volume + b.volume) / load.sqrt() }
    }
}

impl Sums {
    /// A segment with this flow and length over what is below it.
    pub(super) fn of(flow: f64, length: f64, below: &Below, exponent: Exponent) -> Self {
        let load = flow * length + below.load;
        let square = load.sqrt();
        Self { load, power: exponent.raise(load, square), volume: square * (length + below.span) }
    }
}

/// How the volume of the whole tree depends on the sums of one of its segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slope {
    /// Its derivative by the load.
    pub load: f64,
    /// Its derivative by the volume.
    pub volume: f64,
    /// How the root's load depends on the segment's.
    root_load: f64,
}

impl Slope {
    /// That of a root segment: the tree's volume is its own.
    pub(super) const ROOT: Self = Self { load: 0.0, volume: 1.0, root_load: 1.0 };

    /// Carries the slope of a child up to its parent, while a walk goes from the child to the root.
    pub(super) fn rise(&mut self, child: &Sums, below: &Below, parent: &Sums) {
        let load = below.load / below.power * child.power / child.load;
        let volume = (parent.load / below.load).sqrt();
        self.load = load * below_slope(below, parent) * self.root_load + volume * self.load;
        self.volume *= volume;
        self.root_load *= load;
    }

    /// The slope of the whole way, where `self` is that of the lower part and `above` that of the upper one.
    pub(super) fn then(&self, above: &Self) -> Self {
        Self {
            load: above.load * self.root_load + above.volume * self.load,
            volume: above.volume * self.volume,
            root_load: above.root_load * self.root_load,
        }
    }

    /// The slope of the upper part, where `self` is that of the whole way and `below` that of the lower part.
    pub(super) fn without(&self, below: &Self) -> Self {
        let volume = self.volume / below.volume;
        let load = (self.load - volume * below.load) / below.root_load;
        Self { load, volume, root_load: self.root_load / below.root_load }
    }
}

/// Derivative of a segment's volume by the load of what is below it, at constant volumes of the children.
pub(super) fn below_slope(below: &Below, segment: &Sums) -> f64 {
    0.5 * (segment.volume / segment.load - segment.load.sqrt() * below.span / below.load)
}
