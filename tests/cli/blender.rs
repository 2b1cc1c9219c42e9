//! Blender files: finding Blender, its errors, and rendering of the export. A script stands in for Blender; with a real one
//! (`OSCURA_BLENDER`, or a Python with `bpy`) the exporter itself is tested.

use crate::program::*;
use crate::skip::skip;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// An emissive triangle in front of a camera, as the exporter writes scenes.
const SCENE: &str = "[render]\nwidth = 40\nheight = 20\nsamples = 2\n[environment]\nbackground = 0\n\
[[camera]]\nname = \"front\"\ntransform = [{ translate = [0.3, 0.3, 2] }]\nvfov = 40\nshift = [0, 0]\n\
[[lights]]\nvisible_to_camera = false\nobstacle = false\npoint = { radius = 0.1, power = 5 }\ntransform = []\n\
[materials.glow]\ntype = \"emissive\"\nradiance = [1, 0.5, 0.25]\n\
[[objects]]\ntriangle = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nmaterial = \"glow\"\n";

/// A folder with a .blend file, its export, and a search path that is only its own `bin`.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Place {
        let folder = tempfile::tempdir().expect("a folder");
        let place = Place { folder };
        fs::create_dir(place.path("bin")).expect("made");
        fs::write(place.path("room.blend"), "BLENDER").expect("written");
        fs::write(place.path("exported.toml"), SCENE).expect("written");
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A fake program that prints this version and otherwise runs the script: `$FILE`, `$FOLDER`, `$NAME` and `$ANSWER` are the
    /// exporter's arguments.
    fn program(&self, name: &str, version: &str, script: &str) -> PathBuf {
        let here = self.folder.path().display();
        let text = format!(
            "#!/bin/sh\nPATH=/usr/bin:/bin\nif [ \"$1\" = --version ]; then echo '{version}'; exit 0; fi\n\
             echo \"$0 $*\" >> {here}/called\nwhile [ \"$1\" != -- ]; do shift; done\n\
             FILE=$2 FOLDER=$3 NAME=$4 ANSWER=$5\nshift 5\necho \"$*\" >> {here}/options\n{script}\n"
        );
        let path = self.path(name);
        fs::write(&path, text).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("made a program");
        path
    }

    /// A fake Blender that exports the scene.
    fn blender(&self, name: &str) -> PathBuf {
        let here = self.folder.path().display();
        let script = format!(
            "cp {here}/exported.toml $FOLDER/$NAME.toml\n\
             echo '{{\"error\": null, \"warnings\": [[\"Smoke\", \"is lost\"]], \"notes\": [[\"\", \"a note\"]]}}' > $ANSWER"
        );
        self.program(name, "Blender 4.5.1 LTS", &script)
    }

    fn run(&self, variable: Option<&Path>, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_oscura"));
        command.args(args).current_dir(self.folder.path()).env("NO_COLOR", "1");
        command.env("PATH", self.path("bin")).env("HOME", self.folder.path()).env_remove("OSCURA_BLENDER");
        if let Some(variable) = variable {
            command.env("OSCURA_BLENDER", variable);
        }
        command.output().expect("the program starts")
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_default()
    }
}

fn name(path: &Path) -> &str {
    path.to_str().expect("a plain name")
}

#[test]
fn blender_is_found_by_option_variable_or_path() {
    let place = Place::new();
    let (first, second) = (place.blender("first"), place.blender("second"));
    place.blender("bin/blender");
    let render = ["render", "room.blend", "-o", "room.exr"];
    for (variable, option, expected) in
        [(Some(&second), Some(&first), "first"), (Some(&second), None, "second"), (None, None, "bin/blender")]
    {
        let _ = fs::remove_file(place.path("called"));
        let option = option.map_or(vec![], |path| vec!["--blender", name(path)]);
        let output = place.run(variable.map(PathBuf::as_path), &[&render[..], &option].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let called = place.text("called");
        assert!(called.starts_with(name(&place.path(expected))), "{expected}: {called}");
        assert!(called.contains("--disable-autoexec") && called.contains("--background"), "{called}");
        assert!(place.path("room.exr").exists());
    }
}

/// Images packed in the file are unpacked to a temporary folder, and large ones are decoded from it during compilation.
#[test]
fn unpacked_images_exist_until_they_are_decoded() {
    let place = Place::new();
    let noisy = image::RgbImage::from_fn(700, 700, |x, y| image::Rgb([(x * y) as u8, x as u8, y as u8]));
    noisy.save(place.path("large.png")).expect("written");
    let ball = "[textures.t]\ntype = \"image\"\nfile = \"scene.image0.png\"\n[materials.m]\ntype = \"lambert\"\n\
                color = \"t\"\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"m\"\n";
    fs::write(place.path("exported.toml"), format!("{SCENE}{ball}")).expect("written");
    let here = place.path("").display().to_string();
    let script = format!(
        "cp {here}/exported.toml $FOLDER/$NAME.toml\n\
         cp {here}/large.png $FOLDER/scene.image0.png\n\
         echo '{{\"error\": null, \"warnings\": [], \"notes\": []}}' > $ANSWER"
    );
    let blender = place.program("tool", "Blender 4.5.1 LTS", &script);
    let output = place.run(None, &["render", "room.blend", "-o", "a.png", "--blender", name(&blender)]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(!stderr(&output).contains("image0"), "{}", stderr(&output));
}

#[test]
fn blend_files_are_rendered_and_losses_reported() {
    let place = Place::new();
    let blender = place.blender("tool");
    let options = ["--blender", name(&blender)];
    let output =
        place.run(None, &[&["render", "room.blend", "-o", "a.exr", "--json"][..], &options].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let messages = stderr(&output);
    assert!(
        messages.contains("room.blend: Smoke: ") && messages.contains("room.blend: a note"),
        "{messages}"
    );
    assert!(!messages.contains("/scene."), "the temporary files are nobody's business: {messages}");
    let report = report(&output);
    assert_eq!((&report["width"], report["samples_per_pixel"].as_f64()), (&40.into(), Some(2.0)));
    assert_eq!(report["shells"], 1);

    let strict =
        place.run(None, &[&["render", "room.blend", "-o", "b.exr", "--strict"][..], &options].concat());
    assert_eq!(code(&strict), 3);
    assert!(!place.path("b.exr").exists());

    let inspected = place.run(None, &[&["inspect", "room.blend"][..], &options].concat());
    assert!(stdout(&inspected).contains("Smoke: "), "{}", stdout(&inspected));

    fs::remove_file(place.path("options")).expect("options were noted");
    let frames =
        ["render", "room.blend", "-o", "f.exr", "--frames", "3-5x2", "--scene", "Night", "--no-cache"];
    let output = place.run(None, &[&frames[..], &options].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(place.path("f.0003.exr").exists() && place.path("f.0005.exr").exists());
    assert_eq!(place.text("options"), "--frame 3 --scene Night --links\n--frame 5 --scene Night --links\n");
}

#[test]
fn exports_are_atomic_and_overwrite_only_on_request() {
    let place = Place::new();
    let blender = place.blender("tool");
    let export = |more: &[&str]| {
        let args = ["export", "room.blend", "-o", "out", "--blender", name(&blender)];
        place.run(None, &[&args[..], more].concat())
    };
    assert_eq!(code(&export(&[])), 0);
    assert_eq!(names(&place.path("out")), ["scene.toml"]);
    fs::write(place.path("out/scene.toml"), "precious").expect("written");
    assert_eq!(code(&export(&[])), 2);
    assert_eq!(place.text("out/scene.toml"), "precious");
    assert_eq!(code(&export(&["--force"])), 0);
    assert_ne!(place.text("out/scene.toml"), "precious");
    let strict =
        place.run(None, &["export", "room.blend", "-o", "new", "--strict", "--blender", name(&blender)]);
    assert_eq!(code(&strict), 3);
    assert!(!place.path("new").exists());
    let left: Vec<String> =
        names(place.folder.path()).into_iter().filter(|n| n.starts_with(".oscura")).collect();
    assert!(left.is_empty(), "{left:?}");
    let rendered = place.run(None, &["render", "out/scene.toml", "-o", "again.exr"]);
    assert_eq!(code(&rendered), 0, "{}", stderr(&rendered));
    assert_eq!(code(&place.run(None, &["export", "exported.toml", "-o", "other"])), 2);
}

#[test]
fn failures_include_blenders_output() {
    let place = Place::new();
    let answer = "echo '{\"error\": \"the file is damaged\"}' > $ANSWER; exit 3";
    for (version, script, expected) in [
        ("Blender 4.5.1", answer, "the file is damaged"),
        ("Blender 4.5.1", "echo thunder >&2; exit 3", "thunder"),
        ("Blender 4.5.1", "kill -SEGV $$", "signal"),
        ("Blender 4.5.1", "echo fine", "fine"),
        ("Blender 3.6.2", "", "too old"),
        ("Emacs 29", "", "neither Blender nor Python"),
        ("Python 3.11.7", "echo \"ModuleNotFoundError: No module named 'bpy'\"; exit 1", "pip install bpy"),
    ] {
        let program = place.program("tool", version, script);
        let output = place.run(None, &["render", "room.blend", "-o", "a.exr", "--blender", name(&program)]);
        assert_eq!(code(&output), 3, "{script}");
        assert!(stderr(&output).contains(expected), "{version}, {script}: {}", stderr(&output));
        assert!(!place.path("a.exr").exists());
    }
    let missing = place.run(None, &["render", "room.blend", "-o", "a.exr", "--blender", "nowhere"]);
    assert!(stderr(&missing).contains("nowhere"), "{}", stderr(&missing));
}

#[test]
fn missing_blender_is_reported_with_a_hint() {
    let place = Place::new();
    if ["/opt", "/usr/local", "/usr/local/share", "/snap/bin", "/Applications"].iter().any(|folder| {
        fs::read_dir(folder).is_ok_and(|mut l| {
            l.any(|e| e.is_ok_and(|e| e.file_name().to_string_lossy().starts_with("blender")))
        })
    }) {
        return skip("no-blender", "this machine has Blender where it is looked for");
    }
    let output = place.run(None, &["render", "room.blend", "-o", "a.exr"]);
    assert_eq!(code(&output), 3);
    for word in ["room.blend", "Blender 4.2", "pip install bpy", "--blender", "OSCURA_BLENDER"] {
        assert!(stderr(&output).contains(word), "{word}: {}", stderr(&output));
    }
    assert_eq!(code(&place.run(None, &["render", "absent.blend", "-o", "a.exr"])), 3);
}

/// A Python that has `bpy`, if this machine has one.
fn python_with_bpy() -> Option<PathBuf> {
    let named = std::env::var_os("OSCURA_BLENDER").map(PathBuf::from);
    let candidates = named.into_iter().chain(["python3".into(), "python".into()]);
    let has_bpy = |python: &PathBuf| {
        Command::new(python).args(["-c", "import bpy"]).output().is_ok_and(|o| o.status.success())
    };
    candidates.into_iter().find(has_bpy)
}

/// A scene with its lights in view.
const BUILD: &str = r#"
import bpy, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y = 64, 48
scene.render.engine, scene.cycles.samples, scene.cycles.use_adaptive_sampling = "CYCLES", 16, False
def link(name, data, location):
    made = bpy.data.objects.new(name, data)
    made.location = location
    scene.collection.objects.link(made)
    return made
bpy.ops.mesh.primitive_plane_add(size=4)
lamp = bpy.data.lights.new("Panel", "AREA")
lamp.energy, lamp.size = 50, 1
link("Panel", lamp, (0, 0, 2))
scene.camera = link("Eye", bpy.data.cameras.new("Eye"), (0, 0, 5))
scene.world = bpy.data.worlds.new("World")
scene.world.color = (0, 0, 0)
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
"#;

#[test]
fn real_blender_export_is_rendered() {
    let Some(python) = python_with_bpy() else {
        return skip("bpy", "neither OSCURA_BLENDER nor python3 has the module bpy");
    };
    let place = Place::new();
    fs::write(place.path("build.py"), BUILD).expect("written");
    let built = Command::new(&python).args([place.path("build.py"), place.path("room.blend")]).output();
    assert!(built.is_ok_and(|o| o.status.success()));
    let output =
        place.run(None, &["render", "room.blend", "-o", "a.png", "--json", "--blender", name(&python)]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!((&report(&output)["width"], &report(&output)["quads"]), (&64.into(), &1.into()));
    let inspected = place.run(None, &["inspect", "room.blend", "--blender", name(&python)]);
    assert!(stdout(&inspected).contains("'Panel'"), "{}", stdout(&inspected));

    // Truncated.
    let bytes = fs::read(place.path("room.blend")).expect("read");
    fs::write(place.path("room.blend"), &bytes[..bytes.len() / 2]).expect("written");
    let broken = place.run(None, &["render", "room.blend", "-o", "b.png", "--blender", name(&python)]);
    assert_eq!(code(&broken), 3);
    assert!(stderr(&broken).contains("room.blend"), "{}", stderr(&broken));
    assert!(!place.path("b.png").exists());
}

/// Runs one of the test scripts in `tools/blender`.
fn python_test(script: &str) {
    let Some(python) = python_with_bpy() else {
        return skip("bpy", "neither OSCURA_BLENDER nor python3 has the module bpy");
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/blender").join(script);
    let output = Command::new(python).arg(script).env("OSCURA", env!("CARGO_BIN_EXE_oscura")).output();
    let output = output.expect("Python starts");
    assert!(output.status.success(), "{}\n{}", stdout(&output), stderr(&output));
}

#[test]
fn render_engine_in_blender() {
    python_test("test_engine.py");
}

#[test]
fn cached_exports_match_fresh_ones() {
    python_test("test_export.py");
}

#[test]
fn exporter_scripts() {
    [
        "test_object_info.py",
        "test_surfaces.py",
        "test_shapes.py",
        "test_hair.py",
        "test_volumes.py",
        "test_nodes.py",
        "test_scene.py",
        "test_importers.py",
    ]
    .into_iter()
    .for_each(python_test);
}

#[test]
fn export_options_reach_the_exporter() {
    let place = Place::new();
    let blender = place.blender("tool");
    let run = |more: &[&str]| {
        let _ = fs::remove_file(place.path("options"));
        let args = ["render", "room.blend", "-o", "a.png", "--blender", name(&blender)];
        assert_eq!(code(&place.run(None, &[&args[..], more].concat())), 0);
        place.text("options")
    };
    let default = run(&["--view-layer", "Front"]);
    let expected = place.path(".cache/oscura/blender");
    if cfg!(target_os = "linux") && std::env::var_os("XDG_CACHE_HOME").is_none() {
        assert_eq!(default, format!("--view-layer Front --cache {} --links\n", expected.display()));
    }
    let kept = place.folder.path().canonicalize().expect("a folder").join("kept");
    assert_eq!(run(&["--cache", "kept"]), format!("--cache {} --links\n", kept.display()));
    assert_eq!(run(&["--no-cache"]), "--links\n");
}

#[test]
fn export_cache_is_reported_and_cleared() {
    let place = Place::new();
    fs::create_dir(place.path("kept")).expect("made");
    let ours = place.path("kept/0123456789abcdef0123456789abcdef.oscura");
    fs::write(&ours, vec![0; 1 << 20]).expect("written");
    fs::write(place.path("kept/mine.oscura"), "text").expect("written");
    let messages = place.run(None, &["cache", "--cache", "kept"]);
    assert_eq!(stdout(&messages), "kept: 1 files of 1.0 MiB cached\n");
    let deleted = place.run(None, &["cache", "--cache", "kept", "--clear"]);
    assert_eq!((code(&deleted), stdout(&deleted)), (0, "kept: 1 files of 1.0 MiB deleted\n".to_string()));
    assert!(!ours.exists() && place.path("kept/mine.oscura").exists());
}

/// A box and lights in centimetres, in a USD file without other units: Blender imports it, and the radius of the light is 10 cm,
/// not 10 m.
const USD: &str = r#"#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Xform "World"
{
    def Cube "box" {
        double size = 100
    }
    def SphereLight "bulb" {
        float inputs:radius = 10
        float inputs:intensity = 100
        double3 xformOp:translate = (0, 300, 100)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DistantLight "sun" {
        float inputs:angle = 2
    }
}
"#;

#[test]
fn usd_files_are_imported_through_blender() {
    let Some(python) = python_with_bpy() else {
        return skip("bpy", "neither OSCURA_BLENDER nor python3 has the module bpy");
    };
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("room.usda"), USD).expect("written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_oscura"));
    command.current_dir(folder.path()).env("OSCURA_BLENDER", python);
    let output = command.args(["inspect", "room.usda", "--json"]).output().expect("the program starts");
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = report.to_string();
    assert!(text.contains("imported by Blender") && text.contains("1 meshes, 2 lamps"), "{text}");
    assert!(text.contains("0.1 m"), "{text}");
}

/// Blender writes watts times 100 into FBX; other programs a percentage without unit, which would be nearly black.
const FBX: &str = r#"
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_cube_add(size=2)
for name, energy, place in [("dim", 1, (0, 0, 10)), ("bright", 500, (5, 0, 5))]:
    lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
    lamp.data.energy = energy
    lamp.location = place
    bpy.context.collection.objects.link(lamp)
bpy.ops.export_scene.fbx(filepath="room.fbx")
"#;

#[test]
fn fbx_lights_have_plausible_power() {
    let Some(python) = python_with_bpy() else {
        return skip("bpy", "neither OSCURA_BLENDER nor python3 has the module bpy");
    };
    let folder = tempfile::tempdir().expect("a folder");
    let made =
        Command::new(&python).args(["-c", FBX]).current_dir(folder.path()).output().expect("Python starts");
    assert!(folder.path().join("room.fbx").exists(), "{}", stderr(&made));
    let mut command = Command::new(env!("CARGO_BIN_EXE_oscura"));
    command.current_dir(folder.path()).env("OSCURA_BLENDER", python);
    let output = command.args(["inspect", "room.fbx", "--json"]).output().expect("the program starts");
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = report.to_string();
    assert!(text.contains("1257 W"), "{text}");
    assert_eq!(text.matches(" % ").count(), 1, "{text}");
}
