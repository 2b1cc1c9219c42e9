//! glTF files: collections of real, valid and damaged files, and small cases of the format's corners.

mod asset;
mod collections;
mod damage;
mod geometry;
mod materials;
mod nodes;
