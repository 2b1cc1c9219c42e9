//! How paths scatter first: what of it is diffuse.

use super::Integrator;
use super::closure::VertexClass;
use super::closure_metal_rough::MetalRoughClass;
use super::group::Sorted;
use super::lanes::get;
use super::layers::{FirstBounce, Way};
use super::wave::{Vertices, Wave};
use super::workspace::Workspace;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::math::{Frame, Vec3};

/// The share of `whole` that `part` is, by channel.
fn share(part: Rgb, whole: Rgb) -> Rgb {
    let (part, whole) = (part.to_array(), whole.to_array());
    let of = |c: usize| {
        let share = part[c] / whole[c];
        // Nothing of nothing is no number.
        if share > 0.0 { share.min(1.0) } else { 0.0 }
    };
    Rgb::from_array([of(0), of(1), of(2)])
}

impl FirstBounce {
    /// Of a BSDF about the normal `ns` of a surface whose own is `ng`, but for specular lobes.
    pub fn of(bsdf: &Bsdf, [ns, ng]: [Vec3; 2], wo: Vec3, wi: Vec3) -> FirstBounce {
        let frame = Frame::from_normal(ns);
        let crosses = wi.dot(ng) * wo.dot(ng) < 0.0;
        let (wo, wi) = (frame.to_local(wo), frame.to_local(wi));
        FirstBounce { diffuse: share(bsdf.diffuse_part(wo, wi), bsdf.eval(wo, wi).f_cos), crosses }
    }
}

impl Integrator<'_> {
    /// How vertex `i` scatters light from `wi`, but for specular lobes.
    pub(super) fn scattering(
        &self,
        sorted: &Sorted,
        v: &Vertices,
        bsdfs: &[Bsdf],
        i: usize,
        wi: Vec3,
    ) -> FirstBounce {
        // Media scatter to all sides: they count as diffuse.
        if sorted.lambert().contains(&i) || sorted.medium().contains(&i) {
            return FirstBounce::DIFFUSE;
        }
        if sorted.metal_rough().contains(&i) {
            let diffuse = MetalRoughClass.closure(v, i).diffuse_share(wi);
            return FirstBounce { diffuse, crosses: false };
        }
        let bsdf = &bsdfs[i - sorted.general().start];
        FirstBounce::of(bsdf, [get(&v.ns, i), get(&v.ng, i)], get(&v.wo, i), wi)
    }

    /// The way of light that the light sample of vertex `i` brings.
    pub(super) fn way_of_sample(
        &self,
        bounce: u32,
        sorted: &Sorted,
        wave: &Wave,
        bsdfs: &[Bsdf],
        i: usize,
    ) -> Way {
        let Wave { paths, vertices: v, .. } = wave;
        if bounce > 0 {
            return Way::Indirect(paths.first_bounces.get(i));
        }
        Way::Direct(self.scattering(sorted, v, bsdfs, i, get(&v.light.wi, i)))
    }

    /// Takes down how the paths scattered first.
    pub(super) fn keep_first_bounces(&self, sorted: &Sorted, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        for i in sorted.all() {
            let Wave { paths, vertices: v, .. } = &mut **wave;
            let wi = get(&v.next_direction, i);
            let mut first = self.scattering(sorted, v, bsdfs, i, wi);
            if paths.carried.pdf[i] == 0.0 {
                first.diffuse = Rgb::ZERO;
            }
            paths.first_bounces.set(i, first);
        }
    }
}
