//! The compiled scene, compile options and report, and a camera's view of the scene.

use super::emitters::Emitters;
use super::geometry::{Attributes, Geometries, Space};
use super::light_tables::{LightGroups, Links};
use super::material::CompiledMaterial;
use super::medium::Medium;
use super::motion::MotionVectors;
use super::objects::ObjectId;
use super::panes::RefractedLights;
use super::plan::BvhPolicy;
use super::reuse::{Reusable, Sources};
use crate::accel::{Accel, Geometry, TreeQuality};
use crate::bsdf::ShadingModel;
use crate::camera::{self, MovingCamera, ndc_from_world};
use crate::color::spectral::Spectrum;
use crate::error::{Error, ErrorKind, Problem, Result, Warning};
use crate::light::{EnvironmentLight, Lights};
use crate::math::{DMat4, DVec3, Hit, gamma};
use crate::scene::{Camera, MaterialId, RayKinds, Scene, ShapeKind};
use crate::texture::{CompiledTextures, ObjectData, TextureReport};
use crate::work_counter::WorkCounter;
use std::sync::Arc;

#[derive(Clone, Debug, Default)]
pub struct CompileOptions {
    /// Shading models of all materials.
    pub shading: ShadingModel,
    /// The point in world space, metres, that becomes the compiled scene's origin, where single precision is finest; best near
    /// the camera. By default the position of the first camera; without a camera the origin.
    pub anchor: Option<DVec3>,
    /// How the quality of the BVH is chosen. Default [`BvhPolicy::Full`].
    pub bvh: BvhPolicy,
    /// Keep texture coordinates that no material uses, for an output of them.
    pub keeps_uv: bool,
    /// Receives the progress of BVH builds.
    pub counter: WorkCounter,
    /// The picture to be rendered, or the first of several. Texture images are kept only at the mip levels that it needs; other
    /// pictures are possible, but slower where they need finer levels. `None` keeps images at full resolution.
    pub picture: Option<ExpectedPicture>,
    /// Maximum memory of texture images, bytes; larger ones are compressed, in memory or in a temporary file, which costs time.
    /// By default [`texture_memory_for`](super::texture_memory_for) the picture; unlimited without a picture.
    pub texture_memory: Option<u64>,
}

/// A picture to be rendered.
#[derive(Clone, Debug)]
pub struct ExpectedPicture {
    pub camera: Camera,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

/// Memory of a part of a scene or picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryPart {
    /// Name for reports.
    pub name: &'static str,
    /// Size, bytes.
    pub bytes: u64,
}

#[derive(Clone, Debug, Default)]
pub struct CompileReport {
    /// Build time, seconds.
    pub build_s: f64,
    /// Repairs and ignored parts.
    pub warnings: Vec<Warning>,
    /// Harmless omissions, such as degenerate triangles.
    pub notes: Vec<Warning>,
    /// Invisible parts that were omitted, with the memory saved.
    pub left_out: Vec<String>,
    /// Number of triangles in BVHs; shared meshes count once.
    pub triangles: u64,
    /// Number of quads.
    pub quads: u64,
    /// Numbers of analytic shapes, in the order of [`ShapeKind::ALL`].
    pub analytic: [u64; ShapeKind::ALL.len()],
    /// Number of curve segments.
    pub curves: u64,
    /// Number of Gaussian splats.
    pub splats: u64,
    /// Number of lights, including the environment.
    pub lights: u64,
    /// Quality of the BVH.
    pub bvh: TreeQuality,
    /// Memory of the BVH, bytes.
    pub bytes: u64,
    /// Memory by part, including the BVH.
    pub memory: Vec<MemoryPart>,
    /// Report about texture images.
    pub textures: TextureReport,
}

/// A compiled scene, immutable. Independent of cameras: see [`View`](super::View).
pub struct CompiledScene {
    /// The point in world space, metres, that is the origin of all coordinates here.
    pub anchor: DVec3,
    /// BVHs for ray queries.
    pub accel: Accel,
    /// Surfaces at hits.
    pub geometries: Geometries,
    /// Materials of the scene, then copies for objects with traits, then components of mixes.
    pub materials: Vec<CompiledMaterial>,
    /// Shading models of all materials.
    pub shading: ShadingModel,
    /// Media, by medium index; the first is the exterior medium.
    pub media: Vec<Medium>,
    /// Texture lookups.
    pub textures: CompiledTextures,
    pub lights: Lights,
    /// The environment for camera rays, if it differs from the one that lights the scene and is not black.
    pub camera_environment: Option<EnvironmentLight>,
    /// Small bright lights and the bodies that refract their light.
    pub refracted_lights: RefractedLights,
    pub light_groups: LightGroups,
    /// Spectra by light; see [`CompiledScene::spectrum_of_light`].
    pub(super) light_spectra: Vec<Option<Arc<Spectrum>>>,
    /// Ray visibility by light; empty if all lights are visible to all rays.
    pub(super) light_kinds: Vec<RayKinds>,
    /// Light linking.
    pub links: Links,
    /// By area light: does its object cast shadows on catchers? Empty without catchers.
    pub(super) caster_lights: Vec<bool>,
    /// Number of materials of the scene, which come first.
    pub(super) scene_material_count: u32,
    /// The scene's material of each compiled material after those: copies and components.
    pub(super) scene_materials_of_copies: Vec<MaterialId>,
    /// Features, to skip stages of the integrator.
    pub features: Features,
    /// Data of objects for node graphs, by id; empty if no node graph reads them.
    pub objects: Vec<ObjectData>,
    /// The lights of primitives.
    pub(super) emitters: Emitters,
    /// Motion of objects between frames.
    pub vectors: MotionVectors,
    /// The inputs of compilation, for reuse by the next frame.
    pub(super) sources: Option<Sources>,
}

/// Features that a scene uses: the integrator skips the stages of others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// Rays may pass some surfaces: by alpha, visibility, single-sidedness and so on.
    pub alpha: bool,
    /// Some materials have alpha.
    pub transparency: bool,
    /// Some bodies are panes of glass, which shadow rays pass.
    pub panes: bool,
    /// Some vertices have shading normals.
    pub normals: bool,
    /// Some shading normals differ from the geometric ones: by vertex normals or maps.
    pub bent_normals: bool,
    /// Some materials have normal maps or bump maps.
    pub mapped_normals: bool,
    /// Some texture lookups depend on the footprint of the path.
    pub footprints: bool,
    /// Some solids are transmissive.
    pub media: bool,
    /// Some medium only absorbs.
    pub absorption: bool,
    /// Some medium scatters or emits, or has an index-matched boundary.
    pub scattering: bool,
    /// Some solid scatters beneath its surface (random-walk subsurface scattering).
    pub subsurface: bool,
    /// Solids have different priorities (nested dielectrics).
    pub priorities: bool,
    /// Surfaces of some solids coincide.
    pub coincident_surfaces: bool,
    /// Some media have index-matched boundaries.
    pub boundaries: bool,
    /// Several media may overlap.
    pub overlaps: bool,
    /// Ray visibility of the environment.
    pub environment_visible_to: RayKinds,
    /// The environment for camera rays differs from the one that lights the scene.
    pub camera_environment: bool,
    /// Camera rays that hit nothing are opaque: there is a background, which may be black.
    pub background: bool,
    /// Some objects or lights are invisible to some kinds of rays other than camera rays.
    pub ray_kinds: bool,
    /// Lights are linked to some objects only.
    pub links: bool,
    /// Some textures depend on the incident path.
    pub paths: bool,
    /// Some textures trace rays.
    pub traced_textures: bool,
    /// Some BSDFs, normals or weights of mixes are node graphs.
    pub graphs: bool,
    /// Some materials are mixes.
    pub mixes: bool,
    /// Some materials are smooth mirrors.
    pub mirrors: bool,
    /// Some objects are holdouts.
    pub holdouts: bool,
    /// Some objects are shadow catchers.
    pub catchers: bool,
}

impl Features {
    /// Adds features of lights: limited ray visibility, and light linking.
    pub(super) fn with_lights(self, some_kinds: bool, links: bool) -> Features {
        let ray_kinds = self.ray_kinds || some_kinds || links;
        // Shadow linking lets shadow rays pass objects.
        Features { ray_kinds, alpha: self.alpha || links, links, ..self }
    }
}

impl CompiledScene {
    /// The light of the primitive at a hit.
    #[inline]
    pub fn light_at(&self, hit: &Hit) -> Option<u32> {
        match hit.instance {
            0 => self.emitters.light_of(hit.prim),
            instance => self.emitters.moving_light_of(instance, hit.prim),
        }
    }

    /// Does anything but the camera move while the shutter is open?
    pub fn is_moving(&self) -> bool {
        self.accel.is_moving() || self.lights.are_moving()
    }

    /// Ray visibility of light `index`.
    #[inline]
    pub fn ray_kinds_of_light(&self, index: u32) -> RayKinds {
        self.light_kinds.get(index as usize).copied().unwrap_or(RayKinds::ALL)
    }

    /// The spectrum of light `index`, in spectral rendering of uniform, coloured lights.
    #[inline]
    pub fn spectrum_of_light(&self, index: u32) -> Option<&Spectrum> {
        self.light_spectra.get(index as usize).and_then(Option::as_deref)
    }

    /// Does the object of light `index` cast shadows on catchers? Then it is excluded from their reference picture.
    pub fn is_caster_light(&self, index: u32) -> bool {
        self.caster_lights.get(index as usize).is_some_and(|&is_caught| is_caught)
    }

    /// The scene's material of a compiled material, which may be a copy or component.
    pub fn scene_material(&self, material: u32) -> u32 {
        let copy = material.checked_sub(self.scene_material_count);
        copy.map_or(material, |copy| self.scene_materials_of_copies[copy as usize].0)
    }

    /// The object of the scene at a hit.
    pub fn object_at(&self, hit: &Hit) -> ObjectId {
        self.geometries.object(hit)
    }

    /// The parts that the next frame may reuse.
    pub(super) fn into_reusable(self, scene: &Scene) -> Reusable {
        let CompiledScene { accel, geometries, textures, lights, sources, .. } = self;
        match sources {
            Some(sources) => Reusable::of(sources, (accel, geometries), textures, lights, scene),
            None => Reusable::default(),
        }
    }
}

impl CompiledScene {
    /// Memory of large parts, by the lengths of their lists, without grids and profiles.
    pub fn memory(&self) -> Vec<MemoryPart> {
        let spaces = || std::iter::once(&self.geometries.world).chain(&self.geometries.shared);
        let of_spaces = |bytes: fn(&Space) -> usize| spaces().map(|space| bytes(space)).sum::<usize>();
        let placements = &self.geometries.placements;
        let parts = [
            ("BVH", self.accel.stats().bytes as usize),
            ("geometry", of_spaces(|space| of_shapes(&space.shapes))),
            ("attributes", of_spaces(|space| of_attributes(&space.attributes))),
            ("instances", size_of_val(&placements[..])),
            ("materials", self.materials.len() * size_of::<CompiledMaterial>()),
            ("textures", self.textures.bytes()),
            ("lights", self.lights.bytes()),
        ];
        parts.into_iter().map(|(name, bytes)| MemoryPart { name, bytes: bytes as u64 }).collect()
    }
}

fn of_keys<T>(keys: &[Vec<T>]) -> usize {
    keys.iter().map(|key| size_of_val(&key[..])).sum()
}

fn of_shapes(shapes: &Geometry) -> usize {
    let curves = &shapes.curves;
    size_of_val(&shapes.positions[..])
        + size_of_val(&shapes.triangles[..])
        + size_of_val(&shapes.quads[..])
        + size_of_val(&shapes.analytic[..])
        + size_of_val(&curves.points[..])
        + size_of_val(&curves.tangents[..])
        + size_of_val(&curves.segments[..])
        + of_keys(&shapes.keys)
        + shapes.splats.bytes()
}

fn of_attributes(attributes: &Attributes) -> usize {
    size_of_val(&attributes.normals[..])
        + of_keys(&attributes.normal_keys)
        + of_keys(&attributes.uv)
        + size_of_val(&attributes.tangents[..])
        + size_of_val(&attributes.colors[..])
        + attributes.named.iter().map(|list| list.bytes()).sum::<usize>()
        + size_of_val(&attributes.materials[..])
        + size_of_val(&attributes.object_from_world[..])
        + size_of_val(&attributes.curves.along[..])
        + size_of_val(&attributes.curves.colors[..])
}

/// A camera and the size of its picture, for a [`CompiledScene`].
#[derive(Clone, Debug)]
pub struct View {
    /// The camera, relative to the anchor.
    pub camera: camera::Camera,
    /// The camera while the shutter is open, if it moves.
    pub moving: Option<MovingCamera>,
    /// The camera a frame before and a frame after, if known.
    pub neighbours: [camera::Camera; 2],
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Width over height of a pixel.
    pub pixel_aspect: f64,
    /// From world to camera space.
    pub camera_from_world: DMat4,
    /// From world space to normalised device coordinates; `None` for panoramas.
    pub ndc_from_world: Option<DMat4>,
}

impl View {
    /// The view of a camera for a picture of `width` x `height` pixels; cheap.
    pub fn new(compiled: &CompiledScene, camera: &Camera, width: u32, height: u32) -> View {
        let at = |world_from_camera| {
            let camera = Camera { world_from_camera, ..camera.clone() };
            camera::Camera::new(&camera, width, height, compiled.anchor)
        };
        let motion = camera.motion.as_ref();
        let blurring = motion.filter(|m| m.blurs());
        let neighbours = motion.and_then(|m| m.neighbours).unwrap_or([camera.world_from_camera; 2]);
        View {
            moving: blurring.map(|m| MovingCamera::new(m.keys.iter().copied().map(at))),
            neighbours: neighbours.map(at),
            camera: at(camera.world_from_camera),
            width,
            height,
            pixel_aspect: camera.pixel_aspect,
            camera_from_world: DMat4::from(camera.world_from_camera.inverse()),
            ndc_from_world: ndc_from_world(camera, width, height),
        }
    }

    /// Is single precision too coarse at the camera's position, so that the scene should be recompiled with a nearer anchor?
    ///
    /// Coordinates near a camera at a distance D from the anchor are rounded by up to 2^-24 D, and hit points have an error of
    /// up to [`gamma`]`(7)` D, about 7 times as much. The limit is 1/4 of a pixel at the nearest surface: with pixels of 1/1000
    /// of the distance, D may be 600 times the distance of the nearest surface.
    pub fn needs_new_anchor(&self, compiled: &CompiledScene) -> bool {
        let position = self.camera.position();
        let (width, spread) = self.camera.pixel_cone();
        let displacement = gamma(7) * position.length();
        let pixel = |distance: f32| 2.0 * (width + spread * distance);
        // False for NaN.
        let is_precise = |distance: f32| displacement <= 0.25 * pixel(distance);
        displacement != 0.0 && !is_precise(compiled.accel.distance(position))
    }
}

/// The scene's camera at an index, by default the first.
///
/// # Errors
/// A usage error for a camera that does not exist, an input error for a scene without a camera.
pub fn choose_camera(scene: &Scene, index: Option<usize>) -> Result<&Camera> {
    scene.cameras.get(index.unwrap_or(0)).ok_or_else(|| match index {
        Some(i) => Error::usage(format!("there is no camera {i}: the scene has {}", scene.cameras.len())),
        None => {
            let problems = vec![Problem::new("", "the scene has no camera")];
            Error { kind: ErrorKind::Input, file: None, problems, source_text: None }
        }
    })
}
