//! What fills spaces: fog and the insides of solids.

use super::findings::{Findings, Place};
use crate::math::DVec3;
use crate::scene::{Fog, Grid, Medium, Scene};
use std::fmt::Display;

/// Flights in denser media are shorter than positions are precise.
const MOST_EXTINCTION: f32 = 1e9;

/// Rays look at so many points of a grid at most, times a small number.
const MOST_MEAN_FREE_PATHS: f64 = 1e5;

pub(super) fn check_medium(
    medium: &Medium,
    grids: &[Grid],
    place: impl Display + Copy,
    findings: &mut Findings,
) {
    let is_met = medium.extinction.iter().all(|x| (0.0..=MOST_EXTINCTION).contains(x));
    findings.require(is_met, place, "extinction", medium.extinction, "numbers from 0 to 1e9 per metre");
    let is_met = medium.albedo.iter().all(|x| (0.0..=1.0).contains(x));
    findings.require(is_met, place, "albedo", medium.albedo, "numbers from 0 to 1");
    let is_met = medium.anisotropy.abs() < 1.0;
    findings.require(is_met, place, "anisotropy", medium.anisotropy, "above -1 and below 1");
    findings.require_color(&medium.emission, place, "emission");
    if let Some(glow) = medium.glow {
        findings.require(
            medium.grid.is_some(),
            place,
            "glow",
            glow.grid,
            "none where there is no grid of densities",
        );
        if grids.get(glow.grid.index()).is_none() {
            findings.reject(place, "glow", glow.grid, "one of the scene's grids");
        }
        let is_met = glow.kelvin.is_none_or(|kelvin| (1e-6..=1e6).contains(&kelvin));
        findings.require(is_met, place, "kelvin", glow.kelvin, "from 1e-6 to 1e6");
    }
    let Some(id) = medium.grid else { return };
    let Some(grid) = grids.get(id.index()) else {
        return findings.reject(place, "grid", id, "one of the scene's grids");
    };
    let [r, g, b] = medium.extinction;
    let is_met = (r == g && g == b) || medium.emission == [0.0; 3];
    findings.require(
        is_met,
        place,
        "extinction",
        medium.extinction,
        "grey where there is a grid that shines",
    );
    let most = r.max(g).max(b);
    let thickest = grid.values.iter().fold(0.0f32, |most, x| most.max(*x));
    let paths = f64::from(thickest) * f64::from(most) * longest_way(grid);
    // Numbers that are none have had their complaint.
    let is_met = paths.is_nan() || paths <= MOST_MEAN_FREE_PATHS;
    findings.require(is_met, place, "grid", paths, "at most 1e5 mean free paths across where it is thickest");
}

/// The longest of the diagonals of its box, metres.
fn longest_way(grid: &Grid) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| grid.world_from_voxels.matrix3.col(k) * f64::from(grid.size[k]));
    [x + y + z, x + y - z, x - y + z, x - y - z].into_iter().fold(0.0, |most, way| way.length().max(most))
}

fn check_grids(grids: &[Grid], findings: &mut Findings) {
    for (index, grid) in grids.iter().enumerate() {
        let place = Place { list: "grids", index, name: &grid.name };
        let voxels = grid.size.iter().try_fold(1usize, |product, &n| product.checked_mul(n as usize));
        let is_met = voxels.is_some_and(|n| n > 0 && n == grid.values.len());
        findings.require(is_met, place, "size", grid.size, "above 0 and as many as there are values");
        findings.require_finite(&grid.values, place, "values");
        let is_met = grid.values.iter().all(|x| x.is_nan() || *x >= 0.0);
        findings.require(is_met, place, "values", "negative", "numbers from 0 up");
        let map = grid.world_from_voxels;
        let is_met = map.is_finite() && map.matrix3.determinant() != 0.0;
        findings.require(is_met, place, "world_from_voxels", map, "finite, and not flat");
        let voxel = DVec3::from_array([0, 1, 2].map(|k| map.matrix3.col(k).length()));
        // Numbers that are none, and what is flat, have had their complaint.
        let is_met = !(voxel.min_element() < 1e-18 || voxel.max_element() > 1e18) || !is_met;
        findings.require(is_met, place, "world_from_voxels", voxel, "voxels between 1e-18 and 1e18 metres");
    }
}

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    const PLACE: &str = "fog";
    check_grids(&scene.grids, findings);
    let Some(Fog { medium, center, radius }) = &scene.fog else { return };
    check_medium(medium, &[], PLACE, findings);
    findings.require(medium.grid.is_none(), PLACE, "grid", medium.grid, "none: grids are for solids");
    findings.require(center.is_finite(), PLACE, "center", center, "finite numbers");
    let is_met = *radius > 0.0;
    findings.require(is_met, PLACE, "radius", radius, "above 0, or infinite");
    let channels = medium.emission.iter().zip(&medium.extinction);
    let is_bounded = radius.is_finite() || channels.into_iter().all(|(e, x)| *e == 0.0 || *x > 0.0);
    findings.require(is_bounded, PLACE, "emission", medium.emission, "0 where fog without an end is clear");
}
