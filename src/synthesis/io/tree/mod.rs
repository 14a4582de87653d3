//! Files of vessel trees.

mod csv;
mod gxl;
mod levels;
mod swc;
mod swc_read;

pub use csv::{CsvOptions, save_csv, write_csv};
pub use gxl::{GxlOptions, save_gxl, write_gxl};
pub use levels::{save_levels, write_levels};
pub use swc::{SwcOptions, kind_of_swc_structure, save_swc, swc_structure, write_swc};
pub use swc_read::{ReadError, SwcReadOptions, load_swc, read_swc};
