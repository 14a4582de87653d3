//! Where the faces of a cage come from: which trunk, and which length along it.
//!
//! A trunk's faces follow each other: its belts from base to tip, then its base's end, then its tip's. So the first
//! corner of each says whose a corner is.

/// A lateral's mouth: the rings of a row on another trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mouth {
    /// The trunk that it leaves.
    pub trunk: u32,
    /// First and last ring of the row, counted on that trunk.
    pub rings: [u32; 2],
}

/// A stretch of a trunk, in lengths along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    pub trunk: u32,
    pub from: f32,
    pub to: f32,
}

/// What a trunk has in a cage.
#[derive(Clone, Copy, Debug)]
struct Part {
    first_ring: u32,
    first_corner: u32,
    /// First corner of the faces at its base.
    base_corner: u32,
    /// First corner of the faces at its tip, and the corner after the last.
    tip_corner: u32,
    end_corner: u32,
    mouth: Option<Mouth>,
}

/// Origins of all faces.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    parts: Vec<Part>,
    /// Length along its trunk of each ring, and first corner of the belt that begins there.
    lengths: Vec<f32>,
    corners: Vec<u32>,
    /// Stretches in which faces may meet others.
    pub doubts: Vec<Stretch>,
}

impl Layout {
    /// Begins a trunk; a lateral that has no faces gets nothing more.
    pub fn begin(&mut self, mouth: Option<Mouth>, corner: usize) {
        let corner = corner as u32;
        let first_ring = self.lengths.len() as u32;
        self.parts.push(Part {
            first_ring,
            first_corner: corner,
            base_corner: corner,
            tip_corner: corner,
            end_corner: corner,
            mouth,
        });
    }

    /// Adds a ring, at which a belt begins unless it is the last.
    pub fn push_ring(&mut self, length: f32, corner: usize) {
        self.lengths.push(length);
        self.corners.push(corner as u32);
    }

    /// Ends a trunk, given the first corner of the faces at its base and at its tip, and the one after all.
    pub fn end(&mut self, [base, tip, end]: [usize; 3]) {
        if let Some(part) = self.parts.last_mut() {
            (part.base_corner, part.tip_corner, part.end_corner) = (base as u32, tip as u32, end as u32);
        }
    }

    /// Lengths of a trunk's rings along it.
    pub fn lengths(&self, trunk: u32) -> &[f32] {
        &self.lengths[self.rings(trunk)]
    }

    /// The mouth in which a trunk begins.
    pub fn mouth(&self, trunk: u32) -> Option<Mouth> {
        self.parts[trunk as usize].mouth
    }

    /// Number of trunks.
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// The corners of the belts between two rings of a trunk, with those of its ends if the rings are its first or last.
    pub fn corners_between(&self, trunk: u32, [low, high]: [u32; 2]) -> impl Iterator<Item = std::ops::Range<u32>> {
        let part = self.parts[trunk as usize];
        let rings = self.rings(trunk);
        let last = (rings.len() - 1) as u32;
        let corner =
            |ring: u32| if ring == last { part.base_corner } else { self.corners[rings.start + ring as usize] };
        let belts = corner(low)..corner(high);
        let base = (low == 0).then_some(part.base_corner..part.tip_corner);
        let tip = (high == last).then_some(part.tip_corner..part.end_corner);
        std::iter::once(belts).chain(base).chain(tip)
    }

    /// The trunk of a corner, and the rings between which it lies; the same ring twice for an end.
    pub fn place_of(&self, corner: u32) -> (u32, [u32; 2]) {
        // A trunk without faces begins where the next one does.
        let trunk = self.parts.partition_point(|part| part.first_corner <= corner) - 1;
        let part = self.parts[trunk];
        let rings = self.rings(trunk as u32);
        let last = (rings.len() - 1) as u32;
        let ends = if corner >= part.tip_corner {
            [last, last]
        } else if corner >= part.base_corner {
            [0, 0]
        } else {
            let after = self.corners[rings].partition_point(|&first| first <= corner) as u32;
            [after - 1, after.min(last)]
        };
        (trunk as u32, ends)
    }

    fn rings(&self, trunk: u32) -> std::ops::Range<usize> {
        let first = self.parts[trunk as usize].first_ring as usize;
        let end = self.parts.get(trunk as usize + 1).map_or(self.lengths.len(), |part| part.first_ring as usize);
        first..end
    }
}
