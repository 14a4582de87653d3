//! Blood flow against laws, symmetric trees, a dense linear solver, and fresh solutions.

mod demand;
mod dense;
mod full_matrix;
mod incremental;
mod joined;
mod laws;
mod tight;
mod trees;
mod wounded;

#[cfg(feature = "mesh_files")]
#[path = "../common/shared.rs"]
mod shared;
