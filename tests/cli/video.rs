//! Videos of turntables and sequences, by ffmpeg where installed.

use crate::program::*;
use crate::skip::skip;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Is the encoder there?
fn has_ffmpeg() -> bool {
    let is_there = Command::new("ffprobe").arg("-version").output().is_ok();
    if !is_there {
        skip("ffmpeg", "ffmpeg and ffprobe are not installed");
    }
    is_there
}

/// Width, height and number of frames of a video.
fn shape(path: &Path) -> Vec<String> {
    let words = ["-v", "error", "-count_frames", "-select_streams", "v", "-of", "csv=p=0", "-show_entries"];
    let output = Command::new("ffprobe")
        .args(words)
        .arg("stream=width,height,avg_frame_rate,nb_read_frames")
        .arg(path)
        .output();
    let text = String::from_utf8(output.expect("ffprobe").stdout).expect("text");
    text.trim().split(',').map(str::to_string).collect()
}

const SMALL: [&str; 6] = ["--width", "63", "--height", "48", "--spp", "4"];

#[test]
fn a_turntable_becomes_video() {
    if !has_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let words =
        ["render", &scene, "--orbit", "5", "--fps", "12", "-o", "a.mp4", "-o", "a.webm", "-o", "a.png"];
    says(&run(folder.path(), &[&words[..], &SMALL].concat(), 0), "wrote    a.mp4");
    for name in ["a.mp4", "a.webm"] {
        // Sizes of video are even.
        assert_eq!(shape(&folder.path().join(name)), ["62", "48", "12/1", "5"], "{name}");
    }
    // The frames have the colours of the pictures.
    let still = Command::new("ffmpeg")
        .args(["-v", "error", "-i", "a.mp4", "-vframes", "1", "-pix_fmt", "rgb24", "frame.png"])
        .current_dir(folder.path())
        .status();
    assert!(still.expect("ffmpeg").success());
    let mean = |name: &str| {
        let picture = image::open(folder.path().join(name)).expect("a picture").into_rgb8();
        let sum = picture.pixels().fold([0.0; 3], |sum, p| [0, 1, 2].map(|c| sum[c] + f64::from(p[c])));
        sum.map(|sum| sum / f64::from(picture.width() * picture.height()))
    };
    let (video, picture) = (mean("frame.png"), mean("a.0000.png"));
    for c in 0..3 {
        assert!((video[c] - picture[c]).abs() < 4.0, "{video:?} is not {picture:?}");
    }
}

#[test]
fn a_sequence_becomes_video_or_an_animation() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let words = ["render", &scene, "--frames", "1-6x2", "-o", "a.gif"];
    let video = if has_ffmpeg() { &["-o", "a.webm"][..] } else { &[] };
    run(folder.path(), &[&words[..], video, &SMALL].concat(), 0);
    assert!(fs::read(folder.path().join("a.gif")).unwrap().starts_with(b"GIF89a"));
    if !video.is_empty() {
        assert_eq!(shape(&folder.path().join("a.webm"))[3], "3");
    }
    run(folder.path(), &[&words[..], &["--resume"], &SMALL].concat(), 2);
    says(&run(folder.path(), &["render", &scene, "-o", "a.mp4"], 2), "--orbit");
}

/// Makes a video with only this folder in the search path.
fn command(programs: &Path, folder: &Path, frames: &str) -> Command {
    let scene = cornell();
    let mut command = Command::new(env!("CARGO_BIN_EXE_oscura"));
    command.args(["render", &scene, "--orbit", frames, "-o", "a.mp4"]).args(SMALL);
    command.current_dir(folder).env("PATH", programs);
    command
}

fn with_programs(programs: &Path, folder: &Path) -> Output {
    command(programs, folder, "3").output().expect("it starts")
}

/// Writes a fake encoder.
#[cfg(unix)]
fn encoder(folder: &Path, behaviour: &str) {
    use std::os::unix::fs::PermissionsExt;
    let (program, begin) = (folder.join("ffmpeg"), "#!/bin/sh\n[ \"$1\" = -version ] && exit 0\n");
    fs::write(&program, format!("{begin}{behaviour}\n")).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn missing_encoder_is_reported_before_rendering() {
    let (programs, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let output = with_programs(programs.path(), folder.path());
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    let messages = stderr(&output);
    assert!(messages.contains("ffmpeg") && !messages.contains("frame "), "{messages}");
    assert!(names(folder.path()).is_empty());
}

#[test]
#[cfg(unix)]
fn encoder_failures_are_reported_and_leave_no_file() {
    let (programs, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for behaviour in ["exit 1", "read -r line; exit 1", "/bin/cat > /dev/null; exit 1"] {
        encoder(programs.path(), &format!("echo \"Unknown encoder 'libx264'\" >&2\n{behaviour}"));
        fs::write(folder.path().join("a.mp4"), "older").unwrap();
        let output = with_programs(programs.path(), folder.path());
        assert_eq!(code(&output), 4, "{behaviour}: {}", stderr(&output));
        assert!(stderr(&output).contains("Unknown encoder 'libx264'"), "{}", stderr(&output));
        assert_eq!(names(folder.path()), ["a.mp4"]);
        assert_eq!(fs::read_to_string(folder.path().join("a.mp4")).unwrap(), "older");
    }
}

#[test]
#[cfg(unix)]
fn interrupted_videos_leave_no_file() {
    use std::io::{BufRead, BufReader};
    let (programs, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    encoder(programs.path(), "/bin/cat > \"$0.frames\"");
    let mut command = command(programs.path(), folder.path(), "100000");
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().expect("it starts");
    let mut lines = BufReader::new(child.stderr.take().expect("its messages")).lines().map_while(Result::ok);
    let third = lines.by_ref().find(|line| line.starts_with("frame    2 of"));
    assert!(third.is_some(), "frames are rendered");
    assert_eq!(names(folder.path()).len(), 1, "the encoder's own file, under a name of its own");
    let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(status.expect("kill runs").success());
    let messages = lines.collect::<Vec<_>>().join("\n");
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert!(messages.contains("a.mp4"), "{messages}");
    assert!(!messages.contains("the pictures hold"), "{messages}");
    assert!(names(folder.path()).is_empty(), "{:?}", names(folder.path()));
    let frame = 63 * 48 * 4;
    let frames = fs::metadata(programs.path().join("ffmpeg.frames")).expect("what was sent").len();
    assert!(frames >= frame, "{frames} bytes");
}
