//! Attraction points: oxygen drains for the arteries, carbon-dioxide sources for the veins.
//!
//! A drain is born in unsupplied tissue, acts on its nearest open node, and is removed once it is supplied. It stores
//! that node between steps and is notified of changes, so the cost of a step depends on its changes, not on the number
//! of waiting drains:
//!
//! - a new node [notifies](News) the drains within reach, and may become their nearest;
//! - a node that closes, or whose perception changes, [wakes](Drains::wake) the drains that wait at it;
//! - all other drains sleep. A test of them would give the same result as before.

use crate::synthesis::parallel;
use crate::synthesis::space::point_grid::PointGrid;
use bevy_math::{Vec3, bounding::Aabb3d};

/// No node or drain.
const NONE: u32 = u32::MAX;

/// A place that attracts vessels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Attraction {
    pub position: Vec3,
    /// Normal of the facet of the tissue's surface that it lies on; zero without one.
    pub side: Vec3,
}

/// A drain's knowledge of the vessels around it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hearing {
    /// Its nearest open node as of the last search; [`NONE`] for no node within reach.
    node: u32,
    /// Squared distance to that node, infinite without one.
    pub distance: f32,
    /// Squared distance to the nearest node of any kind within reach, infinite without one.
    pub closest: f32,
    /// Cosine of the angle between the node's direction and the direction from it to the drain.
    pub cos: f32,
    /// The drains that wait at the same node, before and after this one.
    before: u32,
    after: u32,
}

impl Hearing {
    const NOBODY: Self =
        Self { node: NONE, distance: f32::INFINITY, closest: f32::INFINITY, cos: 1.0, before: NONE, after: NONE };

    /// The nearest known open node.
    pub fn node(&self) -> Option<u32> {
        (self.node != NONE).then_some(self.node)
    }
}

/// The state of a drain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// The slot is free.
    Gone,
    /// Nothing has changed since the drain was found not to act.
    Asleep,
    /// To be tested in the next step.
    Awake,
    /// To search its nearest open node in the next step.
    Searching,
}

/// The result of a drain's search for its nearest open node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    /// The node, if there is one within reach.
    pub node: Option<u32>,
    /// Squared distance to it.
    pub distance: f32,
    /// Squared distance to the nearest node of any kind, infinite without one.
    pub closest: f32,
    /// Cosine of the angle between the node's direction and the direction to the drain.
    pub cos: f32,
}

/// A new node that a drain must know.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Heard {
    pub node: u32,
    pub drain: u32,
    /// Squared distance between them.
    pub distance: f32,
}

/// New nodes for whose drains one thread searches at a time.
const NODES_PER_SHARE: usize = 1024;

/// Notifications of drains about new nodes. Reuses its buffers.
#[derive(Debug, Default)]
pub(crate) struct News {
    /// Notifications, by share of the nodes.
    shares: Vec<Vec<Heard>>,
}

impl News {
    /// Finds for each of some nodes, numbered from `first` on, the drains within `reach` that it matters to.
    pub fn spread(&mut self, drains: &Drains, first: u32, positions: &[Vec3], reach: f32) {
        let count = positions.len().div_ceil(NODES_PER_SHARE);
        if self.shares.len() < count {
            self.shares.resize_with(count, Vec::new);
        }
        self.shares.iter_mut().for_each(Vec::clear);
        parallel::for_each(&mut self.shares[..count], |share, heard| {
            let start = share * NODES_PER_SHARE;
            let end = positions.len().min(start + NODES_PER_SHARE);
            for (node, &position) in (first + start as u32..).zip(&positions[start..end]) {
                drains.grid.for_each_within(position, reach, |drain, distance| {
                    let known = &drains.hearing[drain as usize];
                    if distance < known.distance || distance < known.closest {
                        heard.push(Heard { node, drain, distance });
                    }
                });
            }
        });
    }

    /// The notifications, in the order of the nodes.
    pub fn iter(&self) -> impl Iterator<Item = Heard> + '_ {
        self.shares.iter().flatten().copied()
    }
}

/// The attraction points of one system.
#[derive(Debug, Default)]
pub(crate) struct Drains {
    grid: PointGrid,
    sides: Vec<Vec3>,
    hearing: Vec<Hearing>,
    states: Vec<State>,
    /// First drain that waits at each node.
    waiting: Vec<u32>,
    /// Drains to be tested in the next step, in no order.
    awake: Vec<u32>,
    /// Slots of removed drains, for reuse.
    free: Vec<u32>,
}

impl Drains {
    /// Removes all drains and covers a box with cells of a given side, keeping memory.
    pub fn reset(&mut self, bounds: &Aabb3d, cell: f32) {
        self.grid.reset(bounds, cell);
        self.sides.clear();
        self.hearing.clear();
        self.states.clear();
        self.waiting.clear();
        self.awake.clear();
        self.free.clear();
    }

    /// Adapts the cells to changed lengths: finer cells for shorter ones.
    pub fn resize_cells(&mut self, cell: f32) {
        self.grid.resize_cells(cell);
    }

    /// Number of living drains.
    pub fn len(&self) -> usize {
        self.states.len() - self.free.len()
    }

    /// Adds a drain that must search its node, and returns its slot.
    pub fn add(&mut self, Attraction { position, side }: Attraction) -> u32 {
        let slot = if let Some(slot) = self.free.pop() {
            self.grid.replace(slot, position);
            slot
        } else {
            self.hearing.push(Hearing::NOBODY);
            self.states.push(State::Gone);
            self.sides.push(side);
            self.grid.push(position)
        };
        self.sides[slot as usize] = side;
        self.hearing[slot as usize] = Hearing::NOBODY;
        self.states[slot as usize] = State::Searching;
        self.awake.push(slot);
        slot
    }

    /// Removes a living drain.
    pub fn remove(&mut self, slot: u32) {
        self.grid.remove(slot);
        self.detach(slot);
        // It may be in the list of awake drains, which drops it later.
        self.states[slot as usize] = State::Gone;
        self.free.push(slot);
    }

    /// Position of a drain.
    pub fn position(&self, slot: u32) -> Vec3 {
        self.grid.point(slot)
    }

    /// A drain as an attraction point.
    pub fn attraction(&self, slot: u32) -> Attraction {
        Attraction { position: self.position(slot), side: self.sides[slot as usize] }
    }

    /// Turns every drain to the side that `side` gives for its position, and lets it search again.
    pub fn turn(&mut self, side: impl Fn(Vec3) -> Vec3) {
        for (slot, own) in self.sides.iter_mut().enumerate().filter(|&(slot, _)| self.states[slot] != State::Gone) {
            *own = side(self.grid.point(slot as u32));
        }
        self.wake_all();
    }

    /// Slots and positions of all living drains, in the order of their slots.
    pub fn living(&self) -> impl Iterator<Item = (u32, Vec3)> + '_ {
        self.slots().map(|slot| (slot, self.position(slot)))
    }

    /// The living drains' slots, in order.
    pub fn slots(&self) -> impl Iterator<Item = u32> + '_ {
        let living = |&(_, &state): &(usize, &State)| state != State::Gone;
        self.states.iter().enumerate().filter(living).map(|(slot, _)| slot as u32)
    }

    /// The index over all drains.
    pub fn index(&self) -> &PointGrid {
        &self.grid
    }

    /// A drain's knowledge.
    pub fn hearing(&self, slot: u32) -> &Hearing {
        &self.hearing[slot as usize]
    }

    /// Drains to be tested in this step, in no particular order.
    pub fn awake(&self) -> &[u32] {
        &self.awake
    }

    /// Whether a drain must search its nearest open node.
    pub fn is_searching(&self, slot: u32) -> bool {
        self.states[slot as usize] == State::Searching
    }

    /// Stores the result of a drain's search for its nearest open node.
    pub fn settle(&mut self, slot: u32, found: Found) {
        self.detach(slot);
        let own = &mut self.hearing[slot as usize];
        *own = Hearing { closest: found.closest, ..Hearing::NOBODY };
        self.states[slot as usize] = State::Awake;
        if let Some(node) = found.node {
            self.attach(slot, node, found.distance, found.cos);
        }
    }

    /// Keeps the drains awake for which `acts` is true, and lets the others sleep.
    pub fn keep_awake(&mut self, mut acts: impl FnMut(u32, &Hearing) -> bool) {
        let (hearing, states) = (&self.hearing, &mut self.states);
        self.awake.retain(|&slot| {
            let stays = acts(slot, &hearing[slot as usize]);
            if !stays {
                states[slot as usize] = State::Asleep;
            }
            stays
        });
    }

    /// Drops drains that were removed while they were awake.
    pub fn forget_the_gone(&mut self) {
        let states = &self.states;
        self.awake.retain(|&slot| states[slot as usize] != State::Gone);
    }

    /// Wakes the drains that wait at a node, since its perception changed. If it has `closed`, they search another one.
    pub fn wake(&mut self, node: u32, closed: bool) {
        let mut slot = self.waiting.get(node as usize).copied().unwrap_or(NONE);
        while slot != NONE {
            let state = &mut self.states[slot as usize];
            if *state == State::Asleep {
                self.awake.push(slot);
            }
            if closed {
                *state = State::Searching;
            } else if *state == State::Asleep {
                *state = State::Awake;
            }
            slot = self.hearing[slot as usize].after;
        }
    }

    /// Makes every drain search again, after reaches have grown.
    pub fn wake_all(&mut self) {
        for (slot, state) in self.states.iter_mut().enumerate() {
            if *state == State::Asleep {
                self.awake.push(slot as u32);
            }
            if *state != State::Gone {
                *state = State::Searching;
            }
        }
    }

    /// Notifies a drain of a new open node. `cos` gives the cosine of the angle between the node's direction and that in
    /// which it sees a drain, if it does. Of two nodes at equal distance, the older stays.
    pub fn hear(&mut self, heard: Heard, cos: impl Fn(Attraction) -> Option<f32>) {
        let Heard { node, drain: slot, distance } = heard;
        let drain = self.attraction(slot);
        let own = &mut self.hearing[slot as usize];
        own.closest = own.closest.min(distance);
        if distance < own.distance
            && let Some(cos) = cos(drain)
        {
            self.detach(slot);
            self.attach(slot, node, distance, cos);
            let state = &mut self.states[slot as usize];
            if *state == State::Asleep {
                self.awake.push(slot);
            }
            *state = State::Awake;
        }
    }

    /// Puts a drain first in the list of drains that wait at a node.
    fn attach(&mut self, slot: u32, node: u32, distance: f32, cos: f32) {
        let Self { hearing, waiting, .. } = self;
        if node as usize >= waiting.len() {
            waiting.resize(node as usize + 1, NONE);
        }
        let after = std::mem::replace(&mut waiting[node as usize], slot);
        if after != NONE {
            hearing[after as usize].before = slot;
        }
        let own = &mut hearing[slot as usize];
        *own = Hearing { node, distance, cos, before: NONE, after, closest: own.closest };
    }

    /// Removes a drain from its list, if any.
    fn detach(&mut self, slot: u32) {
        let Hearing { node, before, after, .. } = self.hearing[slot as usize];
        if node == NONE {
            return;
        }
        match before {
            NONE => self.waiting[node as usize] = after,
            before => self.hearing[before as usize].after = after,
        }
        if after != NONE {
            self.hearing[after as usize].before = before;
        }
        self.hearing[slot as usize].node = NONE;
    }
}
