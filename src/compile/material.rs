//! Compiled materials: constant textures are folded into factors, constant BSDFs evaluated once, others are programs to be
//! evaluated at each hit.

use super::medium::{Medium, is_transmissive_interface};
use crate::bsdf::{Bsdf, BsdfClass, BsdfProgram, Factors, LocalFrame, ShadingModel, Slots};
use crate::color::Rgb;
use crate::color::spectral::{Spectrum, Wavelengths, uplift_reflectance};
use crate::light::Beam;
use crate::math::{Frame, Mat3, Vec3};
use crate::scene::{
    AlphaMode, ColorSlot, EmitterTraits, FloatSlot, LightLinks, Material, MixComponent, Model, NormalMap,
    ObjectSets, ObjectTraits, ParameterMut, Parameters, PbrMaterial, RayKinds, TextureId, Transmission,
};
use crate::shape::Surface;
use crate::texture::{CompiledTextures, JointGraphs, PointReader};
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct CompiledMaterial {
    /// The class of its BSDF: the key of shading groups.
    pub class: BsdfClass,
    /// The BSDF, if constant over the surface.
    pub constant: Option<Bsdf>,
    /// In spectral rendering: the BSDF with RGB colours, if constant over the surface.
    pub constant_rgb: Option<Bsdf>,
    /// The albedo of `constant`; black without.
    pub albedo: Rgb,
    /// Emission, if any.
    pub emission: Option<CompiledEmission>,
    /// In spectral rendering: the spectrum of the emission, if uniform and not white.
    pub light_spectrum: Option<Arc<Spectrum>>,
    /// Single-sided: rays pass from behind.
    pub is_single_sided: bool,
    /// A smooth thin sheet that transmits without refraction: shadow rays pass it. Not if emissive, as shadow rays would miss
    /// the emission.
    pub is_transparent_to_shadow_rays: bool,
    /// Maximum distance, metres, of two flat parallel faces that form a pane, which shadow rays pass; 0 for no panes.
    pub pane_thickness: f32,
    /// Index-matched interface: it only bounds a medium.
    pub is_boundary: bool,
    /// Rays that pass the surface unscattered enter or leave its medium.
    pub bounds_medium: bool,
    /// The medium inside its solids; `None` for opaque and thin-walled materials.
    pub medium: Option<Medium>,
    /// Index of that medium in [`super::CompiledScene::media`]; 0 for none.
    pub medium_index: u16,
    pub normal_map: Option<NormalMap>,
    /// A node graph for the shading normal.
    pub normal: Option<TextureId>,
    /// A node graph for the normal with only the bump mapping of a displacement.
    bumped_normal: Option<TextureId>,
    /// Alpha; `None` for opaque surfaces.
    pub alpha: Option<Alpha>,
    /// Ray visibility, holdout and shadow catcher; `None` for ordinary surfaces.
    pub surface_visibility: Option<SurfaceVisibility>,
    /// Vertex colours multiply the base colour.
    pub uses_vertex_colors: bool,
    /// BSDF parameters depend on the view direction: the BSDF can't be reused for other viewers, nor for light tracing.
    pub depends_on_viewer: bool,
    /// Emission depends on the view direction or on data of a hit that light samples lack: no light sampling.
    pub emission_depends_on_viewer: bool,
    /// A texture reads [`HitData`](crate::texture::HitData).
    pub reads_hit: bool,
    /// Material index in node graphs.
    pub index: f32,
    /// A node graph reads tangents.
    reads_tangents: bool,
    /// A texture depends on the incident path.
    pub reads_path: bool,
    /// A texture traces rays into the scene.
    pub traces_rays: bool,
    /// Texture coordinates are used.
    pub uses_uv: bool,
    /// The BSDF depends on tangents or on a second normal.
    pub uses_frame: bool,
    coat_normal_map: Option<NormalMap>,
    /// The node graphs of the BSDF and its normals; of a mix those of the weights of its components.
    pub graphs: Option<JointGraphs>,
    /// Components of a mix; empty for other materials.
    pub components: Vec<CompiledComponent>,
    /// A component of a mix. Light paths end at mixes, as they don't select a component.
    pub is_component: bool,
    pub(super) program: BsdfProgram,
}

/// A component of a mix; each hit selects one.
#[derive(Clone, Debug)]
pub struct CompiledComponent {
    /// Factor on the BSDF.
    pub weight: ColorSlot,
    /// Estimated reflectance (luminance, 0..1), a factor on the selection probability.
    pub reflectance: f32,
    /// Index among the compiled materials.
    pub index: u32,
    /// The material until it is added to the compiled materials.
    material: Option<Box<CompiledMaterial>>,
}

/// Emitted radiance.
#[derive(Clone, Copy, Debug)]
pub struct CompiledEmission {
    /// Radiance, with constant textures folded.
    pub radiance: ColorSlot,
    /// The back emits too.
    pub two_sided: bool,
    /// Directional distribution.
    pub beam: Beam,
}

/// Which rays intersect a surface; see [`EmitterTraits`](crate::scene::EmitterTraits) and [`ObjectTraits`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceVisibility {
    /// Rays of other kinds pass.
    pub visible_to: RayKinds,
    /// Rays end at the surface; otherwise they add its emission and continue.
    pub is_obstacle: bool,
    /// Holdout: camera rays end at the surface, black and with alpha 0.
    pub is_holdout: bool,
    /// Shadow catcher.
    pub is_catcher: bool,
    /// Sets of the object, for light linking.
    pub sets: ObjectSets,
    /// Light linking of its emission.
    pub links: LightLinks,
}

impl SurfaceVisibility {
    /// Ray visibility of an emitter's surface.
    fn of_emitter(emitter_traits: &EmitterTraits, has_alpha: bool) -> SurfaceVisibility {
        let is_obstacle = emitter_traits.is_obstacle || has_alpha;
        SurfaceVisibility { visible_to: emitter_traits.visible_to, is_obstacle, ..SurfaceVisibility::FULL }
    }

    /// A surface that is present for all rays.
    const FULL: SurfaceVisibility = SurfaceVisibility {
        visible_to: RayKinds::ALL,
        is_obstacle: true,
        is_holdout: false,
        is_catcher: false,
        sets: ObjectSets::NONE,
        links: LightLinks::ALL,
    };
}

impl Slots for PointReader<'_> {
    #[inline]
    fn color(&self, slot: &ColorSlot) -> Rgb {
        let factor = Rgb::from_array(slot.factor);
        match slot.texture {
            None => factor,
            Some(id) => {
                let [r, g, b, _] = self.eval(id);
                factor * Rgb::new(r, g, b)
            }
        }
    }

    #[inline]
    fn number(&self, slot: &FloatSlot) -> f32 {
        match slot.texture {
            None => slot.factor,
            Some((id, channel)) => slot.factor * self.eval(id)[usize::from(channel & 3)],
        }
    }
}

/// Slot values at a path's wavelengths.
struct ByWavelength<'a> {
    slots: &'a PointReader<'a>,
    waves: &'a Wavelengths,
}

impl Slots for ByWavelength<'_> {
    #[inline]
    fn color(&self, slot: &ColorSlot) -> Rgb {
        let factor = Rgb::from_array(slot.factor);
        match slot.texture {
            None => uplift_reflectance(factor, self.waves),
            Some(id) => self.slots.by_wavelength(id, factor, self.waves),
        }
    }

    #[inline]
    fn number(&self, slot: &FloatSlot) -> f32 {
        self.slots.number(slot)
    }

    #[inline]
    fn wavelengths(&self) -> Option<&Wavelengths> {
        Some(self.waves)
    }
}

/// A colour factor at a path's wavelengths, or in RGB if `waves` is `None`.
pub fn color_at_wavelengths(slots: &PointReader<'_>, slot: &ColorSlot, waves: Option<&Wavelengths>) -> Rgb {
    match waves {
        None => slots.color(slot),
        Some(waves) => ByWavelength { slots, waves }.color(slot),
    }
}

/// Is the BSDF anisotropic?
fn is_anisotropic(model: &Model) -> bool {
    matches!(model, Model::Hair { .. }) || model.pbr().is_some_and(|pbr| pbr.anisotropy.is_some())
}

/// The emission of a surface, and its spectrum if uniform.
fn emission_of(
    material: &Material,
    textures: &CompiledTextures,
    shading: ShadingModel,
    is_single_sided: bool,
) -> (Option<CompiledEmission>, Option<Arc<Spectrum>>) {
    let light = material.emission.map(|e| match shading.spectral {
        true => light_spectrum(e.radiance, textures),
        false => (fold_color(e.radiance, textures), None),
    });
    let (light, light_spectrum) = light.map_or((None, None), |(slot, spectrum)| (Some(slot), spectrum));
    let emission = material.emission.zip(light).and_then(|(e, radiance)| {
        let beam = Beam::new(material.emitter_traits.unwrap_or_default().beam, textures.profiles());
        (radiance.factor != [0.0; 3]).then_some(CompiledEmission {
            radiance,
            // Absent surfaces do not emit.
            two_sided: e.two_sided && !is_single_sided,
            beam,
        })
    });
    (emission, light_spectrum)
}

/// The medium inside a material's solids.
fn medium_of(material: &Material, model: &Model, class: BsdfClass, shading: ShadingModel) -> Option<Medium> {
    let medium = Medium::of(model, class, material.medium.as_ref());
    match shading.spectral {
        true => medium.map(|medium| medium.by_wavelength(model, material.medium.as_ref())),
        false => medium,
    }
}

/// A normal map, unless it has no effect or its texture is missing.
fn effective_map(map: Option<NormalMap>, textures: &CompiledTextures) -> Option<NormalMap> {
    map.filter(|map| map.scale != 0.0 && !textures.is_damaged(map.texture))
}

impl CompiledMaterial {
    /// Is the emission multiplied by vertex colours, as for unlit models?
    #[inline]
    pub fn emission_depends_on_vertex(&self) -> bool {
        self.uses_vertex_colors && self.class == BsdfClass::Black
    }

    pub(super) fn new(material: &Material, textures: &CompiledTextures, shading: ShadingModel) -> Self {
        let model = fold_model(&material.model, textures);
        let is_single_sided = !material.double_sided && !is_transmissive(&model);
        let program = BsdfProgram::of(&model, shading);
        let class = program.class();
        let (emission, light_spectrum) = emission_of(material, textures, shading, is_single_sided);
        let alpha = alpha_of(material, textures);
        let visibility = material.emitter_traits.map(|t| SurfaceVisibility::of_emitter(&t, alpha.is_some()));
        let normal_map = effective_map(material.normal_map, textures).filter(|_| class != BsdfClass::Black);
        let normal = material.normal.filter(|_| class != BsdfClass::Black);
        let is_textured = has_texture(&model, |id| textures.spectrum(id).is_none());
        let is_spectral = shading.spectral
            && (has_texture(&model, |id| textures.spectrum(id).is_some()) || program.depends_on_wavelength());
        let coat = model.pbr().and_then(|pbr| pbr.clearcoat);
        let coat_normal_map = effective_map(coat.and_then(|c| c.normal_map), textures);
        let is_mapped = normal_map.is_some() || normal.is_some();
        let maps_coat = coat.is_some() && (is_mapped || coat_normal_map.is_some()); // their normals differ
        let uses_frame = is_anisotropic(&model) || maps_coat;
        let has_texture_outside_bsdf =
            emission.is_some_and(|e| e.radiance.texture.is_some()) || alpha.is_some_and(|a| a.is_textured());
        let is_constant = !is_textured && !material.use_vertex_colors && !uses_frame;
        let constant_rgb = is_constant.then(|| program.evaluate(&Factors, &LocalFrame::DEFAULT));
        let depends_on_hit = |id: TextureId| textures.depends_on_viewer(id) || textures.reads_hit(id);
        CompiledMaterial {
            class,
            constant: constant_rgb.filter(|_| !is_spectral),
            constant_rgb: constant_rgb.filter(|_| is_spectral),
            albedo: constant_rgb.filter(|_| !is_spectral).map_or(Rgb::ZERO, |b| b.albedo()),
            emission,
            light_spectrum,
            is_transparent_to_shadow_rays: program.may_transmit_unscattered() && emission.is_none(),
            pane_thickness: 0.0,
            is_single_sided,
            medium: medium_of(material, &model, class, shading),
            is_boundary: matches!(model, Model::Boundary {}),
            bounds_medium: false,
            medium_index: 0,
            normal_map,
            normal,
            bumped_normal: material.bumped_normal,
            alpha,
            surface_visibility: visibility.filter(|v| *v != SurfaceVisibility::FULL),
            uses_vertex_colors: material.use_vertex_colors,
            depends_on_viewer: has_texture(&model, |id| textures.depends_on_viewer(id)),
            emission_depends_on_viewer: emission.and_then(|e| e.radiance.texture).is_some_and(depends_on_hit),
            reads_hit: material.textures().any(|id| textures.reads_hit(id)),
            index: material.index as f32,
            reads_tangents: material.textures().any(|id| textures.reads_tangents(id)),
            reads_path: material.textures().any(|id| textures.reads_path(id)),
            traces_rays: material.textures().any(|id| textures.traces_rays(id)),
            uses_uv: is_textured || uses_frame || is_mapped || has_texture_outside_bsdf,
            uses_frame,
            coat_normal_map,
            graphs: None,
            components: Vec::new(),
            is_component: false,
            program,
        }
        .with_components(&model, textures, shading)
    }

    /// Adds the node graphs, and the components of a mix, which needs the hit data of all components.
    fn with_components(
        mut self,
        model: &Model,
        textures: &CompiledTextures,
        shading: ShadingModel,
    ) -> CompiledMaterial {
        let maps = [self.normal_map, self.coat_normal_map].into_iter().flatten().map(|map| map.texture);
        let normals = [self.normal, self.bumped_normal].into_iter().flatten();
        self.graphs = textures.join_graphs(textures_of(model).into_iter().chain(maps).chain(normals));
        for MixComponent { weight, material } in model.components() {
            let compiled = CompiledMaterial::new(material, textures, shading);
            self.add_needs(&compiled);
            self.normal_map = self.normal_map.or(compiled.normal_map);
            self.normal = self.normal.or(compiled.normal);
            if self.medium.is_none() {
                self.medium = compiled.medium.clone();
            }
            let reflectance = compiled.constant.map_or(1.0, |_| compiled.albedo.luminance().clamp(0.0, 1.0));
            let material = Some(Box::new(CompiledMaterial {
                // Shadow rays end at the mix.
                is_transparent_to_shadow_rays: false,
                is_single_sided: self.is_single_sided,
                is_component: true,
                ..compiled
            }));
            self.components.push(CompiledComponent { weight: *weight, reflectance, index: 0, material });
        }
        // The weights of the mix affect the radiance of components.
        for component in self.components.iter_mut().filter_map(|c| c.material.as_deref_mut()) {
            component.depends_on_viewer |= self.depends_on_viewer;
            component.reads_path |= self.reads_path;
        }
        self.with_blend(textures)
    }

    /// Replaces two components by a single BSDF, their weighted sum, if [`Blend`](crate::bsdf::Blend) supports it: without
    /// random selection there is less noise. The components must have equal normals and no emission, alpha or medium.
    fn with_blend(self, textures: &CompiledTextures) -> CompiledMaterial {
        let [CompiledComponent { weight: of_a, material: Some(a), .. }, second] = &self.components[..] else {
            return self;
        };
        let CompiledComponent { weight: of_b, material: Some(b), .. } = second else { return self };
        let is_plain = |m: &CompiledMaterial| {
            m.emission.is_none()
                && m.alpha.is_none()
                && m.medium.is_none()
                && !m.uses_vertex_colors
                && !m.uses_frame
        };
        let normals = |m: &CompiledMaterial| (m.normal_map, m.normal, m.bumped_normal);
        let are_compatible = is_plain(a) && is_plain(b) && normals(a) == normals(b);
        let weights = [*of_a, *of_b];
        let program = BsdfProgram::blend(weights, [&a.program, &b.program]).filter(|_| are_compatible);
        let Some(program) = program else { return self };
        let is_constant =
            [a, b].iter().all(|m| m.uniform_bsdf().is_some()) && weights.iter().all(|w| w.texture.is_none());
        let is_spectral = a.constant_rgb.is_some() || b.constant_rgb.is_some();
        let constant_rgb = is_constant.then(|| program.evaluate(&Factors, &LocalFrame::DEFAULT));
        let constant = constant_rgb.filter(|_| !is_spectral);
        let albedo = constant.map_or(Rgb::ZERO, |bsdf| bsdf.albedo());
        let (class, constant_rgb) = (program.class(), constant_rgb.filter(|_| is_spectral));
        let (normal_map, normal, bumped_normal) = normals(a);
        let components = Vec::new();
        let graphs = [&self.graphs, &a.graphs, &b.graphs].into_iter().flatten();
        let graphs = textures.join_graphs(graphs.flat_map(|graphs| graphs.textures.to_vec()));
        CompiledMaterial {
            class,
            graphs,
            program,
            constant,
            constant_rgb,
            albedo,
            normal_map,
            normal,
            bumped_normal,
            components,
            ..self
        }
    }

    /// Adds the hit data that another material needs.
    fn add_needs(&mut self, other: &CompiledMaterial) {
        self.uses_vertex_colors |= other.uses_vertex_colors;
        self.uses_uv |= other.uses_uv;
        self.uses_frame |= other.uses_frame;
        self.depends_on_viewer |= other.depends_on_viewer;
        self.reads_hit |= other.reads_hit;
        self.reads_tangents |= other.reads_tangents;
        self.reads_path |= other.reads_path;
        self.traces_rays |= other.traces_rays;
    }

    /// Components of a mix with another medium than that of the mix, if either scatters; with their medium.
    pub(super) fn components_with_other_media(
        &mut self,
    ) -> impl Iterator<Item = (&mut CompiledMaterial, Medium)> {
        let own_medium = self.medium.as_ref();
        self.components.iter_mut().filter_map(move |component| {
            let part = component.material.as_deref_mut()?;
            let medium = part.medium.clone()?;
            let scatters = |medium: &Medium| medium.scattering.is_some();
            let is_other = own_medium.is_some_and(|own_medium| {
                *own_medium != medium && (scatters(own_medium) || scatters(&medium))
            });
            is_other.then_some((part, medium))
        })
    }

    /// Removes the components' materials, to be appended to all materials from index `first`. They get the ray visibility of the
    /// mix, and its medium unless they have their own.
    pub(super) fn take_components(&mut self, first: usize) -> Vec<CompiledMaterial> {
        let (surface_visibility, medium_index) = (self.surface_visibility, self.medium_index);
        let mut placed = Vec::new();
        for component in &mut self.components {
            let Some(material) = component.material.take() else { continue };
            component.index = (first + placed.len()) as u32;
            let medium_index = match &material.medium {
                None => 0,
                Some(_) if material.medium_index != 0 => material.medium_index,
                Some(_) => medium_index,
            };
            placed.push(CompiledMaterial { surface_visibility, medium_index, ..*material });
        }
        placed
    }

    /// Does the outgoing radiance depend on the incident path or the view direction beyond the BSDF?
    pub fn depends_on_path(&self) -> bool {
        self.depends_on_viewer || self.reads_path || self.alpha.is_some_and(|alpha| alpha.depends_on_viewer)
    }

    /// The BSDF, if constant over the surface apart from spectral colours.
    pub fn uniform_bsdf(&self) -> Option<Bsdf> {
        self.constant.or(self.constant_rgb)
    }

    /// A copy of the material for objects with traits.
    pub(super) fn with_traits(&self, traits: &ObjectTraits) -> CompiledMaterial {
        let own_visibility = self.surface_visibility.unwrap_or(SurfaceVisibility::FULL);
        let visible_to = own_visibility.visible_to.and(traits.visible_to);
        let (is_holdout, is_catcher) = (traits.is_holdout, traits.is_shadow_catcher);
        let (sets, links) = (traits.sets, traits.links);
        let surface_visibility =
            SurfaceVisibility { visible_to, is_holdout, is_catcher, sets, links, ..own_visibility };
        CompiledMaterial {
            surface_visibility: Some(surface_visibility).filter(|p| *p != SurfaceVisibility::FULL),
            ..self.clone()
        }
    }

    /// Does its object cast shadows on catchers? Then it is excluded from their reference picture. Not for pure emitters, which
    /// don't scatter light.
    pub fn casts_on_catchers(&self) -> bool {
        let is_pure_emitter = !self.uses_normals() && self.emission.is_some();
        !is_pure_emitter && !self.surface_visibility.is_some_and(|v| v.is_catcher)
    }

    pub fn visible_to(&self) -> RayKinds {
        self.surface_visibility.map_or(RayKinds::ALL, |v| v.visible_to)
    }

    /// Sets of its object, for light linking.
    pub fn sets(&self) -> ObjectSets {
        self.surface_visibility.map_or(ObjectSets::NONE, |v| v.sets)
    }

    /// Light linking of its emission.
    #[inline]
    pub fn links(&self) -> LightLinks {
        self.surface_visibility.map_or(LightLinks::ALL, |v| v.links)
    }

    /// Is its alpha 0 everywhere, without a medium behind it?
    pub fn is_invisible(&self) -> bool {
        !self.bounds_medium && self.alpha.is_some_and(|alpha| alpha.is_never_present())
    }

    /// May rays pass its surface without scattering?
    pub fn may_pass_through(&self) -> bool {
        self.alpha.is_some()
            || self.surface_visibility.is_some()
            || self.is_single_sided
            || self.is_transparent_to_shadow_rays
            || self.pane_thickness > 0.0
            || self.is_boundary
    }

    /// May rays pass its surface because of its alpha?
    #[inline(always)]
    pub fn is_transparent(&self) -> bool {
        self.alpha.is_some() && !self.is_boundary
    }

    /// Do rays enter a medium inside its solids where they pass the surface by its alpha?
    pub(super) fn alpha_leads_into(&self, medium: &Medium) -> bool {
        let is_subsurface = medium.scattering.as_ref().is_some_and(|s| s.is_subsurface);
        let is_passed_by_alpha_only = !self.is_single_sided && self.surface_visibility.is_none();
        self.is_transparent() && is_passed_by_alpha_only && medium.has_effect() && !is_subsurface
    }

    /// Is it smooth glass for all texture values?
    pub fn is_smooth_glass(&self) -> bool {
        self.program.is_smooth_glass()
    }

    /// Are vertex normals used?
    pub fn uses_normals(&self) -> bool {
        self.class != BsdfClass::Black || self.reads_hit || !self.components.is_empty()
    }

    /// Are tangents used?
    pub fn uses_tangents(&self) -> bool {
        self.normal_map.is_some() || self.reads_tangents || self.uses_frame
    }

    #[inline]
    pub fn bsdf(&self, slots: &PointReader<'_>, frame: &LocalFrame, vertex_color: Rgb) -> Bsdf {
        if let Some(bsdf) = self.constant {
            return bsdf;
        }
        let bsdf = self.program.evaluate(slots, frame);
        if self.uses_vertex_colors { bsdf.tinted(vertex_color) } else { bsdf }
    }

    /// The BSDF at a point at a path's wavelengths.
    pub fn bsdf_by_wavelength(
        &self,
        slots: &PointReader<'_>,
        frame: &LocalFrame,
        vertex_color: Rgb,
        waves: &Wavelengths,
    ) -> Bsdf {
        if let Some(bsdf) = self.constant {
            return bsdf;
        }
        let bsdf = self.program.evaluate(&ByWavelength { slots, waves }, frame);
        if self.uses_vertex_colors { bsdf.tinted(uplift_reflectance(vertex_color, waves)) } else { bsdf }
    }

    /// The shading normal at a point, from the node graph or the normal map if any; and whether the normal of the graph was below
    /// the surface and has been moved to the tangent plane. Normal maps never point below the surface.
    #[inline]
    pub fn shading_normal(
        &self,
        slots: &PointReader<'_>,
        surface: &Surface,
        tangent_frame: Option<Mat3>,
    ) -> (Vec3, bool) {
        match self.normal {
            Some(graph) => graph_normal(graph, slots, surface),
            None => (mapped_normal(self.normal_map, slots, surface, tangent_frame), false),
        }
    }

    /// The normal with only the bump mapping of a displacement, if any; `ns` is the shading normal.
    #[inline]
    pub fn bumped_normal(&self, slots: &PointReader<'_>, surface: &Surface, ns: Vec3) -> Option<Vec3> {
        let graph = self.bumped_normal?;
        Some(if self.normal == Some(graph) { ns } else { graph_normal(graph, slots, surface).0 })
    }

    /// The value of the normal map at a point, in tangent space, not normalised; zero without a map.
    #[inline]
    pub fn mapped_tangent_normal(&self, slots: &PointReader<'_>) -> Vec3 {
        self.normal_map.map_or(Vec3::ZERO, |map| tangent_space_normal(map, slots))
    }

    /// The clearcoat's normal at a point: without its own map the unmapped shading normal, not the base's mapped one.
    #[inline]
    pub fn coat_normal(
        &self,
        slots: &PointReader<'_>,
        surface: &Surface,
        tangent_frame: Option<Mat3>,
    ) -> Vec3 {
        mapped_normal(self.coat_normal_map, slots, surface, tangent_frame)
    }

    /// Tangents and coat normal at a point, in the local frame of the BSDF (of [`Frame::from_normal`]).
    pub fn local_frame(&self, frame: &Frame, tangent_frame: Option<Mat3>, coat_normal: Vec3) -> LocalFrame {
        let default = LocalFrame::DEFAULT;
        let flat = |v: Vec3, otherwise| {
            let local = frame.to_local(v).truncate();
            if local.length_squared() > 1e-12 { local } else { otherwise }
        };
        let (tangent, bitangent) = match tangent_frame {
            Some(t) => (flat(t.x_axis, default.tangent), flat(t.y_axis, default.bitangent)),
            None => (default.tangent, default.bitangent),
        };
        let normal = frame.to_local(coat_normal).normalize_or_zero();
        let coat_normal = if normal.z > 1e-3 { normal } else { default.coat_normal };
        LocalFrame { tangent, bitangent, coat_normal }
    }
}

/// The normal of a node graph, and whether it pointed below the surface and was clamped; the surface's shading normal for
/// zero results.
#[inline(never)]
fn graph_normal(graph: TextureId, slots: &PointReader<'_>, surface: &Surface) -> (Vec3, bool) {
    let result = slots.vector(graph).unwrap_or(Vec3::ZERO).normalize_or_zero();
    let result = result * if slots.is_back() { -1.0 } else { 1.0 };
    let height = result.dot(surface.ns);
    if height > 0.0 {
        return (result, false);
    }
    let tangent = (result - surface.ns * height).normalize_or_zero();
    let is_opposite = tangent == Vec3::ZERO;
    let clamped = if is_opposite { surface.ns } else { (tangent + surface.ns * MIN_HEIGHT).normalize() };
    (clamped, result != Vec3::ZERO)
}

/// Cosine to the surface's normal of clamped normals.
const MIN_HEIGHT: f32 = 1e-4;

/// The normal of a map in world space; the surface's shading normal without a map, and if the map's normal points below the
/// surface.
#[inline]
fn mapped_normal(
    map: Option<NormalMap>,
    slots: &PointReader<'_>,
    surface: &Surface,
    tangent_frame: Option<Mat3>,
) -> Vec3 {
    let (Some(map), Some(frame)) = (map, tangent_frame) else { return surface.ns };
    let mapped = (frame * tangent_space_normal(map, slots)).normalize_or_zero();
    if mapped.dot(surface.ns) > 0.0 { mapped } else { surface.ns }
}

/// The value of a normal map in tangent space, not normalised.
#[inline(always)]
fn tangent_space_normal(map: NormalMap, slots: &PointReader<'_>) -> Vec3 {
    let [x, y, z, _] = slots.eval(map.texture);
    Vec3::new((2.0 * x - 1.0) * map.scale, (2.0 * y - 1.0) * map.scale, 2.0 * z - 1.0)
}

fn is_transmissive(model: &Model) -> bool {
    match model.transmission() {
        Transmission::None => false,
        Transmission::Thin | Transmission::Clear(_) => true,
        Transmission::Pbr(pbr) => is_transmissive_interface(pbr),
    }
}

/// Has a model a texture that satisfies a predicate?
fn has_texture(model: &Model, predicate: impl Fn(TextureId) -> bool) -> bool {
    textures_of(model).into_iter().any(predicate)
}

fn textures_of(model: &Model) -> Vec<TextureId> {
    let mut textures = Vec::new();
    model.visit("", &mut |_, parameter| textures.extend(parameter.texture()));
    textures
}

/// Alpha of a material.
#[derive(Clone, Copy, Debug)]
pub struct Alpha {
    pub(super) slot: FloatSlot,
    /// Colour factor on light that passes transparent parts; `None` for white.
    pub transparent_color: Option<ColorSlot>,
    cutoff: Option<f32>,
    /// Alpha depends on the view direction.
    pub depends_on_viewer: bool,
}

impl Alpha {
    /// Is alpha textured?
    fn is_textured(&self) -> bool {
        self.slot.texture.is_some()
            || self.transparent_color.is_some_and(|transparent_color| transparent_color.texture.is_some())
    }

    /// Is alpha 0 everywhere? (Vertex colours and textures only multiply it.)
    pub(super) fn is_never_present(&self) -> bool {
        self.slot.factor == 0.0
            && self.transparent_color.is_none()
            && self.cutoff.is_none_or(|cutoff| cutoff > 0.0)
    }

    /// The opacity at a point: the probability that rays hit the surface.
    #[inline]
    pub fn opacity(&self, slots: &PointReader<'_>, vertex_alpha: f32) -> f32 {
        let alpha = slots.number(&self.slot) * vertex_alpha;
        match self.cutoff {
            Some(cutoff) => f32::from(u8::from(alpha >= cutoff)),
            None => alpha.clamp(0.0, 1.0),
        }
    }
}

/// The alpha of a material; `None` if opaque everywhere.
fn alpha_of(material: &Material, textures: &CompiledTextures) -> Option<Alpha> {
    let slot = fold_float(material.alpha, textures);
    let transparent_color = fold_color(material.transparent_color, textures);
    let transparent_color = (transparent_color != ColorSlot::constant([1.0; 3])).then_some(transparent_color);
    let read = [slot.texture.map(|(id, _)| id), transparent_color.and_then(|slot| slot.texture)];
    let depends_on_viewer = read.into_iter().flatten().any(|id| textures.depends_on_viewer(id));
    let cutoff = match material.alpha_mode {
        AlphaMode::Opaque => return None,
        AlphaMode::Mask { cutoff } => Some(cutoff),
        AlphaMode::Blend => None,
    };
    let alpha = Alpha { slot, transparent_color, cutoff, depends_on_viewer };
    let present = |a: f32| alpha.cutoff.map_or(a >= 1.0, |cutoff| a >= cutoff);
    let constant = slot.texture.is_none() && !material.use_vertex_colors;
    (!(constant && present(slot.factor))).then_some(alpha)
}

// Constant folding: constant textures are multiplied into the factor of their slot.

/// A colour with constant textures folded.
fn fold_color(slot: ColorSlot, textures: &CompiledTextures) -> ColorSlot {
    match slot.texture.and_then(|id| textures.constant(id)) {
        Some(c) => ColorSlot::constant([0, 1, 2].map(|i| slot.factor[i] * c[i])),
        None if slot.factor == [0.0; 3] => ColorSlot::constant([0.0; 3]),
        None => slot,
    }
}

/// A number with constant textures folded.
fn fold_float(slot: FloatSlot, textures: &CompiledTextures) -> FloatSlot {
    match slot.texture.and_then(|(id, channel)| Some((textures.constant(id)?, channel))) {
        Some((c, channel)) => FloatSlot::constant(slot.factor * c[usize::from(channel & 3)]),
        None if slot.factor == 0.0 => FloatSlot::constant(0.0),
        None => slot,
    }
}

/// A model with constant textures folded and without layers that have no effect.
fn fold_model(model: &Model, textures: &CompiledTextures) -> Model {
    let mut folded = model.clone();
    folded.visit_mut("", &mut |_, parameter| match parameter {
        ParameterMut::Color(slot) => *slot = fold_color(*slot, textures),
        ParameterMut::Number(slot) => *slot = fold_float(*slot, textures),
        ParameterMut::Texture(_) | ParameterMut::Constant(_) => {}
    });
    if let Model::Pbr(pbr) = &mut folded {
        drop_absent_layers(pbr);
    }
    folded
}

fn drop_absent_layers(pbr: &mut PbrMaterial) {
    let is_zero = |slot: &FloatSlot| slot.factor <= 0.0;
    pbr.clearcoat = pbr.clearcoat.filter(|c| !is_zero(&c.factor));
    pbr.sheen = pbr.sheen.filter(|s| s.color.factor != [0.0; 3]);
    pbr.anisotropy = pbr.anisotropy.filter(|a| a.strength > 0.0);
    pbr.iridescence = pbr.iridescence.filter(|i| !is_zero(&i.factor));
    pbr.diffuse_transmission = pbr.diffuse_transmission.filter(|d| !is_zero(&d.factor));
}

// Spectral rendering: constant colours of materials are uplifted to spectra; greys remain factors.

/// A material with constant colours replaced by spectral textures.
pub(super) fn with_spectra(material: &Material, textures: &mut CompiledTextures) -> Material {
    let mut uplifted = material.clone();
    uplifted.model.visit_mut("", &mut |_, parameter| {
        if let ParameterMut::Color(slot) = parameter {
            let folded = fold_color(*slot, textures);
            let spectrum = Spectrum::of_reflectance(Rgb::from_array(folded.factor));
            *slot = match (folded.texture, spectrum) {
                (None, spectrum @ Spectrum::Uplifted { .. }) => {
                    ColorSlot::texture(textures.add_spectrum(spectrum))
                }
                _ => folded,
            };
        }
    });
    uplifted
}

/// Emission with the RGB colour in place of a spectrum, and the spectrum.
fn light_spectrum(slot: ColorSlot, textures: &CompiledTextures) -> (ColorSlot, Option<Arc<Spectrum>>) {
    let slot = fold_color(slot, textures);
    match slot.texture {
        Some(id) => match textures.spectrum(id) {
            Some(spectrum) => {
                let rgb = spectrum.rgb().max(Rgb::ZERO) * Rgb::from_array(slot.factor);
                (ColorSlot::constant(rgb.to_array()), Some(Arc::new(spectrum.clone())))
            }
            None => (slot, None),
        },
        None => match Spectrum::of_light(Rgb::from_array(slot.factor)) {
            Spectrum::Grey(_) => (slot, None),
            spectrum => (slot, Some(Arc::new(spectrum))),
        },
    }
}
