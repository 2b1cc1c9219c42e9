//! Textures of others: constants of constants, mixes, and an end to circles.

use super::compiled::Compiled;
use crate::scene::MOST_NESTED_TEXTURES;

/// A checker of two equal constants is a constant, and so is a mix of constants.
pub(super) fn fold_constants(textures: &mut [Compiled]) {
    for _ in 0..MOST_NESTED_TEXTURES {
        for i in 0..textures.len() {
            let value = |at: u32| match textures.get(at as usize) {
                Some(Compiled::Constant(c)) => Some(*c),
                Some(_) => None,
                None => Some([0.0, 0.0, 0.0, 1.0]),
            };
            let folded = match textures[i] {
                Compiled::Checker { even, odd, .. } => value(even).filter(|even| value(odd) == Some(*even)),
                Compiled::Mix(parts) => {
                    let [a, b, factor] = parts.map(value);
                    a.zip(b).zip(factor).map(|((a, b), factor)| mixed(a, b, factor))
                }
                _ => None,
            };
            if let Some(constant) = folded {
                textures[i] = Compiled::Constant(constant);
            }
        }
    }
}

/// Mixes that contain themselves, or too many others, become black: they are followed without a bound.
pub(super) fn cut_endless_mixes(textures: &mut [Compiled]) {
    if !textures.iter().any(|texture| matches!(texture, Compiled::Mix(_))) {
        return;
    }
    let mut depths = vec![1; textures.len()];
    for _ in 0..=MOST_NESTED_TEXTURES {
        for i in 0..textures.len() {
            let depth = |part: u32| depths.get(part as usize).map_or(1, |depth: &u32| depth + 1);
            depths[i] = match textures[i] {
                Compiled::Checker { even, odd, .. } => depth(even).max(depth(odd)),
                Compiled::Mix(parts) => parts.map(depth).into_iter().max().unwrap_or(1),
                _ => 1,
            };
        }
    }
    for (texture, depth) in textures.iter_mut().zip(depths) {
        if matches!(texture, Compiled::Mix(_)) && depth > MOST_NESTED_TEXTURES {
            *texture = Compiled::Constant([0.0, 0.0, 0.0, 1.0]);
        }
    }
}

/// `a + factor (b - a)` by channel; alpha by the mean of the factor's colours.
pub(super) fn mixed(a: [f32; 4], b: [f32; 4], [red, green, blue, _]: [f32; 4]) -> [f32; 4] {
    let share = [red, green, blue, (red + green + blue) / 3.0];
    std::array::from_fn(|i| a[i] + share[i] * (b[i] - a[i]))
}
