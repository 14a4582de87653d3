//! Candidates for drains: drawn from the tissue, block by block, so that threads can share the work.
//!
//! Every block of every step has its own stretch of the random stream. So what is drawn does not depend on who draws it, nor
//! on when.

use super::vacancy::Vacancy;
use crate::synthesis::parallel;
use crate::synthesis::random::{Stream, VesselRng};
use crate::synthesis::space::order::SpatialOrder;
use crate::synthesis::tissue::Tissue;
use bevy_math::{Vec3, bounding::Aabb3d};

/// Most candidates in a block.
const BLOCK: u32 = 1024;
/// Bits of the stream's position that a block has to itself: a hundred numbers and more for each candidate.
const STRETCH: u32 = 20;
/// Bits of the stream's position for the blocks of a step: more than 2³² candidates need. The steps have the bits above.
const BLOCKS: u32 = 22;
/// Fewest candidates that are looked at in the order in which they lie in space.
const WORTH_SORTING: usize = 8192;

/// Draws candidates from the tissue. Keeps its buffers.
#[derive(Debug)]
pub(crate) struct Draws {
    /// The random stream, at its beginning.
    rng: VesselRng,
    /// As many as any step needed; those beyond what the present one needs are empty.
    blocks: Vec<Vec<Vec3>>,
    /// The step that the blocks are of, 0 for none, and whether its candidates were chosen by what was vacant.
    drawn: (u32, bool),
}

impl Draws {
    /// Those of an organ's seed.
    pub fn new(seed: u64) -> Self {
        Self { rng: Stream::Attraction.rng(seed), blocks: Vec::new(), drawn: (0, false) }
    }

    /// Takes another seed, keeping memory.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Stream::Attraction.rng(seed);
        self.drawn = (0, false);
    }

    /// Draws `count` candidates of a step, from what is vacant if that is known, unless it has been done before.
    pub fn draw(&mut self, tissue: &dyn Tissue, vacancy: Option<&Vacancy>, step: u32, count: u32) {
        if self.drawn == (step, vacancy.is_some()) {
            return;
        }
        self.drawn = (step, vacancy.is_some());
        let needed = count.div_ceil(BLOCK) as usize;
        if self.blocks.len() < needed {
            self.blocks.resize_with(needed, Vec::new);
        }
        let (blocks, beyond) = self.blocks.split_at_mut(needed);
        beyond.iter_mut().for_each(Vec::clear);
        let rng = &self.rng;
        parallel::for_each(blocks, |index, block| {
            let mut rng = rng.clone();
            rng.set_word_pos((u128::from(step) << BLOCKS | index as u128) << STRETCH);
            block.clear();
            let count = BLOCK.min(count - index as u32 * BLOCK);
            match vacancy {
                Some(vacancy) => vacancy.draw(tissue, &mut rng, count, block),
                None => tissue.draw(&mut rng, count, block),
            }
            block.retain(|candidate| candidate.is_finite());
        });
    }
}

/// The candidates of a step, less those that are refused. Keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Candidates {
    /// All that were drawn, in the order in which they were, and which of them were refused.
    drawn: Vec<Vec3>,
    refused: Vec<bool>,
    order: SpatialOrder,
    /// Both in the order in which candidates lie in space.
    sorted: Vec<Vec3>,
    marks: Vec<bool>,
}

impl Candidates {
    /// Takes what has been drawn within a box, less those that `refuse` marks.
    pub fn take(&mut self, draws: &Draws, bounds: &Aabb3d, refuse: impl Fn(&[Vec3], &mut [bool]) + Sync) {
        self.drawn.clear();
        draws.blocks.iter().for_each(|block| self.drawn.extend_from_slice(block));
        self.refused.clear();
        self.refused.resize(self.drawn.len(), false);
        if self.drawn.len() < WORTH_SORTING {
            parallel::zip_chunks(&self.drawn, &mut self.refused, refuse);
        } else {
            // Neighbours ask for the same memory.
            self.order.sort(bounds, &self.drawn);
            let Self { drawn, refused, order, sorted, marks, .. } = self;
            sorted.clear();
            sorted.extend(order.indices().iter().map(|&index| drawn[index as usize]));
            marks.clear();
            marks.resize(sorted.len(), false);
            parallel::zip_chunks(sorted, marks, refuse);
            for (&index, &mark) in order.indices().iter().zip(&*marks) {
                refused[index as usize] = mark;
            }
        }
    }

    /// Those candidates that are left, in the order in which they were drawn.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.drawn.iter().zip(&self.refused).filter(|&(_, &refused)| !refused).map(|(&candidate, _)| candidate)
    }
}
