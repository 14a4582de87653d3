//! Powers of positive numbers in f64, with the same bits on every platform.
//!
//! The standard library's `cbrt` and `powf` differ between platforms.

use crate::synthesis::exponential::{exp, ln};

/// The cube root of a positive, normal number, to two units in the last place.
pub(super) fn cube_root(x: f64) -> f64 {
    // A third of the exponent, which is within 4 %; each of Halley's steps cubes the error.
    let mut root = f64::from_bits(x.to_bits() / 3 + 0x2A9F_7893_0000_0000);
    for _ in 0..3 {
        let cube = root * root * root;
        root *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    root
}

/// Powers of a bifurcation exponent γ: r ↔ r^γ, where r is known by its fourth power.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exponent {
    /// γ, or `None` for 3, whose powers need no logarithm.
    other: Option<f64>,
}

impl Exponent {
    pub(super) fn new(gamma: f64) -> Self {
        Self { other: (gamma != 3.0).then_some(gamma) }
    }

    /// r^γ from r⁴ and r².
    pub(super) fn raise(self, fourth: f64, square: f64) -> f64 {
        match self.other {
            None => square * square.sqrt(),
            Some(gamma) => exp(ln(fourth) * (gamma / 4.0)),
        }
    }

    /// r⁴ from r^γ.
    pub(super) fn fourth(self, power: f64) -> f64 {
        match self.other {
            None => power * cube_root(power),
            Some(gamma) => exp(ln(power) * (4.0 / gamma)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_agree_with_the_platforms_own() {
        let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-14 * b.abs() * (1.0 + b.abs().ln().abs()), "{a} {b}");
        let mut x = 1e-12;
        while x < 1e15 {
            close(cube_root(x), x.cbrt());
            for gamma in [2.0, 2.55, 3.0, 4.0] {
                let exponent = Exponent::new(gamma);
                close(exponent.raise(x, x.sqrt()), x.powf(gamma / 4.0));
                close(exponent.fourth(x), x.powf(4.0 / gamma));
            }
            x *= 1.37;
        }
    }
}
