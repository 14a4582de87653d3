//! A growth that is not drawn yet, and will replace the drawn vessels.

use crate::plugin::growth::tissue::PaintedTissue;
use crate::synthesis::growth::Growth;

/// A growth on a repainted tissue.
#[derive(Debug)]
pub(crate) struct Successor {
    pub(crate) tissue: PaintedTissue,
    pub(crate) growth: Box<dyn Growth>,
    /// Steps after which it replaces the drawn vessels.
    until: u32,
}

impl Successor {
    /// The successor of a growth. If that one is finished, the successor must do all its own steps.
    pub(crate) fn of(predecessor: &dyn Growth, tissue: PaintedTissue, growth: Box<dyn Growth>) -> Self {
        let until = if predecessor.is_finished() { u32::MAX } else { predecessor.progress().done };
        Self { tissue, growth, until }
    }

    /// Whether it has caught up with the drawn vessels.
    pub(crate) fn has_caught_up(&self) -> bool {
        self.growth.is_finished() || self.growth.progress().done >= self.until
    }
}
