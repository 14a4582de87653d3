//! Candidates for drains: drawn from the tissue, block by block, so that threads can share the work.
//!
//! Every block of every step has its own stretch of the random stream. So what is drawn does not depend on who draws it.

use super::parallel;
use super::vacancy::Vacancy;
use crate::synthesis::rng::{Stream, VesselRng};
use crate::synthesis::tissue::Tissue;
use bevy_math::Vec3;

/// Most candidates in a block.
const BLOCK: u32 = 4096;
/// Bits of the stream's position that a block has to itself: a hundred numbers and more for each candidate.
const STRETCH: u32 = 20;

/// Draws the candidates of a step. Keeps its buffers.
#[derive(Debug)]
pub(crate) struct Candidates {
    /// The random stream, at its beginning.
    rng: VesselRng,
    blocks: Vec<Vec<Vec3>>,
    used: usize,
}

impl Candidates {
    /// Those of an organ's seed.
    pub fn new(seed: u64) -> Self {
        Self { rng: Stream::Attraction.rng(seed), blocks: Vec::new(), used: 0 }
    }

    /// Takes another seed, keeping memory.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Stream::Attraction.rng(seed);
        self.used = 0;
    }

    /// Draws `count` candidates in a step, and drops those that are `refused`.
    pub fn draw(
        &mut self,
        tissue: &dyn Tissue,
        vacancy: &Vacancy,
        step: u32,
        count: u32,
        refused: impl Fn(Vec3) -> bool + Sync,
    ) {
        self.used = count.div_ceil(BLOCK) as usize;
        if self.blocks.len() < self.used {
            self.blocks.resize_with(self.used, Vec::new);
        }
        let rng = &self.rng;
        parallel::for_each(&mut self.blocks[..self.used], |index, block| {
            let first = index as u32 * BLOCK;
            let mut rng = rng.clone();
            rng.set_word_pos((u128::from(step) << 32 | index as u128) << STRETCH);
            block.clear();
            let count = BLOCK.min(count - first);
            if !vacancy.draw(tissue, &mut rng, count, block) {
                tissue.draw(&mut rng, count, block);
            }
            block.retain(|&candidate| candidate.is_finite() && !refused(candidate));
        });
    }

    /// Those candidates of the last draw that are left, in the order in which they were drawn.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.blocks[..self.used].iter().flatten().copied()
    }
}
