//! Everything that makes vessels, with no engine below it.

mod attraction;
pub mod colonization;
pub mod instances;
pub mod io;
pub mod mesh;
pub mod murray;
pub mod organ;
pub mod point_grid;
pub mod preset;
pub mod rng;
pub mod roots;
pub mod tissue;
pub mod tree;
