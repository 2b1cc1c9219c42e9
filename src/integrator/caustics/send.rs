//! Light goes on: it is sent by smooth glass, mirrors and polished metal, and spread by other surfaces.

use super::super::Integrator;
use super::super::interfaces::CoincidentHit;
use super::super::interior::Interior;
use super::super::shading_geometry::{HitPoint, bent_normal, scattering_normal, terminator};
use super::super::wave::{get_rgb, set_rgb};
use super::super::workspace::Workspace;
use super::follow::is_stretched;
use super::path::LampPath;
use crate::bsdf::{Bsdf, BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::compile::Role;
use crate::math::{Frame, Ray, Vec3, offset_along};
use crate::sampling::sampler::Dimensions;
use crate::sampling::warp;
use crate::shape::Surface;

/// From so many surfaces on, paths may end.
const FIRST_ROULETTE: u32 = 8;
/// How often they go on then.
const SURVIVAL: f32 = 0.8;

/// Where light arrives at a surface that sends it on.
struct Sender {
    bsdf: Bsdf,
    /// Normals, on the front of the surface that `bsdf` is for.
    ng: Vec3,
    ns: Vec3,
    /// Towards where the light came from.
    wo: Vec3,
    /// Nothing else finds this light: nothing that is sent perfectly smoothly, or nothing at all.
    is_only_way: [bool; 2],
}

/// A sender, its surface, and the solids on the other side.
struct Crossing {
    sender: Sender,
    surface: Surface,
    beyond: Interior,
}

/// How light goes on.
struct Sent {
    direction: Vec3,
    /// What is left of the radiance.
    weight: Rgb,
    /// What becomes of measures.
    scale: f32,
    is_specular: bool,
    is_transmission: bool,
}

impl Integrator<'_> {
    /// The path behind a surface that it met; `None` if it ends.
    pub(super) fn go_on(
        &self,
        path: &LampPath,
        at: &HitPoint<'_>,
        role: Role,
        material_index: u32,
        w: &mut Workspace,
    ) -> Option<LampPath> {
        let Crossing { sender, surface, beyond } = self.meet_sender(path, at, w);
        let (material, arriving) = (at.material, &mut *w.arriving);
        let radiance = get_rgb(&arriving.carried.throughput, 0);
        let [a, b, lobe, roulette] = path.point.sample_4d(&Dimensions::new(2 + path.bounces));
        let sent = match role {
            Role::Sends => self.scatter_light(&sender, [a, b, lobe])?,
            _ => self.spread_light(&sender, material_index, [a, b, lobe])?,
        };
        let survival = match role {
            Role::Sends if path.bounces < FIRST_ROULETTE => 1.0,
            Role::Sends => SURVIVAL,
            // So that those which go on bring as much as before.
            _ => (sent.weight.max_element() * sent.scale).min(1.0),
        };
        let ng = surface.ng;
        let is_lost = material.is_absent_from_behind && sent.direction.dot(ng) <= 0.0;
        if roulette >= survival || is_lost {
            return None;
        }
        let side = if sent.direction.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let origin = offset_along(surface.p, ng * side, ng.abs().dot(surface.p_error));
        Some(LampPath {
            ray: Ray { origin_primitive: (&at.hit).into(), ..Ray::new(origin, sent.direction) },
            radiance: radiance * sent.weight,
            scale: path.scale * sent.scale / survival,
            interior: if sent.is_transmission { beyond } else { arriving.interior[0] },
            bounces: path.bounces + 1,
            has_roles: path.has_roles && role != Role::Neither,
            is_only_way: path.is_only_way && (path.bounces > 0 || sent.is_specular),
            ..*path
        })
    }

    /// What light meets where it arrives at a surface; the lane of paths from lamps holds its state then.
    fn meet_sender(&self, path: &LampPath, at: &HitPoint<'_>, w: &mut Workspace) -> Crossing {
        let waves = path.waves();
        let waves = waves.as_ref();
        let (wo, material, arriving) = (-path.ray.direction, at.material, &mut *w.arriving);
        arriving.interior[0] = path.interior;
        set_rgb(&mut arriving.carried.throughput, 0, path.radiance);
        (arriving.carried.seed[0], arriving.carried.shuffled[0]) = path.point.to_parts();
        let is_solid = material.medium_index != 0;
        if is_solid && at.is_back {
            self.assume_inside(material, at.hit.t, 0, arriving, waves);
        }
        let (bsdf, ns) = self.read_material(at, 0.0, wo, waves);
        let is_only_way = [path.is_only_way, path.is_only_way && path.bounces > 0];
        let mut sender = Sender { bsdf, ng: at.surface.ng, ns, wo, is_only_way };
        let (mut beyond, mut surface) = (arriving.interior[0], at.surface);
        if is_solid {
            let boundary = match self.touching(&path.ray, at) {
                None => self.boundary(bsdf, material, at.is_back, (path.bounces, 0), arriving, waves),
                Some(touching) => {
                    let met = CoincidentHit { at: *at, bsdf, ns, width: 0.0 };
                    let (met, boundary) =
                        self.coincident_interface(met, touching, wo, (path.bounces, 0), arriving, waves);
                    surface = met.at.surface;
                    (sender.ng, sender.ns) = (surface.ng, met.ns);
                    boundary
                }
            };
            (sender.bsdf, beyond) = (boundary.bsdf, boundary.beyond);
            if boundary.is_inverted {
                (sender.ng, sender.ns) = (-sender.ng, -sender.ns);
            }
        }
        Crossing { sender, surface, beyond }
    }

    fn scatter_light(&self, at: &Sender, u: [f32; 3]) -> Option<Sent> {
        let Sender { bsdf, ng, ns, wo, .. } = at;
        // Both normals must agree on which side the light is.
        if wo.dot(*ng) * wo.dot(*ns) <= 0.0 {
            return None;
        }
        let frame = Frame::from_normal(*ns);
        let sample = bsdf.sample(frame.to_local(*wo), u);
        let direction = frame.to_world(sample.wi);
        let crosses = direction.dot(*ng) * wo.dot(*ng) < 0.0;
        if sample.pdf_solid_angle <= 0.0 || crosses != sample.is_transmission || direction.dot(*ng) == 0.0 {
            return None;
        }
        let is_left = || {
            let is_bent = self.scene.features.bent_normals && bent_normal(*ns, *ng, direction).1;
            is_bent || is_stretched(*ns, *ng, direction, *wo)
        };
        if !at.is_only_way[usize::from(!sample.is_specular)] && is_left() {
            return None;
        }
        match sample.is_specular {
            true => Some(Self::send_on(at, &sample, direction)),
            false => self.send_glossy(at, &sample, direction),
        }
    }

    /// By a perfectly smooth surface. What BSDFs scale radiance by at refractions differs from what they scale flux by.
    fn send_on(at: &Sender, sample: &BsdfSample, direction: Vec3) -> Sent {
        let Sender { ng, ns, wo, .. } = at;
        let scale = (wo.dot(*ns) * direction.dot(*ng)) / (wo.dot(*ng) * direction.dot(*ns));
        Sent {
            direction,
            weight: sample.weight * sample.flux,
            scale: if ns == ng { 1.0 } else { scale.abs() },
            is_specular: true,
            is_transmission: sample.is_transmission,
        }
    }

    /// By a polished one that is opaque: what it scatters to a viewer in the direction chosen.
    fn send_glossy(&self, at: &Sender, sample: &BsdfSample, direction: Vec3) -> Option<Sent> {
        let Sender { bsdf, ng, ns, wo, .. } = at;
        if sample.is_transmission {
            return None;
        }
        let ns = scattering_normal(*ns, *ng, direction);
        let frame = Frame::from_normal(ns);
        let f_cos = bsdf.eval(frame.to_local(direction), frame.to_local(*wo)).f_cos;
        let side = if direction.dot(*ng) < 0.0 { -1.0 } else { 1.0 };
        let kept = if self.softens_terminator() { terminator(ns * side, *ng * side, *wo) } else { 1.0 };
        Some(Sent {
            direction,
            weight: f_cos * (kept / sample.pdf_solid_angle),
            scale: (direction.dot(*ng) / wo.dot(*ng)).abs(),
            is_specular: false,
            is_transmission: false,
        })
    }

    /// By any other surface: what it scatters to a viewer in the direction chosen.
    fn spread_light(&self, at: &Sender, material: u32, [a, b, lobe]: [f32; 3]) -> Option<Sent> {
        let Sender { bsdf, ng, ns, wo: wi, .. } = at;
        let catcher = self.catcher(material, *bsdf, [*ns, *ng]);
        let (direction, pdf) = if catcher.is_lambert || catcher.is_opaque && ns != ng {
            // For viewers wherever they see the surface.
            let side = if wi.dot(*ng) < 0.0 { -1.0 } else { 1.0 };
            let local = warp::cosine_hemisphere([a, b]);
            let direction = Frame::from_normal(*ng * side).to_world(local);
            (direction, warp::cosine_hemisphere_pdf_solid_angle(local.z))
        } else {
            let frame = Frame::from_normal(scattering_normal(*ns, *ng, *wi));
            let sample = bsdf.sample(frame.to_local(*wi), [a, b, lobe]);
            let direction = frame.to_world(sample.wi);
            let crosses = direction.dot(*ng) * wi.dot(*ng) < 0.0;
            if crosses != sample.is_transmission {
                return None;
            }
            if sample.is_specular && sample.pdf_solid_angle > 0.0 {
                return Some(Self::send_on(at, &sample, direction));
            }
            (direction, sample.pdf_solid_angle)
        };
        let heights = [direction.dot(*ng), wi.dot(*ng)];
        if pdf <= 0.0 || heights.contains(&0.0) {
            return None;
        }
        let BsdfEval { f_cos, pdf_solid_angle } = self.scattered(&catcher.seen(direction, *wi))?;
        Some(Sent {
            direction,
            // What a path from the camera would be scattered with.
            weight: f_cos / pdf_solid_angle,
            scale: pdf_solid_angle / pdf * (heights[0] / heights[1]).abs(),
            is_specular: false,
            is_transmission: heights[0] * heights[1] < 0.0,
        })
    }
}
