//! Any material may have `displacement = { image = "heights.png", scale = 0.1 }`: meshes, boxes and quads with it are subdivided when the
//! scene is loaded, and moved along their normals.
//!
//! | Displacement | Default | Meaning |
//! |---|---|---|
//! | `image` | required | file of heights, by texture coordinates; the red channel as it is stored, 0 to 1 |
//! | `scale` | required | how far white lies above black, in the units of the mesh: metres, unless its placement scales |
//! | `midlevel` | 0.5 | the value that stays where the mesh is |
//! | `edge` | 1/256 of the mesh's box | longest edge of triangles, in the same units; about the size of a texel shows all of the image. All displaced meshes together may have 16 million triangles |
//! | `wrap` | `repeat` | or `mirror`, `clamp` |
//! | `repeat` | [1, 1] | how often the image lies along u and v |

use super::build::Build;
use super::fields::Fields;
use super::textures::read_image;
use crate::load::image::Use;
use crate::math::Vec2;
use crate::scene::{Displacement, Interpolation, Mapping, Texture, TextureId, TextureTransform, Wrap};

/// The displacement of a material, with a texture of its own.
pub(super) fn read(build: &mut Build, fields: &Fields) -> Option<Displacement> {
    let table = fields.table("displacement")?;
    let image = table.require("image", table.string("image"));
    let scale = table.require("scale", table.number("scale"));
    let midlevel = table.number("midlevel").map_or(0.5, |m| m.value as f32);
    let edge = table.number_in("edge", 1e-9..f64::from(f32::MAX), 0.0) as f32;
    let wraps = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];
    let wrap = table.choice("wrap", &wraps).unwrap_or(Wrap::Repeat);
    let times = table.numbers::<2>("repeat").map_or([1.0; 2], |r| r.value);
    table.finish();
    let (image, scale) = (image?, scale?);
    let image = read_image(build, image.value, image.span, Use::Data)?;
    let transform =
        TextureTransform { scale: Vec2::new(times[0] as f32, times[1] as f32), ..Default::default() };
    let textures = &mut build.loaded.scene.textures;
    textures.push(Texture::Image {
        image,
        wrap_u: wrap,
        wrap_v: wrap,
        interpolation: Interpolation::Bilinear,
        mapping: Mapping::Uv { set: 0, transform },
    });
    let texture = (TextureId(textures.len() as u32 - 1), 0);
    Some(Displacement { texture, scale: scale.value as f32, midlevel, edge })
}
