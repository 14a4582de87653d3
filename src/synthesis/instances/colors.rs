//! Colours of segments: that of their kind, a ramp by radius, age or Strahler order, or that of their kind faded by
//! supply.

use crate::synthesis::tree::VesselTree;
use bevy_math::ops;
use std::{ops::Range, sync::LazyLock};

/// Colours of segments.
///
/// The three ramps cover a scale that widens in steps as the tree grows. Call [`refresh`](Self::refresh) after every
/// change of the tree: it keeps the scale wide enough and returns which colours changed besides those of the changed
/// nodes.
#[derive(Clone, Debug, PartialEq)]
pub enum SegmentColors {
    /// One colour for all, linear sRGB.
    Uniform([f32; 3]),
    /// By radius, logarithmically: doubling the radius is the same distance on the ramp at any size.
    Radius {
        /// Radius of the first colour, tissue lengths. 0: not known yet.
        thinnest: f32,
        /// Radius of the last colour, tissue lengths.
        widest: f32,
    },
    /// By the step of birth: the oldest segments dark, the youngest bright.
    Age {
        /// Step of the last colour.
        span: u32,
    },
    /// By Strahler order, in [`Self::STRAHLER_LEVELS`] fixed steps: terminals dark, the trunk bright.
    Strahler {
        /// Order of every node, from 1.
        orders: Vec<u32>,
    },
    /// By supply: full colour where a segment carries all its blood, pale where it carries none.
    Supply {
        /// Colour of full supply, linear sRGB.
        full: [f32; 3],
        /// Supply of every node, from 0 to [`Self::SUPPLY_LEVELS`]. Nodes beyond the end are supplied.
        levels: Vec<u32>,
    },
}

impl SegmentColors {
    /// Number of orders with different colours; higher ones share the last. Grown trees have 6 to 9.
    pub const STRAHLER_LEVELS: u32 = 9;

    /// Number of supply levels with different colours. More would look no better, and rewrite segments with every
    /// heartbeat.
    pub const SUPPLY_LEVELS: u32 = 32;

    /// Colour of a vessel without blood, linear sRGB: that of the wall alone.
    pub const BLOODLESS: [f32; 3] = [0.52, 0.46, 0.42];

    /// Colours by radius, before the first refresh.
    pub const RADIUS: Self = Self::Radius { thinnest: 0.0, widest: 0.0 };

    /// Colours by age, before the first refresh.
    pub const AGE: Self = Self::Age { span: 0 };

    /// Colours by Strahler order, before the first refresh.
    pub const STRAHLER: Self = Self::Strahler { orders: Vec::new() };

    /// Updates the colours after the nodes in `changed` were added or changed.
    ///
    /// Returns further ranges of nodes whose colour changed. Radius and age scales widen by at least a quarter (an
    /// octave, for radii) at a time, so all colours change only a few times in a growth.
    pub fn refresh(
        &mut self,
        tree: &VesselTree,
        birth_steps: &[u32],
        changed: impl IntoIterator<Item = Range<usize>>,
    ) -> Vec<Range<usize>> {
        let whole = 0..tree.len();
        match self {
            Self::Uniform(_) | Self::Supply { .. } => Vec::new(),
            Self::Radius { thinnest, widest } => {
                let radii = changed.into_iter().flat_map(|range| &tree.radii()[range]);
                if widen_radii(thinnest, widest, radii) { vec![whole] } else { Vec::new() }
            }
            Self::Age { span } => {
                let last = changed.into_iter().flat_map(|range| birth_steps.get(range)).flatten().max();
                match last {
                    Some(&last) if last > *span => {
                        *span = last + last.div_ceil(4);
                        vec![whole]
                    }
                    _ => Vec::new(),
                }
            }
            Self::Strahler { orders } => {
                let new = tree.strahler_orders();
                let ranges = differing_ranges(orders, &new);
                *orders = new;
                ranges
            }
        }
    }

    /// Sets the supply of every node, from 0 to 1, if colours follow supply. Nodes beyond the end of `supply` count as
    /// supplied.
    ///
    /// Returns ranges of nodes whose colour changed. A supply that fluctuates at the limit between two levels changes
    /// nothing.
    pub fn set_supply(&mut self, supply: &[f32]) -> Vec<Range<usize>> {
        let Self::Supply { levels, .. } = self else { return Vec::new() };
        let all = Self::SUPPLY_LEVELS;
        let known = levels.iter().copied().chain(std::iter::repeat(all));
        let level = |(&supply, known): (&f32, u32)| {
            let exact = supply.clamp(0.0, 1.0) * all as f32;
            // `as` turns NaN into 0
            if (exact - known as f32).abs() <= Self::SUPPLY_REST { known } else { (exact + 0.5) as u32 }
        };
        let mut new: Vec<u32> = supply.iter().zip(known).map(level).collect();
        let len = new.len().max(levels.len());
        new.resize(len, all);
        levels.resize(len, all);
        let ranges = differing_ranges(levels, &new);
        *levels = new;
        ranges
    }

    /// Distance of a supply from its level at which the level changes, in levels.
    const SUPPLY_REST: f32 = 0.75;

    /// Linear sRGB of one segment.
    pub fn color(&self, radius: f32, birth: u32, node: usize) -> [f32; 3] {
        match self {
            Self::Uniform(color) => *color,
            Self::Radius { thinnest, widest } => {
                ramp_color(ops::ln(radius / thinnest.max(f32::MIN_POSITIVE)) / ops::ln(widest / thinnest))
            }
            Self::Age { span } => ramp_color(birth as f32 / (*span).max(1) as f32),
            Self::Strahler { orders } => {
                let order = orders.get(node).copied().unwrap_or(1);
                ramp_color(order.saturating_sub(1) as f32 / (Self::STRAHLER_LEVELS - 1) as f32)
            }
            Self::Supply { full, levels } => {
                let level = levels.get(node).copied().unwrap_or(Self::SUPPLY_LEVELS);
                let share = level as f32 / Self::SUPPLY_LEVELS as f32;
                std::array::from_fn(|i| Self::BLOODLESS[i] + (full[i] - Self::BLOODLESS[i]) * share)
            }
        }
    }
}

/// Widens the scale to whole octaves around the radii. Returns whether that was necessary.
fn widen_radii<'a>(thinnest: &mut f32, widest: &mut f32, radii: impl Iterator<Item = &'a f32>) -> bool {
    let (low, high) = radii
        .filter(|radius| radius.is_normal() && **radius > 0.0)
        .fold((f32::INFINITY, 0.0f32), |(low, high), &radius| (low.min(radius), high.max(radius)));
    if high == 0.0 || (*thinnest > 0.0 && low >= *thinnest && high <= *widest) {
        return false;
    }
    let known = *thinnest > 0.0;
    let low = if known { low.min(*thinnest) } else { low };
    let high = if known { high.max(*widest) } else { high };
    *thinnest = ops::exp2(ops::log2(low).floor());
    *widest = ops::exp2(ops::log2(high).ceil()).max(2.0 * *thinnest);
    true
}

/// Runs of indices at which `new` differs from `old`, up to the end of `old`.
fn differing_ranges(old: &[u32], new: &[u32]) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (i, _) in old.iter().zip(new).enumerate().filter(|(_, (a, b))| a != b) {
        match ranges.last_mut() {
            Some(last) if last.end == i => last.end = i + 1,
            _ => ranges.push(i..i + 1),
        }
    }
    ranges
}

const RAMP_LENGTH: usize = 256;

/// The ramp from dark violet by teal to light yellow, at `t` from 0 to 1, linear sRGB. Outside: the nearer end. NaN:
/// the first colour.
///
/// A curve of constant speed in Oklab (Ottosson 2020): lightness rises and hue turns evenly at constant chroma, so
/// equal steps of `t` look equally far apart. Lightness keeps the order in grey and for colour-blind viewers. The hues
/// differ from those of flesh.
pub fn ramp_color(t: f32) -> [f32; 3] {
    static RAMP: LazyLock<[[f32; 3]; RAMP_LENGTH]> =
        LazyLock::new(|| std::array::from_fn(|i| linear_srgb(oklab_on_ramp(i as f32 / (RAMP_LENGTH - 1) as f32))));
    let last = (RAMP_LENGTH - 1) as f32;
    // `as` turns NaN into 0
    RAMP[(t.clamp(0.0, 1.0) * last + 0.5) as usize]
}

/// Oklab lightness, green–red and blue–yellow coordinates on the ramp.
fn oklab_on_ramp(t: f32) -> [f32; 3] {
    const LIGHTNESS: [f32; 2] = [0.40, 0.88];
    const HUE_DEGREES: [f32; 2] = [300.0, 105.0];
    const CHROMA: f32 = 0.105;
    let between = |ends: [f32; 2]| ends[0] + t * (ends[1] - ends[0]);
    let (sin, cos) = ops::sin_cos(between(HUE_DEGREES).to_radians());
    [between(LIGHTNESS), CHROMA * cos, CHROMA * sin]
}

/// Oklab to linear sRGB, by the matrices of Ottosson, "A perceptual color space for image processing", 2020.
fn linear_srgb([lightness, a, b]: [f32; 3]) -> [f32; 3] {
    let cube = |x: f32| x * x * x;
    let l = cube(lightness + 0.396_337_78 * a + 0.215_803_76 * b);
    let m = cube(lightness - 0.105_561_346 * a - 0.063_854_17 * b);
    let s = cube(lightness - 0.089_484_18 * a - 1.291_485_5 * b);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_93 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_4 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::tree::NO_PARENT;
    use bevy_math::Vec3;

    fn luminance([r, g, b]: [f32; 3]) -> f32 {
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    /// A tree on a line with the given parents and radii.
    fn tree(parents: &[u32], radii: &[f32]) -> VesselTree {
        let positions = (0..parents.len()).map(|i| Vec3::new(i as f32, (i * i) as f32, 0.0)).collect();
        VesselTree::from_arrays(positions, parents.to_vec(), radii.to_vec()).unwrap()
    }

    #[test]
    fn ramp_is_displayable_even_and_rises() {
        let step = |i: usize| {
            let [p, q] = [i, i + 1].map(|i| oklab_on_ramp(i as f32 / (RAMP_LENGTH - 1) as f32));
            p.iter().zip(q).map(|(p, q)| (p - q) * (p - q)).sum::<f32>().sqrt()
        };
        for i in 0..RAMP_LENGTH - 1 {
            let t = i as f32 / (RAMP_LENGTH - 1) as f32;
            let (here, next) = (ramp_color(t), ramp_color(t + 1.0 / (RAMP_LENGTH - 1) as f32));
            assert!(here.iter().all(|c| (0.0..=1.0).contains(c)), "{here:?} at {t} is outside sRGB");
            assert!(luminance(next) > luminance(here), "order is lost in grey at {t}");
            assert!((step(i) / step(0) - 1.0).abs() < 0.01);
        }
        assert_eq!(ramp_color(-3.0), ramp_color(0.0));
        assert_eq!(ramp_color(7.0), ramp_color(1.0));
        assert_eq!(ramp_color(f32::NAN), ramp_color(0.0));
    }

    #[test]
    fn strahler_reports_ancestors_that_rose() {
        let mut colors = SegmentColors::STRAHLER;
        colors.refresh(&tree(&[NO_PARENT, 0, 1], &[1.0; 3]), &[], [0..3]);
        let grown = tree(&[NO_PARENT, 0, 1, 1], &[1.0; 4]);
        assert_eq!(colors.refresh(&grown, &[], [3..4]), [0..2]);
        assert!(colors.refresh(&grown, &[], []).is_empty());
        assert_ne!(colors.color(1.0, 0, 1), colors.color(1.0, 0, 3));
    }

    #[test]
    fn radius_scale_is_logarithmic_and_widens_by_octaves() {
        let mut colors = SegmentColors::RADIUS;
        let parents = [NO_PARENT, 0, 1, 2, 3];
        let radii = [0.09, 0.07, 0.04, 0.02, 0.01];
        let grown = tree(&parents, &radii);
        assert_eq!(colors.refresh(&grown, &[], [0..5]), [0..5]);
        assert_eq!(colors, SegmentColors::Radius { thinnest: 0.007_812_5, widest: 0.125 });
        assert!(colors.refresh(&grown, &[], [0..5]).is_empty(), "the scale is wide enough");
        let shades: Vec<f32> = radii.iter().map(|&r| luminance(colors.color(r, 0, 0))).collect();
        assert!(shades.is_sorted_by(|a, b| a > b), "{shades:?}");
        assert_eq!(colors.color(0.031_25, 0, 0), ramp_color(0.5), "half way in octaves");

        let wide = tree(&parents, &[0.2, 0.07, 0.04, 0.02, 0.01]);
        assert_eq!(colors.refresh(&wide, &[], [0..1]), [0..5]);
        assert_eq!(colors, SegmentColors::Radius { thinnest: 0.007_812_5, widest: 0.25 });
        assert!(colors.color(0.0, 0, 0).iter().all(|c| c.is_finite()), "a zero radius gets the first colour");
    }

    #[test]
    fn equal_radii_and_unseen_trees_have_a_colour() {
        let mut colors = SegmentColors::RADIUS;
        assert!(colors.color(0.1, 0, 0).iter().all(|c| c.is_finite()));
        colors.refresh(&tree(&[NO_PARENT, 0], &[0.25, 0.25]), &[], [0..2]);
        assert_eq!(colors.color(0.25, 0, 0), ramp_color(0.0));
        assert_eq!(SegmentColors::AGE.color(0.1, 0, 0), ramp_color(0.0));
        assert_eq!(SegmentColors::STRAHLER.color(0.1, 0, 9), ramp_color(0.0));
    }

    #[test]
    fn supply_blanches_in_steps_that_rest() {
        let full = [0.3, 0.0, 0.0];
        let mut colors = SegmentColors::Supply { full, levels: Vec::new() };
        assert_eq!(colors.color(1.0, 0, 7), full, "what nothing is known of is supplied");
        assert!(colors.set_supply(&[1.0; 6]).is_empty());
        assert_eq!(colors.set_supply(&[1.0, 0.5, 0.0, 1.0, 0.25]), [1..3, 4..5]);
        assert_eq!((colors.color(1.0, 0, 2), colors.color(1.0, 0, 5)), (SegmentColors::BLOODLESS, full));
        let half = colors.color(1.0, 0, 1);
        let middle = 0.5 * (full[0] + SegmentColors::BLOODLESS[0]);
        assert!((half[0] - middle).abs() < 1e-6, "{half:?}");
        let rest = 0.7 / SegmentColors::SUPPLY_LEVELS as f32;
        assert!(colors.set_supply(&[1.0 - rest, 0.5 + rest, rest, 1.0, 0.25 - rest]).is_empty());
        assert_eq!(colors.set_supply(&[f32::NAN]), [0..3, 4..5], "shorter: the rest is supplied again");
        assert_eq!(colors.color(1.0, 0, 0), SegmentColors::BLOODLESS);
        let mut other = SegmentColors::RADIUS;
        assert!(other.set_supply(&[0.0; 6]).is_empty());
    }

    #[test]
    fn age_scale_grows_by_quarters() {
        let mut colors = SegmentColors::AGE;
        let grown = tree(&[NO_PARENT, 0, 1], &[1.0; 3]);
        assert_eq!(colors.refresh(&grown, &[0, 4, 8], [0..3]), [0..3]);
        assert_eq!(colors, SegmentColors::Age { span: 10 });
        assert!(colors.refresh(&grown, &[0, 4, 10], [2..3]).is_empty());
        assert_eq!(colors.refresh(&grown, &[0, 4, 11], [2..3]), [0..3]);
        assert!(luminance(colors.color(1.0, 11, 2)) > luminance(colors.color(1.0, 4, 1)));
    }
}
