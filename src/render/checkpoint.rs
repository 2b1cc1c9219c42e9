//! Checkpoints and partial renders: the identity of a picture, writing the film's sums, and resuming.

use super::error_estimate::ErrorEstimate;
use super::options::ResolvedOptions;
use super::path_strategy::{PathStrategy, StrategyTrials};
use super::progress::Spent;
use super::rendering::Rendering;
use super::schedule::SAMPLE_BLOCK;
use crate::compile::{Fingerprint, of_curves, of_mesh};
use crate::error::{Error, Result};
use crate::image::{Image, Pixels};
use crate::output::part::{
    Channels, FINGERPRINT_PREFIX, Identity, OutputSettings, PartFile, PartHeader, RenderCost, StoredStrategy,
    differences, write_part,
};
use crate::sampling::MAX_Z_ORDER_SPP;
use crate::scene::{Backdrop, CatcherOutput, Scene};
use std::fmt;
use std::fmt::{Debug, Write};
use std::mem::take;
use std::path::Path;
use std::time::Duration;

// The identity of a picture: names and values. Pictures with equal identities are bit-identical.

/// Changes whenever the same scene and options result in a different picture.
const PICTURES: &str = concat!(env!("CARGO_PKG_VERSION"), ", pictures 3");

/// The identity of the picture of a scene with resolved options: fingerprints of the whole scene and of all options that affect pixels.
/// The scene is restored afterwards.
///
/// # Errors
/// An input error for a scene without a camera.
pub fn identity(scene: &mut Scene, resolved: &ResolvedOptions) -> Result<Identity> {
    let camera = of_debug(resolved.camera(scene)?);
    let mut rest = take(scene);
    // Large data is hashed by its bytes, all else by its `Debug` text, which includes every field.
    let (meshes, images, backdrop) =
        (take(&mut rest.meshes), take(&mut rest.images), take(&mut rest.backdrop));
    let (name, cameras, settings) = (take(&mut rest.name), take(&mut rest.cameras), take(&mut rest.settings));
    let (materials, textures) = (take(&mut rest.materials), take(&mut rest.textures));
    let (lights, environment) = (take(&mut rest.lights), take(&mut rest.environment));
    let camera_environment = take(&mut rest.camera_environment);
    let of_meshes = meshes.iter().fold(Fingerprint::START, |sum, mesh| sum.with_fingerprint(of_mesh(mesh)));
    let curves = take(&mut rest.curves);
    let of_curves = curves.iter().fold(of_meshes, |sum, curves| {
        sum.with_fingerprint(of_curves(curves)).with_fingerprint(of_debug(&(&curves.name, &curves.traits)))
    });
    let of_images = images.iter().fold(Fingerprint::START, with_image);
    let of_backdrop = match &backdrop {
        Some(Backdrop::Picture(image)) => with_image(Fingerprint::START, image),
        other => of_debug(other),
    };
    let prints = [
        ("the camera", camera),
        ("the geometry", of_curves.with_fingerprint(of_debug(&rest))),
        ("the materials", of_debug(&materials).with_fingerprint(of_debug(&textures))),
        ("the textures", of_images),
        ("the light", of_debug(&lights).with_fingerprint(of_debug(&environment))),
        ("the background", of_backdrop.with_fingerprint(of_debug(&camera_environment))),
    ];
    *scene = Scene {
        name,
        meshes,
        curves,
        images,
        backdrop,
        cameras,
        settings,
        materials,
        textures,
        lights,
        environment,
        camera_environment,
        ..rest
    };
    let prints =
        prints.map(|(name, print)| (name.to_string(), format!("{FINGERPRINT_PREFIX}{:016x}", print.value())));
    Ok(prints.into_iter().chain(options(resolved)).collect())
}

/// Name of the entry with the number of samples that the sample order is made for.
const ARRANGED: &str = "the number that samples are arranged for";

/// The settings that pixels depend on, as entries of the identity.
fn options(resolved: &ResolvedOptions) -> impl Iterator<Item = (String, String)> {
    let options = resolved.options;
    let planned = options.samples.max(options.planned);
    let arranged = match planned > MAX_Z_ORDER_SPP {
        true => "any number".to_string(),
        false => planned.next_power_of_two().to_string(),
    };
    let aovs: Vec<&str> = options.aovs.iter().map(|aov| aov.info().option).collect();
    let halves = if options.halves { options.halving().name() } else { "none" };
    let separate = [
        ("version", PICTURES.to_string()),
        ("size", format!("{} x {}", options.width, options.height)),
        (ARRANGED, arranged),
        ("the AOVs", aovs.join(",")),
        ("the terminator", options.terminator.name().to_string()),
        ("the halves that denoising needs", halves.to_string()),
        ("shading", format!("{FINGERPRINT_PREFIX}{:016x}", of_debug(&resolved.shading).value())),
        (
            "one of the other options",
            format!("{FINGERPRINT_PREFIX}{:016x}", of_debug(&options.hashed()).value()),
        ),
    ];
    let entries = separate.into_iter().chain(options.identity_entries());
    entries.map(|(name, value)| (name.to_string(), value))
}

/// Adds an image to a fingerprint, without its name.
fn with_image(sum: Fingerprint, image: &Image) -> Fingerprint {
    let sum = [image.width, image.height, image.channels].into_iter().fold(sum, |sum, n| sum.with(n.into()));
    let sum = sum.with_fingerprint(of_debug(&image.encoding));
    match &*image.pixels {
        Pixels::U8(values) => sum.with(8).with_all(values),
        Pixels::U16(values) => sum.with(16).with_all(values),
        Pixels::F32(values) => sum.with(32).with_all(values),
        Pixels::Encoded(encoded) => {
            let mut sum = sum.with(encoded.bits.into());
            encoded.source.with_bytes(&mut |bytes| sum = sum.with_all(bytes));
            sum
        }
    }
}

/// The fingerprint of the `Debug` text of a value.
fn of_debug(value: &impl Debug) -> Fingerprint {
    let mut sum = FingerprintWriter { sum: Fingerprint::START, pending: Vec::new() };
    // `write_str` never fails.
    let _ = write!(sum, "{value:?}");
    sum.sum.with_all(&sum.pending)
}

/// Computes the fingerprint of text written to it.
struct FingerprintWriter {
    sum: Fingerprint,
    pending: Vec<u8>,
}

impl Write for FingerprintWriter {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        const PIECE: usize = 1 << 12;
        self.pending.extend_from_slice(text.as_bytes());
        while self.pending.len() >= PIECE {
            self.sum = self.sum.with_all(&self.pending[..PIECE]);
            self.pending.drain(..PIECE);
        }
        Ok(())
    }
}

// Writing the sums of a rendering, and resuming from them.

/// Options that may change when a rendering is resumed.
const MAY_DIFFER: [&str; 1] = ["samples"];

impl Rendering {
    /// Finishes passes even when cancelled or past the time limit, so that the film can be resumed from.
    #[must_use]
    pub fn with_whole_passes(mut self) -> Rendering {
        self.schedule = self.schedule.with_full_passes();
        self.finishes_passes = true;
        self
    }

    /// Are the samples so far whole blocks, so that the film can be resumed from?
    pub fn is_between_blocks(&self) -> bool {
        self.schedule.next_sample().is_multiple_of(SAMPLE_BLOCK)
    }

    /// Does the next pass end within a block? Only the last one may.
    pub fn ends_within_block(&self) -> bool {
        let end = self.options.samples_to_render().end;
        end - self.schedule.next_sample() < SAMPLE_BLOCK && !end.is_multiple_of(SAMPLE_BLOCK)
    }

    /// Writes the sums so far, as a part of the picture or a checkpoint for [`Rendering::resume`]. Atomic.
    ///
    /// # Errors
    /// An output error.
    pub fn write_part(
        &mut self,
        path: &Path,
        identity: &Identity,
        output: &OutputSettings,
        backdrop: Option<&Backdrop>,
    ) -> Result<()> {
        if self.options.is_part() {
            // Tiles may extend beyond the region.
            self.film.count_invalid(self.schedule.next_sample() - self.options.samples_to_render().start);
        }
        let statistics = self.statistics();
        let warnings = self.techniques.warnings(&self.target()).into_iter().map(|w| w.to_string());
        let output = OutputSettings {
            seed: self.options.seed,
            world_to_camera: self.view.camera_from_world.to_cols_array().map(f64::to_bits),
            world_to_ndc: self.view.ndc_from_world.map(|ndc| ndc.to_cols_array().map(f64::to_bits)),
            pixel_aspect: Some(self.view.pixel_aspect.to_bits()),
            aov_space: self.options.aov_space.name().to_string(),
            mattes: self
                .labels
                .mattes
                .iter()
                .map(|matte| matte.names().map(str::to_string).collect())
                .collect(),
            warnings: output.warnings.iter().cloned().chain(warnings).collect(),
            ..output.clone()
        };
        let header = PartHeader {
            identity: identity.clone(),
            width: self.options.width,
            height: self.options.height,
            samples: self.options.samples,
            region: self.options.pixels(),
            first_sample: self.options.samples_to_render().start,
            end_sample: self.schedule.next_sample(),
            strategy: Some(StoredStrategy {
                branches: self.techniques.strategy.current().branches(),
                shared: self.techniques.strategy.current().shape().map(|shape| shape.to_string()),
            }),
            channels: self.channels(),
            cost: RenderCost {
                wall_s: statistics.render_s,
                cpu_s: statistics.render_cpu_s,
                paths: statistics.samples,
                rays: statistics.rays,
            },
            output,
            resume_bytes: 0,
        };
        let resume_state = self.error_estimate.as_ref().map(ErrorEstimate::to_bytes).unwrap_or_default();
        write_part(path, header, &self.film, backdrop, &resume_state)
    }

    fn channels(&self) -> Channels {
        Channels {
            aovs: self.options.aovs.iter().map(|aov| aov.info().option.to_string()).collect(),
            matte_levels: self.options.matte_levels,
            light_groups: self.labels.light_groups.clone(),
            halves: self.options.halves,
            catchers: self.options.catchers,
            shadows_only: self.options.caught == CatcherOutput::Shadows,
        }
    }

    /// Resumes from a file of [`Rendering::write_part`] for the same picture, perhaps with fewer samples.
    ///
    /// # Errors
    /// An input error that names the differences between the pictures. Its code is `other-sample-plan` if the planned numbers of samples
    /// need different sample orders.
    pub fn resume(&mut self, file: &Path, part: PartFile, identity: &Identity) -> Result<()> {
        let PartFile { header, film, resume_state, .. } = part;
        let of = |identity: &Identity| -> Identity {
            let counts = |(name, _): &(&String, &String)| !MAY_DIFFER.contains(&name.as_str());
            identity.iter().filter(counts).map(|(name, value)| (name.clone(), value.clone())).collect()
        };
        let mut different = differences(&of(identity), &of(&header.identity));
        let samples = self.options.samples_to_render();
        if header.region != self.options.pixels() || header.first_sample != samples.start {
            different.push("it has another region or range of samples".to_string());
        }
        if different.is_empty() && header.channels != self.channels() {
            different.push("it has other channels".to_string());
        }
        if !different.is_empty() {
            let message = format!("is of another picture: {}", different.join("; "));
            let has_other_plan = identity.get(ARRANGED) != header.identity.get(ARRANGED);
            let code = if has_other_plan { "other-sample-plan" } else { "" };
            return Err(Error::input(file, (code, message)).with_help("delete it to start again"));
        }
        if header.end_sample > samples.end {
            let message =
                format!("has {} samples per pixel already, more than {}", header.end_sample, samples.end);
            return Err(Error::input(file, message).with_help("give at least as many samples"));
        }
        let used_strategy =
            header.strategy.as_ref().and_then(strategy).filter(|_| header.end_sample > samples.start);
        if let Some(strategy) = used_strategy {
            self.techniques.strategy = StrategyTrials::decided(strategy);
        }
        self.film = film;
        let RenderCost { wall_s, cpu_s, paths, rays } = header.cost;
        let duration = |s: f64| Duration::try_from_secs_f64(s).unwrap_or_default();
        self.spent = Spent { wall: duration(wall_s), cpu: duration(cpu_s) };
        self.schedule.resume_at(header.end_sample, self.spent.wall);
        self.progress.resume_at(paths, rays);
        if let Some(estimate) = &mut self.error_estimate {
            estimate.restore(&resume_state, self.film.width() as usize * self.film.height() as usize);
        }
        Ok(())
    }
}

/// The path strategy stored in a file.
fn strategy(stored: &StoredStrategy) -> Option<PathStrategy> {
    match &stored.shared {
        Some(shape) => shape.parse().ok().map(PathStrategy::Reuse),
        None => stored
            .branches
            .is_power_of_two()
            .then_some(PathStrategy::Independent { branches: stored.branches }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::part::differences;
    use crate::render::RequestedOptions;
    use crate::scene::{Camera, Material, Mesh, ShadowTerminator, Shape};

    fn scene() -> Scene {
        let mut scene = Scene::default();
        let clay = scene.add_material(Material::lambert("clay", [0.6, 0.3, 0.2]));
        scene.shapes.push(Shape::sphere([0.0, 1.0, 0.0], 1.0, clay));
        scene.meshes.push(Mesh { positions: vec![[0.0; 3]; 3], ..Mesh::default() });
        scene.images.push(Image::from_linear_rgb("a", 2, 1, vec![0.5; 6]));
        scene.cameras.push(Camera::look_at([0.0, 2.0, 6.0], [0.0, 1.0, 0.0], 30.0));
        scene
    }

    fn of(scene: &mut Scene, change: impl Fn(&mut RequestedOptions)) -> Identity {
        let mut requested = RequestedOptions::default();
        change(&mut requested);
        let resolved = requested.resolve(scene).expect("a camera");
        identity(scene, &resolved).expect("a camera")
    }

    #[test]
    fn differences_of_identities_are_named() {
        let same = |_: &mut RequestedOptions| {};
        let (mut before, mut after) = (scene(), scene());
        let ours = of(&mut before, same);
        assert_eq!(of(&mut after, same), ours);
        assert_eq!(format!("{before:?}"), format!("{:?}", scene()), "the scene is as it was");
        let names_change = |change: fn(&mut Scene), name: &str| {
            let mut other = scene();
            change(&mut other);
            assert_eq!(differences(&ours, &of(&mut other, same)), [format!("{name} changed")]);
        };
        names_change(|s| s.meshes[0].positions[1][2] = 1e-30, "the geometry");
        names_change(|s| s.shapes.clear(), "the geometry");
        names_change(|s| s.images[0] = Image::from_linear_rgb("a", 1, 2, vec![0.5; 6]), "the textures");
        names_change(|s| s.materials[0] = Material::lambert("clay", [0.6, 0.3, 0.21]), "the materials");
        names_change(|s| s.backdrop = Some(Backdrop::Color([1.0; 3])), "the background");
        names_change(
            |s| s.cameras[0] = Camera::look_at([0.0, 2.0, 6.1], [0.0, 1.0, 0.0], 30.0),
            "the camera",
        );
        let other = of(&mut after, |requested| requested.settings.depth = Some(7));
        assert_eq!(differences(&ours, &other), ["depth is 100 here and 7 there"]);
        let other = of(&mut after, |requested| requested.settings.terminator = Some(ShadowTerminator::Off));
        assert_eq!(differences(&ours, &other), ["the terminator is soft here and off there"]);
    }

    #[test]
    fn sample_pattern_is_independent_of_the_count_above_256() {
        let with = |samples| {
            of(&mut scene(), |requested: &mut RequestedOptions| requested.settings.samples = Some(samples))
        };
        assert_eq!(differences(&with(500), &with(2000)), ["samples is 500 here and 2000 there"]);
        assert_eq!(differences(&with(16), &with(17)).len(), 2);
    }
}
