//! The efficiency of each technique: a scene with each of them enabled or disabled.

use crate::measure::{Setup, Subject, to_image};
use oscura::error::Result;
use oscura::image::Image;
use oscura::metrics::errors;
use oscura::render::{Caustics, Guiding, PathReuse, RenderOptions, Splitting};
use std::path::Path;

/// Edge of blocks in pixels, whose means are compared as well: low-frequency error is what viewers and denoisers are left with.
const BLOCK: u32 = 8;

/// A combination of techniques.
struct Technique {
    name: &'static str,
    with: fn(RenderOptions) -> RenderOptions,
}

/// The first is the baseline.
const TECHNIQUES: [Technique; 7] = [
    Technique { name: "none", with: plain },
    Technique { name: "by default", with: |options| options },
    Technique { name: "paths not shared", with: |options| options.path_reuse(PathReuse::Off) },
    Technique { name: "no splitting", with: |options| options.splitting(Splitting::OFF) },
    Technique { name: "no caustics from lamps", with: |options| options.caustics(Caustics::Off) },
    Technique { name: "always guided", with: |options| options.guiding(Guiding::On) },
    Technique { name: "never guided", with: |options| options.guiding(Guiding::Off) },
];

fn plain(options: RenderOptions) -> RenderOptions {
    options.path_reuse(PathReuse::Off).splitting(Splitting::OFF).caustics(Caustics::Off).guiding(Guiding::Off)
}

/// Sums over the renders of a scene with one technique.
#[derive(Clone, Copy, Default)]
struct Cost {
    cpu_s: f64,
    /// Squared relative errors of pixels and of blocks.
    squared: [f64; 2],
}

/// The efficiencies of techniques for a scene.
pub struct Comparison {
    scene: String,
    costs: [Cost; TECHNIQUES.len()],
}

/// Renders a scene with all techniques in turn, with several seeds, at the middle step of the ladder.
pub fn compare(path: &Path, setup: &Setup, seeds: u32) -> Result<Vec<Comparison>> {
    let subject = Subject::new(path, setup)?;
    let (reference, own) = subject.reference(setup.reference)?;
    let blocks = block_means(&reference);
    let samples = setup.ladder.get(setup.ladder.len() / 2).copied().unwrap_or(16);
    let mut costs = [Cost::default(); TECHNIQUES.len()];
    for seed in 1..=seeds {
        for (technique, cost) in TECHNIQUES.iter().zip(&mut costs) {
            let mut rendering = subject.rendering_with(samples, seed, technique.with)?;
            rendering.run();
            let picture = to_image(rendering.film());
            cost.cpu_s += rendering.statistics().render_cpu_s;
            cost.squared[0] += (errors(&picture, &reference).rel_mse - own).max(0.0);
            cost.squared[1] += errors(&block_means(&picture), &blocks).rel_mse;
        }
    }
    Ok(vec![Comparison { scene: subject.name, costs }])
}

/// One line per scene and technique.
pub fn csv(comparisons: &[Comparison]) -> String {
    let mut out = "scene,technique,render_cpu_s,relmse,relmse_of_blocks\n".to_string();
    for Comparison { scene, costs } in comparisons {
        for (technique, cost) in TECHNIQUES.iter().zip(costs) {
            let [pixels, blocks] = cost.squared;
            out += &format!("\"{scene}\",{},{},{pixels},{blocks}\n", technique.name, cost.cpu_s);
        }
    }
    out
}

/// One line per scene: the efficiency of each technique relative to none, by pixels and by blocks.
pub fn markdown(comparisons: &[Comparison]) -> String {
    let names = TECHNIQUES[1..].iter().map(|technique| format!(" {} |", technique.name));
    let mut out =
        format!("| scene |{}\n|---|{}\n", names.collect::<String>(), "---:|".repeat(TECHNIQUES.len() - 1));
    for Comparison { scene, costs } in comparisons {
        let work = |cost: &Cost, i: usize| cost.cpu_s * cost.squared[i];
        let gain = |cost: &Cost, i: usize| work(&costs[0], i) / work(cost, i).max(f64::MIN_POSITIVE);
        let cells = costs[1..].iter().map(|cost| format!(" {:.2} ({:.2}) |", gain(cost, 0), gain(cost, 1)));
        out += &format!("| {scene} |{}\n", cells.collect::<String>());
    }
    out
}

/// Means of blocks of pixels; incomplete blocks at the right and bottom are omitted.
fn block_means(image: &Image) -> Image {
    let (width, height) = ((image.width / BLOCK).max(1), (image.height / BLOCK).max(1));
    let (w, h) = (image.width.min(BLOCK), image.height.min(BLOCK));
    let mut rgb = Vec::with_capacity((width * height * 3) as usize);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let pixels = (0..h).flat_map(|j| (0..w).map(move |i| (x * BLOCK + i, y * BLOCK + j)));
        let sum = pixels.fold([0.0f64; 3], |sum, (x, y)| {
            let p = image.rgba(x, y);
            [0, 1, 2].map(|c| sum[c] + f64::from(p[c]))
        });
        rgb.extend(sum.map(|sum| (sum / f64::from(w * h)) as f32));
    }
    Image::from_linear_rgb("blocks", width, height, rgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_have_the_mean_of_their_pixels() {
        let rgb = (0..20 * 9).flat_map(|i| [(i % 20) as f32, 1.0, (i / 20) as f32]).collect();
        let means = block_means(&Image::from_linear_rgb("", 20, 9, rgb));
        assert_eq!((means.width, means.height), (2, 1));
        assert_eq!(means.rgba(0, 0)[..3], [3.5, 1.0, 3.5]);
        assert_eq!(means.rgba(1, 0)[..3], [11.5, 1.0, 3.5]);
    }

    #[test]
    fn twice_the_error_is_half_the_efficiency() {
        let mut costs = [Cost { cpu_s: 2.0, squared: [0.1, 0.01] }; TECHNIQUES.len()];
        costs[1] = Cost { cpu_s: 1.0, squared: [0.4, 0.01] };
        let table = markdown(&[Comparison { scene: "s".to_string(), costs }]);
        assert!(table.contains("| s | 0.50 (2.00) | 1.00 (1.00) |"), "{table}");
    }
}
