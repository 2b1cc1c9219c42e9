//! Resolves options: from a user's choices, the scene's settings and the defaults.

use super::options::{RenderOptions, TreeChoice};
use crate::color::ViewTransform;
use crate::compile::{Tree, choose_camera};
use crate::error::{Error, Result};
use crate::film::{Aov, AovSet};
use crate::scene::{Camera, Scene, Settings, ShadingModel};

const DEFAULT_ASPECT: f64 = 16.0 / 9.0;
/// Maximum number of pixels of a picture, of which parts may be rendered alone. Memory is another limit, which the machine knows.
const PIXEL_LIMIT: u64 = u32::MAX as u64;

/// A user's choices. What they leave open the scene decides; then the defaults of [`RenderOptions`] hold.
#[doc(hidden)]
#[derive(Clone, Debug, Default)]
pub struct Choices {
    /// Settings that scenes have, too: these override the scene's.
    pub settings: Settings,
    /// Name or index of a camera; by default the first.
    pub camera: Option<String>,
    /// Quality of the BVH.
    pub tree: TreeChoice,
    /// All other settings. Those that scenes have are defaults.
    pub options: RenderOptions,
}

/// Everything about a picture that is decided before it is made.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct Settled {
    /// How to render.
    pub options: RenderOptions,
    /// Models that all materials share.
    pub shading: ShadingModel,
    /// Quality of the BVH.
    pub tree: TreeChoice,
    /// Index of the camera in the scene.
    pub camera: Option<usize>,
    /// Settings of display-referred pictures.
    pub look: Look,
}

/// Settings of display-referred pictures: PNG and other formats that are no EXR.
#[doc(hidden)]
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// Exposure, stops.
    pub exposure: f32,
    /// View transform.
    pub view: ViewTransform,
    /// White balance: colour temperature that looks white, kelvin.
    pub white_balance: Option<f32>,
}

impl Choices {
    /// Settles everything for a scene.
    ///
    /// # Errors
    /// A usage error for a camera that the scene doesn't have and for a picture with too many pixels.
    pub fn settle(&self, scene: &Scene) -> Result<Settled> {
        let camera = self.camera.as_deref().map(|wanted| find_camera(scene, wanted)).transpose()?;
        let (width, height) = self.picture_size(scene, camera.unwrap_or(0))?;
        let settings = self.settings.or(&scene.settings);
        let mut options = self.options.with_settings(&settings).size(width, height);
        options.aovs = options.aovs.union(aovs_of(&settings)?);
        options.catchers = scene.has_catchers();
        options.caught = settings.caught.unwrap_or_default();
        Ok(Settled {
            options,
            shading: settings.shading(),
            tree: self.tree,
            camera,
            look: Look {
                exposure: settings.exposure.unwrap_or(0.0),
                view: settings.view.unwrap_or_default(),
                white_balance: settings.white_balance,
            },
        })
    }

    /// Finds a size that is too large for any scene, before one is loaded.
    ///
    /// # Errors
    /// A usage error.
    pub fn check_size(&self) -> Result<()> {
        match (self.settings.width, self.settings.height) {
            (Some(width), Some(height)) => check_pixels(width, height),
            _ => Ok(()),
        }
    }

    fn picture_size(&self, scene: &Scene, camera: usize) -> Result<(u32, u32)> {
        let (chosen, from_scene) = (&self.settings, &scene.settings);
        let seen_by = scene.cameras.get(camera);
        let of_camera = seen_by.and_then(|c| c.aspect_ratio).filter(|a| *a > 0.0 && a.is_finite());
        // In pixels.
        let aspect = match (from_scene.width, from_scene.height) {
            (Some(w), Some(h)) => f64::from(w) / f64::from(h),
            _ => of_camera.unwrap_or(DEFAULT_ASPECT) / seen_by.map_or(1.0, |c| c.pixel_aspect),
        };
        // One dimension that is chosen makes the scene's other one meaningless: the aspect ratio stays.
        let size = match (chosen.width, chosen.height) {
            (None, None) => (from_scene.width, from_scene.height),
            size => size,
        };
        let rounded = |v: f64| v.round().clamp(1.0, 65_536.0) as u32;
        let (width, height) = match size {
            (Some(w), Some(h)) => (w, h),
            (Some(w), None) => (w, rounded(f64::from(w) / aspect)),
            (None, Some(h)) => (rounded(f64::from(h) * aspect), h),
            (None, None) => {
                let width = RenderOptions::default().width;
                (width, rounded(f64::from(width) / aspect))
            }
        };
        check_pixels(width, height)?;
        Ok((width, height))
    }
}

/// The AOVs that settings name.
fn aovs_of(settings: &Settings) -> Result<AovSet> {
    let all = |name: &str| (name == ALL_AOVS).then(AovSet::all);
    let set = |name: &String| all(name).map_or_else(|| name.parse::<Aov>().map(AovSet::from), Ok);
    settings.aovs.iter().flatten().try_fold(AovSet::NONE, |sum, name| Ok(sum.union(set(name)?)))
}

/// The name of all AOVs in lists of them.
pub const ALL_AOVS: &str = "all";

/// Assumed camera rays per second under a time limit: about what two cores trace of simple scenes.
const RAYS_A_SECOND: f64 = 1e6;

impl Settled {
    /// The choice of the BVH's quality, if `pictures` pictures share it.
    pub fn tree(&self, pictures: u64) -> Tree {
        let RenderOptions { width, height, samples, time_limit, .. } = self.options;
        let rays = u64::from(width) * u64::from(height) * u64::from(samples);
        let most = time_limit.map_or(u64::MAX, |limit| (limit.as_secs_f64() * RAYS_A_SECOND) as u64);
        match self.tree {
            TreeChoice::Auto => Tree::For { camera_rays: rays.min(most).saturating_mul(pictures) },
            TreeChoice::Fast => Tree::Fast,
            TreeChoice::Full => Tree::Full,
        }
    }

    /// The camera in the scene that this was settled for.
    ///
    /// # Errors
    /// An input error for a scene without a camera.
    pub fn camera<'a>(&self, scene: &'a Scene) -> Result<&'a Camera> {
        choose_camera(scene, self.camera)
    }
}

fn find_camera(scene: &Scene, wanted: &str) -> Result<usize> {
    let by_name = scene.cameras.iter().position(|c| c.name == wanted);
    let by_number = || wanted.parse().ok().filter(|&i: &usize| i < scene.cameras.len());
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<String> =
            scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} '{}'", c.name)).collect();
        Error::usage(format!("there is no camera '{wanted}'"))
            .with_help(format!("the scene has: {}", names.join(", ")))
    })
}

fn check_pixels(width: u32, height: u32) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(Error::usage(format!("a picture of {width} x {height} pixels has none")));
    }
    if u64::from(width) * u64::from(height) > PIXEL_LIMIT {
        let message = format!("{width} x {height} pixels are more than the {PIXEL_LIMIT} possible");
        return Err(Error::usage(message).with_help("give a smaller width or height"));
    }
    Ok(())
}
