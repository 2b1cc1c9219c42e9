//! One level of an image's pyramid: its texels, or where they are found when somebody asks for them.

use super::paged::PagedLevel;
use crate::image::Image;
use std::sync::Arc;

/// A level of a pyramid; the finest one is the image itself.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Its size and its texels, which are [encoded](crate::image::Pixels::Encoded) where the level is not in memory.
    pub image: Image,
    /// Where the texels come from then.
    pub paged: Option<Arc<PagedLevel>>,
}

impl Level {
    /// A level that stays in memory.
    pub fn resident(image: Image) -> Level {
        Level { image, paged: None }
    }

    /// Bytes of memory that it takes for good.
    pub fn bytes(&self) -> usize {
        if self.paged.is_some() { 0 } else { self.image.bytes() }
    }
}

/// Width and height of an image's levels, from itself down to one texel.
pub(super) fn sizes(width: u32, height: u32) -> impl Iterator<Item = [u32; 2]> {
    let next = |&[w, h]: &[u32; 2]| ([w, h] != [1, 1]).then(|| [(w / 2).max(1), (h / 2).max(1)]);
    std::iter::successors(Some([width, height]), next)
}
