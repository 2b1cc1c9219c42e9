//! What the film of a picture holds.

use super::labels::Labels;
use super::noise;
use super::options::{Caustics, RenderOptions};
use crate::film::{Channel, Layout};

/// The channels of the film of a picture.
pub(super) fn layout(options: &RenderOptions, labels: &Labels) -> Layout {
    let groups = labels.light_groups.iter().map(|name| Channel::light_group(name));
    let caught = options.catchers.then(Channel::of_catchers).into_iter().flatten();
    let further = options.aovs.channels_with(options.matte_levels).chain(groups).chain(caught);
    Layout::new(further).with_halves(options.halves)
}

/// Bytes that light from lamps takes in a film at most, where there is such.
pub fn splat_bytes(options: &RenderOptions, labels: &Labels) -> u64 {
    let region = options.pixels();
    let pixels = u64::from(region.width()) * u64::from(region.height());
    if options.caustics == Caustics::Off {
        0
    } else {
        pixels * layout(options, labels).splat_bytes_per_pixel()
    }
}

/// Bytes that the film of a picture takes, and what its error is estimated by.
pub fn film_bytes(options: &RenderOptions, labels: &Labels) -> u64 {
    let region = options.pixels();
    let of_noise = if options.noise.is_some() { noise::BYTES_PER_PIXEL } else { 0 };
    let a_pixel = layout(options, labels).bytes_per_pixel() + of_noise;
    u64::from(region.width()) * u64::from(region.height()) * a_pixel
}
