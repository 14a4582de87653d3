//! The injury of one segment: its gaps and closures.
//!
//! Gaps are in order along the segment and don't overlap. Between them are its pieces, one more than gaps, some of them
//! without length. A clamp, tie or seal lies on a piece. One exactly at the tip of a piece belongs to that piece; if
//! two tips touch, to the one towards the root.
//!
//! The extent of a gap is decided where the whole tree is known: see `withdrawal`.

use crate::synthesis::haemodynamics::EndSide;

/// A severed end, by its index in the ledger.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Tip {
    pub end: u32,
    /// Whether the lumen is permanently closed.
    pub sealed: bool,
}

/// A stretch of the segment where there is no vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Gap {
    pub from: f32,
    pub to: f32,
    /// The vessel's end at `from`; `None` if the part before it is gone, including the parent's node.
    pub proximal: Option<Tip>,
    /// The end at `to`; `None` if the part behind it is gone, including the segment's own node.
    pub distal: Option<Tip>,
}

impl Gap {
    /// The gap of a wholly removed segment.
    pub const WHOLE: Self = Self { from: 0.0, to: 1.0, proximal: None, distal: None };
}

/// The kind of a closure of the lumen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum ClosureKind {
    /// A clamp, by its index in the ledger.
    Clamp(u32),
    Tie,
    /// Coagulated by heat.
    Seal,
}

/// A stretch of a piece that carries no blood. Only seals have a length.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Closure {
    pub from: f32,
    pub to: f32,
    pub kind: ClosureKind,
}

/// An end on its segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// Its index in the ledger.
    pub index: u32,
    pub side: EndSide,
    /// Share of the segment at its tip.
    pub along: f32,
    /// Whether it is not sealed, and nothing closes its piece.
    pub is_open: bool,
}

/// All gaps and closures of a segment.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Injury {
    gaps: Vec<Gap>,
    /// In the order of `from`.
    closures: Vec<Closure>,
}

/// The empty injury of a whole segment.
pub(super) static NO_INJURY: Injury = Injury { gaps: Vec::new(), closures: Vec::new() };

/// A stretch that a volume removes, as in [`Severed`](super::Severed).
#[derive(Clone, Copy, Debug)]
pub(super) struct Removal {
    pub from: f32,
    pub to: f32,
    pub enters: bool,
    pub leaves: bool,
}

impl Injury {
    /// Whether the vessel is neither severed nor closed.
    pub fn is_empty(&self) -> bool {
        self.gaps.is_empty() && self.closures.is_empty()
    }

    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    pub fn closures(&self) -> &[Closure] {
        &self.closures
    }

    /// The piece before gap `index`; the one behind the last gap for the number of gaps.
    pub fn piece(&self, index: usize) -> [f32; 2] {
        let from = index.checked_sub(1).map_or(0.0, |before| self.gaps[before].to);
        [from, self.gaps.get(index).map_or(1.0, |gap| gap.from)]
    }

    /// All pieces, including those without length.
    pub fn pieces(&self) -> impl Iterator<Item = [f32; 2]> + '_ {
        (0..=self.gaps.len()).map(|index| self.piece(index))
    }

    /// Index of the piece that a closure belongs to.
    fn piece_of(&self, closure: &Closure) -> usize {
        let middle = 0.5 * (f64::from(closure.from) + f64::from(closure.to));
        self.gaps.partition_point(|gap| middle > f64::from(gap.from))
    }

    /// The closures of a piece.
    fn closures_of(&self, piece: usize) -> impl Iterator<Item = &Closure> {
        self.closures.iter().filter(move |closure| self.piece_of(closure) == piece)
    }

    /// The gap that contains a share, its ends included.
    pub fn gap_at(&self, share: f32) -> Option<&Gap> {
        self.gaps.iter().find(|gap| gap.from <= share && share <= gap.to)
    }

    /// Opens a gap where there is a vessel.
    pub fn open(&mut self, gap: Gap) {
        self.clear_closures(gap.from, gap.to);
        let at = self.gaps.partition_point(|other| other.from <= gap.from);
        self.gaps.insert(at, gap);
    }

    /// Removes a stretch, and leaves a gap that contains it. Ends within that are removed. Returns whether it removed
    /// anything that still existed.
    pub fn take_out(&mut self, removal: Removal, gap: Gap) -> bool {
        if self.gaps.contains(&gap) {
            return false;
        }
        let Removal { from, to, enters, leaves } = removal;
        let is_gone = |closure: &Closure| {
            closure.kind != ClosureKind::Seal && ((!enters && closure.from <= to) || (!leaves && closure.from >= from))
        };
        self.closures.retain(|closure| !is_gone(closure));
        self.gaps.retain(|other| other.to < gap.from || other.from > gap.to);
        self.open(gap);
        true
    }

    /// Whether an end that faces the tips would be sealed at a share.
    pub fn is_sealed_below(&self, share: f32) -> bool {
        self.seals().any(|seal| seal.from < share && share <= seal.to)
    }

    /// Whether an end that faces the root would be sealed at a share.
    pub fn is_sealed_above(&self, share: f32) -> bool {
        self.seals().any(|seal| seal.from <= share && share < seal.to)
    }

    fn seals(&self) -> impl Iterator<Item = &Closure> {
        self.closures.iter().filter(|closure| closure.kind == ClosureKind::Seal)
    }

    /// The share of the gap, clamp or tie that holds an end that retracts from `share` towards the root. `None` if it
    /// may continue to the parent.
    pub fn hold_below(&self, share: f32) -> Option<f32> {
        let holds = self.gaps.iter().map(|gap| gap.to).chain(self.clamped());
        holds.filter(|&hold| hold <= share).reduce(f32::max)
    }

    /// The same for an end that retracts towards the node. A clamp at `share` itself stays with the other end.
    pub fn hold_above(&self, share: f32) -> Option<f32> {
        let holds = self.gaps.iter().map(|gap| gap.from).chain(self.clamped());
        holds.filter(|&hold| hold > share).reduce(f32::min)
    }

    /// Shares of clamps and ties.
    fn clamped(&self) -> impl Iterator<Item = f32> {
        self.closures.iter().filter(|closure| closure.kind != ClosureKind::Seal).map(|closure| closure.from)
    }

    /// Removes closures in a removed stretch. Seals that extend beyond it keep the rest.
    fn clear_closures(&mut self, from: f32, to: f32) {
        let mut rest = Vec::new();
        self.closures.retain_mut(|closure| {
            if closure.kind != ClosureKind::Seal {
                return closure.from <= from || closure.from >= to;
            }
            let beyond = Closure { from: closure.from.max(to), ..*closure };
            if beyond.from < beyond.to && closure.from < from {
                rest.push(beyond);
            }
            if closure.from < from {
                closure.to = closure.to.min(from);
            } else {
                *closure = beyond;
            }
            closure.from < closure.to
        });
        self.closures.append(&mut rest);
        self.closures.sort_by(|a, b| a.from.total_cmp(&b.from));
    }

    /// Whether there is a vessel, tips included, at a share.
    pub fn has_vessel(&self, along: f32) -> bool {
        let [from, to] = self.piece(self.gaps.partition_point(|gap| along > gap.from));
        from < to && from <= along && along <= to
    }

    /// Puts a clamp or a tie on existing vessel.
    pub fn close(&mut self, along: f32, kind: ClosureKind) {
        let at = self.closures.partition_point(|other| other.from <= along);
        self.closures.insert(at, Closure { from: along, to: along, kind });
    }

    /// The clamps that are on.
    pub fn clamps(&self) -> impl Iterator<Item = u32> {
        self.closures.iter().filter_map(|closure| match closure.kind {
            ClosureKind::Clamp(clamp) => Some(clamp),
            ClosureKind::Tie | ClosureKind::Seal => None,
        })
    }

    /// Takes a clamp off; false if it is not on.
    pub fn unclamp(&mut self, clamp: u32) -> bool {
        let before = self.closures.len();
        self.closures.retain(|closure| closure.kind != ClosureKind::Clamp(clamp));
        self.closures.len() < before
    }

    /// Seals the existing vessel between two shares, and the ends there. Returns whether anything changed.
    pub fn seal(&mut self, from: f32, to: f32) -> bool {
        let before = self.clone();
        let is_within = |share: f32| from <= share && share <= to;
        for gap in &mut self.gaps {
            for (share, tip) in [(gap.from, &mut gap.proximal), (gap.to, &mut gap.distal)] {
                if let Some(tip) = tip {
                    tip.sealed |= is_within(share);
                }
            }
        }
        for index in 0..=self.gaps.len() {
            let [start, end] = self.piece(index);
            self.seal_within(from.max(start), to.min(end), index);
        }
        *self != before
    }

    /// Seals a stretch of one piece, and merges it with the seals that it meets.
    fn seal_within(&mut self, mut from: f32, mut to: f32, piece: usize) {
        if !(from < to) {
            return;
        }
        let meets = |seal: &&Closure| seal.kind == ClosureKind::Seal && seal.from <= to && seal.to >= from;
        let met: Vec<Closure> = self.closures_of(piece).filter(meets).copied().collect();
        for seal in &met {
            (from, to) = (from.min(seal.from), to.max(seal.to));
        }
        self.closures.retain(|closure| !met.contains(closure));
        let at = self.closures.partition_point(|other| other.from <= from);
        self.closures.insert(at, Closure { from, to, kind: ClosureKind::Seal });
    }

    /// Every end of the segment, from parent to node.
    pub fn ends(&self) -> impl Iterator<Item = End> + '_ {
        self.gaps.iter().enumerate().flat_map(move |(index, gap)| {
            let end = move |tip: Tip, side, along, piece| {
                let is_open = !tip.sealed && self.closures_of(piece).next().is_none();
                End { index: tip.end, side, along, is_open }
            };
            let proximal = gap.proximal.map(|tip| end(tip, EndSide::Proximal, gap.from, index));
            let distal = gap.distal.map(|tip| end(tip, EndSide::Distal, gap.to, index + 1));
            proximal.into_iter().chain(distal)
        })
    }

    /// The share up to which blood comes from the parent, and the open end there, if any.
    pub fn reach_from_parent(&self) -> (f32, Option<u32>) {
        match (self.closures_of(0).next(), self.gaps.first()) {
            (Some(closure), _) => (closure.from, None),
            (None, Some(gap)) => (gap.from, gap.proximal.filter(|tip| !tip.sealed).map(|tip| tip.end)),
            (None, None) => (1.0, None),
        }
    }

    /// The share from which blood may come back from the node, and the open end there, if any.
    pub fn reach_from_node(&self) -> (f32, Option<u32>) {
        let closed = self.closures_of(self.gaps.len()).map(|closure| closure.to).reduce(f32::max);
        match (closed, self.gaps.last()) {
            (Some(share), _) => (share, None),
            (None, Some(gap)) => (gap.to, gap.distal.filter(|tip| !tip.sealed).map(|tip| tip.end)),
            (None, None) => (0.0, None),
        }
    }
}
