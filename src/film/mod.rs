//! The film: where samples become pixels. Threads fill [`FilmTile`]s; the renderer merges them in a fixed order.
//!
//! Every sample belongs to one pixel (filters are importance-sampled, see [`FilterSampler`]), so a pixel is a sum and a
//! count. Sums of a tile are f64: adding f32 values to them loses nothing that a picture could show, however many samples.
//! Sums of a film are exact (`exact_sum.rs`): tiles and films may be added in any order. It is stored in bands of rows (`band.rs`), to
//! which many threads add at once.

mod aov;
mod band;
mod channel;
mod cryptomatte;
mod exact_sum;
mod filter;
mod picture;
mod serialize;
mod shadow_catcher;
mod shared;
mod splats;
mod tile;

pub use aov::{Aov, AovInfo, AovSet, AovSpace, BACKGROUND_DEPTH, MATTE_LEVELS};
pub use channel::{Channel, LIGHT_GROUP, Layout, PixelType, Reduction, Source, Values};
pub use cryptomatte::{MatteIds, matte_id, matte_key};
pub use filter::FilterSampler;
pub use picture::{Film, Plane};
pub use shadow_catcher::CATCHER_PARTS;
pub use shared::SharedFilm;
pub use splats::{Splat, SplatPart};
pub use tile::FilmTile;

#[cfg(test)]
mod tests;
