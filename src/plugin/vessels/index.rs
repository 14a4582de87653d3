//! Finds the segments of a vessel entity that an instrument may meet, at any time of a growth and without delaying a
//! frame.
//!
//! In: [`Vessels`] and their [`ChangeLog`]. Out: candidates for a cut or a touch, and the first hit of a ray. Small
//! trees are indexed at their first query. Jobs index large ones from then on. Segments that the index doesn't hold yet
//! are searched one by one, so an answer is always complete and the same.

use crate::plugin::{
    job::{Job, JobSettings, Jobs},
    lineage::Lineage,
    vessels::{
        change_log::{ChangeCursor, ChangeLog},
        tree::Vessels,
    },
};
use crate::synthesis::{
    pace::Pace,
    segment_index::{RayCast, Region, SegmentIndex, SegmentSearch},
    tree::{NO_PARENT, NodeId, VesselTree},
};
use bevy::{
    ecs::{change_detection::DetectChangesMut, component::Component, system::Query},
    log::warn,
};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// An index over the segments of a vessel entity. Every vessel entity has one, which is empty and free until the first
/// query.
///
/// [`VesselPicker`](crate::plugin::VesselPicker) and [`CuttableVessels`](crate::plugin::CuttableVessels) query it. A
/// query needs no `&mut`: the index follows the vessels when it is queried.
#[derive(Component, Debug, Default)]
pub struct VesselIndex {
    /// Queries that find it outdated write it; the others read it.
    state: RwLock<IndexState>,
}

#[derive(Debug)]
struct IndexState {
    index: SegmentIndex,
    /// The changes that the index has taken over.
    cursor: ChangeCursor,
    /// The indexed tree.
    tree: Lineage,
    /// Whether there has been a query.
    is_wanted: bool,
    /// A newer index that is being made.
    coming: Option<Job<ComingIndex>>,
    /// Whether the work on one panicked. It isn't tried again for the same tree.
    has_failed: bool,
    /// Largest number of nodes for which a query indexes the tree itself.
    at_once: usize,
    /// Nodes of the tree in the last frame, and the number of frames without a change of it.
    len: usize,
    idle_frames: u32,
}

/// An index that was made in a job.
#[derive(Debug)]
struct ComingIndex {
    index: SegmentIndex,
    /// The changes that it has taken over: those until the tree was copied.
    cursor: ChangeCursor,
}

impl ComingIndex {
    async fn of(tree: VesselTree, cursor: ChangeCursor, pace: Pace) -> Self {
        Self { index: SegmentIndex::new_paced(&tree, &pace).await, cursor }
    }
}

impl Default for IndexState {
    fn default() -> Self {
        Self {
            index: SegmentIndex::default(),
            cursor: ChangeCursor::default(),
            tree: Lineage::default(),
            is_wanted: false,
            coming: None,
            has_failed: false,
            at_once: JobSettings::DEFAULT_AT_ONCE,
            len: 0,
            idle_frames: 0,
        }
    }
}

impl VesselIndex {
    /// Frames without growth after which the remaining nodes are indexed.
    const IDLE_FRAMES: u32 = 10;

    /// Number of nodes in the index; the others are searched one by one.
    pub fn indexed(&self) -> usize {
        self.read().index.len()
    }

    /// Whether every node of the vessels is indexed.
    pub fn is_complete(&self, vessels: &Vessels) -> bool {
        let state = self.read();
        state.tree == vessels.lineage() && state.index.len() == vessels.tree().len()
    }

    /// Has large vessels indexed before the first query, so that this is quick, too. The plugin does so for
    /// [`Cuttable`](crate::plugin::Cuttable) organs.
    pub fn prepare(&self) {
        self.write().is_wanted = true;
    }

    /// The index, up to date with the vessels, for any number of queries. The log is that of the same entity.
    pub(crate) fn search<'a>(&'a self, vessels: &'a Vessels, log: &ChangeLog) -> IndexedVessels<'a> {
        let state = self.read();
        if state.is_wanted && state.follows(vessels, log) {
            return IndexedVessels { vessels, state };
        }
        drop(state);
        let mut state = self.write();
        state.is_wanted = true;
        state.follow(vessels, log);
        IndexedVessels { vessels, state: RwLockWriteGuard::downgrade(state) }
    }

    /// A query that panicked leaves at worst an outdated index, which the next one detects.
    fn read(&self) -> RwLockReadGuard<'_, IndexState> {
        self.state.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, IndexState> {
        self.state.write().unwrap_or_else(PoisonError::into_inner)
    }
}

impl IndexState {
    /// Whether the index is up to date with the vessels, for the nodes that it holds.
    fn follows(&self, vessels: &Vessels, log: &ChangeLog) -> bool {
        let len = vessels.tree().len();
        let is_long_enough = self.index.len() == len || len > self.at_once;
        self.tree == vessels.lineage() && self.index.len() <= len && is_long_enough && self.cursor.is_current(log)
    }

    /// Updates changed segments, and indexes the new nodes of a small tree.
    fn follow(&mut self, vessels: &Vessels, log: &ChangeLog) {
        self.forget_others(vessels);
        let (tree, known) = (vessels.tree(), self.index.len());
        if tree.len() <= self.at_once {
            self.index.extend(tree);
        }
        let changes = self.cursor.read(log);
        if changes.count(known) > known / 8 {
            self.index.refit(tree);
        } else {
            self.index.refit_nodes(tree, changes.dirty_nodes(0..known).map(|node| NodeId(node as u32)));
        }
    }

    /// Forgets another tree's segments.
    fn forget_others(&mut self, vessels: &Vessels) {
        if self.tree != vessels.lineage() || self.index.len() > vessels.tree().len() {
            let (is_wanted, at_once) = (self.is_wanted, self.at_once);
            *self = Self { tree: vessels.lineage(), is_wanted, at_once, ..Self::default() };
        }
    }

    /// Takes over an index that has become ready, and starts indexing a large tree again when that pays.
    fn advance(&mut self, vessels: &Vessels, log: &ChangeLog, jobs: &Jobs) {
        self.at_once = jobs.at_once();
        match Job::poll(&mut self.coming) {
            Some(Ok(come)) => (self.index, self.cursor) = (come.index, come.cursor),
            Some(Err(panic)) => {
                warn!("large vessels are searched one by one, which is slow: {panic}");
                self.has_failed = true;
            }
            None => {}
        }
        self.forget_others(vessels);
        let (len, indexed) = (vessels.tree().len(), self.index.len());
        self.idle_frames = if len == self.len { self.idle_frames.saturating_add(1) } else { 0 };
        self.len = len;
        let is_due = len - indexed > indexed / 2 || self.idle_frames > VesselIndex::IDLE_FRAMES;
        let is_due = is_due && self.coming.is_none() && !self.has_failed;
        if len <= self.at_once && len > indexed && self.idle_frames > VesselIndex::IDLE_FRAMES {
            // A small tree waits for no query, either, once it has grown.
            self.follow(vessels, log);
        }
        if len > self.at_once && len > indexed && is_due {
            let (tree, cursor) = (vessels.tree().clone(), log.now());
            self.coming = Some(jobs.start(len, |pace| ComingIndex::of(tree, cursor, pace)));
        }
    }
}

/// Vessels with their index, for queries. Both stay as they are while this is held.
#[derive(Debug)]
pub(crate) struct IndexedVessels<'a> {
    pub(crate) vessels: &'a Vessels,
    state: RwLockReadGuard<'a, IndexState>,
}

impl IndexedVessels<'_> {
    pub(crate) fn tree(&self) -> &VesselTree {
        self.vessels.tree()
    }

    /// Visits at least the segments that meet a region, each by its end node.
    pub(crate) fn candidates(&self, region: &Region, visit: &mut dyn FnMut(NodeId)) {
        let (tree, min, max) = (self.tree(), region.min(), region.max());
        self.state.index.candidates_in(region, &mut *visit);
        for node in self.state.index.len()..tree.len() {
            let parent = tree.parents()[node];
            if parent == NO_PARENT {
                continue;
            }
            let (a, b, radius) = (tree.positions()[node], tree.positions()[parent as usize], tree.radii()[node]);
            if (a.min(b) - radius).cmple(max).all() && (a.max(b) + radius).cmpge(min).all() {
                visit(NodeId(node as u32));
            }
        }
    }

    /// Casts a ray against the segments in its way. `pieces` gives the remaining parts of each, as shares of the way
    /// from the parent's node.
    pub(crate) fn cast<Pieces>(&self, ray: &mut RayCast, pieces: impl Fn(NodeId) -> Pieces)
    where
        Pieces: IntoIterator<Item = [f32; 2]>,
    {
        let (tree, index) = (self.tree(), &self.state.index);
        index.cast(tree, ray, &pieces);
        for node in (index.len() as u32..tree.len() as u32).map(NodeId) {
            if ray.may_meet(tree, node) {
                ray.meet(tree, node, pieces(node));
            }
        }
    }
}

impl SegmentSearch for &IndexedVessels<'_> {
    fn candidates(&mut self, region: &Region, visit: &mut dyn FnMut(NodeId)) {
        IndexedVessels::candidates(self, region, visit);
    }

    fn leaving(&mut self, _: &VesselTree, node: NodeId, visit: &mut dyn FnMut(NodeId)) {
        self.vessels.children(node.index()).for_each(|child| visit(NodeId(child as u32)));
    }
}

/// Cut: advances the indexes that have been queried.
pub(crate) fn index_vessels(mut vessels: Query<(&Vessels, &ChangeLog, &mut VesselIndex)>, jobs: Jobs) {
    for (vessels, log, mut index) in &mut vessels {
        let state = index.bypass_change_detection().state.get_mut().unwrap_or_else(PoisonError::into_inner);
        if state.is_wanted {
            state.advance(vessels, log, &jobs);
        }
    }
}
