//! Changes of finished films: what a denoiser puts in place of what was rendered, and single pixels taken out.

use super::splats::Splats;
use super::{Aov, Film, Layout, Reduction, Source};
use crate::error::Result;
use std::sync::Arc;

impl Film {
    /// One pixel as a film of its own: its numbers without those of all others.
    ///
    /// # Errors
    /// As for [`Film::try_new`].
    ///
    /// # Panics
    /// If it is outside the film.
    pub fn pixel(&self, x: u32, y: u32) -> Result<Film> {
        self.index(x, y);
        let layout = Layout::new(self.channels().iter().skip(1).cloned()).with_halves(self.layout.has_halves);
        let mut film = Film::of_layout(1, 1, layout)?;
        film = film.at(self.origin.0 + x, self.origin.1 + y);
        film.add_bands(self);
        Ok(film)
    }

    /// Puts other colours in place of the mean colours, rows from the top. Alpha and numbers of samples stay.
    ///
    /// # Panics
    /// If there are fewer values than pixels.
    pub fn set_color(&mut self, color: [&[f32]; 3]) {
        let mut from = 0;
        for band in &mut self.bands {
            band.sums.set_color(color.map(|values| &values[from..]));
            band.splats.iter_mut().for_each(Splats::clear_color);
            from += band.pixels();
        }
    }

    /// Puts other values in place of those of a channel that has means over all samples, given by the name of its first
    /// component. Does nothing if there is none.
    ///
    /// # Panics
    /// If there are fewer values than pixels.
    pub fn set_means(&mut self, first: &str, values: [&[f32]; 3]) {
        let index =
            self.channels().iter().position(|c| c.names[0] == first && c.reduction == Reduction::Mean);
        let Some(index) = index.filter(|index| *index > 0) else { return };
        let (layer, mut from) = (self.layer_of(index), 0);
        for band in &mut self.bands {
            let pixels = band.pixels();
            band.sums.set_means(index - 1, values.map(|values| &values[from..]));
            if let Some(of_layer) = band.splats.as_mut().and_then(|splats| splats.layers.get_mut(layer)) {
                *of_layer = Splats::list(pixels);
            }
            from += pixels;
        }
    }

    /// Forgets AOVs that only the way to the picture needed.
    pub fn forget(&mut self, aovs: impl IntoIterator<Item = Aov>) {
        self.forget_channels(aovs.into_iter().map(|aov| aov.info().names[0]));
    }

    /// The same for channels by the names of their first components.
    pub(super) fn forget_channels<'a>(&mut self, first_names: impl IntoIterator<Item = &'a str>) {
        for name in first_names {
            let Some(index) = self.channels().iter().position(|c| c.names[0] == name) else { continue };
            let layer = self.layer_of(index);
            let removed = &self.layout.channels[index];
            let (is_layer, is_variance) =
                (removed.source == Source::PartOfColor, removed.reduction == Reduction::VarianceOfMean);
            let mut channels = self.channels().to_vec();
            channels.remove(index);
            let has_halves = self.layout.has_halves;
            self.layout = Arc::new(Layout::new(channels.into_iter().skip(1)).with_halves(has_halves));
            for band in &mut self.bands {
                match &mut band.splats {
                    Some(splats) if is_layer => drop(splats.layers.remove(layer)),
                    Some(splats) if is_variance => splats.squares = None,
                    _ => {}
                }
                band.sums.remove(index - 1);
                if !self.layout.has_first_hits {
                    band.sums.forget_hits();
                }
            }
        }
    }
}
