//! Reuse of textures, environment and geometry between frames of a sequence, by fingerprints of their inputs.

use super::build_geometry::{self, SceneGeometry};
use super::geometry::Geometries;
use super::limits;
use super::material::CompiledMaterial;
use super::plan::{BvhPolicy, GeometryKeys, Plan};
use crate::accel::{self, Accel, AccelInput, Reuse, TooLarge};
use crate::error::Result;
use crate::image::Image;
use crate::light::{EnvironmentLight, Lights};
use crate::math::DVec3;
use crate::scene::{Environment, Scene, Texture};
use crate::texture::CompiledTextures;
use crate::work_counter::WorkCounter;
use std::sync::Arc;

/// Inputs of a compiled scene, to determine which results the next frame may reuse.
pub(super) struct Sources {
    keys: Option<GeometryKeys>,
    textures: Vec<Texture>,
    images: Vec<Image>,
    environment: Environment,
}

impl Sources {
    pub fn of(scene: &Scene, plan: &Plan) -> Sources {
        Sources {
            keys: plan.keys.clone(),
            textures: scene.textures.clone(),
            images: scene.images.clone(),
            environment: scene.environment.clone(),
        }
    }

    /// May the next frame reuse geometry?
    pub fn keep_geometry(&self) -> bool {
        self.keys.is_some()
    }

    fn has_images_of(&self, scene: &Scene) -> bool {
        self.images.len() == scene.images.len()
            && self.images.iter().zip(&scene.images).all(|(a, b)| {
                Arc::ptr_eq(&a.pixels, &b.pixels)
                    && (a.width, a.height, a.channels, a.encoding)
                        == (b.width, b.height, b.channels, b.encoding)
            })
    }
}

/// Results of the previous frame that a frame may reuse.
#[derive(Default)]
pub(super) struct Reusable {
    /// The compiled textures, if unchanged.
    pub textures: Option<CompiledTextures>,
    /// The environment, if unchanged; `Some(None)` for no environment.
    pub environment: Option<Option<EnvironmentLight>>,
    geometry: Option<(Accel, Geometries, GeometryKeys)>,
}

/// Geometry and its BVH.
pub(super) struct BuiltGeometry {
    pub geometries: Geometries,
    pub accel: Accel,
}

impl Reusable {
    /// The results of the previous frame, compiled from `sources`, that `scene` may reuse.
    pub fn of(
        sources: Sources,
        (accel, geometries): (Accel, Geometries),
        textures: CompiledTextures,
        lights: Lights,
        scene: &Scene,
    ) -> Reusable {
        let same_images = sources.has_images_of(scene);
        let same_textures = same_images && sources.textures == scene.textures;
        let same_environment = same_images && sources.environment == scene.environment;
        Reusable {
            textures: same_textures.then_some(textures),
            environment: same_environment.then(|| lights.into_environment()),
            geometry: sources.keys.map(|keys| (accel, geometries, keys)),
        }
    }

    /// The geometry of a scene, with unchanged parts of the previous frame.
    pub fn geometry(
        &mut self,
        scene: &Scene,
        materials: &[CompiledMaterial],
        origin: DVec3,
        plan: &Plan,
        bvh: (BvhPolicy, &WorkCounter),
    ) -> Result<BuiltGeometry> {
        let earlier = self.geometry.take();
        let (reuse, reused, accel) = match (earlier, &plan.keys) {
            (Some((accel, geometries, before)), Some(now)) if before.shared == now.shared => {
                let Geometries { world, mut shared, .. } = geometries;
                shared.truncate(now.shared.len());
                let is_same = before.world == now.world;
                let reuse = if is_same { Reuse::World } else { Reuse::Shared };
                (reuse, build_geometry::ReusedSpaces { world: is_same.then_some(world), shared }, Some(accel))
            }
            _ => (Reuse::Nothing, build_geometry::ReusedSpaces::default(), None),
        };
        let scene_geometry = build_geometry::build_geometry(scene, materials, origin, plan, reused)?;
        let accel = build(&scene_geometry, plan, bvh, reuse, accel).map_err(limits::too_large)?;
        Ok(BuiltGeometry { geometries: scene_geometry.geometries, accel })
    }
}

fn build(
    scene_geometry: &SceneGeometry,
    plan: &Plan,
    (bvh, counter): (BvhPolicy, &WorkCounter),
    reuse: Reuse,
    earlier: Option<Accel>,
) -> std::result::Result<Accel, TooLarge> {
    let Geometries { world, shared, .. } = &scene_geometry.geometries;
    let geometries: Vec<&accel::Geometry> = [world].into_iter().chain(shared).map(|s| &s.shapes).collect();
    let triangles = geometries.iter().map(|g| (g.triangles.len() + g.curves.len()) as u64).sum();
    let input = AccelInput {
        geometries: &geometries,
        instances: &scene_geometry.instances,
        first_moving: scene_geometry.first_moving,
        // Geometry 0 is the world.
        first_changing: plan.first_deforming + 1,
        moving: &scene_geometry.moving,
        quality: bvh.quality(triangles),
        counter: Some(counter),
    };
    match earlier {
        Some(earlier) => earlier.rebuild(reuse, &input),
        None => Accel::try_build(&input),
    }
}
