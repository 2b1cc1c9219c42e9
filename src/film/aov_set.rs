//! Sets of AOVs.

use super::aov::{Aov, MATTE_LEVELS};
use super::channel::{Channel, Source};

/// Which AOVs a picture carries. What isn't asked for is neither stored nor computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AovSet(u32);

const _: () = assert!(Aov::ALL.len() <= u32::BITS as usize);

impl AovSet {
    /// Colour only.
    pub const NONE: AovSet = AovSet(0);

    /// All there are.
    pub const fn all() -> AovSet {
        let (mut set, mut i) = (AovSet::NONE, 0);
        while i < Aov::ALL.len() {
            set = set.with(Aov::ALL[i]);
            i += 1;
        }
        set
    }

    /// These and one more.
    #[must_use]
    pub const fn with(self, aov: Aov) -> AovSet {
        AovSet(self.0 | 1 << aov as u32)
    }

    /// These and others.
    #[must_use]
    pub const fn union(self, other: AovSet) -> AovSet {
        AovSet(self.0 | other.0)
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

    /// Those of a source.
    #[must_use]
    pub fn of(self, source: Source) -> AovSet {
        self.iter().filter(|aov| aov.info().source == source).collect()
    }

    /// The mattes among them.
    pub fn mattes(self) -> impl Iterator<Item = (Aov, &'static str)> {
        self.iter().filter_map(|aov| Some((aov, aov.matte()?)))
    }

    /// The channels of a film that holds them, mattes with so many ranks of ids.
    pub fn channels_with(self, matte_levels: u32) -> impl Iterator<Item = Channel> {
        self.iter().map(move |aov| aov.channel(matte_levels))
    }

    /// The channels of a film that holds them.
    pub fn channels(self) -> impl Iterator<Item = Channel> {
        self.channels_with(MATTE_LEVELS)
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
