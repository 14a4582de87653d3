//! Candidates for drains: drawn from the tissue, block by block, so that threads can share the work.
//!
//! Every block of every step has its own stretch of the random stream. So what is drawn does not depend on who draws it.

use super::vacancy::Vacancy;
use crate::synthesis::parallel;
use crate::synthesis::rng::{Stream, VesselRng};
use crate::synthesis::spatial_order::SpatialOrder;
use crate::synthesis::tissue::Tissue;
use bevy_math::Vec3;

/// Most candidates in a block.
const BLOCK: u32 = 1024;
/// Bits of the stream's position that a block has to itself: a hundred numbers and more for each candidate.
const STRETCH: u32 = 20;
/// Bits of the stream's position for the blocks of a step: more than 2³² candidates need. The steps have the bits above.
const BLOCKS: u32 = 22;
/// Fewest candidates that are looked at in the order in which they lie in space.
const WORTH_SORTING: usize = 8192;

/// Draws the candidates of a step. Keeps its buffers.
#[derive(Debug)]
pub(crate) struct Candidates {
    /// The random stream, at its beginning.
    rng: VesselRng,
    blocks: Vec<Vec<Vec3>>,
    /// All that were drawn, in the order in which they were, and which of them were refused.
    drawn: Vec<Vec3>,
    refused: Vec<bool>,
    order: SpatialOrder,
    /// Both in the order in which candidates lie in space.
    sorted: Vec<Vec3>,
    marks: Vec<bool>,
}

impl Candidates {
    /// Those of an organ's seed.
    pub fn new(seed: u64) -> Self {
        Self {
            rng: Stream::Attraction.rng(seed),
            blocks: Vec::new(),
            drawn: Vec::new(),
            refused: Vec::new(),
            order: SpatialOrder::default(),
            sorted: Vec::new(),
            marks: Vec::new(),
        }
    }

    /// Takes another seed, keeping memory.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Stream::Attraction.rng(seed);
    }

    /// Draws `count` candidates in a step, less those that `refuse` marks.
    pub fn draw(
        &mut self,
        tissue: &dyn Tissue,
        vacancy: &Vacancy,
        step: u32,
        count: u32,
        refuse: impl Fn(&[Vec3], &mut [bool]) + Sync,
    ) {
        self.draw_all(tissue, vacancy, step, count);
        self.refused.clear();
        self.refused.resize(self.drawn.len(), false);
        if self.drawn.len() < WORTH_SORTING {
            parallel::zip_chunks(&self.drawn, &mut self.refused, refuse);
        } else {
            // Neighbours ask for the same memory.
            self.order.sort(&tissue.bounds(), &self.drawn);
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

    fn draw_all(&mut self, tissue: &dyn Tissue, vacancy: &Vacancy, step: u32, count: u32) {
        let blocks = count.div_ceil(BLOCK) as usize;
        if self.blocks.len() < blocks {
            self.blocks.resize_with(blocks, Vec::new);
        }
        let rng = &self.rng;
        parallel::for_each(&mut self.blocks[..blocks], |index, block| {
            let mut rng = rng.clone();
            rng.set_word_pos((u128::from(step) << BLOCKS | index as u128) << STRETCH);
            block.clear();
            let count = BLOCK.min(count - index as u32 * BLOCK);
            if !vacancy.draw(tissue, &mut rng, count, block) {
                tissue.draw(&mut rng, count, block);
            }
        });
        self.drawn.clear();
        self.drawn.extend(self.blocks[..blocks].iter().flatten().filter(|candidate| candidate.is_finite()));
    }

    /// Those candidates of the last draw that are left, in the order in which they were drawn.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.drawn.iter().zip(&self.refused).filter(|&(_, &refused)| !refused).map(|(&candidate, _)| candidate)
    }
}
