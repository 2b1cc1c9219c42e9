//! The table of AOVs (arbitrary output variables).
//!
//! A new AOV needs a row of the table here, and a line that computes its value: in `integrator/first_hit.rs` for properties of first
//! hits, in `integrator/radiance_buffer.rs` for parts of the radiance. The command line, film and files iterate over the table.

use super::channel::{Channel, PixelType, Reduction, Source, components};
use crate::error::{Error, Result};
use Reduction::{Count, Coverage, First, Mean, MeanOfHits, Minimum, Share, VarianceOfMean};
use std::borrow::Cow;
use std::str::FromStr;

/// The depth written where no sample of a pixel hit a surface, metres.
pub const BACKGROUND_DEPTH: f32 = 1e10;

/// A row of the table.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct AovInfo {
    /// Name on the command line and in scene files: `--aov depth`.
    pub option: &'static str,
    /// Description with unit.
    pub about: &'static str,
    /// Channel names in files.
    pub names: &'static [&'static str],
    /// Type of the values in files.
    pub pixel_type: PixelType,
    /// Source of the values.
    pub source: Source,
    /// Combination of samples to a pixel.
    pub reduction: Reduction,
}

impl AovInfo {
    /// Number of values per sample.
    pub const fn components(&self) -> usize {
        components(self.reduction, self.names.len())
    }
}

/// Channel names of an RGB layer.
macro_rules! rgb {
    ($layer:literal) => {
        &[concat!($layer, ".R"), concat!($layer, ".G"), concat!($layer, ".B")]
    };
}

macro_rules! xyz {
    ($layer:literal) => {
        &[concat!($layer, ".X"), concat!($layer, ".Y"), concat!($layer, ".Z")]
    };
}

/// Channel names of a Cryptomatte at the default number of levels; see [`matte_names`].
macro_rules! matte {
    ($kind:literal) => {
        &[
            concat!($kind, "00.R"),
            concat!($kind, "00.G"),
            concat!($kind, "00.B"),
            concat!($kind, "00.A"),
            concat!($kind, "01.R"),
            concat!($kind, "01.G"),
            concat!($kind, "01.B"),
            concat!($kind, "01.A"),
            concat!($kind, "02.R"),
            concat!($kind, "02.G"),
            concat!($kind, "02.B"),
            concat!($kind, "02.A"),
        ]
    };
}

/// Generates the enum [`Aov`] and the table in the same order. A row: variant, name for users, channel names, pixel type, source,
/// reduction, description.
macro_rules! table {
    ($($name:ident $option:literal $names:expr, $pixel_type:ident $source:ident $reduction:expr; $about:literal)+) => {
        /// An arbitrary output variable: a channel of a picture besides colour.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Aov {
            $(#[doc = $about] $name,)+
        }

        impl Aov {
            /// All AOVs, in the order of the table.
            pub const ALL: &[Aov] = &[$(Aov::$name),+];
        }

        const TABLE: &[AovInfo] = &[$(AovInfo {
            option: $option,
            about: $about,
            names: $names,
            pixel_type: PixelType::$pixel_type,
            source: Source::$source,
            reduction: $reduction,
        }),+];
    };
}

table! {
    Depth "depth" &["Z"], Float FirstHit MeanOfHits { empty: BACKGROUND_DEPTH };
        "Distance of the first surface from the camera's plane, metres; 1e10 where there is none"
    DepthMin "depth_min" &["nearest.Z"], Float FirstHit Minimum { empty: BACKGROUND_DEPTH };
        "Smallest depth of any sample, metres: at edges that of the front object"
    Position "position" xyz!("P"), Float FirstHit MeanOfHits { empty: 0.0 };
        "Position of the first surface, metres, in the AOV space (world by default); 0 where there is none"
    Normal "normal" xyz!("N"), Float FirstHit Mean;
        "Shading normal of the first surface, towards the camera, in the AOV space (world by default)"
    GeometricNormal "geometric_normal" xyz!("Ng"), Float FirstHit Mean;
        "Geometric normal of the first surface, without smoothing and normal maps"
    Facing "facing" &["facing.V"], Float FirstHit Mean;
        "Cosine between the shading normal and the direction to the camera: 1 where the surface faces it"
    Uv "uv" &["UV.U", "UV.V"], Float FirstHit MeanOfHits { empty: 0.0 };
        "First texture coordinates of the first surface, v downwards; 0 where it has none"
    Motion "motion" &["Vector.X", "Vector.Y", "Vector.Z", "Vector.W"], Float FirstHit MeanOfHits { empty: 0.0 };
        "Motion vectors of the first surface, pixels to the right and up: to the previous frame (X, Y), to the next (Z, W)"
    Albedo "albedo" rgb!("albedo"), Float FirstHit Mean;
        "Reflectance of the first surface"
    DenoisingAlbedo "denoising_albedo" rgb!("denoising_albedo"), Float FirstHit Mean;
        "Reflectance of the first surface that is not a smooth mirror, times that of the mirrors before it"
    DenoisingNormal "denoising_normal" xyz!("denoising_normal"), Float FirstHit Mean;
        "Shading normal of that surface, in the AOV space (world by default)"
    Roughness "roughness" &["roughness.V"], Float FirstHit Mean;
        "Perceptual roughness of the first surface, the square root of GGX alpha; 1 for diffuse ones"
    DiffuseColor "diffuse_color" rgb!("DiffCol"), Half FirstHit Mean;
        "Diffuse colour of the first surface"
    GlossyColor "glossy_color" rgb!("GlossCol"), Half FirstHit Mean;
        "Glossy colour of the first surface, at normal incidence"
    TransmissionColor "transmission_color" rgb!("TransCol"), Half FirstHit Mean;
        "Transmission colour of the first surface"
    DiffuseDirect "diffuse_direct" rgb!("DiffDir"), Half PartOfColor Mean;
        "Direct light that the first surface reflects diffusely, multiplied by its colour"
    DiffuseIndirect "diffuse_indirect" rgb!("DiffInd"), Half PartOfColor Mean;
        "Indirect light that the first surface reflects diffusely, multiplied by its colour"
    GlossyDirect "glossy_direct" rgb!("GlossDir"), Half PartOfColor Mean;
        "Direct light that the first surface reflects glossily"
    GlossyIndirect "glossy_indirect" rgb!("GlossInd"), Half PartOfColor Mean;
        "Indirect light that the first surface reflects glossily"
    TransmissionDirect "transmission_direct" rgb!("TransDir"), Half PartOfColor Mean;
        "Direct light that the first surface transmits"
    TransmissionIndirect "transmission_indirect" rgb!("TransInd"), Half PartOfColor Mean;
        "Indirect light that the first surface transmits"
    Emission "emission" rgb!("Emit"), Half PartOfColor Mean;
        "Emission of surfaces that the camera sees"
    Environment "environment" rgb!("Env"), Half PartOfColor Mean;
        "The environment that the camera sees"
    Shadow "shadow" &["shadow.V"], Float FirstHit Share;
        "Shadow: blocked share of the direct light of the first surface; 0 lit, 1 in full shadow, 0 where there is no light"
    ObjectId "object_id" &["object.id"], Uint FirstHit First;
        "ID of the object that the first sample with a surface hit, from 1; 0 where there is none"
    MaterialId "material_id" &["material.id"], Uint FirstHit First;
        "ID of its material, from 1; 0 where there is none"
    CryptoObject "crypto_object" matte!("CryptoObject"), Float FirstHit Coverage;
        "Cryptomatte of objects: hashes of the names of the objects in a pixel, and their coverage"
    CryptoMaterial "crypto_material" matte!("CryptoMaterial"), Float FirstHit Coverage;
        "Cryptomatte of materials"
    CryptoAsset "crypto_asset" matte!("CryptoAsset"), Float FirstHit Coverage;
        "Cryptomatte of assets: objects by their topmost parent"
    Samples "samples" &["samples"], Uint Color Count;
        "Number of samples of the pixel"
    Variance "variance" rgb!("variance"), Float Color VarianceOfMean;
        "Variance of the pixel's colour, estimated as if samples were independent (an upper bound); infinite below two samples"
}

named_enum! {
    /// Coordinate space of the AOVs `position`, `normal`, `geometric_normal` and `denoising_normal`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    AovSpace {
        /// World space: right-handed, y up, metres.
        #[default]
        World = "world",
        /// Camera space at the time of the frame: x to the right, y up, z backwards (visible points have negative z), metres.
        Camera = "camera",
    }
}

impl AovSpace {
    /// Whether a channel, by its name in files, depends on the space.
    pub fn concerns(channel: &str) -> bool {
        ["P.", "N.", "Ng.", "denoising_normal."].iter().any(|layer| channel.starts_with(layer))
    }
}

impl FromStr for AovSpace {
    type Err = Error;

    /// Parses `world` or `camera`.
    ///
    /// # Errors
    /// A usage error.
    fn from_str(text: &str) -> Result<AovSpace> {
        let found = AovSpace::from_name(text);
        found.ok_or_else(|| Error::usage(format!("'{text}' is neither world nor camera")))
    }
}

/// Former names of AOVs.
const ALIASES: [(&str, &str); 4] =
    [("nearest", "depth_min"), ("material", "material_id"), ("z", "depth"), ("normals", "normal")];

/// Default number of levels of a Cryptomatte: ranks of (id, coverage) per pixel.
pub const MATTE_LEVELS: u32 = 6;

impl Aov {
    /// The row of the table.
    pub const fn info(self) -> &'static AovInfo {
        &TABLE[self as usize]
    }

    /// Parses a name or alias.
    pub fn from_option(name: &str) -> Option<Aov> {
        let name = ALIASES.iter().find(|(old, _)| *old == name).map_or(name, |(_, new)| new);
        Aov::ALL.iter().copied().find(|aov| aov.info().option == name)
    }

    /// Name prefix of the layers if it is a Cryptomatte: `CryptoObject`.
    pub fn matte(self) -> Option<&'static str> {
        let info = self.info();
        let is_matte = info.reduction == Coverage;
        is_matte.then(|| info.names[0].trim_end_matches("00.R"))
    }

    /// The film channel; `matte_levels` is the number of levels of a Cryptomatte.
    pub fn channel(self, matte_levels: u32) -> Channel {
        let &AovInfo { names, pixel_type, source, reduction, .. } = self.info();
        let names = match self.matte() {
            Some(kind) => matte_names(kind, matte_levels),
            None => names.iter().map(|&name| Cow::Borrowed(name)).collect(),
        };
        Channel { names, pixel_type, source, reduction }
    }
}

/// Channel names of a Cryptomatte: each layer of four channels holds two ranks of (id, coverage).
fn matte_names(kind: &str, levels: u32) -> Vec<Cow<'static, str>> {
    let layers = 0..levels.div_ceil(2);
    layers.flat_map(|layer| ["R", "G", "B", "A"].map(|c| format!("{kind}{layer:02}.{c}").into())).collect()
}

impl FromStr for Aov {
    type Err = Error;

    /// Parses a name or alias.
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
        aov.channel(MATTE_LEVELS)
    }
}

// Sets of AOVs.

/// A set of AOVs. Others are neither stored nor computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AovSet(u64);

const _: () = assert!(Aov::ALL.len() <= u64::BITS as usize);

impl AovSet {
    /// No AOVs.
    pub const NONE: AovSet = AovSet(0);

    /// All AOVs.
    pub const fn all() -> AovSet {
        let (mut set, mut i) = (AovSet::NONE, 0);
        while i < Aov::ALL.len() {
            set = set.with(Aov::ALL[i]);
            i += 1;
        }
        set
    }

    /// This set with one more AOV.
    #[must_use]
    pub const fn with(self, aov: Aov) -> AovSet {
        AovSet(self.0 | 1 << aov as u64)
    }

    /// The union with another set.
    #[must_use]
    pub const fn union(self, other: AovSet) -> AovSet {
        AovSet(self.0 | other.0)
    }

    /// Whether the set contains an AOV.
    pub const fn contains(self, aov: Aov) -> bool {
        self.0 >> aov as u64 & 1 == 1
    }

    /// Whether the set is not empty.
    #[inline(always)]
    pub const fn any(self) -> bool {
        self.0 != 0
    }

    /// The AOVs with a source.
    #[must_use]
    pub fn of(self, source: Source) -> AovSet {
        self.iter().filter(|aov| aov.info().source == source).collect()
    }

    /// The Cryptomattes, with their name prefixes.
    pub fn mattes(self) -> impl Iterator<Item = (Aov, &'static str)> {
        self.iter().filter_map(|aov| Some((aov, aov.matte()?)))
    }

    /// Film channels of the set, with a number of levels of Cryptomattes.
    pub fn channels_with(self, matte_levels: u32) -> impl Iterator<Item = Channel> {
        self.iter().map(move |aov| aov.channel(matte_levels))
    }

    /// Film channels of the set.
    pub fn channels(self) -> impl Iterator<Item = Channel> {
        self.channels_with(MATTE_LEVELS)
    }

    /// Iterates in the order of the table.
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
    fn table_order_matches_the_enum_and_names_are_unique() {
        let (mut options, mut names) = (HashSet::new(), HashSet::new());
        names.extend(Channel::color().names);
        for (i, &aov) in Aov::ALL.iter().enumerate() {
            let info = aov.info();
            assert_eq!(aov as usize, i);
            assert_eq!(Aov::from_option(info.option), Some(aov));
            assert!(options.insert(info.option), "{} is there twice", info.option);
            let mut fresh = info.names.iter().map(|&name| names.insert(Cow::Borrowed(name)));
            assert!(fresh.all(|is_new| is_new), "{:?}: a name is there twice", info.names);
            // The macro `matte` agrees with `matte_names`.
            assert_eq!(Channel::from(aov).names, info.names);
        }
        assert_eq!(Aov::from_option("colour"), None);
        assert_eq!(Aov::from_option("nearest"), Some(Aov::DepthMin));
        assert_eq!("depth".parse::<Aov>().expect("it is one"), Aov::Depth);
        assert!("colour".parse::<Aov>().expect_err("it is none").to_string().contains("depth"));
    }

    #[test]
    fn mattes_have_two_ranks_per_layer() {
        assert_eq!(
            Aov::CryptoAsset.channel(2).names,
            ["R", "G", "B", "A"].map(|c| format!("CryptoAsset00.{c}"))
        );
        assert_eq!(Aov::CryptoAsset.channel(7).names.len(), 16);
        assert_eq!((Aov::CryptoAsset.matte(), Aov::Depth.matte()), (Some("CryptoAsset"), None));
    }

    #[test]
    fn sets_keep_the_order_of_the_table() {
        let set = AovSet::from([Aov::Variance, Aov::Albedo, Aov::Depth]);
        assert_eq!(set.iter().collect::<Vec<_>>(), [Aov::Depth, Aov::Albedo, Aov::Variance]);
        assert_eq!(set.of(Source::FirstHit), AovSet::from([Aov::Depth, Aov::Albedo]));
        assert!(set.any() && !AovSet::NONE.any() && !set.contains(Aov::Normal));
        assert_eq!(AovSet::all().iter().count(), Aov::ALL.len());
        assert_eq!(set.union(Aov::Normal.into()).iter().count(), 4);
    }
}
