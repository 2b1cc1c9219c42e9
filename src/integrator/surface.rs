//! From hits to vertices: sorts the surfaces that paths hit by the loops that shade them, adds what they emit, and makes
//! the vertices of each group.

use super::Integrator;
use super::closure_metal_rough::{self, store_material};
use super::first_hit::{FirstHit, Shown};
use super::flat::store;
use super::group::{Group, GroupCounts, Sorted};
use super::hit_point::HitPoint;
use super::interior::Interior;
use super::lanes::{set, set_rgb};
use super::normals::scattering_normal;
use super::touching::Met;
use super::wave::Vertices;
use super::workspace::Workspace;
use crate::bsdf::{Bsdf, BsdfClass, LocalFrame, MetalRough};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::SurfaceCoordinates;
use crate::math::{Frame, Hit, Ray, Vec3};
use crate::shape::Surface;
use crate::texture::{PointReader, TexturePoint};

/// A surface with its BSDF.
struct Vertex {
    surface: Surface,
    bsdf: Bsdf,
    /// Solids on its other side.
    beyond: Interior,
    /// The ray came from behind.
    is_back: bool,
    /// Towards the viewer.
    wo: Vec3,
}

impl Integrator<'_> {
    /// Adds what the arriving paths hit to their radiance and makes sorted vertices of the surfaces where they go on.
    /// With `is_last` none goes on.
    pub(super) fn surfaces(&self, bounce: u32, is_last: bool, w: &mut Workspace) -> Sorted {
        if self.scene.features.scattering {
            self.end_flights(bounce, w);
        }
        if self.scene.features.footprints {
            let footprints = &mut w.arriving.footprints;
            for (i, hit) in w.hits.iter().enumerate() {
                footprints.width[i] += footprints.spread[i] * hit.t;
            }
        }
        if self.scene.features.absorption && !self.scene.features.scattering {
            self.absorb(w);
        }
        let counts = match self.scene.features.alpha {
            true => self.classify::<true>(bounce, is_last, w),
            false => self.classify::<false>(bounce, is_last, w),
        };
        self.follow_chains(bounce, w);
        let counts = if self.parts.depths { self.end_deep_paths(w) } else { counts };
        let sorted = counts.sorted();
        self.sort(bounce, &sorted, w);
        if self.parts.depths {
            self.count_bounces(&sorted, w);
        }
        self.escape(bounce, w);
        self.make_plain(sorted.plain(), &mut w.wave.vertices);
        self.make_plain(sorted.plain_metal_rough(), &mut w.wave.vertices);
        self.make_textured(bounce, sorted.textured(), w);
        closure_metal_rough::prepare(&mut w.wave, sorted.metal_rough(), self.scene.shading);
        self.end_bent_chains(bounce, &sorted, w);
        sorted
    }

    /// Finds each hit's material, where it is not known yet, and its group.
    fn classify<const KNOWS_MATERIALS: bool>(
        &self,
        bounce: u32,
        is_last: bool,
        w: &mut Workspace,
    ) -> GroupCounts {
        let mut counts = GroupCounts::new();
        let needs_details = bounce == 0 && self.first_hits.any();
        let scattering = self.scene.features.scattering;
        w.groups.clear();
        if !KNOWS_MATERIALS {
            w.materials.clear();
        }
        for (i, hit) in w.hits.iter().enumerate() {
            let (mut material, mut group) = (0, Group::None);
            if hit.is_hit() {
                material = if KNOWS_MATERIALS { w.materials[i] } else { self.scene.geometries.material(hit) };
                group = match self.groups[material as usize] {
                    _ if is_last => Group::None,
                    Group::Textured if !self.scene.geometries.is_plainly_textured(hit) => Group::MetalRough,
                    group @ (Group::Plain | Group::PlainMetalRough) => {
                        let is_plain = !needs_details && self.scene.geometries.is_flat(hit);
                        if is_plain { group } else { group.of_any_shape() }
                    }
                    group => group,
                };
            } else if scattering && !is_last && w.flights[i].scatters {
                group = Group::Medium;
            }
            counts.add(group);
            w.groups.push(group);
            if !KNOWS_MATERIALS {
                w.materials.push(material);
            }
        }
        counts
    }

    /// Moves the arriving paths to their places in the order of groups, with their vertices or what those are made of.
    fn sort(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let mut next = sorted.starts();
        let general = sorted.general();
        w.escaped.clear();
        // Each that is used is written below.
        if w.bsdfs.len() < general.len() {
            w.bsdfs.resize(general.len(), Bsdf::Black);
        }
        let links = self.scene.features.links;
        for i in 0..w.rays.len() {
            let group = w.groups[i];
            let k = next[group as usize];
            next[group as usize] += 1;
            match group {
                Group::None if !w.hits[i].is_hit() => {
                    if !self.ends_in_medium(bounce, i, w) {
                        w.escaped.push(i as u32);
                    }
                    continue;
                }
                Group::None => {
                    self.end_at(bounce, i, w);
                    continue;
                }
                Group::Plain => self.gather_plain(i, k, w),
                Group::PlainMetalRough => self.gather_plain_metal_rough(i, k, w),
                Group::Textured => self.gather_textured(i, k, w),
                Group::Lambert => {
                    let vertex = self.vertex(bounce, i, w);
                    set_rgb(&mut w.wave.vertices.albedo, k, vertex.bsdf.albedo());
                    store_opaque(&mut w.wave.vertices, k, vertex);
                }
                Group::MetalRough => {
                    let vertex = self.vertex(bounce, i, w);
                    let material = match vertex.bsdf {
                        Bsdf::MetalRough(material) => material,
                        _ => MetalRough::BLACK,
                    };
                    store_material(&mut w.wave.vertices.metal_rough, k, &material);
                    store_opaque(&mut w.wave.vertices, k, vertex);
                }
                Group::Medium => self.place_in_medium(i, k, w),
                Group::Rough | Group::Specular => {
                    let vertex = self.vertex(bounce, i, w);
                    w.bsdfs[k - general.start] = vertex.bsdf;
                    store_general(&mut w.wave.vertices, k, vertex);
                }
            }
            if bounce == 0 {
                w.sink.cover(w.arriving.carried.sample[i]);
            }
            w.arriving.copy_to(i, &mut w.wave.paths, k, self.parts);
            if links {
                self.keep_class(i, k, w);
            }
            w.wave.vertices.origin_primitives[k] = (&w.hits[i]).into();
        }
    }

    /// Collects what a Lambertian vertex of constant albedo is made of.
    #[inline(always)]
    fn gather_plain(&self, i: usize, k: usize, w: &mut Workspace) {
        self.gather_corners(i, k, w);
        let material = &self.scene.materials[w.materials[i] as usize];
        set_rgb(&mut w.wave.vertices.albedo, k, material.albedo);
    }

    /// The same for an opaque glTF material.
    #[inline(always)]
    fn gather_plain_metal_rough(&self, i: usize, k: usize, w: &mut Workspace) {
        self.gather_corners(i, k, w);
        let material = match &self.scene.materials[w.materials[i] as usize].constant {
            Some(Bsdf::MetalRough(material)) => material,
            _ => &MetalRough::BLACK,
        };
        store_material(&mut w.wave.vertices.metal_rough, k, material);
    }

    /// The path ends at a surface: adds its emission.
    fn end_at(&self, bounce: u32, i: usize, w: &mut Workspace) {
        let material = &self.scene.materials[w.materials[i] as usize];
        if bounce == 0 && self.first_hits.any() || material.medium_index != 0 {
            self.vertex(bounce, i, w);
        } else if material.emission.is_some() {
            let at = self.hit_point(i, w);
            self.emit(bounce, i, &at, w);
        }
        if bounce == 0 {
            w.sink.cover(w.arriving.carried.sample[i]);
        }
    }

    /// The surface where ray `i` hit.
    fn hit_point(&self, i: usize, w: &Workspace) -> HitPoint<'_> {
        let time = w.times.of(w.arriving.carried.sample[i]);
        self.point_of(&w.rays[i], w.hits[i], w.materials[i], time)
    }

    /// The surface where a ray hit a material.
    pub(super) fn point_of(&self, ray: &Ray, hit: Hit, material: u32, time: f32) -> HitPoint<'_> {
        let surface = self.scene.geometries.surface(ray, &hit, time);
        let material = &self.scene.materials[material as usize];
        let is_back = surface.ng.dot(ray.direction) > 0.0;
        HitPoint { surface, hit, material, is_back, time }
    }

    /// Makes the vertex where ray `i` hit, whatever its class: geometry, textures, emission, the boundary of solids, and
    /// what outputs show of a first hit.
    fn vertex(&self, bounce: u32, i: usize, w: &mut Workspace) -> Vertex {
        let wo = -w.rays[i].direction;
        let mut at = self.hit_point(i, w);
        let (material, is_back) = (at.material, at.is_back);
        if material.class == BsdfClass::Hair {
            // It scatters to all sides of the fibre, whatever pieces that consists of.
            at.surface.ng = at.surface.ns;
        }
        let is_solid = material.medium_index != 0;
        if is_solid && is_back {
            let waves = w.times.waves(w.arriving.carried.sample[i]);
            self.assume_inside(material, at.hit.t, i, &mut w.arriving, waves);
        }
        let waves = w.times.waves(w.arriving.carried.sample[i]);
        let (mut bsdf, ns) = self.read_material(&at, w.arriving.footprints.width[i], wo, waves);
        if material.passes_straight && w.arriving.carried.pdf[i] > 0.0 {
            bsdf = self.stop_at_sheet(bsdf, i, w);
        }
        let mut vertex = Vertex {
            surface: Surface { ns, ..at.surface },
            bsdf,
            beyond: w.arriving.interior[i],
            is_back,
            wo,
        };
        if material.emission.is_some() {
            self.emit(bounce, i, &at, w);
        }
        if is_solid {
            let waves = w.times.waves(w.arriving.carried.sample[i]);
            let boundary = match self.touching(&w.rays[i], &at) {
                None => self.boundary(bsdf, material, is_back, (bounce, i), &mut w.arriving, waves),
                Some(touching) => {
                    let met = Met { at, bsdf, ns, width: w.arriving.footprints.width[i] };
                    let (met, boundary) =
                        self.boundary_of_touching(met, touching, wo, (bounce, i), &mut w.arriving, waves);
                    vertex.surface = Surface { ns: met.ns, ..met.at.surface };
                    boundary
                }
            };
            (vertex.bsdf, vertex.beyond) = (boundary.bsdf, boundary.beyond);
            if boundary.is_inverted {
                vertex.surface.ng = -vertex.surface.ng;
                vertex.surface.ns = -vertex.surface.ns;
            }
        }
        if self.parts.chains {
            self.end_chain_if_bent(bounce, i, &vertex.surface, wo, &mut w.arriving.chains);
        }
        if bounce == 0 && self.first_hits.any() {
            let surface = Surface { material: w.materials[i], ..vertex.surface };
            let of_rgb = self.is_spectral().then(|| self.shown_bsdf(&at, wo));
            let bsdf = of_rgb.as_ref().unwrap_or(&vertex.bsdf);
            let hit = FirstHit { hit: w.hits[i], time: at.time, surface, wo, bsdf };
            w.first_hits.record(w.arriving.carried.sample[i] as usize, &hit, &self.shown());
        }
        vertex
    }

    /// What first surfaces are part of.
    pub(super) fn shown(&self) -> Shown<'_> {
        Shown {
            scene: self.scene,
            view: self.view,
            mattes: self.options.mattes,
            space: self.options.aov_space,
        }
    }

    /// The BSDF and the shading normal at a point, from textures, vertex colours and normal maps where there are some.
    #[inline(always)]
    pub(super) fn read_material(
        &self,
        at: &HitPoint<'_>,
        width: f32,
        wo: Vec3,
        waves: Option<&Wavelengths>,
    ) -> (Bsdf, Vec3) {
        match at.material.constant.filter(|_| !at.material.uses_uv) {
            Some(bsdf) => (bsdf, at.surface.ns),
            None => self.textured(at, width, wo, waves),
        }
    }

    /// Looks up textures, vertex colours and the normal map.
    fn textured(&self, at: &HitPoint<'_>, width: f32, wo: Vec3, waves: Option<&Wavelengths>) -> (Bsdf, Vec3) {
        let HitPoint { surface, hit, material, time, .. } = at;
        let at = self.scene.geometries.coordinates(surface, hit, self.scene.features.footprints, *time);
        let slots = self.slots(&at, surface, wo, width);
        let ns = material.shading_normal(&slots, surface, at.tangent_frame);
        let frame = if material.uses_frame {
            let scattering = Frame::from_normal(scattering_normal(ns, surface.ng, wo));
            let coat = material.coat_normal(&slots, surface, at.tangent_frame);
            let coat = scattering_normal(coat, surface.ng, wo);
            material.local_frame(&scattering, at.tangent_frame, coat)
        } else {
            LocalFrame::STRAIGHT
        };
        let vertex_color = Rgb::from_slice(&at.color);
        let bsdf = match waves {
            None => material.bsdf(&slots, &frame, vertex_color),
            Some(waves) => material.bsdf_by_wavelength(&slots, &frame, vertex_color, waves),
        };
        (bsdf, ns)
    }

    /// Texture lookups at a point that a path covers in a certain width and sees from `wo`.
    pub(super) fn slots(
        &self,
        at: &SurfaceCoordinates,
        surface: &Surface,
        wo: Vec3,
        width: f32,
    ) -> PointReader<'_> {
        let (world, normal) = (surface.p, surface.ng);
        let cosine = surface.ns.dot(wo).abs();
        let point = TexturePoint { uv: at.uv, world, normal, cosine, width, uv_per_metre: at.uv_per_metre };
        PointReader::new(&self.scene.textures, point)
    }
}

/// Keeps a vertex of an opaque class: its normals are turned to the viewer.
fn store_opaque(v: &mut Vertices, k: usize, vertex: Vertex) {
    let Vertex { mut surface, is_back, wo, .. } = vertex;
    let side = if is_back { -1.0 } else { 1.0 };
    surface.ng *= side;
    surface.ns *= side;
    store(v, k, &surface);
    set(&mut v.wo, k, wo);
}

/// Keeps a vertex without a vectorised class.
fn store_general(v: &mut Vertices, k: usize, vertex: Vertex) {
    let Vertex { mut surface, beyond, wo, .. } = vertex;
    surface.ns = scattering_normal(surface.ns, surface.ng, wo);
    store(v, k, &surface);
    set(&mut v.wo, k, wo);
    v.beyond[k] = beyond;
}
