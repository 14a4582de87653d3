//! Tissue growth: the size of the organ after each step (Rauch & Harders 2021, section 3, "Vessel Tree Updates").
//!
//! Nothing moves. Positions stay relative to the tissue; instead, every length of the settings is multiplied by λ_t =
//! σ₀/σ_t, so vessels become finer as the organ grows.

/// Growth of the tissue during a step, as a law for its size σ relative to the start (σ₀ = 1).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueGrowth {
    /// The organ keeps its size.
    None,
    /// σ rises by this much each step. The paper's law, with 0.02.
    Linear(f32),
    /// σ rises by this share of itself each step.
    Exponential(f32),
    /// σ after each step, from the first on; the last value stays in force. For custom laws.
    Table(Vec<f32>),
}

impl TissueGrowth {
    /// The paper's increment of σ in a step.
    pub const DEFAULT_LINEAR: f32 = 0.02;

    /// Tabulates a custom law for `steps` steps: `law(step)` is σ after that step, and `law(1)` the first value.
    pub fn from_fn(steps: u32, law: impl Fn(u32) -> f32) -> Self {
        Self::Table((1..=steps).map(law).collect())
    }

    /// Size σ after `step` steps, computed from the size before that step.
    pub(crate) fn advance(&self, size: f32, step: u32) -> f32 {
        match self {
            Self::None => size,
            Self::Linear(increment) => size + increment,
            Self::Exponential(share) => size + size * share,
            Self::Table(sizes) => {
                let index = (step.max(1) as usize - 1).min(sizes.len().saturating_sub(1));
                sizes.get(index).copied().unwrap_or(size)
            }
        }
    }

    /// Whether the size stays constant after a step.
    pub(crate) fn is_over(&self, step: u32) -> bool {
        match self {
            Self::None => true,
            Self::Linear(increment) => *increment == 0.0,
            Self::Exponential(share) => *share == 0.0,
            Self::Table(sizes) => step as usize >= sizes.len(),
        }
    }

    /// Whether every size that this law gives within `steps` steps is finite and above zero.
    pub(crate) fn check(&self, steps: u32) -> Result<(), f32> {
        let steps = match self {
            // The last value stays.
            Self::Table(sizes) => u32::try_from(sizes.len()).map_or(steps, |sizes| steps.min(sizes)),
            // It only rises, so the last size is the largest; rounding makes it less, if anything.
            Self::Linear(increment) if *increment >= 0.0 => {
                let last = (1.0 + f64::from(*increment) * f64::from(steps)) as f32;
                return if last.is_finite() { Ok(()) } else { Err(last) };
            }
            _ => steps,
        };
        let mut size = 1.0;
        for step in 1..=steps {
            let before = size;
            size = self.advance(size, step);
            if !(size.is_finite() && size > 0.0) {
                return Err(size);
            }
            // What rounding has stopped changes no more.
            if size == before && !matches!(self, Self::Table(_)) {
                break;
            }
        }
        Ok(())
    }
}

impl Default for TissueGrowth {
    fn default() -> Self {
        Self::Linear(Self::DEFAULT_LINEAR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size_after(growth: &TissueGrowth, steps: u32) -> f32 {
        (1..=steps).fold(1.0, |size, step| growth.advance(size, step))
    }

    #[test]
    fn laws_follow_their_formula() {
        assert_eq!(size_after(&TissueGrowth::None, 50), 1.0);
        assert!((size_after(&TissueGrowth::Linear(0.02), 100) - 3.0).abs() < 1e-4);
        assert!((size_after(&TissueGrowth::Exponential(0.01), 100) - 1.01f32.powi(100)).abs() < 1e-3);
        let own = TissueGrowth::from_fn(3, |step| 1.0 + step as f32);
        assert_eq!(size_after(&own, 2), 3.0);
        assert_eq!(size_after(&own, 9), 4.0);
        assert_eq!(size_after(&TissueGrowth::Table(vec![]), 9), 1.0);
    }

    #[test]
    fn a_size_of_zero_or_infinity_is_found() {
        assert!(TissueGrowth::Linear(-0.1).check(9).is_ok());
        assert!(TissueGrowth::Linear(-0.1).check(20).is_err());
        assert!(TissueGrowth::Exponential(10.0).check(100).is_err());
        assert!(TissueGrowth::Linear(1e38).check(100).is_err());
        assert!(TissueGrowth::Linear(f32::NAN).check(1).is_err());
        assert!(TissueGrowth::Table(vec![1.0, 1.0, 0.0]).check(3).is_err());
        assert!(TissueGrowth::Table(vec![1.0, 1.0, 0.0]).check(2).is_ok());
    }

    #[test]
    fn as_many_steps_as_there_are_numbers_are_checked_as_well() {
        for growth in [TissueGrowth::None, TissueGrowth::default(), TissueGrowth::Exponential(1e-9)] {
            assert_eq!(growth.check(u32::MAX), Ok(()), "{growth:?}");
        }
        assert_eq!(TissueGrowth::Table(vec![2.0; 3]).check(u32::MAX), Ok(()));
        assert!(TissueGrowth::Exponential(0.01).check(u32::MAX).is_err());
        assert!(TissueGrowth::Linear(-0.01).check(u32::MAX).is_err());
    }
}
