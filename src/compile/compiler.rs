//! Moments of a sequence, each compiled from what it has in common with the one before.

use super::bake::{self, Baked};
use super::geometry::Geometries;
use super::material::CompiledMaterial;
use super::plan::{Keys, Plan};
use super::{CompileOptions, CompileReport, CompiledScene, View, compile_after, input_error};
use crate::accel::{self, Accel, AccelInput, BuildOptions, Reuse};
use crate::error::Result;
use crate::image::Image;
use crate::light::EnvironmentLight;
use crate::math::DVec3;
use crate::scene::{Camera, EnergyCompensation, Environment, Scene, Texture};
use crate::texture::CompiledTextures;
use std::sync::Arc;

/// Most triangles that the accelerator can address.
const MAX_TRIANGLES: usize = 400_000_000;

/// Compiles the moments of a sequence one after another. What does not change is compiled once: textures, the environment,
/// and in scenes of many triangles the world that stands still and the meshes that move in it as they are. Only what moves is
/// placed anew then, and meshes that change their shape are built. (Where something moves, pictures of such scenes may
/// differ from single ones by rounding: a single picture has all in one world.)
#[derive(Default)]
pub struct Compiler {
    latest: Option<CompiledScene>,
}

impl Compiler {
    /// One without a moment yet.
    pub fn new() -> Compiler {
        Compiler::default()
    }

    /// Compiles a moment and the view of a camera on a picture of `width` x `height` pixels. The anchor stays where it was
    /// as long as single precision suffices for the camera.
    ///
    /// # Errors
    /// As for [`super::compile`].
    pub fn compile(
        &mut self,
        scene: &Scene,
        energy_compensation: EnergyCompensation,
        camera: &Camera,
        (width, height): (u32, u32),
    ) -> Result<(&CompiledScene, View, CompileReport)> {
        let suits = |s: &&CompiledScene| {
            let keeps = s.sources.as_ref().is_some_and(|sources| sources.keys.is_some());
            keeps && !View::new(s, camera, width, height).needs_new_anchor(s)
        };
        let earlier = self.latest.take();
        let anchor = earlier.as_ref().filter(suits).map(|s| s.anchor);
        let anchor = Some(anchor.unwrap_or(camera.world_from_camera.translation));
        let options = CompileOptions { energy_compensation, anchor };
        let (compiled, report) = compile_after(earlier, scene, &options, true)?;
        let view = View::new(&compiled, camera, width, height);
        Ok((self.latest.insert(compiled), view, report))
    }
}

/// What a compiled scene was made of, as far as another moment may have it in common.
pub(super) struct Sources {
    keys: Option<Keys>,
    textures: Vec<Texture>,
    images: Vec<Image>,
    environment: Environment,
}

impl Sources {
    /// Those of a scene.
    pub fn of(scene: &Scene, plan: &Plan) -> Sources {
        Sources {
            keys: plan.keys.clone(),
            textures: scene.textures.clone(),
            images: scene.images.clone(),
            environment: scene.environment.clone(),
        }
    }

    fn has_images_of(&self, scene: &Scene) -> bool {
        self.images.len() == scene.images.len()
            && self.images.iter().zip(&scene.images).all(|(a, b)| {
                Arc::ptr_eq(&a.pixels, &b.pixels)
                    && (a.width, a.height, a.channels, a.encoding) == (b.width, b.height, b.channels, b.encoding)
            })
    }
}

/// What is left of an earlier moment for another one.
#[derive(Default)]
pub(super) struct Kept {
    /// The same textures.
    pub textures: Option<CompiledTextures>,
    /// The same environment, if there is one at all.
    pub environment: Option<Option<EnvironmentLight>>,
    geometry: Option<(Accel, Geometries, Keys)>,
}

/// What rays meet.
pub(super) struct Geometry {
    pub geometries: Geometries,
    pub accel: Accel,
}

impl Kept {
    /// What an earlier moment may have in common with a scene.
    pub fn of(earlier: Option<CompiledScene>, scene: &Scene) -> Kept {
        let Some(earlier) = earlier else { return Kept::default() };
        let CompiledScene { accel, geometries, textures, lights, sources, .. } = earlier;
        let Some(sources) = sources else { return Kept::default() };
        let same_images = sources.has_images_of(scene);
        let same_textures = same_images && sources.textures == scene.textures;
        let same_environment = same_images && sources.environment == scene.environment;
        Kept {
            textures: same_textures.then_some(textures),
            environment: same_environment.then(|| lights.into_environment()),
            geometry: sources.keys.map(|keys| (accel, geometries, keys)),
        }
    }

    /// The geometry of a scene, as much of it as can be from the earlier moment.
    pub fn geometry(
        &mut self,
        scene: &Scene,
        materials: &[CompiledMaterial],
        origin: DVec3,
        plan: &Plan,
    ) -> Result<Geometry> {
        let earlier = self.geometry.take();
        let (reuse, kept, accel) = match (earlier, &plan.keys) {
            (Some((accel, geometries, before)), Some(now)) if before.shared == now.shared => {
                let Geometries { world, mut shared, .. } = geometries;
                shared.truncate(now.shared.len());
                let is_same = before.world == now.world;
                let reuse = if is_same { Reuse::World } else { Reuse::Shared };
                (reuse, bake::Kept { world: is_same.then_some(world), shared }, Some(accel))
            }
            _ => (Reuse::Nothing, bake::Kept::default(), None),
        };
        let baked = bake::bake(scene, materials, origin, plan, kept);
        check_size(&baked.geometries)?;
        let accel = build(&baked, plan, reuse, accel);
        Ok(Geometry { geometries: baked.geometries, accel })
    }
}

fn build(baked: &Baked, plan: &Plan, reuse: Reuse, earlier: Option<Accel>) -> Accel {
    let Geometries { world, shared, .. } = &baked.geometries;
    let geometries: Vec<&accel::Geometry> = [world].into_iter().chain(shared).map(|s| &s.shapes).collect();
    let input = AccelInput {
        geometries: &geometries,
        instances: &baked.instances,
        first_moving: baked.first_moving,
        // The world counts, too.
        first_changing: plan.first_changing + 1,
    };
    match earlier {
        Some(earlier) => earlier.rebuild(reuse, &input, &BuildOptions::default()),
        None => Accel::build_parts(&input, &BuildOptions::default()),
    }
}

fn check_size(geometries: &Geometries) -> Result<()> {
    let spaces = geometries.shared.iter().chain([&geometries.world]);
    let triangles: usize = spaces.map(|space| space.shapes.triangles.len()).sum();
    if triangles > MAX_TRIANGLES {
        return Err(input_error(format!("{triangles} triangles are more than the {MAX_TRIANGLES} possible")));
    }
    Ok(())
}
