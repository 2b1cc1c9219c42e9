//! Metals by their measured indices of refraction.

use super::metals::METALS;
use super::wavelengths::{Curve, Wavelengths};
use crate::color::Rgb;
use std::sync::OnceLock;

/// A metal whose complex index of refraction was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metal(u8);

/// Real part and extinction coefficient.
struct Index([Curve; 2]);

fn indices() -> &'static [Index] {
    static INDICES: OnceLock<Vec<Index>> = OnceLock::new();
    INDICES.get_or_init(|| {
        let curve = |nodes: &[[f32; 3]], part: usize| {
            let nodes: Vec<_> = nodes.iter().map(|n| (f64::from(n[0]), f64::from(n[part]))).collect();
            Curve::share(&nodes)
        };
        METALS.iter().map(|(_, nodes)| Index([curve(nodes, 1), curve(nodes, 2)])).collect()
    })
}

impl Metal {
    /// The metal of a name.
    pub fn named(name: &str) -> Option<Metal> {
        METALS.iter().position(|(own, _)| *own == name).map(|i| Metal(i as u8))
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        METALS[usize::from(self.0)].0
    }

    /// Real part and extinction coefficient in the lanes of a path.
    #[inline]
    pub fn index(self, waves: &Wavelengths) -> [Rgb; 2] {
        let Index([eta, k]) = &indices()[usize::from(self.0)];
        [waves.map(|nm| eta.at(nm)), waves.map(|nm| k.at(nm))]
    }
}

#[cfg(test)]
mod tests {
    use super::super::wavelengths::rgb_of;
    use super::*;

    /// Reflectance at normal incidence in daylight, against published colours (Akenine-Moeller et al. 2018, "Real-Time Rendering",
    /// table 9.2, linear Rec. 709).
    #[test]
    fn metals_have_their_published_colours() {
        for (name, published) in [
            ("gold", [1.022, 0.782, 0.344]),
            ("copper", [0.955, 0.638, 0.538]),
            ("silver", [0.972, 0.960, 0.915]),
        ] {
            let metal = Metal::named(name).expect("a metal");
            let Index([eta, k]) = &indices()[usize::from(metal.0)];
            let found = rgb_of(|nm| {
                let (n, k) = (f64::from(eta.at(nm as f32)), f64::from(k.at(nm as f32)));
                ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
            });
            println!("{name}: {found:.3?}, published {published:?}");
            assert!((0..3).all(|c| (found[c] - published[c]).abs() < 0.002), "{name}: {found:?}");
            assert_eq!(metal.name(), name);
        }
        assert_eq!(Metal::named("kryptonite"), None);
    }
}
