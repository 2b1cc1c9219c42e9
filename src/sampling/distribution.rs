//! Distributions over indices by an alias table.

/// One entry of an [`AliasTable`].
#[derive(Clone, Copy, Debug)]
struct AliasEntry {
    /// Probability to stay.
    threshold: f32,
    /// Where to go otherwise.
    alias: u32,
    /// Probability of this index.
    pdf_discrete: f32,
}

/// An index with the random number that is left after choosing it.
#[derive(Clone, Copy, Debug)]
pub struct DiscreteSample {
    /// The index.
    pub index: usize,
    /// Its probability.
    pub pdf_discrete: f32,
    /// Uniform in [0, 1), independent of the index (with fewer bits than the number given).
    pub remapped: f32,
}

/// Indices with given probabilities in constant time (Walker 1974, set up as in Vose 1991).
#[derive(Clone, Debug)]
pub struct AliasTable {
    entries: Vec<AliasEntry>,
}

impl AliasTable {
    /// From weights, at least one; negative and non-finite ones count as 0. All zero gives equal probabilities.
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

    /// Probability of an index.
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
        assert_eq!(AliasTable::new(&[]).sample(0.5).index, 0);
    }
}
