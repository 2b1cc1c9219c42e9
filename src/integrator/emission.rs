//! Emission of surfaces and the environment hit by paths, MIS-weighted against light sampling; emission spectra.
//!
//! Spectral rendering (Wilkie et al. 2014, "Hero Wavelength Spectral Sampling"): throughput, BSDFs, absorption and emission have one
//! value per wavelength of a path in place of red, green and blue. Sampling decisions are symmetric in the wavelengths, which equals
//! the balance heuristic over them; where a direction depends on the wavelength (dispersion), the path continues with a single one,
//! sampled in proportion to throughput. Colours are uplifted to spectra on lookup;
//! [`RadianceBuffer::convert_to_rgb`](super::radiance_buffer::RadianceBuffer::convert_to_rgb) converts the result.

use super::Integrator;
use super::light_visibility::LightVisibility;
use super::radiance_buffer::{PathClass, RadianceOrigin, class_of_path};
use super::sampling::Purpose;
use super::shading_geometry::{HitPoint, PathOrigin};
use super::shading_groups::SortedVertices;
use super::visibility::receiver_class;
use super::wave::{LENGTH, Paths, Scratch, WAVE, Wave, get, get_rgb, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::{Bsdf, Slots};
use crate::color::Rgb;
use crate::color::spectral::{Spectrum, Wavelengths, uplift_emission};
use crate::light::{
    AreaLight, EnvironmentLight, ImageMap, LightSource, Lights, Radiance, SelectedSun, TexelPosition,
    solid_angle_density,
};
use crate::math::{Hit, Ray, Vec3};
use crate::scene::RayKinds;
use crate::simd::{Kernel, dispatch};

impl Integrator<'_> {
    /// Adds the emission of the surface hit by arriving path `i`.
    pub(super) fn emit(&self, bounce: u32, i: usize, at: &HitPoint<'_>, w: &mut Workspace) {
        let HitPoint { surface, hit, material, is_back, time, .. } = at;
        let Some(emission) = material.emission.filter(|e| e.two_sided || !is_back) else { return };
        let light = self.scene.light_at(hit);
        let kept = self.camera_path_fraction(bounce, i, light, w);
        if kept == Rgb::ZERO {
            return;
        }
        let links = self.links_of(material, light.is_some());
        if !self.is_linked_emission(bounce, i, links, &w.arriving) {
            return;
        }
        let wo = -w.rays[i].direction;
        // Unfiltered as in light sampling, but for node graphs that read hits, whose bumps Cycles leaves out in light samples.
        let is_filtered = light.is_none() || material.emission_depends_on_viewer;
        let width = if is_filtered { w.arriving.footprints.width[i] } else { 0.0 };
        let radiance = self.emitted(at, (wo, width), w.wavelengths(i));
        let radiance = emission.beam.radiance(radiance, surface.ng, wo, &self.scene.textures);
        let path = &w.arriving.state;
        let mut weight = 1.0;
        if path.pdf[i].competes()
            && let Some(index) = light
        {
            if self.is_shadowed(i, &w.arriving) {
                return;
            }
            let moving = self.scene.lights.are_moving().then(|| self.scene.lights.area_at(index, *time));
            let area = moving.as_ref().unwrap_or(&self.scene.lights.area()[index as usize]);
            let p = self.start_of_ray(i, w);
            let receiver = self.light_receiver(p, get(&w.arriving.receiver_normal, i));
            let class = receiver_class(i, &w.arriving, self.scene.features.links);
            let pdf_discrete = self.scene.lights.pdf_discrete(class, &receiver, index);
            let through_panes = self.pane_density_ratio(i, (p, surface.p), area.normal_at(surface.p, p), w);
            weight =
                path.pdf[i].mis_weight(|| area.pdf_solid_angle(p, surface.p) * pdf_discrete * through_panes);
        }
        w.radiance_buffer.contribute(
            path.radiance_index[i],
            bounce,
            get_rgb(&path.throughput, i) * radiance * weight * kept,
            || RadianceOrigin {
                class: class_of_path(bounce, PathClass::Emission, &w.arriving.first_bounces, i),
                group: match light {
                    Some(index) => self.scene.light_groups.of_light(index),
                    None => {
                        let material = self.scene.scene_material(surface.material);
                        self.scene.light_groups.of_surface(self.scene.object_at(hit), material)
                    }
                },
            },
        );
    }

    /// Adds the radiance of suns to escaped paths whose direction is inside the sun's disk.
    fn add_suns(&self, bounce: u32, w: &mut Workspace) {
        let suns = self.scene.lights.suns().iter().filter(|s| bounce > 0 || s.is_visible_to_camera);
        for SelectedSun { sun, index, pdf_discrete, .. } in suns {
            let index = *index;
            let path = &w.arriving.state;
            for i in w.escaped.iter().map(|&i| i as usize).filter(|&i| sun.contains(w.rays[i].direction)) {
                if self.optional.visibility && !self.sees_light(bounce, i, index, &w.arriving) {
                    continue;
                }
                let receiver = self.light_receiver(w.rays[i].origin, get(&w.arriving.receiver_normal, i));
                let class = receiver_class(i, &w.arriving, self.scene.features.links);
                let far = self.scene.lights.far_pdf_discrete(class, &receiver);
                let pdf_discrete = pdf_discrete[class as usize] * far;
                let pdf = sun.pdf_inside() * pdf_discrete;
                let weight = path.pdf[i].mis_weight(|| pdf);
                let kept = self.camera_path_fraction(bounce, i, Some(index), w);
                if kept == Rgb::ZERO {
                    continue;
                }
                let wavelengths = w.times.wavelengths(path.radiance_index[i]);
                let radiance = self.uplift_light(sun.radiance, Some(index), wavelengths);
                let value = get_rgb(&path.throughput, i) * radiance * weight * kept;
                w.radiance_buffer.contribute(path.radiance_index[i], bounce, value, || RadianceOrigin {
                    class: class_of_path(bounce, PathClass::Environment, &w.arriving.first_bounces, i),
                    group: self.scene.light_groups.of_light(index),
                });
            }
        }
    }

    /// Adds the environment for camera rays to escaped camera rays.
    fn add_camera_environment(&self, w: &mut Workspace) {
        let Some(seen) = &self.scene.camera_environment else { return };
        look_up(seen, &w.rays, &w.escaped, &mut w.wave.scratch);
        let path = &w.arriving.state;
        let [_, _, _, _, _, r, g, b, _] = &w.wave.scratch;
        let group = self.scene.light_groups.of_light((self.scene.lights.len() as u32).saturating_sub(1));
        for (k, &i) in w.escaped.iter().enumerate() {
            let i = i as usize;
            let radiance = Rgb::new(r[k], g[k], b[k]);
            let radiance = self.uplift_light(radiance, None, w.times.wavelengths(path.radiance_index[i]));
            w.radiance_buffer.contribute(
                path.radiance_index[i],
                0,
                get_rgb(&path.throughput, i) * radiance,
                || RadianceOrigin {
                    class: class_of_path(0, PathClass::Environment, &w.arriving.first_bounces, i),
                    group,
                },
            );
        }
    }

    /// Sets alpha to 1 for camera rays that escape to a background, even a black one.
    fn set_background_opaque(&self, w: &mut Workspace) {
        if self.scene.features.background {
            for &i in &w.escaped {
                w.radiance_buffer.set_opaque(w.arriving.state.radiance_index[i as usize]);
            }
        }
    }

    /// Adds the environment and suns to escaped paths.
    pub(super) fn add_environment(&self, bounce: u32, w: &mut Workspace) {
        let (lights, features) = (&self.scene.lights, &self.scene.features);
        if bounce > 0 {
            if self.optional.only_clear_glass {
                self.add_clear_background(w);
            }
        } else if !features.environment_visible_to.contains(RayKinds::CAMERA) {
            return;
        } else {
            self.set_background_opaque(w);
            if features.camera_environment {
                return self.add_camera_environment(w);
            }
        }
        self.add_suns(bounce, w);
        let Some(environment) = lights.environment() else { return };
        if self.optional.visibility {
            self.keep_visible_escapes(bounce, w);
        }
        let (path, scratch) = (&w.arriving.state, &mut w.wave.scratch);
        look_up(environment, &w.rays, &w.escaped, scratch);
        let linked = self.scene.features.links;
        if lights.use_tree() {
            let (rays, escaped, arriving) = (&w.rays, &w.escaped, &w.arriving);
            let visibility = self.options.light_visibility;
            dispatch(FarProbabilities { lights, visibility, rays, escaped, arriving, linked, scratch });
        } else {
            scratch[0][..w.escaped.len()].fill(1.0);
        }
        let [far, _, _, _, _, r, g, b, pdf] = scratch;
        if environment.has_portals() {
            for (pdf, ray) in pdf.iter_mut().zip(w.escaped.iter().map(|&i| &w.rays[i as usize])) {
                *pdf = LightSource::pdf_solid_angle(environment, ray.origin, ray.direction);
            }
        }
        let pdf_discrete = lights.environment_pdf_discrete(0);
        let light = lights.len() as u32 - 1;
        for (k, &i) in w.escaped.iter().enumerate() {
            let i = i as usize;
            let weight = path.pdf[i].mis_weight(|| {
                let of_class = || lights.environment_pdf_discrete(receiver_class(i, &w.arriving, linked));
                let pdf_discrete = if linked { of_class() } else { pdf_discrete };
                pdf[k] * pdf_discrete * far[k]
            });
            let radiance = Rgb::new(r[k], g[k], b[k]);
            let radiance =
                self.uplift_light(radiance, Some(light), w.times.wavelengths(path.radiance_index[i]));
            w.radiance_buffer.contribute(
                path.radiance_index[i],
                bounce,
                get_rgb(&path.throughput, i) * radiance * weight,
                || RadianceOrigin {
                    class: class_of_path(bounce, PathClass::Environment, &w.arriving.first_bounces, i),
                    group: self.scene.light_groups.of_light(light),
                },
            );
        }
    }
}

/// Computes the light tree's probability of selecting lights at infinity, at the origins of escaped rays: first scratch array.
struct FarProbabilities<'a> {
    lights: &'a Lights,
    visibility: Option<&'a LightVisibility>,
    rays: &'a [Ray],
    escaped: &'a [u32],
    arriving: &'a Paths,
    /// Is light linking in use?
    linked: bool,
    scratch: &'a mut Scratch,
}

impl Kernel for FarProbabilities<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let FarProbabilities { lights, visibility, rays, escaped, arriving, linked, scratch: [far, ..] } =
            self;
        for (far, &i) in far.iter_mut().zip(escaped) {
            let i = i as usize;
            let normal = get(&arriving.receiver_normal, i);
            let receiver = LightVisibility::receiver(visibility, rays[i].origin, normal);
            *far = lights.far_pdf_discrete(receiver_class(i, arriving, linked), &receiver);
        }
    }
}

/// Looks up environment radiance and solid-angle pdf in the directions of escaped rays: last four scratch arrays.
fn look_up(environment: &EnvironmentLight, rays: &[Ray], escaped: &[u32], scratch: &mut Scratch) {
    if let Some(map) = environment.image_map() {
        return dispatch(LookUp { map, rays, escaped, scratch });
    }
    let [_, _, _, _, _, r, g, b, pdf] = scratch;
    for (k, &i) in escaped.iter().enumerate() {
        let direction = rays[i as usize].direction;
        [r[k], g[k], b[k]] = environment.radiance(direction).to_array();
        pdf[k] = environment.pdf_solid_angle(direction);
    }
}

struct LookUp<'a> {
    map: &'a ImageMap,
    rays: &'a [Ray],
    escaped: &'a [u32],
    scratch: &'a mut Scratch,
}

/// Prefetch distance of texels, in lookups.
const PREFETCH_DISTANCE: usize = 16;
const _: () = assert!(WAVE + PREFETCH_DISTANCE <= LENGTH);

impl Kernel for LookUp<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LookUp { map, rays, escaped, scratch } = self;
        let [x, y, z, ..] = &mut *scratch;
        for (k, &i) in escaped.iter().enumerate() {
            [x[k], y[k], z[k]] = rays[i as usize].direction.to_array();
        }
        let count = escaped.len().min(WAVE);
        locate(map, scratch, count);
        read(map, scratch, count);
    }
}

// References to loop data as arguments let the compiler assume that it doesn't change.

/// Maps directions, in the first three scratch arrays, to bilinear weights in the next two and texel indices in the last.
#[inline(always)]
fn locate(map: &ImageMap, scratch: &mut Scratch, count: usize) {
    let [x, y, z, s, t, _, _, _, first] = scratch;
    for k in 0..count {
        let at = map.locate(map.uv(Vec3::new(x[k], y[k], z[k])));
        [s[k], t[k]] = at.weights;
        first[k] = f32::from_bits(at.first);
    }
}

/// Reads radiance and pdf at the texels that [`locate`] found.
#[inline(always)]
fn read(map: &ImageMap, scratch: &mut Scratch, count: usize) {
    let [x, y, z, s, t, r, g, b, pdf] = scratch;
    for k in 0..count {
        map.prefetch(pdf[k + PREFETCH_DISTANCE].to_bits());
        let at = TexelPosition { first: pdf[k].to_bits(), weights: [s[k], t[k]] };
        let (radiance, density) = map.read(&at);
        [r[k], g[k], b[k]] = radiance.to_array();
        pdf[k] = density;
    }
    for k in 0..count {
        pdf[k] *= solid_angle_density(Vec3::new(x[k], y[k], z[k]));
    }
}

/// A light's spectrum, scaled so that the mean of its RGB channels is that of `rgb`.
fn scaled(spectrum: &Spectrum, rgb: Rgb, wavelengths: &Wavelengths) -> Rgb {
    let mean = spectrum.rgb().max(Rgb::ZERO).mean();
    let scale = if mean > 0.0 { rgb.mean() / mean } else { 0.0 };
    spectrum.at(wavelengths) * scale
}

impl Integrator<'_> {
    /// Is spectral rendering enabled?
    #[inline(always)]
    pub(super) fn is_spectral(&self) -> bool {
        self.scene.shading.spectral
    }

    /// Samples the wavelengths of each new path.
    #[cold]
    pub(super) fn start_wavelengths(&self, w: &mut Workspace) {
        let Workspace { times, arriving, pixels, .. } = w;
        let dimensions = self.dimensions(0, Purpose::Wavelength);
        let path = &arriving.state;
        let draw = |i: usize| {
            let [u, ..] = path.sobol_point(i).sample_4d(&dimensions);
            Wavelengths::sample(u)
        };
        times.start_wavelengths((0..pixels.len()).map(draw), self.options.branches);
    }

    /// Emission of colour `rgb` at a path's wavelengths, by the spectrum of `light` if it has one, else by uplift.
    #[inline]
    pub(super) fn uplift_light(
        &self,
        rgb: Rgb,
        light: Option<u32>,
        wavelengths: Option<&Wavelengths>,
    ) -> Rgb {
        let Some(wavelengths) = wavelengths else { return rgb };
        match light.and_then(|light| self.scene.spectrum_of_light(light)) {
            Some(spectrum) => scaled(spectrum, rgb, wavelengths),
            None => uplift_emission(rgb, wavelengths),
        }
    }

    /// Multiplies light samples whose emission depends on the hit by the radiance emitted towards the vertex and the opacity there.
    #[cold]
    pub(super) fn evaluate_emission_at_hits(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, times, .. } = w;
        let Wave { paths, vertices: v, .. } = &mut **wave;
        for i in sorted.lit() {
            let radiance = get_rgb(&v.light.radiance, i);
            let light = self.scene.lights.area().get(v.light.index[i] as usize);
            let Some(AreaLight { radiance: Radiance::AtHit { primitive, .. }, .. }) = light else { continue };
            if radiance.max_element() <= 0.0 {
                continue;
            }
            let (origin, target) = (get(&v.p, i), get(&v.light.target, i));
            let [a, b] = light.map_or([0.0; 2], |light| light.edge_coordinates(target));
            let hit = Hit { t: (target - origin).length(), u: a, v: b, prim: *primitive, ..Hit::MISS };
            let ray = Ray::new(origin, get(&v.light.wi, i));
            let time = times.of(paths.state.radiance_index[i]);
            let at = self.ray_hit_point(&ray, hit, self.scene.geometries.material(&hit), time);
            let opacity = self.opacity(&ray, &hit, time, at.material, PathOrigin::of_kinds(RayKinds::SHADOW));
            let emitted = self.emitted(&at, (-ray.direction, 0.0), None) * opacity;
            set_rgb(&mut v.light.radiance, i, radiance * emitted);
        }
    }

    /// Uplifts the colours of light samples to the wavelengths of their paths.
    #[cold]
    pub(super) fn uplift_light_samples(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, times, .. } = w;
        let light = &mut wave.vertices.light;
        for i in sorted.lit() {
            let rgb = get_rgb(&light.radiance, i);
            if rgb.max_element() > 0.0 {
                let index = self.only_light.unwrap_or(light.index[i]);
                let wavelengths = times.wavelengths(wave.paths.state.radiance_index[i]);
                set_rgb(&mut light.radiance, i, self.uplift_light(rgb, Some(index), wavelengths));
            }
        }
    }

    /// Radiance that a surface emits towards `wo`, for a path's footprint, metres, and wavelengths.
    pub(super) fn emitted(
        &self,
        at: &HitPoint<'_>,
        (wo, width): (Vec3, f32),
        wavelengths: Option<&Wavelengths>,
    ) -> Rgb {
        let HitPoint { surface, material, .. } = at;
        let Some(emission) = material.emission else { return Rgb::ZERO };
        let rgb = match emission.radiance.texture {
            None => Rgb::from_array(emission.radiance.factor),
            Some(_) => {
                let coordinates = self.coordinates(at);
                let hit_data = self.hit_data(at, &coordinates, wo);
                self.slots(&coordinates, surface, wo, width, hit_data.as_ref()).color(&emission.radiance)
            }
        };
        let rgb = match material.emission_depends_on_vertex() {
            true => rgb * self.vertex_color(at),
            false => rgb,
        };
        match (wavelengths, &material.light_spectrum) {
            (None, _) => rgb,
            (Some(wavelengths), Some(spectrum)) => scaled(spectrum, rgb, wavelengths),
            (Some(wavelengths), None) => uplift_emission(rgb, wavelengths),
        }
    }

    /// The interpolated vertex colour at a hit.
    #[cold]
    fn vertex_color(&self, at: &HitPoint<'_>) -> Rgb {
        let [r, g, b, _] = self.scene.geometries.coordinates(&at.surface, &at.hit, false, at.time).color;
        Rgb::from_array([r, g, b])
    }

    /// The BSDF of a surface in RGB, for AOVs.
    #[cold]
    pub(super) fn rgb_bsdf(&self, at: &HitPoint<'_>, wo: Vec3) -> Bsdf {
        self.read_material(at, 0.0, wo, None).bsdf
    }
}
