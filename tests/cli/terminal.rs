//! `--show`: pictures drawn in a terminal.

use crate::program::*;
use crate::skip::skip;
use std::path::Path;
use std::process::Command;

/// Runs the program in a terminal of 60 x 20 characters and returns its output. `None` without Python, which provides the
/// terminal.
#[cfg(unix)]
fn in_terminal(folder: &Path, term: &str, words: &[&str]) -> Option<(i32, String)> {
    const SPAWN: &str = "import os, pty, sys; sys.exit(os.waitstatus_to_exitcode(pty.spawn(sys.argv[1:])))";
    let mut command = Command::new("python3");
    command.args(["-c", SPAWN, "sh", "-c", "stty cols 60 rows 20; exec \"$0\" \"$@\""]);
    command
        .arg(env!("CARGO_BIN_EXE_oscura"))
        .args(words)
        .current_dir(folder)
        .stdin(std::process::Stdio::null());
    for name in ["TMUX", "KITTY_WINDOW_ID", "TERM_PROGRAM"] {
        command.env_remove(name);
    }
    let Ok(output) = command.env("TERM", term).output() else {
        skip("python3", "there is no python3");
        return None;
    };
    Some((code(&output), String::from_utf8_lossy(&output.stdout).replace("\r\n", "\n")))
}

const SMALL: [&str; 9] = ["--width", "40", "--height", "32", "--spp", "2", "--threads", "1", "--quiet"];

type Pixel = Option<[u8; 3]>;

/// The pixels of a half-block drawing: two rows per line. `None` is the terminal's background.
fn pixels(drawn: &str) -> Vec<Vec<Pixel>> {
    let mut rows = Vec::new();
    for line in drawn.lines().filter(|line| line.contains("\x1b[")) {
        let (mut upper, mut lower, mut colors) = (Vec::new(), Vec::new(), [None; 2]);
        let mut rest = line;
        while let Some(c) = rest.chars().next() {
            rest = &rest[c.len_utf8()..];
            match c {
                '\x1b' => {
                    let (code, behind) = rest[1..].split_once('m').expect("a code");
                    rest = behind;
                    let numbers: Vec<u8> = code.split(';').map(|n| n.parse().expect("a number")).collect();
                    colors = match numbers[..] {
                        [38, 2, r, g, b, 48, 2, r2, g2, b2] => [Some([r, g, b]), Some([r2, g2, b2])],
                        [0, 38, 2, r, g, b] => [Some([r, g, b]), None],
                        _ => [None; 2],
                    };
                }
                '▄' => (upper.push(None), lower.push(colors[0])).1,
                _ => (upper.push(colors[0]), lower.push(colors[1])).1,
            }
        }
        rows.extend([upper, lower]);
    }
    rows
}

#[test]
#[cfg(unix)]
fn a_terminal_shows_the_pixels_of_the_png() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let words = [&["render", &scene, "-o", "a.png", "--show"], &SMALL[..]].concat();
    let Some((code, drawn)) = in_terminal(folder.path(), "xterm-256color", &words) else { return };
    assert_eq!(code, 0, "{drawn}");
    let picture = image::open(folder.path().join("a.png")).unwrap().into_rgba8();
    let shown = pixels(&drawn);
    assert_eq!((shown.len(), shown[0].len()), (32, 40), "{drawn}");
    for (x, y, pixel) in picture.enumerate_pixels() {
        let [r, g, b, a] = pixel.0;
        assert_eq!(shown[y as usize][x as usize], (a >= 128).then_some([r, g, b]), "({x}, {y})");
    }
    // A larger picture is scaled to the terminal: 20 lines minus two, of two rows each.
    let large =
        ["render", &cornell(), "--show", "--width", "120", "--height", "120", "--spp", "1", "--quiet"];
    let (code, drawn) = in_terminal(folder.path(), "xterm-256color", &large).expect("as before");
    let shown = pixels(&drawn);
    assert_eq!((code, shown.len(), shown[0].len()), (0, 36, 36), "no file is needed\n{drawn}");
}

#[test]
#[cfg(unix)]
fn graphics_protocols_of_terminals() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let of = |term: &str, show: &str| {
        let words = [&["render", &scene, show], &SMALL[..]].concat();
        in_terminal(folder.path(), term, &words)
    };
    let Some((code, kitty)) = of("xterm-kitty", "--show") else { return };
    assert!(code == 0 && kitty.contains("\x1b_Gf=100,a=T,q=2,c=40,r=16,m="), "{kitty}");
    let sixel = of("foot", "--show").expect("as before").1;
    assert!(sixel.contains("\x1bP0;1q\"1;1;40;32#0;2;0;0;0") && sixel.contains("\x1b\\"), "{sixel}");
    let chosen = of("dumb", "--show=sixel").expect("as before");
    assert!(chosen.0 == 0 && chosen.1.contains("\x1bP0;1q"), "{}", chosen.1);
    let (code, refused) = of("dumb", "--show").expect("as before");
    assert!(code == 2 && refused.contains("--show=blocks"), "{refused}");
}

#[test]
fn non_terminals_are_refused_before_rendering() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |more: &[&str], why: &str| {
        says(&run(folder.path(), &[&["render", &cornell(), "-o", "a.png", "--show"], more].concat(), 2), why);
        assert!(!folder.path().join("a.png").exists());
    };
    refused(&[], "--show needs a terminal");
    refused(&["--json"], "--json");
}

#[test]
#[cfg(unix)]
fn crops_are_not_shown() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let words = [&["render", &scene, "--show", "--sample-range", "0..8"], &SMALL[..]].concat();
    let Some((code, messages)) = in_terminal(folder.path(), "xterm-256color", &words) else { return };
    assert_eq!(code, 2, "{messages}");
    assert!(messages.contains("-o NAME.part"), "{messages}");
}
