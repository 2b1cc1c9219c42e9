//! Densities on a grid.

use crate::math::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// Values on a grid that fills a box, which may stand anyhow.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// For reports.
    pub name: String,
    /// Voxels along the grid's x, y and z.
    pub size: [u32; 3],
    /// Values in the middles of voxels, from 0 up: those along x follow each other, then those along y. Between them it is
    /// interpolated; towards the box's sides the outermost ones hold.
    pub values: Arc<Vec<f32>>,
    /// From voxels to the world, metres: the box reaches from the origin to `size`, and outside nothing is. May turn, scale,
    /// mirror and shear.
    pub world_from_voxels: DAffine3,
}

impl Grid {
    /// A grid in a box along the axes of the world, from its least to its greatest corner, metres.
    pub fn in_box(name: String, size: [u32; 3], values: Arc<Vec<f32>>, min: DVec3, max: DVec3) -> Grid {
        let voxel = (max - min) / DVec3::from_array(size.map(f64::from));
        let world_from_voxels = DAffine3::from_mat3_translation(DMat3::from_diagonal(voxel), min);
        Grid { name, size, values, world_from_voxels }
    }

    /// The least and the greatest corner of the box along the axes of the world that is around its own, metres.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let corner = |k: u32| {
            let at = [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { f64::from(self.size[axis]) } else { 0.0 });
            self.world_from_voxels.transform_point3(DVec3::from_array(at))
        };
        (1..8).map(corner).fold((corner(0), corner(0)), |(low, high), at| (low.min(at), high.max(at)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_around_grids() {
        let (min, max) = (DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 3.0, 4.5));
        let (size, values) = ([4, 2, 5], Arc::new(vec![0.0; 40]));
        let along = Grid::in_box(String::new(), size, values, min, max);
        assert_eq!(along.bounds(), (min, max));
        let turn = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_4);
        let turned = Grid { world_from_voxels: turn * along.world_from_voxels, ..along };
        let (low, high) = turned.bounds();
        let wanted = (DVec3::new(1.0, 0.0, 1.0), DVec3::new(5.5, 3.0, 5.5));
        let root = DVec3::new(0.5f64.sqrt(), 1.0, 0.5f64.sqrt());
        assert!(
            (low - wanted.0 * root).length() < 1e-12 && (high - wanted.1 * root).length() < 1e-12,
            "{low} {high}"
        );
    }
}
