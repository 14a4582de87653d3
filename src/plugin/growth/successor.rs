//! A growth that nobody sees yet, and that will take the place of the vessels that are drawn.

use crate::plugin::growth::tissue::PaintedTissue;
use crate::synthesis::growth::Growth;

/// A growth on a tissue that was painted anew.
#[derive(Debug)]
pub(crate) struct Successor {
    pub(crate) tissue: PaintedTissue,
    pub(crate) growth: Box<dyn Growth>,
    /// Steps after which it takes the place of what is drawn.
    until: u32,
}

impl Successor {
    /// The successor of a growth. One that is finished has all steps as its measure.
    pub(crate) fn of(predecessor: &dyn Growth, tissue: PaintedTissue, growth: Box<dyn Growth>) -> Self {
        let until = if predecessor.is_finished() { u32::MAX } else { predecessor.progress().done };
        Self { tissue, growth, until }
    }

    /// Whether it has come as far as what is drawn.
    pub(crate) fn has_caught_up(&self) -> bool {
        self.growth.is_finished() || self.growth.progress().done >= self.until
    }
}
