//! The bands of a film: rows that threads add to without meeting those that add to others.

use super::Values;
use super::channel::{Channel, Reduction, Source};
use super::layout::Layout;
use super::rect::Rect;
use super::splats::{Splat, Splats};
use super::sums::Sums;
use super::tile::FilmTile;

/// Some rows of a film: all that is kept of their pixels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Band {
    pub sums: Sums,
    /// Light from paths of lamps, once there is some.
    pub splats: Option<Splats>,
}

impl Band {
    /// Without samples; `None` if the memory isn't there.
    pub fn try_new(pixels: usize, layout: &Layout) -> Option<Band> {
        Some(Band { sums: Sums::try_new(pixels, layout)?, splats: None })
    }

    pub fn pixels(&self) -> usize {
        self.sums.count.len()
    }

    /// The sums of splats, from now on there.
    pub fn splats(&mut self, layout: &Layout) -> &mut Splats {
        self.splats.get_or_insert_with(|| Splats::new(self.sums.count.len(), layout))
    }

    /// Adds what of a tile is within the band, which stands at a place of the picture.
    pub fn add_tile(&mut self, own: Rect, tile: &FilmTile) {
        for (at, from, length) in own.rows_of(tile.place()) {
            self.sums.add_tile_row(at, &tile.sums, from, length, &tile.layout);
        }
    }

    /// Adds what of another band is within this one.
    pub fn add_band(&mut self, own: Rect, other: &Band, place: Rect, layout: &Layout) {
        for (at, from, length) in own.rows_of(place) {
            self.sums.add_row(at, &other.sums, from, length, layout);
            if let Some(theirs) = &other.splats {
                let ours = self.splats(layout);
                (0..length).for_each(|i| ours.merge(at + i, theirs, from + i));
            }
        }
    }

    /// Adds splats. Those outside the band are left out; gives the number of those that are not finite and left out, too.
    pub fn add_splats(
        &mut self,
        own: Rect,
        splats: &[Splat],
        is_of_first_half: bool,
        layout: &Layout,
    ) -> u64 {
        let (width, height) = (own.width(), own.height());
        let sums = self.splats(layout);
        let mut invalid = 0;
        for splat in splats {
            let (x, y) = (splat.x.wrapping_sub(own.x0), splat.y.wrapping_sub(own.y0));
            if x < width && y < height {
                let pixel = y as usize * width as usize + x as usize;
                invalid += u64::from(!sums.add(pixel, splat, is_of_first_half));
            }
        }
        invalid
    }

    /// Mean colour and alpha of a pixel, premultiplied; zero where there are no samples yet.
    pub fn mean(&self, pixel: usize) -> [f32; 4] {
        let of_splats = self.splats.as_ref().map_or([0.0; 3], |splats| splats.mean(pixel));
        self.sums.mean_rgba_with(pixel, of_splats)
    }

    /// The means of a pixel's halves, and of how many samples they are.
    pub fn halves(&self, pixel: usize) -> ([[f32; 3]; 2], [u32; 2]) {
        let (means, counts) = self.sums.halves(pixel);
        let splats = self.splats.as_ref().map_or([[0.0; 3]; 2], |splats| splats.halves(pixel));
        let with = |half: usize, c: usize| (f64::from(means[half][c]) + splats[half][c]) as f32;
        ([0, 1].map(|half| [0, 1, 2].map(|c| with(half, c))), counts)
    }

    /// The values of a channel beyond colour, which is this one of the layers if it is one.
    pub fn planes(&self, index: usize, channel: &Channel, layer: usize) -> Vec<Values> {
        let mut planes = self.sums.planes(index, channel);
        let Some(splats) = &self.splats else { return planes };
        if channel.source == Source::PartOfColor {
            splats.means_of_layer(layer).into_iter().for_each(|means| add(&mut planes, means));
        } else if channel.reduction == Reduction::VarianceOfMean {
            splats.variances().into_iter().for_each(|variances| add(&mut planes, variances));
        }
        planes
    }
}

/// Adds values to those of planes, as many a pixel as there are planes.
fn add(planes: &mut [Values], values: impl Iterator<Item = [f64; 3]>) {
    for (pixel, values) in values.enumerate() {
        for (plane, value) in planes.iter_mut().zip(values) {
            if let Values::Float(plane) = plane {
                plane[pixel] = (f64::from(plane[pixel]) + value) as f32;
            }
        }
    }
}
