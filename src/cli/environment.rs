//! The environment as the arguments ask for it, in place of the scene's.

use super::args::RenderArgs;
use oscura::error::{Result, Warning};
use oscura::image::Image;
use oscura::load::image::load_environment;
use oscura::scene::{Environment, ImageId, Scene};

/// What `--env` brings, read once for all pictures of a sequence.
pub(crate) struct EnvironmentOverride {
    image: Option<Image>,
    warnings: Vec<Warning>,
}

impl EnvironmentOverride {
    /// Reads the picture that the arguments name, if any.
    ///
    /// # Errors
    /// An input error if it can't be read.
    pub fn load(args: &RenderArgs) -> Result<EnvironmentOverride> {
        let mut warnings = Vec::new();
        let path = args.env.as_ref().filter(|path| !path.as_os_str().is_empty());
        let image = path.map(|path| load_environment(path, &mut warnings)).transpose()?;
        Ok(EnvironmentOverride { image, warnings })
    }

    /// Replaces or adjusts a scene's environment; gives all warnings about it.
    pub fn apply(&self, args: &RenderArgs, scene: &mut Scene) -> Vec<Warning> {
        let mut warnings = self.warnings.clone();
        if args.env.is_some() {
            scene.scale_environment_sun(0.0);
            scene.environment_sun = None;
            scene.environment_unsampled = false;
            scene.camera_environment = None;
        }
        if let Some(image) = &self.image {
            scene.images.push(image.clone());
            let image = ImageId((scene.images.len() - 1) as u32);
            scene.environment = Environment::Image { image, strength: 1.0, rotation_rad: 0.0 };
        } else if args.env.is_some() {
            scene.environment = Environment::Black;
        }
        let factor = args.env_strength;
        match &mut scene.environment {
            Environment::Image { strength, .. } => {
                let before = *strength;
                *strength = factor.unwrap_or(before);
                let ratio = if before > 0.0 { *strength / before } else { 1.0 };
                scene.scale_environment_sun(ratio);
                if let Some(degrees) = args.env_rotation {
                    scene.turn_environment(degrees.to_radians());
                }
                return warnings;
            }
            Environment::Constant(color) => *color = color.map(|v| v * factor.unwrap_or(1.0)),
            Environment::Gradient { nadir, zenith } => {
                *nadir = nadir.map(|v| v * factor.unwrap_or(1.0));
                *zenith = zenith.map(|v| v * factor.unwrap_or(1.0));
            }
            Environment::Black if factor.is_some() => {
                warnings.push(Warning::general("--env-strength has no effect: there is no environment"));
            }
            Environment::Black => {}
        }
        if args.env_rotation.is_some() {
            warnings.push(Warning::general("--env-rotation has no effect: there is no environment picture"));
        }
        warnings
    }
}
