//! Order in space: which points and boxes are near, and on which side of a plane a point lies.
//!
//! | room | what it holds |
//! |---|---|
//! | [`point_grid`] | points that come and go, by distance |
//! | [`bvh`] | boxes that stay |
//! | `packed_boxes` | boxes that come and move |
//! | `morton`, `order` | places along a curve through space |
//! | `exact_side` | signs without rounding |

pub mod bvh;
pub(crate) mod exact_side;
pub(crate) mod morton;
pub(crate) mod order;
pub(crate) mod packed_boxes;
pub mod point_grid;
