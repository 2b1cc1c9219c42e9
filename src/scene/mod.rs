//! The scene description: plain data, created by loaders or in code and read by the renderer. All of it is public.
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
pub use camera::{Aperture, Camera, Panorama, Projection, ThinLens, looking_at, without_scale};
pub use geometry::{
    CurveBasis, Curves, Instance, Keyframes, Mesh, MeshPart, Motion, Quad, SceneMotion, Shape, ShapeKind,
    Splats, VertexAttribute, Vertices, f16,
};
pub use ids::{GridId, ImageId, MaterialId, MeshId, ProfileId, TextureId};
pub use light::{
    Backdrop, DEFAULT_GROUP, Environment, GROUP_KEY, Light, LightKind, LightProfile, Portal, SpotFalloff,
    group_or_default, is_group_name,
};
pub use material::{
    AlphaMode, Anisotropy, Beam, Clearcoat, DiffuseTransmission, Displacement, DisplacementKind, Emission,
    EmitterTraits, EnergyCompensation, FresnelModel, GlassReflection, Iridescence, Material, MixComponent,
    Model, PbrMaterial, Sheen, SubsurfaceEntry, Transmission, hair_color, hair_color_scale,
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

/// A scene description.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Name in reports.
    pub name: String,
    /// Triangle meshes in object space; placed by `instances`.
    pub meshes: Vec<Mesh>,
    /// Instances of meshes.
    pub instances: Vec<Instance>,
    /// Analytic spheres, disks etc.
    pub shapes: Vec<Shape>,
    /// Analytic parallelograms.
    pub quads: Vec<Quad>,
    /// Hair and other curves.
    pub curves: Vec<Curves>,
    /// Materials, by [`MaterialId`].
    pub materials: Vec<Material>,
    /// Textures, by [`TextureId`].
    pub textures: Vec<Texture>,
    /// Images, by [`ImageId`]. Those used only by textures may be [encoded](crate::image::Pixels::Encoded).
    pub images: Vec<Image>,
    /// Voxel grids of media, by [`GridId`].
    pub grids: Vec<Grid>,
    /// Profiles of area lights, by [`ProfileId`].
    pub profiles: Vec<Arc<LightProfile>>,
    /// Point, spot and directional lights.
    pub lights: Vec<Light>,
    /// Radiance of rays that leave the scene.
    pub environment: Environment,
    /// Separate environment for camera rays.
    pub camera_environment: Option<Environment>,
    /// The medium outside all solids.
    pub fog: Option<Fog>,
    /// Ray kinds that the environment is visible to. Without camera rays, the background is transparent.
    pub environment_visible_to: RayKinds,
    /// The environment is not sampled as a light: it contributes only through scattered rays that leave the scene. Visibility to
    /// their ray kinds, not to shadow rays, then determines its shadows.
    pub environment_bsdf_only: bool,
    /// Backdrop of transparent pixels.
    pub backdrop: Option<Backdrop>,
    /// Light group of the environment; empty for the default group.
    pub environment_group: String,
    /// Openings that guide the sampling of environment light.
    pub portals: Vec<Portal>,
    /// Index in `lights` of the environment's sun, a [`LightKind::Sun`]. Unlike other suns, it is visible to the camera if the
    /// environment is.
    pub environment_sun: Option<u32>,
    /// Cameras; the first is the default.
    pub cameras: Vec<Camera>,
    /// Motion of objects during the exposure.
    pub motion: SceneMotion,
    /// Render settings; the command line overrides them.
    pub settings: Settings,
}
