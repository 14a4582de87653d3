//! Exponential and logarithm of `f64`, with the same bits on every platform.
//!
//! `bevy_math::ops` has them only for `f32`, and std's differ between platforms. These use the four basic operations
//! and bits, which are exact everywhere. Their error is a few units in the last place.

use bevy_math::ops;

/// e^x. Overflows to infinity above 709 and falls to 0 below −708.
pub(crate) fn exp(x: f64) -> f64 {
    if !(x < 709.0) {
        return if x.is_nan() { x } else { f64::INFINITY };
    }
    if x < -708.0 {
        return 0.0;
    }
    // e^x = 2^k · e^r with |r| ≤ ln 2 / 2; ln 2 in two parts, so that k·ln 2 loses no accuracy.
    const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let k = (x * std::f64::consts::LOG2_E).round();
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let power = f64::from_bits(((k as i64 + 1023) as u64) << 52);
    power * (1.0 + small_exp_m1(r))
}

/// e^x − 1, accurate near 0, too.
pub(crate) fn exp_m1(x: f64) -> f64 {
    if x.abs() < 0.35 { small_exp_m1(x) } else { exp(x) - 1.0 }
}

/// e^x − 1 for |x| ≤ 0.35, by its series: Σ xⁿ/n!.
fn small_exp_m1(x: f64) -> f64 {
    x * INVERSE_FACTORIALS.iter().rev().fold(0.0, |sum, coefficient| coefficient + x * sum)
}

/// 1/n! from n = 1.
const INVERSE_FACTORIALS: [f64; 14] = {
    let mut inverses = [1.0; 14];
    let (mut n, mut factorial) = (1, 1.0);
    while n < 14 {
        factorial *= (n + 1) as f64;
        inverses[n] = 1.0 / factorial;
        n += 1;
    }
    inverses
};

/// The natural logarithm of a positive number within the range of `f32`.
pub(crate) fn ln(x: f64) -> f64 {
    let guess = f64::from(ops::ln(x as f32));
    // One step of Halley's method, from 7 digits to all of them.
    let y = exp(guess);
    guess + 2.0 * (x - y) / (x + y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_agree_with_std() {
        for i in -70_000..=70_000 {
            let x = f64::from(i) * 0.01;
            let expected = x.exp();
            assert!((exp(x) - expected).abs() <= 4e-16 * expected.max(f64::MIN_POSITIVE), "e^{x}");
            let small = x * 1e-3;
            assert!((exp_m1(small) - small.exp_m1()).abs() <= 1e-15 * small.exp_m1().abs(), "e^{small} − 1");
        }
        for i in 1..100_000 {
            let x = f64::from(i) * 0.013;
            assert!((ln(x) - x.ln()).abs() <= 4e-16 * x.ln().abs().max(1.0), "ln {x}");
        }
    }

    #[test]
    fn extremes_do_not_wrap() {
        assert_eq!(exp(1e9), f64::INFINITY);
        assert_eq!(exp(-1e9), 0.0);
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(f64::NAN).is_nan());
        assert!(exp(708.9).is_finite());
    }
}
