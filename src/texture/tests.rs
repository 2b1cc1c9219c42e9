//! Lookups by closed forms, and textures that are malformed.

use super::*;
use crate::math::Vec2;
use crate::scene::Mapping;

fn checker(mapping: Mapping, odd: [f32; 3]) -> CompiledTextures {
    let textures = [
        Texture::Checker { even: TextureId(1), odd: TextureId(2), cell_size: 0.5, mapping },
        Texture::Solid([1.0; 3]),
        Texture::Solid(odd),
    ];
    CompiledTextures::resident(&textures, &[], Vec3::ZERO)
}

#[test]
fn checkers_alternate_across_zero() {
    let uv = checker(Mapping::default(), [0.0; 3]);
    let world = checker(Mapping::World, [0.0; 3]);
    let at = |x: f32, y: f32| uv.eval(TextureId(0), Vec2::new(x, y), Vec3::ZERO)[0];
    assert_eq!([at(0.1, 0.1), at(0.6, 0.1), at(-0.1, 0.1), at(-0.1, -0.1)], [1.0, 0.0, 0.0, 1.0]);
    let at = |x, y, z| world.eval(TextureId(0), Vec2::ZERO, Vec3::new(x, y, z))[0];
    assert_eq!([at(0.1, 0.1, 0.1), at(0.6, 0.1, 0.1), at(0.6, -0.1, 0.1)], [1.0, 0.0, 1.0]);
}

#[test]
fn constants_fold_and_circles_are_black() {
    assert_eq!(checker(Mapping::World, [1.0; 3]).constant(TextureId(0)), Some([1.0; 4]));
    assert_eq!(checker(Mapping::World, [0.5; 3]).constant(TextureId(0)), None);
    let circle =
        Texture::Checker { even: TextureId(0), odd: TextureId(9), cell_size: 1.0, mapping: Mapping::World };
    let t = CompiledTextures::resident(&[circle], &[], Vec3::ZERO);
    assert_eq!(t.eval(TextureId(0), Vec2::ZERO, Vec3::ZERO), [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(t.eval(TextureId(7), Vec2::ZERO, Vec3::ZERO), [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn tables_by_the_cosine_are_linear() {
    let table = |colors: &[[f32; 3]]| Texture::Facing(colors.into());
    let textures = [
        table(&[[0.0; 3], [1.0, 0.5, 0.25], [0.0, 1.0, 0.0]]),
        table(&[[0.5; 3], [0.5; 3]]),
        table(&[]),
        Texture::Checker { even: TextureId(0), odd: TextureId(1), cell_size: 1.0, mapping: Mapping::World },
    ];
    let t = CompiledTextures::resident(&textures, &[], Vec3::ZERO);
    let at = |cosine| t.eval_at(TextureId(0), &TexturePoint { cosine, ..TexturePoint::default() });
    assert_eq!(at(0.0), [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(at(0.25), [0.5, 0.25, 0.125, 1.0]);
    assert_eq!(at(0.75), [0.5, 0.75, 0.125, 1.0]);
    // Rounding may lead a little beyond.
    assert_eq!([at(1.0), at(1.000_001)], [[0.0, 1.0, 0.0, 1.0]; 2]);
    assert_eq!(t.constant(TextureId(1)), Some([0.5, 0.5, 0.5, 1.0]));
    assert_eq!(t.constant(TextureId(2)), Some([0.0, 0.0, 0.0, 1.0]));
    assert_eq!([0, 1, 2, 3, 9].map(|i| t.depends_on_viewer(TextureId(i))), [true, false, false, true, false]);
}

#[test]
fn mixes_follow_their_factor() {
    let mix = |a, b, factor| Texture::Mix { a: TextureId(a), b: TextureId(b), factor: TextureId(factor) };
    let mapping = Mapping::default();
    let textures = [
        Texture::Solid([0.25, 0.5, 1.0]),
        Texture::Solid([0.75, 0.0, 3.0]),
        Texture::Checker { even: TextureId(0), odd: TextureId(1), cell_size: 0.5, mapping },
        Texture::Facing([[0.0, 0.0, 0.0], [1.0, 0.5, 0.25]].into()),
        mix(2, 1, 3),
        Texture::Solid([0.5, 1.0, 0.0]),
        mix(0, 1, 5),
        // A mix within a mix, one with itself, and one with nothing.
        mix(4, 0, 5),
        mix(8, 0, 3),
        mix(0, 99, 3),
    ];
    let t = CompiledTextures::resident(&textures, &[], Vec3::ZERO);
    let at = |id, x, cosine| {
        let uv = [Vec2::new(x, 0.1); 2];
        t.eval_at(TextureId(id), &TexturePoint { uv, cosine, ..TexturePoint::default() })
    };
    // The first cell is the first colour, which goes to the second one; the other cell is that one already.
    assert_eq!(at(4, 0.1, 0.0), [0.25, 0.5, 1.0, 1.0]);
    assert_eq!(at(4, 0.1, 0.5), [0.5, 0.375, 1.25, 1.0]);
    assert_eq!(at(4, 0.1, 1.0), [0.75, 0.25, 1.5, 1.0]);
    assert_eq!(at(4, 0.6, 0.5), [0.75, 0.0, 3.0, 1.0]);
    assert_eq!(t.constant(TextureId(6)), Some([0.5, 0.0, 1.0, 1.0]));
    assert_eq!(at(7, 0.1, 0.5), [0.375, 0.5, 1.25, 1.0]);
    assert_eq!(at(8, 0.1, 0.5), [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(at(9, 0.1, 1.0), [0.0, 0.25, 0.75, 1.0]);
    let of_view = [2, 4, 6, 7, 9].map(|i| t.depends_on_viewer(TextureId(i)));
    assert_eq!(of_view, [false, true, false, true, true]);
}

#[test]
fn circles_of_checkers_and_mixes_end() {
    let mapping = Mapping::World;
    let textures = [
        Texture::Checker { even: TextureId(1), odd: TextureId(1), cell_size: 1.0, mapping },
        Texture::Mix { a: TextureId(0), b: TextureId(2), factor: TextureId(0) },
        Texture::Solid([1.0; 3]),
    ];
    let t = CompiledTextures::resident(&textures, &[], Vec3::ZERO);
    assert_eq!(t.eval(TextureId(1), Vec2::ZERO, Vec3::ZERO), [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn world_offset_moves_patterns_back() {
    let noise = Texture::Noise {
        kind: NoiseKind::Marble,
        frequency: 2.0,
        octaves: 4,
        low: [0.0; 3],
        high: [1.0, 2.0, 3.0],
        seed: 5,
    };
    let here = CompiledTextures::resident(std::slice::from_ref(&noise), &[], Vec3::ZERO);
    let moved = CompiledTextures::resident(&[noise], &[], Vec3::splat(8.0));
    let p = Vec3::new(0.25, 0.5, 0.125);
    let value = moved.eval(TextureId(0), Vec2::ZERO, p);
    assert_eq!(value, here.eval(TextureId(0), Vec2::ZERO, p + 8.0));
    assert!((value[1] - 2.0 * value[0]).abs() < 1e-6);
}

#[test]
fn normals_become_colours() {
    let t = CompiledTextures::resident(&[Texture::Normal], &[], Vec3::ZERO);
    assert_eq!(t.constant(TextureId(0)), None);
    let point = TexturePoint { normal: Vec3::new(0.6, 0.0, -0.8), ..TexturePoint::default() };
    let value = t.eval_at(TextureId(0), &point);
    for (found, expected) in value.into_iter().zip([0.8, 0.5, 0.1, 1.0]) {
        assert!((found - expected).abs() < 1e-6, "{value:?}");
    }
}

#[test]
fn one_pixel_images_are_constants() {
    let image = Image::from_linear_rgb("dot", 1, 1, vec![0.1, 0.2, 0.3]);
    let texture = Texture::Image {
        image: ImageId(0),
        wrap_u: Default::default(),
        wrap_v: Default::default(),
        interpolation: Default::default(),
        mapping: Mapping::default(),
    };
    let t = CompiledTextures::resident(&[texture], &[image], Vec3::ZERO);
    assert_eq!(t.constant(TextureId(0)), Some([0.1, 0.2, 0.3, 1.0]));
}
