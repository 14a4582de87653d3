//! Integrals of the normal distribution.

use std::f32::consts::{LN_2, LOG2_E};

/// Standard deviations beyond which an edge is not seen: 1 − Φ is below 1.4e-3 there, a tenth of a level of 8 bits for
/// a vessel with a quarter of the contrast.
pub(super) const SEEN: f32 = 3.0;
/// Standard deviations beyond which the distribution is as at this one: 1 − Φ is 1e-9 there.
const REACH: f32 = 6.0;
/// Sums with it are rounded to whole numbers, which are their lowest bits.
const ROUNDING: f32 = 12_582_912.0;
/// (ln 2)ⁿ/n!: the series of 2^x.
const POWERS: [f32; 7] = [1.0, LN_2, 0.240_226_5, 0.055_504_11, 0.009_618_129, 0.001_333_355_8, 0.000_154_035_3];
/// Abramowitz & Stegun, "Handbook of Mathematical Functions" (1964), 26.2.17.
const TAIL: [f32; 5] = [0.319_381_53, -0.356_563_78, 1.781_477_9, -1.821_255_9, 1.330_274_5];
const TAIL_SCALE: f32 = 0.231_641_9;
/// 1/√(2π).
const PEAK: f32 = 0.398_942_3;

/// Φ(x) and its derivative φ(x). Φ is off by less than 5e-7.
///
/// Without branches, so that a loop over points works on several at a time, and from the basic operations alone, so
/// that it has the same bits everywhere.
#[inline(always)]
pub(super) fn gauss(x: f32) -> [f32; 2] {
    let far = if x.abs() < REACH { x.abs() } else { REACH };
    // 2^y with y = −x²/2 · log₂ e, in a whole part and one of at most ½.
    let y = -0.5 * LOG2_E * far * far;
    let rounded = y + ROUNDING;
    let rest = y - (rounded - ROUNDING);
    let whole = f32::from_bits((rounded.to_bits() << 23).wrapping_add(1.0f32.to_bits()));
    let [a, b, c, d, e, f, g] = POWERS;
    let power = a + rest * (b + rest * (c + rest * (d + rest * (e + rest * (f + rest * g)))));
    let density = PEAK * whole * power;
    let t = 1.0 / (1.0 + TAIL_SCALE * far);
    let [a, b, c, d, e] = TAIL;
    let tail = density * t * (a + t * (b + t * (c + t * (d + t * e))));
    [if x < 0.0 { tail } else { 1.0 - tail }, density]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::exponential::exp;

    #[test]
    fn values_are_those_of_published_tables() {
        // Abramowitz & Stegun, table 26.1.
        for (x, cumulative, density) in [
            (0.0, 0.5, 0.398_942_3),
            (0.5, 0.691_462_46, 0.352_065_33),
            (1.0, 0.841_344_8, 0.241_970_72),
            (1.96, 0.975_002_1, 0.058_440_94),
            (3.0, 0.998_650_1, 0.004_431_848),
        ] {
            let ([up, slope], [down, same]) = (gauss(x), gauss(-x));
            assert!((up - cumulative).abs() < 5e-7 && (down - (1.0 - cumulative)).abs() < 5e-7, "at {x}: {up}, {down}");
            assert!((slope - density).abs() < 1e-6 && (same - density).abs() < 1e-6, "at {x}: {slope}, {same}");
        }
        for x in [-9.0, f32::NEG_INFINITY] {
            let ([low, _], [high, _]) = (gauss(x), gauss(-x));
            assert!(low < 2e-9 && high == 1.0);
        }
    }

    #[test]
    fn the_density_is_the_derivative_everywhere() {
        let (mut sum, step) = (0.0f64, 1.0 / 256.0);
        for i in -1536..1536 {
            let x = (f64::from(i) + 0.5) * step;
            let exact = exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
            let [below, density] = gauss(x as f32);
            // The exponent is rounded to 24 bits, and is up to 26.
            assert!((f64::from(density) - exact).abs() < 1e-6 * exact.max(1e-3), "at {x}");
            assert!((f64::from(below) - sum - 0.5 * step * exact).abs() < 3e-6, "at {x}");
            sum += step * exact;
        }
    }
}
