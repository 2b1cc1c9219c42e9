//! A scene ready to render, and what it is compiled for.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::groups::LightGroups;
use super::links::Links;
use super::material::CompiledMaterial;
use super::medium::Medium;
use super::objects::ObjectId;
use super::reuse::{Kept, Sources};
use super::tree::Tree;
use super::vectors::Vectors;
use crate::accel::{Accel, TreeQuality};
use crate::bsdf::ShadingModel;
use crate::color::spectral::Spectrum;
use crate::error::Warning;
use crate::gauge::Gauge;
use crate::light::{EnvironmentLight, Lights};
use crate::math::{DVec3, Hit};
use crate::scene::{Camera, MaterialId, RayKinds, Scene, ShapeTag};
use crate::texture::{CompiledTextures, TextureReport};
use std::sync::Arc;

/// What to compile for.
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
    /// Is told how far the building of trees is.
    pub gauge: Gauge,
    /// The picture that will be rendered, or the first of several. Images of textures are kept only as finely as it shows them; others
    /// may be rendered as well, and take longer where they show more. Without it images are kept as they are.
    pub picture: Option<ExpectedPicture>,
    /// Bytes that the images of textures may take; what is beyond is decoded again and again while pictures are rendered. By default
    /// any number.
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

/// What compiling did.
#[derive(Clone, Debug, Default)]
pub struct CompileReport {
    /// Seconds it took.
    pub build_s: f64,
    /// What was repaired or ignored.
    pub warnings: Vec<Warning>,
    /// What was left out, though nothing is amiss: triangles without area.
    pub notes: Vec<Warning>,
    /// What the picture does not need, with what leaving it out saved.
    pub left_out: Vec<String>,
    /// Triangles that rays can hit; shared meshes count once.
    pub triangles: u64,
    /// Quads.
    pub quads: u64,
    /// Spheres, disks and the like, in the order of [`ShapeTag::ALL`].
    pub analytic: [u64; ShapeTag::ALL.len()],
    /// Pieces of curves that rays can hit.
    pub curves: u64,
    /// Lights, the environment included.
    pub lights: u64,
    /// How good the trees are that rays walk.
    pub tree: TreeQuality,
    /// Memory of the accelerator.
    pub bytes: u64,
    /// Memory by part, the accelerator included.
    pub memory: Vec<MemoryPart>,
    /// What became of the images of textures.
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
    /// What solids are filled with, by the number that their materials give; the first is what surrounds the scene.
    pub media: Vec<Medium>,
    /// Texture lookups.
    pub textures: CompiledTextures,
    /// Everything that shines.
    pub lights: Lights,
    /// What cameras see of the environment, if that is another one, unless it is black.
    pub camera_environment: Option<EnvironmentLight>,
    /// Which group each is in.
    pub light_groups: LightGroups,
    /// Their spectra, by number; see [`CompiledScene::spectrum_of_light`].
    pub(super) light_spectra: Vec<Option<Arc<Spectrum>>>,
    /// What each lights, by number; empty where all light everything.
    pub(super) light_kinds: Vec<RayKinds>,
    /// What the lights are linked to.
    pub links: Links,
    /// By light: is it left out where the effect of objects on shadow catchers is told? Empty without catchers.
    pub(super) caught_lights: Vec<bool>,
    /// Materials of the scene that it was compiled from: the first ones. Copies for objects with traits follow.
    pub(super) own_materials: u32,
    /// What these are copies of, in their order.
    pub(super) originals: Vec<MaterialId>,
    /// What the integrator may skip.
    pub features: Features,
    /// Which primitives are lights.
    pub(super) emitters: Emitters,
    /// Where objects are at the neighbouring frames.
    pub vectors: Vectors,
    /// What it was made of, for what may be made of it.
    pub(super) sources: Option<Sources>,
}

/// What a scene makes use of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// Some surface is absent in places or for some rays.
    pub alpha: bool,
    /// Some vertices have shading normals.
    pub normals: bool,
    /// Some shading normals differ from the geometric ones: those of vertices or of maps.
    pub bent_normals: bool,
    /// Some textures depend on how much of a surface a path sees.
    pub footprints: bool,
    /// Light passes through solids.
    pub media: bool,
    /// Some of them absorb it and do nothing else.
    pub absorption: bool,
    /// Some medium scatters or shines, or ends where no surface is.
    pub scattering: bool,
    /// Some medium scatters within a solid that has a surface.
    pub walks: bool,
    /// Some solids displace others wherever they overlap.
    pub priorities: bool,
    /// The surfaces of some solids lie on those of others.
    pub touching: bool,
    /// Some media end where no surface is.
    pub boundaries: bool,
    /// Several media may fill one place together.
    pub overlaps: bool,
    /// Rays that see the environment.
    pub environment_visible_to: RayKinds,
    /// Do cameras see another environment than what lights the scene?
    pub camera_environment: bool,
    /// Objects or lights are visible to some kinds of rays only, the camera's aside.
    pub ray_kinds: bool,
    /// Lights are linked to some objects only.
    pub links: bool,
    /// Some objects cut holes into pictures.
    pub holdouts: bool,
    /// Of some objects cameras see only what others change on them.
    pub catchers: bool,
}

impl Features {
    /// With lights that light some kinds of rays only, or some objects only.
    pub(super) fn with_lights(self, some_kinds: bool, links: bool) -> Features {
        let ray_kinds = self.ray_kinds || some_kinds || links;
        // What casts no shadows in the light of some is absent for their shadow rays.
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
    pub fn kinds_of_light(&self, index: u32) -> RayKinds {
        self.light_kinds.get(index as usize).copied().unwrap_or(RayKinds::ALL)
    }

    /// The spectrum of light `index`, where pictures are rendered by wavelength and it shines the same everywhere and not white.
    #[inline]
    pub fn spectrum_of_light(&self, index: u32) -> Option<&Spectrum> {
        self.light_spectra.get(index as usize).and_then(Option::as_deref)
    }

    /// Is light `index` left out where the effect of objects on shadow catchers is told?
    pub fn is_caught_light(&self, index: u32) -> bool {
        self.caught_lights.get(index as usize).is_some_and(|&is_caught| is_caught)
    }

    /// The material of the scene that a compiled one stands for.
    pub fn described_material(&self, material: u32) -> u32 {
        let copy = material.checked_sub(self.own_materials);
        copy.map_or(material, |copy| self.originals[copy as usize].0)
    }

    /// The object of the scene at a hit.
    pub fn object_at(&self, hit: &Hit) -> ObjectId {
        self.geometries.object(hit)
    }

    /// What another moment may have in common with this one.
    pub(super) fn into_kept(self, scene: &Scene) -> Kept {
        let CompiledScene { accel, geometries, textures, lights, sources, .. } = self;
        match sources {
            Some(sources) => Kept::of(sources, (accel, geometries), textures, lights, scene),
            None => Kept::default(),
        }
    }
}
