//! Shadow catchers: objects that appear only by what the rest of the scene changes on them.
//!
//! Of samples whose camera rays meet a catcher first the film holds apart, as means over all samples of the pixel: their
//! radiance W with the whole scene, their radiance O with nothing but catchers and lights, and their share c. What is seen
//! by these samples becomes, channel by channel,
//!
//! ```text
//! rgb = W - (1 - a) O,    alpha = a c,    with a = 1 - min(1, least of W / O over the channels).
//! ```
//!
//! Laid over a plate P, that is rgb + (c - alpha) P, where the plate stands for O / c. If it is just that, the sum is W: what
//! the catcher would show as an object like others, whatever a is, and so without bias of the ratio of two estimates. With
//! this a, rgb is nowhere negative, a grey shadow has no rgb and darkens any plate by its factor, and what is brighter than
//! without the scene is added. The factors W / O, which darken or brighten each channel of any plate, are a layer of their
//! own, as Cycles has them ("shadow catcher" pass, to be multiplied).
//!
//! Cycles' own pictures have nothing but alpha there: a = 1 - min(1, mean of W / O over the channels) and no rgb, so that colours that
//! objects cast are grey, and what is brighter than without the scene is lost ([`CatcherOutput::Shadows`]).

use super::{Channel, Film, PixelType, Reduction, Source};
use crate::scene::CatcherOutput;
use std::borrow::Cow;

/// Names of the layer that stays, and of what is only needed on the way.
const LAYER: [&str; 3] = ["ShadowCatcher.R", "ShadowCatcher.G", "ShadowCatcher.B"];
const WITHOUT: [&str; 3] = ["catcher_without.R", "catcher_without.G", "catcher_without.B"];
const SHARE: [&str; 1] = ["catcher_share.V"];

/// Parts that samples bring for shadow catchers: radiance with the scene, without, and whether it was one.
pub const CATCHER_PARTS: usize = 3;

/// Less light than this counts as none: nothing to compare with.
const DARK: f32 = 1e-12;

impl Channel {
    /// What films of scenes with shadow catchers hold besides.
    pub fn of_catchers() -> [Channel; CATCHER_PARTS] {
        [&LAYER[..], &WITHOUT, &SHARE].map(|names| Channel {
            names: names.iter().map(|&name| Cow::Borrowed(name)).collect(),
            pixel_type: PixelType::Half,
            source: Source::PartOfColor,
            reduction: Reduction::Mean,
        })
    }
}

impl Film {
    /// Turns what was found on shadow catchers into colour and alpha, and into the layer of factors. Does nothing without
    /// catchers, and the second time.
    pub fn settle_catchers(&mut self, caught: CatcherOutput) {
        let plane = |name: &str| self.plane(name).map(super::Values::into_floats);
        let Some(share) = plane(SHARE[0]) else { return };
        let of = |names: [&str; 3]| names.map(|name| plane(name).unwrap_or_default());
        let (with, without) = (of(LAYER), of(WITHOUT));
        let mut factors = [(); 3].map(|()| Vec::with_capacity(share.len()));
        for (pixel, &share) in share.iter().enumerate() {
            let (with, without) = ([0, 1, 2].map(|c| with[c][pixel]), [0, 1, 2].map(|c| without[c][pixel]));
            let ratio = |c: usize| if without[c] > DARK { with[c] / without[c] } else { 1.0 };
            let least = match caught {
                CatcherOutput::All => (0..3).map(ratio).fold(1.0, f32::min).max(0.0),
                CatcherOutput::Shadows => ((0..3).map(ratio).sum::<f32>() / 3.0).clamp(0.0, 1.0),
            };
            let (sum, count) = self.color_of(pixel);
            for c in 0..3 {
                let taken = match caught {
                    CatcherOutput::All => least * without[c],
                    CatcherOutput::Shadows => with[c],
                };
                let left = sum[c] / count.max(1.0) - f64::from(taken);
                // Nothing but rounding.
                let is_nothing = left.abs() <= f64::from(1e-6 * taken.max(without[c]));
                sum[c] = if is_nothing { 0.0 } else { left * count };
                factors[c].push(1.0 + share * (ratio(c) - 1.0));
            }
            sum[3] += f64::from((1.0 - least) * share) * count;
        }
        self.set_means(LAYER[0], [&factors[0], &factors[1], &factors[2]]);
        self.forget_channels([WITHOUT[0], SHARE[0]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::FilmTile;

    /// Two pixels of two samples each: the first sees a catcher by one of them.
    fn film(with: [f32; 3], without: [f32; 3]) -> Film {
        let mut film = Film::try_new(2, 1, Channel::of_catchers()).expect("there is memory");
        let mut tile: FilmTile = film.tile(0, 0, 2, 1);
        let none = [[0.0; 3]; 3];
        tile.add_with_parts(0, with, 0.0, None, &[with, without, [1.0; 3]], false);
        for (pixel, rgb) in [(0, [0.5; 3]), (1, [0.25; 3]), (1, [0.25; 3])] {
            tile.add_with_parts(pixel, rgb, 1.0, None, &none, false);
        }
        film.merge(tile);
        film
    }

    #[test]
    fn laid_over_the_plate_it_shows_what_the_catcher_would() {
        for (with, without) in [
            ([0.2, 0.2, 0.2], [0.4, 0.4, 0.4]),
            ([0.2, 0.5, 0.3], [0.4, 0.4, 0.4]),
            ([0.5, 0.5, 0.6], [0.4, 0.4, 0.4]),
            ([0.4, 0.4, 0.4], [0.4, 0.4, 0.4]),
            ([0.0, 0.0, 0.0], [0.4, 0.4, 0.4]),
            ([0.1, 0.2, 0.3], [0.0, 0.0, 0.0]),
        ] {
            let mut film = film(with, without);
            film.settle_catchers(CatcherOutput::All);
            let [r, g, b, alpha] = film.mean_rgba(0, 0);
            for c in 0..3 {
                let whole = [r, g, b][c] + (1.0 - alpha) * without[c];
                let truth = 0.5 * with[c] + 0.5 * 0.5;
                assert!((whole - truth).abs() < 1e-6, "{with:?} of {without:?}: {whole}, not {truth}");
                assert!([r, g, b][c] >= 0.25 - 1e-6, "{with:?} of {without:?}: {r} {g} {b} {alpha}");
            }
            assert_eq!(film.mean_rgba(1, 0), [0.25, 0.25, 0.25, 1.0]);
            assert_eq!(film.channels().len(), 2);
        }
    }

    #[test]
    fn grey_shadows_are_alpha_alone() {
        let mut film = film([0.1; 3], [0.4; 3]);
        film.settle_catchers(CatcherOutput::All);
        let [r, g, b, alpha] = film.mean_rgba(0, 0);
        assert!([r, g, b].iter().all(|v| (v - 0.25).abs() < 1e-6) && (alpha - 0.5 - 0.375).abs() < 1e-6);
        let factor = film.plane("ShadowCatcher.R").expect("the layer").into_floats();
        assert!((factor[0] - (0.5 + 0.5 * 0.25)).abs() < 1e-6 && factor[1] == 1.0);
        let before = film.rgba();
        film.settle_catchers(CatcherOutput::All);
        assert_eq!(film.rgba(), before);
    }

    /// Half of the pixel is the catcher; the rest of it stays.
    #[test]
    fn shadows_alone_are_the_mean_of_the_channels() {
        for (with, without, alpha) in [
            ([0.1, 0.2, 0.3], [0.4, 0.4, 0.4], 0.5),
            ([0.4, 0.2, 0.9], [0.4, 0.4, 0.4], 0.0),
            ([0.0, 0.2, 0.5], [0.4, 0.4, 0.5], 0.5),
            ([0.1, 0.1, 0.1], [0.2, 0.1, 0.0], 1.0 / 6.0),
        ] {
            let mut film = film(with, without);
            film.settle_catchers(CatcherOutput::Shadows);
            let [r, g, b, a] = film.mean_rgba(0, 0);
            let is_rest = [r, g, b].iter().all(|v| (v - 0.25).abs() < 1e-6);
            assert!(
                is_rest && (a - 0.5 - 0.5 * alpha).abs() < 1e-6,
                "{with:?} of {without:?}: {r} {g} {b} {a}"
            );
        }
    }
}
