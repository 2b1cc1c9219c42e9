//! Heights from an image by texture coordinates.

use crate::image::{Encoding, Image};
use crate::math::Vec2;
use crate::scene::{Displacement, Mapping, Scene, Texture, TextureId, TextureTransform, Wrap};

/// What lies over the parts of a mesh: displacement and its heights.
pub(super) type Parts<'a> = Vec<Option<(&'a Displacement, &'a Heights)>>;

/// The values of a channel, bilinear between the middles of texels.
pub(super) struct Heights {
    size: [usize; 2],
    values: Vec<f32>,
    wrap: [Wrap; 2],
    set: u32,
    transform: TextureTransform,
}

impl Heights {
    /// Of a texture, which must be an image by texture coordinates; else the reason.
    pub fn of(scene: &Scene, (id, channel): (TextureId, u8)) -> Result<Heights, String> {
        let texture = scene.textures.get(id.index());
        let Some(Texture::Image { image, wrap_u, wrap_v, mapping: Mapping::Uv { set, transform }, .. }) =
            texture
        else {
            return Err("is displaced by images only, which lie by texture coordinates".into());
        };
        let image = scene.images.get(image.index()).ok_or("is displaced by an image that is not there")?;
        let image = image.decoded().map_err(|_| "is displaced by an image that can't be decoded")?;
        // Heights are no colours, whatever else the image is used for.
        let image = Image { encoding: Encoding::Linear, ..image };
        let size = [image.width as usize, image.height as usize];
        let texel =
            |i: usize| image.rgba((i % size[0]) as u32, (i / size[0]) as u32)[usize::from(channel.min(3))];
        Ok(Heights {
            size,
            values: (0..size[0] * size[1]).map(texel).collect(),
            wrap: [*wrap_u, *wrap_v],
            set: *set,
            transform: *transform,
        })
    }

    /// The set of texture coordinates that it takes.
    pub fn set(&self) -> usize {
        self.set as usize
    }

    /// The height at coordinates of that set.
    pub fn at(&self, uv: [f32; 2]) -> f32 {
        let TextureTransform { offset, rotation_rad, scale } = self.transform;
        let scaled = Vec2::from_array(uv) * scale;
        let (sin, cos) = rotation_rad.sin_cos();
        let turned = Vec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x);
        let at = (offset + turned).to_array();
        let texel = |k: usize| f64::from(at[k]) * self.size[k] as f64 - 0.5;
        let (x, y) = (texel(0), texel(1));
        let (s, t) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
        let value = |i: i64, j: i64| {
            let column = wrapped(x.floor() as i64 + i, self.size[0], self.wrap[0]);
            let row = wrapped(y.floor() as i64 + j, self.size[1], self.wrap[1]);
            self.values[row * self.size[0] + column]
        };
        let mix = |a: f32, b: f32, share: f32| a + (b - a) * share;
        mix(mix(value(0, 0), value(1, 0), s), mix(value(0, 1), value(1, 1), s), t)
    }
}

fn wrapped(at: i64, size: usize, wrap: Wrap) -> usize {
    let size = size as i64;
    let inside = match wrap {
        Wrap::Repeat => at.rem_euclid(size),
        Wrap::Mirror => {
            let twice = at.rem_euclid(2 * size);
            twice.min(2 * size - 1 - twice)
        }
        Wrap::Clamp => at.clamp(0, size - 1),
    };
    inside as usize
}
