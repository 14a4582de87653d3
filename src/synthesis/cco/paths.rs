//! Ways from candidates to the root, which they share.
//!
//! The candidates of a terminal lie near each other, so their ways meet soon. What one changes above that point is
//! nearly what another does: the volume of the whole tree is taken to be linear there. That serves for a bound, not for
//! a cost.

use super::{
    forest::{Forest, NONE},
    sums::{Below, Slope, Sums},
};

/// What is known above a segment, for sums that it has if a terminal is added below it.
#[derive(Clone, Copy, Debug)]
struct Step {
    segment: u32,
    sums: Sums,
    /// Volume of the whole tree then.
    volume: f64,
    /// How it depends on the sums.
    slope: Slope,
}

/// The ways of the candidates of one terminal.
#[derive(Clone, Debug, Default)]
pub(super) struct Paths {
    steps: Vec<Step>,
    /// Numbers of the steps by the hash of their segment, in a table with a power of two of places; `NONE` is free.
    step_of: Vec<u32>,
    /// Buffer: the way of one candidate up to another's, with the slopes from its beginning.
    way: Vec<(u32, Sums, Slope)>,
}

impl Paths {
    /// Forgets all ways, for another terminal.
    pub(super) fn clear(&mut self) {
        self.steps.clear();
        self.step_of.fill(NONE);
    }

    /// The place of a segment's step in the table, or the free one where it belongs.
    fn slot(&self, segment: u32) -> usize {
        let mask = self.step_of.len() - 1;
        // Fibonacci hashing.
        let mut slot = segment.wrapping_mul(0x9E37_79B9) as usize >> 8 & mask;
        while self.step_of[slot] != NONE && self.steps[self.step_of[slot] as usize].segment != segment {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn step(&self, segment: u32) -> Option<&Step> {
        if self.steps.is_empty() {
            return None;
        }
        self.steps.get(self.step_of[self.slot(segment)] as usize)
    }

    fn add(&mut self, step: Step) {
        // Half full at most.
        if 2 * self.steps.len() >= self.step_of.len() {
            self.step_of = vec![NONE; (2 * self.step_of.len()).max(256)];
            for number in 0..self.steps.len() {
                let slot = self.slot(self.steps[number].segment);
                self.step_of[slot] = number as u32;
            }
        }
        let slot = self.slot(step.segment);
        self.step_of[slot] = self.steps.len() as u32;
        self.steps.push(step);
    }

    /// Volume of the tree if a segment, which gains so much flow, had other sums, and how it depends on them.
    pub(super) fn ascend(&mut self, forest: &Forest, mut segment: u32, mut sums: Sums, gain: f64) -> (f64, Slope) {
        self.way.clear();
        let mut slope = Slope::ROOT;
        let (volume, whole) = loop {
            if let Some(known) = self.step(segment) {
                let load = known.slope.load * (sums.load - known.sums.load);
                let own = known.slope.volume * (sums.volume - known.sums.volume);
                break (known.volume + load + own, slope.then(&known.slope));
            }
            self.way.push((segment, sums, slope));
            let parent = forest.node(segment).parent;
            let node = forest.node(parent);
            if node.parent == NONE {
                break (sums.volume, slope);
            }
            let below = Below::join(&sums, &forest.sister(segment), forest.exponent);
            let above = Sums::of(node.flow + gain, forest.length(parent), &below, forest.exponent);
            slope.rise(&sums, &below, &above);
            (segment, sums) = (parent, above);
        };
        for number in 0..self.way.len() {
            let (segment, sums, below) = self.way[number];
            self.add(Step { segment, sums, volume, slope: whole.without(&below) });
        }
        (volume, whole)
    }
}
