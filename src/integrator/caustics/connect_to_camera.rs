//! Connections of light paths to the camera, and their splats.

use super::super::Integrator;
use super::super::interior::{CameraInterior, Interior};
use super::super::mixes::eval_lobes;
use super::super::radiance_buffer::PathClass;
use super::super::shading_geometry::{EvaluatedMaterial, HitPoint, Mapping, Terminator, scattering_normal};
use super::super::shading_groups::ShadingGroup;
use super::super::wave::FirstBounce;
use super::super::workspace::Workspace;
use super::STILL;
use super::plan::{CausticTally, LightPath};
use crate::bsdf::{Bsdf, BsdfEval};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::CausticRole;
use crate::film::{Splat, SplatPart};
use crate::math::{Frame, Ray, Vec3, offset_along};
use crate::sampling::hash::hash32;
use crate::scene::RayKinds;
use std::f32::consts::FRAC_1_PI;

/// A connection to the camera.
pub(super) struct CameraConnection {
    /// From the surface to the lens.
    segment: Ray,
    film: [f32; 2],
    /// Contribution to a pixel whose filter weight is 1.
    value: Rgb,
    /// The wavelengths of the channels; none for red, green and blue.
    wavelengths: Option<Wavelengths>,
    /// Its shares of layers: light passes and light groups.
    parts: Option<[(Option<usize>, Rgb); 3]>,
    /// Contribution of a path from the camera that finds this light; infinite where none can.
    value_from_camera: f32,
    salt: u32,
}

impl CameraConnection {
    /// Linear Rec. 709 of a value by channel.
    #[inline]
    fn rgb(&self, value: Rgb) -> [f32; 3] {
        let value = value.to_array();
        self.wavelengths.as_ref().map_or(value, |wavelengths| wavelengths.rgb(value))
    }
}

/// A surface that scatters light to the camera.
#[derive(Clone, Copy)]
pub(super) struct Receiver {
    pub bsdf: Bsdf,
    pub is_lambert: bool,
    /// It scatters on the camera's side only.
    pub is_opaque: bool,
    /// Only its diffuse lobes count.
    pub is_diffuse: bool,
    pub ng: Vec3,
    pub ns: Vec3,
    pub mapping: Mapping,
    /// Directions to the camera and back along the light path.
    pub wo: Vec3,
    pub wi: Vec3,
}

impl Receiver {
    /// The receiver seen along these directions.
    pub fn seen(self, wo: Vec3, wi: Vec3) -> Receiver {
        let side = if self.is_opaque && wo.dot(self.ng) < 0.0 { -1.0 } else { 1.0 };
        Receiver {
            ng: self.ng * side,
            ns: self.ns * side,
            mapping: self.mapping.on_side(side),
            wo,
            wi,
            ..self
        }
    }
}

impl Integrator<'_> {
    /// The connection of a hit to the camera, before the test of visibility.
    pub(super) fn connect_to_camera(
        &self,
        path: &LightPath,
        at: &HitPoint<'_>,
        material: u32,
    ) -> Option<CameraConnection> {
        let sight = self.view.camera.connect(at.surface.p, path.lens)?;
        let margin = self.options.filter.radius();
        let is_on = |at: f32, size: u32| at > -margin && at < size as f32 + margin;
        let has_aovs = |[x, y]: [f32; 2]| is_on(x, self.view.width) && is_on(y, self.view.height);
        if !self.view.camera.equivalent_film_points(sight.film).any(has_aovs) {
            return None;
        }
        let is_back = sight.direction.dot(at.surface.ng) <= 0.0;
        let is_hidden =
            at.material.surface_visibility.is_some_and(|p| !p.visible_to.contains(RayKinds::CAMERA));
        if is_hidden || at.material.is_absent_from_behind && is_back {
            return None;
        }
        let wavelengths = path.wavelengths();
        // Texture footprint of a ray from the camera.
        let (width, spread) = self.view.camera.pixel_cone();
        let (wo, wi) = (sight.direction, -path.ray.direction);
        let evaluated = self.read_material(at, width + spread * sight.distance, wo, wavelengths.as_ref());
        let receiver = self.receiver(path, material, evaluated, at.surface.ng).seen(wo, wi);
        let BsdfEval { f_cos, pdf_solid_angle } = self.scattered(&receiver)?;
        let Receiver { ng, wo, wi, .. } = receiver;
        let area = sight.pixels_per_area * (wo.dot(ng) / wi.dot(ng)).abs();
        let plan = self.options.caustics?;
        // The segment ends at the camera's near distance, in the medium there.
        let [near, _] = self.view.camera.range(-sight.direction);
        let start = if near > 0.0 { sight.lens - sight.direction * near } else { sight.lens };
        let around = match self.camera_interior {
            CameraInterior::Same(interior) => interior,
            CameraInterior::Differs => Interior::around(self.scene, start, STILL),
        };
        let medium = &self.scene.media[usize::from(around.medium())];
        let left = if self.scene.features.absorption {
            medium.transmittance_at(sight.distance - near, wavelengths.as_ref())
        } else {
            Rgb::ONE
        };
        let value = path.radiance * f_cos * left * (path.scale * area / plan.paths as f32);
        let found = (path.radiance * f_cos).luminance() / pdf_solid_angle;
        let side = if wo.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let origin = offset_along(at.surface.p, ng * side, ng.abs().dot(at.surface.p_error));
        let segment = Ray::segment(origin, start - origin);
        let (seed, index) = path.point.to_parts();
        (value.max_element() > 0.0).then(|| CameraConnection {
            segment: Ray { origin_primitive: (&at.hit).into(), ..segment },
            film: sight.film,
            value,
            parts: self.parts_of(&receiver, path.light),
            wavelengths,
            value_from_camera: if path.is_only_way { f32::INFINITY } else { found },
            salt: hash32(seed ^ hash32(index ^ path.bounces)),
        })
    }

    /// A surface of this geometric normal.
    pub(super) fn receiver(
        &self,
        path: &LightPath,
        material: u32,
        EvaluatedMaterial { bsdf, ns, mapping }: EvaluatedMaterial,
        ng: Vec3,
    ) -> Receiver {
        let is_of_diffuse =
            self.options.caustics.is_some_and(|p| p.role(material) == CausticRole::DiffuseReceiver);
        let group = self.groups[material as usize];
        let is_lambert = matches!(group, ShadingGroup::Plain | ShadingGroup::Lambert);
        let is_opaque = is_lambert
            || matches!(
                group,
                ShadingGroup::PlainMetalRough | ShadingGroup::Textured | ShadingGroup::MetalRough
            );
        // No path from the camera finds the rest of the only ones.
        let is_diffuse = is_of_diffuse && !path.is_only_way;
        Receiver { bsdf, is_lambert, is_opaque, is_diffuse, ng, ns, mapping, wo: ng, wi: ng }
    }

    /// BSDF times cosine, and the density with which a path from the camera would sample the direction of the light.
    pub(super) fn scattered(&self, at: &Receiver) -> Option<BsdfEval> {
        let Receiver { bsdf, is_lambert, is_opaque, is_diffuse, ng, ns, mapping, wo, wi } = at;
        let height = wi.dot(*ng);
        let crosses = height * wo.dot(*ng) < 0.0;
        if height == 0.0 || bsdf.is_specular() || crosses && (*is_opaque || !bsdf.scatters_through()) {
            return None;
        }
        let evaluated = EvaluatedMaterial { bsdf: *bsdf, ns: *ns, mapping: *mapping };
        let n = if *is_lambert { *ns } else { scattering_normal(*ns, *ng, *wo) };
        let (eval, diffuse) = if *is_lambert {
            let pdf_solid_angle = wi.dot(n).max(0.0) * FRAC_1_PI;
            let f_cos = bsdf.albedo() * pdf_solid_angle;
            (BsdfEval { f_cos, pdf_solid_angle }, f_cos)
        } else {
            let frame = Frame::from_normal(n);
            let (viewer, light) = (*wo, *wi);
            let (wo, wi) = (frame.to_local(viewer), frame.to_local(light));
            if crosses && wo.z * wi.z >= 0.0 {
                return None;
            }
            let is_split = mapping.is_mapped && n != *ns;
            let (eval, diffuse) = match is_split {
                true => eval_lobes(&evaluated, *ng, [viewer, light]),
                false => (bsdf.eval(wo, wi), bsdf.diffuse_part(wo, wi)),
            };
            let f_cos = if *is_diffuse { bsdf.diffuse_part(wo, wi).min(eval.f_cos) } else { eval.f_cos };
            (BsdfEval { f_cos, ..eval }, diffuse)
        };
        let side = if height < 0.0 { -1.0 } else { 1.0 };
        let terminator = if crosses { Terminator::Sharp } else { self.terminator() };
        let normals = [n * side, mapping.smooth * side, *ng * side];
        let (f_cos, kept) =
            terminator.left((eval.f_cos, diffuse), evaluated.relief(), (*ns * side, normals), *wi);
        let f_cos = f_cos * kept;
        (eval.pdf_solid_angle > 0.0).then_some(BsdfEval { f_cos, ..eval })
    }

    /// The layers that light of this light belongs to, and its shares.
    fn parts_of(&self, at: &Receiver, light: u32) -> Option<[(Option<usize>, Rgb); 3]> {
        if self.layers.count() == 0 {
            return None;
        }
        let Receiver { bsdf, is_lambert, is_diffuse, ng, ns, wo, wi, .. } = at;
        let first = match *is_lambert || *is_diffuse {
            true => FirstBounce::DIFFUSE,
            false => FirstBounce::of(bsdf, [scattering_normal(*ns, *ng, *wo), *ng], *wo, *wi),
        };
        let [a, b] = self.layers.shares(PathClass::Indirect(first));
        let group = self.layers.of_group(usize::from(self.scene.light_groups.of_light(light)));
        Some([a, b, (group, Rgb::ONE)])
    }

    /// Tests the visibility of connections and adds the unoccluded ones to the pixels around.
    pub(super) fn splat(
        &self,
        connections: &[CameraConnection],
        w: &mut Workspace,
        splats: &mut Vec<Splat>,
    ) -> CausticTally {
        let segments: Vec<Ray> = connections.iter().map(|c| c.segment).collect();
        let salts: Vec<u32> = connections.iter().map(|c| c.salt).collect();
        let blocked = self.blocked(&segments, &salts, true, w);
        let mut tally = CausticTally::default();
        for (connections, _) in connections.iter().zip(&blocked).filter(|(_, blocked)| !**blocked) {
            let [x, y] = connections.film;
            let is_inside = x >= 0.0 && y >= 0.0 && x < self.view.width as f32 && y < self.view.height as f32;
            if is_inside {
                tally.add(connections.value.luminance(), connections.value_from_camera);
            }
            for film in self.view.camera.equivalent_film_points(connections.film) {
                self.splat_one(connections, film, splats);
            }
        }
        tally
    }

    /// Adds a connection to the pixels whose filters include a point of the film.
    fn splat_one(&self, connections: &CameraConnection, [film_x, film_y]: [f32; 2], splats: &mut Vec<Splat>) {
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
                    let value = connections.value * weight;
                    let of_layer = |(layer, share): (Option<usize>, Rgb)| match layer {
                        Some(layer) => SplatPart { layer: layer as u16, rgb: connections.rgb(value * share) },
                        None => SplatPart::NONE,
                    };
                    let parts = connections.parts.map(|parts| Box::new(parts.map(of_layer)));
                    splats.push(Splat { x, y, rgb: connections.rgb(value), parts });
                }
            }
        }
    }
}
