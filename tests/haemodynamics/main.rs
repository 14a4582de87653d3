//! Blood flow against laws, symmetric trees, a dense linear solver, and itself solved anew.

mod dense;
mod incremental;
mod joined;
mod laws;
mod trees;
