//! glTF files: collections of real, valid and damaged files, and small cases of the format's corners.

pub mod asset;
mod choices;
mod collections;
mod damage;
mod decoders;
mod exported;
mod faults;
mod geometry;
mod images;
mod layers;
mod lights;
mod materials;
mod motion;
mod nodes;
mod packed;
mod pointers;
mod splats;
mod uv_sets;
