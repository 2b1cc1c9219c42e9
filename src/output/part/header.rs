//! What a file of sums says about itself.

use crate::film::{Aov, AovSet, Channel, Layout};
use crate::scene::{Caught, is_group_name};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a picture depends on, by name: options with their values, and fingerprints of what is too long to be told.
pub type Identity = BTreeMap<String, String>;

/// Values of identities that begin so are fingerprints.
pub const PRINT: &str = "#";

/// What differs between two identities, in words.
pub fn differences(ours: &Identity, theirs: &Identity) -> Vec<String> {
    let names = ours.keys().chain(theirs.keys().filter(|name| !ours.contains_key(*name)));
    let differing = names.filter(|name| ours.get(*name) != theirs.get(*name));
    let word = |value: Option<&String>| value.map_or("missing", String::as_str).to_string();
    let told = differing.map(|name| {
        let (ours, theirs) = (word(ours.get(name)), word(theirs.get(name)));
        match ours.starts_with(PRINT) || theirs.starts_with(PRINT) {
            true => format!("{name} changed"),
            false => format!("{name} is {ours} here and {theirs} there"),
        }
    });
    told.collect()
}

/// A rectangle of pixels: from column `x0` and row `y0` up to, not including, column `x1` and row `y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// Left column.
    pub x0: u32,
    /// Top row.
    pub y0: u32,
    /// Column right of the last.
    pub x1: u32,
    /// Row below the last.
    pub y1: u32,
}

impl Region {
    /// Columns.
    pub fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }
}

impl std::fmt::Display for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{},{},{},{}", self.x0, self.y0, self.x1, self.y1)
    }
}

/// How paths are traced.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Way {
    /// Paths that go on from the first surface of each sample.
    pub branches: u32,
    /// In which groups pixels share paths.
    pub shared: Option<String>,
}

/// What was spent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Seconds of rendering by the wall's clock.
    pub wall_s: f64,
    /// The same of processors.
    pub cpu_s: f64,
    /// Paths.
    pub paths: u64,
    /// Rays.
    pub rays: u64,
}

/// Which channels a film has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Channels {
    /// AOVs by their options.
    pub aovs: Vec<String>,
    /// Ranks of ids of mattes.
    pub matte_levels: u32,
    /// Names of the groups of lights that have channels.
    pub light_groups: Vec<String>,
    /// Are the halves of the samples kept apart?
    pub halves: bool,
    /// Is what shadow catchers catch kept?
    #[serde(default)]
    pub catchers: bool,
    /// Are only shadows shown of it?
    #[serde(default)]
    pub shadows_only: bool,
}

impl Channels {
    /// What is shown of what shadow catchers catch.
    pub fn caught(&self) -> Caught {
        if self.shadows_only { Caught::Shadows } else { Caught::All }
    }

    /// The AOVs; `None` if one is unknown.
    pub fn aovs(&self) -> Option<AovSet> {
        self.aovs.iter().map(|name| Aov::from_option(name)).collect()
    }

    /// The film's layout; `None` if there is none of the kind.
    pub fn layout(&self) -> Option<Layout> {
        const MOST_LEVELS: u32 = 64;
        let aovs = self.aovs().filter(|_| (1..=MOST_LEVELS).contains(&self.matte_levels))?;
        if !self.light_groups.iter().all(|name| is_group_name(name)) {
            return None;
        }
        let groups = self.light_groups.iter().map(|name| Channel::light_group(name));
        let caught = self.catchers.then(Channel::of_catchers).into_iter().flatten();
        let further = aovs.channels_with(self.matte_levels).chain(groups).chain(caught);
        Some(Layout::new(further).with_halves(self.halves))
    }
}

/// What lies behind a picture where it is transparent. A picture follows the sums.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Behind {
    /// Nothing.
    #[default]
    Nothing,
    /// The bits of a linear colour.
    Color([u32; 3]),
    /// A picture so wide and high, RGBA in single floats.
    Picture(u32, u32),
}

/// How pictures are written that are made of the sums. Floats are kept as bits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Finish {
    /// Seed of all randomness.
    pub seed: u32,
    /// From world to camera space, by columns.
    pub world_to_camera: [u64; 16],
    /// From there to normalized device coordinates, if that is known.
    #[serde(default)]
    pub world_to_ndc: Option<[u64; 16]>,
    /// Width over height of a pixel; square where there is none.
    #[serde(default)]
    pub pixel_aspect: Option<u64>,
    /// Which space AOVs of places and directions are in, by name; the world's where there is none.
    #[serde(default)]
    pub aov_space: String,
    /// How far from the world's origin the scene's coordinates have theirs.
    pub world_offset: Option<[u64; 3]>,
    /// Names that the mattes may show, matte by matte.
    pub mattes: Vec<Vec<String>>,
    /// What was ignored, approximated or repaired before the first sample.
    pub warnings: Vec<String>,
    /// The noise is to be taken out; then only these AOVs stay, by their options.
    #[serde(default)]
    pub denoise: Option<Vec<String>>,
    /// Whose picture it is.
    pub owner: Option<String>,
    /// 32-bit colours in EXRs.
    pub float: bool,
    /// Leave times and dates out.
    pub reproducible: bool,
    /// View transform of PNGs and the like, by name.
    pub view: String,
    /// The temperature of the light that looks white in them, kelvin, as bits.
    pub white_balance: Option<u32>,
    /// Have they 16 bits a channel?
    pub deep: bool,
    /// Their exposure, stops.
    pub exposure: u32,
    /// Are they dithered?
    pub dither: bool,
    /// Do they stand before black?
    #[serde(default)]
    pub opaque: bool,
    /// What lies behind the picture.
    pub behind: Behind,
}

/// A file's head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartHeader {
    /// What the picture depends on.
    pub identity: Identity,
    /// Width of the whole picture in pixels.
    pub width: u32,
    /// Its height.
    pub height: u32,
    /// Samples a pixel that the whole picture is to have.
    pub samples: u32,
    /// The pixels that the file has.
    pub region: Region,
    /// Which of their samples: from this one.
    pub first_sample: u32,
    /// Up to, not including, this one.
    pub end_sample: u32,
    /// How they were traced; `None` if that was still open.
    pub way: Option<Way>,
    /// Channels.
    pub channels: Channels,
    /// What was spent.
    pub effort: Effort,
    /// How pictures are written.
    pub finish: Finish,
    /// Bytes of what follows the sums and the picture behind.
    pub further_bytes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_name_what_differs() {
        let of = |pairs: &[(&str, &str)]| -> Identity {
            pairs.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect()
        };
        let ours = of(&[("depth", "5"), ("the meshes", "#1"), ("seed", "0"), ("version", "1")]);
        let theirs = of(&[("depth", "8"), ("the meshes", "#2"), ("seed", "0")]);
        let expected =
            ["depth is 5 here and 8 there", "the meshes changed", "version is 1 here and missing there"];
        assert_eq!(differences(&ours, &theirs), expected);
        assert!(differences(&ours, &ours).is_empty());
    }
}
