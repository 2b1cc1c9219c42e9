//! What a structure takes, estimated from numbers alone: for the room that is asked for before it is built, and for an error
//! before any work where it can't be addressed.

use super::input::AccelInput;
use super::input::Geometry;
use super::layout::{ANALYTIC_LINES, INSTANCE_LINES, MAX_LINE, TRIANGLE_LINES};
use crate::shape::triangle::LANES;
use crate::simd::Line;
use std::fmt::{self, Display, Formatter};

/// Numbers of primitives, and about how much memory their trees take: at most so much, but for few scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// Triangles; those of a shared geometry count once.
    pub triangles: u64,
    /// Quads, spheres, disks and the like.
    pub shapes: u64,
    /// Pieces of curves.
    pub curves: u64,
    /// Instances.
    pub instances: u64,
    /// Memory of the trees.
    pub bytes: u64,
}

const LINE: u64 = size_of::<Line>() as u64;

/// The memory of a triangle of a surface, in packets of so many lines for so many of them. Packets are two thirds full, and a node
/// of eight children takes four lines.
const fn in_packets(lines: u64, per: u64) -> u64 {
    lines * LINE * 3 / (2 * per) + LINE / 4
}

/// The memory of a primitive that has a packet of so many lines alone, as strewn ones do. Nodes have few children then, of which not
/// all are leaves: they come to 1.4 lines for each of 5,000 strewn instances.
const fn in_own_packet(lines: u64) -> u64 {
    lines * LINE + 3 * LINE / 2
}

impl Estimate {
    /// The most memory that references can address.
    pub const LIMIT: u64 = MAX_LINE as u64 * LINE;

    /// That of everything that a structure is built over, as far as an instance uses it.
    pub fn of(input: &AccelInput) -> Estimate {
        let mut estimate = Estimate::default();
        let used = input.used_geometries();
        for (geometry, _) in input.geometries.iter().zip(&used).filter(|(_, used)| **used) {
            estimate.add_geometry(geometry);
        }
        estimate.add_instances(input.instances.len());
        estimate
    }

    /// Adds the tree of a geometry.
    pub fn add_geometry(&mut self, geometry: &Geometry) {
        self.add_triangles(geometry.triangles.len(), geometry.keys.len());
        self.add_quads(geometry.quads.len());
        self.add_analytic(geometry.analytic.len());
        self.add_curves(geometry.curves.len());
        // However small it is.
        self.bytes += 8 * LINE;
    }

    /// Adds triangles, whose vertices move between so many keys; none where they stand still.
    pub fn add_triangles(&mut self, count: usize, keys: usize) {
        let lines = TRIANGLE_LINES as u64;
        let lines = if keys == 0 { lines } else { ANALYTIC_LINES as u64 + keys as u64 * lines };
        self.triangles += count as u64;
        self.add(count, in_packets(lines, LANES as u64));
    }

    /// Adds quads, of which each is two triangles in a packet.
    pub fn add_quads(&mut self, count: usize) {
        self.shapes += count as u64;
        self.add(count, in_own_packet(TRIANGLE_LINES as u64));
    }

    /// Adds spheres, disks and the like.
    pub fn add_analytic(&mut self, count: usize) {
        self.shapes += count as u64;
        self.add(count, in_own_packet(ANALYTIC_LINES as u64));
    }

    /// Adds pieces of curves.
    pub fn add_curves(&mut self, count: usize) {
        self.curves += count as u64;
        self.add(count, in_own_packet(ANALYTIC_LINES as u64));
    }

    /// Adds instances.
    pub fn add_instances(&mut self, count: usize) {
        self.instances += count as u64;
        self.add(count, in_own_packet(INSTANCE_LINES as u64));
    }

    fn add(&mut self, count: usize, bytes: u64) {
        self.bytes = self.bytes.saturating_add((count as u64).saturating_mul(bytes));
    }

    /// Cache lines of the trees.
    pub(super) fn lines(&self) -> usize {
        self.bytes.div_ceil(LINE) as usize
    }

    /// Fails where the trees are too large to be addressed.
    pub fn check(self) -> Result<(), TooLarge> {
        if self.bytes > Estimate::LIMIT { Err(TooLarge(self)) } else { Ok(()) }
    }
}

/// A structure that is too large to be addressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge(pub Estimate);

impl Display for TooLarge {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Estimate { triangles, shapes, curves, instances, bytes } = self.0;
        let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
        let numbers = [
            (triangles, "triangles"),
            (shapes, "quads and analytic shapes"),
            (curves, "pieces of curves"),
            (instances, "instances"),
        ];
        let numbers = numbers.iter().filter(|(count, _)| *count > 0);
        let numbers: Vec<String> = numbers.map(|(count, what)| format!("{count} {what}")).collect();
        let limit = gib(Estimate::LIMIT);
        // Found while it was built, where packets are emptier than was expected.
        let size = if bytes > Estimate::LIMIT { gib(bytes) } else { limit };
        let about = if bytes > Estimate::LIMIT { "about" } else { "more than" };
        write!(
            f,
            "{} take {about} {size:.1} GiB of acceleration structure, of which {limit:.0} GiB can be addressed; place \
             meshes several times in place of copies (those of 1024 triangles or more are shared), or render parts apart",
            numbers.join(", ")
        )
    }
}

impl std::error::Error for TooLarge {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_addressed_is_an_error_with_numbers() {
        let mut estimate = Estimate::default();
        estimate.add_triangles(380_000_000, 0);
        assert_eq!(estimate.check(), Ok(()));
        // The same with their vertices at four keys takes four times as much.
        let mut moving = Estimate::default();
        moving.add_triangles(380_000_000, 4);
        let message = moving.check().expect_err("too large").to_string();
        assert!(message.starts_with("380000000 triangles take about 124.6 GiB of acc"), "{message}");
        assert!(message.contains("32 GiB can be addressed"), "{message}");
        estimate.add_curves(100_000_000);
        estimate.add_instances(5);
        let message = estimate.check().expect_err("too large").to_string();
        assert!(
            message.contains("380000000 triangles, 100000000 pieces of curves, 5 instances"),
            "{message}"
        );
        assert!(TooLarge(Estimate::default()).to_string().contains("more than 32.0 GiB"));
    }
}
