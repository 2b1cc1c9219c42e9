//! Light that paths find by themselves: emitting surfaces and the environment, weighted against light sampling.

use super::Integrator;
use super::hit_point::HitPoint;
use super::lanes::{LENGTH, WAVE, get, get_rgb};
use super::layers::{Origin, Way, way_of_path};
use super::linking::class;
use super::wave::{Paths, Scratch};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::light::{
    EnvironmentLight, ImageMap, Lights, Receiver, SelectedSun, TexelPosition, solid_angle_density,
};
use crate::math::{Ray, Vec3};
use crate::sampling::power_heuristic;
use crate::scene::RayKinds;
use crate::simd::{Kernel, dispatch};

impl Integrator<'_> {
    /// Adds the light that a surface emits along the ray of arriving path `i`.
    pub(super) fn emit(&self, bounce: u32, i: usize, at: &HitPoint<'_>, w: &mut Workspace) {
        let HitPoint { surface, hit, material, is_back, time } = at;
        let Some(emission) = material.emission.filter(|e| e.two_sided || !is_back) else { return };
        let light = self.scene.light_at(hit);
        if self.is_left_to_lamps(bounce, i, light, w) {
            return;
        }
        let links = self.links_of(material, light.is_some());
        if !self.finds_linked(bounce, i, links, &w.arriving) {
            return;
        }
        let wo = -w.rays[i].direction;
        let radiance = self.emitted(at, wo, w.times.waves(w.arriving.carried.sample[i]));
        let radiance = emission.beam.of(radiance, surface.ng, wo, &self.scene.textures);
        let path = &w.arriving.carried;
        let mut weight = 1.0;
        if path.pdf[i] > 0.0
            && let Some(index) = light
        {
            if self.is_shadowed(i, &w.arriving) {
                return;
            }
            let moving = self.scene.lights.are_moving().then(|| self.scene.lights.area_at(index, *time));
            let area = moving.as_ref().unwrap_or(&self.scene.lights.area()[index as usize]);
            let p = w.rays[i].origin;
            let receiver = Receiver { p, normal: get(&w.arriving.receiver_normal, i) };
            let class = class(i, &w.arriving, self.scene.features.links);
            let pdf_discrete = self.scene.lights.pdf_discrete(class, &receiver, index);
            weight = power_heuristic(path.pdf[i], area.pdf_solid_angle(p, surface.p) * pdf_discrete);
        }
        w.sink.contribute(path.sample[i], get_rgb(&path.throughput, i) * radiance * weight, || Origin {
            way: way_of_path(bounce, Way::Emission, &w.arriving.first_bounces, i),
            group: match light {
                Some(index) => self.scene.light_groups.of_light(index),
                None => {
                    let material = self.scene.described_material(surface.material);
                    self.scene.light_groups.of_surface(self.scene.object_at(hit), material)
                }
            },
        });
    }

    /// Adds the light of the suns in whose directions paths left the scene.
    fn add_suns(&self, bounce: u32, w: &mut Workspace) {
        let suns = self.scene.lights.suns().iter().filter(|s| bounce > 0 || s.is_seen);
        for SelectedSun { sun, index, pdf_discrete, .. } in suns {
            let index = *index;
            let path = &w.arriving.carried;
            for i in w.escaped.iter().map(|&i| i as usize).filter(|&i| sun.contains(w.rays[i].direction)) {
                if self.parts.kinds && !self.brings_light(bounce, i, index, &w.arriving) {
                    continue;
                }
                let receiver = Receiver { p: w.rays[i].origin, normal: get(&w.arriving.receiver_normal, i) };
                let class = class(i, &w.arriving, self.scene.features.links);
                let far = self.scene.lights.far_pdf_discrete(class, &receiver);
                let pdf_discrete = pdf_discrete[class as usize] * far;
                let pdf = sun.pdf_solid_angle() * pdf_discrete;
                let weight = if path.pdf[i] > 0.0 { power_heuristic(path.pdf[i], pdf) } else { 1.0 };
                if self.is_left_to_lamps(bounce, i, Some(index), w) {
                    continue;
                }
                let waves = w.times.waves(path.sample[i]);
                let radiance = self.lanes_of_light(sun.radiance, Some(index), waves);
                let value = get_rgb(&path.throughput, i) * radiance * weight;
                w.sink.contribute(path.sample[i], value, || Origin {
                    way: way_of_path(bounce, Way::Environment, &w.arriving.first_bounces, i),
                    group: self.scene.light_groups.of_light(index),
                });
            }
        }
    }

    /// Adds what cameras see of an environment that differs for them.
    fn escape_to_camera(&self, w: &mut Workspace) {
        let Some(seen) = &self.scene.camera_environment else { return };
        look_up(seen, &w.rays, &w.escaped, &mut w.wave.scratch);
        let path = &w.arriving.carried;
        let [_, _, _, _, _, r, g, b, _] = &w.wave.scratch;
        let group = self.scene.light_groups.of_light((self.scene.lights.len() as u32).saturating_sub(1));
        for (k, &i) in w.escaped.iter().enumerate() {
            let i = i as usize;
            let radiance = Rgb::new(r[k], g[k], b[k]);
            let radiance = self.lanes_of_light(radiance, None, w.times.waves(path.sample[i]));
            w.sink.contribute(path.sample[i], get_rgb(&path.throughput, i) * radiance, || Origin {
                way: way_of_path(0, Way::Environment, &w.arriving.first_bounces, i),
                group,
            });
            w.sink.cover(path.sample[i]);
        }
    }

    /// Adds the environment to the paths that left the scene.
    pub(super) fn escape(&self, bounce: u32, w: &mut Workspace) {
        let lights = &self.scene.lights;
        if bounce > 0 {
            if self.parts.clear {
                self.see_through(w);
            }
        } else if !self.scene.features.environment_visible_to.contains(RayKinds::CAMERA) {
            return;
        } else if self.scene.features.camera_environment {
            return self.escape_to_camera(w);
        }
        self.add_suns(bounce, w);
        let Some(environment) = lights.environment() else { return };
        if self.parts.kinds {
            self.keep_visible_escapes(bounce, w);
        }
        let (path, scratch) = (&w.arriving.carried, &mut w.wave.scratch);
        look_up(environment, &w.rays, &w.escaped, scratch);
        let linked = self.scene.features.links;
        if lights.use_tree() {
            let (rays, escaped, arriving) = (&w.rays, &w.escaped, &w.arriving);
            dispatch(FarShares { lights, rays, escaped, arriving, linked, scratch });
        } else {
            scratch[0][..w.escaped.len()].fill(1.0);
        }
        let [far, _, _, _, _, r, g, b, pdf] = scratch;
        if environment.has_portals() {
            for (pdf, ray) in pdf.iter_mut().zip(w.escaped.iter().map(|&i| &w.rays[i as usize])) {
                *pdf = environment.pdf_from(ray.origin, ray.direction);
            }
        }
        let pdf_discrete = lights.environment_pdf_discrete(0);
        let light = lights.len() as u32 - 1;
        for (k, &i) in w.escaped.iter().enumerate() {
            let i = i as usize;
            let weight = match path.pdf[i] {
                scattered if scattered > 0.0 => {
                    let of_class = || lights.environment_pdf_discrete(class(i, &w.arriving, linked));
                    let pdf_discrete = if linked { of_class() } else { pdf_discrete };
                    power_heuristic(scattered, pdf[k] * pdf_discrete * far[k])
                }
                _ => 1.0,
            };
            let radiance = Rgb::new(r[k], g[k], b[k]);
            let radiance = self.lanes_of_light(radiance, Some(light), w.times.waves(path.sample[i]));
            w.sink.contribute(path.sample[i], get_rgb(&path.throughput, i) * radiance * weight, || Origin {
                way: way_of_path(bounce, Way::Environment, &w.arriving.first_bounces, i),
                group: self.scene.light_groups.of_light(light),
            });
            if bounce == 0 {
                w.sink.cover(path.sample[i]);
            }
        }
    }
}

/// The probabilities of choosing among the lights infinitely far away, where rays that left came from: to the first lane of the
/// scratch memory.
struct FarShares<'a> {
    lights: &'a Lights,
    rays: &'a [Ray],
    escaped: &'a [u32],
    arriving: &'a Paths,
    /// Lights are linked to some objects only.
    linked: bool,
    scratch: &'a mut Scratch,
}

impl Kernel for FarShares<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let FarShares { lights, rays, escaped, arriving, linked, scratch: [far, ..] } = self;
        for (far, &i) in far.iter_mut().zip(escaped) {
            let i = i as usize;
            let receiver = Receiver { p: rays[i].origin, normal: get(&arriving.receiver_normal, i) };
            *far = lights.far_pdf_discrete(class(i, arriving, linked), &receiver);
        }
    }
}

/// Radiance and density of the directions in which rays left: to the last four lanes of the scratch memory.
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

/// So many lookups ahead texels are asked for.
const AHEAD: usize = 16;
const _: () = assert!(WAVE + AHEAD <= LENGTH);

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

// What the loops read is taken by reference, so that the compiler knows that it stays as it is.

/// From directions, in the first lanes of the scratch memory, to places between texels: shares behind them, and the texels'
/// indices in the last lane.
#[inline(always)]
fn locate(map: &ImageMap, scratch: &mut Scratch, count: usize) {
    let [x, y, z, s, t, _, _, _, first] = scratch;
    for k in 0..count {
        let at = map.locate(map.uv(Vec3::new(x[k], y[k], z[k])));
        [s[k], t[k]] = at.shares;
        first[k] = f32::from_bits(at.first);
    }
}

/// From there to radiances and densities.
#[inline(always)]
fn read(map: &ImageMap, scratch: &mut Scratch, count: usize) {
    let [x, y, z, s, t, r, g, b, pdf] = scratch;
    for k in 0..count {
        map.prefetch(pdf[k + AHEAD].to_bits());
        let at = TexelPosition { first: pdf[k].to_bits(), shares: [s[k], t[k]] };
        let (radiance, density) = map.read(&at);
        [r[k], g[k], b[k]] = radiance.to_array();
        pdf[k] = density;
    }
    for k in 0..count {
        pdf[k] *= solid_angle_density(Vec3::new(x[k], y[k], z[k]));
    }
}
