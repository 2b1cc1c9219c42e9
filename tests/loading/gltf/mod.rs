//! glTF: collections of real, valid and damaged files, and small cases of the format's corner cases.

mod animation;
mod animation_pointer;
pub mod asset;
mod blender_exports;
mod collections;
mod compressed_geometry;
mod damage;
mod decoders;
mod geometry;
mod images;
mod layers;
mod lights;
mod load_options;
mod materials;
mod nodes;
mod repairs;
mod splats;
mod uv_sets;
