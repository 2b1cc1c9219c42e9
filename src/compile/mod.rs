//! From what the user described to what the renderer needs: flat geometry with its accelerator, folded materials and
//! textures, lights. Whatever the picture does not need is left out, and said so.

mod bake;
mod closed;
mod compiler;
mod content;
mod emitters;
mod fold;
mod geometry;
mod material;
mod medium;
mod objects;
mod plan;
mod tangents;
mod view;

pub use geometry::{
    Corners, Geometries, Placement, Space, SurfaceCoordinates, TextureCorners, Transform,
};
pub use compiler::Compiler;
pub use material::{Alpha, CompiledEmission, CompiledMaterial};
pub use medium::Medium;
pub use objects::ObjectId;
pub use view::{View, choose_camera};

use crate::accel::{Accel, BuildStats};
use crate::error::{Error, ErrorKind, Problem, Result, Warning};
use crate::light::{EnvironmentLight, Lights, PunctualLight};
use crate::math::{Bounds3, DVec3, Hit};
use crate::scene::{EnergyCompensation, Scene};
use crate::shape::Analytic;
use crate::texture::CompiledTextures;
use compiler::{Geometry, Kept, Sources};
use emitters::Emitters;
use std::time::Instant;

/// What to compile for.
#[derive(Clone, Copy, Debug, Default)]
pub struct CompileOptions {
    /// Treatment of light that bounces between microfacets.
    pub energy_compensation: EnergyCompensation,
    /// The point of the scene's world that becomes the compiled scene's origin, metres. Single precision is finest
    /// around it, so it belongs where the camera is. By default the position of the first camera; without a camera the
    /// origin.
    pub anchor: Option<DVec3>,
}

/// What compiling did.
#[derive(Clone, Debug, Default)]
pub struct CompileReport {
    /// Seconds it took.
    pub build_s: f64,
    /// What was repaired or ignored.
    pub warnings: Vec<Warning>,
    /// What the picture does not need, with what leaving it out saved.
    pub left_out: Vec<String>,
    /// Triangles that rays can hit; shared meshes count once.
    pub triangles: u64,
    /// Quads.
    pub quads: u64,
    /// Spheres, disks and the like, in the order of [`Analytic::NAMES`].
    pub analytic: [u64; Analytic::NAMES.len()],
    /// Lights, the environment included.
    pub lights: u64,
    /// Memory of the accelerator.
    pub bytes: u64,
}

/// A scene ready to render. Immutable; rendering it can't fail. It knows no camera: see [`View`].
pub struct CompiledScene {
    /// The point of the scene's world that is the origin of all coordinates here, metres.
    pub anchor: DVec3,
    /// Ray queries.
    pub accel: Accel,
    /// Surfaces at hits.
    pub geometries: Geometries,
    /// Materials.
    pub materials: Vec<CompiledMaterial>,
    /// Treatment of light that bounces between microfacets.
    pub energy_compensation: EnergyCompensation,
    /// What solids are filled with, by the number that their materials give; the first is what surrounds the scene.
    pub media: Vec<Medium>,
    /// Texture lookups.
    pub textures: CompiledTextures,
    /// Everything that shines.
    pub lights: Lights,
    /// What the integrator may skip.
    pub features: Features,
    emitters: Emitters,
    /// What it was made of, for what may be made of it.
    sources: Option<Sources>,
}

/// What a scene makes use of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// Some surface is partly absent.
    pub alpha: bool,
    /// Some vertices have shading normals.
    pub normals: bool,
    /// Some shading normals differ from the geometric ones: those of vertices or of maps.
    pub bent_normals: bool,
    /// Some textures depend on how much of a surface a path sees.
    pub footprints: bool,
    /// Light passes through solids.
    pub media: bool,
    /// Some of them absorb it.
    pub absorption: bool,
}

impl CompiledScene {
    /// The light that the primitive at a hit is part of.
    #[inline]
    pub fn light_at(&self, hit: &Hit) -> Option<u32> {
        if hit.instance == 0 { self.emitters.light_of(hit.prim) } else { None }
    }

    /// The object of the scene at a hit.
    pub fn object_at(&self, hit: &Hit) -> ObjectId {
        self.geometries.object(hit)
    }
}

/// Compiles a scene.
///
/// # Errors
/// An input error for a scene with more triangles than can be addressed.
pub fn compile(scene: &Scene, options: &CompileOptions) -> Result<(CompiledScene, CompileReport)> {
    compile_after(None, scene, options, false)
}

/// Compiles a scene; as one moment of a sequence, whose earlier moment gives what it has in common with this one.
fn compile_after(
    earlier: Option<CompiledScene>,
    scene: &Scene,
    options: &CompileOptions,
    is_sequence: bool,
) -> Result<(CompiledScene, CompileReport)> {
    let begin = Instant::now();
    let anchor = options.anchor.unwrap_or_else(|| default_anchor(scene));
    let mut report = CompileReport::default();
    let mut kept = Kept::of(earlier, scene);
    let textures = match kept.textures.take() {
        Some(textures) => textures.moved(anchor.as_vec3()),
        None => CompiledTextures::new(&scene.textures, &scene.images, anchor.as_vec3()),
    };
    let compiled = |m| CompiledMaterial::new(m, &textures, options.energy_compensation);
    let mut materials: Vec<CompiledMaterial> = scene.materials.iter().map(compiled).collect();
    let media = medium::number(scene, &mut materials, &mut report.warnings);
    let (warnings, left_out) = (&mut report.warnings, &mut report.left_out);
    let plan = plan::plan(scene, &materials, anchor, is_sequence, warnings, left_out);
    let Geometry { geometries, accel } = kept.geometry(scene, &materials, anchor, &plan)?;
    report_accel(accel.stats(), &mut report);

    let emitters = emitters::find(&geometries, &materials);
    let punctual = scene.lights.iter().map(|l| PunctualLight::new(l, anchor)).collect();
    let environment = match kept.environment.take() {
        Some(environment) => environment,
        None => EnvironmentLight::new(&scene.environment, &scene.images, true),
    };
    let radius = scene_radius(&geometries);
    let lights = Lights::new(emitters.lights.clone(), punctual, environment, &textures, radius);
    report.lights = lights.len() as u64;
    let features = features(&geometries, &materials, &textures, &media);
    report.build_s = begin.elapsed().as_secs_f64();
    let compiled = CompiledScene {
        anchor,
        accel,
        geometries,
        materials,
        energy_compensation: options.energy_compensation,
        media,
        textures,
        lights,
        features,
        emitters,
        sources: is_sequence.then(|| Sources::of(scene, &plan)),
    };
    Ok((compiled, report))
}

fn features(
    geometries: &Geometries,
    materials: &[CompiledMaterial],
    textures: &CompiledTextures,
    media: &[Medium],
) -> Features {
    Features {
        alpha: materials.iter().any(|m| m.alpha.is_some()),
        normals: geometries.has_normals(),
        bent_normals: geometries.has_normals() || materials.iter().any(|m| m.normal_map.is_some()),
        footprints: textures.use_footprints(),
        media: media.len() > 1,
        absorption: media.iter().any(|m| m.absorption.is_some()),
    }
}

fn default_anchor(scene: &Scene) -> DVec3 {
    scene.cameras.first().map_or(DVec3::ZERO, |camera| camera.world_from_camera.translation)
}

fn input_error(message: impl Into<String>) -> Error {
    let problems = vec![Problem::new("", message)];
    Error { kind: ErrorKind::Input, file: None, problems, source_text: None }
}

fn report_accel(stats: &BuildStats, report: &mut CompileReport) {
    report.bytes = stats.bytes;
    (report.triangles, report.quads, report.analytic) = (stats.triangles, stats.quads, stats.analytic);
    let dropped = stats.dropped;
    let mut warn = |count: u64, what: &str, with: &str| {
        let message = match count {
            0 => return,
            1 => format!("1 {what} {with} was dropped"),
            _ => format!("{count} {what}s {with} were dropped"),
        };
        report.warnings.push(Warning::general(message));
    };
    warn(dropped.not_finite, "primitive", "with coordinates that are not finite or beyond 1e18 m");
    warn(dropped.degenerate, "primitive", "without area");
    warn(dropped.instances, "placement", "with singular transforms");
}

/// Half the diagonal of the box around everything, at least a little.
fn scene_radius(geometries: &Geometries) -> f32 {
    let mut world = geometries.world.bounds;
    for placement in &geometries.placements {
        let object = geometries.shared[placement.geometry as usize].bounds;
        if !object.is_empty() {
            let Transform { linear, translation, .. } = placement.world_from_object;
            let place = |p| linear * p + translation;
            world = object.corners().into_iter().map(place).fold(world, Bounds3::with);
        }
    }
    let radius = 0.5 * world.extent().length();
    if radius > 0.0 && radius.is_finite() { radius } else { 1.0 }
}
