//! Random numbers to points, directions and indices: warps with their densities, distributions over tables, and the
//! weights that combine strategies. Every sampler here passes the chi-square harness in [`chi2`].
//!
//! Conventions: `u` is uniform in `[0, 1)` per component. Densities name their measure. Samplers are free of libm and
//! (apart from table searches) of data-dependent branches, so that loops over paths vectorise.

mod allotment;
mod arrangement;
pub mod bilinear;
#[doc(hidden)]
pub mod chi2;
pub mod distribution;
pub mod hash;
pub mod mis;
pub mod sampler;
pub mod warp;

pub use allotment::Allotment;
pub use arrangement::{Arrangement, MOST_ARRANGED};
pub use bilinear::{BilinearMap, MapSample, MapSamples};
pub use distribution::AliasTable;
pub use mis::power_heuristic;
