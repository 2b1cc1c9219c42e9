//! The film: where samples become pixels. Threads fill [`FilmTile`]s; the renderer merges them in a fixed order.
//!
//! Every sample belongs to one pixel (filters are importance-sampled, see [`FilterSampler`]), so a pixel is a sum and a
//! count. Sums are f64: adding f32 values to them loses nothing that a picture could show, however many samples.

mod filter;
mod tile;

pub use filter::FilterSampler;
pub use tile::FilmTile;

use crate::error::{Error, Result};

/// The depth written where no sample of a pixel hit a surface, metres.
pub const BACKGROUND_DEPTH: f32 = 1e10;

/// Which arbitrary output variables a picture carries besides colour. What isn't asked for is neither stored nor
/// computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AovSet {
    /// Depth of the first surface as seen from the camera, metres.
    pub depth: bool,
    /// Shading normal of the first surface in world space.
    pub normal: bool,
    /// Reflectance of the first surface.
    pub albedo: bool,
}

impl AovSet {
    /// Is anything asked for?
    #[inline(always)]
    pub fn any(self) -> bool {
        self.depth || self.normal || self.albedo
    }
}

/// What the first surface along a sample looks like, for the AOVs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AovSample {
    /// Depth in metres.
    pub depth: f32,
    /// Unit normal in world space.
    pub normal: [f32; 3],
    /// Reflectance.
    pub albedo: [f32; 3],
}

/// Sums of everything that samples bring, one entry a pixel. Lists of AOVs that nobody asked for are empty.
#[derive(Clone, Debug, Default, PartialEq)]
struct Sums {
    /// Red, green, blue, alpha.
    rgba: Vec<[f64; 4]>,
    /// Samples in `rgba`.
    count: Vec<u32>,
    /// Depths of the samples that hit something.
    depth: Vec<f64>,
    normal: Vec<[f64; 3]>,
    albedo: Vec<[f64; 3]>,
    /// Samples in the AOVs that hit something.
    hits: Vec<u32>,
}

impl Sums {
    fn new(pixels: usize, aovs: AovSet) -> Sums {
        Sums::try_new(pixels, aovs).expect("there is memory for the sums")
    }

    /// Like [`Sums::new`]; `None` if the memory isn't there.
    fn try_new(pixels: usize, aovs: AovSet) -> Option<Sums> {
        fn zeros<T: bytemuck::Zeroable>(count: usize) -> Option<Vec<T>> {
            bytemuck::try_zeroed_vec(count).ok()
        }
        let only_if = |wanted: bool| if wanted { pixels } else { 0 };
        Some(Sums {
            rgba: zeros(pixels)?,
            count: zeros(pixels)?,
            depth: zeros(only_if(aovs.depth))?,
            normal: zeros(only_if(aovs.normal))?,
            albedo: zeros(only_if(aovs.albedo))?,
            hits: zeros(only_if(aovs.any()))?,
        })
    }

    /// Bytes of the lists for one pixel.
    fn bytes_per_pixel(aovs: AovSet) -> u64 {
        let only_if = |wanted: bool, bytes: usize| if wanted { bytes as u64 } else { 0 };
        let (f, n) = (size_of::<f64>(), size_of::<u32>());
        only_if(true, 4 * f + n)
            + only_if(aovs.depth, f)
            + only_if(aovs.normal, 3 * f)
            + only_if(aovs.albedo, 3 * f)
            + only_if(aovs.any(), n)
    }

    /// Adds one row of another set of sums.
    fn add_row(&mut self, at: usize, other: &Sums, from: usize, length: usize) {
        fn add<const N: usize>(into: &mut [[f64; N]], from: &[[f64; N]]) {
            for (sum, value) in into.iter_mut().flatten().zip(from.iter().flatten()) {
                *sum += value;
            }
        }
        fn count(into: &mut [u32], from: &[u32]) {
            for (sum, value) in into.iter_mut().zip(from) {
                *sum = sum.saturating_add(*value);
            }
        }
        let (here, there) = (at..at + length, from..from + length);
        add(&mut self.rgba[here.clone()], &other.rgba[there.clone()]);
        count(&mut self.count[here.clone()], &other.count[there.clone()]);
        if !self.depth.is_empty() {
            for (sum, value) in self.depth[here.clone()].iter_mut().zip(&other.depth[there.clone()]) {
                *sum += value;
            }
        }
        if !self.normal.is_empty() {
            add(&mut self.normal[here.clone()], &other.normal[there.clone()]);
        }
        if !self.albedo.is_empty() {
            add(&mut self.albedo[here.clone()], &other.albedo[there.clone()]);
        }
        if !self.hits.is_empty() {
            count(&mut self.hits[here], &other.hits[there]);
        }
    }
}

/// A picture being made: sums and counts for every pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    aovs: AovSet,
    sums: Sums,
    invalid_samples: u64,
}

impl Film {
    /// An empty film of `width` by `height` pixels.
    ///
    /// # Panics
    /// If there is no memory for it; see [`Film::try_new`].
    pub fn new(width: u32, height: u32, aovs: AovSet) -> Film {
        let sums = Sums::new(width as usize * height as usize, aovs);
        Film { width, height, aovs, sums, invalid_samples: 0 }
    }

    /// An empty film of `width` by `height` pixels.
    ///
    /// # Errors
    /// A usage error that tells how much memory it takes, if that isn't there.
    pub fn try_new(width: u32, height: u32, aovs: AovSet) -> Result<Film> {
        let pixels = u64::from(width) * u64::from(height);
        let sums = usize::try_from(pixels).ok().and_then(|pixels| Sums::try_new(pixels, aovs));
        let sums = sums.ok_or_else(|| {
            let gib = pixels as f64 * Sums::bytes_per_pixel(aovs) as f64 / f64::from(1u32 << 30);
            Error::usage(format!(
                "a picture of {width} x {height} pixels takes {gib:.1} GiB of memory, which the system refuses"
            ))
            .with_help("make it smaller, or leave out --aov")
        })?;
        Ok(Film { width, height, aovs, sums, invalid_samples: 0 })
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// What it carries besides colour.
    pub fn aovs(&self) -> AovSet {
        self.aovs
    }

    /// Samples that were NaN or infinite and therefore left out of their pixels.
    pub fn invalid_samples(&self) -> u64 {
        self.invalid_samples
    }

    /// Pixels without a valid sample: black and transparent, because rendering stopped before or all samples were NaN.
    pub fn unsampled_pixels(&self) -> u64 {
        self.sums.count.iter().filter(|&&n| n == 0).count() as u64
    }

    /// An empty tile for the rectangle that starts at (`x0`, `y0`), cut off at the film's edges.
    pub fn tile(&self, x0: u32, y0: u32, width: u32, height: u32) -> FilmTile {
        let (x0, y0) = (x0.min(self.width), y0.min(self.height));
        FilmTile::new(x0, y0, width.min(self.width - x0), height.min(self.height - y0), self.aovs)
    }

    /// Adds a tile. For the same picture at any number of threads, merge the tiles that share pixels in one order.
    ///
    /// # Panics
    /// If the tile reaches beyond the film or carries other AOVs.
    pub fn merge(&mut self, tile: FilmTile) {
        assert!(
            tile.x0 + tile.width <= self.width && tile.y0 + tile.height <= self.height,
            "a tile reaches beyond the film"
        );
        assert_eq!(tile.aovs, self.aovs, "a tile carries other AOVs than the film");
        for row in 0..tile.height {
            let at = self.index(tile.x0, tile.y0 + row);
            let from = row as usize * tile.width as usize;
            self.sums.add_row(at, &tile.sums, from, tile.width as usize);
        }
        self.invalid_samples += tile.invalid_samples;
    }

    /// Mean colour and alpha of a pixel, premultiplied; zero where there are no samples yet.
    pub fn mean_rgba(&self, x: u32, y: u32) -> [f32; 4] {
        let at = self.index(x, y);
        let scale = reciprocal(self.sums.count[at]);
        self.sums.rgba[at].map(|sum| (sum * scale) as f32)
    }

    /// Valid samples that a pixel has.
    pub fn samples(&self, x: u32, y: u32) -> u32 {
        self.sums.count[self.index(x, y)]
    }

    /// Mean depth of the samples that hit something, metres; [`BACKGROUND_DEPTH`] where none did. `None` if depth
    /// wasn't asked for.
    pub fn depth(&self, x: u32, y: u32) -> Option<f32> {
        let at = self.index(x, y);
        let sum = *self.sums.depth.get(at)?;
        let hits = self.sums.hits[at];
        Some(if hits == 0 { BACKGROUND_DEPTH } else { (sum * reciprocal(hits)) as f32 })
    }

    /// Mean normal over all samples (zero for those that hit nothing). `None` if normals weren't asked for.
    pub fn normal(&self, x: u32, y: u32) -> Option<[f32; 3]> {
        self.mean_of(&self.sums.normal, x, y)
    }

    /// Mean reflectance over all samples (zero for those that hit nothing). `None` if it wasn't asked for.
    pub fn albedo(&self, x: u32, y: u32) -> Option<[f32; 3]> {
        self.mean_of(&self.sums.albedo, x, y)
    }

    fn mean_of(&self, list: &[[f64; 3]], x: u32, y: u32) -> Option<[f32; 3]> {
        let at = self.index(x, y);
        let scale = reciprocal(self.sums.count[at]);
        list.get(at).map(|sum| sum.map(|s| (s * scale) as f32))
    }

    fn index(&self, x: u32, y: u32) -> usize {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) is outside the film");
        y as usize * self.width as usize + x as usize
    }
}

fn reciprocal(count: u32) -> f64 {
    if count == 0 { 0.0 } else { 1.0 / f64::from(count) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: AovSet = AovSet { depth: true, normal: true, albedo: true };

    #[test]
    fn a_pixel_is_the_mean_of_its_samples() {
        let mut film = Film::new(3, 2, AovSet::default());
        let mut tile = film.tile(1, 1, 2, 1);
        tile.add(1, [1.0, 2.0, 3.0], 1.0);
        tile.add(1, [3.0, 2.0, 1.0], 0.0);
        film.merge(tile);
        assert_eq!(film.mean_rgba(2, 1), [2.0, 2.0, 2.0, 0.5]);
        assert_eq!(film.mean_rgba(1, 1), [0.0; 4]);
        assert_eq!((film.samples(2, 1), film.samples(0, 0)), (2, 0));
        assert_eq!((film.depth(2, 1), film.normal(2, 1), film.albedo(2, 1)), (None, None, None));
    }

    #[test]
    fn a_film_that_does_not_fit_says_what_it_takes() {
        let error = Film::try_new(u32::MAX, u32::MAX, ALL).expect_err("2^64 pixels");
        assert!(error.to_string().contains("GiB"), "{error}");
        let one = Film::try_new(3, 2, ALL).expect("six pixels");
        assert_eq!(one, Film::new(3, 2, ALL));
        assert_eq!(one.unsampled_pixels(), 6);
    }

    #[test]
    fn sums_do_not_drift() {
        // 2^24 additions of 0.1 in f32 end at about 2.1 M instead of 1.68 M.
        let mut film = Film::new(1, 1, AovSet::default());
        let mut tile = film.tile(0, 0, 1, 1);
        for _ in 0..1 << 24 {
            tile.add(0, [0.1, 1e-6, 1e6], 1.0);
        }
        film.merge(tile);
        assert_eq!(film.mean_rgba(0, 0), [0.1, 1e-6, 1e6, 1.0]);
    }

    #[test]
    fn invalid_samples_are_counted_and_left_out() {
        let mut film = Film::new(1, 1, AovSet::default());
        let mut tile = film.tile(0, 0, 1, 1);
        tile.add(0, [1.0; 3], 1.0);
        tile.add(0, [f32::NAN, 0.0, 0.0], 1.0);
        tile.add(0, [0.0, f32::INFINITY, 0.0], 1.0);
        tile.add(0, [0.0, 0.0, f32::NEG_INFINITY], 1.0);
        tile.add(0, [0.0; 3], f32::NAN);
        film.merge(tile);
        assert_eq!(film.mean_rgba(0, 0), [1.0; 4]);
        assert_eq!((film.samples(0, 0), film.invalid_samples()), (1, 4));
    }

    #[test]
    fn tiles_are_cut_at_the_edges_and_merge_in_any_place() {
        let mut film = Film::new(5, 5, ALL);
        for (x, y) in [(0, 0), (4, 0), (0, 4), (4, 4)] {
            let mut tile = film.tile(x, y, 4, 4);
            for pixel in 0..tile.width * tile.height {
                tile.add(pixel, [1.0; 3], 1.0);
            }
            film.merge(tile);
        }
        for (x, y) in (0..5).flat_map(|y| (0..5).map(move |x| (x, y))) {
            assert_eq!(film.samples(x, y), 1);
        }
        let outside = film.tile(9, 9, 4, 4);
        assert_eq!((outside.width, outside.height), (0, 0));
    }

    #[test]
    fn depth_is_a_mean_over_hits_and_the_rest_over_all_samples() {
        let mut film = Film::new(2, 1, ALL);
        let mut tile = film.tile(0, 0, 2, 1);
        let hit = AovSample { depth: 4.0, normal: [0.0, 1.0, 0.0], albedo: [0.5, 0.25, 1.0] };
        for sample in [Some(hit), None] {
            tile.add(0, [0.0; 3], 1.0);
            tile.add_aovs(0, sample);
            tile.add(1, [0.0; 3], 1.0);
            tile.add_aovs(1, None);
        }
        film.merge(tile);
        assert_eq!(film.depth(0, 0), Some(4.0));
        assert_eq!(film.normal(0, 0), Some([0.0, 0.5, 0.0]));
        assert_eq!(film.albedo(0, 0), Some([0.25, 0.125, 0.5]));
        assert_eq!(film.depth(1, 0), Some(BACKGROUND_DEPTH));
        assert_eq!(film.normal(1, 0), Some([0.0; 3]));
    }
}
