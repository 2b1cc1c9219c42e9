//! `oscura compare`: error metrics against a reference, and a statistical test of differences against noise.

use super::args::CompareArgs;
use super::json;
use super::process::Outcome;
use super::report::print_line;
use oscura::error::{Error, Result};
use oscura::image::Image;
use oscura::load::image::load_linear_rgb;
use oscura::metrics::{
    BLOCK, ChannelTest, Errors, ZTest, difference_picture, errors, flip, non_finite_pixels, side_by_side,
    z_test,
};
use oscura::output::{Format, check_target, encode_rgb8, write_atomically};
use serde::Serialize;
use std::path::Path;

pub(crate) fn run(args: &CompareArgs) -> Result<Outcome> {
    for path in args.output.iter().chain(&args.side_by_side) {
        if Format::of(path)? != Format::Png {
            return Err(Error::usage(format!("{}: must be a .png file", path.display())));
        }
        check_target(path)?;
    }
    let reference = read(&args.reference, None)?;
    let picture = read(&args.picture, Some(&reference))?;
    let measured = errors(&picture, &reference);
    let test = match (&args.other_seed, &args.var) {
        (Some(other), Some(variance)) => {
            let other = read(other, Some(&reference))?;
            let variance = read(variance, Some(&reference))?;
            let test = z_test(&picture, &other, &reference, &variance);
            Some(test.ok_or_else(|| {
                let (w, h) = (picture.width, picture.height);
                Error::input(&args.picture, format!("{w} x {h} pixels are too few for a statistical test"))
                    .with_help(format!("it needs at least {BLOCK} x {BLOCK} pixels; leave out --other-seed"))
            })?)
        }
        _ => None,
    };
    let flip_map = flip(&picture, &reference);
    if let Some(path) = &args.output {
        write_png(path, &difference_picture(&picture, &reference), picture.width, picture.height)?;
    }
    if let Some(path) = &args.side_by_side {
        write_png(path, &side_by_side(&picture, &reference, &flip_map), 3 * picture.width, picture.height)?;
    }
    if args.json {
        json::print(&Report::new(&measured, flip_map.mean, test.as_ref()));
    } else {
        print(&measured, flip_map.mean, test.as_ref());
    }
    Ok(if test.is_none_or(|t| t.agrees()) { Outcome::Done } else { Outcome::Disagreement })
}

fn write_png(path: &Path, pixels: &[u8], width: u32, height: u32) -> Result<()> {
    let png =
        encode_rgb8(pixels, width, height, Format::Png).map_err(|message| Error::output(path, message))?;
    write_atomically(path, &png)
}

/// Reads a picture and checks that it is finite and has the size of the reference.
fn read(path: &Path, reference: Option<&Image>) -> Result<Image> {
    let image = load_linear_rgb(path)?;
    let invalid = non_finite_pixels(&image);
    if invalid > 0 {
        return Err(Error::input(path, format!("{invalid} pixels are NaN or infinite")));
    }
    if let Some(r) = reference
        && (r.width, r.height) != (image.width, image.height)
    {
        let sizes =
            format!("{} x {} pixels, the reference {} x {}", image.width, image.height, r.width, r.height);
        return Err(Error::input(path, format!("has {sizes}")).with_help("compare pictures of the same size"));
    }
    Ok(image)
}

fn print(measured: &Errors, flip: f64, test: Option<&ZTest>) {
    let [r, g, b] = measured.mean_ratio();
    print_line(&format!("RMSE {:.6}", measured.rmse));
    print_line(&format!("relMSE {:.6}", measured.rel_mse));
    print_line(&format!("FLIP {flip:.6}"));
    print_line(&format!("mean ratio R {r:.5} G {g:.5} B {b:.5}"));
    let Some(test) = test else { return };
    for (name, c) in ["R", "G", "B"].iter().zip(&test.channels) {
        print_line(&format!(
            "{name}: mean {:.6} ref {:.6} ratio {:.5} +- {:.5} ({:+.1} sigma)",
            c.mean,
            c.reference,
            c.mean / c.reference,
            c.sigma / c.reference,
            c.z()
        ));
    }
    print_line(&format!(
        "blocks beyond 3 sigma: {:.2} %  beyond 5: {:.2} %",
        100.0 * test.beyond_3_sigma,
        100.0 * test.beyond_5_sigma
    ));
    print_line(if test.agrees() { "the pictures agree" } else { "the pictures disagree" });
}

/// Output of `--json`.
#[derive(Serialize)]
struct Report {
    rmse: f64,
    rel_mse: f64,
    flip: f64,
    mean: [f64; 3],
    reference_mean: [f64; 3],
    mean_ratio: [f64; 3],
    z_test: Option<Verdict>,
}

/// The z-test; lists are per channel.
#[derive(Serialize)]
struct Verdict {
    agrees: bool,
    mean: [f64; 3],
    reference_mean: [f64; 3],
    sigma: [f64; 3],
    z: [f64; 3],
    beyond_3_sigma: f64,
    beyond_5_sigma: f64,
}

impl Report {
    fn new(measured: &Errors, flip: f64, test: Option<&ZTest>) -> Report {
        let verdict = |test: &ZTest| {
            let each = |f: fn(&ChannelTest) -> f64| test.channels.map(|c| f(&c));
            Verdict {
                agrees: test.agrees(),
                mean: each(|c| c.mean),
                reference_mean: each(|c| c.reference),
                sigma: each(|c| c.sigma),
                z: each(|c| c.z()),
                beyond_3_sigma: test.beyond_3_sigma,
                beyond_5_sigma: test.beyond_5_sigma,
            }
        };
        Report {
            rmse: measured.rmse,
            rel_mse: measured.rel_mse,
            flip,
            mean: measured.mean,
            reference_mean: measured.reference_mean,
            mean_ratio: measured.mean_ratio(),
            z_test: test.map(verdict),
        }
    }
}
