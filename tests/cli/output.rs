//! Round trips of output files.

use exr::prelude::{AttributeValue, FlatSamples, ReadChannels, ReadLayers, Text, read};
use oscura::error::ErrorKind;
use oscura::film::{Aov, AovSet, AovSpace, BACKGROUND_DEPTH, Film};
use oscura::math::{DMat4, DVec3};
use oscura::output::{
    Format, Matte, Metadata, OutputOptions, PngOptions, ViewTransform, check_target, encode, write_atomically,
};
use std::path::Path;
use std::time::{Duration, SystemTime};

fn film(aovs: AovSet) -> Film {
    let mut film = Film::new(37, 21, aovs);
    let mut tile = film.tile(0, 0, 37, 21);
    for i in 0..37 * 21 {
        let v = i as f32 / 100.0;
        let rgb = [v, v * 0.5, 1.0 / (1.0 + v)];
        let alpha = if i % 3 == 0 { 0.5 } else { 1.0 };
        let hit = [v, 0.0, 0.0, 1.0, 0.1, 0.2, 0.3];
        let hit = if aovs.any() { &hit[..] } else { &[] };
        tile.add_with_first_hit(i, rgb, alpha, (i > 0).then_some(hit));
    }
    film.merge(tile);
    film
}

fn metadata() -> Metadata {
    Metadata {
        samples: 16.0,
        seed: u32::MAX,
        owner: Some("Ada".into()),
        render_s: Some(1.5),
        captured: Some(SystemTime::UNIX_EPOCH + Duration::from_secs(951_782_400)),
        world_offset: None,
        world_to_camera: Some(DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0))),
        world_to_ndc: Some(DMat4::from_translation(DVec3::new(4.0, 5.0, 6.0))),
        pixel_aspect: Some(1.25),
        aov_space: AovSpace::Camera,
        denoised: Some("by hand".into()),
        mattes: vec![Matte::new("crypto_asset", vec!["hello".into()])],
        stopped_by: Some("a signal".into()),
        warnings: vec!["a \u{2192} b".into()],
    }
}

type Layer = exr::image::Layer<exr::image::AnyChannels<FlatSamples>>;

fn read_back(bytes: &[u8]) -> (Layer, exr::meta::header::ImageAttributes) {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .expect("our own file is valid");
    (image.layer_data, image.attributes)
}

fn values(layer: &Layer, name: &str) -> Vec<f32> {
    let channel = layer.channel_data.list.iter().find(|c| c.name.to_string() == name);
    channel.unwrap_or_else(|| panic!("no channel {name}")).sample_data.values_as_f32().collect()
}

#[test]
fn exr_has_colour_aovs_and_attributes() {
    let film = film([Aov::Depth, Aov::Normal, Aov::Albedo].into());
    let options = OutputOptions { float: true, metadata: metadata(), ..Default::default() };
    let encoded = encode(&film, Format::Exr, &options, Path::new("x.exr")).unwrap();
    assert!(encoded.warnings.is_empty());
    let (layer, shared) = read_back(&encoded.bytes);
    let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "Z", "albedo.B", "albedo.G", "albedo.R"]);
    for (c, name) in ["R", "G", "B", "A"].iter().enumerate() {
        let expected: Vec<f32> = film.rgba().iter().map(|pixel| pixel[c]).collect();
        assert_eq!(values(&layer, name), expected);
    }
    let depth = values(&layer, "Z");
    assert_eq!((depth[0], depth[100]), (BACKGROUND_DEPTH, 1.0));
    assert_eq!((values(&layer, "N.Z")[1], values(&layer, "albedo.G")[1]), (1.0, 0.2));

    let a = &layer.attributes;
    assert_eq!(
        a.software_name.as_ref().unwrap().to_string(),
        format!("oscura {}", env!("CARGO_PKG_VERSION"))
    );
    assert_eq!(a.owner.as_ref().unwrap().to_string(), "Ada");
    assert_eq!(a.capture_date.as_ref().unwrap().to_string(), "2000:02:29 00:00:00");
    // Row vectors: the translation is in the last row.
    assert_eq!(a.world_to_camera.unwrap()[12..15], [1.0, 2.0, 3.0]);
    assert_eq!(a.world_to_normalized_device.unwrap()[12..15], [4.0, 5.0, 6.0]);
    assert_eq!(shared.chromaticities.unwrap().red.0, 0.64);
    assert_eq!(shared.pixel_aspect, 1.25);
    let other =
        |name: &str| a.other.get(&Text::from(name)).or_else(|| shared.other.get(&Text::from(name))).cloned();
    assert_eq!(other("samples"), Some(AttributeValue::I32(16)));
    assert_eq!(other("aovSpace"), Some(AttributeValue::Text(Text::from("camera"))));
    assert_eq!(other("denoised"), Some(AttributeValue::Text(Text::from("by hand"))));
    assert_eq!(other("stoppedBy"), Some(AttributeValue::Text(Text::from("a signal"))));
    assert_eq!(other("seed"), Some(AttributeValue::Text(Text::from("4294967295"))));
    assert_eq!(other("renderTime"), Some(AttributeValue::F32(1.5)));
    assert_eq!(other("warnings"), Some(AttributeValue::Text(Text::from("a ? b"))));
    let matte = |what: &str| other(&format!("cryptomatte/28322e9/{what}"));
    for (what, value) in [
        ("name", "crypto_asset"),
        ("hash", "MurmurHash3_32"),
        ("conversion", "uint32_to_float32"),
        ("manifest", "{\"hello\":\"248bfa47\"}"),
    ] {
        assert_eq!(matte(what), Some(AttributeValue::Text(Text::from(value))), "{what}");
    }
    assert_eq!(other("colorInteropID"), Some(AttributeValue::Text(Text::from("lin_rec709_scene"))));
}

#[test]
fn additional_channels_keep_their_names_and_types() {
    let mut film = Film::new(2, 1, [Aov::Samples, Aov::MaterialId, Aov::Variance, Aov::Position].into());
    let mut tile = film.tile(0, 0, 2, 1);
    let hit = [10.0, 20.0, 30.0, f32::from_bits(3)];
    for value in [1.0, 3.0] {
        tile.add_with_first_hit(1, [value; 3], 1.0, Some(&hit));
    }
    film.merge(tile);
    let (layer, _) =
        read_back(&encode(&film, Format::Exr, &Default::default(), Path::new("x")).unwrap().bytes);
    let of = |name: &str| {
        let channel = layer.channel_data.list.iter().find(|c| c.name.to_string() == name);
        channel.unwrap_or_else(|| panic!("no channel {name}")).sample_data.clone()
    };
    assert_eq!(of("samples"), FlatSamples::U32(vec![0, 2]));
    assert_eq!(of("material.id"), FlatSamples::U32(vec![0, 3]));
    assert_eq!(of("variance.R"), FlatSamples::F32(vec![f32::INFINITY, 1.0]));
    assert_eq!(of("P.Y"), FlatSamples::F32(vec![0.0, 20.0]));
    assert!(matches!(of("R"), FlatSamples::F16(_)));
}

#[test]
fn unrequested_aovs_are_not_written() {
    let encoded =
        encode(&film(AovSet::default()), Format::Exr, &OutputOptions::default(), Path::new("x")).unwrap();
    let (layer, _) = read_back(&encoded.bytes);
    assert_eq!(layer.channel_data.list.len(), 4);
    assert!(layer.channel_data.list.iter().all(|c| matches!(c.sample_data, FlatSamples::F16(_))));
    assert!(layer.attributes.capture_date.is_none());
}

#[test]
fn values_beyond_half_floats_are_clamped_and_counted() {
    let mut film = Film::new(2, 1, AovSet::default());
    let mut tile = film.tile(0, 0, 2, 1);
    tile.add(0, [70_000.0, 65_504.0, 1e30], 1.0);
    film.merge(tile);
    let half = encode(&film, Format::Exr, &OutputOptions::default(), Path::new("x")).unwrap();
    assert_eq!(half.warnings.len(), 1);
    assert!(half.warnings[0].message.starts_with("2 "), "{}", half.warnings[0]);
    let (layer, _) = read_back(&half.bytes);
    assert_eq!(values(&layer, "B")[0], 65_504.0);
    let written = layer.attributes.other.get(&Text::from("warnings"));
    assert_eq!(written, Some(&AttributeValue::Text(Text::from(half.warnings[0].to_string().as_str()))));
    assert!(!layer.attributes.other.contains_key(&Text::from("stoppedBy")));
    let float = OutputOptions { float: true, ..Default::default() };
    let float = encode(&film, Format::Exr, &float, Path::new("x")).unwrap();
    assert!(float.warnings.is_empty());
    assert_eq!(values(&read_back(&float.bytes).0, "R")[0], 70_000.0);
}

#[test]
fn fractional_sample_counts_are_stored() {
    let film = film(AovSet::default());
    for (samples, expected) in [(0.5, AttributeValue::F32(0.5)), (7.0, AttributeValue::I32(7))] {
        let metadata = Metadata { samples, ..Default::default() };
        let options = OutputOptions { metadata, ..Default::default() };
        let encoded = encode(&film, Format::Exr, &options, Path::new("x")).unwrap();
        assert_eq!(read_back(&encoded.bytes).0.attributes.other.get(&Text::from("samples")), Some(&expected));
    }
}

#[test]
fn the_same_film_gives_the_same_bytes() {
    let film = film([Aov::Depth, Aov::Normal, Aov::Albedo].into());
    let options = OutputOptions { metadata: metadata(), ..Default::default() };
    let first = encode(&film, Format::Exr, &options, Path::new("x")).unwrap().bytes;
    for _ in 0..20 {
        assert!(encode(&film, Format::Exr, &options, Path::new("x")).unwrap().bytes == first);
    }
}

fn decode_png(bytes: &[u8]) -> image::DynamicImage {
    image::load_from_memory_with_format(bytes, image::ImageFormat::Png).expect("our own file is valid")
}

fn constant(rgb: [f32; 3], alpha: f32) -> Film {
    let mut film = Film::new(16, 16, AovSet::default());
    let mut tile = film.tile(0, 0, 16, 16);
    for i in 0..256 {
        tile.add(i, rgb, alpha);
    }
    film.merge(tile);
    film
}

#[test]
fn png_applies_exposure_view_and_straight_alpha() {
    let png = |film: &Film, png: PngOptions| {
        let options = OutputOptions { png, ..Default::default() };
        decode_png(&encode(film, Format::Png, &options, Path::new("x")).unwrap().bytes)
    };
    // sRGB: 0.214041 is code 127.5, one stop below 0.428082.
    let grey = png(&constant([0.5, 0.25, 1.0], 1.0), PngOptions { exposure: -1.0, ..Default::default() });
    assert_eq!(grey.color(), image::ColorType::Rgb8);
    assert_eq!(grey.to_rgb8().get_pixel(3, 3).0, [137, 99, 188]);
    // Premultiplied 0.25 at alpha 0.5 is a straight 0.5.
    let half = png(&constant([0.25, 0.0, 0.5], 0.5), PngOptions::default());
    assert_eq!(half.to_rgba8().get_pixel(0, 0).0, [188, 0, 255, 128]);
    // The filmic curve separates values that sRGB clips.
    let filmic = |v| ViewTransform::Filmic.encode([v; 3])[0];
    assert!(
        filmic(1.0) < 1.0 && filmic(1.0) < filmic(2.0) && filmic(2.0) < filmic(4.0) && filmic(1e30) == 1.0
    );
    let x = 0.6f64;
    let curve = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    let expected = 1.055 * curve.powf(1.0 / 2.4) - 0.055;
    assert!((f64::from(filmic(1.0)) - expected).abs() < 1e-6);
    assert_eq!(filmic(0.0), 0.0);
}

#[test]
fn dither_keeps_the_mean_between_two_codes() {
    let film = constant([0.2; 3], 1.0);
    let options =
        OutputOptions { png: PngOptions { dither: true, ..Default::default() }, ..Default::default() };
    let picture = decode_png(&encode(&film, Format::Png, &options, Path::new("x")).unwrap().bytes).to_rgb8();
    let mean = picture.pixels().map(|p| f64::from(p.0[0])).sum::<f64>() / 256.0;
    let exact = f64::from(ViewTransform::Srgb.encode([0.2; 3])[0]) * 255.0;
    assert!((mean - exact).abs() <= 1.0 / 64.0, "{mean} {exact}");
}

#[test]
fn files_are_written_atomically() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    check_target(&path).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    write_atomically(&path, b"one").unwrap();
    write_atomically(&path, b"two").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"two");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    // A folder of that name can't be replaced by a file: the temporary file is removed.
    let taken = folder.path().join("taken.png");
    std::fs::create_dir(&taken).unwrap();
    std::fs::write(taken.join("x"), b"x").unwrap();
    assert!(write_atomically(&taken, b"three").is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    let missing = check_target(folder.path().join("no/b.exr")).unwrap_err();
    assert!(missing.kind == ErrorKind::Output, "{missing}");
}

/// Permissions follow the umask, symbolic links are kept and their targets replaced, and errors name the picture only.
#[cfg(unix)]
#[test]
fn files_respect_umask_and_links() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let [path, other, link] = ["a.png", "other", "link.png"].map(|name| folder.path().join(name));
    std::fs::write(&other, b"other").unwrap();
    symlink(&other, &link).unwrap();
    write_atomically(&path, b"one").unwrap();
    write_atomically(&link, b"two").unwrap();
    let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&path), mode(&other));
    assert!(link.is_symlink());
    assert_eq!(
        (std::fs::read(&link).unwrap(), std::fs::read(&other).unwrap()),
        (b"two".into(), b"two".into())
    );

    let error = write_atomically(folder.path().join("absent/a.png"), b"x").unwrap_err().to_string();
    assert!(error.contains("absent/a.png: ") && error.ends_with("(os error 2)"), "{error}");
}

#[test]
fn formats_come_from_extensions() {
    assert_eq!(Format::of(Path::new("a/b.EXR")).unwrap(), Format::Exr);
    assert_eq!(Format::of(Path::new("b.png")).unwrap(), Format::Png);
    for name in ["a", "a.bmp", "exr", ".png"] {
        assert!(Format::of(Path::new(name)).is_err(), "{name}");
    }
}

/// All parts with their channels, and the display window.
fn parts_of(bytes: &[u8]) -> (Vec<Layer>, exr::meta::attribute::IntegerBounds) {
    let image = read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = image.from_buffered(std::io::Cursor::new(bytes)).expect("our own file is valid");
    (image.layer_data.into_vec(), image.attributes.display_window)
}

#[test]
fn all_layouts_and_compressions_round_trip() {
    use oscura::output::{ExrCompression, ExrLayout, ExrOptions, ExrWindow};
    let film = film([Aov::Depth, Aov::Normal, Aov::Albedo].into());
    let written = |exr: ExrOptions| {
        let options = OutputOptions { float: true, metadata: metadata(), exr, ..Default::default() };
        encode(&film, Format::Exr, &options, Path::new("x.exr")).expect("it can be written").bytes
    };
    let plain = read_back(&written(ExrOptions::default())).0;
    let tiles = Some(16);
    let lossless = [ExrCompression::None, ExrCompression::Rle, ExrCompression::Zips, ExrCompression::Piz];
    for exr in lossless
        .map(|compression| ExrOptions { compression, ..Default::default() })
        .into_iter()
        .chain([ExrOptions { tiles, ..Default::default() }])
    {
        let layer = read_back(&written(exr.clone())).0;
        assert!(layer.channel_data == plain.channel_data, "{exr:?}");
    }
    let exr = ExrOptions { layout: ExrLayout::Multipart, ..Default::default() };
    let bytes = written(exr.clone());
    assert!(bytes == written(exr), "the same bytes each time");
    let (parts, _) = parts_of(&bytes);
    let names = parts.iter().map(|part| part.attributes.layer_name.as_ref().map(Text::to_string));
    assert_eq!(names.flatten().collect::<Vec<_>>(), ["rgba", "depth", "N", "albedo"]);
    for (part, name) in [(0, "A"), (1, "Z"), (2, "N.Z"), (3, "albedo.G")] {
        assert_eq!(values(&parts[part], name), values(&plain, name));
    }
    let exr = ExrOptions { layout: ExrLayout::Layers, ..Default::default() };
    let layer = read_back(&written(exr)).0;
    assert_eq!(values(&layer, "ViewLayer.Combined.G"), values(&plain, "G"));
    assert_eq!(values(&layer, "ViewLayer.Depth.Z"), values(&plain, "Z"));
    let window = Some(ExrWindow { origin: (-3, 4), frame: (31, 40) });
    let (parts, frame) = parts_of(&written(ExrOptions { window, ..Default::default() }));
    assert_eq!((parts[0].attributes.layer_position.0, parts[0].attributes.layer_position.1), (-3, 4));
    assert_eq!((frame.position.0, frame.position.1, frame.size.0, frame.size.1), (0, 0, 31, 40));
    assert!(parts[0].channel_data == plain.channel_data);
}
