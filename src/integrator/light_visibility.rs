//! Learned light selection: fractions of unoccluded light samples, by cell of position and normal and by group of lights.
//!
//! The estimates of light selection ignore occlusion, so that in a building most samples may go to lights behind walls. As in Bayesian
//! online regression (Vévoda, Kondapaneni, Křivánek 2018), fractions are learned by cell, here from the light samples of some paths before
//! the first pass. Groups are the nodes two levels below the root of the light tree, and the lights at infinity. For independent occlusion
//! with probability 1 - v, the variance is least if selection probabilities are proportional to the root of v.

use super::cells::{Grid, KeyIndices, parent};
use crate::light::{LIGHT_GROUPS, LightWeights, Receiver};
use crate::math::Vec3;

/// Target for the number of light samples of a cell.
const SAMPLES_PER_CELL: f64 = 128.0;

/// Number of light samples with which a cell counts as much as its parent.
const PRIOR: f32 = 0.25;

/// Lower bound on the fraction of unoccluded samples.
const MIN_FRACTION: f32 = 4e-4;

/// A light sample and whether its shadow ray was unoccluded; samples without a contribution count as occluded.
#[derive(Clone, Copy, Debug)]
pub struct LightSampleRecord {
    pub p: [f32; 3],
    /// Normal of the receiver, zero if light from both sides contributes.
    pub n: [f32; 3],
    /// Group of the light.
    pub group: u8,
    pub is_visible: bool,
}

/// Weights of groups of lights by cell.
#[derive(Clone, Debug)]
pub struct LightVisibility {
    grid: Grid,
    indices: KeyIndices,
    weights: Vec<LightWeights>,
}

/// Numbers of light samples of a cell by group: unoccluded and all.
#[derive(Clone, Copy, Debug)]
struct Counts([[f32; 2]; LIGHT_GROUPS]);

impl Counts {
    const NONE: Counts = Counts([[0.0; 2]; LIGHT_GROUPS]);

    fn add(&mut self, record: &LightSampleRecord) {
        let [visible, all] = &mut self.0[usize::from(record.group)];
        *visible += f32::from(u8::from(record.is_visible));
        *all += 1.0;
    }

    /// Fraction of unoccluded samples by group, with those of the parent cell as prior.
    fn fractions(&self, prior: &[f32; LIGHT_GROUPS]) -> [f32; LIGHT_GROUPS] {
        std::array::from_fn(|group| {
            let [visible, all] = self.0[group];
            ((visible + PRIOR * prior[group]) / (all + PRIOR)).max(MIN_FRACTION)
        })
    }

    /// The weights of light selection.
    fn weights(&self, fractions: &[f32; LIGHT_GROUPS]) -> LightWeights {
        LightWeights::new(&fractions.map(f32::sqrt), &self.0.map(|[_, all]| all))
    }

    /// Second moment of light samples, for contributions proportional to the estimates: with probabilities that were learned, and
    /// without; and the squared mean.
    fn moments(&self, fractions: &[f32; LIGHT_GROUPS]) -> [f32; 3] {
        let total: f32 = self.0.iter().map(|[_, all]| all).sum();
        let (mut root, mut plain) = (0.0, 0.0);
        for ([_, all], fraction) in self.0.iter().zip(fractions) {
            root += all / total * fraction.sqrt();
            plain += all / total * fraction;
        }
        [root * root, plain, plain * plain].map(|moment| moment * total)
    }
}

impl LightVisibility {
    /// Learns from light samples. Also returns the expected ratio of the variance of light selection with and without the weights.
    pub fn learn(records: &[LightSampleRecord]) -> Option<(LightVisibility, f32)> {
        let places: Vec<[Vec3; 2]> =
            records.iter().map(|record| [record.p.into(), record.n.into()]).collect();
        let grid = Grid::suited_to(&places, places.len() as f64, SAMPLES_PER_CELL)?;
        let counted = |key: &dyn Fn(u64) -> u64| {
            let (mut indices, mut cells) = (KeyIndices::default(), Vec::<(u64, Counts)>::new());
            for record in records {
                let key = key(grid.key(Vec3::from_array(record.p), Vec3::from_array(record.n)));
                let index = indices.insert(key) as usize;
                if index == cells.len() {
                    cells.push((key, Counts::NONE));
                }
                cells[index].1.add(record);
            }
            (indices, cells)
        };
        let (mut indices, cells) = counted(&|key| key);
        let (of_parents, parents) = counted(&parent);
        let unknown = [1.0; LIGHT_GROUPS];
        let fractions: Vec<[f32; LIGHT_GROUPS]> =
            parents.iter().map(|(_, counts)| counts.fractions(&unknown)).collect();
        let (mut weights, mut moments) = (Vec::new(), [0.0; 3]);
        for (key, counts) in &cells {
            let prior = of_parents.get(parent(*key)).map_or(&unknown, |index| &fractions[index as usize]);
            let of_cell = counts.fractions(prior);
            let of_cell_moments = counts.moments(&of_cell);
            (0..3).for_each(|k| moments[k] += of_cell_moments[k]);
            weights.push(counts.weights(&of_cell));
        }
        for ((key, counts), of_parent) in parents.iter().zip(&fractions) {
            indices.insert(*key);
            weights.push(counts.weights(of_parent));
        }
        let [learned, plain, square] = moments;
        let ratio = (learned - square) / (plain - square);
        Some((LightVisibility { grid, indices, weights }, if ratio < 1.0 { ratio } else { 1.0 }))
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.weights.len()
    }

    /// The weights at a point; `None` far from all light samples.
    #[inline(never)]
    fn at(&self, p: Vec3, n: Vec3) -> Option<&LightWeights> {
        let key = self.grid.key(p, n);
        let index = self.indices.get(key).or_else(|| self.indices.get(parent(key)))?;
        self.weights.get(index as usize)
    }

    /// A receiver with the weights at its point.
    #[inline(always)]
    pub fn receiver(visibility: Option<&LightVisibility>, p: Vec3, normal: Vec3) -> Receiver<'_> {
        match visibility {
            None => Receiver::new(p, normal),
            Some(visibility) => Receiver { p, normal, weights: visibility.at(p, normal) },
        }
    }
}
