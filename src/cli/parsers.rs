//! Parsers of command-line values.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, ValueEnum};
use oscura::error::Error;
use oscura::film::{Aov, AovInfo, AovSet, PixelType};
use oscura::load::file_names_in;
use oscura::output::part::Region;
use oscura::render::ALL_AOVS;
use oscura::scene::{BounceLimits, Clamp};
use std::borrow::Cow;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Parses a number for which `is_valid` holds; `expected` describes valid numbers in the error message.
pub(super) fn number(text: &str, is_valid: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    let point = if text.contains(',') { ", with a decimal point" } else { "" };
    text.parse().ok().filter(|&v| is_valid(v)).ok_or_else(|| format!("must be {expected}{point}"))
}

/// Parses an integer from `min` to `max`.
pub(super) fn integer<T: TryFrom<u32>>(
    min: u32,
    max: u32,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text| {
        let value = text.parse::<u32>().ok().filter(|v| (min..=max).contains(v));
        value.and_then(|v| T::try_from(v).ok()).ok_or_else(|| match max {
            u32::MAX => format!("must be a whole number, {min} or more"),
            _ => format!("must be a whole number from {min} to {max}"),
        })
    }
}

/// Exposure, stops; the range is that of scene files.
pub(super) fn stops(text: &str) -> Result<f32, String> {
    number(text, |v| (-100.0..=100.0).contains(&v), "a number from -100 to 100").map(|v| v as f32)
}

/// A rectangle of pixels, `X0,Y0,X1,Y1`.
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

/// Parses `name=value,name=value`; each name may occur once.
fn limits(text: &str, names: &'static [&'static str]) -> Result<HashMap<&'static str, f64>, String> {
    let mut found = HashMap::new();
    for entry in text.split(',') {
        let (name, value) = entry
            .split_once('=')
            .ok_or_else(|| format!("'{entry}' is not a limit such as {}=5", names.join("=5,")))?;
        let known = names.iter().find(|known| **known == name.trim());
        let known = known.ok_or_else(|| format!("'{name}' is not one of {}", names.join(", ")))?;
        let value = number(value.trim(), |v| v > 0.0, "a number above 0")?;
        if found.insert(*known, value).is_some() {
            return Err(format!("'{name}' is given twice"));
        }
    }
    Ok(found)
}

/// Maximum numbers of bounces by type.
pub(super) fn bounce_limits(text: &str) -> Result<BounceLimits, String> {
    let found = limits(text, BounceLimits::NAMES)?;
    if let Some(value) = found.values().find(|v| v.fract() != 0.0 || **v > f64::from(u32::MAX)) {
        return Err(format!("{value} is not a number of bounces"));
    }
    Ok(BounceLimits::by_name(|name| found.get(name).map(|limit| *limit as u32)))
}

/// Maximum contribution of a path.
pub(super) fn clamp(text: &str) -> Result<Clamp, String> {
    let found = limits(text, Clamp::NAMES)?;
    Ok(Clamp::by_name(|name| found.get(name).map(|limit| *limit as f32)))
}

/// One of `all` by name; `about` is the help of a value, or empty.
pub(super) fn named<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
    about: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let value = move |&one: &T| match about(one) {
        "" => PossibleValue::new(name(one)),
        about => PossibleValue::new(name(one)).help(about),
    };
    let parser = PossibleValuesParser::new(all.iter().map(value));
    parser.try_map(move |text| all.iter().copied().find(|&one| name(one) == text).ok_or("unknown name"))
}

/// Default address of tev.
const TEV: &str = "127.0.0.1:14158";

/// Values of `--preview`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PreviewArg {
    /// A page, opened in the browser.
    Page,
    /// A page; only its address is printed.
    Address,
    /// The viewer tev at an address, HOST:PORT.
    Tev(String),
}

impl FromStr for PreviewArg {
    type Err = String;

    fn from_str(text: &str) -> Result<PreviewArg, String> {
        match text {
            "page" => Ok(PreviewArg::Page),
            "address" => Ok(PreviewArg::Address),
            "tev" => Ok(PreviewArg::Tev(TEV.to_string())),
            _ => match text.strip_prefix("tev:") {
                Some(address) if address.contains(':') => Ok(PreviewArg::Tev(address.to_string())),
                _ => Err("must be page, address, tev, or tev:HOST:PORT".to_string()),
            },
        }
    }
}

/// Values of `--show`: graphics protocols of terminals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShowArg {
    /// Detected from environment variables.
    Auto,
    /// Block characters of two pixels each.
    Blocks,
    /// The kitty graphics protocol.
    Kitty,
    /// Sixel graphics.
    Sixel,
}

/// Maximum number of frames of a range; more are probably a mistake.
const MAX: u64 = 1 << 20;

/// Maximum number of digits of a frame number.
const MAX_DIGITS: usize = 20;

/// Default frame rate, frames per second.
pub(crate) const FRAME_RATE: f64 = 24.0;

/// A frame rate.
pub(super) fn frames_per_second(text: &str) -> Result<f64, String> {
    number(text, |f| f.is_finite() && f > 0.0, "a number above 0")
}

/// A range of frames: first, last (included) and step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Frames {
    first: u32,
    last: u32,
    step: u32,
}

impl FromStr for Frames {
    type Err = String;

    /// `7`, `1-10` or `1-10x2`.
    fn from_str(text: &str) -> Result<Frames, String> {
        let wrong = || "not a range of frames such as 7, 1-10 or 1-10x2".to_string();
        let number = |text: &str| text.parse::<u32>().map_err(|_| wrong());
        let (range, step) = match text.split_once('x') {
            Some((range, step)) => (range, number(step)?),
            None => (text, 1),
        };
        let (first, last) = match range.split_once('-') {
            Some((first, last)) => (number(first)?, number(last)?),
            None => (number(range)?, number(range)?),
        };
        if step == 0 || last < first {
            return Err("the last frame comes before the first, or the step is 0".to_string());
        }
        if u64::from(last - first) / u64::from(step) >= MAX {
            return Err(format!("more than {MAX} frames"));
        }
        Ok(Frames { first, last, step })
    }
}

impl Frames {
    /// The frame numbers.
    pub(crate) fn numbers(self) -> impl Iterator<Item = u32> {
        (self.first..=self.last).step_by(self.step as usize)
    }

    /// Whether there are several frames, with step 1.
    pub(crate) fn are_consecutive(self) -> bool {
        self.step == 1 && self.last > self.first
    }

    /// The file of a frame: `####`, `%04d` or `$F4` in the name is replaced by the number with at least four digits; without a
    /// pattern, `.####` is inserted before the extension.
    pub(crate) fn file(path: &Path, number: u32) -> PathBuf {
        let (head, width, tail) = Frames::parts_of_name(path);
        path.with_file_name(format!("{head}{number:0width$}{tail}"))
    }

    /// Whether a file name has a pattern such as `####`.
    pub(crate) fn is_pattern(path: &Path) -> bool {
        with_hashes(&path.file_name().unwrap_or_default().to_string_lossy()).contains('#')
    }

    /// Whether a frame is in the range.
    pub(crate) fn contains(self, number: u32) -> bool {
        (self.first..=self.last).contains(&number) && (number - self.first).is_multiple_of(self.step)
    }

    /// The numbers of the frames with existing files, sorted.
    ///
    /// # Errors
    /// A folder that can't be read, or no frames.
    pub(crate) fn existing(path: &Path) -> Result<Vec<u32>, Error> {
        let (head, _, tail) = Frames::parts_of_name(path);
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut numbers = Vec::new();
        for name in file_names_in(folder)? {
            let digits = name.strip_prefix(&head).and_then(|rest| rest.strip_suffix(&tail));
            let number = digits.and_then(|digits| digits.parse().ok());
            numbers
                .extend(number.filter(|&n| Frames::file(path, n).file_name().is_some_and(|of| *of == *name)));
        }
        numbers.sort_unstable();
        if numbers.is_empty() { Err(Frames::missing(path)) } else { Ok(numbers) }
    }

    /// The error for missing frames.
    pub(crate) fn missing(path: &Path) -> Error {
        Error::input(path, "there are no such frames")
    }

    /// Splits a file name: prefix, minimum number of digits, suffix.
    fn parts_of_name(path: &Path) -> (String, usize, String) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = with_hashes(&name);
        let pattern = match name.contains('#') {
            true => name.to_string(),
            false => {
                let (stem, extension) = name.rsplit_once('.').unwrap_or((&name, ""));
                format!("{stem}.####.{extension}")
            }
        };
        let start = pattern.find('#').unwrap_or(0);
        let width = pattern[start..].chars().take_while(|c| *c == '#').count();
        (pattern[..start].to_string(), width, pattern[start + width..].to_string())
    }
}

/// Replaces the first `%d`, `%4d`, `%04d`, `$F` or `$F4` of a name by `#` for each digit.
fn with_hashes(name: &str) -> Cow<'_, str> {
    for (begin, end) in [("%", "d"), ("$F", "")] {
        for (at, _) in name.match_indices(begin) {
            let rest = &name[at + begin.len()..];
            let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            let width = if digits == 0 { Some(1) } else { rest[..digits].parse().ok() };
            if let (Some(tail), Some(width @ 1..=MAX_DIGITS)) = (rest[digits..].strip_prefix(end), width) {
                return Cow::Owned(format!("{}{}{tail}", &name[..at], "#".repeat(width)));
            }
        }
    }
    Cow::Borrowed(name)
}

/// Synonym for all three Cryptomattes.
const ALL_MATTES: &str = "cryptomatte";

/// Parses a name of `--aov`: an AOV, `all`, or `help` for the table of AOVs.
#[derive(Clone)]
pub(super) struct AovParser;

impl AovParser {
    fn inner() -> PossibleValuesParser {
        let value = |aov: &Aov| PossibleValue::new(aov.info().option).help(aov.info().about);
        let further = [
            PossibleValue::new(ALL_AOVS).help("All of these"),
            PossibleValue::new("help").help("Lists them with the names and types of their channels"),
            // Synonyms.
            PossibleValue::new("nearest").hide(true),
            PossibleValue::new("material").hide(true),
            PossibleValue::new(ALL_MATTES).hide(true),
            PossibleValue::new("z").hide(true),
            PossibleValue::new("normals").hide(true),
        ];
        PossibleValuesParser::new(Aov::ALL.iter().map(value).chain(further))
    }
}

impl TypedValueParser for AovParser {
    type Value = AovSet;

    fn parse_ref(&self, cmd: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<AovSet, clap::Error> {
        if value == "help" {
            let mut error = clap::Error::new(ErrorKind::DisplayHelp).with_cmd(cmd);
            error.insert(ContextKind::ValidValue, ContextValue::String(table()));
            return Err(error);
        }
        let name = AovParser::inner().parse_ref(cmd, arg, value)?;
        if name == ALL_MATTES {
            let mattes = [Aov::CryptoObject, Aov::CryptoMaterial, Aov::CryptoAsset];
            return Ok(mattes.into_iter().map(AovSet::from).fold(AovSet::NONE, AovSet::union));
        }
        let one = Aov::from_option(&name).map(AovSet::from);
        Ok(one.unwrap_or_else(AovSet::all))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(AovParser::inner().possible_values()?.collect::<Vec<_>>().into_iter()))
    }
}

/// The table of AOVs, if `--aov help` requested it.
pub(super) fn aov_table_requested(error: &clap::Error) -> Option<&str> {
    match (error.kind(), error.get(ContextKind::ValidValue)) {
        (ErrorKind::DisplayHelp, Some(ContextValue::String(table))) => Some(table),
        _ => None,
    }
}

/// The table of all AOVs with their channels.
fn table() -> String {
    let mut text = String::from("EXR channels in addition to R, G, B and A:\n\n");
    for info in Aov::ALL.iter().map(|aov| aov.info()) {
        text += &format!("{:<22} {} ({})\n{:22} {}\n", info.option, names(info), kind(info), "", info.about);
    }
    text += "\nThe passes from diffuse_direct to environment add up to R, G and B.\n";
    text
}

/// Channel names grouped by layer, such as `DiffDir.RGB`.
fn names(info: &AovInfo) -> String {
    let layer = |name: &'static str| name.rsplit_once('.').map_or(("", name), |parts| parts);
    let mut layers: Vec<(&str, String)> = Vec::new();
    for (of, component) in info.names.iter().map(|name| layer(name)) {
        match layers.last_mut().filter(|(last, _)| *last == of) {
            Some((_, components)) => components.push_str(component),
            None => layers.push((of, component.to_string())),
        }
    }
    let shown = |(of, components): &(&str, String)| match of.is_empty() {
        true => components.clone(),
        false => format!("{of}.{components}"),
    };
    layers.iter().map(shown).collect::<Vec<_>>().join(", ")
}

fn kind(info: &AovInfo) -> &'static str {
    match info.pixel_type {
        PixelType::Half => "half, float with --float",
        PixelType::Float => "float",
        PixelType::Uint => "32-bit integer",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn preview_values_are_parsed() {
        assert_eq!("address".parse(), Ok(PreviewArg::Address));
        assert_eq!("tev".parse(), Ok(PreviewArg::Tev("127.0.0.1:14158".to_string())));
        assert_eq!("tev:[::1]:99".parse(), Ok(PreviewArg::Tev("[::1]:99".to_string())));
        for wrong in ["tev:", "tev:host", "Page", ""] {
            assert!(wrong.parse::<PreviewArg>().is_err(), "{wrong}");
        }
    }
}

#[cfg(test)]
mod frames_tests {
    use super::*;

    #[test]
    fn ranges_are_parsed() {
        let list = |text: &str| Frames::from_str(text).map(|f| f.numbers().collect::<Vec<_>>());
        assert_eq!(list("7"), Ok(vec![7]));
        assert_eq!(list("1-4"), Ok(vec![1, 2, 3, 4]));
        assert_eq!(list("0-9x4"), Ok(vec![0, 4, 8]));
        for wrong in ["", "a", "3-1", "1-5x0", "-3", "1-", "0-4294967295"] {
            assert!(list(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn frame_numbers_are_inserted_into_names() {
        let file = |path: &str, n| Frames::file(Path::new(path), n).to_string_lossy().replace('\\', "/");
        assert_eq!(file("a/out.exr", 7), "a/out.0007.exr");
        assert_eq!(file("a/out_##.exr", 7), "a/out_07.exr");
        assert_eq!(file("out.##.exr", 123), "out.123.exr");
        assert_eq!(file("a%d/out.%04d.exr", 7), "a%d/out.0007.exr");
        assert_eq!(file("out_$F4.exr", 7), "out_0007.exr");
        assert_eq!(file("out_%d.exr", 7), "out_7.exr");
        assert_eq!(file("100%-%3d.exr", 7), "100%-007.exr");
        assert_eq!(file("50%.exr", 7), "50%.0007.exr");
    }
}
