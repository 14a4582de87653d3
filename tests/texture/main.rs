//! Vessels in textures: exact where there is an exact answer, the same on any number of threads, without seams.

#[path = "../common/shared.rs"]
mod shared;

mod exact;
mod files;
mod inputs;
mod meshes;
mod organs;
mod seams;
