//! Render farms: the templates in `tools/farm` run in the installed schedulers, and match single runs.

use crate::program::*;
use crate::skip::skip;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const OSCURA: &str = env!("CARGO_BIN_EXE_oscura");

/// The folder with the templates; absent in the package on crates.io.
fn farm() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/farm");
    if !folder.exists() {
        skip("tools", "the package is without tools");
    }
    Some(folder).filter(|folder| folder.exists())
}

/// Runs a program that may not be installed.
fn output_of(command: &mut Command, what: &str) -> Option<Output> {
    let output = command.output();
    if output.is_err() {
        skip(what, &format!("there is no {what} in the PATH"));
    }
    output.ok()
}

fn reed() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/reed.gltf").display().to_string()
}

#[test]
fn open_job_description_matches_single_runs() {
    let Some(farm) = farm() else { return };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = reed();
    let options = ["--width", "32", "--float", "--reproducible", "--aov", "depth,crypto_object"];
    let parameters = [
        format!("Oscura={OSCURA}"),
        format!("Scene={scene}"),
        format!("Output={}", folder.display()),
        "Frames=1-2".to_string(),
        "Samples=20".to_string(),
        "Shards=3".to_string(),
        "LastShard=2".to_string(),
        format!("Options={}", options.join(" ")),
    ];
    let mut command = Command::new("openjd");
    command.arg("run").arg(farm.join("openjd.yaml")).args(["--step", "Merge", "--run-dependencies"]);
    for parameter in &parameters {
        command.args(["-p", parameter]);
    }
    let Some(output) = output_of(&mut command, "openjd (pip install openjd-cli)") else { return };
    assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
    assert!(stdout(&output).contains("openjd_progress: 100.00"), "{}", stdout(&output));
    assert_eq!(names(folder), ["picture.0001.exr", "picture.0002.exr"]);
    for frame in ["1", "2"] {
        let fixed = ["render", &scene, "-o", "s.exr", "--frames", frame, "--spp", "20"];
        run(folder, &[&fixed[..], &options[..]].concat(), 0);
        let bytes = |name: &str| fs::read(folder.join(format!("{name}.000{frame}.exr"))).expect("a picture");
        assert!(bytes("s") == bytes("picture"), "frame {frame}");
    }
}

#[test]
fn slurm_matches_single_runs() {
    let Some(farm) = farm() else { return };
    let script = farm.join("try_slurm.sh");
    let Some(output) =
        output_of(Command::new("bash").arg(script).args([OSCURA, &reed(), "1-1", "2", "16"]), "bash")
    else {
        return;
    };
    print!("{}", stdout(&output));
    assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
}

/// The tasks that Flamenco would compile from the job type: nothing is rendered here.
#[test]
fn flamenco_tasks_cover_all_samples() {
    let Some(farm) = farm() else { return };
    let script = r#"
        const source = require('fs').readFileSync(process.argv[1], 'utf8');
        const author = {
            Task: (name) => ({ name, commands: [], needs: [],
                addCommand(c) { this.commands.push(c); }, addDependency(t) { this.needs.push(t.name); } }),
            Command: (name, parameters) => ({ name, ...parameters }),
        };
        const frameChunker = (frames) => frames.split(',');
        const tasks = [];
        const job = { settings: { oscura: 'oscura', scene: 's.glb', output: '/out', name: 'p', frames: '7,8', samples: 20,
            shards: 4, options: '--float' }, addTask: (task) => tasks.push(task) };
        new Function('author', 'frameChunker', 'job', source + '; compileJob(job);')(author, frameChunker, job);
        console.log(JSON.stringify(tasks));
    "#;
    let file = farm.join("flamenco-oscura.js");
    let Some(output) = output_of(Command::new("node").args(["-e", script]).arg(file), "node") else { return };
    assert!(output.status.success(), "{}", stderr(&output));
    let tasks: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let tasks = tasks.as_array().expect("a list");
    let words = |task: &serde_json::Value| -> Vec<String> {
        let words = task["commands"][0]["args"].as_array().expect("words");
        words.iter().map(|word| word.as_str().expect("a word").to_string()).collect()
    };
    let ranges: Vec<String> = tasks.iter().take(3).map(|task| words(task)[9].clone()).collect();
    assert_eq!(ranges, ["0..8", "8..16", "16..20"]);
    let merge = words(&tasks[3]);
    assert_eq!(merge[..2], ["merge", "/out/p.0007.0.part"]);
    assert_eq!(merge[4..], ["-o", "/out/p.0007.exr"]);
    assert_eq!(tasks[3]["needs"].as_array().map(Vec::len), Some(3));
    assert_eq!(tasks.len(), 8);
}
