//! Spatial search: nearby points and boxes, and the side of a plane on which a point lies.
//!
//! | module | what it holds |
//! |---|---|
//! | [`point_grid`] | points that are added and removed, by distance |
//! | [`bvh`] | fixed boxes |
//! | `box_pairs` | pairs of boxes that overlap |
//! | `packed_boxes` | boxes that are added and move |
//! | `morton`, `order` | spatial order of points |
//! | `exact_side` | signs without rounding |

pub(crate) mod box_pairs;
pub mod bvh;
pub(crate) mod exact_side;
pub(crate) mod morton;
pub(crate) mod order;
pub(crate) mod packed_boxes;
pub mod point_grid;
