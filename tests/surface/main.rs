//! Closed meshes of vessel trees: what must hold for grown networks, real vessels and trees made to be hard.

#[path = "../common/mod.rs"]
mod common;
mod loops;
mod measures;
mod networks;
mod real;
mod shapes;
