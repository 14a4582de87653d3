//! Random streams: one `u64` seed for an organ, one named stream per stage.
//!
//! Every stage draws from its own ChaCha8 stream, so a new draw in one stage doesn't change the others. ChaCha8 is
//! specified to the bit, hence the same on every platform and in every future version.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The generator that every stage draws from.
pub type VesselRng = ChaCha8Rng;

/// A stage that draws random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Stream {
    /// Attraction points sampled while the vessels grow.
    Attraction = 1,
    /// Places where roots are put automatically.
    Roots = 2,
    /// The shape of a procedural organ.
    Organ = 3,
    /// Monte-Carlo measures of a finished tree, such as coverage.
    Statistics = 4,
    /// Terminals of constrained constructive optimisation.
    Terminals = 5,
    /// Points of a tissue that it keeps.
    Tissue = 6,
}

impl Stream {
    /// The generator of this stage for an organ's `seed`.
    ///
    /// Two stages of one seed, and one stage of two seeds, share no numbers.
    pub fn rng(self, seed: u64) -> VesselRng {
        let mut rng = VesselRng::seed_from_u64(seed);
        rng.set_stream(self as u64);
        rng
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::random::*;
    use rand::Rng;

    #[test]
    fn streams_and_seeds_are_independent_and_repeatable() {
        let draw = |stream: Stream, seed| stream.rng(seed).next_u64();
        assert_eq!(draw(Stream::Roots, 7), draw(Stream::Roots, 7));
        assert_ne!(draw(Stream::Roots, 7), draw(Stream::Roots, 8));
        assert_ne!(draw(Stream::Roots, 7), draw(Stream::Attraction, 7));
    }
}
