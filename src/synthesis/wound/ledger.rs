//! The ledger of what was done to one tree: cuts, clamps, ties and seals, with undo.

use crate::synthesis::haemodynamics::EndSide;
use crate::synthesis::tree::{NodeId, Place, VesselTree};
use crate::synthesis::wound::blade::Shape;
use crate::synthesis::wound::crossing::{Severed, segment, severed, within};
use crate::synthesis::wound::injury::{ClosureKind, End, Injury, NO_INJURY};
#[cfg(feature = "serialize")]
use crate::synthesis::wound::saved::SavedWounds;
use crate::synthesis::wound::withdrawal::Plan;
use crate::synthesis::{
    segment_index::{Region, SegmentSearch},
    wound::{Blade, BladeError, ClampId, EndId, Retraction, SeveredEnd, WoundError, WoundReport},
};
use std::{collections::BTreeMap, ops::Range};

/// All that was done to one tree.
///
/// The tree itself stays as it is: it may grow and move beneath, and every place keeps its share of its segment. All
/// calls take the tree that the wounds belong to; after another one took its place, [`clear`](Self::clear).
///
/// `candidates(region, visit)` is the index over the tree's segments: it calls `visit` with at least those that meet a
/// region, as [`SegmentIndex::candidates_in`](crate::synthesis::segment_index::SegmentIndex::candidates_in) does. A cut
/// asks more of it, which the same closure answers: see [`SegmentSearch`].
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(into = "SavedWounds", try_from = "SavedWounds"))]
pub struct Wounds {
    pub(super) retraction: Retraction,
    /// By node. None of them is empty.
    pub(super) injuries: BTreeMap<u32, Injury>,
    pub(super) ends: Vec<Record>,
    pub(super) clamps: Vec<Record>,
    journal: Vec<Action>,
    /// What the segments touched by the journal's actions were before, in order.
    before: Vec<(u32, Injury)>,
    pub(super) generation: u32,
    hits: Vec<Severed>,
}

/// An end or a clamp that was made, in the order of making.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Record {
    pub(super) node: u32,
    generation: u32,
}

/// How long the ledger's lists were before an action.
#[derive(Clone, Copy, Debug)]
struct Action {
    ends: usize,
    clamps: usize,
    before: usize,
}

impl Wounds {
    /// No wounds yet.
    ///
    /// # Errors
    /// A retraction outside its limits.
    pub fn new(retraction: Retraction) -> Result<Self, WoundError> {
        retraction.validate()?;
        Ok(Self { retraction, ..Self::default() })
    }

    /// How far ends draw back.
    pub fn retraction(&self) -> Retraction {
        self.retraction
    }

    /// Changes how far the ends of later cuts draw back.
    ///
    /// # Errors
    /// A value outside its limits.
    pub fn set_retraction(&mut self, retraction: Retraction) -> Result<(), WoundError> {
        retraction.validate()?;
        self.retraction = retraction;
        Ok(())
    }

    /// Whether every segment is as it grew.
    pub fn is_empty(&self) -> bool {
        self.injuries.is_empty()
    }

    /// Number of the last action that changed anything. It only rises, through undo and clear too, so that whatever
    /// carries it can be told from what came later.
    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// Number of actions that can be undone.
    pub fn actions(&self) -> usize {
        self.journal.len()
    }

    /// Severs every vessel that the blade crosses; a ball or capsule also takes out what lies within it.
    ///
    /// The blade is in the tree's space: see [`Blade::to_local`]. What counts as crossed is said at
    /// [`severed`]. Gaps are no vessel: what crosses one severs nothing there. How far the ends draw back, and what holds
    /// them, is said at [`Retraction`].
    pub fn cut(&mut self, blade: &Blade, tree: &VesselTree, mut search: impl SegmentSearch) -> WoundReport {
        let mut hits = std::mem::take(&mut self.hits);
        severed(blade, tree, |region, visit| search.candidates(region, visit), &mut hits);
        let action = self.begin();
        let mut plan = Plan::new(tree, &self.injuries, &hits, search, self.retraction);
        let generation = self.generation + 1;
        let ends = &mut self.ends;
        let mut new_end = |node: NodeId| {
            ends.push(Record { node: node.0, generation });
            ends.len() as u32 - 1
        };
        if blade.is_volume() {
            plan.take_out(&mut new_end);
        } else {
            plan.cut(&mut new_end);
        }
        let Plan { severed: places, mut changes, .. } = plan;
        self.hits = hits;
        // In the order in which they were planned, where a segment has several.
        changes.sort_by_key(|&(node, _)| node);
        for of_segment in changes.chunk_by(|(a, _), (b, _)| a == b) {
            self.change(of_segment[0].0, |injury| {
                of_segment.iter().fold(false, |changed, (_, change)| change.apply(injury) || changed)
            });
        }
        WoundReport { severed: places, ..self.finish(action, tree) }
    }

    /// Puts a clamp on a vessel: no blood passes until it is taken off.
    ///
    /// # Errors
    /// A place that is not on a vessel of the tree, or in a gap.
    pub fn clamp(&mut self, place: Place, tree: &VesselTree) -> Result<(ClampId, WoundReport), WoundError> {
        let clamp = ClampId { index: self.clamps.len() as u32, generation: self.generation + 1 };
        let report = self.close(place, tree, ClosureKind::Clamp(clamp.index))?;
        Ok((clamp, report))
    }

    /// Takes a clamp off.
    ///
    /// # Errors
    /// When it is not on.
    pub fn unclamp(&mut self, clamp: ClampId, tree: &VesselTree) -> Result<WoundReport, WoundError> {
        let record = self.clamps.get(clamp.index as usize).filter(|record| record.generation == clamp.generation);
        let &Record { node, .. } = record.ok_or(WoundError::NoSuchClamp { clamp })?;
        let action = self.begin();
        self.change(node, |injury| injury.unclamp(clamp.index));
        let report = self.finish(action, tree);
        if report.is_empty() { Err(WoundError::NoSuchClamp { clamp }) } else { Ok(report) }
    }

    /// Ties a vessel off: a clamp that only undo takes off again.
    ///
    /// # Errors
    /// A place that is not on a vessel of the tree, or in a gap.
    pub fn ligate(&mut self, place: Place, tree: &VesselTree) -> Result<WoundReport, WoundError> {
        self.close(place, tree, ClosureKind::Tie)
    }

    /// Seals by heat, within a ball or capsule, all vessels up to a calibre, for good: intact ones over the length that
    /// lies within, and open ends that do. A cut through a sealed stretch opens nothing.
    ///
    /// `max_calibre` is the largest diameter that the instrument seals, in tissue lengths; infinity for any. Bipolar
    /// instruments are rated to 7 mm.
    ///
    /// # Errors
    /// A blade that is a surface, a calibre that is not above 0.
    pub fn cauterise(
        &mut self,
        volume: &Blade,
        max_calibre: f32,
        tree: &VesselTree,
        mut candidates: impl FnMut(&Region, &mut dyn FnMut(NodeId)),
    ) -> Result<WoundReport, WoundError> {
        let Shape::Volume(inside) = &volume.shape else { return Err(BladeError::NotAVolume.into()) };
        if !(max_calibre > 0.0) {
            return Err(WoundError::Calibre { calibre: max_calibre });
        }
        let mut nodes = Vec::new();
        volume.parts(|region, _| candidates(region, &mut |node| nodes.push(node.0)));
        nodes.sort_unstable();
        nodes.dedup();
        let action = self.begin();
        for node in nodes {
            let Some([parent, end]) = segment(tree, NodeId(node)) else { continue };
            let is_small = 2.0 * tree.radii()[node as usize] <= max_calibre;
            if let Some(range) = within(inside, parent, end).filter(|_| is_small) {
                self.change(node, |injury| injury.seal(range.from as f32, range.to as f32));
            }
        }
        Ok(self.finish(action, tree))
    }

    /// Undoes the last action that changed anything; `None` where there is none.
    pub fn undo(&mut self, tree: &VesselTree) -> Option<WoundReport> {
        (!self.journal.is_empty()).then(|| self.undo_last(1, tree))
    }

    /// Undoes the last actions that changed anything, and reports what that changed in sum: all where they are fewer.
    pub fn undo_last(&mut self, actions: usize, tree: &VesselTree) -> WoundReport {
        let mut report = WoundReport::default();
        let left = self.journal.len().saturating_sub(actions);
        let Some(&first) = self.journal.get(left) else { return report };
        let mut touched = self.before.split_off(first.before);
        // Of what a segment was before several actions, the first counts: the order of these stays.
        touched.sort_by_key(|&(node, _)| node);
        touched.dedup_by_key(|&mut (node, _)| node);
        for (node, before) in touched {
            let now = self.injuries.remove(&node).unwrap_or_default();
            self.compare(tree, node, &now, &before, &mut report);
            if !before.is_empty() {
                self.injuries.insert(node, before);
            }
        }
        self.journal.truncate(left);
        self.ends.truncate(first.ends);
        self.clamps.truncate(first.clamps);
        report
    }

    /// Undoes all actions, and reports what that changed in sum.
    pub fn undo_all(&mut self, tree: &VesselTree) -> WoundReport {
        let mut report = WoundReport::default();
        for (&node, injury) in &self.injuries {
            self.compare(tree, node, injury, &NO_INJURY, &mut report);
        }
        self.clear();
        report
    }

    /// Forgets everything, for another tree. The settings stay.
    pub fn clear(&mut self) {
        self.injuries.clear();
        self.ends.clear();
        self.clamps.clear();
        self.journal.clear();
        self.before.clear();
    }

    /// The severed end of an id, where it is now; `None` where it is gone.
    pub fn end(&self, id: EndId, tree: &VesselTree) -> Option<SeveredEnd> {
        let record = self.ends.get(id.index as usize).filter(|record| record.generation == id.generation)?;
        let injury = self.injuries.get(&record.node)?;
        let end = injury.ends().find(|end| end.index == id.index)?;
        self.locate(tree, record.node, end)
    }

    /// All severed ends, open or not, where they are now: in the order of the nodes, then from parent to node.
    pub fn ends<'a>(&'a self, tree: &'a VesselTree) -> impl Iterator<Item = SeveredEnd> + 'a {
        let of_segment = move |(&node, injury): (&u32, &'a Injury)| {
            injury.ends().filter_map(move |end| self.locate(tree, node, end))
        };
        self.injuries.iter().flat_map(of_segment)
    }

    /// Where a clamp sits; `None` where it is no longer on.
    pub fn clamp_place(&self, clamp: ClampId) -> Option<Place> {
        let record = self.clamps.get(clamp.index as usize).filter(|record| record.generation == clamp.generation)?;
        let closures = self.injuries.get(&record.node)?.closures();
        let found = closures.iter().find(|closure| closure.kind == ClosureKind::Clamp(clamp.index))?;
        Some(Place::new(NodeId(record.node), found.from))
    }

    /// The clamps that are on, in the order of their nodes.
    pub fn clamps(&self) -> impl Iterator<Item = ClampId> + '_ {
        let id = |index: u32| ClampId { index, generation: self.clamps[index as usize].generation };
        self.injuries.values().flat_map(Injury::clamps).map(id)
    }

    /// Whether every segment that something was done to is one of a tree's, so that this may be the ledger of that tree.
    pub fn fits(&self, tree: &VesselTree) -> bool {
        self.injuries.keys().all(|&node| segment(tree, NodeId(node)).is_some())
    }

    /// What was done, without what it takes to undo it.
    #[must_use]
    pub fn without_history(&self) -> Self {
        let Self { retraction, generation, .. } = *self;
        let (injuries, ends, clamps) = (self.injuries.clone(), self.ends.clone(), self.clamps.clone());
        Self { retraction, generation, injuries, ends, clamps, ..Self::default() }
    }

    /// The segments that anything was done to, in the order of their nodes.
    pub fn injured(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.injuries().map(|(node, _)| node)
    }

    pub(super) fn injury(&self, node: NodeId) -> Option<&Injury> {
        self.injuries.get(&node.0)
    }

    pub(super) fn injuries(&self) -> impl Iterator<Item = (NodeId, &Injury)> {
        self.injuries.iter().map(|(&node, injury)| (NodeId(node), injury))
    }

    pub(super) fn injuries_within(&self, nodes: Range<usize>) -> impl Iterator<Item = (NodeId, &Injury)> {
        let bound = |node: usize| u32::try_from(node).unwrap_or(u32::MAX);
        // An empty range may lie anywhere: a map takes none that is the wrong way round.
        let nodes = bound(nodes.start)..bound(nodes.end.max(nodes.start));
        self.injuries.range(nodes).map(|(&node, injury)| (NodeId(node), injury))
    }

    pub(super) fn end_id(&self, index: u32) -> EndId {
        EndId { index, generation: self.ends[index as usize].generation }
    }

    fn close(&mut self, place: Place, tree: &VesselTree, kind: ClosureKind) -> Result<WoundReport, WoundError> {
        check(place, tree)?;
        let action = self.begin();
        let closes = self.change(place.node.0, |injury| {
            injury.has_vessel(place.along) && {
                injury.close(place.along, kind);
                true
            }
        });
        if closes && matches!(kind, ClosureKind::Clamp(_)) {
            self.clamps.push(Record { node: place.node.0, generation: self.generation + 1 });
        }
        let report = self.finish(action, tree);
        if report.is_empty() { Err(WoundError::NoVessel { place }) } else { Ok(report) }
    }

    fn begin(&self) -> Action {
        Action { ends: self.ends.len(), clamps: self.clamps.len(), before: self.before.len() }
    }

    /// Changes one segment. `change` says whether it did, and so does this.
    fn change(&mut self, node: u32, change: impl FnOnce(&mut Injury) -> bool) -> bool {
        let before = self.injuries.remove(&node).unwrap_or_default();
        let mut injury = before.clone();
        let changed = change(&mut injury);
        if !injury.is_empty() {
            self.injuries.insert(node, injury);
        }
        if changed {
            self.before.push((node, before));
        }
        changed
    }

    /// Ends an action: it counts if it changed anything.
    fn finish(&mut self, action: Action, tree: &VesselTree) -> WoundReport {
        let mut report = WoundReport::default();
        if self.before.len() == action.before {
            return report;
        }
        self.generation += 1;
        self.journal.push(action);
        for (node, before) in &self.before[action.before..] {
            let now = self.injuries.get(node).unwrap_or(&NO_INJURY);
            self.compare(tree, *node, before, now, &mut report);
        }
        report
    }

    /// Adds to a report what became of one segment.
    fn compare(&self, tree: &VesselTree, node: u32, before: &Injury, now: &Injury, report: &mut WoundReport) {
        let [was_open, stays_open] = [before, now].map(|injury| {
            let mut open: Vec<u32> = injury.ends().filter(|end| end.is_open).map(|end| end.index).collect();
            open.sort_unstable();
            open
        });
        let opened = now.ends().filter(|end| end.is_open && was_open.binary_search(&end.index).is_err());
        report.opened.extend(opened.filter_map(|end| self.locate(tree, node, end)));
        let closed = before.ends().filter(|end| end.is_open && stays_open.binary_search(&end.index).is_err());
        report.closed.extend(closed.map(|end| self.end_id(end.index)));
        let clamp_id = |index: u32| ClampId { index, generation: self.clamps[index as usize].generation };
        let lacking = |here: &Injury, there: &Injury| -> Vec<ClampId> {
            here.clamps().filter(|&clamp| there.clamps().all(|other| other != clamp)).map(clamp_id).collect()
        };
        report.clamped.extend(lacking(now, before));
        report.unclamped.extend(lacking(before, now));
        report.changed.push(NodeId(node));
    }

    /// A severed end as it lies in the tree; `None` where the tree has no such segment.
    fn locate(&self, tree: &VesselTree, node: u32, end: End) -> Option<SeveredEnd> {
        let place = Place::new(NodeId(node), end.along);
        let [start, stop] = segment(tree, place.node)?;
        // In f64, since a segment may be too short for the square of its length in f32.
        let along = (stop.as_dvec3() - start.as_dvec3()).normalize_or_zero().as_vec3();
        Some(SeveredEnd {
            id: self.end_id(end.index),
            place,
            side: end.side,
            is_open: end.is_open,
            position: tree.position_at(place),
            direction: if end.side == EndSide::Proximal { along } else { -along },
            radius: tree.radii()[place.node.index()],
        })
    }
}

/// Passes a place on a segment of the tree.
fn check(place: Place, tree: &VesselTree) -> Result<(), WoundError> {
    let Place { node, along } = place;
    if node.index() >= tree.len() {
        return Err(WoundError::NoSuchNode { node: node.0, nodes: tree.len() });
    }
    if tree.parent(node).is_none() {
        return Err(WoundError::OnRoot { node: node.0 });
    }
    if !(0.0..=1.0).contains(&along) {
        return Err(WoundError::Along { node: node.0, along });
    }
    Ok(())
}
