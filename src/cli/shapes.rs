//! How many of each kind of shape there are, in words and for programs.

use oscura::scene::{Scene, ShapeTag};
use serde::{Serialize, Serializer};

/// A count for each of [`ShapeTag::ALL`].
#[derive(Clone, Copy)]
pub(crate) struct ShapeCounts(pub [u64; ShapeTag::ALL.len()]);

impl ShapeCounts {
    /// The shapes of a scene.
    pub fn of(scene: &Scene) -> ShapeCounts {
        let mut counts = ShapeCounts([0; ShapeTag::ALL.len()]);
        for shape in &scene.shapes {
            counts.0[shape.kind.tag() as usize] += 1;
        }
        counts
    }

    fn iter(self) -> impl Iterator<Item = (ShapeTag, u64)> {
        ShapeTag::ALL.iter().copied().zip(self.0)
    }

    /// `1 sphere, 2 disks, `: the kinds that are there, each with a comma.
    pub fn words(self) -> String {
        let there = self.iter().filter(|(_, count)| *count > 0);
        let one = |(tag, count): (ShapeTag, u64)| {
            format!("{count} {}, ", if count == 1 { tag.name() } else { tag.plural() })
        };
        there.map(one).collect()
    }
}

/// A key for each kind.
impl Serialize for ShapeCounts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(tag, count)| (tag.plural().replace(' ', "_"), count)))
    }
}
