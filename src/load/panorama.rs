//! Textures as environments: equirectangular images of what a texture is in each direction.

use crate::error::{Result, Warning};
use crate::image::Image;
use crate::math::{Vec3, poly};
use crate::scene::{Environment, ImageId, Scene, Texture, TextureId};
use crate::texture::{CompiledTextures, PointReader, TextureNeeds, TexturePoint};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// Widths that may be asked for, texels.
pub const WIDTHS: RangeInclusive<u32> = 16..=16384;

/// Default widths: of textures without images, and at most of those with images, which are as wide as the widest of these.
const DEFAULT_WIDTH: u32 = 2048;
const MAX_DEFAULT_WIDTH: u32 = 8192;

/// The environment that a texture of a scene makes: the texture is evaluated at the points of the unit sphere around the origin. Its
/// image is added to the scene; `width` is that in texels, twice the height.
///
/// # Errors
/// That of a damaged image of the texture.
pub fn environment(
    scene: &mut Scene,
    texture: TextureId,
    width: Option<u32>,
    strength: f32,
    rotation_rad: f64,
    warnings: &mut Vec<Warning>,
) -> Result<Environment> {
    let used = images_of(scene, texture);
    let finest = (0..scene.images.len()).map(|i| used.contains(&ImageId(i as u32)).then_some(0)).collect();
    let needs = TextureNeeds { finest, limit: None };
    let (textures, report) = CompiledTextures::new(&scene.textures, &scene.images, Vec3::ZERO, needs)?;
    warnings.extend(report.warnings);
    if let Some([r, g, b, _]) = textures.constant(texture) {
        return Ok(Environment::Constant([r, g, b].map(|c| c * strength)));
    }
    let widest = used.iter().filter_map(|id| scene.images.get(id.index())).map(|image| image.width).max();
    let default = widest.unwrap_or(0).clamp(DEFAULT_WIDTH, MAX_DEFAULT_WIDTH);
    let width = width.unwrap_or(default);
    // Images have no detail between their texels.
    let image = scene.add_image(evaluated(&textures, texture, width, widest.is_none()));
    Ok(Environment::Image { image, strength, rotation_rad })
}

/// The images that a texture and its parts read.
fn images_of(scene: &Scene, texture: TextureId) -> BTreeSet<ImageId> {
    let (mut images, mut known, mut pending) = (BTreeSet::new(), BTreeSet::new(), vec![texture]);
    while let Some(id) = pending.pop() {
        let Some(texture) = scene.textures.get(id.index()).filter(|_| known.insert(id)) else { continue };
        if let Texture::Image { image, .. } = texture {
            images.insert(*image);
        }
        pending.extend(texture.parts());
    }
    images
}

/// The texture in all directions: at the middles of texels, and where `refined` at four points of those whose neighbours differ.
fn evaluated(textures: &CompiledTextures, texture: TextureId, width: u32, is_refined: bool) -> Image {
    let height = (width / 2).max(1);
    let size = [width, height];
    let value = |x: f64, y: f64| {
        let direction = direction((x / f64::from(width)) as f32, (y / f64::from(height)) as f32);
        // Seen from within the sphere.
        let point =
            TexturePoint { world: direction, normal: -direction, cosine: 1.0, ..TexturePoint::default() };
        let [r, g, b, _] = PointReader::new(textures, point).eval(texture);
        [r, g, b]
    };
    let middles = rows(size, |x, y| value(f64::from(x) + 0.5, f64::from(y) + 0.5));
    let values = match is_refined {
        false => middles,
        true => rows(size, |x, y| match has_edge(&middles, size, [x, y]) {
            false => middles[(y * width + x) as usize],
            true => mean(
                [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
                    .map(|(s, t)| value(f64::from(x) + s, f64::from(y) + t)),
            ),
        }),
    };
    Image::from_linear_rgb("environment", width, height, values.into_flattened())
}

/// The values of all texels, row by row from the top.
fn rows([width, height]: [u32; 2], value: impl Fn(u32, u32) -> [f32; 3] + Sync) -> Vec<[f32; 3]> {
    let mut values = vec![[0.0; 3]; width as usize * height as usize];
    values.par_chunks_exact_mut(width as usize).zip(0..height).for_each(|(row, y)| {
        (0..).zip(row).for_each(|(x, texel)| *texel = value(x, y));
    });
    values
}

/// Does a texel differ from one beside it by more than a share of the brighter one?
fn has_edge(values: &[[f32; 3]], [width, height]: [u32; 2], [x, y]: [u32; 2]) -> bool {
    /// Below it, texels are interpolated well enough.
    const EVEN: f32 = 0.1;
    let at = |x: u32, y: u32| values[(y * width + x) as usize];
    let own = at(x, y);
    let beside = [
        at((x + 1) % width, y),
        at((x + width - 1) % width, y),
        at(x, (y + 1).min(height - 1)),
        at(x, y.saturating_sub(1)),
    ];
    beside.iter().any(|other| (0..3).any(|c| (own[c] - other[c]).abs() > EVEN * own[c].max(other[c])))
}

fn mean(values: [[f32; 3]; 4]) -> [f32; 3] {
    std::array::from_fn(|c| values.iter().map(|value| value[c]).sum::<f32>() / 4.0)
}

/// The direction of equirectangular coordinates, as [`Environment::Image`] has them.
fn direction(u: f32, v: f32) -> Vec3 {
    let ((sin_phi, cos_phi), (sin_theta, cos_theta)) =
        (poly::sin_cos_turns(u - 0.5), poly::sin_cos_turns(0.5 * v));
    Vec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mapping;
    use crate::scene::nodes::{Node, NodeGraph, NodeInput, NodeKind, SocketType};
    use std::sync::Arc;

    /// A checker in space shows its octants, and the environment what the texture is in each direction.
    #[test]
    fn directions_are_points_of_the_unit_sphere() {
        let mut scene = Scene::default();
        let [even, odd] = [[1.0, 0.5, 0.25], [0.0, 0.0, 2.0]].map(|c| scene.add_texture(Texture::Solid(c)));
        let checker =
            scene.add_texture(Texture::Checker { even, odd, cell_size: 2.0, mapping: Mapping::World });
        let made = environment(&mut scene, checker, Some(64), 3.0, 0.5, &mut Vec::new()).unwrap();
        let Environment::Image { image, strength, rotation_rad } = made else { panic!("{made:?}") };
        assert_eq!((strength, rotation_rad), (3.0, 0.5));
        let image = &scene.images[image.index()];
        assert_eq!((image.width, image.height), (64, 32));
        for (x, y) in (0..32).flat_map(|y| (0..64).map(move |x| (x, y))) {
            let d = direction((x as f32 + 0.5) / 64.0, (y as f32 + 0.5) / 32.0);
            let negative = [d.x, d.y, d.z].iter().filter(|c| **c < 0.0).count();
            let expected = if negative % 2 == 0 { [1.0, 0.5, 0.25] } else { [0.0, 0.0, 2.0] };
            assert_eq!(&image.rgba(x, y)[..3], &expected, "{d}");
        }
    }

    #[test]
    fn constant_textures_are_constant_environments() {
        let mut scene = Scene::default();
        let grey = scene.add_texture(Texture::Solid([0.5; 3]));
        let made = environment(&mut scene, grey, None, 2.0, 0.0, &mut Vec::new()).unwrap();
        assert_eq!(made, Environment::Constant([1.0; 3]));
        assert!(scene.images.is_empty());
    }

    /// An image by directions is found again where it was, texel by texel.
    #[test]
    fn an_environment_image_passes_through_a_graph() {
        let mut scene = Scene::default();
        let rgb: Vec<f32> = (0..64 * 32 * 3).map(|i| (i % 97) as f32 / 7.0).collect();
        let image = scene.add_image(Image::from_linear_rgb("sky", 64, 32, rgb.clone()));
        let (wrap_u, wrap_v) = Default::default();
        let texture = Texture::Image {
            image,
            wrap_u,
            wrap_v,
            interpolation: Default::default(),
            mapping: Mapping::default(),
        };
        let read = scene.add_texture(texture);
        let kind = NodeKind::from_name("environment_texture").unwrap();
        assert_eq!(kind.outputs()[0].kind, SocketType::Color);
        let inputs = vec![NodeInput::Default; kind.inputs().len()];
        let nodes = vec![Node { kind, inputs, image: Some(read) }];
        let graph = NodeGraph { nodes, result: NodeInput::Link { node: 0, output: 0 }, is_z_up: true };
        let graph = scene.add_texture(Texture::Nodes(Arc::new(graph)));
        let made = environment(&mut scene, graph, Some(64), 1.0, 0.0, &mut Vec::new()).unwrap();
        let Environment::Image { image, .. } = made else { panic!("{made:?}") };
        for (i, expected) in rgb.as_chunks::<3>().0.iter().enumerate() {
            let found = scene.images[image.index()].rgba(i as u32 % 64, i as u32 / 64);
            let distance = (0..3).map(|c| (found[c] - expected[c]).abs()).fold(0.0, f32::max);
            assert!(distance < 1e-3, "{i}: {found:?} {expected:?}");
        }
    }
}
