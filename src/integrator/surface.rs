//! From hits to vertices: sorts hits by shading group, adds emission, evaluates geometry and textures.

use super::Integrator;
use super::first_hit::{AovContext, FirstHit, FirstHits};
use super::interfaces::CoincidentHit;
use super::interior::Interior;
use super::scatter::sample_of_branch;
use super::shading_geometry::{
    BUMP_SHADOWING, EvaluatedMaterial, HitPoint, Mapping, PathOrigin, UNMAPPED, scattering_normal,
};
use super::shading_groups::{
    ShadingGroup, ShadingGroupCounts, SortedVertices, load_material, prepare, store_material,
};
use super::wave::{
    CornerLanes, Lanes3, PathState, TexturedLanes, Vertices, WAVE, get, get_rgb, set, set_rgb,
};
use super::workspace::Workspace;
use crate::bsdf::{Bsdf, LocalFrame, MetalRough};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::{HitReader, SurfaceCoordinates, SurfaceHit, point_reader};
use crate::math::{Frame, Hit, Ray, Vec2, Vec3, select};
use crate::scene::{RayKinds, SkippedCaustics};
use crate::shape::{Surface, shading_normal, triangle_surface};
use crate::simd::{Kernel, dispatch, map_each};
use crate::texture::{CameraData, GraphResults, HitData, PathData, PointReader, TexturePoint};
use std::ops::Range;

/// A surface with its BSDF.
struct Vertex {
    surface: Surface,
    bsdf: Bsdf,
    /// Solids on the far side.
    far_interior: Interior,
    mapping: Mapping,
    /// The ray hit the back side.
    is_back: bool,
    /// Direction to the viewer, unit length.
    wo: Vec3,
}

impl Vertex {
    fn material(&self) -> EvaluatedMaterial {
        EvaluatedMaterial { bsdf: self.bsdf, ns: self.surface.ns, mapping: self.mapping }
    }
}

impl Integrator<'_> {
    /// Builds the vertices of the arriving paths, sorted by shading group, and adds the emission of surfaces.
    pub(super) fn surfaces(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if self.scene.features.graphs {
            self.evaluate_graphs(bounce, w, |w, i, _| w.groups[i] != ShadingGroup::None);
        }
        self.sort(bounce, sorted, w);
        self.make_flat(sorted.flat_lambert(), &mut w.wave.vertices);
        self.make_flat(sorted.flat_metal_rough(), &mut w.wave.vertices);
        self.make_textured(bounce, sorted.textured(), w);
        if self.options.skip_caustics != SkippedCaustics::NONE {
            self.remove_caustic_lobes(sorted, w);
        }
        prepare(&mut w.wave, sorted.metal_rough(), self.scene.shading.fresnel);
    }

    /// Widens the footprints of paths to those at their hits.
    pub(super) fn widen_ray_cones(&self, w: &mut Workspace) {
        let footprints = &mut w.arriving.footprints;
        for (i, hit) in w.hits.iter().enumerate() {
            footprints.width[i] += footprints.spread[i] * hit.t;
        }
    }

    /// Finds the shading group of each hit, and its material if unknown. With `is_last` all paths end.
    pub(super) fn classify_hits(&self, bounce: u32, is_last: bool, w: &mut Workspace) -> ShadingGroupCounts {
        match self.scene.features.alpha || self.scene.features.mixes {
            true => self.classify::<true>(bounce, is_last, w),
            false => self.classify::<false>(bounce, is_last, w),
        }
    }

    /// [`Integrator::classify_hits`] with known or unknown materials.
    fn classify<const KNOWS_MATERIALS: bool>(
        &self,
        bounce: u32,
        is_last: bool,
        w: &mut Workspace,
    ) -> ShadingGroupCounts {
        let mut counts = ShadingGroupCounts::new();
        let (needs_details, follows) = (bounce == 0 && self.first_hits.any(), self.follows_mirrors(bounce));
        let scattering = self.scene.features.scattering;
        w.groups.clear();
        if !KNOWS_MATERIALS {
            w.materials.clear();
        }
        for (i, hit) in w.hits.iter().enumerate() {
            let (mut material, mut group) = (0, ShadingGroup::None);
            if hit.is_hit() {
                material = if KNOWS_MATERIALS { w.materials[i] } else { self.scene.geometries.material(hit) };
                group = match self.groups[material as usize] {
                    _ if is_last => ShadingGroup::None,
                    ShadingGroup::Textured if !self.scene.geometries.is_single_uv_triangle(hit) => {
                        ShadingGroup::MetalRough
                    }
                    group @ (ShadingGroup::FlatLambert | ShadingGroup::FlatMetalRough) => {
                        let has_aovs = needs_details || follows && w.arriving.only_mirrors[i] != 0;
                        let is_flat = !has_aovs && self.scene.geometries.is_flat(hit);
                        if is_flat { group } else { group.of_any_shape() }
                    }
                    group => group,
                };
            } else if scattering && !is_last && w.medium_segments[i].scatters {
                group = ShadingGroup::Medium;
            }
            counts.add(group);
            w.groups.push(group);
            if !KNOWS_MATERIALS {
                w.materials.push(material);
            }
        }
        counts
    }

    /// Copies the arriving paths to the order of shading groups, and builds their vertices or gathers the input of vectorised loops.
    fn sort(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let mut next = sorted.starts();
        let general = sorted.general();
        w.escaped.clear();
        // Only grows: all elements in use are overwritten below.
        if w.bsdfs.len() < general.len() {
            w.bsdfs.resize(general.len(), Bsdf::Black);
        }
        let needs_receiver = self.scene.features.links || self.lifts_shadow_rays();
        for i in 0..w.rays.len() {
            let group = w.groups[i];
            let k = next[group as usize];
            next[group as usize] += 1;
            match group {
                ShadingGroup::None if !w.hits[i].is_hit() => {
                    if !self.ends_in_medium(bounce, i, w) {
                        w.escaped.push(i as u32);
                    }
                    continue;
                }
                ShadingGroup::None => {
                    self.end_at_surface(bounce, i, w);
                    continue;
                }
                ShadingGroup::FlatLambert => self.gather_flat_lambert(i, k, w),
                ShadingGroup::FlatMetalRough => self.gather_flat_metal_rough(i, k, w),
                ShadingGroup::Textured => self.gather_textured(i, k, w),
                ShadingGroup::Lambert => {
                    let vertex = self.vertex(bounce, i, w);
                    set_rgb(&mut w.wave.vertices.albedo, k, vertex.bsdf.albedo());
                    store_opaque(&mut w.wave.vertices, k, vertex);
                }
                ShadingGroup::MetalRough => {
                    let vertex = self.vertex(bounce, i, w);
                    let material = match vertex.bsdf {
                        Bsdf::MetalRough(material) => material,
                        _ => MetalRough::BLACK,
                    };
                    store_material(&mut w.wave.vertices.metal_rough, k, &material);
                    store_opaque(&mut w.wave.vertices, k, vertex);
                }
                ShadingGroup::Medium => self.make_medium_vertex(i, k, w),
                ShadingGroup::Rough | ShadingGroup::Specular => {
                    let vertex = self.vertex(bounce, i, w);
                    let evaluated =
                        self.select_lobe(bounce, i, vertex.material(), [vertex.surface.ng, vertex.wo], w);
                    w.bsdfs[k - general.start] = evaluated.bsdf;
                    store_general(&mut w.wave.vertices, k, &vertex, &evaluated);
                }
            }
            if bounce == 0 {
                w.radiance_buffer.set_opaque(w.arriving.state.radiance_index[i]);
            }
            w.arriving.copy_to(i, &mut w.wave.paths, k, self.optional);
            if needs_receiver {
                self.record_receiver(i, k, w);
            }
            w.wave.vertices.origin_primitives[k] = (&w.hits[i]).into();
        }
    }

    /// Records further data of a vertex for light sampling: receiver class and smooth surface.
    fn record_receiver(&self, i: usize, k: usize, w: &mut Workspace) {
        if self.scene.features.links {
            self.record_receiver_class(i, k, w);
        }
        if self.lifts_shadow_rays() {
            self.record_lift(i, k, w);
        }
    }

    /// Gathers the corners and the albedo of a Lambertian vertex of constant albedo.
    #[inline(always)]
    fn gather_flat_lambert(&self, i: usize, k: usize, w: &mut Workspace) {
        self.gather_corners(i, k, w);
        let material = &self.scene.materials[w.materials[i] as usize];
        set_rgb(&mut w.wave.vertices.albedo, k, material.albedo);
    }

    /// Gathers the corners and the parameters of an opaque glTF material.
    #[inline(always)]
    fn gather_flat_metal_rough(&self, i: usize, k: usize, w: &mut Workspace) {
        self.gather_corners(i, k, w);
        let material = match &self.scene.materials[w.materials[i] as usize].constant {
            Some(Bsdf::MetalRough(material)) => material,
            _ => &MetalRough::BLACK,
        };
        store_material(&mut w.wave.vertices.metal_rough, k, material);
    }

    /// Adds the emission, and AOVs, of a surface where a path ends.
    fn end_at_surface(&self, bounce: u32, i: usize, w: &mut Workspace) {
        let material = &self.scene.materials[w.materials[i] as usize];
        if self.has_aovs(bounce, i, w) || material.medium_index != 0 {
            self.vertex(bounce, i, w);
        } else if material.emission.is_some() {
            let at = self.hit_point(bounce, i, w);
            self.emit(bounce, i, &at, w);
        }
        if bounce == 0 {
            w.radiance_buffer.set_opaque(w.arriving.state.radiance_index[i]);
        }
    }

    /// The hit point of ray `i`.
    pub(super) fn hit_point(&self, bounce: u32, i: usize, w: &Workspace) -> HitPoint<'_> {
        let time = w.time(i);
        let at = self.ray_hit_point(&w.rays[i], w.hits[i], w.materials[i], time);
        HitPoint { path: self.origin_of_hit(bounce, i, w), ..at }
    }

    /// Properties of arriving path `i` that node graphs read; unknown if none reads them.
    pub(super) fn origin_of_hit(&self, bounce: u32, i: usize, w: &Workspace) -> PathOrigin {
        match self.scene.features.paths || self.scene.features.traced_textures {
            true => self.path_origin(bounce, i, &w.arriving),
            false => PathOrigin::UNKNOWN,
        }
    }

    /// The hit point of a ray on a surface with a material.
    pub(super) fn ray_hit_point(&self, ray: &Ray, hit: Hit, material: u32, time: f32) -> HitPoint<'_> {
        let surface = self.scene.geometries.surface(ray, &hit, time);
        let material = &self.scene.materials[material as usize];
        let is_back = surface.ng.dot(ray.direction) > 0.0;
        HitPoint { surface, hit, material, is_back, time, path: PathOrigin::UNKNOWN }
    }

    /// Builds the vertex at the hit of ray `i`: geometry, textures, emission, interfaces of solids, and AOVs.
    fn vertex(&self, bounce: u32, i: usize, w: &mut Workspace) -> Vertex {
        let wo = -w.rays[i].direction;
        let at = self.vertex_point(bounce, i, w);
        let HitPoint { material, is_back, .. } = at;
        let is_solid = material.medium_index != 0;
        if is_solid && is_back {
            let wavelengths = w.times.wavelengths(w.arriving.state.radiance_index[i]);
            self.assume_inside(material, at.hit.t, i, &mut w.arriving, wavelengths);
        }
        let mut evaluated = self.read_vertex_material(i, &at, wo, w);
        if material.is_transparent_to_shadow_rays && w.arriving.state.pdf[i].competes() {
            evaluated.bsdf = self.scatter_at_thin_glass(evaluated.bsdf, i, w);
        }
        let pane = self.reflect_at_pane(material.pane_thickness, i, w);
        let EvaluatedMaterial { bsdf, ns, mapping } = evaluated;
        let (surface, far_interior) = (Surface { ns, ..at.surface }, w.arriving.interior[i]);
        let mut vertex = Vertex { surface, bsdf: pane.unwrap_or(bsdf), far_interior, mapping, is_back, wo };
        if material.emission.is_some() {
            self.emit(bounce, i, &at, w);
        }
        if is_solid && pane.is_none() {
            let wavelengths = w.times.wavelengths(w.arriving.state.radiance_index[i]);
            let boundary = match self.coincident_surfaces(&w.rays[i], &at) {
                None => {
                    self.interface_hit(bsdf, material, is_back, (bounce, i), &mut w.arriving, wavelengths)
                }
                Some(coincident) => {
                    let first = CoincidentHit { at, evaluated, width: w.arriving.footprints.width[i] };
                    let (refracting, boundary) = self.coincident_interface(
                        first,
                        coincident,
                        wo,
                        (bounce, i),
                        &mut w.arriving,
                        wavelengths,
                    );
                    vertex.surface = Surface { ns: refracting.evaluated.ns, ..refracting.at.surface };
                    vertex.mapping = refracting.evaluated.mapping;
                    boundary
                }
            };
            (vertex.bsdf, vertex.far_interior) = (boundary.bsdf, boundary.far_interior);
            if boundary.is_inverted {
                vertex.surface.ng = -vertex.surface.ng;
                vertex.surface.ns = -vertex.surface.ns;
                vertex.mapping = vertex.mapping.on_side(-1.0);
            }
        }
        if self.optional.caustic_chains {
            self.end_chain_if_bent(bounce, i, &vertex.surface, wo, &mut w.arriving.caustic_chains);
        }
        if self.has_aovs(bounce, i, w) {
            self.record_vertex(bounce, i, &at, &vertex, w);
        }
        vertex
    }

    /// Are denoising guides recorded behind mirrors at this bounce?
    fn follows_mirrors(&self, bounce: u32) -> bool {
        self.optional.only_mirrors && bounce > 0
    }

    /// Are AOVs recorded at the vertex of arriving path `i`?
    fn has_aovs(&self, bounce: u32, i: usize, w: &Workspace) -> bool {
        match bounce {
            0 => self.first_hits.any(),
            _ => self.optional.only_mirrors && w.arriving.only_mirrors[i] != 0,
        }
    }

    /// Records the AOVs of the vertex of ray `i`, a camera ray or a ray reflected by mirrors only.
    fn record_vertex(&self, bounce: u32, i: usize, at: &HitPoint<'_>, vertex: &Vertex, w: &mut Workspace) {
        let is_mirror = vertex.bsdf.is_mirror();
        if self.optional.only_mirrors {
            w.arriving.only_mirrors[i] = u32::from(is_mirror);
        }
        if bounce > 0 && is_mirror {
            return;
        }
        let surface = Surface { material: w.materials[i], ..vertex.surface };
        let of_rgb = self.is_spectral().then(|| self.rgb_bsdf(at, vertex.wo));
        let bsdf = of_rgb.as_ref().unwrap_or(&vertex.bsdf);
        let weight = self.aov_weight(bounce, [i, i], &w.arriving.state, w);
        let hit = FirstHit { hit: w.hits[i], time: at.time, surface, wo: vertex.wo, bsdf, weight };
        self.record(bounce, w.arriving.state.radiance_index[i], &hit, &mut w.first_hits);
    }

    /// Records the AOVs of a vertex for the sample of a radiance index.
    fn record(&self, bounce: u32, radiance_index: u32, hit: &FirstHit<'_>, first_hits: &mut FirstHits) {
        match bounce {
            0 => first_hits.record(radiance_index as usize, hit, &self.aov_context()),
            _ => {
                let sample = sample_of_branch(radiance_index, self.options.branches);
                first_hits.record_in_mirror(sample as usize, hit, &self.aov_context());
            }
        }
    }

    /// Factor on the albedo AOVs of a vertex, hit by ray `i` and path `k` of `paths`.
    fn aov_weight(&self, bounce: u32, [i, k]: [usize; 2], paths: &PathState, w: &Workspace) -> Rgb {
        if bounce == 0 {
            let has_weights = self.optional.component_weight;
            return if has_weights { get_rgb(&w.arriving.component_weight, i) } else { Rgb::ONE };
        }
        // Reflectance of the mirrors; `roulette_scale` undoes the division by the number of branches.
        let weight = get_rgb(&paths.throughput, k) * paths.roulette_scale[k];
        let weight =
            if self.is_spectral() { Rgb::ONE * ((weight.r + weight.g + weight.b) / 3.0) } else { weight };
        weight.min(Rgb::ONE)
    }

    pub(super) fn aov_context(&self) -> AovContext<'_> {
        AovContext {
            scene: self.scene,
            view: self.view,
            mattes: self.options.mattes,
            space: self.options.aov_space,
        }
    }

    /// Evaluates the material at a hit point: BSDF and shading normal, with textures, vertex colours and normal maps.
    #[inline(always)]
    pub(super) fn read_material(
        &self,
        at: &HitPoint<'_>,
        width: f32,
        wo: Vec3,
        wavelengths: Option<&Wavelengths>,
    ) -> EvaluatedMaterial {
        match at.material.constant.filter(|_| !at.material.uses_uv) {
            Some(bsdf) => {
                EvaluatedMaterial { bsdf, ns: at.surface.ns, mapping: Mapping::none(at.surface.ns) }
            }
            None => self.textured(at, &self.coordinates(at), (width, wo), (wavelengths, None)),
        }
    }

    /// Inputs of textures at a hit point, for lookups filtered by the ray footprint.
    pub(super) fn coordinates(&self, at: &HitPoint<'_>) -> SurfaceCoordinates {
        self.scene.geometries.coordinates(&at.surface, &at.hit, self.scene.features.footprints, at.time)
    }

    /// [`Integrator::hit_data`] for those graphs of the material whose results are not known; `None` if all are.
    pub(super) fn missing_hit_data(
        &self,
        results: Option<GraphResults<'_>>,
        at: &HitPoint<'_>,
        coordinates: &SurfaceCoordinates,
        wo: Vec3,
    ) -> Option<HitData<'_>> {
        let are_all_known = results.is_some() && at.material.graphs.as_ref().is_some_and(|g| g.is_complete);
        if are_all_known { None } else { self.hit_data(at, coordinates, wo) }
    }

    /// [`Integrator::read_material`] at the hit of ray `i`, where node graphs may have been evaluated already.
    #[inline(always)]
    fn read_vertex_material(
        &self,
        i: usize,
        at: &HitPoint<'_>,
        wo: Vec3,
        w: &Workspace,
    ) -> EvaluatedMaterial {
        let wavelengths = w.wavelengths(i);
        let width = w.arriving.footprints.width[i];
        match w.graphs.at(i) {
            None => self.read_material(at, width, wo, wavelengths),
            Some(evaluated) => {
                let results = w.graphs.results(evaluated, at);
                self.textured(at, &evaluated.coordinates, (width, wo), (wavelengths, results))
            }
        }
    }

    /// Looks up textures, vertex colours and the normal map, given known results of node graphs.
    fn textured(
        &self,
        at: &HitPoint<'_>,
        coordinates: &SurfaceCoordinates,
        (width, wo): (f32, Vec3),
        (wavelengths, results): (Option<&Wavelengths>, Option<GraphResults<'_>>),
    ) -> EvaluatedMaterial {
        let HitPoint { surface, material, .. } = at;
        let hit_data = self.missing_hit_data(results, at, coordinates, wo);
        let slots = self.slots(coordinates, surface, wo, width, hit_data.as_ref()).with_results(results);
        let tangent_frame = coordinates.tangent_frame;
        let (ns, points_inwards) = material.shading_normal(&slots, surface, tangent_frame);
        let frame = if material.uses_frame {
            let scattering = Frame::from_normal(scattering_normal(ns, surface.ng, wo));
            let coat = material.coat_normal(&slots, surface, tangent_frame);
            let coat = scattering_normal(coat, surface.ng, wo);
            material.local_frame(&scattering, tangent_frame, coat)
        } else {
            LocalFrame::DEFAULT
        };
        let vertex_color = Rgb::from_slice(&coordinates.color);
        let bsdf = match wavelengths {
            None => material.bsdf(&slots, &frame, vertex_color),
            Some(wavelengths) => material.bsdf_by_wavelength(&slots, &frame, vertex_color, wavelengths),
        };
        let bsdf = if points_inwards { bsdf.without_base() } else { bsdf };
        let bumps = material.bumped_normal(&slots, surface, ns);
        let mapping = Mapping {
            smooth_normal: bumps.unwrap_or(surface.ns),
            is_mapped: ns != surface.ns,
            has_bumps: bumps.is_some(),
        };
        EvaluatedMaterial { bsdf, ns, mapping }
    }

    /// Reader of textures at a point, for the viewer's direction `wo` and footprint `width`, metres; node graphs read `hit`
    /// ([`Integrator::hit_data`]).
    pub(super) fn slots<'h>(
        &'h self,
        at: &SurfaceCoordinates,
        surface: &Surface,
        wo: Vec3,
        width: f32,
        hit: Option<&'h HitData<'h>>,
    ) -> PointReader<'h> {
        point_reader(&self.scene.textures, at, surface, wo, width, hit)
    }
}

/// Stores a vertex of an opaque shading group, with normals on the viewer's side.
fn store_opaque(v: &mut Vertices, k: usize, vertex: Vertex) {
    let bump_mode = vertex.material().bump_mode();
    let Vertex { mut surface, mapping, is_back, wo, .. } = vertex;
    let side = if is_back { -1.0 } else { 1.0 };
    surface.ng *= side;
    surface.ns *= side;
    store(v, k, &surface);
    store_bump_mode(v, k, bump_mode, mapping.smooth_normal * side);
    set(&mut v.wo, k, wo);
}

/// Stores a vertex with a general BSDF.
fn store_general(v: &mut Vertices, k: usize, vertex: &Vertex, evaluated: &EvaluatedMaterial) {
    store(v, k, &Surface { ns: evaluated.ns, ..vertex.surface });
    store_bump_mode(v, k, evaluated.bump_mode(), evaluated.mapping.smooth_normal);
    set(&mut v.wo, k, vertex.wo);
    v.far_interior[k] = vertex.far_interior;
}

/// Stores the data of the bump terminator.
#[inline(always)]
fn store_bump_mode(v: &mut Vertices, k: usize, bump_mode: f32, smooth: Vec3) {
    v.bump_mode[k] = bump_mode;
    if bump_mode != UNMAPPED {
        set(&mut v.smooth_normal, k, smooth);
    }
}

impl Integrator<'_> {
    /// Gathers the corners of the triangle or quad hit by ray `i`, for vertex `k`.
    #[inline(always)]
    pub(super) fn gather_corners(&self, i: usize, k: usize, w: &mut Workspace) {
        let hit = &w.hits[i];
        let Some(corners) = self.scene.geometries.corners(hit) else { return };
        let v = &mut w.wave.vertices;
        for c in 0..3 {
            set(&mut v.corners.positions[c], k, corners.positions[c].into());
        }
        if self.scene.features.normals {
            for c in 0..3 {
                set(&mut v.corners.normals[c], k, corners.normals[c].into());
            }
        }
        (v.corners.weights[0][k], v.corners.weights[1][k]) = (hit.u, hit.v);
        set(&mut v.wo, k, -w.rays[i].direction);
    }

    /// Computes surfaces from corners, with normals on the front side.
    pub(super) fn make_surfaces(&self, range: Range<usize>, vertices: &mut Vertices) {
        if self.scene.features.normals {
            dispatch(MakeSurfaces::<true> { vertices, range });
        } else {
            dispatch(MakeSurfaces::<false> { vertices, range });
        }
    }

    /// Computes flat vertices: surfaces with normals on the viewer's side.
    pub(super) fn make_flat(&self, range: Range<usize>, vertices: &mut Vertices) {
        self.make_surfaces(range.clone(), vertices);
        dispatch(OrientNormals { vertices, range });
    }
}

#[inline(always)]
pub(super) fn store(v: &mut Vertices, k: usize, surface: &Surface) {
    set(&mut v.p, k, surface.p);
    set(&mut v.ng, k, surface.ng);
    set(&mut v.ns, k, surface.ns);
    v.offset[k] = surface.ng.abs().dot(surface.p_error);
}

/// Positions or normals at the corners of vertex `i`.
#[inline(always)]
pub(super) fn corners(lanes: &[Lanes3; 3], i: usize) -> [[f32; 3]; 3] {
    [get(&lanes[0], i).to_array(), get(&lanes[1], i).to_array(), get(&lanes[2], i).to_array()]
}

/// Computes surfaces from corners, with or without shading normals.
struct MakeSurfaces<'a, const SMOOTH: bool> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl<const SMOOTH: bool> Kernel for MakeSurfaces<'_, SMOOTH> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let CornerLanes { positions, normals, weights: [a, b] } = &v.corners;
            let mut surface = triangle_surface(corners(positions, i), a[i], b[i]);
            if SMOOTH {
                surface.ns = shading_normal(corners(normals, i), a[i], b[i], surface.ng);
            }
            store(v, i, &surface);
        }
    }
}

/// Flips the normals of flat vertices to the viewer's side.
struct OrientNormals<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for OrientNormals<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
            let side = if ng.dot(get(&v.wo, i)) < 0.0 { -1.0 } else { 1.0 };
            set(&mut v.ng, i, ng * side);
            set(&mut v.ns, i, ns * side);
            v.bump_mode[i] = UNMAPPED;
        }
    }
}

impl Integrator<'_> {
    /// Gathers the corners and texture coordinates of the triangle hit by ray `i`, for vertex `k`.
    #[inline(always)]
    pub(super) fn gather_textured(&self, i: usize, k: usize, w: &mut Workspace) {
        self.gather_corners(i, k, w);
        let Some(corners) = self.scene.geometries.texture_corners(&w.hits[i]) else { return };
        let t = &mut w.wave.vertices.textured;
        for c in 0..3 {
            (t.corner_uv[c][0][k], t.corner_uv[c][1][k]) = (corners.uv[c][0], corners.uv[c][1]);
            let [x, y, z, _] = corners.tangents[c];
            set(&mut t.tangents[c], k, Vec3::new(x, y, z));
        }
        let [x, y, z, w] = corners.tangents[0];
        t.handedness[k] = if [x, y, z, w] == [0.0; 4] { 0.0 } else { 1.0f32.copysign(w) };
        t.ray[k] = i as u32;
    }

    /// Computes textured vertices from their corners and textures.
    pub(super) fn make_textured(&self, bounce: u32, range: Range<usize>, w: &mut Workspace) {
        let vertices = &mut w.wave.vertices;
        self.make_surfaces(range.clone(), vertices);
        dispatch(TextureFrames { vertices, range: range.clone() });
        for k in range.clone() {
            self.read_textures(bounce, k, w);
        }
        dispatch(BendNormals { vertices: &mut w.wave.vertices, range: range.clone() });
        if bounce == 0 && self.first_hits.any() || self.follows_mirrors(bounce) {
            for k in range {
                if bounce == 0 || w.wave.paths.only_mirrors[k] != 0 {
                    self.record_textured(bounce, k, w);
                }
            }
        }
    }

    /// Records the AOVs of textured vertex `k`.
    fn record_textured(&self, bounce: u32, k: usize, w: &mut Workspace) {
        let v = &w.wave.vertices;
        let i = v.textured.ray[k] as usize;
        let surface = Surface {
            p: get(&v.p, k),
            p_error: Vec3::ZERO,
            ng: get(&v.ng, k),
            ns: get(&v.ns, k),
            material: w.materials[i],
        };
        let bsdf = Bsdf::MetalRough(load_material(&v.metal_rough, k, self.scene.shading.fresnel));
        // Time 0: moving geometry is in other shading groups.
        let paths = &w.wave.paths.state;
        let weight = self.aov_weight(bounce, [i, k], paths, w);
        let hit = FirstHit { hit: w.hits[i], time: 0.0, surface, wo: get(&v.wo, k), bsdf: &bsdf, weight };
        self.record(bounce, paths.radiance_index[k], &hit, &mut w.first_hits);
        if self.optional.only_mirrors {
            w.wave.paths.only_mirrors[k] = 0;
        }
    }

    /// Looks up the textures of vertex `k`: normal map, material, emission.
    fn read_textures(&self, bounce: u32, k: usize, w: &mut Workspace) {
        let v = &mut w.wave.vertices;
        let i = v.textured.ray[k] as usize;
        let material = &self.scene.materials[w.materials[i] as usize];
        let (p, ng) = (get(&v.p, k), get(&v.ng, k));
        let uv = Vec2::new(v.textured.uv[0][k], v.textured.uv[1][k]);
        let point = TexturePoint {
            uv: [uv, Vec2::ZERO],
            world: p,
            normal: ng,
            // Materials that read it are in other shading groups.
            cosine: 1.0,
            width: w.arriving.footprints.width[i],
            uv_per_metre: [v.textured.uv_per_metre[k], 0.0],
        };
        let reader = PointReader::new(&self.scene.textures, point);
        set(&mut v.textured.mapped, k, material.mapped_tangent_normal(&reader));
        let read = match material.bsdf(&reader, &LocalFrame::DEFAULT, Rgb::ONE) {
            Bsdf::MetalRough(m) => m,
            _ => MetalRough::BLACK,
        };
        store_material(&mut v.metal_rough, k, &read);
        if material.emission.is_some() {
            let is_back = ng.dot(get(&v.wo, k)) < 0.0;
            let surface = Surface { p, p_error: Vec3::ZERO, ng, ns: ng, material: w.materials[i] };
            let hit = w.hits[i];
            let path = PathOrigin::UNKNOWN;
            self.emit(bounce, i, &HitPoint { surface, hit, material, is_back, time: 0.0, path }, w);
        }
    }
}

/// Computes texture coordinates and tangent frames from corners and shading normals.
struct TextureFrames<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for TextureFrames<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let CornerLanes { positions, weights: [second, third], .. } = &v.corners;
            let weights = [1.0 - second[i] - third[i], second[i], third[i]];
            let n = get(&v.ns, i);
            let corners = map_each(corners(positions, i), Vec3::from_array);
            let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
            let t = &mut v.textured;
            let uv = |c: usize| Vec2::new(t.corner_uv[c][0][i], t.corner_uv[c][1][i]);
            let (d1, d2) = (uv(1) - uv(0), uv(2) - uv(0));
            let at = uv(0) * weights[0] + uv(1) * weights[1] + uv(2) * weights[2];
            let determinant = d1.x * d2.y - d1.y * d2.x;
            let per_metre = (determinant.abs() / e1.cross(e2).length()).sqrt();
            // Tangents of the mesh if present, else from the gradient of the texture coordinates; v grows downwards.
            let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
            let by_uv = (e1 * d2.y - e2 * d1.y) * sign;
            let up = (e1 * d2.x - e2 * d1.x) * sign;
            let of_vertices = (0..3).fold(Vec3::ZERO, |sum, c| sum + get(&t.tangents[c], i) * weights[c]);
            let hand_by_uv = if n.cross(by_uv).dot(up) < 0.0 { -1.0 } else { 1.0 };
            let given = flat(of_vertices, n);
            let uses_given = (t.handedness[i] != 0.0) & (given.length_squared() > MIN_SQUARED);
            let tangent = select(uses_given, given, flat(by_uv, n));
            let hand = if uses_given { t.handedness[i] } else { hand_by_uv };
            let length = tangent.length();
            let scale = if length * length > MIN_SQUARED { 1.0 / length } else { 0.0 };
            let tangent = tangent * scale;
            let bitangent = n.cross(tangent) * if hand < 0.0 { -1.0 } else { 1.0 };
            (t.uv[0][i], t.uv[1][i]) = (at.x, at.y);
            t.uv_per_metre[i] = per_metre;
            set(&mut t.tangent, i, tangent);
            set(&mut t.bitangent, i, bitangent);
        }
    }
}

/// Squared length below which tangents count as zero.
const MIN_SQUARED: f32 = 1e-30;

/// The component of a vector perpendicular to a normal.
#[inline(always)]
fn flat(v: Vec3, n: Vec3) -> Vec3 {
    v - n * n.dot(v)
}

/// Applies normal maps and flips normals to the viewer's side.
struct BendNormals<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for BendNormals<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (ns, ng) = (get(&v.ns, i), get(&v.ng, i));
            let TexturedLanes { tangent, bitangent, mapped, .. } = &v.textured;
            let (t, m) = (get(tangent, i), get(mapped, i));
            let bent = t * m.x + get(bitangent, i) * m.y + ns * m.z;
            let length = bent.length();
            // Ignored if the mapped normal points to the other side, or without a tangent frame.
            let is_mapped = (bent.dot(ns) > 0.0) & (length > 0.0) & (t.length_squared() > 0.0);
            let n = select(is_mapped, bent / if length > 0.0 { length } else { 1.0 }, ns);
            let side = if ng.dot(get(&v.wo, i)) < 0.0 { -1.0 } else { 1.0 };
            set(&mut v.ng, i, ng * side);
            set(&mut v.ns, i, n * side);
            set(&mut v.smooth_normal, i, ns * side);
            v.bump_mode[i] = if is_mapped { BUMP_SHADOWING } else { UNMAPPED };
        }
    }
}

// Inputs of node graphs at a hit.

impl Integrator<'_> {
    /// Inputs of a material's node graphs at a hit for viewer direction `wo`; `None` if the material reads none.
    #[inline(always)]
    pub(super) fn hit_data(
        &self,
        at: &HitPoint<'_>,
        coordinates: &SurfaceCoordinates,
        wo: Vec3,
    ) -> Option<HitData<'_>> {
        if at.material.reads_hit { self.read_hit(at, coordinates, wo) } else { None }
    }

    #[inline(never)]
    fn read_hit(&self, at: &HitPoint<'_>, coordinates: &SurfaceCoordinates, wo: Vec3) -> Option<HitData<'_>> {
        let HitPoint { surface, hit, material, is_back, time, path } = at;
        let reader = HitReader {
            geometries: &self.scene.geometries,
            objects: &self.scene.objects,
            camera: CameraData {
                camera_from_world: &self.view.camera_from_world,
                ndc_from_world: self.view.ndc_from_world.as_ref(),
            },
        };
        let surface_hit = SurfaceHit { surface, hit, material, is_back: *is_back, time: *time };
        let mut data = reader.read(surface_hit, coordinates, wo, path_data(path, hit.t));
        if material.traces_rays
            && let Some(data) = &mut data
        {
            data.rays = self.ray_origin(at);
        }
        data
    }
}

/// Path properties as in Cycles' Light Path node, where "glossy ray" includes transmission and "reflection ray" diffuse.
fn path_data(path: &PathOrigin, length: f32) -> PathData {
    let is = |kind: RayKinds| path.kinds.contains(kind) && path.kinds != RayKinds::NONE;
    let (diffuse, glossy, transmission) =
        (is(RayKinds::DIFFUSE), is(RayKinds::GLOSSY), is(RayKinds::TRANSMISSION));
    let shadow = is(RayKinds::SHADOW);
    let kinds = [
        is(RayKinds::CAMERA) && !shadow,
        shadow,
        diffuse && !shadow,
        (glossy || transmission) && !shadow,
        path.is_singular,
        (diffuse || glossy) && !shadow,
        transmission && !shadow,
        is(RayKinds::VOLUME) && !shadow,
    ];
    PathData { kinds: kinds.map(|is| f32::from(u8::from(is))), length, depth: f32::from(path.bounces) }
}
