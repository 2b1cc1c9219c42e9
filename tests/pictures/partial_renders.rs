//! Partial renders: crops and sample ranges merge to the same bits as a single run, on any machine; so does resuming.

use crate::support::{material, options, quad};
use oscura::compile::{CompileOptions, compile};
use oscura::film::{Aov, AovSet, Film, Reduction};
use oscura::output::part::{Identity, OutputSettings, PartFile, Region, check_parts, read_header, read_part};
use oscura::render::{
    CancelHandle, Caustics, PassOutcome, RenderOptions, Rendering, denoising_guides, in_pool,
};
use oscura::scene::{Camera, Environment, Material, Scene};
use oscura::simd::{Level, limit_level};
use std::path::{Path, PathBuf};

fn load(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    oscura::load::load(&path, &Default::default()).expect("the scene loads").scene
}

fn rendering(scene: &Scene, options: &RenderOptions) -> Rendering {
    let (compiled, _) = compile(scene, &CompileOptions::default()).expect("the scene compiles");
    Rendering::new(compiled, &scene.cameras[0], *options).expect("the film fits").with_whole_passes()
}

fn all_aovs() -> AovSet {
    Aov::ALL.iter().copied().collect()
}

/// Every value of every plane, as bits.
fn bits(film: &Film) -> Vec<(String, Vec<u32>)> {
    let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect();
    film.planes().map(|plane| (plane.name.to_string(), bits(plane.values.into_floats()))).collect()
}

fn at_once(scene: &Scene, options: &RenderOptions) -> Film {
    let mut rendering = rendering(scene, options);
    assert_eq!(rendering.run(), PassOutcome::Done);
    rendering.film().clone()
}

/// Renders a part into a file.
fn write(scene: &Scene, options: &RenderOptions, file: &Path) {
    let mut rendering = rendering(scene, options);
    assert_eq!(rendering.run(), PassOutcome::Done);
    rendering.write_part(file, &Identity::new(), &OutputSettings::default(), None).expect("a file");
}

/// Merges parts in the order of their samples, as `oscura merge` does.
fn merged(files: &[PathBuf]) -> Film {
    let mut heads: Vec<_> = files.iter().map(|f| (f.clone(), read_header(f).expect("a head"))).collect();
    heads.sort_by_key(|(_, header)| header.first_sample);
    assert_eq!(check_parts(&heads).expect("parts of one picture"), Vec::<String>::new());
    let header = &heads[0].1;
    let layout = header.channels.layout().expect("known channels");
    let mut film = Film::of_layout(header.width, header.height, layout).expect("the film fits");
    heads.iter().for_each(|(file, _)| film.merge_film(&read_part(file).expect("a part").film));
    film
}

/// Splits a length unevenly into so many parts.
fn cuts(length: u32, count: u32) -> Vec<(u32, u32)> {
    let at = |i: u32| if i == count { length } else { (length * i / count + i % 3).min(length) };
    (0..count).map(|i| (at(i), at(i + 1))).collect()
}

#[test]
fn merged_parts_match_a_single_run() {
    let folder = tempfile::tempdir().unwrap();
    let scene = load("cornell-quads.toml");
    for reuse in ["off", "4x4/4"] {
        let options = options(48, 76, 100).aovs(all_aovs()).halves(true);
        let options = options.size(48, 40).path_reuse(reuse.parse().unwrap());
        let whole = at_once(&scene, &options);
        let mut files = Vec::new();
        for (i, &samples) in cuts(76, 7).iter().enumerate() {
            for (k, &(y0, y1)) in cuts(40, 5).iter().enumerate() {
                let region = Region { x0: 0, y0, x1: 48, y1 };
                let own = options.sample_range(samples).region(region);
                let file = folder.path().join(format!("{reuse}-{i}-{k}.part").replace('/', "_"));
                limit_level(Level::ALL[(i + k) % Level::ALL.len()]);
                let threads = [1, 2, 7][(i + 2 * k) % 3];
                in_pool(Some(threads), || write(&scene, &own, &file)).expect("the threads start");
                files.push(file);
            }
        }
        limit_level(Level::HIGHEST);
        // Shuffled.
        files.sort_by_key(|file| {
            file.to_string_lossy().bytes().map(u32::from).fold(7, |a, b| a * 31 % 977 + b)
        });
        let film = merged(&files);
        assert!(bits(&film) == bits(&whole), "{reuse}");
        assert!(film.halves() == whole.halves() && film.invalid_samples() == whole.invalid_samples());
    }
}

/// Automatic choices of techniques depend on the first samples of the whole picture: parts without them make the same ones.
#[test]
fn parts_choose_the_techniques_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mut chosen = Vec::new();
    for scene in [load("cornell-quads.toml"), open_box()] {
        let options = options(192, 16, 5);
        let mut whole = rendering(&scene, &options);
        whole.run();
        chosen.push((whole.statistics().path_reuse.is_some(), whole.statistics().branches > 1));
        let (left, right) =
            (Region { x0: 0, y0: 0, x1: 50, y1: 192 }, Region { x0: 50, y0: 0, x1: 192, y1: 192 });
        let parts = [(left, (0, 8)), (left, (8, 16)), (right, (0, 8)), (right, (8, 16))];
        let files: Vec<PathBuf> = (0..4).map(|i| folder.path().join(format!("{i}.part"))).collect();
        for ((region, samples), file) in parts.into_iter().zip(&files) {
            write(&scene, &options.region(region).sample_range(samples), file);
        }
        assert!(bits(&merged(&files)) == bits(whole.film()));
    }
    assert!(chosen.iter().any(|(shares, _)| *shares), "no scene shares paths: the test shows nothing");
}

/// A box with an area light, open to a dim sky.
fn open_box() -> Scene {
    let mut scene = Scene::default();
    let white = material(&mut scene, Material::lambert("white", [0.8; 3]));
    let lamp = material(&mut scene, Material::emitter("lamp", [9.0; 3], false));
    quad(&mut scene, [-4.0, -1.0, -4.0], [8.0, 0.0, 0.0], [0.0, 0.0, 8.0], white);
    quad(&mut scene, [-4.0, -1.0, -4.0], [8.0, 0.0, 0.0], [0.0, 5.0, 0.0], white);
    quad(&mut scene, [-0.3, 2.0, -0.3], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6], lamp);
    scene.environment = Environment::Constant([0.2; 3]);
    scene.cameras.push(Camera::look_at([0.0, 0.5, 4.0], [0.0, 0.0, -1.0], 40.0));
    scene
}

#[test]
fn resuming_matches_a_single_run() {
    let options = options(192, 36, 5).aovs(all_aovs()).halves(true).noise(1e-9);
    check_resuming(&load("cornell-quads.toml"), &options);
}

/// The error of the denoised picture is measured at the same sample counts, with light tracing too.
#[test]
fn resuming_to_a_noise_threshold_matches_a_single_run() {
    let options = options(192, 64, 100).aovs(denoising_guides()).halves(true).noise(0.02).denoises(true);
    check_resuming(&load("cornell-spheres.toml"), &options.caustics(Caustics::On));
}

/// Stops a render after some passes and resumes from the file, repeatedly.
fn check_resuming(scene: &Scene, options: &RenderOptions) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.part");
    let mut whole = rendering(scene, options);
    whole.run();
    assert!(whole.statistics().error.is_some());
    for passes in [1, 3] {
        let begin = |options: &RenderOptions| {
            let mut rendering = rendering(scene, options);
            if file.exists() {
                let part = read_part(&file).expect("a file");
                rendering.resume(&file, part, &Identity::new()).expect("it goes on");
            }
            rendering
        };
        let mut rendering = begin(options);
        while rendering.is_between_blocks() && rendering.next_pass() == PassOutcome::Progressed {
            if rendering.statistics().samples / (192 * 192) >= 8 * passes {
                rendering
                    .write_part(&file, &Identity::new(), &OutputSettings::default(), None)
                    .expect("a file");
                rendering = begin(options);
            }
            if rendering.ends_within_block() {
                rendering
                    .write_part(&file, &Identity::new(), &OutputSettings::default(), None)
                    .expect("a file");
            }
        }
        assert!(bits(rendering.film()) == bits(whole.film()), "{passes}");
        assert_eq!(rendering.film().halves(), whole.film().halves());
        assert_eq!(rendering.statistics().error, whole.statistics().error);
        std::fs::remove_file(&file).expect("it was there");
    }
}

#[test]
fn finished_renders_resume_to_more_samples() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.part");
    let scene = load("cornell-quads.toml");
    let few = options(8, 270, 5).aovs(Aov::Variance);
    let many = few.samples(600);
    let mut rendering_of_few = rendering(&scene, &few);
    while rendering_of_few.next_pass() == PassOutcome::Progressed {
        if rendering_of_few.ends_within_block() {
            let written =
                rendering_of_few.write_part(&file, &Identity::new(), &OutputSettings::default(), None);
            written.expect("a file");
        }
    }
    let mut more = rendering(&scene, &many);
    more.resume(&file, read_part(&file).expect("a file"), &Identity::new()).expect("it goes on");
    assert_eq!(more.film().samples(0, 0), 264);
    more.run();
    assert!(bits(more.film()) == bits(&at_once(&scene, &many)));
    // The planned number determines the sequence.
    let planned = options(8, 8, 5).planned(24);
    write(&scene, &planned, &file);
    let mut more = rendering(&scene, &planned.samples(24));
    more.resume(&file, read_part(&file).expect("a file"), &Identity::new()).expect("it goes on");
    more.run();
    assert!(bits(more.film()) == bits(&at_once(&scene, &options(8, 24, 5))));
}

#[test]
fn cancelled_passes_are_completed_where_the_render_can_be_resumed() {
    let scene = load("cornell-quads.toml");
    let cancel = CancelHandle::new();
    let mut rendering = rendering(&scene, &options(16, 64, 5)).with_cancel_handle(cancel.clone());
    rendering.next_pass();
    cancel.cancel();
    assert_eq!(rendering.next_pass(), PassOutcome::Cancelled);
    let counts: Vec<u32> = (0..16).map(|x| rendering.film().samples(x, 3)).collect();
    assert_eq!(counts, [16; 16]);
    assert!(rendering.is_between_blocks());
}

#[test]
fn invalid_parts_are_refused() {
    let scene = load("cornell-quads.toml");
    let (compiled, _) = compile(&scene, &CompileOptions::default()).expect("the scene compiles");
    let compiled = std::sync::Arc::new(compiled);
    let options = options(16, 64, 5);
    let refused = |options: RenderOptions| {
        Rendering::new(compiled.clone(), &scene.cameras[0], options).err().expect("it is refused").to_string()
    };
    let region = |x0, y0, x1, y1| options.region(Region { x0, y0, x1, y1 });
    assert!(refused(region(0, 0, 17, 3)).contains("0,0,17,3"));
    assert!(refused(region(3, 3, 3, 4)).contains("16 x 16"));
    assert!(refused(options.sample_range((8, 65))).contains("0..64"));
    let limited = options.sample_range((0, 8)).time_limit(std::time::Duration::from_secs(1));
    assert!(refused(limited).contains("time"));
}

/// A truncated file or a flipped bit is refused, without large allocations.
#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (file, copy) = (folder.path().join("a.part"), folder.path().join("b.part"));
    let scene = load("cornell-quads.toml");
    let options = options(24, 8, 5).aovs(all_aovs()).halves(true);
    write(&scene, &options, &file);
    let bytes = std::fs::read(&file).expect("a file");
    let refused = |bytes: &[u8]| {
        std::fs::write(&copy, bytes).expect("written");
        read_part(&copy).err().map(|error| error.problems[0].code)
    };
    assert_eq!(refused(&bytes), None);
    for length in (0..bytes.len()).step_by(4096).chain([1, 20, 24, 200, bytes.len() - 1]) {
        let code = refused(&bytes[..length]).expect("it is refused");
        assert!(["part-damaged", "not-a-part"].contains(&code), "{length}: {code}");
    }
    for i in 0..1000usize {
        let mut other = bytes.clone();
        // The first bytes are the most interesting.
        let at = if i < 300 { i * 7 } else { i * bytes.len() / 1000 };
        other[at.min(bytes.len() - 1)] ^= 1 << (i % 8);
        assert!(refused(&other).is_some(), "bit {} of byte {at}", i % 8);
    }
    assert!(refused(&[&bytes[..], &[0]].concat()).is_some());
    let channels = read_header(&file).expect("a head").channels.layout().expect("known channels");
    let film = Film::of_layout(24, 24, channels).expect("it fits");
    assert!(film.channels().iter().any(|channel| channel.reduction == Reduction::Coverage));
    assert!(matches!(read_part(&file), Ok(PartFile { .. })));
}

/// Headers with a valid checksum but false sizes are refused.
#[test]
fn inconsistent_headers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (file, copy) = (folder.path().join("a.part"), folder.path().join("b.part"));
    write(&load("cornell-quads.toml"), &options(8, 8, 5), &file);
    let bytes = std::fs::read(&file).expect("a file");
    let length = u64::from_le_bytes(bytes[16..24].try_into().expect("eight bytes")) as usize;
    let (head, rest) = bytes[24..bytes.len() - 4].split_at(length);
    let with = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut head: serde_json::Value = serde_json::from_slice(head).expect("JSON");
        change(&mut head);
        let head = head.to_string();
        let length = (head.len() as u64).to_le_bytes();
        let mut other = [&bytes[..16], &length[..], head.as_bytes(), rest].concat();
        other.extend(crc32fast::hash(&other).to_le_bytes());
        std::fs::write(&copy, other).expect("written");
        read_part(&copy).err().map(|error| error.problems[0].code)
    };
    assert_eq!(with(&|_| ()), None);
    let large = |head: &mut serde_json::Value| {
        head["output"]["background"] = serde_json::json!({ "Picture": [1u32 << 30, 1u32 << 30] });
    };
    assert_eq!(with(&large), Some("part-damaged"));
    for name in ["ключ", "", "a.b", "two words"] {
        let reported = with(&|head| head["channels"]["light_groups"] = serde_json::json!([name]));
        assert_eq!(reported, Some("part-damaged"), "{name}");
    }
}
