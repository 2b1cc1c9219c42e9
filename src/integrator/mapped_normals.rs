//! Mapped normals that face away from the viewer.
//!
//! Facets are evaluated around a normal that is bent towards the viewer ([`super::shading_geometry::bent_normal`]). The diffuse
//! base beneath doesn't depend on the viewer and keeps the normal that the map gives, as in Cycles 5.0. A vertex has one normal:
//! where both differ, each path selects the base or all else, as at a mix of materials, and its throughput is divided
//! by the probability.

use super::Integrator;
use super::sampling::Purpose;
use super::shading_geometry::{EvaluatedMaterial, UNMAPPED, WHOLE_LIGHT, local_viewer, scattering_normal};
use super::wave::{Lanes3, Vertices, get, get_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::BsdfEval;
use crate::color::Rgb;
use crate::math::{Frame, Vec3};
use crate::sampling::sampler::SobolPoint;
use std::ops::Range;

/// Probability of either part at least, where there are both: light samples of narrow highlights vary less by that.
const MIN_PROBABILITY: f32 = 0.25;

/// The probability of selecting the base that has this share of what the viewer sees.
#[inline]
fn probability(share: f32) -> f32 {
    if share <= 0.0 || share >= 1.0 {
        return share.clamp(0.0, 1.0);
    }
    share.clamp(MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
}

/// Value and density of a mapped surface for a viewer, with each part around its own normal; and the value of its base.
pub(super) fn eval_lobes(evaluated: &EvaluatedMaterial, ng: Vec3, [wo, wi]: [Vec3; 2]) -> (BsdfEval, Rgb) {
    let facets = Frame::from_normal(scattering_normal(evaluated.ns, ng, wo));
    let base = Frame::from_normal(evaluated.ns);
    let wo_facets = facets.to_local(wo);
    let (of_base, of_facets, share) = evaluated.bsdf.split_base(wo_facets);
    let (a, b) = (
        of_base.eval(local_viewer(&base, wo, ng), base.to_local(wi)),
        of_facets.eval(wo_facets, facets.to_local(wi)),
    );
    let p = probability(share);
    let eval = BsdfEval {
        f_cos: a.f_cos + b.f_cos,
        pdf_solid_angle: p * a.pdf_solid_angle + (1.0 - p) * b.pdf_solid_angle,
    };
    (eval, a.f_cos)
}

impl Integrator<'_> {
    /// Keeps the shading normals of vertices of opaque glTF materials from before they are bent.
    pub(super) fn keep_unbent_normals(&self, range: Range<usize>, v: &mut Vertices) {
        if self.scene.features.mapped_normals {
            for c in 0..3 {
                let (from, to): (&Lanes3, &mut Lanes3) = (&v.ns, &mut v.unbent);
                to[c][range.clone()].copy_from_slice(&from[c][range.clone()]);
            }
        }
    }

    /// Selects parts of opaque glTF materials whose mapped normals were bent.
    pub(super) fn select_lobes(&self, bounce: u32, range: Range<usize>, w: &mut Workspace) {
        if !self.scene.features.mapped_normals {
            return;
        }
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        let (path, v) = (&mut w.wave.paths.state, &mut w.wave.vertices);
        for i in range {
            if v.relief[i] == UNMAPPED {
                continue;
            }
            let closures = &mut v.metal_rough_closures;
            let share = closures.probability_diffuse[i];
            if share <= 0.0 {
                v.relief[i] = WHOLE_LIGHT;
            }
            if v.is_bent[i] == 0.0 {
                continue;
            }
            let p = probability(share);
            let [_, u, ..] = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).sample_4d(&dimensions);
            let is_base = u < p;
            if is_base {
                for part in [&mut closures.f0, &mut closures.schlick_rise, &mut closures.exact_rise] {
                    set_rgb(part, i, Rgb::ZERO);
                }
                let unbent = get(&v.unbent, i);
                set(&mut v.ns, i, unbent);
            } else {
                set_rgb(&mut closures.diffuse, i, Rgb::ZERO);
                v.relief[i] = WHOLE_LIGHT;
            }
            closures.probability_diffuse[i] = if is_base { 1.0 } else { 0.0 };
            closures.probability_specular[i] = if is_base { 0.0 } else { 1.0 };
            let throughput = get_rgb(&path.throughput, i);
            set_rgb(&mut path.throughput, i, throughput * (1.0 / if is_base { p } else { 1.0 - p }));
        }
    }

    /// The material at the vertex of arriving path `i`, with the normal that its BSDF is evaluated around; one of its parts where they need two.
    pub(super) fn select_lobe(
        &self,
        bounce: u32,
        i: usize,
        evaluated: EvaluatedMaterial,
        [ng, wo]: [Vec3; 2],
        w: &mut Workspace,
    ) -> EvaluatedMaterial {
        let bent = scattering_normal(evaluated.ns, ng, wo);
        if !evaluated.mapping.is_mapped || bent == evaluated.ns {
            return EvaluatedMaterial { ns: bent, ..evaluated };
        }
        let (base, above, share) = evaluated.bsdf.split_base(Frame::from_normal(bent).to_local(wo));
        let p = probability(share);
        let path = &mut w.arriving.state;
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        let [_, u, ..] = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).sample_4d(&dimensions);
        let is_base = u < p;
        let throughput = get_rgb(&path.throughput, i);
        set_rgb(&mut path.throughput, i, throughput * (1.0 / if is_base { p } else { 1.0 - p }));
        let (bsdf, ns) = if is_base { (base, evaluated.ns) } else { (above, bent) };
        EvaluatedMaterial { bsdf, ns, ..evaluated }
    }
}
