//! No-go regions: where no vessel may be, such as over a landmark that must stay free.

mod field;
mod tissue;

pub use field::{NoGoField, NoGoRegion};
pub use tissue::NoGoTissue;
