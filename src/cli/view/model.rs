//! The scene that is viewed: loaded, compiled, and brought to what the pages want.

use super::ViewArgs;
use crate::cli::environment::EnvironmentOverride;
use crate::cli::page::{Facts, Look, Pose, Wish, own_command};
use crate::cli::settings::{choices, png};
use crate::cli::shot::{load_options, load_scene};
use crate::cli::{scene_path, terms};
use oscura::compile::{CompileReport, CompiledScene, Compiler, View};
use oscura::error::{Error, Result, Warning};
use oscura::film::Aov;
use oscura::load::Loaded;
use oscura::math::DVec3;
use oscura::output::PngOptions;
use oscura::render::{CancelHandle, Settled};
use oscura::scene::{Camera, Environment, instance_extents, scene_extent};
use std::sync::Arc;

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
    compiler: Compiler,
    triangles: u64,
    notes: Vec<String>,
    /// Which wish for loading it follows.
    loads: u64,
    /// How the environment was turned when it was loaded, degrees.
    own_rotation: Option<f64>,
    rotation: Option<f64>,
}

impl Model {
    /// Loads and compiles the scene.
    ///
    /// # Errors
    /// As `oscura render` does.
    pub fn load(args: &ViewArgs, cancel: &CancelHandle) -> Result<Model> {
        let args = &args.picture;
        scene_path::check(&args.scene)?;
        let environment = EnvironmentOverride::load(args)?;
        let mut loaded = load_scene(args, cancel, &load_options(args)?)?;
        terms::in_loaded(&mut loaded);
        let mut warnings = std::mem::take(&mut loaded.warnings);
        warnings.extend(environment.apply(args, &mut loaded.scene));
        let settled = choices(args).settle(&loaded.scene)?;
        let is_stage_lit = loaded.turntable.is_some_and(|table| table.is_stage_lit());
        args.place.apply(&mut loaded.scene, settled.camera.unwrap_or(0), args.stage.fov)?;
        let camera = settled.camera(&loaded.scene)?.clone();
        let mut compiler = Compiler::sequence();
        let (compiled, report) = compile(&mut compiler, &loaded, &settled, &camera)?;
        warnings.extend(report.warnings.iter().cloned());
        let notes = loaded.notes.iter().chain(&warnings).map(Warning::to_string).collect();
        let own_rotation = rotation(&loaded.scene.environment);
        Ok(Model {
            png: png(args, settled.exposure, is_stage_lit),
            samples: args.spp.unwrap_or(SAMPLES),
            loaded,
            settled,
            compiled,
            compiler,
            triangles: report.triangles,
            notes,
            loads: 0,
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
        Ok(Wish { pose, camera, size, rotation: None, aov: None, loads: 0 })
    }

    pub fn look(&self) -> Look {
        Look { png: self.png, aov: None }
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
            passes: Aov::ALL.iter().map(|aov| (aov.info().option, aov.info().about)).collect(),
            notes: self.notes.clone(),
            is_live: true,
            command: own_command(),
        }
    }

    /// The scene's cameras.
    pub fn poses(&self) -> Vec<Pose> {
        let scene = &self.loaded.scene;
        let bounds = scene_extent(scene, &instance_extents(scene)).0;
        let (low, high) = bounds.unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
        let pose = |camera: &Camera| {
            let eye = camera.world_from_camera.translation;
            let ahead = camera.world_from_camera.transform_vector3(DVec3::NEG_Z);
            let distance = (0.5 * (low + high) - eye).dot(ahead);
            // A camera within the scene may look away from its middle.
            let distance = if distance > 0.0 { distance } else { 0.5 * low.distance(high).max(1e-3) };
            Pose::new(camera.clone(), distance)
        };
        scene.cameras.iter().map(pose).collect()
    }

    /// Brings it to what is wanted. Gives what pages tell about the scene if that has changed.
    ///
    /// # Errors
    /// As [`Model::load`]; it is then as it was.
    pub fn follow(&mut self, args: &ViewArgs, wish: &Wish) -> Result<Option<Facts>> {
        let is_fresh = wish.loads != self.loads;
        if is_fresh {
            // Whatever comes of it, it was tried.
            self.loads = wish.loads;
            *self = Model { loads: wish.loads, ..Model::load(args, &CancelHandle::new())? };
        }
        let camera = wish.pose.camera();
        let view = View::new(&self.compiled, camera, wish.size.0, wish.size.1);
        if self.turn(wish) || view.needs_new_anchor(&self.compiled) {
            self.compiled = compile(&mut self.compiler, &self.loaded, &self.settled, camera)?.0;
        }
        Ok(is_fresh.then(|| self.facts(args)))
    }

    /// Turns the environment. Returns whether anything changed.
    fn turn(&mut self, wish: &Wish) -> bool {
        let wanted = wish.rotation.or(self.own_rotation);
        if wanted == self.rotation {
            return false;
        }
        self.rotation = wanted;
        if let (Environment::Image { rotation_rad, .. }, Some(degrees)) =
            (&mut self.loaded.scene.environment, wanted)
        {
            *rotation_rad = degrees.to_radians();
        }
        true
    }
}

fn rotation(environment: &Environment) -> Option<f64> {
    match environment {
        Environment::Image { rotation_rad, .. } => Some(rotation_rad.to_degrees()),
        _ => None,
    }
}

fn compile(
    compiler: &mut Compiler,
    loaded: &Loaded,
    settled: &Settled,
    camera: &Camera,
) -> Result<(Arc<CompiledScene>, CompileReport)> {
    compiler.set_tree(settled.tree(1));
    let size = (settled.options.width, settled.options.height);
    compiler.compile(&loaded.scene, settled.shading, camera, size)
}
