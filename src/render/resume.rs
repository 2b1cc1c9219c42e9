//! Saving what a rendering has, and going on from it.

use super::clock::Spent;
use super::rendering::Rendering;
use super::share::SAMPLE_BLOCK;
use super::technique::{Choice, Technique};
use crate::error::{Error, Result};
use crate::output::part::{
    Channels, Effort, Finish, Identity, PartFile, PartHeader, Way, differences, write_part,
};
use crate::scene::{Backdrop, CatcherOutput};
use std::path::Path;
use std::time::Duration;

/// Options that a rendering may be gone on from to others of.
const MAY_DIFFER: [&str; 1] = ["samples"];

impl Rendering {
    /// Finishes passes even when it is cancelled or late, so that the film is one that can be gone on from.
    #[must_use]
    pub fn with_whole_passes(mut self) -> Rendering {
        self.schedule = self.schedule.with_whole_passes();
        self.finishes_passes = true;
        self
    }

    /// Can the film be gone on from as it is? Its samples are whole blocks then.
    pub fn is_between_blocks(&self) -> bool {
        self.schedule.next_sample().is_multiple_of(SAMPLE_BLOCK)
    }

    /// Does the next pass end within a block, as the last one may?
    pub fn ends_within_block(&self) -> bool {
        let end = self.options.taken().end;
        end - self.schedule.next_sample() < SAMPLE_BLOCK && !end.is_multiple_of(SAMPLE_BLOCK)
    }

    /// Writes the sums so far: a part of the picture, or what [`Rendering::go_on`] goes on from. Whole or not at all.
    ///
    /// # Errors
    /// An output error.
    pub fn write_part(
        &mut self,
        path: &Path,
        identity: &Identity,
        finish: &Finish,
        backdrop: Option<&Backdrop>,
    ) -> Result<()> {
        if self.options.is_part() {
            // Tiles may have reached beyond the region.
            self.film.count_invalid(self.schedule.next_sample() - self.options.taken().start);
        }
        let statistics = self.statistics();
        let warnings = self.choice.warning(&self.scene, &self.options).map(|w| w.to_string());
        let finish = Finish {
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
            warnings: finish.warnings.iter().cloned().chain(warnings).collect(),
            ..finish.clone()
        };
        let header = PartHeader {
            identity: identity.clone(),
            width: self.options.width,
            height: self.options.height,
            samples: self.options.samples,
            region: self.options.pixels(),
            first_sample: self.options.taken().start,
            end_sample: self.schedule.next_sample(),
            way: Some(Way {
                branches: self.choice.now.branches(),
                shared: self.choice.now.shape().map(|shape| shape.to_string()),
            }),
            channels: self.channels(),
            effort: Effort {
                wall_s: statistics.render_s,
                cpu_s: statistics.render_cpu_s,
                paths: statistics.samples,
                rays: statistics.rays,
            },
            finish,
            further_bytes: 0,
        };
        let further = self.noise.as_ref().map(|noise| noise.to_bytes()).unwrap_or_default();
        write_part(path, header, &self.film, backdrop, &further)
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

    /// Goes on from what [`Rendering::write_part`] wrote for the same picture, perhaps with fewer samples.
    ///
    /// # Errors
    /// An input error that says what is different there.
    pub fn go_on(&mut self, file: &Path, part: PartFile, identity: &Identity) -> Result<()> {
        let PartFile { header, film, further, .. } = part;
        let of = |identity: &Identity| -> Identity {
            let counts = |(name, _): &(&String, &String)| !MAY_DIFFER.contains(&name.as_str());
            identity.iter().filter(counts).map(|(name, value)| (name.clone(), value.clone())).collect()
        };
        let mut different = differences(&of(identity), &of(&header.identity));
        let taken = self.options.taken();
        if header.region != self.options.pixels() || header.first_sample != taken.start {
            different.push("it is another part of the picture".to_string());
        }
        if different.is_empty() && header.channels != self.channels() {
            different.push("its channels are others".to_string());
        }
        if !different.is_empty() {
            let message = format!("is of another picture: {}", different.join("; "));
            return Err(Error::input(file, message).with_help("delete it to begin anew"));
        }
        if header.end_sample > taken.end {
            let message =
                format!("has {} samples a pixel already, more than {}", header.end_sample, taken.end);
            return Err(Error::input(file, message).with_help("ask for as many or more"));
        }
        let way = header.way.as_ref().and_then(technique).filter(|_| header.end_sample > taken.start);
        if let Some(technique) = way {
            self.choice = Choice::decided(technique);
        }
        self.film = film;
        let Effort { wall_s, cpu_s, paths, rays } = header.effort;
        let duration = |s: f64| Duration::try_from_secs_f64(s).unwrap_or_default();
        self.spent = Spent { wall: duration(wall_s), cpu: duration(cpu_s) };
        self.schedule.go_on_from(header.end_sample, self.spent.wall);
        self.progress.go_on_from(paths, rays);
        if let Some(noise) = &mut self.noise {
            noise.go_on(&further, self.film.width() as usize * self.film.height() as usize);
        }
        Ok(())
    }
}

/// What a file says about how paths are traced.
fn technique(way: &Way) -> Option<Technique> {
    match &way.shared {
        Some(shape) => shape.parse().ok().map(Technique::Shared),
        None => way.branches.is_power_of_two().then_some(Technique::Alone { branches: way.branches }),
    }
}
