//! Signals, threads and memory, on Linux.

use crate::program::*;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Starts the program.
fn start(folder: &Path, fixed: &[&str], more: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_oscura"))
        .args(fixed.iter().chain(more))
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

/// Starts an endless render, and waits until its threads are running.
fn endless(folder: &Path, more: &[&str]) -> Child {
    endless_scene(folder);
    let fixed = ["render", "endless.toml", "-o", "a.exr", "--depth", "4294967295", "--width", "64"];
    let child = start(folder, &fixed, more);
    let begin = Instant::now();
    while cpu_ticks(child.id()) < 10 {
        assert!(begin.elapsed() < Duration::from_secs(60), "it does nothing");
        std::thread::sleep(Duration::from_millis(10));
    }
    child
}

/// CPU time of a process, hundredths of a second.
fn cpu_ticks(id: u32) -> u64 {
    let stat = fs::read_to_string(format!("/proc/{id}/stat")).expect("the process runs");
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    fields[11].parse::<u64>().expect("a number") + fields[12].parse::<u64>().expect("a number")
}

fn send(child: &Child, signal: &str) {
    let status = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(status.expect("kill runs").success());
}

#[test]
fn first_signal_ends_endless_paths_and_writes_the_picture() {
    for signal in ["-INT", "-TERM"] {
        let folder = tempfile::tempdir().unwrap();
        let child = endless(folder.path(), &["--strict", "--json"]);
        send(&child, signal);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
        // No path has ended: there is nothing to write.
        assert_eq!(report(&output)["error"]["exit_code"], 130);
        assert_eq!(names(folder.path()), ["endless.toml"]);

        let more = ["-o", "a.exr", "-o", "a.png", "--save-every", "0.05", "--strict", "--json"];
        let child = long(folder.path(), &more, "a.png");
        send(&child, signal);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
        assert_eq!(report(&output)["interrupted"], true);
        assert_eq!(attribute(&folder.path().join("a.exr"), "stoppedBy"), text("signal"));
    }
}

#[test]
fn signal_before_the_first_sample_keeps_the_old_picture() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.exr"), "precious").unwrap();
    let child = endless(folder.path(), &[]);
    send(&child, "-INT");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(folder.path().join("a.exr")).unwrap(), "precious");
    assert_eq!(names(folder.path()), ["a.exr", "endless.toml"]);
}

/// Some tiles have samples, others none: less than an earlier picture, and more than nothing.
#[test]
fn signal_before_full_coverage_writes_new_files_only() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.png"), "precious").unwrap();
    let output = stopped_in_its_first_pass(folder.path());
    assert!(!stderr(&output).contains("wrote"), "{}", stderr(&output));
    assert!(stderr(&output).contains("a.png is kept as it was"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(folder.path().join("a.png")).unwrap(), "precious");

    fs::remove_file(folder.path().join("a.png")).unwrap();
    let output = stopped_in_its_first_pass(folder.path());
    assert!(stderr(&output).contains("pixels have no sample and are black"), "{}", stderr(&output));
    let picture = image::open(folder.path().join("a.png")).expect("a picture").into_rgba8();
    let seen = picture.pixels().filter(|pixel| pixel.0[..3] != [0; 3]).count();
    assert!(seen > 0 && seen < 4000 * 4000, "{seen} pixels");
}

/// Renders a large picture and stops it after 1.5 s of CPU time.
fn stopped_in_its_first_pass(folder: &Path) -> Output {
    let scene = cornell();
    let fixed = ["render", &scene, "-o", "a.png", "--size", "4000x4000", "--spp", "64", "--threads", "1"];
    let child = start(folder, &fixed, &[]);
    let begin = Instant::now();
    while cpu_ticks(child.id()) < 150 {
        assert!(begin.elapsed() < Duration::from_secs(60), "it does nothing");
        std::thread::sleep(Duration::from_millis(10));
    }
    send(&child, "-INT");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    output
}

#[test]
fn broken_pipe_of_a_picture_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let fixed = ["render", &scene, "-o", "exr:-", "--size", "400x300", "--spp", "1"];
    let mut child = start(folder.path(), &fixed, &[]);
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
    assert!(!stderr(&output).contains("wrote"), "{}", stderr(&output));
}

#[test]
fn two_signals_within_a_second_count_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let child = long(folder.path(), &["-o", "a.exr", "-o", "a.png", "--save-every", "0.05"], "a.png");
    let picture = folder.path().join("a.exr");
    // While stopped, both are pending and arrive when it continues.
    send(&child, "-STOP");
    fs::remove_file(&picture).unwrap();
    send(&child, "-INT");
    send(&child, "-TERM");
    send(&child, "-CONT");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert_eq!(attribute(&picture, "stoppedBy"), text("signal"));
}

#[test]
fn one_render_thread() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = endless(folder.path(), &["--threads", "1"]);
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).expect("it runs");
    child.kill().expect("it can be ended");
    child.wait().expect("it ends");
    let threads = status.lines().find_map(|l| l.strip_prefix("Threads:")).expect("a count");
    // The main thread, the signal thread, and the render thread.
    assert_eq!(threads.trim(), "3");
}

#[test]
fn out_of_memory_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let run = |more: &str| {
        let program = env!("CARGO_BIN_EXE_oscura");
        let line = format!("ulimit -v 3000000; exec {program} render {} -o a.png {more}", cornell());
        let output = Command::new("sh").args(["-c", &line]).current_dir(folder.path()).output();
        let output = output.expect("the shell runs");
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        stderr(&output)
    };
    assert!(run("--width 16384 --height 16384 --spp 4").contains("12.0 GiB"));
    assert!(run("--threads 1000").contains("threads"));
    assert!(names(folder.path()).is_empty());
}

/// Intermediate pictures of denoised renders are noisy and keep the denoiser's inputs; other renders don't.
#[test]
fn intermediate_pictures_can_be_denoised() {
    let folder = tempfile::tempdir().unwrap();
    let child = long(folder.path(), &["-o", "a.exr", "--save-every", "0.05", "--denoise"], "a.exr");
    let (picture, kept) = (folder.path().join("a.exr"), folder.path().join("kept.exr"));
    fs::copy(&picture, &kept).unwrap();
    send(&child, "-TERM");
    assert_eq!(child.wait_with_output().expect("it ends").status.code(), Some(130));
    assert!(
        ["denoising_albedo.R", "denoising_normal.X"].iter().all(|name| planes(&kept).contains_key(*name))
    );
    assert_eq!(planes(&picture).keys().collect::<Vec<_>>(), ["A", "B", "G", "R"]);
    assert_eq!(attribute(&kept, "denoised"), None);
    assert!(attribute(&picture, "denoised").is_some());
    says(&run(folder.path(), &["denoise", "kept.exr", "-o", "clean.exr"], 0), "guides   albedo, normal;");
}

/// Starts a render of very many samples; waits until a picture exists.
fn long(folder: &Path, more: &[&str], picture: &str) -> Child {
    let scene = cornell();
    let fixed = ["render", &scene, "--width", "32", "--spp", "100000000"];
    let child = start(folder, &fixed, more);
    let begin = Instant::now();
    while !folder.join(picture).exists() {
        assert!(begin.elapsed() < Duration::from_secs(60), "there is no picture");
        std::thread::sleep(Duration::from_millis(10));
    }
    child
}

#[test]
fn intermediate_pictures_are_complete_files_marked_unfinished() {
    let folder = tempfile::tempdir().unwrap();
    let child = long(folder.path(), &["-o", "a.exr", "-o", "a.png", "--save-every", "0.05"], "a.png");
    let picture = folder.path().join("a.exr");
    assert_eq!(attribute(&picture, "stoppedBy"), text("not finished"));
    assert!(pixels(&picture).iter().any(|p| p[0] > 0.0));
    send(&child, "-TERM");
    assert_eq!(child.wait_with_output().expect("it ends").status.code(), Some(130));
    assert_eq!(attribute(&picture, "stoppedBy"), text("signal"));
}

#[test]
fn interrupted_frames_are_rendered_next_time() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("f.0001.exr"), "").unwrap();
    let frames = ["-o", "f.exr", "--frames", "1-2", "--resume", "--json"];
    let child = long(folder.path(), &frames, "f.0001.exr");
    while cpu_ticks(child.id()) < 20 {
        std::thread::sleep(Duration::from_millis(10));
    }
    send(&child, "-TERM");
    assert_eq!(child.wait_with_output().expect("it ends").status.code(), Some(130));
    assert_eq!(names(folder.path()), ["f.0001.exr"]);
}

/// A pipe that delays the model: slow loading is reported, as text or JSON.
#[test]
fn slow_loading_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("late.ply");
    let model = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/meshes/torus.ply")).unwrap();
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs").success());
    let fixed = ["render", "late.ply", "--width", "16", "--spp", "1", "--threads", "1", "-o"];
    for (more, on_stdout) in [
        (&["a.png", "--progress", "json"][..], "{\"event\": \"load\", \"elapsed_s\": 2.0"),
        (&["b.png", "--progress", "openjd"], "openjd_status: load, 2 s\n"),
        (&["c.png"], ""),
        (&["d.png", "--quiet"], ""),
    ] {
        let child = start(folder.path(), &fixed, more);
        std::thread::sleep(Duration::from_millis(2400));
        fs::write(&pipe, &model).expect("the program reads");
        let output = child.wait_with_output().expect("the program ends");
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert!(stdout(&output).contains(on_stdout), "{more:?}: {}", stdout(&output));
        let says = stderr(&output).contains("load     2 s so far");
        assert_eq!(says, more == ["c.png"], "{more:?}: {}", stderr(&output));
    }
}
