//! Densities on a grid.

use crate::math::DVec3;
use std::sync::Arc;

/// Values on a grid that fills a box along the axes of the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// For reports.
    pub name: String,
    /// Voxels along x, y and z.
    pub size: [u32; 3],
    /// Values in the middles of voxels, from 0 up: those along x follow each other, then those along y. Between them it is
    /// interpolated; towards the box's sides the outermost ones hold.
    pub values: Arc<Vec<f32>>,
    /// The box's least corner, metres.
    pub min: DVec3,
    /// Its greatest corner; outside nothing is.
    pub max: DVec3,
}
