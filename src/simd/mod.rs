//! CPU levels and function multiversioning; the only module with `unsafe`.
//!
//! A loop in a [`Kernel`] whose `run` is `#[inline(always)]` (and calls only `#[inline(always)]` functions) is compiled and
//! vectorised for each level; [`dispatch`] runs the version for the best level of the CPU. Results are bit-identical on all
//! levels, since no level contracts or reorders floating-point operations.

#![allow(unsafe_code)]

mod boxes;
mod cache_line;
#[cfg(target_arch = "aarch64")]
mod neon;
mod wide;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use boxes::{BoxRay, Entry, Planes, ShearedLine, map_each};
pub use cache_line::{
    Claim, Claims, Line, Table, append_claims, prefer_huge_pages, prefetch_element, prefetch_lines,
    reserve_on_huge_pages,
};
pub use wide::{Lanes, LanesKernel};
pub use wide::{ScalarWide, WIDEN, Wide, WideKernel};

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// Instruction sets that kernels are compiled for on the target architecture, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// The baseline of the target; the only level of other architectures.
    Scalar,
    /// AVX2 and FMA (x86-64-v3).
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, VL, DQ, BW, CD (x86-64-v4).
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// NEON, which every AArch64 CPU has. It is part of the baseline, so auto-vectorised loops are the same on both levels;
    /// this one adds the intrinsics of [`Wide`] and [`Lanes`].
    #[cfg(target_arch = "aarch64")]
    Neon,
}

impl Level {
    /// All levels of the architecture, slowest first.
    #[cfg(target_arch = "x86_64")]
    pub const ALL: [Level; 3] = [Level::Scalar, Level::Avx2, Level::Avx512];
    /// All levels of the architecture, slowest first.
    #[cfg(target_arch = "aarch64")]
    pub const ALL: [Level; 2] = [Level::Scalar, Level::Neon];
    /// All levels of the architecture, slowest first.
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    pub const ALL: [Level; 1] = [Level::Scalar];

    /// The highest level of the architecture: no limit.
    pub const HIGHEST: Level = Level::ALL[Level::ALL.len() - 1];

    /// The name in reports and options.
    pub fn name(self) -> &'static str {
        match self {
            Level::Scalar => "scalar",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => "avx512",
            #[cfg(target_arch = "aarch64")]
            Level::Neon => "neon",
        }
    }

    /// Does this CPU support it (regardless of [`limit_level`])?
    pub fn is_available(self) -> bool {
        self <= detected_level()
    }
}

/// The best level of this CPU.
#[inline]
fn detected_level() -> Level {
    static BEST: OnceLock<Level> = OnceLock::new();
    *BEST.get_or_init(detect)
}

/// The best level of this CPU within [`limit_level`].
#[inline]
pub fn best_level() -> Level {
    let detected = detected_level();
    if LIMIT.load(Ordering::Relaxed) < detected as u8 { limit() } else { detected }
}

/// The discriminant of the highest level in use.
static LIMIT: AtomicU8 = AtomicU8::new(Level::HIGHEST as u8);

#[cold]
fn limit() -> Level {
    Level::ALL[usize::from(LIMIT.load(Ordering::Relaxed))]
}

/// Limits the CPU level of the whole process, for tests and measurements.
pub fn limit_level(level: Level) {
    LIMIT.store(level as u8, Ordering::Relaxed);
}

#[cfg(target_arch = "x86_64")]
fn detect() -> Level {
    let v3 = is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt");
    let v4 = v3
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512cd");
    match (v3, v4) {
        (_, true) => Level::Avx512,
        (true, _) => Level::Avx2,
        _ => Level::Scalar,
    }
}

/// NEON is part of the architecture. (Lane order equals memory order on little-endian targets only.)
#[cfg(target_arch = "aarch64")]
fn detect() -> Level {
    if cfg!(target_endian = "little") { Level::Neon } else { Level::Scalar }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn detect() -> Level {
    Level::Scalar
}

/// A loop that is compiled once per CPU level.
pub trait Kernel {
    /// The result.
    type Output;
    /// Runs the loop. Implementations, and all functions that it calls, must be `#[inline(always)]`.
    fn run(self) -> Self::Output;
}

/// Runs a kernel compiled for the best level of this CPU.
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    dispatch_at(best_level(), kernel)
}

/// Runs a kernel compiled for a level, or for the best available one below it.
#[inline]
pub fn dispatch_at<K: Kernel>(level: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    match level.min(best_level()) {
        // SAFETY: `best_level` detected every feature that `run_avx512` is compiled with.
        Level::Avx512 => return unsafe { run_avx512(kernel) },
        // SAFETY: as above, for `run_avx2`.
        Level::Avx2 => return unsafe { run_avx2(kernel) },
        Level::Scalar => {}
    }
    let _ = level;
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512cd,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// Runs a vector kernel compiled for a level, or for the best available one below it.
#[inline]
pub fn dispatch_wide_at<K: WideKernel>(level: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    match level.min(best_level()) {
        // SAFETY: `best_level` detected every feature that `run_wide_avx512` is compiled with.
        Level::Avx512 => return unsafe { run_wide_avx512(kernel) },
        // SAFETY: as above, for `run_wide_avx2`.
        Level::Avx2 => return unsafe { run_wide_avx2(kernel) },
        Level::Scalar => {}
    }
    #[cfg(target_arch = "aarch64")]
    if level.min(best_level()) == Level::Neon {
        // SAFETY: `best_level` detected NEON, which is part of the AArch64 baseline.
        return kernel.run(unsafe { neon::Neon::new() });
    }
    let _ = level;
    kernel.run(ScalarWide)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512cd,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_wide_avx512<K: WideKernel>(kernel: K) -> K::Output {
    // SAFETY: this function runs only on CPUs that have its features.
    kernel.run(unsafe { x86::X86::<true>::new() })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_wide_avx2<K: WideKernel>(kernel: K) -> K::Output {
    // SAFETY: as above.
    kernel.run(unsafe { x86::X86::<false>::new() })
}

/// Runs a kernel of sixteen lanes compiled for the best level of this CPU.
#[inline]
pub fn dispatch_lanes<K: LanesKernel>(kernel: K) -> K::Output {
    dispatch_lanes_at(best_level(), kernel)
}

/// Runs a kernel of sixteen lanes compiled for a level, or for the best available one below it.
#[inline]
pub fn dispatch_lanes_at<K: LanesKernel>(level: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    match level.min(best_level()) {
        // SAFETY: `best_level` detected every feature that `run_lanes_avx512` is compiled with.
        Level::Avx512 => return unsafe { run_lanes_avx512(kernel) },
        // SAFETY: as above, for `run_lanes_avx2`.
        Level::Avx2 => return unsafe { run_lanes_avx2(kernel) },
        Level::Scalar => {}
    }
    #[cfg(target_arch = "aarch64")]
    if level.min(best_level()) == Level::Neon {
        // SAFETY: `best_level` detected NEON, which is part of the AArch64 baseline.
        return kernel.run(unsafe { neon::NeonLanes::new() });
    }
    let _ = level;
    kernel.run(wide::ScalarLanes)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512cd,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_lanes_avx512<K: LanesKernel>(kernel: K) -> K::Output {
    // SAFETY: this function runs only on CPUs that have its features.
    kernel.run(unsafe { x86::Avx512::new() })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_lanes_avx2<K: LanesKernel>(kernel: K) -> K::Output {
    // SAFETY: as above.
    kernel.run(unsafe { x86::Avx2::new() })
}

#[cfg(test)]
mod tests {
    // Lanes index several arrays at once.
    #![allow(clippy::needless_range_loop)]

    use super::*;

    /// A pseudo-random number generator for tests (PCG, O'Neill 2014).
    struct Rng(u64);
    impl Rng {
        fn bits(&mut self) -> u32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
            x.rotate_right((self.0 >> 59) as u32)
        }
        fn signed(&mut self) -> f32 {
            (self.bits() >> 8) as f32 / 8_388_608.0 - 1.0
        }
        /// Sometimes a special value.
        fn number(&mut self, special: bool) -> f32 {
            const SPECIAL: [f32; 12] = [
                0.0,
                -0.0,
                1.0,
                f32::INFINITY,
                f32::NEG_INFINITY,
                f32::NAN,
                f32::MIN_POSITIVE,
                -1e-40,
                f32::MAX,
                -1e19,
                3e-20,
                0.5,
            ];
            let which = self.bits() as usize % 96;
            if special && which < SPECIAL.len() { SPECIAL[which] } else { self.signed() }
        }
        fn vector(&mut self) -> [f32; 3] {
            [self.signed(), self.signed(), self.signed()]
        }
        /// A direction whose largest component lies in [1, 2), sometimes with zeros.
        fn direction(&mut self) -> [f32; 3] {
            let mut d = self.vector();
            if self.bits().is_multiple_of(4) {
                d[self.bits() as usize % 3] = 0.0;
            }
            d[self.bits() as usize % 3] = (1.0 + self.signed().abs() * 0.99).copysign(self.signed());
            d
        }
    }

    fn ray(rng: &mut Rng) -> (BoxRay, [f32; 3], [f32; 3]) {
        let (origin, direction) = (rng.vector(), rng.direction());
        let mut boxes = BoxRay::NONE;
        boxes.set(origin, direction, 2.0);
        (boxes, origin, direction)
    }

    /// Runs a test on each level.
    fn on_all_levels<T: WideKernel<Output = ()>>(test: impl Fn(&'static str) -> T) {
        for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
            dispatch_wide_at(level, test(level.name()));
        }
    }

    struct Boxes(&'static str);
    impl WideKernel for Boxes {
        type Output = ();
        #[inline(always)]
        fn run<W: Wide>(self, w: W) {
            let (mut rng, mut hits, mut misses) = (Rng(1), 0, 0);
            for _ in 0..4000 {
                let (ray, origin, direction) = ray(&mut rng);
                let mut planes = Planes::default();
                for lane in 0..8 {
                    for axis in 0..3 {
                        let (a, b) = (rng.signed(), rng.signed());
                        (planes[2 * axis][lane], planes[2 * axis + 1][lane]) = (a.min(b), a.max(b));
                    }
                }
                // The last box is empty, the one before it infinite.
                for plane in 0..6 {
                    let sign = if plane % 2 == 0 { 1.0 } else { -1.0 };
                    (planes[plane][7], planes[plane][6]) = (sign * f32::INFINITY, -sign * f32::INFINITY);
                }
                let (mask, _) = w.boxes(&planes, &ray, 0.0, 10.0);
                assert_eq!(mask >> 6, 1, "{}", self.0);
                for lane in 0..6 {
                    let (mut near, mut far, mut scale) = (0.0f64, 10.0f64, 1.0f64);
                    for axis in 0..3 {
                        let at = |p: f32| f64::from(p - origin[axis]) / f64::from(direction[axis]);
                        let (a, b) = (at(planes[2 * axis][lane]), at(planes[2 * axis + 1][lane]));
                        let is_inside = planes[2 * axis][lane] <= origin[axis]
                            && origin[axis] <= planes[2 * axis + 1][lane];
                        if direction[axis] == 0.0 {
                            near = if is_inside { near } else { f64::INFINITY };
                        } else {
                            (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
                            scale = scale.max(1.0 / f64::from(direction[axis]).abs());
                        }
                    }
                    let is_hit = mask >> lane & 1 == 1;
                    assert!(is_hit || near > far, "{}: {near} {far}", self.0);
                    assert!(!is_hit || near <= far + 1e-5 * scale, "{}: {near} {far}", self.0);
                    hits += u32::from(is_hit);
                    misses += u32::from(!is_hit);
                }
            }
            assert!(hits > 1000 && misses > 1000, "{hits} {misses}");
        }
    }

    #[test]
    fn box_test_is_conservative_and_tight() {
        on_all_levels(Boxes);
    }

    struct OffsetsThatOverflow(&'static str);
    impl WideKernel for OffsetsThatOverflow {
        type Output = ();
        #[inline(always)]
        fn run<W: Wide>(self, w: W) {
            // Along y, and so far from the coordinates' origin that the error bounds of x and z are infinite: boxes that the
            // ray intersects along y alone.
            let mut ray = BoxRay::NONE;
            ray.set([1e30, -4.0, -1e30], [0.0, 1.0, 0.0], 2.0);
            let mut planes = [[0.0; 8]; 6];
            planes[3] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
            let (mask, near) = w.boxes(&planes, &ray, 0.0, 100.0);
            assert_eq!(mask, 255, "{}", self.0);
            let mut entries = [Entry { reference: 9, distance: 9.0 }; 8];
            w.store_sorted(mask, near, &[0; 8], &mut entries);
            assert!(entries.iter().all(|e| (e.distance - 4.0).abs() < 1e-5), "{}: {entries:?}", self.0);
        }
    }

    #[test]
    fn axes_with_unbounded_error_are_accepted() {
        on_all_levels(OffsetsThatOverflow);
    }

    struct Stores(&'static str);
    impl WideKernel for Stores {
        type Output = ();
        #[inline(always)]
        fn run<W: Wide>(self, w: W) {
            let mut rng = Rng(2);
            // A ray along x from the origin, and boxes unbounded along y and z: the entry distance is the first plane, exactly.
            let mut ray = BoxRay::NONE;
            ray.set([0.0; 3], [1.0, 0.0, 0.0], 1.0);
            for i in 0..256 * 40 {
                let mask = i % 256;
                let mut planes = [[f32::NEG_INFINITY; 8], [f32::INFINITY; 8]].repeat(3);
                for (lane, distance) in planes[0].iter_mut().enumerate() {
                    // Zeros, values that differ in their last bits only, duplicates.
                    *distance = match rng.bits() % 4 {
                        0 => 0.0,
                        1 => f32::from_bits(0x3f80_0000 + rng.bits() % 16),
                        2 => (lane / 3) as f32,
                        _ => rng.signed().abs() * 1e6,
                    };
                }
                let planes: &Planes = planes.first_chunk().expect("six");
                let child = [(); 8].map(|()| rng.bits());
                let (all, near) = w.boxes(planes, &ray, 0.0, f32::MAX);
                assert_eq!(all, 255, "{}", self.0);
                let untouched = [Entry { reference: 0, distance: 0.0 }; 8];
                let (mut entries, mut expected) = (untouched, untouched);
                w.store_sorted(mask, near, &child, &mut entries);
                ScalarWide.store_sorted(mask, planes[0], &child, &mut expected);
                let bits = |e: &Entry| (e.reference, e.distance.to_bits());
                for k in 0..mask.count_ones() as usize {
                    assert_eq!(bits(&entries[k]), bits(&expected[k]), "{} {mask:b} {planes:?}", self.0);
                }
                w.store_masked(mask, &child, &mut entries);
                let lanes = (0..8).filter(|lane| mask >> lane & 1 == 1);
                assert!(
                    lanes.zip(&entries).all(|(lane, e)| e.reference == child[lane]),
                    "{} {mask:b}",
                    self.0
                );
            }
        }
    }

    #[test]
    fn children_are_stored_in_the_order_of_the_scalar_reference() {
        on_all_levels(Stores);
    }

    fn packet(rng: &mut Rng, special: bool) -> [[f32; 4]; 12] {
        [(); 12].map(|()| [(); 4].map(|()| rng.number(special)))
    }

    fn line(rng: &mut Rng) -> (BoxRay, ShearedLine, [f32; 3], [f32; 3]) {
        let (boxes, origin, direction) = ray(rng);
        (boxes, ShearedLine::new(origin, direction), origin, direction)
    }

    struct Packets(&'static str);
    impl WideKernel for Packets {
        type Output = ();
        #[inline(always)]
        fn run<W: Wide>(self, w: W) {
            let (mut rng, mut hits, mut ahead) = (Rng(3), 0, 0);
            for i in 0..60_000u32 {
                let special = i % 2 == 1;
                let mut rows = packet(&mut rng, special);
                let (boxes, line, origin, direction) = line(&mut rng);
                let [kx, ky, kz] = line.axes();
                if i % 3 == 0 {
                    // The line passes through a vertex of each triangle, where edge functions are zero.
                    for lane in 0..4 {
                        for axis in [kx, ky, kz] {
                            rows[4 * axis][lane] =
                                origin[axis] + if i % 2 == 0 { 0.0 } else { direction[axis] };
                        }
                    }
                }
                let lanes = w.candidates(&rows, &boxes, &origin, &line.shear);
                let expected = ScalarWide.candidates(&rows, &boxes, &origin, &line.shear);
                // x86 may accept triangles with a NaN edge function; the exact test rejects them.
                assert_eq!(lanes & expected, expected, "{} {rows:?}", self.0);
                assert!(special || lanes == expected, "{} {rows:?}", self.0);
                assert!(self.0 != "neon" || lanes == expected, "{} {rows:?}", self.0);
                hits += lanes.count_ones();

                let (row, number) = (rows[i as usize % 12], rows[i as usize % 12][i as usize % 4].to_bits());
                assert_eq!(w.equal(&row, number), ScalarWide.equal(&row, number), "{} {row:?}", self.0);

                let requested = if i % 5 == 0 { u32::MAX } else { rng.bits() & 15 };
                let t = w.plane_parameters(&rows, &origin, &direction, requested);
                let expected = ScalarWide.plane_parameters(&rows, &origin, &direction, requested);
                for lane in (0..4).filter(|lane| requested >> lane & 1 == 1) {
                    let (a, b) = (t[lane], expected[lane]);
                    let is_same =
                        a.to_bits() == b.to_bits() || (a.is_nan() && (b.is_nan() || b.is_sign_negative()));
                    assert!(is_same, "{}: {t:?} {expected:?}", self.0);
                    ahead += u32::from(a > 0.0);
                }
            }
            assert!(hits > 10_000 && ahead > 10_000, "{hits} {ahead}");
        }
    }

    #[test]
    fn packet_tests_match_the_scalar_reference() {
        on_all_levels(Packets);
    }

    #[test]
    fn limit_level_affects_the_used_level_only() {
        assert_eq!(Level::ALL.last(), Some(&Level::HIGHEST));
        assert!(Level::ALL.is_sorted() && Level::Scalar.is_available());
        let available = |level: &Level| level.is_available();
        let before: Vec<Level> = Level::ALL.into_iter().filter(available).collect();
        limit_level(Level::Scalar);
        assert_eq!(best_level(), Level::Scalar);
        assert_eq!(Level::ALL.into_iter().filter(available).collect::<Vec<_>>(), before);
        limit_level(Level::HIGHEST);
        assert_eq!(Some(&best_level()), before.last());
    }

    /// Counts the lines copied by reallocations.
    #[test]
    fn growth_on_huge_pages_is_amortised() {
        for parts in [10, 100, 1000, 10_000] {
            let (mut lines, mut moved) = (Vec::new(), 0);
            for _ in 0..parts {
                let before = lines.capacity();
                reserve_on_huge_pages(&mut lines, 7);
                moved += if lines.capacity() == before { 0 } else { lines.len() };
                lines.resize(lines.len() + 7, Line::ZERO);
            }
            assert!(moved <= 2 * 7 * parts, "{moved} lines moved by {parts} parts");
        }
    }

    #[test]
    fn claims_are_filled_in_any_order_within_the_capacity() {
        let line = |n: usize| Line([n as u32; 16]);
        let filled = |skips: bool| {
            let mut lines = vec![line(0)];
            lines.reserve_exact(10);
            let capacity = lines.capacity();
            append_claims(&mut lines, |mut claims| {
                let first = claims.claim(2).expect("capacity");
                let second = claims.claim(capacity - 4).expect("capacity");
                assert!(claims.claim(2).is_none() && claims.claim(1).is_none());
                second.fill(&vec![line(2); capacity - 4]);
                if !skips {
                    first.fill(&[line(1); 2]);
                }
            });
            lines
        };
        let lines = filled(false);
        assert_eq!(lines[..4].iter().map(|l| l.0[3]).collect::<Vec<_>>(), [0, 1, 1, 2]);
        // An unfilled claim is uninitialised memory.
        assert_eq!(filled(true).len(), 1);
    }
}
