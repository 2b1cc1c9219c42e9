//! What files say about how a picture was made.

use super::options::RenderOptions;
use super::rendering::Rendering;
use super::statistics::Statistics;
use crate::compile::CompiledScene;
use crate::error::Warning;
use crate::math::DVec3;
use crate::output::{Metadata, OutputOptions, PngOptions};
use crate::scene::RayKinds;
use std::time::SystemTime;

/// Are pictures for looking at to be transparent where nothing is? Only where that is asked for: by an environment that
/// cameras don't see, by transparent glass, holdouts or shadow catchers. Others stand before black; EXRs have alpha always.
pub fn shows_alpha(scene: &CompiledScene, options: &RenderOptions) -> bool {
    let features = &scene.features;
    let is_hidden = !features.environment_visible_to.contains(RayKinds::CAMERA);
    is_hidden || features.catchers || features.holdouts || options.transparent_glass
}

impl Rendering {
    /// How [`Rendering::save`] writes the picture so far.
    pub fn output_options(&self) -> OutputOptions {
        self.options_with(&self.warnings())
    }

    pub(super) fn options_with(&self, warnings: &[Warning]) -> OutputOptions {
        let statistics = self.statistics();
        let stopped_by = match statistics {
            Statistics { interrupted: true, .. } => Some("cancelled"),
            Statistics { timed_out: true, .. } => Some("time limit"),
            _ => None,
        };
        let metadata = Metadata {
            samples: statistics.samples_per_pixel,
            seed: self.options.seed,
            owner: None,
            render_s: Some(statistics.render_s),
            captured: Some(SystemTime::now()),
            world_to_camera: Some(self.view.camera_from_world),
            world_to_ndc: self.view.ndc_from_world,
            pixel_aspect: Some(self.view.pixel_aspect),
            aov_space: self.options.aov_space,
            denoised: self.denoised.clone(),
            mattes: self.labels.mattes.clone(),
            world_offset: Some(self.world_offset).filter(|o| *o != DVec3::ZERO),
            stopped_by: stopped_by.map(str::to_string),
            warnings: warnings.iter().map(Warning::to_string).collect(),
        };
        OutputOptions {
            png: PngOptions {
                exposure: self.look.exposure,
                view: self.look.view.clone(),
                white_balance: self.look.white_balance,
                opaque: !shows_alpha(&self.scene, &self.options),
                ..PngOptions::default()
            },
            metadata,
            ..OutputOptions::default()
        }
    }
}
