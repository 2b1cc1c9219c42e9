//! From what the user described to what the renderer needs: flat geometry with its accelerator, folded materials and
//! textures, lights. Whatever the picture does not need is left out, and said so.

mod bake;
mod closed;
mod emitters;
mod fold;
mod geometry;
mod material;
mod media;
mod medium;
mod tangents;

pub use geometry::{
    Corners, Geometries, Surface, SurfaceCoordinates, TextureCorners, shading_normal, triangle_surface,
};
pub use material::{Alpha, CompiledEmission, CompiledMaterial};
pub use medium::Medium;

use crate::accel::{Accel, BuildOptions, BuildStats};
use crate::bsdf::ShadingModel;
use crate::camera::Camera;
use crate::error::{Error, ErrorKind, Problem, Result, Warning};
use crate::light::{EnvironmentLight, Lights, PunctualLight};
use crate::math::{Bounds3, DMat4, DVec3, Hit, Vec3};
use crate::scene::{EnergyCompensation, FresnelModel, Scene};
use crate::texture::CompiledTextures;
use bake::Baked;
use emitters::Emitters;
use std::time::Instant;

/// Most triangles that the accelerator can address.
const MAX_TRIANGLES: usize = 400_000_000;

/// What to compile for.
#[derive(Clone, Copy, Debug)]
pub struct CompileOptions {
    /// Treatment of light that bounces between microfacets.
    pub energy_compensation: EnergyCompensation,
    /// Fresnel term of the dielectric layers of glTF materials.
    pub fresnel: FresnelModel,
    /// Which camera; the first by default.
    pub camera: Option<usize>,
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
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
    /// Spheres.
    pub spheres: u64,
    /// Lights, the environment included.
    pub lights: u64,
    /// Memory of the accelerator.
    pub bytes: u64,
    /// The camera's view of the scene's world.
    pub world_to_camera: DMat4,
}

/// A scene ready to render. Immutable; rendering it can't fail. Its origin is the camera's position.
pub struct CompiledScene {
    /// Ray queries.
    pub accel: Accel,
    /// Where its origin is in the scene's world.
    pub origin: DVec3,
    /// Camera rays.
    pub camera: Camera,
    /// Surfaces at hits.
    pub geometries: Geometries,
    /// Materials.
    pub materials: Vec<CompiledMaterial>,
    /// Models that all materials share.
    pub shading: ShadingModel,
    /// What solids are filled with, by the number that their materials give; the first is what surrounds the scene.
    pub media: Vec<Medium>,
    /// Texture lookups.
    pub textures: CompiledTextures,
    /// Everything that shines.
    pub lights: Lights,
    /// What the integrator may skip.
    pub features: Features,
    emitters: Emitters,
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
}

/// Compiles a scene.
///
/// # Errors
/// A usage error for a camera that does not exist, an input error for a scene without a camera or with more triangles
/// than can be addressed.
pub fn compile(scene: &Scene, options: &CompileOptions) -> Result<(CompiledScene, CompileReport)> {
    let begin = Instant::now();
    let camera = choose_camera(scene, options)?;
    let origin = camera.world_from_camera.translation;
    let mut report = CompileReport {
        world_to_camera: DMat4::from(camera.world_from_camera.inverse()),
        ..CompileReport::default()
    };
    let textures = CompiledTextures::new(&scene.textures, &scene.images, origin.as_vec3());
    let CompileOptions { energy_compensation, fresnel, .. } = *options;
    let shading = ShadingModel { energy_compensation, fresnel };
    let compiled = |m| CompiledMaterial::new(m, &textures, shading);
    let mut materials: Vec<CompiledMaterial> = scene.materials.iter().map(compiled).collect();
    let media = media::number(scene, &mut materials, &mut report.warnings);
    let Baked { geometries, instances } =
        bake::bake(scene, &materials, origin, &mut report.warnings, &mut report.left_out);
    check_size(&geometries)?;
    let accel = Accel::build(&geometries.shapes, &instances, &BuildOptions::default());
    report_accel(accel.stats(), &mut report);

    let emitters = emitters::find(&geometries, &materials);
    let punctual = scene.lights.iter().map(|l| PunctualLight::new(l, origin)).collect();
    let environment = EnvironmentLight::new(&scene.environment, &scene.images, true);
    let radius = scene_radius(&geometries);
    let lights = Lights::new(emitters.lights.clone(), punctual, environment, &textures, radius);
    report.lights = lights.len() as u64;
    let features = Features {
        alpha: materials.iter().any(|m| m.alpha.is_some()),
        normals: geometries.has_normals(),
        bent_normals: geometries.has_normals() || materials.iter().any(|m| m.normal_map.is_some()),
        footprints: textures.use_footprints(),
        media: media.len() > 1,
        absorption: media.iter().any(|m| m.absorption.is_some()),
    };
    let camera = Camera::new(camera, options.width, options.height, origin);
    report.build_s = begin.elapsed().as_secs_f64();
    let compiled = CompiledScene {
        accel,
        origin,
        camera,
        geometries,
        materials,
        shading,
        media,
        textures,
        lights,
        features,
        emitters,
    };
    Ok((compiled, report))
}

fn choose_camera<'a>(scene: &'a Scene, options: &CompileOptions) -> Result<&'a crate::scene::Camera> {
    let index = options.camera.unwrap_or(0);
    scene.cameras.get(index).ok_or_else(|| match options.camera {
        Some(i) => Error::usage(format!("there is no camera {i}: the scene has {}", scene.cameras.len())),
        None => input_error("the scene has no camera"),
    })
}

fn check_size(geometries: &Geometries) -> Result<()> {
    let triangles: usize = geometries.shapes.iter().map(|g| g.triangles.len()).sum();
    if triangles > MAX_TRIANGLES {
        return Err(input_error(format!("{triangles} triangles are more than the {MAX_TRIANGLES} possible")));
    }
    Ok(())
}

fn input_error(message: impl Into<String>) -> Error {
    let problems = vec![Problem::new("", message)];
    Error { kind: ErrorKind::Input, file: None, problems, source_text: None }
}

fn report_accel(stats: &BuildStats, report: &mut CompileReport) {
    report.bytes = stats.bytes;
    (report.triangles, report.quads, report.spheres) = (stats.triangles, stats.quads, stats.spheres);
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
    let mut bounds = vec![Bounds3::EMPTY; geometries.shapes.len()];
    for (b, shapes) in bounds.iter_mut().zip(&geometries.shapes) {
        *b = Bounds3::of(shapes.positions.iter().map(|&p| Vec3::from_array(p)).filter(|p| p.is_finite()));
        for q in &shapes.quads {
            for p in [q.corner, q.corner + q.edge_u, q.corner + q.edge_v, q.corner + q.edge_u + q.edge_v] {
                *b = b.with(p);
            }
        }
        for s in &shapes.spheres {
            *b = b.with(s.center - Vec3::splat(s.radius)).with(s.center + Vec3::splat(s.radius));
        }
    }
    let mut world = bounds[0];
    for placement in &geometries.placements {
        let object = bounds[placement.geometry as usize];
        if !object.is_empty() {
            let place = |p| placement.linear * p + placement.translation;
            world = object.corners().into_iter().map(place).fold(world, Bounds3::with);
        }
    }
    let radius = 0.5 * world.extent().length();
    if radius > 0.0 && radius.is_finite() { radius } else { 1.0 }
}
