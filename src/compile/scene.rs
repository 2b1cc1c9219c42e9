//! A scene ready to render, compile options and report, and a camera's view of the scene.

use super::emitters::Emitters;
use super::geometry::{Attributes, Geometries, Space};
use super::light_tables::{LightGroups, Links};
use super::material::CompiledMaterial;
use super::medium::Medium;
use super::motion::MotionVectors;
use super::objects::ObjectId;
use super::panes::RefractedLights;
use super::plan::Tree;
use super::reuse::{Reusable, Sources};
use crate::accel::{Accel, Geometry, TreeQuality};
use crate::bsdf::ShadingModel;
use crate::camera::{self, MovingCamera, ndc_from_world};
use crate::color::spectral::Spectrum;
use crate::error::{Error, ErrorKind, Problem, Result, Warning};
use crate::light::{EnvironmentLight, Lights};
use crate::math::{DMat4, DVec3, Hit, gamma};
use crate::scene::{Camera, MaterialId, RayKinds, Scene, ShapeTag};
use crate::texture::{CompiledTextures, ObjectData, TextureReport};
use crate::work_counter::WorkCounter;
use std::sync::Arc;

/// Options of compiling.
#[derive(Clone, Debug, Default)]
pub struct CompileOptions {
    /// Models that all materials share.
    pub shading: ShadingModel,
    /// The point of the scene's world that becomes the compiled scene's origin, metres. Single precision is finest
    /// around it, so it belongs where the camera is. By default the position of the first camera; without a camera the
    /// origin.
    pub anchor: Option<DVec3>,
    /// How good the trees are that rays walk. Default [`Tree::Full`].
    pub tree: Tree,
    /// Keep texture coordinates that no material asks for: an output shows them.
    pub keeps_uv: bool,
    /// Receives the progress of building trees.
    pub counter: WorkCounter,
    /// The picture that will be rendered, or the first of several. Images of textures are kept only as finely as it shows them; others
    /// may be rendered as well, and take longer where they show more. Without it images are kept as they are.
    pub picture: Option<ExpectedPicture>,
    /// Bytes that the images of textures may take; larger ones are compressed, in memory or in a temporary file, which takes time. By
    /// default [`texture_memory_for`](super::texture_memory_for) the picture; any number without one.
    pub texture_memory: Option<u64>,
}

/// A picture that will be rendered.
#[derive(Clone, Debug)]
pub struct ExpectedPicture {
    /// Where it is seen from.
    pub camera: Camera,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

/// A part of a scene or picture and the bytes that it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryPart {
    /// Its name in reports.
    pub name: &'static str,
    /// Bytes.
    pub bytes: u64,
}

/// A report about compiling.
#[derive(Clone, Debug, Default)]
pub struct CompileReport {
    /// Seconds it took.
    pub build_s: f64,
    /// Repairs and ignored parts.
    pub warnings: Vec<Warning>,
    /// Parts left out though nothing is wrong: triangles without area.
    pub notes: Vec<Warning>,
    /// Parts that the picture does not need, with the memory that leaving them out saved.
    pub left_out: Vec<String>,
    /// Triangles that rays can hit; shared meshes count once.
    pub triangles: u64,
    /// Quads.
    pub quads: u64,
    /// Spheres, disks and the like, in the order of [`ShapeTag::ALL`].
    pub analytic: [u64; ShapeTag::ALL.len()],
    /// Pieces of curves that rays can hit.
    pub curves: u64,
    /// Gaussian splats that rays can hit.
    pub splats: u64,
    /// Lights, the environment included.
    pub lights: u64,
    /// How good the trees are that rays walk.
    pub tree: TreeQuality,
    /// Memory of the accelerator.
    pub bytes: u64,
    /// Memory by part, the accelerator included.
    pub memory: Vec<MemoryPart>,
    /// The images of textures.
    pub textures: TextureReport,
}

/// A scene ready to render. Immutable; rendering it can't fail. It knows no camera: see [`View`](super::View).
pub struct CompiledScene {
    /// The point of the scene's world that is the origin of all coordinates here, metres.
    pub anchor: DVec3,
    /// Ray queries.
    pub accel: Accel,
    /// Surfaces at hits.
    pub geometries: Geometries,
    /// Materials.
    pub materials: Vec<CompiledMaterial>,
    /// Models that all materials share.
    pub shading: ShadingModel,
    /// Media, by the number that materials have; the first one surrounds the scene.
    pub media: Vec<Medium>,
    /// Texture lookups.
    pub textures: CompiledTextures,
    /// Everything that emits light.
    pub lights: Lights,
    /// The environment that camera rays see, if it differs from the one that lights the scene and is not black.
    pub camera_environment: Option<EnvironmentLight>,
    /// The small bright ones, and the bodies that refract their light.
    pub refracted_lights: RefractedLights,
    /// Which group each is in.
    pub light_groups: LightGroups,
    /// Their spectra, by number; see [`CompiledScene::spectrum_of_light`].
    pub(super) light_spectra: Vec<Option<Arc<Spectrum>>>,
    /// Rays that each light is visible to, by number; empty where all lights are visible to all.
    pub(super) light_kinds: Vec<RayKinds>,
    /// Light linking.
    pub links: Links,
    /// By light: is it left out of the reference picture of shadow catchers? Empty without catchers.
    pub(super) caught_lights: Vec<bool>,
    /// Materials of the scene that it was compiled from: the first ones. Copies for objects with traits follow.
    pub(super) own_materials: u32,
    /// The originals of these copies, in their order.
    pub(super) originals: Vec<MaterialId>,
    /// Features that the integrator may skip.
    pub features: Features,
    /// The objects as graphs of nodes see them, by number; empty where no graph asks.
    pub objects: Vec<ObjectData>,
    /// Which primitives are lights.
    pub(super) emitters: Emitters,
    /// Where objects are at the neighbouring frames.
    pub vectors: MotionVectors,
    /// The sources that it was made of, for reuse at another time.
    pub(super) sources: Option<Sources>,
}

/// Features that a scene uses: the integrator leaves out the stages of the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// Some surface has alpha or is invisible to some rays.
    pub alpha: bool,
    /// Some surface has an alpha of its own.
    pub transparency: bool,
    /// Some bodies are panes of glass, which light samples pass.
    pub panes: bool,
    /// Some vertices have shading normals.
    pub normals: bool,
    /// Some shading normals differ from the geometric ones: those of vertices or of maps.
    pub bent_normals: bool,
    /// Some are those of maps or bumps.
    pub mapped_normals: bool,
    /// Some textures depend on how much of a surface a path sees.
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
    /// Rays that see the environment.
    pub environment_visible_to: RayKinds,
    /// Camera rays see another environment than the one that lights the scene.
    pub camera_environment: bool,
    /// Camera rays that hit nothing see a background, which may be black: they are opaque.
    pub background: bool,
    /// Objects or lights are visible to some kinds of rays only, the camera's aside.
    pub ray_kinds: bool,
    /// Lights are linked to some objects only.
    pub links: bool,
    /// Some textures depend on the incident path.
    pub paths: bool,
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
    /// With lights that light some kinds of rays only, or some objects only.
    pub(super) fn with_lights(self, some_kinds: bool, links: bool) -> Features {
        let ray_kinds = self.ray_kinds || some_kinds || links;
        // Objects that cast no shadow in the light of some lights are absent for their shadow rays.
        Features { ray_kinds, alpha: self.alpha || links, links, ..self }
    }
}

impl CompiledScene {
    /// The light that the primitive at a hit is part of.
    #[inline]
    pub fn light_at(&self, hit: &Hit) -> Option<u32> {
        match hit.instance {
            0 => self.emitters.light_of(hit.prim),
            instance => self.emitters.moving_light_of(instance, hit.prim),
        }
    }

    /// Does anything but the camera move while the picture is taken?
    pub fn is_moving(&self) -> bool {
        self.accel.is_moving() || self.lights.are_moving()
    }

    /// The kinds of rays that light `index` is visible to.
    #[inline]
    pub fn ray_kinds_of_light(&self, index: u32) -> RayKinds {
        self.light_kinds.get(index as usize).copied().unwrap_or(RayKinds::ALL)
    }

    /// The spectrum of light `index`, where pictures are rendered by wavelength and it emits the same everywhere and is not white.
    #[inline]
    pub fn spectrum_of_light(&self, index: u32) -> Option<&Spectrum> {
        self.light_spectra.get(index as usize).and_then(Option::as_deref)
    }

    /// Is light `index` left out of the reference picture of shadow catchers?
    pub fn is_caught_light(&self, index: u32) -> bool {
        self.caught_lights.get(index as usize).is_some_and(|&is_caught| is_caught)
    }

    /// The scene's material that a compiled one is, or is a copy of.
    pub fn described_material(&self, material: u32) -> u32 {
        let copy = material.checked_sub(self.own_materials);
        copy.map_or(material, |copy| self.originals[copy as usize].0)
    }

    /// The object of the scene at a hit.
    pub fn object_at(&self, hit: &Hit) -> ObjectId {
        self.geometries.object(hit)
    }

    /// The parts that another time may reuse.
    pub(super) fn into_reusable(self, scene: &Scene) -> Reusable {
        let CompiledScene { accel, geometries, textures, lights, sources, .. } = self;
        match sources {
            Some(sources) => Reusable::of(sources, (accel, geometries), textures, lights, scene),
            None => Reusable::default(),
        }
    }
}

impl CompiledScene {
    /// The bytes of each large part: lists by their lengths, without what few scenes have (tables of grids and profiles).
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
    /// Camera rays, in the compiled scene's coordinates.
    pub camera: camera::Camera,
    /// The camera while the shutter is open, if it moves then.
    pub moving: Option<MovingCamera>,
    /// The camera a frame before and a frame after, where that is known.
    pub neighbours: [camera::Camera; 2],
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Width over height of a pixel.
    pub pixel_aspect: f64,
    /// From the scene's world to the camera's own space.
    pub camera_from_world: DMat4,
    /// From there to normalized device coordinates; panoramas have no such matrix.
    pub ndc_from_world: Option<DMat4>,
}

impl View {
    /// The view of a camera on a picture of `width` x `height` pixels. Takes no time to speak of: nothing is built.
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

    /// Is single precision too coarse where the camera stands, so that the scene should be compiled around an anchor near
    /// it?
    ///
    /// Coordinates near a camera that is D away from the anchor are rounded by up to 2^-24 D, and points of surfaces,
    /// from which paths continue, lie within [`gamma`]`(7)` D, about 7 times as much, of where they should. That may be a
    /// quarter of a pixel at the nearest surface: with pixels of a thousandth of the distance, D may be 600 times the
    /// distance of the nearest surface.
    pub fn needs_new_anchor(&self, compiled: &CompiledScene) -> bool {
        let position = self.camera.position();
        let (width, spread) = self.camera.pixel_cone();
        let displacement = gamma(7) * position.length();
        let pixel = |distance: f32| 2.0 * (width + spread * distance);
        // NaN counts as too coarse.
        let suits = |distance: f32| displacement <= 0.25 * pixel(distance);
        displacement != 0.0 && !suits(compiled.accel.distance(position))
    }
}

/// The scene's camera of an index; the first without one.
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
