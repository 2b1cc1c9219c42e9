//! Long renders: killed, resumed, split and merged.

use crate::program::*;
use crate::skip::skip;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// Options that make bytes comparable.
const FIXED: [&str; 4] = ["--reproducible", "--float", "--aov", "all"];

fn arguments<'a>(scene: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let width: &[&str] = if more.contains(&"--width") { &[] } else { &["--width", "64"] };
    [&["render", scene], &FIXED[..], width, more].concat()
}

fn shoot(folder: &Path, more: &[&str]) -> String {
    let scene = cornell();
    let output = run(folder, &arguments(&scene, more), 0);
    stderr(&output)
}

/// The exit code and what was reported.
fn fails(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = oscura(folder, args);
    (code(&output), stderr(&output))
}

fn same(folder: &Path, a: &str, b: &str) -> bool {
    fs::read(folder.join(a)).expect("a file") == fs::read(folder.join(b)).expect("a file")
}

#[test]
fn merged_parts_have_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    shoot(folder, &["--spp", "20", "-o", "whole.exr", "-o", "whole.png"]);
    let parts = [
        ("a.part", "0..5", "0,0,64,20", "1"),
        ("b.part", "5..20", "0,0,64,20", "2"),
        ("c.part", "0..20", "0,20,30,64", "7"),
        ("d.part", "0..20", "30,20,64,64", "2"),
    ];
    for (file, samples, region, threads) in parts {
        let more = ["--spp", "20", "-o", file, "--sample-range", samples, "--region", region];
        shoot(folder, &[&more[..], &["--threads", threads]].concat());
    }
    let merge = |more: &[&str]| oscura(folder, &[&["merge"], more].concat());
    let output = merge(&["d.part", "b.part", "a.part", "c.part", "-o", "m.exr", "-o", "m.png", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(report(&output)["parts"], 4);
    assert!(same(folder, "whole.exr", "m.exr") && same(folder, "whole.png", "m.png"));

    // All problems have this code.
    let is_coded = |output: &Output, code: &str| {
        let codes = report(output)["error"]["codes"].as_array().cloned().unwrap_or_default();
        !codes.is_empty() && codes.iter().all(|own| own == code)
    };
    let missing = merge(&["d.part", "b.part", "c.part", "-o", "x.exr", "--json"]);
    assert!(code(&missing) == 3 && is_coded(&missing, "part-missing"), "{}", stderr(&missing));
    assert!(
        stderr(&missing).contains("0..8") && stderr(&missing).contains("0,0,64,20"),
        "{}",
        stderr(&missing)
    );
    let allowed = merge(&["d.part", "b.part", "c.part", "-o", "x.exr", "--allow-missing"]);
    assert_eq!(code(&allowed), 0, "{}", stderr(&allowed));
    assert_eq!(attribute(&folder.join("x.exr"), "stoppedBy"), text("parts are missing"));
    let messages = stderr(&allowed);
    // 44 rows have all 20 samples, 20 rows the first 12 (whole blocks of eight and the rest).
    assert!(messages.contains("merged ") && messages.contains("17.5 "), "{messages}");
    let twice = merge(&["d.part", "b.part", "a.part", "c.part", "c.part", "-o", "y.exr", "--json"]);
    assert!(code(&twice) == 3 && is_coded(&twice, "parts-overlap"), "{}", stderr(&twice));
    shoot(folder, &["--spp", "20", "-o", "e.part", "--sample-range", "0..8", "--seed", "3"]);
    let foreign = merge(&["d.part", "e.part", "c.part", "-o", "y.exr", "--json"]);
    assert!(code(&foreign) == 3 && is_coded(&foreign, "part-of-another-picture"), "{}", stderr(&foreign));
    assert!(stderr(&foreign).contains("e.part") && stderr(&foreign).contains("seed"), "{}", stderr(&foreign));
    fs::write(folder.join("f.part"), "text").unwrap();
    let broken = merge(&["d.part", "f.part", "-o", "y.exr", "--json"]);
    assert_eq!((code(&broken), folder.join("y.exr").exists()), (3, false));
    assert!(stderr(&broken).contains("f.part") && is_coded(&broken, "not-a-part"), "{}", stderr(&broken));
}

#[test]
fn invalid_combinations_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let refused = |more: &[&str]| {
        let (code, messages) = fails(folder.path(), &arguments(&scene, more));
        assert_eq!(code, 2, "{messages}");
        messages
    };
    assert!(refused(&["-o", "a.exr", "--sample-range", "0..8"]).contains(".part"));
    assert!(refused(&["-o", "a.exr", "--resume"]).contains("--checkpoint"));
    assert!(refused(&["-o", "a.part", "--region", "0,0,65,9"]).contains("64 x 64"));
    assert!(refused(&["-o", "a.part", "--region", "9,0,9,9"]).contains("region"));
    assert!(refused(&["-o", "f.exr", "--checkpoint", "c", "--frames", "1-2"]).contains("####"));
    assert!(refused(&["-o", "a.exr", "--noise", "0"]).contains("percent"));
    assert!(refused(&["-o", "a.exr", "--spp", "8", "--min-spp", "8"]).contains("--noise"));
    assert!(refused(&["-o", "a.exr", "--noise", "2", "--spp", "8", "--max-spp", "8"]).contains("--max-spp"));
    assert!(refused(&["-o", "a.exr", "--noise", "2", "--min-spp", "9", "--max-spp", "8"]).contains("above"));
    assert!(refused(&["-o", "a.exr", "--memory-limit", "1M"]).contains("1 MiB"));
    assert!(
        refused(&["-o", "a.exr", "--width", "16384", "--height", "8192", "--memory-limit", "2G"])
            .contains("the picture")
    );
    assert!(names(folder.path()).is_empty());
}

#[test]
fn finished_renders_resume_to_more_samples() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let kept = ["--checkpoint", "c.part"];
    shoot(folder, &["--spp", "300", "--width", "16", "-o", "whole.exr"]);
    shoot(folder, &[&["--spp", "260", "--width", "16", "-o", "a.exr"], &kept[..]].concat());
    let messages =
        shoot(folder, &[&["--spp", "300", "--width", "16", "-o", "a.exr", "--resume"], &kept[..]].concat());
    assert!(
        messages.contains("resume ") && messages.contains("256") && same(folder, "a.exr", "whole.exr"),
        "{messages}"
    );

    let scene = cornell();
    let go_on = |more: &[&str]| {
        let fixed = ["-o", "a.exr", "--resume", "--checkpoint", "c.part", "--width", "16"];
        let (code, messages) = fails(folder, &arguments(&scene, &[&fixed[..], more].concat()));
        assert_eq!(code, 3, "{messages}");
        messages
    };
    assert!(go_on(&["--spp", "300", "--depth", "3"]).contains("depth"));
    assert!(go_on(&["--spp", "260"]).contains("296"));
    let messages = go_on(&["--spp", "100"]);
    assert!(messages.contains("--plan"), "{messages}");
    let changed = fs::read_to_string(&scene).unwrap().replacen("0.725", "0.625", 1);
    fs::write(folder.join("changed.gltf"), changed).unwrap();
    let before = fs::read(folder.join("c.part")).unwrap();
    let fixed = ["-o", "a.exr", "--resume", "--checkpoint", "c.part", "--width", "16", "--spp", "300"];
    let (code, messages) = fails(folder, &[&["render", "changed.gltf"], &FIXED[..], &fixed[..]].concat());
    assert!(code == 3 && messages.contains("materials"), "{messages}");
    assert!(fs::read(folder.join("c.part")).unwrap() == before);
}

#[test]
fn several_scenes_in_one_command() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = cornell();
    let small = ["--width", "16", "--spp", "1"];
    fs::write(folder.join("broken.glb"), "nothing").unwrap();
    let batch =
        |more: &[&str]| oscura(folder, &[&["render", &scene, "broken.glb"], more, &small[..]].concat());
    let same_file = batch(&["-o", "a.exr"]);
    assert!(code(&same_file) == 2 && stderr(&same_file).contains("{stem}"), "{}", stderr(&same_file));
    let output = batch(&["-o", "{stem}.exr"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("1 of 2 scenes failed:\n  broken.glb"), "{}", stderr(&output));
    assert_eq!(names(folder), ["broken.glb", "cornell-box.exr"]);
    let frames = ["render", &scene, "-o", "{name}_%03d.png", "--frames", "1-2"];
    run(folder, &[&frames[..], &small].concat(), 0);
    let made = ["broken.glb", "cornell-box.exr", "cornell-box_001.png", "cornell-box_002.png"];
    assert_eq!(names(folder), made);
}

#[test]
fn json_progress() {
    let folder = tempfile::tempdir().unwrap();
    let reported = |kind| {
        let output = render(folder.path(), "a.exr", &["--progress", kind]);
        (stdout(&output), stderr(&output))
    };
    let line: serde_json::Value =
        serde_json::from_str(reported("json").0.lines().last().expect("a line")).unwrap();
    assert_eq!((line["event"].as_str(), line["progress"].as_f64()), (Some("progress"), Some(1.0)));
    assert!(reported("openjd").0.contains("openjd_progress: 100.00\n"));
    assert_eq!((reported("none").0, reported("plain").0), (String::new(), String::new()));
}

#[test]
fn noise_threshold_is_reached() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let reported = |more: &[&str]| {
        let output = run(folder.path(), &arguments(&scene, &[&["-o", "a.exr", "--json"], more].concat()), 0);
        report(&output)
    };
    let json = reported(&["--noise", "3", "--spp", "400"]);
    let (error, samples) =
        (json["estimated_error"].as_f64().unwrap(), json["samples_per_pixel"].as_f64().unwrap());
    assert!((0.02..=0.03).contains(&error) && samples < 400.0, "{json}");
    let again = reported(&["--noise", "3", "--spp", "400", "--threads", "1"]);
    assert_eq!(again["estimated_error"], json["estimated_error"]);
    assert_eq!(reported(&["--noise", "0.01", "--spp", "40"])["samples_per_pixel"], 40);
    assert_eq!(reported(&["--noise", "0.01", "--max-spp", "48"])["samples_per_pixel"], 48);
    // An error already reached at the first estimate.
    assert_eq!(reported(&["--noise", "90"])["samples_per_pixel"], 16);
    assert_eq!(reported(&["--noise", "90", "--min-spp", "72"])["samples_per_pixel"], 72);
}

/// Whichever is reached first ends the render; a long enough time limit changes no pixel.
#[test]
fn noise_threshold_with_a_time_limit() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    shoot(folder, &["-o", "noise.exr", "--noise", "4"]);
    shoot(folder, &["-o", "both.exr", "--noise", "4", "--time-limit", "1000"]);
    assert!(pixels(&folder.join("noise.exr")) == pixels(&folder.join("both.exr")));
    let scene = cornell();
    let more = ["-o", "late.exr", "--noise", "0.001", "--time-limit", "0.5", "--json"];
    let output = run(folder, &arguments(&scene, &more), 0);
    let json = report(&output);
    assert_eq!(json["timed_out"], true, "{json}");
    assert!(json["render_s"].as_f64().expect("a number") < 3.0, "{json}");
}

/// With a noise threshold, progress is estimated from the error.
#[test]
fn progress_follows_the_noise() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let more = ["-o", "a.exr", "--width", "96", "--noise", "2", "--progress", "json"];
    let output = run(folder.path(), &arguments(&scene, &more), 0);
    let reported = stdout(&output);
    let lines: Vec<serde_json::Value> =
        reported.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let last = lines.last().expect("a line");
    assert_eq!(last["progress"], 1.0);
    let known: Vec<_> = lines.iter().filter(|line| line.get("estimated_error").is_some()).collect();
    assert!(!known.is_empty(), "{reported}");
    for line in known {
        let of = |key: &str| line[key].as_f64().unwrap();
        assert!(of("estimated_error") > 0.0, "{line}");
        assert!(of("samples_total") < 0.1 * 96.0 * 96.0 * 65536.0, "{line}");
    }
}

/// Kills a render with checkpoints at hashed times, resumes it, and verifies the files.
#[cfg(target_os = "linux")]
#[test]
fn killed_renders_resume_to_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = cornell();
    let size = ["--spp", "300", "-o", "a.exr"];
    shoot(folder, &["--spp", "300", "-o", "whole.exr"]);
    let kept = ["--checkpoint", "c.part", "--checkpoint-interval", "0.03", "--resume"];
    let all = arguments(&scene, &[&size[..], &kept[..]].concat());
    let start = || -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_oscura"));
        command.args(&all).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().expect("the program starts")
    };
    let mut random = oscura::sampling::hash::SplitMix64::new(7);
    let mut progress = Vec::new();
    for _ in 0..6 {
        let mut child = start();
        std::thread::sleep(Duration::from_secs_f64(0.1 + 0.5 * random.next_unit()));
        child.kill().expect("it can be killed");
        child.wait().expect("it ends");
        if folder.join("a.exr").exists() {
            assert!(same(folder, "a.exr", "whole.exr"), "a broken picture has its final name");
        }
        let checkpoint = folder.join("c.part");
        if checkpoint.exists() {
            let header = oscura::output::part::read_header(&checkpoint).expect("it is whole");
            oscura::output::part::read_part(&checkpoint).expect("it is whole");
            progress.push(header.end_sample);
        }
    }
    assert!(progress.windows(2).all(|w| w[0] <= w[1]), "{progress:?}");
    shoot(folder, &[&size[..], &kept[..]].concat());
    assert!(same(folder, "a.exr", "whole.exr"));
}

/// A full disk, simulated by a file size limit: the older checkpoint and picture are kept.
#[cfg(target_os = "linux")]
#[test]
fn full_disk_keeps_older_files() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = cornell();
    let run = |blocks: &str, spp: &str| {
        let program = env!("CARGO_BIN_EXE_oscura");
        let line = format!(
            "trap '' XFSZ; ulimit -f {blocks}; exec {program} render {scene} -o a.exr --width 64 --spp {spp} \
             --checkpoint c.part --resume --plan 64"
        );
        let output = Command::new("sh").args(["-c", &line]).current_dir(folder).output();
        output.expect("the shell runs")
    };
    assert_eq!(code(&run("unlimited", "16")), 0);
    let before = ["a.exr", "c.part"].map(|name| fs::read(folder.join(name)).unwrap());
    let full = run("8", "64");
    assert_eq!(code(&full), 4, "{}", stderr(&full));
    assert_eq!(["a.exr", "c.part"].map(|name| fs::read(folder.join(name)).unwrap()), before);
    assert_eq!(names(folder), ["a.exr", "c.part"]);
    assert_eq!(code(&run("unlimited", "64")), 0);
}

/// A folder that becomes read-only during a render: an error, and its checkpoint is intact.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_becomes_read_only_keeps_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = cornell();
    fs::create_dir(folder.join("d")).unwrap();
    let program = env!("CARGO_BIN_EXE_oscura");
    let (fixed, keep) = (FIXED.join(" "), "--checkpoint c.part --checkpoint-interval 0.2 --resume");
    // While a file is being written, the system refuses to make the folder read-only.
    let script = format!(
        "mount -t tmpfs none d || exit 99; cd d; \
         {program} render {scene} -o a.exr --width 64 --spp 1200 {fixed} {keep} 2> ../messages & \
         until [ -e c.part ] && mount -o remount,ro . 2> ../busy; do sleep 0.01; done; \
         wait $!; echo $? > ../code; ls -A > ../names; cp c.part ..; [ ! -e a.exr ] || cp a.exr .."
    );
    let output = Command::new("unshare").args(["-rm", "sh", "-c", &script]).current_dir(folder).output();
    match output {
        Ok(output) if folder.join("code").exists() => assert_eq!(code(&output), 0, "{}", stderr(&output)),
        _ => return skip("mounts", "this system lets users mount nothing"),
    }
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    assert_eq!((read("code").trim(), read("names").trim()), ("4", "c.part"), "{}", read("messages"));
    assert!(
        read("messages").contains("a.exr") && read("messages").contains("Read-only"),
        "{}",
        read("messages")
    );
    shoot(folder, &["--spp", "1200", "-o", "a.exr", "--checkpoint", "c.part", "--resume"]);
    shoot(folder, &["--spp", "1200", "-o", "whole.exr"]);
    assert!(same(folder, "a.exr", "whole.exr"));
}
