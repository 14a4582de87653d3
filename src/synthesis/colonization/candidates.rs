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
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

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
    blocks: Blocks,
}

/// Where the candidates of a step are drawn from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampling<'a> {
    /// The tissue in force.
    pub tissue: &'a dyn Tissue,
    /// Number of the step, from 1, and of the last one.
    pub step: u32,
    pub last: u32,
    /// Number of candidates.
    pub count: u32,
}

/// The candidates of a step, block by block.
type Blocks = Vec<Vec<Vec3>>;

impl Draws {
    /// The draws of an organ's seed.
    pub fn new(seed: u64) -> Self {
        Self { rng: Stream::Attraction.rng(seed), blocks: Vec::new() }
    }

    /// Takes another seed, keeping memory.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Stream::Attraction.rng(seed);
    }

    /// Draws that may be done on another thread, for as many steps ahead.
    pub fn ahead(&self, steps: u32) -> Ahead {
        Ahead { rng: self.rng.clone(), steps, ready: Mutex::default() }
    }

    /// Draws the candidates of a step, from vacant pieces if those are known. Those of plain tissue may have been drawn
    /// ahead.
    pub fn draw(&mut self, of: Sampling<'_>, vacancy: Option<&Vacancy>, ahead: Option<&Ahead>) {
        let is_ready = ahead.is_some_and(|ahead| ahead.take(of.step, vacancy.is_none(), &mut self.blocks));
        if !is_ready {
            fill(&self.rng, of, vacancy, &mut self.blocks);
        }
    }
}

/// Draws the candidates of a step.
fn fill(rng: &VesselRng, of: Sampling<'_>, vacancy: Option<&Vacancy>, blocks: &mut Blocks) {
    let Sampling { tissue, step, count, .. } = of;
    let needed = count.div_ceil(BLOCK) as usize;
    if blocks.len() < needed {
        blocks.resize_with(needed, Vec::new);
    }
    let (blocks, beyond) = blocks.split_at_mut(needed);
    beyond.iter_mut().for_each(Vec::clear);
    parallel::for_each(blocks, |index, block| {
        let mut rng = rng.clone();
        rng.set_word_pos((u128::from(step) << BLOCKS | index as u128) << STRETCH);
        block.clear();
        let count = BLOCK.min(count - index as u32 * BLOCK);
        match vacancy {
            Some(vacancy) => vacancy.draw(tissue, &mut rng, count, block),
            None => tissue.draw(&mut rng, count, block),
        }
        // Nearly always all of them are, and to see that takes less than to keep those that are.
        if !block.iter().fold(true, |all, candidate| all & candidate.is_finite()) {
            block.retain(|candidate| candidate.is_finite());
        }
    });
}

/// Candidates of coming steps, drawn on another thread. Whoever needs them doesn't wait for them.
#[derive(Debug)]
pub(crate) struct Ahead {
    rng: VesselRng,
    steps: u32,
    ready: Mutex<Ready>,
}

/// Candidates that are ready. The lock on them is never held while any are drawn.
#[derive(Debug, Default)]
struct Ready {
    /// The next step whose candidates will be asked for; 0 if none will.
    next: u32,
    /// Steps from then on, in order.
    steps: VecDeque<(u32, Blocks)>,
    spare: Vec<Blocks>,
}

impl Ahead {
    /// Most steps that are drawn ahead.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Whether so many steps are still to be drawn.
    pub fn lacks(&self, steps: usize) -> bool {
        let ready = self.ready();
        ready.next > 0 && ready.steps.len() + steps <= self.steps as usize
    }

    /// Draws the first step that is not ready, unless enough are. `at` gives the one of a number.
    pub fn draw_next<'a>(&self, at: impl Fn(u32) -> Sampling<'a>) -> bool {
        let (of, mut blocks) = {
            let mut ready = self.ready();
            let number = ready.steps.back().map_or(ready.next, |(last, _)| last + 1);
            let of = at(number);
            if ready.next == 0 || number >= ready.next + self.steps || number > of.last {
                return false;
            }
            (of, ready.spare.pop().unwrap_or_default())
        };
        fill(&self.rng, of, None, &mut blocks);
        let mut ready = self.ready();
        let is_late = ready.next > of.step || ready.next == 0;
        let follows = ready.steps.back().is_none_or(|(last, _)| last + 1 == of.step);
        if is_late || !follows {
            ready.spare.push(blocks);
        } else {
            ready.steps.push_back((of.step, blocks));
        }
        true
    }

    /// Takes the candidates of a step in exchange for old ones, if they are ready; and tells whether `more` of plain tissue
    /// will be asked for.
    fn take(&self, step: u32, more: bool, blocks: &mut Blocks) -> bool {
        let mut ready = self.ready();
        let Ready { next, steps, spare } = &mut *ready;
        *next = if more { step + 1 } else { 0 };
        while let Some((number, mut drawn)) = steps.pop_front() {
            let is_it = more && number == step;
            if is_it {
                std::mem::swap(&mut drawn, blocks);
            }
            spare.push(drawn);
            if is_it {
                return true;
            }
            if number > step && more {
                break;
            }
        }
        false
    }

    fn ready(&self) -> MutexGuard<'_, Ready> {
        self.ready.lock().unwrap_or_else(PoisonError::into_inner)
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
