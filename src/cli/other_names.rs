//! Names of options in other renderers, for tips about unknown options.

/// Option names of other renderers, without dashes, and tips that name our equivalent.
const NAMES: [(&[&str], &str); 27] = [
    (&["s", "n", "sample", "samples-per-pixel", "num-samples"], "--spp N sets the samples per pixel"),
    (&["t", "j", "thread", "num-threads", "nthreads", "cpus"], "--threads N sets the number of threads"),
    (
        &["W", "H", "w", "x", "y", "r", "res", "resx", "resy", "dimensions"],
        "--size WxH sets the size, such as --size 1920x1080",
    ),
    (&["scale", "percent", "resolution-percentage"], "--size WxH sets the size in pixels"),
    (
        &["f", "frame", "a", "anim", "animation", "render-frame", "render-anim"],
        "--frames A-B renders frames, --frames N one of them",
    ),
    (
        &["F", "format", "render-format", "file-format"],
        "the extension of -o FILE sets the format, such as -o room.exr",
    ),
    (&["out", "outfile", "output-file", "render-output"], "-o FILE sets the output file"),
    (&["outdir", "output-dir", "output-folder", "dir"], "-o FOLDER/FILE sets the output folder and file"),
    (
        &["hdri", "hdr", "envmap", "environment", "environment-map", "ibl", "skybox", "world"],
        "--env FILE sets the environment map",
    ),
    (&["passes", "pass", "aovs", "layers", "render-passes"], "--aov LIST adds passes ('oscura help passes')"),
    (&["cryptomatte", "crypto"], "--aov crypto_object,crypto_material,crypto_asset adds Cryptomatte"),
    (
        &["max-bounces", "max-depth", "ray-depth", "maxdepth", "path-depth"],
        "--depth N sets the maximum number of bounces, --bounces the limits by type",
    ),
    (
        &["tonemap", "tone-map", "tonemapping", "tone-mapping", "view-transform", "look", "ocio"],
        "--view NAME sets the view transform, such as --view agx",
    ),
    (&["gamma"], "--view gamma is the power 1 / 2.2"),
    (
        &["alpha", "film-transparent", "transparent-background", "no-background"],
        "--transparent makes the background transparent",
    ),
    (
        &["gpu", "cuda", "optix", "metal", "device", "cycles-device", "engine", "E"],
        "oscura renders on the CPU ('oscura help gpu')",
    ),
    (
        &["adaptive", "adaptive-threshold", "noise-threshold", "error", "noise-level"],
        "--noise P stops at an estimated noise of P percent",
    ),
    (&["timeout", "max-time", "render-time"], "--time-limit S stops after S seconds"),
    (&["log-level", "loglevel", "debug", "log", "V"], "-v prints details, -q errors only"),
    (
        &["fireflies", "firefly", "clamping", "clamp-indirect", "clamp-direct"],
        "--clamp indirect=10 removes fireflies, and darkens the picture",
    ),
    (&["turntable", "spin"], "--orbit N renders a turntable of N frames"),
    (
        &["dof", "aperture", "f-stop", "fstop", "lens-radius"],
        "--defocus and --focus set depth of field ('oscura help camera')",
    ),
    (
        &["from", "camera-position", "position", "origin", "lookfrom", "look-from"],
        "--eye X,Y,Z sets the camera position, --view-from NAME the view of a model without a camera",
    ),
    (&["lookat", "look-at", "at", "to"], "--target X,Y,Z sets the look-at point"),
    (
        &["tile", "tiles", "bucket", "rect", "cropwindow", "crop-window", "window"],
        "--crop X0,Y0,X1,Y1 renders only a rectangle of pixels",
    ),
    (
        &["part", "parts", "shard", "shards", "chunk", "split", "slice"],
        "--sample-range A..B renders a share of the samples, for 'oscura merge' ('oscura help farm')",
    ),
    (
        &["ui", "gui", "interactive", "live", "viewer"],
        "'oscura view SCENE' shows a scene live in the browser",
    ),
];

/// The tip for an option name of another renderer, without dashes.
pub(super) fn tip_for(name: &str) -> Option<&'static str> {
    let name = name.replace('_', "-");
    NAMES.iter().find(|(names, _)| names.contains(&&*name)).map(|(_, tip)| *tip)
}

#[cfg(test)]
mod tests {
    use super::super::command_line::Arguments;
    use super::*;

    #[test]
    fn tips_name_existing_options_for_names_that_are_not_options() {
        let command = Arguments::full_command();
        let render = command.find_subcommand("render").expect("a command");
        let has = |word: &str| {
            let mut arguments = render.get_arguments();
            arguments.any(|arg| {
                let longs = arg.get_long_and_visible_aliases().unwrap_or_default();
                longs.contains(&word) || word.len() == 1 && arg.get_short() == word.chars().next()
            })
        };
        for (names, tip) in NAMES {
            for name in names {
                assert!(!has(name), "{name}");
            }
            for word in
                tip.split(|c: char| !c.is_alphanumeric() && c != '-').filter(|word| word.starts_with('-'))
            {
                assert!(has(word.trim_start_matches('-')), "{word}");
            }
        }
    }
}
