//! What rays meet: emitted light, and the surfaces that scatter it, sorted by the loop that shades them.

use super::Integrator;
use super::wave::{Paths, Vertices, Workspace, get, set};
use crate::bsdf::{Bsdf, BsdfClass};
use crate::compile::{CompiledMaterial, Coordinates, Surface, TexturedSlots, transmittance};
use crate::film::AovSample;
use crate::math::{Hit, Ray, Vec2, Vec3};
use crate::sampling::power_heuristic;
use crate::texture::TexturePoint;

/// Which loop shades a vertex. The order is that of the sorted vertices.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Group {
    Lambert,
    /// Light sampling may reach it.
    Rough,
    /// It can't.
    Specular,
    /// The path ends here.
    None,
}

const GROUPS: usize = 4;

/// How many vertices there are of each group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sorted {
    /// Lambertian ones, the first.
    pub lambert: usize,
    /// All that light sampling may reach, Lambertian ones included.
    pub lit: usize,
    total: usize,
}

impl Sorted {
    /// All vertices.
    pub(super) fn total(&self) -> usize {
        self.total
    }
}

fn group_of(material: &CompiledMaterial) -> Group {
    match material.class {
        BsdfClass::Black => Group::None,
        BsdfClass::Lambert => Group::Lambert,
        BsdfClass::Dielectric | BsdfClass::ThinDielectric => Group::Specular,
        BsdfClass::Conductor | BsdfClass::MetalRough => {
            let is_specular = material.constant.is_some_and(|b| b.is_specular());
            if is_specular { Group::Specular } else { Group::Rough }
        }
    }
}

impl Integrator<'_> {
    /// Adds what the arriving paths see to their radiance and sorts the surfaces where they go on. With `is_last` none
    /// goes on.
    pub(super) fn surfaces(&self, bounce: u32, is_last: bool, w: &mut Workspace) -> Sorted {
        let counts = self.classify(is_last, w);
        let lambert = counts[Group::Lambert as usize];
        let lit = lambert + counts[Group::Rough as usize];
        let sorted = Sorted { lambert, lit, total: lit + counts[Group::Specular as usize] };
        let mut next = [0, lambert, lit];
        w.bsdfs.clear();
        w.bsdfs.resize(sorted.total - lambert, Bsdf::Black);
        for i in 0..w.rays.len() {
            let hit = w.hits[i];
            if !hit.is_hit() {
                self.escape(bounce, i, w);
                continue;
            }
            let ray = w.rays[i];
            let mut vertex = self.meet(bounce, i, &ray, &hit, w);
            let group = w.groups[i] as usize;
            if group == Group::None as usize {
                continue;
            }
            let k = next[group];
            next[group] += 1;
            w.arriving.copy_to(i, &mut w.wave.paths, k);
            if group == Group::Lambert as usize {
                let back = if vertex.is_back { -1.0 } else { 1.0 };
                vertex.surface.ng *= back;
                vertex.surface.ns *= back;
                let albedo = vertex.bsdf.albedo();
                let dark = vertex.is_dark;
                set(&mut w.wave.vertices.albedo, k, if dark { Vec3::ZERO } else { albedo });
            } else {
                let n = &mut vertex.surface;
                n.ns = facing(n.ns, n.ng, -ray.direction);
                set(&mut w.wave.vertices.wo, k, -ray.direction);
                w.bsdfs[k - lambert] = if vertex.is_dark { Bsdf::Black } else { vertex.bsdf };
            }
            store(&mut w.wave.vertices, k, &vertex.surface);
        }
        sorted
    }

    /// Finds each hit's material and group; returns the groups' sizes.
    fn classify(&self, is_last: bool, w: &mut Workspace) -> [usize; GROUPS] {
        let mut counts = [0; GROUPS];
        w.groups.clear();
        w.materials.clear();
        for hit in &w.hits {
            let (material, group) = if hit.is_hit() {
                let material = self.scene.geometries.material(hit);
                let group = group_of(&self.scene.materials[material as usize]);
                (material, if is_last { Group::None } else { group })
            } else {
                (0, Group::None)
            };
            counts[group as usize] += 1;
            w.groups.push(group as u8);
            w.materials.push(material);
        }
        counts
    }

    /// The path leaves the scene.
    fn escape(&self, bounce: u32, i: usize, w: &mut Workspace) {
        let Some(environment) = self.scene.lights.environment() else { return };
        let paths = &w.arriving;
        let (radiance, pdf) = environment.radiance_and_pdf(w.rays[i].direction);
        let weight = match paths.pdf[i] {
            scattered if scattered > 0.0 => {
                power_heuristic(scattered, pdf * self.scene.lights.environment_pdf_discrete())
            }
            _ => 1.0,
        };
        let sum = &mut w.radiance[paths.sample[i] as usize];
        add(sum, get(&paths.throughput, i) * radiance * weight);
        if bounce == 0 {
            sum[3] = 1.0;
        }
    }

    /// The path meets a surface: adds its emission and looks up how it scatters.
    fn meet(&self, bounce: u32, i: usize, ray: &Ray, hit: &Hit, w: &mut Workspace) -> Vertex {
        let mut surface = self.scene.geometries.surface(ray, hit);
        let material = &self.scene.materials[w.materials[i] as usize];
        let is_back = surface.ng.dot(ray.direction) > 0.0;
        if is_back && let Some(absorption) = material.absorption {
            let left = transmittance(absorption, hit.t);
            let throughput = get(&w.arriving.throughput, i);
            set(&mut w.arriving.throughput, i, throughput * left);
        }
        let constant = material.constant.filter(|_| !material.uses_uv);
        let bsdf = match constant {
            Some(bsdf) => bsdf,
            None => {
                let (bsdf, ns) = self.textured(material, &surface, hit);
                surface.ns = ns;
                bsdf
            }
        };
        if material.emission.is_some() {
            self.emit(i, material, &surface, hit, is_back, w);
        }
        let is_dark = is_back && !material.is_two_sided;
        if bounce == 0 {
            let sample = w.arriving.sample[i] as usize;
            w.radiance[sample][3] = 1.0;
            if let Some(aov) = w.aovs.get_mut(sample) {
                let flip = if is_back { -1.0 } else { 1.0 };
                *aov = Some(AovSample {
                    depth: self.scene.camera.depth(surface.p),
                    normal: (surface.ns * flip).to_array(),
                    albedo: if is_dark { [0.0; 3] } else { bsdf.albedo().to_array() },
                });
            }
        }
        Vertex { surface, bsdf, is_back, is_dark }
    }

    /// Looks up textures, vertex colours and the normal map.
    fn textured(&self, material: &CompiledMaterial, surface: &Surface, hit: &Hit) -> (Bsdf, Vec3) {
        let Coordinates { uv, color, tangent_frame } = self.scene.geometries.coordinates(surface, hit);
        let slots = self.slots(uv, surface.p);
        let ns = material.shading_normal(&slots, surface, tangent_frame);
        (material.bsdf(&slots, Vec3::from_slice(&color)), ns)
    }

    pub(super) fn slots(&self, uv: [Vec2; 2], world: Vec3) -> TexturedSlots<'_> {
        TexturedSlots { textures: &self.scene.textures, point: TexturePoint { uv, world } }
    }

    /// Adds the light that a surface emits, weighted against sampling the light it is.
    fn emit(
        &self,
        i: usize,
        material: &CompiledMaterial,
        surface: &Surface,
        hit: &Hit,
        is_back: bool,
        w: &mut Workspace,
    ) {
        let Some(emission) = material.emission.filter(|e| e.two_sided || !is_back) else { return };
        let radiance = match emission.radiance.texture {
            None => Vec3::from_array(emission.radiance.factor),
            Some(_) => {
                use crate::bsdf::Slots;
                let uv = self.scene.geometries.coordinates(surface, hit).uv;
                self.slots(uv, surface.p).color(&emission.radiance)
            }
        };
        let paths = &w.arriving;
        let mut weight = 1.0;
        if paths.pdf[i] > 0.0
            && let Some(index) = self.scene.light_at(hit)
        {
            let light = &self.scene.lights.area()[index as usize];
            let pdf = light.pdf_solid_angle(w.rays[i].origin, surface.p);
            weight = power_heuristic(paths.pdf[i], pdf * self.scene.lights.pdf_discrete(index));
        }
        add(&mut w.radiance[paths.sample[i] as usize], get(&paths.throughput, i) * radiance * weight);
    }
}

/// A surface with its BSDF.
struct Vertex {
    surface: Surface,
    bsdf: Bsdf,
    /// The ray came from behind.
    is_back: bool,
    /// The back of a one-sided material: black.
    is_dark: bool,
}

/// The shading normal, bent as far as needed for the viewer to be on the same side of it as of the surface.
#[inline(always)]
fn facing(ns: Vec3, ng: Vec3, wo: Vec3) -> Vec3 {
    const LEAST: f32 = 1e-4;
    let side = if ng.dot(wo) < 0.0 { -1.0 } else { 1.0 };
    let cosine = ns.dot(wo) * side;
    if cosine >= LEAST { ns } else { (ns + wo * (side * (LEAST - cosine))).normalize() }
}

fn store(vertices: &mut Vertices, k: usize, surface: &Surface) {
    set(&mut vertices.p, k, surface.p);
    set(&mut vertices.ng, k, surface.ng);
    set(&mut vertices.ns, k, surface.ns);
    vertices.offset[k] = surface.ng.abs().dot(surface.p_error);
}

/// Adds light to a sample.
#[inline(always)]
pub(super) fn add(sum: &mut [f32; 4], light: Vec3) {
    sum[0] += light.x;
    sum[1] += light.y;
    sum[2] += light.z;
}

impl Paths {
    #[inline(always)]
    pub(super) fn copy_to(&self, i: usize, other: &mut Paths, k: usize) {
        for c in 0..3 {
            other.throughput[c][k] = self.throughput[c][i];
        }
        other.pdf[k] = self.pdf[i];
        other.eta_squared[k] = self.eta_squared[i];
        other.seed[k] = self.seed[i];
        other.shuffled[k] = self.shuffled[i];
        other.sample[k] = self.sample[i];
    }
}
