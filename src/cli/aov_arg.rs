//! `--aov`: names of the film's table of channels, `all`, and `help` for the table.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command};
use oscura::film::{Aov, AovInfo, AovSet, PixelType};
use oscura::render::ALL_AOVS;
use std::ffi::OsStr;

/// Reads one name.
#[derive(Clone)]
pub(super) struct AovParser;

impl AovParser {
    fn inner() -> PossibleValuesParser {
        let value = |aov: &Aov| PossibleValue::new(aov.info().option).help(aov.info().about);
        let further = [
            PossibleValue::new(ALL_AOVS).help("All of these"),
            PossibleValue::new("help").help("Lists them with the names and types of their channels"),
            // Names of earlier versions.
            PossibleValue::new("nearest").hide(true),
            PossibleValue::new("material").hide(true),
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
        let one = Aov::from_option(&name).map(AovSet::from);
        Ok(one.unwrap_or_else(AovSet::all))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(AovParser::inner().possible_values()?.collect::<Vec<_>>().into_iter()))
    }
}

/// The table, if that is what was asked for.
pub(super) fn asked_for(error: &clap::Error) -> Option<&str> {
    match (error.kind(), error.get(ContextKind::ValidValue)) {
        (ErrorKind::DisplayHelp, Some(ContextValue::String(table))) => Some(table),
        _ => None,
    }
}

/// All AOVs with their channels.
fn table() -> String {
    let mut text = String::from("Channels of EXRs besides R, G, B and A:\n\n");
    for info in Aov::ALL.iter().map(|aov| aov.info()) {
        text += &format!("{:<22} {} ({})\n{:22} {}\n", info.option, names(info), kind(info), "", info.about);
    }
    text += "\nThe passes from diffuse_direct to environment add up to R, G and B.\n";
    text
}

/// `DiffDir.RGB` for three names of a layer.
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
