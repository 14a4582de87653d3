//! The studio alone, for examples in which nothing grows before the eyes: without the keys for growth.

pub mod headless;
pub mod light;
pub mod photo;
pub mod studio;
