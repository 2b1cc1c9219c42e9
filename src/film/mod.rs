//! The film accumulates samples. Threads fill [`FilmTile`]s, which are merged into the film.
//!
//! Every sample belongs to one pixel (filters are importance-sampled, see [`FilterSampler`]), so a pixel is a sum and a count. Tiles have
//! plain f64 sums, precise enough for any number of samples. The film has exact sums (`exact_sum.rs`), so that tiles and films may be
//! added in any order. It consists of bands of rows (`band.rs`), to which several threads add concurrently.

mod aov;
mod band;
mod channel;
mod cryptomatte;
mod exact_sum;
mod filter;
mod picture;
mod serialize;
mod shared;
mod splats;
mod tile;

pub use aov::{Aov, AovInfo, AovSet, AovSpace, BACKGROUND_DEPTH, MATTE_LEVELS};
pub use channel::{Channel, LIGHT_GROUP, Layout, PixelType, Reduction, Source, Values};
pub use cryptomatte::{MatteIds, matte_id, matte_key};
pub use filter::FilterSampler;
pub use picture::{CATCHER_PARTS, Film, Plane};
pub use shared::SharedFilm;
pub use splats::{Splat, SplatPart};
pub use tile::FilmTile;

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> AovSet {
        Aov::ALL.iter().copied().collect()
    }

    fn floats(film: &Film, name: &str) -> Vec<f32> {
        film.plane(name).unwrap_or_else(|| panic!("no plane {name}")).into_floats()
    }

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
        assert_eq!(floats(&film, "G")[5], 2.0);
        assert_eq!(film.rgba()[5], [2.0, 2.0, 2.0, 0.5]);
        assert_eq!((film.channels().len(), film.plane("Z")), (1, None));
    }

    #[test]
    fn films_beyond_the_memory_are_an_error_with_their_size() {
        let error = Film::try_new(u32::MAX, u32::MAX, all().channels()).expect_err("2^64 pixels");
        assert!(error.to_string().contains("GiB"), "{error}");
        let one = Film::try_new(3, 2, all().channels()).expect("six pixels");
        assert_eq!(one, Film::new(3, 2, all()));
        assert_eq!(one.unsampled_pixels(), 6);
    }

    #[test]
    fn sums_of_many_samples_are_precise() {
        // 2^24 additions of 0.1 in f32 give about 2.1 million instead of 1.68 million.
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
    fn tiles_are_clipped_at_the_edges_of_the_film() {
        let mut film = Film::new(5, 5, all());
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

    /// A film of one pixel after samples, each with the values of a first hit or none, merged in tiles of the given sizes.
    fn reduced(channel: Channel, samples: &[Option<&[f32]>], tiles: &[usize]) -> Film {
        let mut film = Film::try_new(1, 1, [channel]).expect("one pixel");
        let mut rest = samples;
        for &size in tiles {
            let (own, others) = rest.split_at(size);
            let mut tile = film.tile(0, 0, 1, 1);
            own.iter().for_each(|hit| tile.add_with_first_hit(0, [0.0; 3], 1.0, *hit));
            film.merge(tile);
            rest = others;
        }
        assert!(rest.is_empty());
        film
    }

    #[test]
    fn first_hits_are_reduced_by_the_reduction_of_the_channel() {
        let depths: [Option<&[f32]>; 4] = [None, Some(&[4.0]), Some(&[2.0]), None];
        let cases = [
            (Reduction::Mean, 1.5, 0.0),
            (Reduction::MeanOfHits { empty: 9.0 }, 3.0, 9.0),
            (Reduction::Minimum { empty: 9.0 }, 2.0, 9.0),
            (Reduction::First, 4.0, 0.0),
            (Reduction::Count, 2.0, 0.0),
            // Of 0, 4, 2, 0: (20 - 36 / 4) / 3 / 4.
            (Reduction::VarianceOfMean, 11.0 / 12.0, 0.0),
        ];
        for (reduction, expected, empty) in cases {
            let channel = Channel { reduction, ..Channel::from(Aov::Depth) };
            for tiles in [&[4][..], &[2, 2], &[1, 1, 1, 1], &[0, 3, 1]] {
                assert_eq!(
                    floats(&reduced(channel.clone(), &depths, tiles), "Z"),
                    [expected],
                    "{reduction:?}"
                );
            }
            assert_eq!(floats(&reduced(channel, &[None, None], &[1, 1]), "Z"), [empty], "{reduction:?}");
        }
    }

    #[test]
    fn ids_are_ranked_by_their_fraction_of_all_samples() {
        let names = ["crypto00.R", "crypto00.G", "crypto00.B", "crypto00.A"].map(std::borrow::Cow::Borrowed);
        let channel =
            Channel { names: names.to_vec(), reduction: Reduction::Coverage, ..Channel::from(Aov::Depth) };
        let ids = [0x3f80_0001, 0x4100_0000, 0x4200_0000].map(f32::from_bits);
        let [a, b, c] = ids.each_ref().map(|id| Some(std::slice::from_ref(id)));
        let samples = [a, b, None, b, c, a, b, None];
        let expected = [ids[1], 3.0 / 8.0, ids[0], 2.0 / 8.0].map(f32::to_bits);
        for tiles in [&[8][..], &[3, 5], &[1, 6, 1]] {
            let film = reduced(channel.clone(), &samples, tiles);
            let values = names.each_ref().map(|name| floats(&film, name)[0].to_bits());
            assert_eq!(values, expected);
        }
        let film = reduced(channel, &[None], &[1]);
        assert!(names.iter().all(|name| floats(&film, name) == [0.0]));
    }

    #[test]
    fn sample_count_and_variance_of_colour() {
        let mut film = Film::new(3, 1, [Aov::Samples, Aov::Variance].into());
        for value in [1.0, 3.0, 8.0] {
            let mut tile = film.tile(0, 0, 2, 1);
            tile.add_with_first_hit(0, [value, 2.0, 0.1 * value], 1.0, None);
            if value == 1.0 {
                tile.add_with_first_hit(1, [value; 3], 1.0, None);
                tile.add_with_first_hit(1, [f32::NAN; 3], 1.0, None);
            }
            film.merge(tile);
        }
        assert_eq!(film.plane("samples"), Some(Values::Uint(vec![3, 1, 0])));
        // Deviations of -3, -1, 4 from the mean: 26 / 2 / 3.
        assert_eq!(floats(&film, "variance.R"), [26.0f32 / 6.0, f32::INFINITY, f32::INFINITY]);
        assert_eq!(floats(&film, "variance.G")[0], 0.0);
        assert!((floats(&film, "variance.B")[0] - 0.01 * 26.0 / 6.0).abs() < 1e-7);
    }

    #[test]
    fn planes_are_listed_in_order_and_non_finite_hits_count_as_misses() {
        let aovs = AovSet::from([Aov::Depth, Aov::Samples, Aov::MaterialId, Aov::Normal]);
        let mut film = Film::new(2, 1, aovs);
        let mut tile = film.tile(0, 0, 2, 1);
        let hit = |depth: f32| [depth, 0.0, 1.0, 0.0, f32::from_bits(7)];
        tile.add_with_first_hit(0, [1.0; 3], 1.0, Some(&hit(4.0)));
        tile.add_with_first_hit(0, [1.0; 3], 1.0, None);
        tile.add_with_first_hit(1, [1.0; 3], 1.0, Some(&hit(f32::NAN)));
        film.merge(tile);
        let names: Vec<&str> = film.planes().map(|plane| plane.name).collect();
        assert_eq!(names, ["R", "G", "B", "A", "Z", "N.X", "N.Y", "N.Z", "material.id", "samples"]);
        assert_eq!(floats(&film, "Z"), [4.0, BACKGROUND_DEPTH]);
        assert_eq!(floats(&film, "N.Y"), [0.5, 0.0]);
        assert_eq!(film.plane("material.id"), Some(Values::Uint(vec![7, 0])));
        assert_eq!(film.plane("samples"), Some(Values::Uint(vec![2, 1])));
        for plane in film.planes() {
            assert_eq!(film.plane(plane.name), Some(plane.values), "{}", plane.name);
        }
    }

    #[test]
    fn half_buffers_are_means_of_their_samples() {
        let layout = || Layout::new([]).with_halves(true);
        let mut film = Film::of_layout(2, 1, layout()).expect("two pixels");
        let mut tile = film.tile(0, 0, 2, 1);
        for (value, is_of_first_half) in [(1.0, true), (3.0, true), (f32::NAN, true), (8.0, false)] {
            tile.add_with_parts(1, [value; 3], 1.0, None, &[], is_of_first_half);
        }
        film.merge(tile.clone());
        film.merge(tile);
        assert_eq!(film.halves(), Some([vec![[0.0; 3], [2.0; 3]], vec![[0.0; 3], [8.0; 3]]]));
        assert_eq!((film.mean_rgba(1, 0), film.planes().count()), ([4.0, 4.0, 4.0, 1.0], 4));
        assert_eq!(Film::new(2, 1, AovSet::default()).halves(), None);
    }
}
