//! Curves: their lists, and whether their material is one that curves can have.

use super::findings::{Findings, Place};
use crate::scene::{Curves, Material, Scene, Transmission};

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    for (index, curves) in scene.curves.iter().enumerate() {
        let place = Place { list: "curves", index, name: &curves.name };
        lists(curves, place, findings);
        match scene.materials.get(curves.material.index()) {
            None => findings.reject(place, "material", curves.material, "one of the scene's materials"),
            Some(material) => suits(material, place, findings),
        }
    }
}

fn lists(curves: &Curves, place: Place, findings: &mut Findings) {
    let sum: u64 = curves.strands.iter().map(|n| u64::from(*n)).sum();
    let points = curves.points.len();
    findings.require(sum == points as u64, place, "strands", sum, "as many points as there are");
    let odd = curves.strands.iter().find(|n| !curves.basis.takes(**n as usize));
    findings.require(odd.is_none(), place, "strands", odd, curves.basis.asks_for());
    findings.require(curves.radii.len() == points, place, "radii", curves.radii.len(), "one a point");
    let has_colors = [0, points].contains(&curves.colors.len());
    findings.require(has_colors, place, "colors", curves.colors.len(), "one a point, or none");
    findings.require_finite(curves.points.as_flattened(), place, "points");
    findings.require_finite(&curves.radii, place, "radii");
    findings.require_finite(curves.colors.as_flattened(), place, "colors");
    let negative = curves.radii.iter().find(|r| **r < 0.0);
    findings.require(negative.is_none(), place, "radii", negative, "from 0 up");
    let is_finite = curves.world_from_object.is_finite();
    findings.require(is_finite, place, "world_from_object", curves.world_from_object, "finite");
}

/// Rays meet curves from outside only: they have no inside, and are no lights.
fn suits(material: &Material, place: Place, findings: &mut Findings) {
    let is_solid = match material.model.transmission() {
        Transmission::Clear(_) => true,
        Transmission::Pbr(pbr) => pbr.has_volume || pbr.keeps_radiance,
        Transmission::None | Transmission::Thin => false,
    };
    let name = &material.name;
    let opaque = "no solid glass and filled with no medium: curves take opaque and thin materials and 'hair'";
    findings.require(!is_solid && material.medium.is_none(), place, "material", name, opaque);
    let dark = "one that does not shine: curves are no lights";
    findings.require(material.emission.is_none(), place, "material", name, dark);
}
