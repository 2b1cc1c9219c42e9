//! Distributions over tables: piecewise constant on 0..1 by inversion, and over indices by an alias table.

/// A density on 0..1 that is constant on `n` equal pieces.
#[derive(Clone, Debug)]
pub struct PiecewiseConstant {
    /// Density of each piece; their mean is 1.
    density: Vec<f32>,
    /// Distribution function at the left end of each piece, and 1 at the end.
    cumulative: Vec<f32>,
}

impl PiecewiseConstant {
    /// From weights, at least one; negative and non-finite ones count as 0. All zero gives the uniform density.
    pub fn new(weights: &[f32]) -> PiecewiseConstant {
        let cleaned = cleaned(weights);
        let total: f64 = cleaned.iter().sum();
        let n = cleaned.len() as f64;
        let mut sum = 0.0;
        let mut cumulative = vec![0.0];
        for w in &cleaned {
            sum += w / total;
            cumulative.push(sum.min(1.0) as f32);
        }
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        PiecewiseConstant { density: cleaned.iter().map(|w| (w * n / total) as f32).collect(), cumulative }
    }

    /// Inverts the distribution function: a position and the index of its piece.
    #[inline]
    pub fn sample(&self, u: f32) -> (f32, usize) {
        let n = self.density.len();
        let piece = (self.cumulative.partition_point(|&c| c <= u).max(1) - 1).min(n - 1);
        let (low, high) = (self.cumulative[piece], self.cumulative[piece + 1]);
        let share = (u - low) / if high > low { high - low } else { 1.0 };
        let x = (piece as f32 + share) / n as f32;
        (if x < 1.0 { x } else { 1.0f32.next_down() }, piece)
    }

    /// Density at a position in 0..1.
    #[inline]
    pub fn pdf(&self, x: f32) -> f32 {
        let n = self.density.len();
        self.density[((x * n as f32) as usize).min(n - 1)]
    }

    /// Chance of a piece.
    #[inline]
    pub fn pdf_discrete(&self, piece: usize) -> f32 {
        self.density[piece] / self.density.len() as f32
    }
}

/// One entry of an [`AliasTable`].
#[derive(Clone, Copy, Debug)]
struct AliasEntry {
    /// Chance to stay.
    threshold: f32,
    /// Where to go otherwise.
    alias: u32,
    /// Chance of this index.
    pdf_discrete: f32,
}

/// An index with the random number that is left after choosing it.
#[derive(Clone, Copy, Debug)]
pub struct DiscreteSample {
    /// The index.
    pub index: usize,
    /// Its chance.
    pub pdf_discrete: f32,
    /// Uniform in [0, 1), independent of the index (with fewer bits than the number given).
    pub remapped: f32,
}

/// Indices with given chances in constant time (Walker 1974, set up as in Vose 1991).
#[derive(Clone, Debug)]
pub struct AliasTable {
    entries: Vec<AliasEntry>,
}

impl AliasTable {
    /// From weights, at least one; negative and non-finite ones count as 0. All zero gives equal chances.
    pub fn new(weights: &[f32]) -> AliasTable {
        let cleaned = cleaned(weights);
        let total: f64 = cleaned.iter().sum();
        let n = cleaned.len();
        let mut scaled: Vec<f64> = cleaned.iter().map(|w| w / total * n as f64).collect();
        let mut entries: Vec<AliasEntry> = cleaned
            .iter()
            .enumerate()
            .map(|(i, w)| AliasEntry { threshold: 1.0, alias: i as u32, pdf_discrete: (w / total) as f32 })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| scaled[i] < 1.0);
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            entries[s].threshold = scaled[s] as f32;
            entries[s].alias = l as u32;
            scaled[l] -= 1.0 - scaled[s];
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        AliasTable { entries }
    }

    /// How many indices.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Never: a table has at least one index.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Chooses an index.
    #[inline]
    pub fn sample(&self, u: f32) -> DiscreteSample {
        let n = self.entries.len();
        let scaled = u * n as f32;
        let at = (scaled as usize).min(n - 1);
        let rest = scaled - at as f32;
        let entry = self.entries[at];
        let stays = rest < entry.threshold;
        let index = if stays { at } else { entry.alias as usize };
        let remapped = if stays {
            rest / entry.threshold
        } else {
            (rest - entry.threshold) / (1.0 - entry.threshold).max(f32::MIN_POSITIVE)
        };
        DiscreteSample {
            index,
            pdf_discrete: self.entries[index].pdf_discrete,
            remapped: remapped.min(1.0f32.next_down()),
        }
    }

    /// Chance of an index.
    #[inline]
    pub fn pdf_discrete(&self, index: usize) -> f32 {
        self.entries[index].pdf_discrete
    }
}

/// Weights as f64 without negative or non-finite values; all ones if nothing is left. Never empty.
fn cleaned(weights: &[f32]) -> Vec<f64> {
    let clean: Vec<f64> =
        weights.iter().map(|&w| if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 }).collect();
    if clean.iter().sum::<f64>() > 0.0 { clean } else { vec![1.0; weights.len().max(1)] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Chi2;

    const WEIGHTS: [f32; 7] = [0.0, 3.0, 0.1, 0.0, 5.0, 1.0, 0.0];

    #[test]
    fn piecewise_constant_passes_chi_square() {
        let d = PiecewiseConstant::new(&WEIGHTS);
        Chi2::new("piecewise constant", 1).cells(14, 4).assert(
            |u| Some([f64::from(d.sample(u[0]).0), f64::from(u[1])]),
            |p| f64::from(d.pdf(p[0] as f32)),
        );
        for u in [0.0, 0.5, 1.0f32.next_down()] {
            let (x, piece) = d.sample(u);
            assert!(d.pdf(x) > 0.0 && d.pdf_discrete(piece) > 0.0, "{u} gives {x}");
        }
    }

    #[test]
    fn alias_table_passes_chi_square_with_its_remainder() {
        let table = AliasTable::new(&WEIGHTS);
        let n = table.len() as f64;
        Chi2::new("alias table", 1).cells(7, 8).assert(
            |u| {
                let s = table.sample(u[0]);
                assert_eq!(s.pdf_discrete, table.pdf_discrete(s.index));
                Some([(s.index as f64 + 0.5) / n, f64::from(s.remapped)])
            },
            |p| f64::from(table.pdf_discrete((p[0] * n) as usize)) * n,
        );
    }

    #[test]
    fn hopeless_weights_give_equal_chances() {
        let weights = [0.0, f32::NAN, -1.0, f32::INFINITY];
        assert_eq!(AliasTable::new(&weights).pdf_discrete(2), 0.25);
        assert_eq!(PiecewiseConstant::new(&weights).pdf(0.3), 1.0);
        assert_eq!(AliasTable::new(&[]).sample(0.5).index, 0);
    }
}
