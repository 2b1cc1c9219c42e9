//! The scene as the user described it, as plain data: no behaviour, no files. Loaders fill it, the renderer reads it.
//!
//! Everything is public: load a scene and change it, or build one in code.
//!
//! ```
//! use oscura::scene::{Camera, Environment, Material, Scene, Shape};
//! let mut scene = Scene::default();
//! let clay = scene.add_material(Material::lambert("clay", [0.6, 0.3, 0.2]));
//! scene.shapes.push(Shape::sphere([0.0, 1.0, 0.0], 1.0, clay));
//! scene.environment = Environment::Constant([1.0; 3]);
//! scene.cameras.push(Camera::look_at([0.0, 2.0, 6.0], [0.0, 1.0, 0.0], 30.0));
//! let picture = oscura::Renderer::new(scene).size(16, 16).samples(4).render()?;
//! assert!(picture.film().mean_rgba(8, 8)[0] > picture.film().mean_rgba(8, 8)[2]);
//! # Ok::<(), oscura::Error>(())
//! ```

mod bounds;
mod camera;
mod construct;
mod geometry;
mod ids;
mod light;
mod material;
mod medium;
pub mod nodes;
mod object_traits;
mod settings;
mod slot;
mod texture;
mod validate;
mod watertightness;

pub use bounds::{Extent, MeshHulls, instance_extents, scene_extent};
pub use camera::{Aperture, Camera, Panorama, Projection, ThinLens, looking_at};
pub use geometry::{
    CurveBasis, Curves, Instance, Keyframes, Mesh, MeshPart, Motion, Quad, SceneMotion, Shape, ShapeKind,
    ShapeTag, Splats, VertexAttribute, Vertices, f16,
};
pub use ids::{GridId, ImageId, MaterialId, MeshId, ProfileId, TextureId};
pub use light::{
    Backdrop, DEFAULT_GROUP, Environment, GROUP_KEY, Light, LightKind, LightProfile, Portal, SpotFade,
    group_or_default, is_group_name,
};
pub use material::{
    AlphaMode, Anisotropy, Beam, Clearcoat, DiffuseTransmission, Displacement, Emission, EmitterTraits,
    EnergyCompensation, FresnelModel, GlassReflection, Iridescence, Material, MixComponent, Model,
    PbrMaterial, Sheen, SubsurfaceEntry, Transmission, hair_color, hair_color_scale,
};
pub use medium::{EmissionGrid, Fog, Grid, Medium, MediumTextures, coefficients};
pub use object_traits::{LightLinks, Link, ObjectInfo, ObjectSet, ObjectSets, ObjectTraits, RayKinds};
pub use settings::{
    BounceLimits, CatcherOutput, Clamp, Filter, Settings, ShadingModel, ShadowTerminator, SkippedCaustics,
};
pub use slot::{ColorSlot, FloatSlot, NormalMap, Parameter, ParameterMut, Parameters};
pub use texture::{Interpolation, MAX_TEXTURE_NESTING, Mapping, NoiseKind, Texture, TextureTransform, Wrap};
pub use watertightness::{MaterialUses, Watertightness};
pub(crate) use watertightness::{encloses, has_no_border};

use crate::image::Image;
use std::sync::Arc;

/// Everything that a picture is made of.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Where it came from, for reports.
    pub name: String,
    /// Triangle meshes in their own space; placed by `instances`.
    pub meshes: Vec<Mesh>,
    /// Placed meshes.
    pub instances: Vec<Instance>,
    /// Analytic spheres, disks and the like.
    pub shapes: Vec<Shape>,
    /// Analytic parallelograms.
    pub quads: Vec<Quad>,
    /// Hair and other curves.
    pub curves: Vec<Curves>,
    /// Materials, by [`MaterialId`].
    pub materials: Vec<Material>,
    /// Textures, by [`TextureId`].
    pub textures: Vec<Texture>,
    /// Images, by [`ImageId`]. Large ones that only textures use may still be [encoded](crate::image::Pixels::Encoded).
    pub images: Vec<Image>,
    /// Grids of densities, by [`GridId`].
    pub grids: Vec<Grid>,
    /// Profiles of lights with a surface, by [`ProfileId`].
    pub profiles: Vec<Arc<LightProfile>>,
    /// Point, spot and directional lights.
    pub lights: Vec<Light>,
    /// Radiance of rays that hit nothing.
    pub environment: Environment,
    /// The environment that camera rays see instead.
    pub camera_environment: Option<Environment>,
    /// The medium around all solids.
    pub fog: Option<Fog>,
    /// Which rays see the environment. Where those of the camera don't, pictures are transparent.
    pub environment_visible_to: RayKinds,
    /// Only paths that leave the scene find the environment's light, and no light samples: what casts shadows in it is then what
    /// the rays of these paths see, whatever shadow rays see.
    pub environment_unsampled: bool,
    /// Backdrop of transparent pixels.
    pub backdrop: Option<Backdrop>,
    /// The environment's group of lights; empty for the default one.
    pub environment_group: String,
    /// Openings through which light of the environment is looked for.
    pub portals: Vec<Portal>,
    /// Which of the lights, a [`LightKind::Sun`], is the environment's sun: unlike other suns cameras see it, if they see the
    /// environment.
    pub environment_sun: Option<u32>,
    /// Cameras found; the first is used unless the user chooses another.
    pub cameras: Vec<Camera>,
    /// Which objects move while the picture is taken.
    pub motion: SceneMotion,
    /// Render settings of the scene; the command line may override each.
    pub settings: Settings,
}
