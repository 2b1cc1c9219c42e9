//! EXRs of several parts, and laid out as Blender's are, in the commands that read pictures; and how EXRs lie where parts of
//! pictures are merged.

use crate::program::*;
use exr::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// All channels of all parts, without the name of the render layer.
fn all_planes(path: &Path) -> BTreeMap<String, Vec<f32>> {
    let file = read_all_flat_layers_from_file(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let channels = file.layer_data.iter().flat_map(|layer| &layer.channel_data.list);
    let plain = |name: String| {
        let below = name.trim_start_matches("ViewLayer.").trim_start_matches("Combined.");
        if below == "Depth.Z" { "Z".to_string() } else { below.to_string() }
    };
    channels.map(|c| (plain(c.name.to_string()), c.sample_data.values_as_f32().collect())).collect()
}

fn run(folder: &Path, line: &str) -> String {
    let args: Vec<&str> = line.split_whitespace().collect();
    let output = oscura(folder, &args);
    assert_eq!(code(&output), 0, "{line}: {}", stderr(&output));
    stderr(&output)
}

#[test]
fn all_layouts_are_denoised_and_converted_alike() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let mut found = Vec::new();
    for layout in ["single", "multipart", "layers"] {
        let aovs = "albedo,normal,depth,variance,diffuse_direct";
        run(
            folder.path(),
            &format!(
                "render {scene} -o {layout}.exr --exr-layout {layout} --width 48 --spp 4 --float --quiet --aov {aovs}"
            ),
        );
        let said = run(folder.path(), &format!("denoise {layout}.exr -o clean-{layout}.exr"));
        assert!(said.contains("albedo, normal, depth; noise from the variance"), "{layout}: {said}");
        let (noisy, clean) = (format!("{layout}.exr"), format!("clean-{layout}.exr"));
        let (noisy, clean) = (all_planes(&folder.path().join(noisy)), all_planes(&folder.path().join(clean)));
        assert!(noisy["G"] != clean["G"] && noisy["DiffDir.G"] != clean["DiffDir.G"], "{layout}");
        run(folder.path(), &format!("convert {layout}.exr -o {layout}.png --layer DiffDir"));
        let picture = std::fs::read(folder.path().join(format!("{layout}.png"))).expect("a picture");
        found.push((clean, picture));
    }
    assert_eq!(found[0], found[1]);
    assert_eq!(found[0], found[2]);
}

#[test]
fn merging_chooses_how_exrs_lie() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let small = "--width 16 --spp 2 --quiet --aov normal";
    let refused = oscura(
        folder.path(),
        &format!("render {scene} -o a.part {small} --exr-layout multipart")
            .split_whitespace()
            .collect::<Vec<_>>(),
    );
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("oscura merge"), "{}", stderr(&refused));
    run(folder.path(), &format!("render {scene} -o a.part {small}"));
    run(folder.path(), "merge a.part -o a.exr --exr-layout multipart --exr-compression piz");
    let file = read_all_flat_layers_from_file(folder.path().join("a.exr")).expect("an EXR");
    assert_eq!(file.layer_data.len(), 2);
    assert!(file.layer_data.iter().all(|layer| layer.encoding.compression == Compression::PIZ));
}

#[test]
fn types_that_mean_nothing_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let small = "--width 16 --spp 2";
    let line = format!("render {scene} -o a.exr {small} --aov crypto_object --exr-half CryptoObject00");
    let refused = oscura(folder.path(), &line.split_whitespace().collect::<Vec<_>>());
    assert_eq!(code(&refused), 2, "{}", stderr(&refused));
    let said = run(folder.path(), &format!("render {scene} -o a.exr {small} --exr-half Foo"));
    assert!(said.contains("'Foo'"), "{said}");
}
