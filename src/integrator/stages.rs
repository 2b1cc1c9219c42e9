//! The stages of path tracing, in the order in which a wave runs them at each bounce.
//!
//! A wave of up to [`super::WAVE`] paths starts at the camera ([`super::generate`]). At each bounce the stages of [`ARRIVE`] intersect the
//! rays and build the vertices where paths continue, and those of [`LEAVE`] add direct light and scatter. Which stages run depends on the
//! scene, its outputs and the techniques in use: a plain scene has seven (intersect, classify, surfaces, environment; direct light,
//! scatter, next rays). Techniques and features are added as stages to the lists; the loop over bounces doesn't refer to them.

use super::sampling::{Block, CameraSamples};
use super::shading_groups::{ShadingGroupCounts, SortedVertices};
use super::workspace::Workspace;
use super::{Integrator, PathSample, random_walks};

/// The data that stages pass to each other, in [`Workspace`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Data {
    /// Rays of the arriving paths.
    Rays,
    /// State of the arriving paths, or of the sorted ones after the stage "surfaces".
    Paths,
    /// Path segments within media.
    Segments,
    /// Nearest hits of the rays.
    Hits,
    /// Shading groups of the hits.
    Groups,
    /// Vertices, sorted by shading group, and their BSDFs.
    Vertices,
    /// Guiding cells of the vertices.
    Cells,
    /// Lobes of vertices towards refracted lights.
    Lobes,
    /// Origins and directions of the scattered rays.
    Scattered,
    /// Prefixes and suffixes for path reuse.
    Subpaths,
    /// Vertices recorded to train a guide.
    Training,
    /// Radiance, alpha and AOVs of the samples.
    Results,
}

/// Number of bounces between checks for interruption; few paths are that long.
const STOP_INTERVAL: u32 = 64;

/// One step of all paths of a wave.
#[cfg_attr(not(test), expect(dead_code, reason = "name, reads and writes are for readers and tests"))]
pub(super) struct Stage {
    pub name: &'static str,
    /// Does the stage run with this scene, these outputs and these techniques?
    pub condition: fn(&Integrator<'_>) -> bool,
    pub bounces: Bounces,
    pub reads: &'static [Data],
    pub writes: &'static [Data],
    pub run: fn(&Integrator<'_>, &mut Bounce, &mut Workspace),
}

/// The bounces at which a stage runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bounces {
    All,
    /// First hits only.
    First,
}

/// The current bounce of a wave.
pub(super) struct Bounce {
    /// 0 at the first surface.
    pub number: u32,
    /// Do all paths end at this bounce?
    pub is_last: bool,
    /// Number of hits of each shading group.
    pub counts: ShadingGroupCounts,
    /// Ranges of the shading groups.
    pub vertices: SortedVertices,
}

impl Bounce {
    pub fn new(number: u32, is_last: bool) -> Bounce {
        let counts = ShadingGroupCounts::new();
        let vertices = counts.sorted();
        Bounce { number, is_last, counts, vertices }
    }
}

/// The stages in use, in order.
pub(super) struct Stages {
    pub arrive: Vec<&'static Stage>,
    pub leave: Vec<&'static Stage>,
}

impl Stages {
    pub fn of(integrator: &Integrator<'_>) -> Stages {
        let used = |stages: &'static [Stage]| stages.iter().filter(|s| (s.condition)(integrator)).collect();
        Stages { arrive: used(ARRIVE), leave: used(LEAVE) }
    }
}

impl Integrator<'_> {
    /// Traces all samples of a block and passes them to `sink`, pixel by pixel, sample by sample. Calls `stop` every 64 bounces, so that
    /// very long paths can be interrupted. Returns false if interrupted: then samples are missing.
    #[must_use]
    pub fn trace(
        &self,
        block: &Block,
        w: &mut Workspace,
        stop: &dyn Fn() -> bool,
        mut sink: impl FnMut(&PathSample<'_>),
    ) -> bool {
        let stages = Stages::of(self);
        let mut samples =
            CameraSamples::new(self.options.plan, block, self.options.branches.trailing_zeros());
        loop {
            self.generate(&mut samples, w);
            if w.pixels.is_empty() {
                return true;
            }
            if self.has_shadow_catchers() {
                self.save_camera_paths(w);
            }
            if !self.trace_wave(block, &stages, w, stop)
                || self.has_shadow_catchers() && !self.trace_without_casters(&stages, w, stop)
            {
                return false;
            }
            if self.is_spectral() {
                w.radiance_buffer.convert_to_rgb(w.times.all_wavelengths());
            }
            let has_layers = w.radiance_buffer.has_layers();
            for (i, (&[r, g, b, alpha], &pixel)) in
                w.radiance_buffer.samples().iter().zip(&w.pixels).enumerate()
            {
                let (layers, baseline) = (
                    if has_layers { w.radiance_buffer.layer_values(i) } else { &[] },
                    w.radiance_buffer.baseline(i),
                );
                let first_hit = w.first_hits.get(i);
                sink(&PathSample { pixel, rgb: [r, g, b], alpha, first_hit, layers, baseline });
            }
        }
    }

    /// Traces the generated wave, with the pre- and postprocessing of techniques; false if `stop` interrupted it.
    fn trace_wave(&self, block: &Block, stages: &Stages, w: &mut Workspace, stop: &dyn Fn() -> bool) -> bool {
        let Some(tiling) = &self.options.reuse else {
            let is_done = self.trace_paths(stages, w, stop);
            self.make_training_samples(w);
            if is_done && self.options.branches > 1 && self.options.records_baseline {
                self.join_branches(w);
            }
            return is_done;
        };
        self.begin_reuse(tiling, block, w.pixels.len(), w);
        let is_done = self.trace_paths(stages, w, stop);
        if is_done {
            self.reuse_paths(tiling, w);
        }
        is_done
    }

    /// Traces the paths of a wave to their ends; false if `stop` interrupted it.
    pub(super) fn trace_paths(&self, stages: &Stages, w: &mut Workspace, stop: &dyn Fn() -> bool) -> bool {
        let max_walk_steps = if self.optional.depth { random_walks::MAX_STEPS } else { 0 };
        let last = self.options.max_depth.saturating_add(max_walk_steps);
        for number in 0..=last {
            if number % STOP_INTERVAL == STOP_INTERVAL - 1 && stop() {
                return false;
            }
            let mut bounce = Bounce::new(number, number == last);
            self.run_stages(&stages.arrive, &mut bounce, w);
            if bounce.vertices.all().is_empty() {
                return true;
            }
            self.run_stages(&stages.leave, &mut bounce, w);
            if w.rays.is_empty() {
                return true;
            }
        }
        true
    }

    fn run_stages(&self, stages: &[&Stage], bounce: &mut Bounce, w: &mut Workspace) {
        for stage in stages {
            if stage.bounces == Bounces::All || bounce.number == 0 {
                (stage.run)(self, bounce, w);
            }
        }
    }
}

fn always(_: &Integrator<'_>) -> bool {
    true
}

use Data::{
    Cells, Groups, Hits, Lobes, Paths, Rays, Results, Scattered, Segments, Subpaths, Training, Vertices,
};

/// Stages from the rays of a wave to its vertices.
pub(super) const ARRIVE: &[Stage] = &[
    Stage {
        name: "medium distances",
        condition: |i| i.scene.features.scattering,
        bounces: Bounces::All,
        reads: &[Rays, Paths],
        writes: &[Segments, Rays],
        run: |i, b, w| i.start_medium_segments(b.number, w),
    },
    Stage {
        name: "intersect",
        condition: always,
        bounces: Bounces::All,
        reads: &[Rays],
        writes: &[Hits],
        run: |i, _, w| w.intersect(&i.scene.accel),
    },
    Stage {
        name: "random walks",
        condition: |i| i.random_walks.exist(),
        bounces: Bounces::All,
        reads: &[Rays, Hits, Segments, Paths],
        writes: &[Rays, Hits, Segments, Paths],
        run: |i, b, w| i.follow_random_walks(b.number, w),
    },
    Stage {
        name: "caustics: arrival",
        condition: |i| i.options.caustics.is_some(),
        bounces: Bounces::All,
        reads: &[Paths],
        writes: &[Paths],
        run: |i, _, w| i.shift_chains(w),
    },
    Stage {
        name: "pass-through surfaces",
        condition: |i| i.scene.features.alpha,
        bounces: Bounces::All,
        reads: &[Rays, Hits, Paths],
        writes: &[Rays, Hits, Paths, Results],
        run: |i, b, w| {
            i.start_crossings(w);
            i.pass_through_surfaces(b.number, w);
            i.end_crossings(w);
        },
    },
    Stage {
        name: "sky shadows",
        condition: |i| i.records_sky_shadows(),
        bounces: Bounces::All,
        reads: &[Rays, Hits, Paths],
        writes: &[Results],
        run: |i, b, w| i.record_sky_shadows(b.number, w),
    },
    Stage {
        name: "holdouts and shadow catchers",
        condition: |i| i.scene.features.alpha,
        bounces: Bounces::First,
        reads: &[Hits, Paths],
        writes: &[Hits, Paths],
        run: |i, _, w| i.find_holdouts_and_catchers(w),
    },
    Stage {
        name: "medium scattering",
        condition: |i| i.scene.features.scattering,
        bounces: Bounces::All,
        reads: &[Rays, Hits, Segments, Paths],
        writes: &[Hits, Paths, Results],
        run: |i, b, w| i.end_medium_segments(b.number, w),
    },
    Stage {
        name: "ray cones",
        condition: |i| i.scene.features.footprints,
        bounces: Bounces::All,
        reads: &[Hits],
        writes: &[Paths],
        run: |i, _, w| i.widen_ray_cones(w),
    },
    Stage {
        name: "absorption",
        condition: |i| i.scene.features.absorption && !i.scene.features.scattering,
        bounces: Bounces::All,
        reads: &[Hits, Paths],
        writes: &[Paths],
        run: |i, _, w| i.absorb(w),
    },
    Stage {
        name: "mixes",
        condition: |i| i.scene.features.mixes,
        bounces: Bounces::All,
        reads: &[Rays, Hits, Paths],
        writes: &[Hits, Paths, Results],
        run: |i, b, w| i.select_components(b.number, w),
    },
    Stage {
        name: "classify",
        condition: always,
        bounces: Bounces::All,
        reads: &[Hits],
        writes: &[Groups],
        run: |i, b, w| b.counts = i.classify_hits(b.number, b.is_last, w),
    },
    Stage {
        name: "caustics: surfaces",
        condition: |i| i.options.caustics.is_some(),
        bounces: Bounces::All,
        reads: &[Hits, Paths],
        writes: &[Paths],
        run: |i, b, w| i.update_chains(b.number, w),
    },
    Stage {
        name: "bounce limits",
        condition: |i| i.optional.depth || i.optional.bounce_counts || i.optional.transparent_count,
        bounces: Bounces::All,
        reads: &[Paths, Groups],
        writes: &[Groups],
        run: |i, b, w| b.counts = i.end_deep_paths(w),
    },
    Stage {
        name: "surfaces",
        condition: always,
        bounces: Bounces::All,
        reads: &[Rays, Hits, Groups, Paths],
        writes: &[Vertices, Paths, Results],
        run: |i, b, w| {
            b.vertices = b.counts.sorted();
            i.surfaces(b.number, &b.vertices, w);
        },
    },
    Stage {
        name: "glossy filter",
        condition: |i| i.optional.min_pdf,
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Vertices],
        run: |i, b, w| i.filter_glossy(&b.vertices, w),
    },
    Stage {
        name: "depth count",
        condition: |i| i.optional.depth,
        bounces: Bounces::All,
        reads: &[Vertices],
        writes: &[Paths],
        run: |i, b, w| i.count_bounces(&b.vertices, w),
    },
    Stage {
        name: "environment",
        condition: always,
        bounces: Bounces::All,
        reads: &[Rays, Hits, Paths],
        writes: &[Results],
        run: |i, b, w| i.add_environment(b.number, w),
    },
    Stage {
        name: "alpha",
        condition: |i| i.scene.features.alpha || i.optional.only_clear_glass,
        bounces: Bounces::First,
        reads: &[Vertices, Results],
        writes: &[Paths, Results],
        run: |i, b, w| i.set_alpha(&b.vertices, w),
    },
    Stage {
        name: "caustics: bent normals",
        condition: |i| i.options.caustics.is_some(),
        bounces: Bounces::All,
        reads: &[Vertices],
        writes: &[Paths],
        run: |i, b, w| i.end_bent_chains(b.number, &b.vertices, w),
    },
];

/// Stages from vertices to the rays of the next bounce.
pub(super) const LEAVE: &[Stage] = &[
    Stage {
        name: "guiding: cells",
        condition: |i| i.options.guide.is_some(),
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Cells],
        run: |i, b, w| i.find_cells(b.number, &b.vertices, w),
    },
    Stage {
        name: "path reuse: cut",
        condition: |i| i.options.reuse.is_some(),
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Subpaths, Paths],
        run: |i, b, w| i.cut_paths(b.number, &b.vertices, w),
    },
    Stage {
        name: "direct light",
        condition: |i| !i.scene.lights.is_empty(),
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Results],
        run: |i, b, w| i.add_direct_light(b.number, &b.vertices, w),
    },
    Stage {
        name: "split",
        condition: |i| i.options.branches > 1,
        bounces: Bounces::First,
        reads: &[Vertices, Paths],
        writes: &[Vertices, Paths],
        run: |i, b, w| b.vertices = i.split(&b.vertices, w),
    },
    Stage {
        name: "refracted lights: lobes",
        condition: |i| i.samples_refracted_lights(),
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Lobes],
        run: |i, b, w| i.find_light_lobes(b.number, &b.vertices, w),
    },
    Stage {
        name: "scatter",
        condition: always,
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Scattered, Paths],
        run: |i, b, w| i.scatter(b.number, &b.vertices, w),
    },
    Stage {
        name: "refracted lights: sampling",
        condition: |i| i.samples_refracted_lights(),
        bounces: Bounces::All,
        reads: &[Vertices, Lobes, Scattered, Paths],
        writes: &[Scattered, Paths],
        run: |i, b, w| i.scatter_to_refracted_lights(b.number, &b.vertices, w),
    },
    Stage {
        name: "glossy filter: pdfs",
        condition: |i| i.optional.min_pdf,
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Paths],
        run: |i, b, w| i.record_densities(&b.vertices, b.number, w),
    },
    Stage {
        name: "clear glass",
        condition: |i| i.optional.only_clear_glass,
        bounces: Bounces::All,
        reads: &[Vertices, Scattered],
        writes: &[Paths],
        run: |i, b, w| i.update_clear_paths(&b.vertices, w),
    },
    Stage {
        name: "caustics: lobes",
        condition: |i| i.options.caustics.is_some(),
        bounces: Bounces::All,
        reads: &[Vertices, Scattered],
        writes: &[Paths],
        run: |i, b, w| i.update_chain_fractions(&b.vertices, w),
    },
    Stage {
        name: "caustics: large corrections",
        condition: |i| i.options.caustics.is_some(),
        bounces: Bounces::All,
        reads: &[Vertices, Scattered],
        writes: &[Paths],
        run: |i, b, w| i.end_chains_of_large_correction(b.number, &b.vertices, w),
    },
    Stage {
        name: "guiding: training",
        condition: |i| i.options.records_training,
        bounces: Bounces::All,
        reads: &[Vertices, Scattered, Paths],
        writes: &[Training],
        run: |i, b, w| i.record_vertices(&b.vertices, w),
    },
    Stage {
        name: "light passes",
        condition: |i| i.optional.first_bounces,
        bounces: Bounces::First,
        reads: &[Vertices, Scattered],
        writes: &[Paths],
        run: |i, b, w| i.record_first_bounces(&b.vertices, w),
    },
    Stage {
        name: "ray kinds",
        condition: |i| i.optional.visibility,
        bounces: Bounces::All,
        reads: &[Vertices, Scattered, Paths],
        writes: &[Paths],
        run: |i, b, w| i.choose_ray_kinds(b.number, &b.vertices, w),
    },
    Stage {
        name: "bounces by kind",
        condition: |i| i.optional.bounce_counts,
        bounces: Bounces::All,
        reads: &[Vertices, Paths],
        writes: &[Paths],
        run: |i, b, w| i.count_bounces_by_kind(&b.vertices, w),
    },
    Stage {
        name: "path reuse: lobes",
        condition: |i| i.options.reuse.is_some(),
        bounces: Bounces::All,
        reads: &[Vertices, Scattered, Subpaths, Paths],
        writes: &[Subpaths, Paths],
        run: |i, b, w| i.divide_lobes(b.number, &b.vertices, w),
    },
    Stage {
        name: "next rays",
        condition: always,
        bounces: Bounces::All,
        reads: &[Scattered, Paths],
        writes: &[Rays, Paths],
        run: |i, b, w| i.spawn_rays(&b.vertices, w),
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_read_what_was_written() {
        // Camera rays.
        let mut written = vec![Rays, Paths];
        for stage in ARRIVE.iter().chain(LEAVE) {
            for data in stage.reads {
                assert!(written.contains(data), "{} reads {data:?}", stage.name);
            }
            written.extend(stage.writes);
        }
        assert_eq!(LEAVE.last().map(|stage| stage.writes), Some(&[Rays, Paths][..]));
    }

    #[test]
    fn the_guide_lists_the_stages() {
        let page = include_str!("../guide/internals_tracing.md");
        for stage in ARRIVE.iter().chain(LEAVE) {
            assert!(page.contains(&format!("| {} |", stage.name)), "{}", stage.name);
        }
    }
}
