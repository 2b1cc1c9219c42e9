//! Pixels of pictures that are compared.

use crate::image::Image;

pub(super) fn rgb(image: &Image, x: u32, y: u32) -> [f64; 3] {
    let [r, g, b, _] = image.rgba(x, y);
    [r, g, b].map(f64::from)
}

pub(super) fn pixels(image: &Image) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (image.width, image.height);
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}

pub(super) fn assert_same_size(images: &[&Image]) {
    assert!(
        images.windows(2).all(|w| (w[0].width, w[0].height) == (w[1].width, w[1].height)),
        "pictures of different sizes can't be compared"
    );
}
