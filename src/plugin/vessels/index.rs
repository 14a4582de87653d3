//! Which segments of a vessel entity an instrument may meet, at any moment of a growth and without holding up a frame.
//!
//! In: [`Vessels`], and which of them moved. Out: candidates for a cut or a touch. Small trees are indexed when they are
//! first asked about. Large ones are indexed in the task pool; what the index doesn't hold yet is searched one by one,
//! so that an answer is complete at any time.

use crate::plugin::vessels::tree::{Lineage, Vessels};
use crate::synthesis::{
    segment_index::{Region, SegmentIndex, SegmentSearch},
    tree::{NO_PARENT, NodeId, VesselTree},
};
use bevy::{
    ecs::{change_detection::DetectChanges, component::Component, system::Query, world::Ref},
    tasks::{AsyncComputeTaskPool, Task, TaskPool, futures::check_ready},
};

/// An index over the segments of a vessel entity. The plugin adds it to the vessels of a
/// [`Cuttable`](crate::plugin::Cuttable) organ and keeps it up to date.
#[derive(Component, Debug, Default)]
pub struct VesselIndex {
    index: SegmentIndex,
    lineage: Lineage,
    /// What moved since the index was measured.
    moved: Moved,
    task: Option<Task<SegmentIndex>>,
    /// What moved since the tree was copied for the task.
    moved_meanwhile: Moved,
    idle_frames: u32,
}

/// Nodes that moved or changed their radius.
#[derive(Debug, Default)]
enum Moved {
    #[default]
    None,
    Nodes(Vec<u32>),
    All,
}

impl Moved {
    fn add(&mut self, nodes: impl IntoIterator<Item = u32>, most: usize) {
        match self {
            Self::None => *self = Self::Nodes(nodes.into_iter().collect()),
            Self::Nodes(moved) => moved.extend(nodes),
            Self::All => {}
        }
        if matches!(self, Self::Nodes(moved) if moved.len() > most) {
            *self = Self::All;
        }
    }
}

impl VesselIndex {
    /// Nodes that are indexed within a frame, some 3 ms. Larger trees are indexed beside the frames.
    const AT_ONCE: usize = 8192;
    /// Frames without growth after which what it left is indexed.
    const IDLE_FRAMES: u32 = 10;

    /// Nodes that the index holds; the others are searched one by one.
    pub fn indexed(&self) -> usize {
        self.index.len()
    }

    /// Whether every node of the vessels is indexed.
    pub fn is_complete(&self, vessels: &Vessels) -> bool {
        self.lineage == vessels.lineage() && self.index.len() == vessels.tree().len()
    }

    /// Takes note of nodes that moved, with their children; `None` for all.
    pub(crate) fn note_moved(&mut self, vessels: &Vessels, nodes: Option<&[u32]>) {
        let most = vessels.tree().len() / 8;
        for moved in [&mut self.moved, &mut self.moved_meanwhile] {
            match nodes {
                None => *moved = Moved::All,
                Some(nodes) => {
                    let children = |&node: &u32| vessels.children(node as usize).map(|child| child as u32);
                    moved.add(nodes.iter().copied().chain(nodes.iter().flat_map(children)), most);
                }
            }
        }
    }

    /// Makes the index right for the vessels as they are: to be called before questions.
    pub(crate) fn refresh(&mut self, vessels: &Vessels) {
        self.follow(vessels);
        if vessels.tree().len() <= Self::AT_ONCE {
            self.index.extend(vessels.tree());
        }
        match std::mem::take(&mut self.moved) {
            Moved::None => {}
            Moved::Nodes(nodes) => self.index.refit_nodes(vessels.tree(), nodes.into_iter().map(NodeId)),
            Moved::All => self.index.refit(vessels.tree()),
        }
    }

    /// Visits at least the segments that meet a region, each by its end node. Call [`refresh`](Self::refresh) before.
    pub(crate) fn candidates(&self, tree: &VesselTree, region: &Region, visit: &mut dyn FnMut(NodeId)) {
        let (min, max) = (region.min(), region.max());
        self.index.candidates_in(region, &mut *visit);
        for node in self.index.len()..tree.len() {
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

    /// Forgets another tree's segments, and takes over an index that has become ready.
    fn follow(&mut self, vessels: &Vessels) {
        if self.lineage != vessels.lineage() || self.index.len() > vessels.tree().len() {
            *self = Self { lineage: vessels.lineage(), ..Self::default() };
        }
        if let Some(index) = self.task.as_mut().and_then(check_ready) {
            self.task = None;
            self.index = index;
            self.moved = std::mem::take(&mut self.moved_meanwhile);
        }
    }

    /// Begins to index a large tree anew where that pays.
    fn begin(&mut self, vessels: &Vessels, grew: bool) {
        let (len, indexed) = (vessels.tree().len(), self.index.len());
        self.idle_frames = if grew { 0 } else { self.idle_frames.saturating_add(1) };
        let is_due = len - indexed > indexed / 2 || self.idle_frames > Self::IDLE_FRAMES;
        if len > Self::AT_ONCE && len > indexed && is_due && self.task.is_none() {
            let tree = vessels.tree().clone();
            let pool = AsyncComputeTaskPool::get_or_init(TaskPool::new);
            self.task = Some(pool.spawn(async move { SegmentIndex::new(&tree) }));
            self.moved_meanwhile = Moved::None;
        }
    }
}

/// Vessels with their index, to be cut.
pub(crate) struct IndexedVessels<'a> {
    pub(crate) vessels: &'a Vessels,
    pub(crate) index: &'a VesselIndex,
}

impl SegmentSearch for IndexedVessels<'_> {
    fn candidates(&mut self, region: &Region, visit: &mut dyn FnMut(NodeId)) {
        self.index.candidates(self.vessels.tree(), region, visit);
    }

    fn leaving(&mut self, _: &VesselTree, node: NodeId, visit: &mut dyn FnMut(NodeId)) {
        self.vessels.children(node.index()).for_each(|child| visit(NodeId(child as u32)));
    }
}

/// Cut: indexes go on being built.
pub(crate) fn index_vessels(mut vessels: Query<(Ref<Vessels>, &mut VesselIndex)>) {
    for (vessels, mut index) in &mut vessels {
        index.follow(&vessels);
        index.begin(&vessels, vessels.is_changed());
    }
}
