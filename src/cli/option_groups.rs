//! Headings of the options in help, and the options that `-h` shows.

use clap::{Arg, ArgAction, Command};

/// Commands whose options are grouped.
const GROUPED: [&str; 4] = ["render", "view", "inspect", "thumb"];

/// Headings and the ids of their options, in the order of help.
pub(super) const GROUPS: [(&str, &[&str]); 13] = [
    (
        "Output",
        &[
            "output",
            "file",
            "force_overwrite",
            "quiet",
            "verbose",
            "show",
            "preview",
            "port",
            "no_open",
            "watch",
            "json",
            "progress",
            "strict",
            "explain",
            "reproducible",
            "owner",
            "dither",
            "deep",
            "float",
            "exr_layout",
            "exr_compression",
            "exr_tiles",
            "exr_half",
            "exr_float",
            "working_space",
        ],
    ),
    (
        "Image",
        &[
            "size",
            "width",
            "height",
            "exposure",
            "view",
            "white_balance",
            "background",
            "transparent",
            "transparent_glass",
            "crop",
            "overscan",
        ],
    ),
    ("Animation", &["frames", "orbit", "fps", "time", "shutter", "shutter_position", "motion_keys"]),
    ("Camera", &["camera", "eye", "target", "fov", "focus", "defocus", "view_height", "view_from", "zoom"]),
    ("Light", &["env", "env_strength", "env_rotation", "stage", "ground", "light_units"]),
    (
        "Model",
        &[
            "up",
            "smooth",
            "subdivide",
            "point_radius",
            "scene_name",
            "node",
            "variant",
            "glass",
            "force",
            "allow_external",
            "no_sidecar",
        ],
    ),
    ("Blender files", &["blender", "view_layer", "bake", "cache", "no_cache"]),
    (
        "Sampling and quality",
        &[
            "quality",
            "spp",
            "noise",
            "max_spp",
            "min_spp",
            "depth",
            "bounces",
            "clamp",
            "filter_glossy",
            "unbiased",
            "seed",
            "animate_seed",
            "caustics",
            "spectral",
        ],
    ),
    ("Passes", &["aov", "light_groups", "aov_space", "crypto_levels"]),
    ("Denoising", &["denoise", "no_denoise", "denoise_alone", "denoiser", "oidn_library"]),
    (
        "Long renders",
        &[
            "time_limit",
            "resume",
            "checkpoint",
            "checkpoint_interval",
            "save_every",
            "plan",
            "sample_range",
            "region",
            "threads",
            "memory_limit",
        ],
    ),
    (
        "Expert",
        &[
            "filter",
            "filter_radius",
            "guiding",
            "light_selection",
            "path_reuse",
            "splitting",
            "microfacet",
            "fresnel",
            "terminator",
            "bvh",
            "texture_memory",
        ],
    ),
    ("Help", &["help"]),
];

/// The options of `render` and `view` that `-h` shows.
const COMMON: [&str; 26] = [
    "output",
    "quiet",
    "verbose",
    "size",
    "exposure",
    "view",
    "background",
    "frames",
    "orbit",
    "camera",
    "eye",
    "target",
    "fov",
    "env",
    "stage",
    "up",
    "quality",
    "spp",
    "noise",
    "aov",
    "time_limit",
    "resume",
    "port",
    "no_open",
    "watch",
    "help",
];

/// The heading of an option, and its position among all options.
fn place(id: &str) -> Option<(&'static str, usize)> {
    let all = GROUPS.iter().flat_map(|(heading, ids)| ids.iter().map(move |id| (*heading, *id)));
    all.enumerate().find(|(_, (_, own))| *own == id).map(|(at, (heading, _))| (heading, at))
}

/// Groups the options of some commands under headings. `-h` of `render` and `view` hides less common options.
pub(super) fn group(command: Command) -> Command {
    if !GROUPED.contains(&command.get_name()) {
        return command;
    }
    let has_many = ["render", "view"].contains(&command.get_name());
    let help = Arg::new("help").short('h').long("help").action(ArgAction::Help);
    let help =
        help.help(if has_many { "Print the common options (-h) or all (--help)" } else { "Print help" });
    let command = command.disable_help_flag(true).arg(help);
    let command = command.mut_args(|arg| {
        let Some((heading, at)) = place(arg.get_id().as_str()) else { return arg };
        let is_common = !has_many || COMMON.contains(&arg.get_id().as_str());
        arg.help_heading(heading).display_order(at).hide_short_help(!is_common)
    });
    if !has_many {
        return command;
    }
    let count = command.get_arguments().filter(|arg| !arg.is_positional() && !arg.is_hide_set()).count();
    let name = command.get_name().to_string();
    command
        .after_help(format!(
            "'oscura {name} --help' explains all {count} options, 'oscura help TOPIC' those of a topic."
        ))
        .after_long_help("")
}

#[cfg(test)]
mod tests {
    use super::super::command_line::Arguments;
    use super::*;

    #[test]
    fn each_option_has_one_heading() {
        let ids: Vec<&str> = GROUPS.iter().flat_map(|(_, ids)| ids.iter().copied()).collect();
        for (at, id) in ids.iter().enumerate() {
            assert!(!ids[..at].contains(id), "{id} is listed twice");
        }
        for command in Arguments::full_command().get_subcommands().filter(|c| GROUPED.contains(&c.get_name()))
        {
            for arg in command.get_arguments().filter(|arg| !arg.is_positional()) {
                assert!(arg.get_help_heading().is_some(), "{} {}", command.get_name(), arg.get_id());
            }
        }
        assert!(COMMON.iter().all(|id| ids.contains(id)));
    }

    #[test]
    fn headings_are_in_order_and_few_options_are_common() {
        for name in ["render", "view"] {
            let mut command = Arguments::full_command();
            let command = command.find_subcommand_mut(name).expect("the command");
            let (short, long) = (command.render_help().to_string(), command.render_long_help().to_string());
            let lines = |text: &str| text.lines().map(str::to_string).collect::<Vec<_>>();
            let options = |text: &str| lines(text).iter().filter(|l| l.trim_start().starts_with('-')).count();
            assert!((15..=24).contains(&options(&short)), "{short}");
            assert!(options(&long) > 2 * options(&short), "{long}");
            let headings: Vec<String> = lines(&long)
                .into_iter()
                .filter_map(|line| line.strip_suffix(':').map(str::to_string))
                .filter(|heading| !heading.starts_with(' ') && heading != "Arguments")
                .collect();
            let known: Vec<&str> = GROUPS.iter().map(|(heading, _)| *heading).collect();
            let places: Vec<_> = headings.iter().map(|h| known.iter().position(|k| k == h)).collect();
            assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{name}: {headings:?}");
        }
    }
}
