//! What the examples share: a studio to look at organs in, with a window or without.

pub mod controls;
pub mod headless;
pub mod light;
pub mod photo;
pub mod studio;
