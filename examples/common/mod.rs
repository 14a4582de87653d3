//! Shared code of the examples: a studio for organs, with or without a window.

pub mod controls;
pub mod headless;
pub mod light;
pub mod photo;
pub mod studio;
