//! Arguments about renders that take long: when they stop, how they survive, how they are divided.

use super::progress::ProgressArg;
use clap::Args;
use oscura::output::part::Region;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Long renders")]
pub(crate) struct LongArgs {
    /// Stop when the picture's relative error is about P percent, at --max-spp samples at most [default then: 65536].
    #[arg(long, value_name = "P", value_parser = percent, allow_negative_numbers = true)]
    pub noise: Option<f32>,
    /// Fewest samples of a pixel with --noise or --adaptive auto.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub min_spp: Option<u32>,
    /// Most samples of a pixel with --noise (where --spp says the same) or --adaptive auto.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub max_spp: Option<u32>,
    /// Stop after this many seconds of rendering and write what is there.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub time_limit: Option<Duration>,
    /// Also write the picture so far, each time that so many seconds of rendering have passed.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub save_every: Option<Duration>,
    /// Keep in FILE what --resume goes on from: written now and then, at a signal, and at the end.
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Seconds between two writings of the checkpoint.
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "60", requires = "checkpoint")]
    pub checkpoint_interval: Duration,
    /// Go on from the checkpoint, if there is one, to as many samples as before or to more. Of a sequence, leave out those
    /// frames whose pictures exist; a frame that is interrupted is not written.
    #[arg(long)]
    pub resume: bool,
    /// Arrange samples so that a picture of at most 256 a pixel can be gone on from to N later.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub plan: Option<u32>,
    /// Take only the samples A to B, B not included, of all --spp, in blocks of eight, and write a .part file.
    #[arg(long, value_name = "A..B", value_parser = range)]
    pub sample_range: Option<(u32, u32)>,
    /// Take only the pixels from column X0 and row Y0 to before column X1 and row Y1: into a .part file to be merged with
    /// others, or into a picture as --crop does.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = region)]
    pub region: Option<Region>,
    /// How progress is told: plain lines, json or openjd lines on standard output, none [default: a bar on a terminal].
    #[arg(long, value_name = "KIND")]
    pub progress: Option<ProgressArg>,
    /// Refuse pictures and scenes that take more memory, such as 8G or 500M [default: what the machine has].
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub memory_limit: Option<u64>,
    /// Memory for the images of textures, such as 4G or 500M: what is beyond is decoded again when it is needed. The picture doesn't depend
    /// on it [default: a quarter of the machine's].
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub texture_memory: Option<u64>,
}

fn percent(text: &str) -> Result<f32, String> {
    let valid = |v: &f32| *v > 0.0 && *v <= 1000.0;
    text.parse().ok().filter(valid).ok_or_else(|| "must be a number of percent above 0".to_string())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let value: f64 = text.parse().map_err(|_| "not a number of seconds".to_string())?;
    let valid = value > 0.0;
    Duration::try_from_secs_f64(value)
        .ok()
        .filter(|_| valid)
        .ok_or_else(|| "must be a number of seconds above 0".to_string())
}

fn range(text: &str) -> Result<(u32, u32), String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    ends.filter(|(a, b)| a < b).ok_or_else(|| "not a range of samples such as 0..64".to_string())
}

pub(super) fn region(text: &str) -> Result<Region, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => Ok(Region { x0, y0, x1, y1 }),
        _ => {
            Err("not a region such as 0,0,640,360: left, top, right and bottom, the last two not included"
                .into())
        }
    }
}

/// A number of bytes: `500M`, `8G`, `8GiB`.
fn bytes(text: &str) -> Result<u64, String> {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let unit = unit.trim().to_ascii_uppercase();
    let bits = match unit.trim_end_matches('B').trim_end_matches('I') {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => return Err("not a size such as 500M or 8G".into()),
    };
    let value = number.parse::<f64>().ok().map(|n| n * f64::from(bits).exp2());
    let value = value.filter(|v| *v >= 1.0).ok_or("not a size such as 500M or 8G")?;
    Ok(value as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values() {
        assert_eq!((range("0..64"), range("8..9")), (Ok((0, 64)), Ok((8, 9))));
        assert!(["", "4", "4..4", "5..4", "-1..3", "a..b"].iter().all(|text| range(text).is_err()));
        assert_eq!(region("1,2,3,4"), Ok(Region { x0: 1, y0: 2, x1: 3, y1: 4 }));
        assert!(["", "1,2,3", "3,0,3,4", "0,0,-1,1"].iter().all(|text| region(text).is_err()));
        assert_eq!((bytes("500M"), bytes("1.5 GiB"), bytes("7")), (Ok(500 << 20), Ok(3 << 29), Ok(7)));
        assert!(["", "G", "-1G", "5X"].iter().all(|text| bytes(text).is_err()));
    }
}
