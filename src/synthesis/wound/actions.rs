//! Actions on vessels: cut, clamp, tie and seal.

use crate::synthesis::{
    segment_index::{Region, SegmentSearch},
    tree::{NodeId, Place, VesselTree},
    wound::{
        Blade, BladeError, ClampId, WoundError, WoundReport, Wounds,
        blade::Shape,
        crossing::{segment, severed, within},
        injury::ClosureKind,
        ledger::Record,
        withdrawal::Plan,
    },
};

impl Wounds {
    /// Severs every vessel that the blade crosses; a ball or capsule also removes what lies within it.
    ///
    /// The blade is in the tree's space: see [`Blade::to_local`]. [`severed`] defines what counts as crossed. A blade
    /// that crosses a gap severs nothing there. [`Retraction`](super::Retraction) defines how far the ends retract, and
    /// what holds them.
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
        // Several changes of one segment stay in the order of the plan.
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
    /// If it is not on.
    pub fn unclamp(&mut self, clamp: ClampId, tree: &VesselTree) -> Result<WoundReport, WoundError> {
        let record = self.clamps.get(clamp.index as usize).filter(|record| record.generation == clamp.generation);
        let &Record { node, .. } = record.ok_or(WoundError::NoSuchClamp { clamp })?;
        let action = self.begin();
        self.change(node, |injury| injury.unclamp(clamp.index));
        let report = self.finish(action, tree);
        if report.is_empty() { Err(WoundError::NoSuchClamp { clamp }) } else { Ok(report) }
    }

    /// Ties a vessel off: a clamp that only undo removes.
    ///
    /// # Errors
    /// A place that is not on a vessel of the tree, or in a gap.
    pub fn ligate(&mut self, place: Place, tree: &VesselTree) -> Result<WoundReport, WoundError> {
        self.close(place, tree, ClosureKind::Tie)
    }

    /// Permanently seals by heat, within a ball or capsule, all vessels up to a calibre: intact ones over their length
    /// inside, and open ends inside. A cut through a sealed stretch opens nothing.
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
}

/// Checks that a place is on a segment of the tree.
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
