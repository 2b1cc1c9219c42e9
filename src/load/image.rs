//! Decoding of images and environments.
