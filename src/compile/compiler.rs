//! Compiles a scene, or the frames of a sequence, which reuse unchanged results of the previous frame.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::light_tables::LightTables;
use super::limits::{check, check_size};
use super::material::CompiledMaterial;
use super::medium::Medium;
use super::motion::MotionVectors;
use super::objects::ObjectMaterials;
use super::panes::RefractedLights;
use super::plan::{BvhPolicy, Plan};
use super::reuse::{BuiltGeometry, Reusable, Sources};
use super::scene::{CompileOptions, CompileReport, CompiledScene, ExpectedPicture, Features, View};
use super::{
    coincident_surfaces, emitters, inside_out, material, media, motion, objects, panes, plan, texture_needs,
};
use crate::accel::{Accel, BuildStats};
use crate::error::{Problem, Result, Warning};
use crate::light::{EnvironmentLight, LightMotions, Lights, PunctualLight};
use crate::math::DVec3;
use crate::scene::{Camera, Environment, Model, RayKinds, Scene, ShadingModel};
use crate::texture::CompiledTextures;
use crate::work_counter::WorkCounter;
use std::sync::Arc;
use std::time::Instant;

/// Compiles scenes, or the frames of a sequence in order. Frames reuse textures, the environment and, in scenes with many
/// triangles, static geometry and undeformed moving meshes; only transforms and deformed meshes are updated. (Pictures of
/// such frames may differ from single pictures by rounding, because a single picture merges all meshes into the world.)
pub struct Compiler {
    is_sequence: bool,
    latest: Option<Arc<CompiledScene>>,
    bvh: BvhPolicy,
    keeps_uv: bool,
    texture_memory: Option<u64>,
    has_other_cameras: bool,
    counter: WorkCounter,
}

impl Compiler {
    /// A compiler of independent scenes.
    pub fn single() -> Compiler {
        Compiler::new(false)
    }

    /// A compiler of the frames of a sequence.
    pub fn sequence() -> Compiler {
        Compiler::new(true)
    }

    fn new(is_sequence: bool) -> Compiler {
        let (bvh, counter) = (BvhPolicy::default(), WorkCounter::default());
        Compiler {
            is_sequence,
            latest: None,
            bvh,
            keeps_uv: false,
            texture_memory: None,
            has_other_cameras: false,
            counter,
        }
    }

    /// Progress of the build.
    pub fn counter(&self) -> &WorkCounter {
        &self.counter
    }

    /// Sets how the quality of the BVH is chosen. Default [`BvhPolicy::Full`].
    pub fn set_bvh(&mut self, bvh: BvhPolicy) {
        self.bvh = bvh;
    }

    /// Keeps texture coordinates that no material uses.
    pub fn keep_uv(&mut self, keeps_uv: bool) {
        self.keeps_uv = keeps_uv;
    }

    /// Limits the memory of texture images, bytes; see [`CompileOptions::texture_memory`].
    pub fn set_texture_memory(&mut self, bytes: Option<u64>) {
        self.texture_memory = bytes;
    }

    /// Keeps the full resolution of textures, as other cameras will render the same scene.
    pub fn allow_camera_changes(&mut self) {
        self.has_other_cameras = true;
    }

    /// Compiles a frame for a camera and a picture of `width` x `height` pixels. The anchor of the previous frame is reused as long
    /// as single precision suffices.
    ///
    /// # Errors
    /// As for [`super::compile`], and the problems of [`Camera::validate`].
    pub fn compile(
        &mut self,
        scene: &Scene,
        shading: ShadingModel,
        camera: &Camera,
        (width, height): (u32, u32),
    ) -> Result<(Arc<CompiledScene>, CompileReport)> {
        check(scene.validate())?;
        // The camera may not be one of the scene's.
        check(camera.validate())?;
        let keeps_anchor = |s: &&Arc<CompiledScene>| {
            let keeps = s.sources.as_ref().is_some_and(Sources::keep_geometry);
            keeps && !View::new(s, camera, width, height).needs_new_anchor(s)
        };
        let earlier = self.latest.take();
        let anchor = earlier.as_ref().filter(keeps_anchor).map(|s| s.anchor);
        let anchor = Some(anchor.unwrap_or(camera.world_from_camera.translation));
        let (bvh, keeps_uv, counter) = (self.bvh, self.keeps_uv, self.counter.clone());
        let picture =
            (!self.has_other_cameras).then(|| ExpectedPicture { camera: camera.clone(), width, height });
        let texture_memory = self.texture_memory;
        let options = CompileOptions { shading, anchor, bvh, keeps_uv, counter, picture, texture_memory };
        // Reuse is impossible while the earlier frame is still being rendered.
        let earlier = earlier.and_then(|scene| Arc::try_unwrap(scene).ok());
        let (compiled, report) = compile_after(earlier, scene, &options, self.is_sequence)?;
        let compiled = Arc::new(compiled);
        if self.is_sequence {
            self.latest = Some(compiled.clone());
        }
        Ok((compiled, report))
    }
}

/// Compiles a scene.
///
/// # Errors
/// An input error with the problems of [`Scene::validate`], for a non-finite anchor, or for a scene that exceeds the limits
/// of indices or addresses.
pub fn compile(scene: &Scene, options: &CompileOptions) -> Result<(CompiledScene, CompileReport)> {
    check(scene.validate())?;
    if let Some(anchor) = options.anchor.filter(|anchor| !anchor.is_finite()) {
        check(vec![Problem::new("anchor", format!("is {anchor:?}, but must be finite"))])?;
    }
    compile_after(None, scene, options, false)
}

/// Compiles a validated scene and reuses unchanged parts of `earlier`, the previous frame of a sequence.
fn compile_after(
    earlier: Option<CompiledScene>,
    scene: &Scene,
    options: &CompileOptions,
    is_sequence: bool,
) -> Result<(CompiledScene, CompileReport)> {
    let (begin, mut report) = (Instant::now(), CompileReport::default());
    let anchor = options.anchor.unwrap_or_else(|| default_anchor(scene));
    let mut reused = earlier.map_or_else(Reusable::default, |earlier| earlier.into_reusable(scene));
    warn_of_interpolated_metals(scene, options.shading, &mut report.warnings);
    let mut textures = textures(reused.textures.take(), scene, (anchor, options), &mut report)?;
    let (warnings, left_out) = (&mut report.warnings, &mut report.left_out);
    let (materials, media, object_materials) =
        materials(scene, (anchor, &mut textures), options.shading, warnings);
    let named = (scene, object_materials, textures.attributes().clone());
    let plan = plan::plan(named, &materials, anchor, is_sequence, warnings, left_out);
    let inside_out = inside_out::find(scene, &materials, &mut report.warnings);
    let shifts = emitters::find_flush_lights(scene, anchor, &mut report.notes);
    let plan = Plan { keeps_uv: options.keeps_uv, inside_out, shifts, ..plan };
    check_size(scene, &plan)?;
    let BuiltGeometry { geometries, accel } =
        reused.geometry(scene, &materials, anchor, &plan, (options.bvh, &options.counter))?;
    report_accel(accel.stats(), &mut report, || plan::count_degenerate(scene, &plan));
    let objects = objects::of(scene, &materials, anchor);
    let emitters = emitters::find(&geometries, &materials, &textures, &objects);
    let others = (&media[..], environment(scene, reused.environment.take(), anchor, &mut report.warnings));
    let surfaces = (&emitters, &geometries, &materials[..]);
    let (lights, tables) =
        lights((scene, &plan.object_materials, options.shading), anchor, others, surfaces, &textures)?;
    let refracted_lights = RefractedLights::find(scene, &materials, anchor, (&lights, &textures));
    let features = features(scene, (&geometries, &accel, anchor), &materials, &textures, &media)
        .with_lights(!tables.ray_kinds.is_empty(), tables.links.are_used());
    (report.lights, report.build_s) = (lights.len() as u64, begin.elapsed().as_secs_f64());
    let compiled = CompiledScene {
        anchor,
        accel,
        geometries,
        objects,
        materials,
        shading: options.shading,
        media,
        textures,
        lights,
        camera_environment: camera_environment(scene),
        refracted_lights,
        light_groups: tables.groups,
        light_spectra: tables.spectra,
        light_kinds: tables.ray_kinds,
        links: tables.links,
        caster_lights: tables.caster_lights,
        scene_material_count: scene.materials.len() as u32,
        scene_materials_of_copies: plan.object_materials.sources(),
        features,
        emitters,
        vectors: MotionVectors::of(scene, anchor),
        sources: is_sequence.then(|| Sources::of(scene, &plan)),
    };
    report_compiled(&compiled, &mut report);
    Ok((compiled, report))
}

/// Distance from the camera, metres, above which squared triangle areas may overflow single precision.
const MAX_DISTANCE: f32 = 4e9;

/// Reports the memory, and warns of far surfaces.
fn report_compiled(compiled: &CompiledScene, report: &mut CompileReport) {
    report.memory = compiled.memory();
    let reach = compiled.bounding_radius();
    if reach > MAX_DISTANCE {
        report.warnings.push(Warning::general(format!(
            "surfaces are up to {reach:.1e} m away: triangles and quads longer than {MAX_DISTANCE:.0e} m are black; scale the scene down"
        )));
    }
}

/// All lights with the tables indexed by light. Infinitely distant lights are removed if opaque fog fills the world.
fn lights(
    (scene, object_materials, shading): (&Scene, &ObjectMaterials, ShadingModel),
    anchor: DVec3,
    (media, environment): (&[Medium], Option<EnvironmentLight>),
    surfaces: (&Emitters, &Geometries, &[CompiledMaterial]),
    textures: &CompiledTextures,
) -> Result<(Lights, LightTables)> {
    let emitters = surfaces.0;
    let punctual = scene.lights.iter().map(|l| PunctualLight::new(l, anchor)).collect();
    let motions =
        LightMotions { area: emitters.moving.clone(), punctual: motion::moving_lights(scene, anchor) };
    let volumes = media::volume_lights(scene, surfaces.2, media, anchor);
    let listed = (emitters.lights.clone(), punctual, volumes);
    let mut lights = Lights::moving(listed, motions, environment, textures);
    let tables = LightTables::new((scene, object_materials, shading), &lights, surfaces);
    let links = &tables.links;
    check(links.problems())?;
    if links.are_used() {
        let is_linked = |class: usize, light| links.reach(links.of_light(light), class as u32);
        lights.link(links.classes(), textures, is_linked);
    }
    scene.environment_sun.into_iter().for_each(|sun| lights.show_sun_to_camera(sun));
    if scene.fog.as_ref().is_some_and(media::is_opaque_to_far_light) {
        lights.exclude_infinite_lights();
    }
    Ok((lights, tables))
}

/// Warns of metals with indices of refraction for three wavelengths only, which spectral rendering interpolates.
fn warn_of_interpolated_metals(scene: &Scene, shading: ShadingModel, warnings: &mut Vec<Warning>) {
    for material in scene.materials.iter().filter(|_| shading.spectral) {
        if let Model::Conductor { metal: None, .. } = material.model {
            let name = &material.name;
            warnings.push(Warning::general(format!(
                "the index of refraction of metal '{name}' is interpolated from three wavelengths; use a measured metal by \
                name"
            )));
        }
    }
}

/// The textures; `reused` are those of the earlier frame, if unchanged.
fn textures(
    reused: Option<CompiledTextures>,
    scene: &Scene,
    (anchor, options): (DVec3, &CompileOptions),
    report: &mut CompileReport,
) -> Result<CompiledTextures> {
    let needs = texture_needs::of(scene, options);
    let textures = match reused {
        Some(textures) if textures.suffice_for(&needs) => textures.with_world_offset(anchor.as_vec3()),
        earlier => {
            let (list, images) = (&scene.textures, &scene.images);
            let compiled = CompiledTextures::new_reusing(earlier, list, images, anchor.as_vec3(), needs);
            let (textures, mut messages) = compiled?;
            report.warnings.append(&mut messages.warnings);
            report.left_out.extend(messages.left_out());
            report.textures = messages;
            textures
        }
    };
    Ok(textures.with_profiles(&scene.profiles).with_spectra(&scene.textures, options.shading.spectral))
}

/// The background of camera rays, if it differs from the environment that lights the scene.
fn camera_environment(scene: &Scene) -> Option<EnvironmentLight> {
    scene.camera_environment.as_ref().and_then(|seen| EnvironmentLight::new(seen, &scene.images, false))
}

/// The environment with its portals; `reused` is that of the earlier frame, if unchanged.
fn environment(
    scene: &Scene,
    reused: Option<Option<EnvironmentLight>>,
    anchor: DVec3,
    warnings: &mut Vec<Warning>,
) -> Option<EnvironmentLight> {
    let new = || EnvironmentLight::new(&scene.environment, &scene.images, true);
    let mut environment = reused.unwrap_or_else(new);
    match &mut environment {
        Some(environment) => {
            environment.set_portals(&scene.portals, anchor);
            let needs_shadow_rays = scene.object_traits().any(|traits| traits.visible_to.has_own_shadows());
            environment.set_sampled(!scene.environment_bsdf_only, needs_shadow_rays);
        }
        None if scene.portals.is_empty() => {}
        None => {
            let message = "portals have no effect: there is no environment";
            warnings.push(Warning::general(message));
        }
    }
    environment
}

/// The materials, including copies for single objects; the media of solids; and the material indices of objects.
fn materials(
    scene: &Scene,
    (anchor, textures): (DVec3, &mut CompiledTextures),
    shading: ShadingModel,
    warnings: &mut Vec<Warning>,
) -> (Vec<CompiledMaterial>, Vec<Medium>, ObjectMaterials) {
    let replaced = media::replace_open_subsurface(scene, warnings);
    let replaced = scene.materials.iter().zip(&replaced).map(|(m, other)| other.as_ref().unwrap_or(m));
    let compiled = |m| match shading.spectral {
        true => CompiledMaterial::new(&material::with_spectra(m, textures), textures, shading),
        false => CompiledMaterial::new(m, textures, shading),
    };
    let mut materials: Vec<CompiledMaterial> = replaced.map(compiled).collect();
    let mut media = media::collect(scene, anchor, &mut materials, shading.spectral, warnings);
    media::warn_of_overlaps(scene, &materials, warnings);
    panes::mark(scene, &mut materials);
    let mut object_materials = ObjectMaterials::of(scene);
    object_materials.extend(&mut materials);
    media::mark_enclosed(scene, &materials, &mut media);
    (materials, media, object_materials)
}

fn features(
    scene: &Scene,
    (geometries, accel, anchor): (&Geometries, &Accel, DVec3),
    materials: &[CompiledMaterial],
    textures: &CompiledTextures,
    media: &[Medium],
) -> Features {
    let is_foggy = media.first().is_some_and(|m| m.scattering.is_some());
    let boundaries = materials.iter().any(|m| m.bounds_medium);
    let mapped_normals = materials.iter().any(|m| m.normal_map.is_some() || m.normal.is_some());
    Features {
        alpha: materials.iter().any(CompiledMaterial::may_pass_through),
        transparency: materials.iter().any(CompiledMaterial::is_transparent),
        panes: materials.iter().any(|m| m.pane_thickness > 0.0),
        normals: geometries.has_normals(),
        bent_normals: geometries.has_normals() || mapped_normals,
        mapped_normals,
        footprints: textures.use_ray_footprints(),
        media: media.len() > 1 || is_foggy,
        priorities: media.iter().skip(1).any(|m| m.rank() != media[1].rank()),
        scattering: boundaries || media.iter().any(|m| m.scattering.is_some()),
        boundaries,
        overlaps: media.iter().any(|m| m.is_additive)
            && media.iter().filter(|m| m.is_additive || m.keeps_overlapping_media).count() > 1,
        coincident_surfaces: coincident_surfaces::exist(scene, materials, (geometries, accel, anchor)),
        subsurface: media.iter().filter_map(|m| m.scattering.as_ref()).any(|s| !s.counts_as_bounces),
        environment_visible_to: scene.environment_visible_to,
        camera_environment: scene.camera_environment.is_some(),
        background: *scene.camera_environment.as_ref().unwrap_or(&scene.environment) != Environment::Black,
        paths: materials.iter().any(|m| m.reads_path),
        traced_textures: materials.iter().any(|m| m.traces_rays),
        ray_kinds: materials
            .iter()
            .any(|m| m.reads_path || !m.visible_to().contains(RayKinds::ALL.without(RayKinds::CAMERA))),
        catchers: materials.iter().any(|m| m.surface_visibility.is_some_and(|p| p.is_catcher)),
        links: false,
        graphs: materials.iter().any(|m| m.graphs.is_some()),
        mixes: materials.iter().any(|m| !m.components.is_empty()),
        mirrors: materials.iter().any(|m| m.uniform_bsdf().is_some_and(|b| b.is_mirror())),
        holdouts: materials.iter().any(|m| m.surface_visibility.is_some_and(|p| p.is_holdout)),
        absorption: media.iter().any(|m| m.absorption.is_some()),
    }
}

fn default_anchor(scene: &Scene) -> DVec3 {
    scene.cameras.first().map_or(DVec3::ZERO, |camera| camera.world_from_camera.translation)
}

fn report_accel(stats: &BuildStats, report: &mut CompileReport, count_degenerate: impl Fn() -> u64) {
    (report.bvh, report.bytes) = (stats.quality, stats.bytes);
    (report.triangles, report.quads, report.analytic) = (stats.triangles, stats.quads, stats.analytic);
    (report.curves, report.splats) = (stats.curves, stats.splats);
    let dropped = stats.dropped;
    let report_dropped = |list: &mut Vec<Warning>, count: u64, what: &str, with: &str| {
        let message = match count {
            0 => return,
            1 => format!("1 {what} {with} was dropped"),
            _ => format!("{count} {what}s {with} were dropped"),
        };
        list.push(Warning::general(message));
    };
    let far = "with coordinates that are not finite or beyond 1e18 m";
    report_dropped(&mut report.warnings, dropped.not_finite, "primitive", far);
    // Only a note: meshes such as the poles of spheres have degenerate triangles, which are invisible.
    let without_area = if dropped.degenerate > 0 { count_degenerate().min(dropped.degenerate) } else { 0 };
    report_dropped(&mut report.notes, without_area, "primitive", "without area");
    let too_small =
        "too small for single precision at its distance from the camera or the centre of its mesh";
    report_dropped(&mut report.warnings, dropped.degenerate - without_area, "primitive", too_small);
    report_dropped(&mut report.warnings, dropped.instances, "instance", "with singular transforms");
}
