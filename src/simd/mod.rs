//! CPU levels and dispatch to code compiled for them: the only home of `unsafe`.
//!
//! A loop written once runs compiled for the best level that the CPU has: put it in a [`Kernel`] whose `run` is
//! `#[inline(always)]` (and calls only `#[inline(always)]` functions) and hand it to [`dispatch`]. The compiler
//! vectorises it for each level. Results are the same bit for bit on all levels, since no level contracts or reorders
//! floating-point operations.

#![allow(unsafe_code)]

mod block;
mod cache_line;
#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(test)]
mod tests;
mod wide;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use block::{BlockQuery, BoxRay, Entry, Planes, ShearedLine, TriangleBlock, map_each};
pub use cache_line::{
    Claim, Claims, Line, Table, append_claims, prefer_huge_pages, prefetch_element, prefetch_lines,
    reserve_on_huge_pages,
};
pub use wide::{Lanes, LanesKernel};
pub use wide::{ScalarWide, WIDEN, Wide, WideKernel};

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// Instruction sets that kernels are compiled for, in ascending order, for the architecture of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// The baseline of the target; on architectures without levels of their own the only one.
    Scalar,
    /// AVX2 and FMA (x86-64-v3).
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, VL, DQ, BW, CD (x86-64-v4).
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// NEON, four wide, which every AArch64 CPU has. The baseline has it too, so loops that the compiler vectorises are
    /// the same on both levels; what this one adds are the vectors of traversal.
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

    /// The highest level of the architecture: as a limit, none.
    pub const HIGHEST: Level = Level::ALL[Level::ALL.len() - 1];

    /// The name used in reports and options.
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

    /// Does this CPU support it? (Whatever [`limit_level`] allows.)
    pub fn is_available(self) -> bool {
        self <= detected_level()
    }
}

/// The best level that this CPU has.
#[inline]
fn detected_level() -> Level {
    static BEST: OnceLock<Level> = OnceLock::new();
    *BEST.get_or_init(detect)
}

/// The best level that this CPU has (and that [`limit_level`] allows).
#[inline]
pub fn best_level() -> Level {
    let detected = detected_level();
    if LIMITED.load(Ordering::Relaxed) < detected as u8 { limit() } else { detected }
}

/// The highest level in use, as a number.
static LIMITED: AtomicU8 = AtomicU8::new(Level::HIGHEST as u8);

#[cold]
fn limit() -> Level {
    Level::ALL[usize::from(LIMITED.load(Ordering::Relaxed))]
}

/// Limits the CPU level of the whole process: for tests and measurements.
pub fn limit_level(level: Level) {
    LIMITED.store(level as u8, Ordering::Relaxed);
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

/// NEON belongs to the architecture. (Its lanes are numbered as they lie in memory, which they do in little-endian memory
/// alone.)
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
    /// What it returns.
    type Output;
    /// Runs it. Mark the implementation, and all that it calls in its loops, `#[inline(always)]`.
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
        // SAFETY: `best_level` saw that the CPU has every feature that `run_avx512` is compiled with.
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
        // SAFETY: `best_level` saw that the CPU has every feature that `run_wide_avx512` is compiled with.
        Level::Avx512 => return unsafe { run_wide_avx512(kernel) },
        // SAFETY: as above, for `run_wide_avx2`.
        Level::Avx2 => return unsafe { run_wide_avx2(kernel) },
        Level::Scalar => {}
    }
    #[cfg(target_arch = "aarch64")]
    if level.min(best_level()) == Level::Neon {
        // SAFETY: `best_level` saw that the CPU has NEON, which is what the whole program is compiled with.
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
        // SAFETY: `best_level` saw that the CPU has every feature that `run_lanes_avx512` is compiled with.
        Level::Avx512 => return unsafe { run_lanes_avx512(kernel) },
        // SAFETY: as above, for `run_lanes_avx2`.
        Level::Avx2 => return unsafe { run_lanes_avx2(kernel) },
        Level::Scalar => {}
    }
    #[cfg(target_arch = "aarch64")]
    if level.min(best_level()) == Level::Neon {
        // SAFETY: `best_level` saw that the CPU has NEON, which is what the whole program is compiled with.
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
