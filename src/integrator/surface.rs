//! What rays meet: emitted light, and the surfaces that scatter it, sorted by the loop that shades them.

use super::Integrator;
use super::interior::Interior;
use super::metal_rough;
use super::normals::scattering_normal;
use super::wave::{Paths, Vertices, Workspace, get, get_rgb, set, set_rgb};
use crate::bsdf::{Bsdf, BsdfClass, LocalFrame, MetalRough};
use crate::color::Rgb;
use crate::compile::{CompiledMaterial, Surface, SurfaceCoordinates};
use crate::film::AovSample;
use crate::light::Receiver;
use crate::math::{Frame, Hit, Vec3};
use crate::sampling::power_heuristic;
use crate::texture::{PointReader, TexturePoint};

/// Which loop shades a vertex. The order is that of the sorted vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Group {
    /// Lambertian, of constant albedo, on a triangle or quad: a vectorised loop makes the vertex.
    Plain,
    /// Other Lambertian ones.
    Lambert,
    /// Opaque glTF materials with textures on triangles: vectorised loops make the vertices.
    Textured,
    /// Other opaque glTF materials.
    MetalRough,
    /// Others that light sampling may reach.
    Rough,
    /// It can't.
    Specular,
    /// The path ends here.
    None,
}

const GROUPS: usize = 7;

/// How many vertices there are of each group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sorted {
    plain: usize,
    /// Lambertian ones, the first.
    pub lambert: usize,
    /// Those and the textured ones, the next.
    textured: usize,
    /// Those and the other ones of opaque glTF materials, the next.
    pub metal_rough: usize,
    /// All that light sampling may reach, Lambertian ones included.
    pub lit: usize,
    /// All.
    pub total: usize,
}

/// How many hits there are of each group.
struct GroupCounts([usize; GROUPS]);

impl GroupCounts {
    /// Where each group starts.
    fn starts(&self) -> [usize; GROUPS] {
        let mut sum = 0;
        self.0.map(|count| {
            sum += count;
            sum - count
        })
    }
}

pub(super) fn group_of(material: &CompiledMaterial) -> Group {
    match material.class {
        BsdfClass::Black => Group::None,
        BsdfClass::Lambert => {
            let is_plain = material.constant.is_some() && !material.uses_uv && material.emission.is_none();
            if is_plain { Group::Plain } else { Group::Lambert }
        }
        BsdfClass::Dielectric | BsdfClass::ThinDielectric => Group::Specular,
        _ => {
            // What is smooth in air need not be within another solid.
            let stays_smooth = |b: Bsdf| material.medium_index == 0 || b.with_ior(2.0).is_specular();
            let is_specular = material.constant.is_some_and(|b| b.is_specular() && stays_smooth(b));
            match material.class {
                _ if is_specular => Group::Specular,
                BsdfClass::MetalRough if material.uses_uv && !material.uses_vertex_colors => Group::Textured,
                BsdfClass::MetalRough => Group::MetalRough,
                _ => Group::Rough,
            }
        }
    }
}

impl Integrator<'_> {
    /// Adds what the arriving paths see to their radiance and sorts the surfaces where they go on. With `is_last` none
    /// goes on.
    pub(super) fn surfaces(&self, bounce: u32, is_last: bool, w: &mut Workspace) -> Sorted {
        if self.scene.features.footprints {
            let Workspace { arriving: paths, hits, .. } = &mut *w;
            for (i, hit) in hits.iter().enumerate() {
                paths.cone_width[i] += paths.cone_spread[i] * hit.t;
            }
        }
        if self.scene.features.absorption {
            self.absorb(w);
        }
        let mut next = self.classify(bounce, is_last, w).starts();
        let [_, plain, lambert, textured, metal_rough, lit, total] = next;
        let sorted = Sorted { plain, lambert, textured, metal_rough, lit, total };
        w.escaped.clear();
        // Each that is used is written below.
        if w.bsdfs.len() < total - metal_rough {
            w.bsdfs.resize(total - metal_rough, Bsdf::Black);
        }
        for i in 0..w.rays.len() {
            let group = w.groups[i];
            let k = next[group as usize];
            next[group as usize] += 1;
            if group != Group::None {
                w.wave.vertices.departures[k] = (&w.hits[i]).into();
            }
            match group {
                Group::None if !w.hits[i].is_hit() => w.escaped.push(i as u32),
                Group::None => self.end_at(bounce, i, w),
                Group::Plain => self.gather(bounce, i, k, w),
                Group::Textured => self.gather_textured(bounce, i, k, w),
                Group::Lambert => {
                    let vertex = self.meet(bounce, i, w);
                    w.arriving.copy_to(i, &mut w.wave.paths, k);
                    store_lambert(&mut w.wave.vertices, k, vertex);
                }
                Group::MetalRough => {
                    let vertex = self.meet(bounce, i, w);
                    w.arriving.copy_to(i, &mut w.wave.paths, k);
                    store_metal_rough(&mut w.wave.vertices, k, vertex, -w.rays[i].direction);
                }
                Group::Rough | Group::Specular => {
                    let vertex = self.meet(bounce, i, w);
                    w.arriving.copy_to(i, &mut w.wave.paths, k);
                    w.bsdfs[k - metal_rough] = if vertex.is_dark { Bsdf::Black } else { vertex.bsdf };
                    w.wave.vertices.beyond[k] = vertex.beyond;
                    store_generic(&mut w.wave.vertices, k, vertex, -w.rays[i].direction);
                }
            }
        }
        self.escape(bounce, w);
        self.look_at_textured(bounce, sorted.lambert..sorted.textured, w);
        metal_rough::see(&mut w.wave, sorted.lambert..sorted.metal_rough, self.scene.shading);
        self.make_plain(sorted.plain, &mut w.wave);
        sorted
    }

    /// Finds each hit's material and group.
    fn classify(&self, bounce: u32, is_last: bool, w: &mut Workspace) -> GroupCounts {
        let mut counts = [0; GROUPS];
        let needs_details = bounce == 0 && self.options.aovs;
        w.groups.clear();
        w.materials.clear();
        for hit in &w.hits {
            let (mut material, mut group) = (0, Group::None);
            if hit.is_hit() {
                material = self.scene.geometries.material(hit);
                group = match self.groups[material as usize] {
                    _ if is_last => Group::None,
                    Group::Textured if !self.scene.geometries.is_plainly_textured(hit) => Group::MetalRough,
                    Group::Plain if needs_details || !self.scene.geometries.is_flat(hit) => Group::Lambert,
                    group => group,
                };
            }
            counts[group as usize] += 1;
            w.groups.push(group);
            w.materials.push(material);
        }
        GroupCounts(counts)
    }

    /// The path ends at a surface: adds its emission.
    fn end_at(&self, bounce: u32, i: usize, w: &mut Workspace) {
        let material = &self.scene.materials[w.materials[i] as usize];
        if bounce == 0 && self.options.aovs || material.medium_index != 0 {
            self.meet(bounce, i, w);
            return;
        }
        if material.emission.is_some() {
            let (ray, hit) = (w.rays[i], w.hits[i]);
            let surface = self.scene.geometries.surface(&ray, &hit);
            let is_back = surface.ng.dot(ray.direction) > 0.0;
            self.emit(i, material, &surface, &hit, is_back, w);
        }
        if bounce == 0 {
            w.radiance[w.arriving.sample[i] as usize][3] = 1.0;
        }
    }

    /// The path meets a surface: adds its emission and looks up how it scatters.
    fn meet(&self, bounce: u32, i: usize, w: &mut Workspace) -> Vertex {
        let (ray, hit) = (&{ w.rays[i] }, &{ w.hits[i] });
        let mut surface = self.scene.geometries.surface(ray, hit);
        let material = &self.scene.materials[w.materials[i] as usize];
        let is_back = surface.ng.dot(ray.direction) > 0.0;
        if material.medium_index != 0 && is_back {
            self.enter_unnoticed(material, hit.t, i, &mut w.arriving);
        }
        let constant = material.constant.filter(|_| !material.uses_uv);
        let mut bsdf = match constant {
            Some(bsdf) => bsdf,
            None => {
                let width = w.arriving.cone_width[i];
                let (bsdf, ns) = self.textured(material, &surface, hit, width, -ray.direction);
                surface.ns = ns;
                bsdf
            }
        };
        if material.emission.is_some() {
            self.emit(i, material, &surface, hit, is_back, w);
        }
        let mut beyond = w.arriving.interior[i];
        if material.medium_index != 0 {
            let boundary = self.boundary(bsdf, material, is_back, bounce, i, &mut w.arriving);
            (bsdf, beyond) = (boundary.bsdf, boundary.beyond);
            if boundary.is_inverted {
                (surface.ng, surface.ns) = (-surface.ng, -surface.ns);
            }
        }
        let is_dark = is_back && !material.is_two_sided;
        if bounce == 0 {
            let sample = w.arriving.sample[i] as usize;
            w.radiance[sample][3] = 1.0;
            if let Some(aov) = w.aovs.get_mut(sample) {
                let flip = if surface.ng.dot(ray.direction) > 0.0 { -1.0 } else { 1.0 };
                *aov = Some(AovSample {
                    depth: self.scene.camera.depth(surface.p),
                    normal: (surface.ns * flip).to_array(),
                    albedo: if is_dark { [0.0; 3] } else { bsdf.albedo().to_array() },
                });
            }
        }
        Vertex { surface, bsdf, beyond, is_back, is_dark }
    }

    /// Looks up textures, vertex colours and the normal map.
    fn textured(
        &self,
        material: &CompiledMaterial,
        surface: &Surface,
        hit: &Hit,
        width: f32,
        wo: Vec3,
    ) -> (Bsdf, Vec3) {
        let at = self.scene.geometries.coordinates(surface, hit, self.scene.features.footprints);
        let slots = self.slots(&at, surface, width);
        let ns = material.shading_normal(&slots, surface, at.tangent_frame);
        let frame = if material.uses_frame {
            let scattering = Frame::from_normal(scattering_normal(ns, surface.ng, wo));
            let coat = material.coat_normal(&slots, surface, at.tangent_frame);
            let coat = scattering_normal(coat, surface.ng, wo);
            material.local_frame(&scattering, at.tangent_frame, coat)
        } else {
            LocalFrame::STRAIGHT
        };
        (material.bsdf(&slots, &frame, Rgb::from_slice(&at.color)), ns)
    }

    /// Texture lookups at a point that a path sees in a certain width.
    pub(super) fn slots(&self, at: &SurfaceCoordinates, surface: &Surface, width: f32) -> PointReader<'_> {
        let (world, normal) = (surface.p, surface.ng);
        let point = TexturePoint { uv: at.uv, world, normal, width, uv_per_metre: at.uv_per_metre };
        PointReader::new(&self.scene.textures, point)
    }

    /// Adds the light that a surface emits, weighted against sampling the light it is.
    pub(super) fn emit(
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
            None => Rgb::from_array(emission.radiance.factor),
            Some(_) => {
                use crate::bsdf::Slots;
                // A point: light sampling, which this is weighted against, sees points too.
                let at = self.scene.geometries.coordinates(surface, hit, false);
                self.slots(&at, surface, 0.0).color(&emission.radiance)
            }
        };
        let paths = &w.arriving;
        let mut weight = 1.0;
        if paths.pdf[i] > 0.0
            && let Some(index) = self.scene.light_at(hit)
        {
            let light = &self.scene.lights.area()[index as usize];
            let p = w.rays[i].origin;
            let receiver = Receiver { p, normal: get(&paths.receiver_normal, i) };
            let pdf_discrete = self.scene.lights.pdf_discrete(&receiver, index);
            weight = power_heuristic(paths.pdf[i], light.pdf_solid_angle(p, surface.p) * pdf_discrete);
        }
        add(&mut w.radiance[paths.sample[i] as usize], get_rgb(&paths.throughput, i) * radiance * weight);
    }
}

/// A surface with its BSDF.
struct Vertex {
    surface: Surface,
    bsdf: Bsdf,
    /// Solids on its other side.
    beyond: Interior,
    /// The ray came from behind.
    is_back: bool,
    /// The back of a one-sided material: black.
    is_dark: bool,
}

#[inline(always)]
pub(super) fn store(v: &mut Vertices, k: usize, surface: &Surface) {
    set(&mut v.p, k, surface.p);
    set(&mut v.ng, k, surface.ng);
    set(&mut v.ns, k, surface.ns);
    v.offset[k] = surface.ng.abs().dot(surface.p_error);
}

fn store_lambert(v: &mut Vertices, k: usize, vertex: Vertex) {
    let Vertex { mut surface, bsdf, is_back, is_dark, .. } = vertex;
    let side = if is_back { -1.0 } else { 1.0 };
    surface.ng *= side;
    surface.ns *= side;
    store(v, k, &surface);
    set_rgb(&mut v.albedo, k, if is_dark { Rgb::ZERO } else { bsdf.albedo() });
}

fn store_metal_rough(v: &mut Vertices, k: usize, vertex: Vertex, wo: Vec3) {
    let Vertex { mut surface, bsdf, is_back, is_dark, .. } = vertex;
    let side = if is_back { -1.0 } else { 1.0 };
    surface.ng *= side;
    surface.ns *= side;
    store(v, k, &surface);
    set(&mut v.wo, k, wo);
    match bsdf {
        Bsdf::MetalRough(material) if !is_dark => metal_rough::store(&mut v.metal_rough, k, &material),
        _ => metal_rough::store(&mut v.metal_rough, k, &MetalRough::BLACK),
    }
}

fn store_generic(v: &mut Vertices, k: usize, vertex: Vertex, wo: Vec3) {
    let mut surface = vertex.surface;
    surface.ns = scattering_normal(surface.ns, surface.ng, wo);
    store(v, k, &surface);
    set(&mut v.wo, k, wo);
}

/// Adds light to a sample.
#[inline(always)]
pub(super) fn add(sum: &mut [f32; 4], light: Rgb) {
    sum[0] += light.r;
    sum[1] += light.g;
    sum[2] += light.b;
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
        other.cone_width[k] = self.cone_width[i];
        other.cone_spread[k] = self.cone_spread[i];
        other.interior[k] = self.interior[i];
    }
}
