//! What a film can hold: the table of channels that users may ask for, and how samples become pixels in each.
//!
//! A further channel is a row of the table here, and the line of `integrator/first_hit.rs` that fills it. The command
//! line, the film and the files walk the table.

use crate::error::{Error, Result};
use std::borrow::Cow;
use std::str::FromStr;

/// The depth written where no sample of a pixel hit a surface, metres.
pub const BACKGROUND_DEPTH: f32 = 1e10;

/// How files store the values of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PixelType {
    /// 16-bit floats, unless 32 are asked for.
    Half,
    /// 32-bit floats.
    Float,
    /// 32-bit integers.
    Uint,
}

/// What of a sample a channel is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// Its red, green and blue. Every sample brings them.
    Color,
    /// The surface that its camera ray hit, if any.
    FirstHit,
}

/// How the values that samples bring become the value of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reduction {
    /// Mean over all samples; those that hit nothing count as zero.
    Mean,
    /// Mean over those that hit something; `empty` where none did.
    MeanOfHits {
        /// The value where nothing was hit.
        empty: f32,
    },
    /// The smallest value; `empty` where nothing was hit.
    Minimum {
        /// The value where nothing was hit.
        empty: f32,
    },
    /// The value of the first sample that hit something; 0 where none did. For numbers that have no mean.
    First,
    /// Variance of the mean over all samples: their sample variance divided by their number, which is the variance of
    /// independent samples. Ours are better spread than such, so that the mean varies less (by a factor of 7 over the
    /// Cornell box at 20 samples). Infinite below two samples, which say nothing about it.
    VarianceOfMean,
    /// How many samples brought a value.
    Count,
    /// Which ids (the bits of a float, and never those of a NaN) cover the pixel: pairs of an id and its share of all
    /// samples, the largest share first, as many as there are pairs of names.
    Coverage,
}

/// One entry of a film's list: values that have one source and one reduction.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name of each component in files: `layer.component`.
    pub names: Vec<Cow<'static, str>>,
    /// How files store it.
    pub pixel_type: PixelType,
    /// Where its values come from.
    pub source: Source,
    /// What becomes of them.
    pub reduction: Reduction,
}

impl Channel {
    /// The picture itself: premultiplied colour and alpha. The first of every film.
    pub fn color() -> Channel {
        Channel {
            names: ["R", "G", "B", "A"].map(Cow::Borrowed).to_vec(),
            pixel_type: PixelType::Half,
            source: Source::Color,
            reduction: Reduction::Mean,
        }
    }

    /// How many numbers each sample brings.
    pub fn components(&self) -> usize {
        components(self.reduction, self.names.len())
    }
}

/// How many numbers each sample brings to a channel of so many names.
const fn components(reduction: Reduction, names: usize) -> usize {
    match reduction {
        // An id, whose counts become several planes.
        Reduction::Coverage => 1,
        _ => names,
    }
}

/// A row of the table.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct AovInfo {
    /// What users call it: `--aov depth`.
    pub option: &'static str,
    /// What it is, with its unit.
    pub about: &'static str,
    /// Names of the components in files.
    pub names: &'static [&'static str],
    /// How files store it.
    pub pixel_type: PixelType,
    /// Where its values come from.
    pub source: Source,
    /// What becomes of them.
    pub reduction: Reduction,
}

impl AovInfo {
    /// How many numbers each sample brings.
    pub const fn components(&self) -> usize {
        components(self.reduction, self.names.len())
    }
}

/// Makes the enum of the rows, and the table in the same order.
macro_rules! table {
    ($($name:ident { about: $about:literal, $($field:ident: $value:expr),+ $(,)? })+) => {
        /// An arbitrary output variable: what a picture may carry besides colour.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Aov {
            $(#[doc = $about] $name,)+
        }

        impl Aov {
            /// All there are, in the order of the table.
            pub const ALL: &[Aov] = &[$(Aov::$name),+];
        }

        const TABLE: &[AovInfo] = &[$(AovInfo { about: $about, $($field: $value),+ }),+];
    };
}

table! {
    Depth {
        about: "Distance of the first surface from the camera's plane, metres; 1e10 where there is none",
        option: "depth",
        names: &["Z"],
        pixel_type: PixelType::Float,
        source: Source::FirstHit,
        reduction: Reduction::MeanOfHits { empty: BACKGROUND_DEPTH },
    }
    Nearest {
        about: "The least depth of any sample, metres: edges keep that of what is in front",
        option: "nearest",
        names: &["nearest.Z"],
        pixel_type: PixelType::Float,
        source: Source::FirstHit,
        reduction: Reduction::Minimum { empty: BACKGROUND_DEPTH },
    }
    Position {
        about: "Where the first surface is in the scene's world, metres; 0 where there is none",
        option: "position",
        names: &["P.X", "P.Y", "P.Z"],
        pixel_type: PixelType::Float,
        source: Source::FirstHit,
        reduction: Reduction::MeanOfHits { empty: 0.0 },
    }
    Normal {
        about: "Shading normal of the first surface in world space, towards the camera",
        option: "normal",
        names: &["N.X", "N.Y", "N.Z"],
        pixel_type: PixelType::Float,
        source: Source::FirstHit,
        reduction: Reduction::Mean,
    }
    Albedo {
        about: "Reflectance of the first surface",
        option: "albedo",
        names: &["albedo.R", "albedo.G", "albedo.B"],
        pixel_type: PixelType::Float,
        source: Source::FirstHit,
        reduction: Reduction::Mean,
    }
    Material {
        about: "Number of the material that the first sample with a surface hit, from 1; 0 where there is none",
        option: "material",
        names: &["material.id"],
        pixel_type: PixelType::Uint,
        source: Source::FirstHit,
        reduction: Reduction::First,
    }
    Samples {
        about: "How many samples the pixel has",
        option: "samples",
        names: &["samples"],
        pixel_type: PixelType::Uint,
        source: Source::Color,
        reduction: Reduction::Count,
    }
    Variance {
        about: "Variance of the pixel's colour, were its samples independent (it is less); infinite below two samples",
        option: "variance",
        names: &["variance.R", "variance.G", "variance.B"],
        pixel_type: PixelType::Float,
        source: Source::Color,
        reduction: Reduction::VarianceOfMean,
    }
}

impl Aov {
    /// Its row of the table.
    pub const fn info(self) -> &'static AovInfo {
        &TABLE[self as usize]
    }

    /// The one of this name on the command line.
    pub fn from_option(name: &str) -> Option<Aov> {
        Aov::ALL.iter().copied().find(|aov| aov.info().option == name)
    }
}

impl FromStr for Aov {
    type Err = Error;

    /// By the name on the command line.
    fn from_str(name: &str) -> Result<Aov> {
        Aov::from_option(name).ok_or_else(|| {
            let names: Vec<&str> = Aov::ALL.iter().map(|aov| aov.info().option).collect();
            Error::usage(format!("there is no AOV '{name}'"))
                .with_help(format!("one of {}", names.join(", ")))
        })
    }
}

impl From<Aov> for Channel {
    fn from(aov: Aov) -> Channel {
        let &AovInfo { names, pixel_type, source, reduction, .. } = aov.info();
        let names = names.iter().map(|&name| Cow::Borrowed(name)).collect();
        Channel { names, pixel_type, source, reduction }
    }
}

/// Which AOVs a picture carries. What isn't asked for is neither stored nor computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AovSet(u32);

const _: () = assert!(Aov::ALL.len() <= u32::BITS as usize);

impl AovSet {
    /// Colour only.
    pub const NONE: AovSet = AovSet(0);

    /// These and one more.
    #[must_use]
    pub const fn with(self, aov: Aov) -> AovSet {
        AovSet(self.0 | 1 << aov as u32)
    }

    /// Is it asked for?
    pub const fn contains(self, aov: Aov) -> bool {
        self.0 >> aov as u32 & 1 == 1
    }

    /// Is anything asked for?
    #[inline(always)]
    pub const fn any(self) -> bool {
        self.0 != 0
    }

    /// Those that show the first surface.
    #[must_use]
    pub fn of_first_hits(self) -> AovSet {
        self.iter().filter(|aov| aov.info().source == Source::FirstHit).collect()
    }

    /// The channels of a film that holds them.
    pub fn channels(self) -> impl Iterator<Item = Channel> {
        self.iter().map(Channel::from)
    }

    /// Those asked for, in the order of the table.
    pub fn iter(self) -> impl Iterator<Item = Aov> {
        Aov::ALL.iter().copied().filter(move |&aov| self.contains(aov))
    }
}

impl FromIterator<Aov> for AovSet {
    fn from_iter<T: IntoIterator<Item = Aov>>(aovs: T) -> AovSet {
        aovs.into_iter().fold(AovSet::NONE, AovSet::with)
    }
}

impl<const N: usize> From<[Aov; N]> for AovSet {
    fn from(aovs: [Aov; N]) -> AovSet {
        aovs.into_iter().collect()
    }
}

impl From<Aov> for AovSet {
    fn from(aov: Aov) -> AovSet {
        AovSet::NONE.with(aov)
    }
}

impl From<&[Aov]> for AovSet {
    fn from(aovs: &[Aov]) -> AovSet {
        aovs.iter().copied().collect()
    }
}

impl From<Vec<Aov>> for AovSet {
    fn from(aovs: Vec<Aov>) -> AovSet {
        aovs.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn rows_stand_at_their_places_and_names_are_unique() {
        let (mut options, mut names) = (HashSet::new(), HashSet::new());
        names.extend(Channel::color().names);
        for (i, &aov) in Aov::ALL.iter().enumerate() {
            let info = aov.info();
            assert_eq!(aov as usize, i);
            assert_eq!(Aov::from_option(info.option), Some(aov));
            assert!(options.insert(info.option), "{} is there twice", info.option);
            let mut fresh = info.names.iter().map(|&name| names.insert(Cow::Borrowed(name)));
            assert!(fresh.all(|is_new| is_new), "{:?}: a name is there twice", info.names);
        }
        assert_eq!(Aov::from_option("colour"), None);
        assert_eq!("depth".parse::<Aov>().expect("it is one"), Aov::Depth);
        assert!("colour".parse::<Aov>().expect_err("it is none").to_string().contains("depth"));
    }

    #[test]
    fn sets_keep_the_order_of_the_table() {
        let set = AovSet::from([Aov::Variance, Aov::Albedo, Aov::Depth]);
        assert_eq!(set.iter().collect::<Vec<_>>(), [Aov::Depth, Aov::Albedo, Aov::Variance]);
        assert_eq!(set.of_first_hits(), AovSet::from([Aov::Depth, Aov::Albedo]));
        assert!(set.any() && !AovSet::NONE.any() && !set.contains(Aov::Normal));
    }
}
