//! Caustics show: light that arrives at a surface is scattered to the camera.

use super::super::Integrator;
use super::super::interior::{CameraInterior, Interior};
use super::super::radiance_buffer::PathClass;
use super::super::shading_geometry::{HitPoint, scattering_normal, terminator};
use super::super::shading_groups::ShadingGroup;
use super::super::wave::FirstBounce;
use super::super::workspace::Workspace;
use super::STILL;
use super::plan::{CausticTally, LampPath};
use crate::bsdf::{Bsdf, BsdfEval};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::film::{Splat, SplatPart};
use crate::math::{Frame, Ray, Vec3, offset_along};
use crate::sampling::hash::hash32;
use crate::scene::RayKinds;
use std::f32::consts::FRAC_1_PI;

/// Light on its way to the camera.
pub(super) struct Caught {
    /// From the surface to the lens.
    segment: Ray,
    film: [f32; 2],
    /// What a pixel gets whose filter is 1 there.
    value: Rgb,
    /// The wavelengths that it has by channel, where those are not red, green and blue.
    waves: Option<Wavelengths>,
    /// What of it belongs to layers.
    parts: Option<[(Option<usize>, Rgb); 3]>,
    /// What a path from the camera that found this light would bring; infinite where none can.
    brought_from_camera: f32,
    salt: u32,
}

impl Caught {
    /// Linear Rec. 709 of a value by channel.
    #[inline]
    fn rgb(&self, value: Rgb) -> [f32; 3] {
        let value = value.to_array();
        self.waves.as_ref().map_or(value, |waves| waves.rgb(value))
    }
}

/// A surface that scatters light to a viewer.
#[derive(Clone, Copy)]
pub(super) struct Catcher {
    pub bsdf: Bsdf,
    pub is_lambert: bool,
    /// Only on the viewer's side.
    pub is_opaque: bool,
    pub ng: Vec3,
    pub ns: Vec3,
    /// Towards the viewer and towards where the light came from.
    pub wo: Vec3,
    pub wi: Vec3,
}

impl Catcher {
    /// The same from where it is seen and lit.
    pub fn seen(self, wo: Vec3, wi: Vec3) -> Catcher {
        let side = if self.is_opaque && wo.dot(self.ng) < 0.0 { -1.0 } else { 1.0 };
        Catcher { ng: self.ng * side, ns: self.ns * side, wo, wi, ..self }
    }
}

impl Integrator<'_> {
    /// What light that met a surface sends to the camera, if nothing is in its way.
    pub(super) fn catch(&self, path: &LampPath, at: &HitPoint<'_>, material: u32) -> Option<Caught> {
        let sight = self.view.camera.sight(at.surface.p, path.lens)?;
        let margin = self.options.filter.radius();
        let is_on = |at: f32, size: u32| at > -margin && at < size as f32 + margin;
        let is_shown = |[x, y]: [f32; 2]| is_on(x, self.view.width) && is_on(y, self.view.height);
        if !self.view.camera.alike(sight.film).any(is_shown) {
            return None;
        }
        let is_behind = sight.direction.dot(at.surface.ng) <= 0.0;
        let is_hidden = at.material.presence.is_some_and(|p| !p.visible_to.contains(RayKinds::CAMERA));
        if is_hidden || at.material.is_absent_from_behind && is_behind {
            return None;
        }
        let waves = path.waves();
        // As wide as what the camera sees there.
        let (width, spread) = self.view.camera.pixel_cone();
        let (wo, wi) = (sight.direction, -path.ray.direction);
        let (bsdf, ns) = self.read_material(at, width + spread * sight.distance, wo, waves.as_ref());
        let catcher = self.catcher(material, bsdf, [ns, at.surface.ng]).seen(wo, wi);
        let BsdfEval { f_cos, pdf_solid_angle } = self.scattered(&catcher)?;
        let Catcher { ng, wo, wi, .. } = catcher;
        let area = sight.pixels_per_area * (wo.dot(ng) / wi.dot(ng)).abs();
        let plan = self.options.caustics?;
        // The way to where the camera begins to see, which is in what surrounds that place.
        let [near, _] = self.view.camera.range(-sight.direction);
        let start = if near > 0.0 { sight.lens - sight.direction * near } else { sight.lens };
        let around = match self.camera_interior {
            CameraInterior::Same(interior) => interior,
            CameraInterior::Differs => Interior::around(self.scene, start, STILL),
        };
        let medium = &self.scene.media[usize::from(around.medium())];
        let left = if self.scene.features.absorption {
            medium.transmittance_at(sight.distance - near, waves.as_ref())
        } else {
            Rgb::ONE
        };
        let value = path.radiance * f_cos * left * (path.scale * area / plan.paths as f32);
        let found = (path.radiance * f_cos).luminance() / pdf_solid_angle;
        let side = if wo.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let origin = offset_along(at.surface.p, ng * side, ng.abs().dot(at.surface.p_error));
        let segment = Ray::segment(origin, start - origin);
        let (seed, index) = path.point.to_parts();
        (value.max_element() > 0.0).then(|| Caught {
            segment: Ray { origin_primitive: (&at.hit).into(), ..segment },
            film: sight.film,
            value,
            parts: self.parts_of(&catcher, path.light),
            waves,
            brought_from_camera: if path.is_only_way { f32::INFINITY } else { found },
            salt: hash32(seed ^ hash32(index ^ path.bounces)),
        })
    }

    /// A surface with this BSDF and these normals, for shading and geometric.
    pub(super) fn catcher(&self, material: u32, bsdf: Bsdf, [ns, ng]: [Vec3; 2]) -> Catcher {
        let group = self.groups[material as usize];
        let is_lambert = matches!(group, ShadingGroup::Plain | ShadingGroup::Lambert);
        let is_opaque = is_lambert
            || matches!(
                group,
                ShadingGroup::PlainMetalRough | ShadingGroup::Textured | ShadingGroup::MetalRough
            );
        Catcher { bsdf, is_lambert, is_opaque, ng, ns, wo: ng, wi: ng }
    }

    /// What a surface scatters to its viewer, and how often paths from there would go to where the light comes from.
    pub(super) fn scattered(&self, at: &Catcher) -> Option<BsdfEval> {
        let Catcher { bsdf, is_lambert, is_opaque, ng, ns, wo, wi } = at;
        let height = wi.dot(*ng);
        let crosses = height * wo.dot(*ng) < 0.0;
        if height == 0.0 || bsdf.is_specular() || crosses && (*is_opaque || !bsdf.scatters_through()) {
            return None;
        }
        let n = if *is_lambert { *ns } else { scattering_normal(*ns, *ng, *wo) };
        let eval = if *is_lambert {
            let pdf_solid_angle = wi.dot(n).max(0.0) * FRAC_1_PI;
            BsdfEval { f_cos: bsdf.albedo() * pdf_solid_angle, pdf_solid_angle }
        } else {
            let frame = Frame::from_normal(n);
            let (wo, wi) = (frame.to_local(*wo), frame.to_local(*wi));
            if crosses && wo.z * wi.z >= 0.0 {
                return None;
            }
            bsdf.eval(wo, wi)
        };
        let side = if height < 0.0 { -1.0 } else { 1.0 };
        let is_soft = self.softens_terminator() && !crosses;
        let kept = if is_soft { terminator(n * side, *ng * side, *wi) } else { 1.0 };
        (eval.pdf_solid_angle > 0.0).then_some(BsdfEval { f_cos: eval.f_cos * kept, ..eval })
    }

    /// The layers that light of a lamp belongs to, and its shares there.
    fn parts_of(&self, at: &Catcher, light: u32) -> Option<[(Option<usize>, Rgb); 3]> {
        if self.layers.count() == 0 {
            return None;
        }
        let Catcher { bsdf, is_lambert, ng, ns, wo, wi, .. } = at;
        let first = match is_lambert {
            true => FirstBounce::DIFFUSE,
            false => FirstBounce::of(bsdf, [scattering_normal(*ns, *ng, *wo), *ng], *wo, *wi),
        };
        let [a, b] = self.layers.shares(PathClass::Indirect(first));
        let group = self.layers.of_group(usize::from(self.scene.light_groups.of_light(light)));
        Some([a, b, (group, Rgb::ONE)])
    }

    /// Brings the light that nothing is in the way of to the pixels that show it.
    pub(super) fn show(&self, caught: &[Caught], w: &mut Workspace, splats: &mut Vec<Splat>) -> CausticTally {
        let segments: Vec<Ray> = caught.iter().map(|c| c.segment).collect();
        let salts: Vec<u32> = caught.iter().map(|c| c.salt).collect();
        let blocked = self.blocked(&segments, &salts, true, w);
        let mut tally = CausticTally::default();
        for (caught, _) in caught.iter().zip(&blocked).filter(|(_, blocked)| !**blocked) {
            let [x, y] = caught.film;
            let is_inside = x >= 0.0 && y >= 0.0 && x < self.view.width as f32 && y < self.view.height as f32;
            if is_inside {
                tally.add(caught.value.luminance(), caught.brought_from_camera);
            }
            for film in self.view.camera.alike(caught.film) {
                self.spread(caught, film, splats);
            }
        }
        tally
    }

    /// The pixels in whose filters a place of the film is.
    fn spread(&self, caught: &Caught, [film_x, film_y]: [f32; 2], splats: &mut Vec<Splat>) {
        let filter = self.options.filter;
        let range = |at: f32, size: u32| {
            let (first, last) = ((at - 0.5 - filter.radius()).ceil(), (at - 0.5 + filter.radius()).floor());
            (first.max(0.0) as u32)..((last + 1.0).clamp(0.0, size as f32) as u32)
        };
        for y in range(film_y, self.view.height) {
            let of_row = filter.value(film_y - (y as f32 + 0.5));
            for x in range(film_x, self.view.width) {
                let weight = of_row * filter.value(film_x - (x as f32 + 0.5));
                if weight > 0.0 {
                    let value = caught.value * weight;
                    let of_layer = |(layer, share): (Option<usize>, Rgb)| match layer {
                        Some(layer) => SplatPart { layer: layer as u16, rgb: caught.rgb(value * share) },
                        None => SplatPart::NONE,
                    };
                    let parts = caught.parts.map(|parts| Box::new(parts.map(of_layer)));
                    splats.push(Splat { x, y, rgb: caught.rgb(value), parts });
                }
            }
        }
    }
}
