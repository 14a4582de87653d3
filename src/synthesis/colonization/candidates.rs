//! Candidates for drains: drawn from the tissue, block by block, so that threads can share the work.
//!
//! Every block of every step has its own stretch of the random stream, so candidates don't depend on the thread or time
//! of the draw.

use super::vacancy::Vacancy;
use crate::synthesis::parallel;
use crate::synthesis::random::{Stream, VesselRng};
use crate::synthesis::space::order::SpatialOrder;
use crate::synthesis::tissue::Tissue;
use bevy_math::{Vec3, bounding::Aabb3d};

/// Most candidates in a block.
const BLOCK: u32 = 1024;
/// Bits of the stream's position within a block: more than a hundred numbers for each candidate.
const STRETCH: u32 = 20;
/// Bits of the stream's position for the blocks of a step: more than 2³² candidates need. Steps use the bits above.
const BLOCKS: u32 = 22;
/// Fewest candidates that are tested in spatial order.
const WORTH_SORTING: usize = 8192;

/// Draws candidates from the tissue. Reuses its buffers.
#[derive(Debug)]
pub(crate) struct Draws {
    /// The random stream, at its beginning.
    rng: VesselRng,
    /// As many as any step needed; surplus ones are empty.
    blocks: Vec<Vec<Vec3>>,
    /// The step of the blocks, 0 for none, and whether its candidates were drawn from vacant pieces.
    drawn: (u32, bool),
}

impl Draws {
    /// The draws of an organ's seed.
    pub fn new(seed: u64) -> Self {
        Self { rng: Stream::Attraction.rng(seed), blocks: Vec::new(), drawn: (0, false) }
    }

    /// Takes another seed, keeping memory.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Stream::Attraction.rng(seed);
        self.drawn = (0, false);
    }

    /// Draws `count` candidates of a step, from vacant pieces if those are known, unless they have been drawn before.
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

/// The candidates of a step, less the refused ones. Reuses its buffers.
#[derive(Debug, Default)]
pub(crate) struct Candidates {
    /// All drawn candidates, in the order of drawing, and which of them were refused.
    drawn: Vec<Vec3>,
    refused: Vec<bool>,
    order: SpatialOrder,
    /// Both in spatial order.
    sorted: Vec<Vec3>,
    marks: Vec<bool>,
}

impl Candidates {
    /// Takes the drawn candidates, which lie within a box, less those that `refuse` marks.
    pub fn take(&mut self, draws: &Draws, bounds: &Aabb3d, refuse: impl Fn(&[Vec3], &mut [bool]) + Sync) {
        self.drawn.clear();
        draws.blocks.iter().for_each(|block| self.drawn.extend_from_slice(block));
        self.refused.clear();
        self.refused.resize(self.drawn.len(), false);
        if self.drawn.len() < WORTH_SORTING {
            parallel::zip_chunks(&self.drawn, &mut self.refused, refuse);
        } else {
            // Neighbours use the same memory.
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

    /// The remaining candidates, in the order of drawing.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.drawn.iter().zip(&self.refused).filter(|&(_, &refused)| !refused).map(|(&candidate, _)| candidate)
    }
}
