//! Caustics that are left out, as in Cycles where its Reflective or Refractive Caustics are off: a surface that a diffusely scattered
//! ray hits has no glossy reflection, or no transmission. What is under a layer that is gone gets the light that the layer
//! would have reflected.

use super::Integrator;
use super::shading_groups::SortedVertices;
use super::wave::set_rgb;
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::scene::RayKinds;

impl Integrator<'_> {
    /// Takes the lobes of caustics from the BSDFs of the sorted vertices.
    #[cold]
    #[inline(never)]
    pub(super) fn leave_out_caustics(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let skipped = self.options.skip_caustics;
        let Workspace { wave, bsdfs, .. } = w;
        let (visibility, materials) = (&wave.paths.visibility, &mut wave.vertices.metal_rough);
        let is_diffuse = |i: usize| visibility[i].kind() == RayKinds::DIFFUSE;
        for i in sorted.metal_rough().filter(|&i| skipped.reflective && is_diffuse(i)) {
            set_rgb(&mut materials.layer_f0, i, Rgb::ZERO);
            set_rgb(&mut materials.metal_f0, i, Rgb::ZERO);
            (materials.layer_f90[i], materials.metallic[i]) = (0.0, 0.0);
        }
        let general = sorted.general();
        for i in general.clone().filter(|&i| is_diffuse(i)) {
            bsdfs[i - general.start].leave_out(skipped);
        }
    }
}
