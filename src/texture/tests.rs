//! Lookups against closed forms, malformed textures, and mip levels that are omitted or decoded on demand: lookups find the same
//! texels, with no more decoding than needed.

use super::*;
use crate::error::Warning;
use crate::image::{Damage, Encoded, Encoding, ImageSource, Pixels};
use crate::math::Vec2;
use crate::scene::nodes::{Node, NodeInput, NodeKind};
use crate::scene::{Interpolation, Mapping, Wrap};
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

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
fn constants_fold_and_cycles_are_black() {
    assert_eq!(checker(Mapping::World, [1.0; 3]).constant(TextureId(0)), Some([1.0; 4]));
    assert_eq!(checker(Mapping::World, [0.5; 3]).constant(TextureId(0)), None);
    let cycle =
        Texture::Checker { even: TextureId(0), odd: TextureId(9), cell_size: 1.0, mapping: Mapping::World };
    let t = CompiledTextures::resident(&[cycle], &[], Vec3::ZERO);
    assert_eq!(t.eval(TextureId(0), Vec2::ZERO, Vec3::ZERO), [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(t.eval(TextureId(7), Vec2::ZERO, Vec3::ZERO), [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn tables_by_cosine_are_interpolated_linearly() {
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
    // Rounding may exceed 1 slightly.
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
        // A mix of a mix, one that contains itself, and one with a dangling reference.
        mix(4, 0, 5),
        mix(8, 0, 3),
        mix(0, 99, 3),
    ];
    let t = CompiledTextures::resident(&textures, &[], Vec3::ZERO);
    let at = |id, x, cosine| {
        let uv = [Vec2::new(x, 0.1); 2];
        t.eval_at(TextureId(id), &TexturePoint { uv, cosine, ..TexturePoint::default() })
    };
    // An even cell is mixed from texture 0 to texture 1; an odd cell is texture 1 already.
    assert_eq!(at(4, 0.1, 0.0), [0.25, 0.5, 1.0, 1.0]);
    assert_eq!(at(4, 0.1, 0.5), [0.5, 0.375, 1.25, 1.0]);
    assert_eq!(at(4, 0.1, 1.0), [0.75, 0.25, 1.5, 1.0]);
    assert_eq!(at(4, 0.6, 0.5), [0.75, 0.0, 3.0, 1.0]);
    assert_eq!(t.constant(TextureId(6)), Some([0.5, 0.0, 1.0, 1.0]));
    assert_eq!(at(7, 0.1, 0.5), [0.375, 0.5, 1.25, 1.0]);
    assert_eq!(at(8, 0.1, 0.5), [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(at(9, 0.1, 1.0), [0.0, 0.25, 0.75, 1.0]);
    let depends_on_viewer = [2, 4, 6, 7, 9].map(|i| t.depends_on_viewer(TextureId(i)));
    assert_eq!(depends_on_viewer, [false, true, false, true, true]);
}

#[test]
fn cycles_of_checkers_and_mixes_are_black() {
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
fn world_offset_is_added_to_positions() {
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
fn normals_are_encoded_as_colours() {
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

/// An image source that counts decodings, and fails after `most` of them.
#[derive(Debug)]
struct Counted {
    image: Image,
    decodes: AtomicU64,
    max_decodes: u64,
}

impl ImageSource for Counted {
    fn decode(&self, _: &mut Vec<Warning>) -> Result<Image, Damage> {
        match self.decodes.fetch_add(1, Relaxed) < self.max_decodes {
            true => Ok(self.image.clone()),
            false => Err(Damage::LeftOut(Warning::general("gone"))),
        }
    }

    fn with_bytes(&self, _: &mut dyn FnMut(&[u8])) {}
}

/// Noise and a ramp in components of `bits` bits.
fn decoded(width: u32, height: u32, channels: u32, bits: u32, seed: u32) -> Image {
    let value = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 9) % 90 + i / 97;
    let count = width * height * channels;
    let (pixels, encoding) = match bits {
        8 => (Pixels::U8((0..count).map(|i| value(i) as u8).collect()), Encoding::Srgb),
        16 => (Pixels::U16((0..count).map(|i| (value(i) * 131) as u16).collect()), Encoding::Srgb),
        _ => (Pixels::F32((0..count).map(|i| value(i) as f32 / 7.0 - 5.0).collect()), Encoding::Linear),
    };
    let pixels = Arc::new(pixels);
    Image { name: format!("image {seed}"), width, height, channels, encoding, pixels }
}

fn encoded(image: &Image, max_decodes: u64) -> (Image, Arc<Counted>) {
    let bits = match *image.pixels {
        Pixels::U8(_) => 8,
        Pixels::U16(_) => 16,
        _ => 32,
    };
    let source = Arc::new(Counted { image: image.clone(), decodes: AtomicU64::new(0), max_decodes });
    let size = [image.width, image.height, image.channels];
    let pixels = Arc::new(Pixels::Encoded(Encoded { size, bits, source: source.clone() }));
    (Image { pixels, ..image.clone() }, source)
}

fn texture(image: usize, interpolation: Interpolation) -> Texture {
    let (wrap_u, wrap_v) = (Wrap::Repeat, Wrap::Mirror);
    Texture::Image {
        image: ImageId(image as u32),
        wrap_u,
        wrap_v,
        interpolation,
        mapping: Mapping::default(),
    }
}

fn made(textures: &[Texture], images: &[Image], needs: &TextureNeeds) -> (CompiledTextures, TextureReport) {
    CompiledTextures::new(textures, images, Vec3::ZERO, needs.clone()).expect("nothing is fatal")
}

/// Bits of lookups at `count` pseudo-random points with footprints of up to `most_texels`, in texture coordinates.
fn look(textures: &CompiledTextures, texture: usize, count: u32, most_texels: f32) -> Vec<[u32; 4]> {
    let at = |i: u32| {
        let part = |k: u32| (i.wrapping_mul(k) % 1009) as f32 / 1009.0;
        let uv = Vec2::new(part(7919) * 3.0 - 1.0, part(104_729) * 3.0 - 1.0);
        let width = part(31) * most_texels;
        let point = TexturePoint { uv: [uv, uv], width, uv_per_metre: [1.0; 2], ..TexturePoint::default() };
        textures.eval_at(TextureId(texture as u32), &point).map(f32::to_bits)
    };
    (0..count).map(at).collect()
}

#[test]
fn lookups_on_demand_equal_resident_lookups() {
    let kinds = [Interpolation::Trilinear, Interpolation::Bilinear, Interpolation::Nearest];
    for (width, height, channels, bits) in [
        (300, 200, 3, 8),
        (256, 256, 4, 8),
        (130, 70, 1, 16),
        (64, 199, 2, 16),
        (100, 150, 3, 32),
        (140, 70, 4, 32),
    ] {
        let image = decoded(width, height, channels, bits, 5);
        for kind in kinds {
            let textures = [texture(0, kind)];
            let (resident, _) = made(&textures, std::slice::from_ref(&image), &TextureNeeds::default());
            let expected = look(&resident, 0, 2000, 0.2);
            for finest in [None, Some(0), Some(2), Some(40)] {
                for limit in [None, Some(1), Some(50_000), Some(1 << 30)] {
                    let (on_demand, source) = encoded(&image, u64::MAX);
                    let needs = TextureNeeds { finest: vec![finest], limit };
                    let (textures, _) = made(&textures, &[on_demand], &needs);
                    let found = look(&textures, 0, 2000, 0.2);
                    assert!(found == expected, "{width} {kind:?} {finest:?} {limit:?}");
                    // Once for the expected levels, at most once more for others.
                    assert!((1..=2).contains(&source.decodes.load(Relaxed)));
                }
            }
        }
    }
}

#[test]
fn levels_finer_than_needed_are_omitted_and_decoded_once_on_demand() {
    let image = decoded(512, 512, 3, 8, 1);
    let (on_demand, source) = encoded(&image, u64::MAX);
    let textures = [texture(0, Interpolation::Trilinear)];
    let needs = TextureNeeds { finest: vec![Some(3)], limit: None };
    let (compiled, report) = made(&textures, &[on_demand], &needs);
    let expected: u64 = (0..7).map(|level| (64u64 >> level).pow(2) * 3).sum();
    assert_eq!((report.bytes, report.reduced, report.decoded), (expected, 1, 1));
    assert_eq!((compiled.on_demand().decodes, source.decodes.load(Relaxed)), (0, 1));
    // Footprints of 8 texels and more.
    for i in 8..200 {
        let point =
            TexturePoint { width: i as f32 / 512.0, uv_per_metre: [1.0; 2], ..TexturePoint::default() };
        compiled.eval_at(TextureId(0), &point);
    }
    assert_eq!((compiled.on_demand().tiles, source.decodes.load(Relaxed)), (0, 1));
    // Finer levels: the image is decoded once more, and not again.
    look(&compiled, 0, 5000, 0.0);
    look(&compiled, 0, 5000, 0.01);
    assert_eq!((compiled.on_demand().decodes, source.decodes.load(Relaxed)), (1, 2));
    // Compressed, and not larger than the texels with block headers.
    let finer: u64 = (0..3).map(|level| (512u64 >> level).pow(2) * 3).sum();
    let taken = compiled.bytes() as u64 - report.bytes;
    assert!(taken > finer / 4 && taken < finer + finer / 16, "{taken} of {finer}");
}

#[test]
fn unneeded_images_are_never_decoded() {
    let images: Vec<_> = (0..3).map(|seed| encoded(&decoded(64, 64, 3, 8, seed), u64::MAX)).collect();
    let textures: Vec<Texture> = (0..3).map(|i| texture(i, Interpolation::Trilinear)).collect();
    let needs = TextureNeeds { finest: vec![Some(0), None, None], limit: None };
    let list: Vec<Image> = images.iter().map(|(image, _)| image.clone()).collect();
    let (_, report) = made(&textures, &list, &needs);
    let decodes: Vec<u64> = images.iter().map(|(_, source)| source.decodes.load(Relaxed)).collect();
    assert_eq!((decodes, report.unneeded), (vec![1, 0, 0], 2));
}

#[test]
fn levels_in_memory_stay_within_the_limit() {
    const COUNT: usize = 8;
    let full: Vec<Image> = (0..COUNT as u32).map(|seed| decoded(256, 256, 3, 8, seed)).collect();
    let images: Vec<_> = full.iter().map(|image| encoded(image, u64::MAX)).collect();
    let list: Vec<Image> = images.iter().map(|(image, _)| image.clone()).collect();
    let textures: Vec<Texture> = (0..COUNT).map(|i| texture(i, Interpolation::Trilinear)).collect();
    let limit = 600_000;
    let needs = TextureNeeds { finest: Vec::new(), limit: Some(limit) };
    let (compiled, report) = made(&textures, &list, &needs);
    let (resident, _) = made(&textures, &full, &TextureNeeds::default());
    assert!(report.paged > 0 && report.bytes <= limit * 3 / 4 && report.file_bytes > limit / 2, "{report:?}");
    for _ in 0..2 {
        for i in 0..COUNT {
            assert!(look(&compiled, i, 3000, 0.02) == look(&resident, i, 3000, 0.02));
        }
    }
    let counts = compiled.on_demand();
    // Each shard may hold one tile that is larger than its limit.
    assert!(compiled.bytes() as u64 + counts.bytes <= limit + 64 * 64 * 64 * 3, "{counts:?}");
    assert!(counts.evicted_tiles > 0 && counts.tiles > counts.evicted_tiles, "{counts:?}");
    let decodes: Vec<u64> = images.iter().map(|(_, source)| source.decodes.load(Relaxed)).collect();
    assert_eq!((decodes, counts.decodes), (vec![1; COUNT], 0));
}

#[test]
fn a_failed_decoding_is_reported_once_and_replaced_by_a_coarse_copy() {
    let image = decoded(256, 256, 3, 8, 1);
    let (on_demand, source) = encoded(&image, 1);
    let textures = [texture(0, Interpolation::Trilinear), texture(0, Interpolation::Bilinear)];
    let needs = TextureNeeds { finest: vec![Some(4)], limit: None };
    let (compiled, report) = made(&textures, &[on_demand], &needs);
    assert!(report.warnings.is_empty());
    let found = look(&compiled, 0, 1000, 0.0);
    assert!(found.iter().any(|rgba| rgba[0] != 0), "{:?}", found[0]);
    look(&compiled, 1, 1000, 0.0);
    let counts = compiled.on_demand();
    assert_eq!((counts.warnings.len(), source.decodes.load(Relaxed)), (1, 2));
    assert!(counts.warnings[0].message.starts_with("image 1: a coarse copy"), "{}", counts.warnings[0]);
}

#[test]
fn textures_of_damaged_images_are_white_and_reported() {
    let (broken, _) = encoded(&decoded(64, 64, 3, 8, 1), 0);
    let textures = [texture(0, Interpolation::Bilinear)];
    let (compiled, report) = made(&textures, &[broken], &TextureNeeds::default());
    assert!(compiled.is_damaged(TextureId(0)) && report.warnings.len() == 1);
    assert_eq!(compiled.constant(TextureId(0)), Some([1.0; 4]));
}

#[test]
fn images_with_the_same_pixels_are_decoded_once() {
    let (color, source) = encoded(&decoded(64, 64, 3, 8, 1), u64::MAX);
    let data = Image { encoding: Encoding::Linear, ..color.clone() };
    let textures = [texture(0, Interpolation::Bilinear), texture(1, Interpolation::Trilinear)];
    made(&textures, &[color, data], &TextureNeeds::default());
    assert_eq!(source.decodes.load(Relaxed), 1);
}

#[test]
fn later_pictures_decode_only_images_that_need_finer_levels() {
    let images: Vec<_> = (0..2).map(|seed| encoded(&decoded(256, 256, 3, 8, seed), u64::MAX)).collect();
    let list: Vec<Image> = images.iter().map(|(image, _)| image.clone()).collect();
    let textures: Vec<Texture> = (0..2).map(|i| texture(i, Interpolation::Trilinear)).collect();
    let needs = |finest: [u32; 2]| TextureNeeds { finest: finest.map(Some).to_vec(), limit: None };
    let (first, _) = made(&textures, &list, &needs([3, 2]));
    assert!(first.suffice_for(&needs([3, 3])) && !first.suffice_for(&needs([1, 2])));
    let (second, _) = CompiledTextures::new_reusing(Some(first), &textures, &list, Vec3::ZERO, needs([1, 4]))
        .expect("nothing is damaged");
    let decodes: Vec<u64> = images.iter().map(|(_, source)| source.decodes.load(Relaxed)).collect();
    assert_eq!(decodes, [2, 1]);
    // The second image has kept its finer levels.
    assert!(second.suffice_for(&needs([1, 2])));
}

#[test]
fn concurrent_lookups_agree_and_decode_once() {
    let image = decoded(400, 300, 3, 8, 9);
    let textures = [texture(0, Interpolation::Bilinear)];
    let (resident, _) = made(&textures, std::slice::from_ref(&image), &TextureNeeds::default());
    let expected = look(&resident, 0, 3000, 0.0);
    let (on_demand, source) = encoded(&image, u64::MAX);
    let needs = TextureNeeds { finest: vec![None], limit: Some(1 << 20) };
    let (compiled, _) = made(&textures, &[on_demand], &needs);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| assert!(look(&compiled, 0, 3000, 0.0) == expected));
        }
    });
    assert_eq!(source.decodes.load(Relaxed), 1);
}

/// Graphs that are evaluated together at several points have the bits of each graph at each point.
#[test]
fn joint_graphs_equal_single_ones() {
    let node = |name: &str, inputs: &[(usize, NodeInput)]| {
        let kind = NodeKind::from_name(name).expect("a node");
        let mut all = vec![NodeInput::Default; kind.inputs().len()];
        inputs.iter().for_each(|&(i, input)| all[i] = input);
        Node { kind, inputs: all, image: None, reads_alpha: false }
    };
    let value = |x: f32| NodeInput::Value([x; 3]);
    let link = |node, output| NodeInput::Link { node, output };
    // Noise with a fraction of an octave and distortion, which the others read.
    let nodes = vec![
        node("noise_texture", &[(3, value(2.5)), (8, value(0.7))]),
        node("voronoi_texture", &[(0, link(0, 1))]),
        node("wave_texture", &[(2, link(0, 0)), (3, value(3.0))]),
    ];
    let graph = |node, output| {
        let graph = NodeGraph { nodes: nodes.clone(), result: link(node, output), is_z_up: true };
        Texture::Nodes(Arc::new(graph))
    };
    let list = [graph(0, 1), graph(1, 0), graph(2, 0)];
    let textures = CompiledTextures::resident(&list, &[], Vec3::new(1.0, 2.0, 3.0));
    let joint = textures.join_graphs((0..3).map(TextureId)).expect("graphs");
    for count in [1, 5, GRAPH_LANES] {
        let at = |i: usize| Vec3::new(0.37 * i as f32, -1.1, 2.0 + i as f32);
        let points: Vec<TexturePoint> =
            (0..count).map(|i| TexturePoint { world: at(i), ..TexturePoint::default() }).collect();
        let mut results = Vec::new();
        joint.evaluate(&textures, &points, &vec![None; count], &mut results);
        assert_eq!(results.len(), 3 * count);
        for (point, of_point) in points.iter().zip(results.chunks(3)) {
            for (id, result) in (0..3).map(TextureId).zip(of_point) {
                let [r, g, b, _] = textures.eval_at(id, point);
                assert!(r > 0.0, "{id:?}");
                assert_eq!(result.map(|x| nodes::reflectance(x).to_bits()), [r, g, b].map(f32::to_bits));
            }
        }
    }
}
