//! Images: that there are as many numbers as the size says.

use super::findings::{Findings, Place};
use crate::image::{Image, Pixels};
use crate::scene::{Backdrop, Scene, Texture};

/// What images must be that are more than textures.
pub(super) const DECODED: &str = "decoded";

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    // The environment counts texels that are no numbers as black; textures hand them on.
    let mut is_texture = vec![false; scene.images.len()];
    for texture in &scene.textures {
        if let Texture::Image { image, .. } = texture
            && let Some(is_texture) = is_texture.get_mut(image.index())
        {
            *is_texture = true;
        }
    }
    for (index, image) in scene.images.iter().enumerate() {
        check_image(image, Place { list: "images", index, name: &image.name }, is_texture[index], findings);
    }
    if let Some(Backdrop::Picture(image)) = &scene.backdrop {
        let place = Place { list: "backdrop", index: 0, name: &image.name };
        findings.require(!image.is_encoded(), place, "pixels", "encoded", DECODED);
        check_image(image, Place { list: "backdrop", index: 0, name: &image.name }, true, findings);
    }
}

/// Checks an image, and its numbers as well where those must be finite.
fn check_image(image: &Image, place: Place, is_finite: bool, findings: &mut Findings) {
    findings.require(image.width > 0, place, "width", image.width, "at least 1");
    findings.require(image.height > 0, place, "height", image.height, "at least 1");
    let channels = image.channels;
    findings.require((1..=4).contains(&channels), place, "channels", channels, "1 to 4");
    let length = match &*image.pixels {
        Pixels::U8(list) => list.len(),
        Pixels::U16(list) => list.len(),
        Pixels::F32(list) => list.len(),
        // Whoever decodes them compares their size.
        Pixels::Encoded(_) => return,
    };
    let expected = u128::from(image.width) * u128::from(image.height) * u128::from(channels);
    let is_met = length as u128 == expected;
    findings.require(is_met, place, "length of pixels", length, "width * height * channels");
    if let Pixels::F32(numbers) = &*image.pixels
        && is_finite
    {
        findings.require_finite(numbers, place, "pixels");
    }
}
