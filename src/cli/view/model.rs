//! The scene that is viewed: loaded, compiled, and brought to what the pages want.

use super::ViewArgs;
use crate::cli::args::RenderArgs;
use crate::cli::environment::EnvironmentOverride;
use crate::cli::page::{Facts, Look, Pose, Wish, own_command};
use crate::cli::prepared::{Prepared, Wants, prepare};
use crate::cli::shot::{load_options, load_scene};
use crate::cli::stage_args::BackgroundArg;
use crate::cli::{limits, scene_path};
use oscura::compile::{CompiledScene, Compiler, View};
use oscura::error::{Error, Result, Warning};
use oscura::film::Aov;
use oscura::load::{LoadOptions, Loaded, SavedFiles};
use oscura::math::DVec3;
use oscura::output::PngOptions;
use oscura::render::{CancelHandle, Settled};
use oscura::scene::{Camera, Environment, Scene, instance_extents, scene_extent};
use std::sync::Arc;
use std::time::Instant;

/// Samples of a finished picture, unless the arguments say so.
const SAMPLES: u32 = 1024;
/// Most pixels that a picture has at first, unless the arguments say so.
const PIXELS: u64 = 640_000;

pub(super) struct Model {
    pub loaded: Loaded,
    pub settled: Settled,
    pub compiled: Arc<CompiledScene>,
    /// Samples of a finished picture.
    pub samples: u32,
    pub png: PngOptions,
    /// Which wish for loading it follows.
    pub loads: u64,
    compiler: Compiler,
    triangles: u64,
    notes: Vec<String>,
    /// How the environment was turned when it was loaded, degrees.
    own_rotation: Option<f64>,
    rotation: Option<f64>,
}

impl Model {
    /// Loads and compiles the scene, and has its files watched in place of those before; where that fails, besides them.
    ///
    /// # Errors
    /// As `oscura render` does.
    pub fn load(args: &ViewArgs, files: &SavedFiles, cancel: &CancelHandle) -> Result<Model> {
        let newer = SavedFiles::default();
        let model = Model::read(&args.picture, &newer, cancel);
        files.take_over(&newer, model.is_err());
        model
    }

    fn read(args: &RenderArgs, files: &SavedFiles, cancel: &CancelHandle) -> Result<Model> {
        let start = Instant::now();
        scene_path::check(&args.scene)?;
        limits::before_loading(args)?;
        args.env.iter().for_each(|path| files.note(path));
        if let Some(BackgroundArg::File(path)) = &args.stage.background {
            files.note(path);
        }
        let environment = EnvironmentOverride::load(args)?;
        let options = LoadOptions { files: files.clone(), ..load_options(args)? };
        let mut loaded = load_scene(args, cancel, &options)?;
        let mut compiler = Compiler::sequence();
        compiler.expect_other_cameras();
        let wants = Wants { has_exr: true, keeps_uv: true, pictures: 1 };
        let prepared = prepare(args, wants, Some(&environment), &mut loaded, start, &mut compiler)?;
        let Prepared { scene, settled, png, notes, warnings, build, .. } = prepared;
        let own_rotation = rotation(&loaded.scene.environment);
        Ok(Model {
            loaded,
            settled,
            compiled: scene,
            samples: args.spp.unwrap_or(SAMPLES),
            png,
            loads: 0,
            compiler,
            triangles: build.triangles,
            notes: notes.iter().chain(&warnings).map(Warning::to_string).collect(),
            own_rotation,
            rotation: own_rotation,
        })
    }

    /// What is wanted of it at first.
    pub fn wish(&self, args: &ViewArgs, facts: &Facts, poses: &[Pose]) -> Result<Wish> {
        let fits = |&&(w, h): &&(u32, u32)| u64::from(w) * u64::from(h) <= PIXELS;
        let is_chosen = args.picture.width.or(args.picture.height).is_some();
        let whole = (self.settled.options.width, self.settled.options.height);
        let size = facts.sizes.iter().rev().find(fits).filter(|_| !is_chosen).copied().unwrap_or(whole);
        let camera = self.settled.camera.unwrap_or(0);
        let pose =
            poses.get(camera).cloned().ok_or_else(|| Error::input(&args.picture.scene, "has no camera"))?;
        let rotation = self.own_rotation.and(args.picture.env_rotation);
        Ok(Wish { pose, camera, size, rotation, aov: None, loads: self.loads })
    }

    pub fn look(&self) -> Look {
        Look::new(self.png.clone())
    }

    /// What pages tell about it.
    pub fn facts(&self, args: &ViewArgs) -> Facts {
        let (w, h) = (self.settled.options.width, self.settled.options.height);
        let part = |share: u32| ((w / share).max(1), (h / share).max(1));
        let name = args.picture.scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let camera = |(i, camera): (usize, &Camera)| match camera.name.as_str() {
            "" => format!("Camera {i}"),
            name => name.to_string(),
        };
        Facts {
            name,
            cameras: self.loaded.scene.cameras.iter().enumerate().map(camera).collect(),
            triangles: self.triangles,
            sizes: [4, 2, 1].map(part).to_vec(),
            rotation: self.own_rotation,
            samples: self.samples,
            passes: self.passes(),
            notes: self.notes.clone(),
            is_live: true,
            command: own_command(),
        }
    }

    /// What can be shown. Where things go to is known only if that was asked for when they were loaded.
    fn passes(&self) -> Vec<(&'static str, &'static str)> {
        let knows_motion = self.settled.options.aovs.contains(Aov::Motion);
        let shown = Aov::ALL.iter().filter(|aov| knows_motion || **aov != Aov::Motion);
        shown.map(|aov| (aov.info().option, aov.info().about)).collect()
    }

    /// The scene's cameras.
    pub fn poses(&self, args: &ViewArgs) -> Vec<Pose> {
        let scene = &self.loaded.scene;
        let bounds = scene_extent(scene, &instance_extents(scene)).0;
        let (low, high) = bounds.unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
        let chosen = self.settled.camera.unwrap_or(0);
        let pose = |(number, camera): (usize, &Camera)| {
            let eye = camera.world_from_camera.translation;
            let ahead = camera.world_from_camera.transform_vector3(DVec3::NEG_Z);
            let distance = (0.5 * (low + high) - eye).dot(ahead);
            // A camera within the scene may look away from its middle.
            let distance = if distance > 0.0 { distance } else { 0.5 * low.distance(high).max(1e-3) };
            let pose = Pose::new(camera.clone(), distance);
            match number == chosen {
                true => pose.with_arguments(&args.picture.place, args.picture.stage.fov),
                false => pose,
            }
        };
        scene.cameras.iter().enumerate().map(pose).collect()
    }

    /// Loads the scene again, as the wish of a number asks for.
    ///
    /// # Errors
    /// As [`Model::load`]; it is then as it was.
    pub fn reload(
        &mut self,
        args: &ViewArgs,
        files: &SavedFiles,
        cancel: &CancelHandle,
        loads: u64,
    ) -> Result<()> {
        // Whatever comes of it, it was tried.
        self.loads = loads;
        *self = Model { loads, ..Model::load(args, files, cancel)? };
        Ok(())
    }

    /// Brings it to what is wanted.
    ///
    /// # Errors
    /// As compiling has them; it is then as it was.
    pub fn follow(&mut self, wish: &Wish) -> Result<()> {
        let camera = wish.pose.camera();
        let wanted = wish.rotation.or(self.own_rotation);
        let view = View::new(&self.compiled, camera, wish.size.0, wish.size.1);
        if wanted == self.rotation && !view.needs_new_anchor(&self.compiled) {
            return Ok(());
        }
        turn(&mut self.loaded.scene, wanted);
        let size = (self.settled.options.width, self.settled.options.height);
        match self.compiler.compile(&self.loaded.scene, self.settled.shading, camera, size) {
            Ok((compiled, _)) => (self.compiled, self.rotation) = (compiled, wanted),
            Err(error) => {
                turn(&mut self.loaded.scene, self.rotation);
                return Err(error);
            }
        }
        Ok(())
    }
}

/// Turns an environment's picture to an angle, degrees.
fn turn(scene: &mut Scene, wanted: Option<f64>) {
    if let Some(degrees) = wanted {
        scene.turn_environment(degrees.to_radians());
    }
}

fn rotation(environment: &Environment) -> Option<f64> {
    match environment {
        Environment::Image { rotation_rad, .. } => Some(rotation_rad.to_degrees()),
        _ => None,
    }
}
