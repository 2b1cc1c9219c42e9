//! Options that change nothing in a run, each with why: nobody should look for an effect that can't come.

use super::args::{CRYPTO_LEVELS, FRAME_RATE, RenderArgs};
use super::moving::is_moving;
use super::prepared::Prepared;
use oscura::error::Warning;
use oscura::film::{Aov, AovSet, AovSpace};
use oscura::output::Format;
use oscura::scene::{Motion, Scene};
use std::path::Path;

/// What a run makes.
struct Made {
    /// EXRs, or parts that may become some.
    exr: bool,
    /// Pictures that are shaped for looking at, also on a page, in the terminal, or of parts.
    shown: bool,
    /// The same, or Radiance HDR.
    exposed: bool,
    /// Pictures that may have 16 bits a channel.
    deep: bool,
    /// GIF, APNG or video.
    moving: bool,
}

impl Made {
    fn of(args: &RenderArgs) -> Made {
        let is = |wanted: &[Format]| {
            let fits = |path: &&std::path::PathBuf| Format::of(path).is_ok_and(|f| wanted.contains(&f));
            args.output.iter().any(|path| fits(&path))
        };
        let is_part = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("part"));
        let part = args.output.iter().any(|path| is_part(path));
        let moving = args.output.iter().any(|path| is_moving(path));
        let live = args.show.is_some() || args.preview.is_some();
        let pictures = is(&[Format::Png, Format::Jpeg, Format::Tiff, Format::WebP]);
        let shown = pictures || moving || live || part;
        Made {
            exr: part || is(&[Format::Exr]),
            shown,
            exposed: shown || is(&[Format::Hdr]),
            deep: part || is(&[Format::Png, Format::Tiff]),
            moving,
        }
    }
}

const NO_EXR: &str = "no output is an EXR";
const NOT_SHOWN: &str = "no output is a picture for looking at, such as a PNG";

/// Warnings of all options that are given and change nothing.
pub(super) fn warnings(args: &RenderArgs, scene: &Scene, prepared: &Prepared) -> Vec<Warning> {
    let made = Made::of(args);
    let aovs = prepared.kept_aovs;
    let given = args.aov.iter().fold(AovSet::NONE, |all, aovs| all.union(*aovs));
    let aovs = given.union(aovs);
    let has_mattes = aovs.mattes().next().is_some();
    let placed = [Aov::Position, Aov::Normal, Aov::GeometricNormal];
    let has_placed = placed.into_iter().any(|aov| aovs.contains(aov));
    let is_space_chosen = args.aov_space != AovSpace::default();
    let has_groups = scene.light_groups().len() > 1;
    let moves = scene.instances.iter().any(|i| !matches!(i.motion, Motion::Still))
        || scene.cameras.iter().any(|camera| camera.motion.is_some())
        || args.shutter.shutter.is_some();
    let timed = args.frames.is_some() || args.orbit.is_some() && made.moving || moves;
    // Each option: is it given, does it change anything, and why not.
    let options = [
        ("--aov", !args.aov.is_empty(), made.exr, NO_EXR),
        ("--light-groups", args.light_groups, made.exr, NO_EXR),
        (
            "--light-groups",
            args.light_groups && made.exr,
            has_groups,
            "the scene has no groups of lights to keep apart",
        ),
        ("--float", args.float, made.exr, NO_EXR),
        ("--owner", args.owner.is_some(), made.exr, NO_EXR),
        ("what --exr-... and --working-space say", args.exr.format.is_given(), made.exr, NO_EXR),
        ("--crypto-levels", args.crypto_levels != CRYPTO_LEVELS, has_mattes, "--aov has no Cryptomatte"),
        ("--aov-space", is_space_chosen, has_placed, "--aov has no position, normal or geometric_normal"),
        ("--view", args.view.is_some(), made.shown, NOT_SHOWN),
        ("--exposure", args.exposure.is_some(), made.exposed, NOT_SHOWN),
        ("--white-balance", args.picture.white_balance.is_some(), made.exposed, NOT_SHOWN),
        ("--dither", args.dither, made.shown, NOT_SHOWN),
        ("--deep", args.picture.deep, made.deep, "no output is a PNG or TIFF"),
        (
            "--fps",
            args.fps != FRAME_RATE,
            timed,
            "there is no sequence, no moving picture and no open shutter",
        ),
    ];
    let idle = options.into_iter().filter(|(_, is_given, works, _)| *is_given && !works);
    idle.map(|(option, _, _, why)| Warning::general(format!("{option} has no effect: {why}"))).collect()
}
