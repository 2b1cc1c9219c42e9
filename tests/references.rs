//! Pictures of the whole program against converged references that another renderer made.

mod support;

use oscura::film::Film;
use oscura::image::Image;
use oscura::load::image::load_linear_rgb;
use oscura::load::load;
use oscura::metrics::z_test;
use oscura::render::RenderOptions;
use std::path::{Path, PathBuf};
use support::{options, picture};

/// Edge of the pictures rendered here, pixels.
const SIZE: u32 = 64;

/// A file of references; says so and gives `None` where it is absent.
fn reference(name: &str) -> Option<PathBuf> {
    let shared = std::env::var_os("OSCURA_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let path = shared.join("refs").join(name);
    if !path.is_file() {
        println!("skipped: {} is absent", path.display());
        return None;
    }
    Some(path)
}

/// The means of square blocks, times `factor`: box-filtered pixels of `SIZE` x `SIZE` larger ones.
fn shrunk(image: &Image, factor: f64) -> Image {
    let block = image.width / SIZE;
    assert_eq!((image.width, image.height), (block * SIZE, block * SIZE), "{}", image.name);
    let mut rgb = Vec::new();
    for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
        let inside = (0..block * block).map(|i| image.rgba(x * block + i % block, y * block + i / block));
        let sum = inside.fold([0.0; 3], |s, p| [0, 1, 2].map(|c| s[c] + f64::from(p[c])));
        rgb.extend(sum.map(|s| (s * factor / f64::from(block * block)) as f32));
    }
    Image::from_linear_rgb("shrunk", SIZE, SIZE, rgb)
}

fn to_image(film: &Film) -> Image {
    let pixels = (0..film.height()).flat_map(|y| (0..film.width()).map(move |x| (x, y)));
    let rgb = pixels.flat_map(|(x, y)| film.mean_rgba(x, y).into_iter().take(3)).collect();
    Image::from_linear_rgb("render", film.width(), film.height(), rgb)
}

/// Tolerance: the mean of each channel within 4 standard errors, at most 2 % of the 8 x 8 blocks beyond 3. The standard
/// errors are those of both pictures together, and must themselves be below 0.4 % of the mean.
#[test]
fn the_cornell_box_agrees_with_another_renderer() {
    let (Some(means), Some(variances)) = (reference("S1_cornell.ref.exr"), reference("S1_cornell.var.exr"))
    else {
        return;
    };
    let means = load_linear_rgb(&means).expect("the reference");
    let variances = load_linear_rgb(&variances).expect("its variance");
    let pixels_a_block = f64::from(means.width / SIZE).powi(2);

    let asset = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cornell-box.gltf");
    let scene = load(&asset, &Default::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    let shot = |seed| to_image(&picture(&scene, &RenderOptions { seed, ..options(SIZE, 256, 100) }));
    let (a, b) = (shot(1), shot(2));
    let test =
        z_test(&a, &b, &shrunk(&means, 1.0), &shrunk(&variances, 1.0 / pixels_a_block)).expect("many blocks");
    println!("{test:?}; z {:?}", test.channels.map(|c| c.z()));
    for channel in &test.channels {
        assert!(channel.sigma < 0.004 * channel.reference, "too noisy to tell: {channel:?}");
    }
    assert!(test.agrees(), "{test:?}");

    // The test can tell: 4 % less light is not the same picture.
    let dimmer = |image: &Image| shrunk(image, 0.96);
    let dimmed =
        z_test(&dimmer(&a), &dimmer(&b), &shrunk(&means, 1.0), &shrunk(&variances, 1.0 / pixels_a_block));
    assert!(!dimmed.expect("many blocks").agrees(), "{dimmed:?}");
}
