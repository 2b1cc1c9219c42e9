//! One level of an image's pyramid: its texels, or where they are found when somebody asks for them.

use super::paged::PagedLevel;
use super::texels::{Texels, WithTexels, with_common_texels};
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

    /// Lets `task` work on the texels.
    #[inline(always)]
    pub fn with_texels<T: WithTexels>(&self, task: T) -> T::Output {
        with_common_texels(&self.image, task, |task| task.run(OtherTexels(self)))
    }
}

/// Texels of rare formats, and those that are not in memory.
struct OtherTexels<'a>(&'a Level);

impl Texels for OtherTexels<'_> {
    #[inline]
    fn texel(&self, at: usize) -> [f32; 4] {
        let Level { image, paged } = self.0;
        if let Some(paged) = paged {
            return paged.texel(at);
        }
        let width = image.width as usize;
        image.rgba((at % width) as u32, (at / width) as u32)
    }
}
