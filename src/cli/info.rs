//! `oscura info`: the contents of an EXR file.

use super::json;
use super::picture_args::InfoArgs;
use super::process::Outcome;
use super::report::print_line;
use oscura::error::Result;
use oscura::load::image::{Layered, load_layered};
use serde::Serialize;
use std::collections::BTreeMap;

pub(crate) fn run(args: &InfoArgs) -> Result<Outcome> {
    let file = load_layered(&args.picture)?;
    let parts: Vec<Part> = (0..file.len()).map(|part| Part::of(&file, part)).collect();
    match args.json {
        true => json::print(&Report { file: args.picture.display().to_string(), parts }),
        false => parts.iter().enumerate().for_each(|(number, part)| part.print(number, file.len())),
    }
    Ok(Outcome::Done)
}

#[derive(Serialize)]
struct Report {
    file: String,
    parts: Vec<Part>,
}

/// A part of the file.
#[derive(Serialize)]
struct Part {
    name: Option<String>,
    width: usize,
    height: usize,
    compression: String,
    channels: Vec<Channel>,
    header: BTreeMap<String, String>,
}

/// A channel; minimum, maximum and mean of the finite values, null if there are none.
#[derive(Serialize)]
struct Channel {
    name: String,
    #[serde(rename = "type")]
    kind: &'static str,
    min: f64,
    max: f64,
    mean: f64,
    nan: usize,
    infinite: usize,
}

impl Part {
    fn of(file: &Layered, part: usize) -> Part {
        let [width, height] = file.size(part);
        let channel = |info: oscura::load::image::ChannelInfo| {
            let values = file.values(part, &info.name).unwrap_or_default();
            Channel::of(info.name, info.kind, &values)
        };
        Part {
            name: file.name(part),
            width,
            height,
            compression: file.compression(part),
            channels: file.channels(part).into_iter().map(channel).collect(),
            header: file.attributes(part).into_iter().collect(),
        }
    }

    fn print(&self, number: usize, of: usize) {
        let name = self.name.as_ref().map(|name| format!(" '{name}'")).unwrap_or_default();
        let part = if of > 1 { format!("part {}{name}: ", number + 1) } else { String::new() };
        print_line(&format!("{part}{} x {}, {}", self.width, self.height, self.compression));
        print_line(&format!("{:<26} {:5} {:>13} {:>13} {:>13}", "channel", "type", "min", "max", "mean"));
        for c in &self.channels {
            let count = |n: usize, what: &str| if n > 0 { format!("  {n} {what}") } else { String::new() };
            print_line(&format!(
                "{:<26} {:5} {:>13} {:>13} {:>13}{}{}",
                c.name,
                c.kind,
                short(c.min),
                short(c.max),
                short(c.mean),
                count(c.nan, "NaN"),
                count(c.infinite, "infinite")
            ));
        }
        for (name, value) in &self.header {
            print_line(&format!("{name}: {value}"));
        }
    }
}

/// A number in six significant digits or fewer, with an exponent for very small and large ones.
fn short(value: f64) -> String {
    match value.abs() {
        _ if value.is_nan() => "-".to_string(),
        0.0 => "0".to_string(),
        size if (1e-3..1e6).contains(&size) => format!("{value:.5}"),
        _ => format!("{value:.4e}"),
    }
}

impl Channel {
    fn of(name: String, kind: &'static str, values: &[f32]) -> Channel {
        let finite = || values.iter().filter(|v| v.is_finite()).map(|&v| f64::from(v));
        let nan = values.iter().filter(|v| v.is_nan()).count();
        Channel {
            name,
            kind,
            min: finite().fold(f64::NAN, f64::min),
            max: finite().fold(f64::NAN, f64::max),
            mean: finite().sum::<f64>() / finite().count() as f64,
            nan,
            infinite: values.len() - nan - finite().count(),
        }
    }
}
