//! Reading organs and trees: what a file shows is what grows, and no file harms.

mod builder;
mod cases;
mod files;
mod gltf;
mod hostile;
#[path = "../common/shared.rs"]
mod shared;
mod swc;
