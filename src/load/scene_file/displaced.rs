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
//!
//! Parts of a mesh with displacements of different `edge` or `scale`, or beside one that is not displaced, come apart where they meet: give
//! both the same, with heights that end at `midlevel` there.
//!
//! And any may have `normal = { image = "normals.png" }` or `bump = { image = "heights.png" }`: light falls on it as if its surface were
//! uneven, while its shape stays. They go by texture coordinates, which meshes must have; quads, spheres and disks have their own.
//!
//! | Normals | Default | Meaning |
//! |---|---|---|
//! | `image` | required | `normal`: normals as in glTF, (n + 1) / 2 with y up; `bump`: heights in the red channel |
//! | `scale` | 1 | factor on the slopes; of `bump`, at 1 white lies a hundredth of the image's width above black, as with `-bm 1` of MTL files |
//! | `wrap` | `repeat` | or `clamp`; of `normal` also `mirror` |
//! | `repeat` | [1, 1] | how often the image lies along u and v |

use super::build::Build;
use super::fields::Fields;
use super::textures::{read_image, read_pixels};
use crate::error::Warning;
use crate::load::heights::{BUMP_HEIGHT, holds_normals, normals_of_heights};
use crate::load::image::Use;
use crate::math::Vec2;
use crate::scene::{
    Displacement, ImageId, Interpolation, Mapping, NormalMap, Texture, TextureId, TextureTransform, Wrap,
};

/// The displacement of a material, with a texture of its own. A check opens no image.
pub(super) fn read(build: &mut Build, fields: &Fields, is_check: bool) -> Option<Displacement> {
    let table = fields.table("displacement")?;
    let image = table.require("image", table.string("image"));
    let scale = table.require("scale", table.number("scale"));
    let midlevel = table.number("midlevel").map_or(0.5, |m| m.value as f32);
    let edge = table.number_in("edge", 1e-9..f64::from(f32::MAX), 0.0) as f32;
    let placed = on_surface(&table, &WRAPS);
    table.finish();
    let (image, scale) = (image?, scale?);
    if is_check {
        return None;
    }
    let image = read_pixels(build, image.value, image.span, Use::Data)?;
    let texture = (placed.texture(build, image), 0);
    Some(Displacement { texture, scale: scale.value as f32, midlevel, edge })
}

/// Ways to go on beyond the edges of an image.
const WRAPS: [(&str, Wrap); 3] = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];

/// How an image lies on a surface.
struct OnSurface {
    wrap: Wrap,
    times: [f64; 2],
}

fn on_surface(table: &Fields, wraps: &[(&'static str, Wrap)]) -> OnSurface {
    let wrap = table.choice("wrap", wraps).unwrap_or(Wrap::Repeat);
    OnSurface { wrap, times: table.numbers::<2>("repeat").map_or([1.0; 2], |r| r.value) }
}

impl OnSurface {
    /// The image as a texture, which is added to the scene.
    fn texture(&self, build: &mut Build, image: ImageId) -> TextureId {
        let scale = Vec2::new(self.times[0] as f32, self.times[1] as f32);
        let transform = TextureTransform { scale, ..Default::default() };
        build.loaded.scene.add_texture(Texture::Image {
            image,
            wrap_u: self.wrap,
            wrap_v: self.wrap,
            interpolation: Interpolation::Bilinear,
            mapping: Mapping::Uv { set: 0, transform },
        })
    }
}

/// The normals that a material is shaded with, from `normal` or `bump`. A check opens no image.
pub(super) fn normals(build: &mut Build, fields: &Fields, is_check: bool) -> Option<NormalMap> {
    if fields.has("normal") && fields.has("bump") {
        fields.problems.push(fields.span(), "'normal' and 'bump' say the same: leave one out");
    }
    let (key, is_height) = if fields.has("bump") { ("bump", true) } else { ("normal", false) };
    let table = fields.table(key)?;
    let image = table.require("image", table.string("image"));
    let scale = table.number_in("scale", -1000.0..1000.0, 1.0) as f32;
    // Where heights are mirrored, their slopes would have to turn round.
    let placed = on_surface(&table, if is_height { &[WRAPS[0], WRAPS[2]] } else { &WRAPS });
    table.finish();
    let (name, span) = image.map(|image| (image.value, image.span))?;
    if is_check {
        return None;
    }
    if !is_height {
        let image = read_image(build, name, span, Use::Data)?;
        return Some(NormalMap { texture: placed.texture(build, image), scale });
    }
    let mut image = read_pixels(build, name, span, Use::Data)?;
    let heights = &build.loaded.scene.images[image.index()];
    if holds_normals(heights) {
        let message =
            format!("'{name}' of 'bump' looks like a map of normals: say 'normal' in place of 'bump'");
        build.loaded.warnings.push(Warning::new(build.file, "", message));
    }
    let normals = normals_of_heights(heights, scale * BUMP_HEIGHT);
    image = build.loaded.scene.add_image(normals);
    Some(NormalMap { texture: placed.texture(build, image), scale: 1.0 })
}
