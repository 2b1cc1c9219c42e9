//! Ray intersection: one structure over triangles, quads, analytic shapes, curves and placed geometries, and batched queries on
//! it.
//!
//! obvhs builds a binary tree, which is collapsed to eight children a node at least expected cost and packed into cache
//! lines; [`Accel::closest`] and [`Accel::occluded`] walk it with up to 32 rays in flight, in a loop compiled for
//! the CPU level found at start-up. All levels give the same hits bit for bit, and so do batches of any size.
//!
//! Many primitives are cut into chunks that are built and written each for itself, and a tree over these joins them: see
//! `pieces.rs`. Chunks, and the trees of geometries that are no larger, are built side by side: see `append.rs`. Either way, and whatever a tree's quality, rays meet the same primitives (but see [`TreeQuality`]).
//!
//! Primitive ids within a geometry: triangles `0..T`, then quads `T..T + Q`, then `A` analytic shapes from
//! `T + Q` on, then pieces of curves from `T + Q + A` on.

mod append;
mod binary;
mod build;
mod chunks;
mod collapse;
mod emit;
mod estimate;
mod fan;
mod gather;
mod halves;
mod input;
mod layout;
#[cfg(test)]
mod many_tests;
mod motion;
mod nearest;
mod normalize;
mod parts;
mod pieces;
mod plane;
mod prepare;
mod relocate;
mod scan;
mod slot;
mod stream;
mod structure;
#[cfg(test)]
mod tests;
mod tree;
#[cfg(test)]
mod tree_tests;
mod validate;

pub use estimate::{Estimate, TooLarge};
pub use fan::{Bits, Fan, FanHits};
pub use gather::{Dropped, is_in_reach};
pub use input::{AccelInput, AccelInstance, Geometry, MovingInstance, Reuse, TreeQuality};
pub use parts::BuildStats;
pub use structure::Accel;
