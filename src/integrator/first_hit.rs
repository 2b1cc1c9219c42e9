//! What outputs besides colour show of the first surface of a path.

use super::Integrator;
use crate::color::Rgb;
use crate::film::AovSample;
use crate::math::Vec3;

impl Integrator<'_> {
    /// Keeps the first surface of a sample: point, shading normal towards the viewer, reflectance.
    pub(super) fn record_first_hit(
        &self,
        sample: u32,
        p: Vec3,
        ns: Vec3,
        albedo: Rgb,
        aovs: &mut [Option<AovSample>],
    ) {
        if let Some(aov) = aovs.get_mut(sample as usize) {
            *aov = Some(AovSample {
                depth: self.scene.camera.depth(p),
                normal: ns.to_array(),
                albedo: albedo.to_array(),
            });
        }
    }
}
