//! Diffuse reflection of a half space by the dipole of Jensen, Marschner, Levoy, Hanrahan 2001, "A Practical Model for Subsurface
//! Light Transport": what the radius of Blender's Random Walk (Skin) means.

/// Steps of the bisection: to a part in a million.
const STEPS: usize = 40;

/// The reduced albedo from which a body counts as white, and its complement.
const WHITE: (f32, f64) = (0.995, 1e-6);

/// Reduced mean free path of a body of a colour over its diffusion length 1 / sqrt(3 sigma_a sigma_t), at an index of refraction.
pub(super) fn path_per_length(color: f32, ior: f32) -> f32 {
    let absorbed =
        if color >= WHITE.0 { WHITE.1 } else { absorbed_share(f64::from(color), extrapolation(ior)) };
    (3.0 * absorbed).sqrt() as f32
}

/// 4 A / 3 of the dipole: how far outside of an index of refraction its boundary lies, in mean free paths.
fn extrapolation(ior: f32) -> f64 {
    let eta = f64::from(ior);
    let diffuse_fresnel = -1.440 / (eta * eta) + 0.710 / eta + 0.668 + 0.0636 * eta;
    4.0 / 3.0 * (1.0 + diffuse_fresnel) / (1.0 - diffuse_fresnel)
}

/// One minus the reduced albedo of a half space that reflects a share of diffuse light.
fn absorbed_share(color: f64, extrapolation: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if reflectance(middle, extrapolation) > color { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Diffuse reflectance of a half space; it falls with what is absorbed.
fn reflectance(absorbed: f64, extrapolation: f64) -> f64 {
    let root = (3.0 * absorbed).sqrt();
    0.5 * (1.0 - absorbed) * (1.0 + (-extrapolation * root).exp()) * (-root).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_come_back() {
        for ior in [1.01, 1.4, 2.0] {
            for color in [0.05, 0.3, 0.8, 0.99] {
                let absorbed = f64::from(path_per_length(color, ior)).powi(2) / 3.0;
                let back = reflectance(absorbed, extrapolation(ior));
                assert!((back - f64::from(color)).abs() < 1e-4, "{ior} {color}: {back}");
            }
        }
    }

    /// The paths of dark bodies are long, those of white bodies short, of black ones 1 / sqrt(1/3).
    #[test]
    fn paths_shorten_with_the_color() {
        let paths = [0.0, 0.1, 0.5, 0.9, 0.999].map(|color| path_per_length(color, 1.4));
        assert!(paths.is_sorted_by(|a, b| a > b), "{paths:?}");
        assert!((paths[0] - 3.0f32.sqrt()).abs() < 1e-4, "{paths:?}");
    }
}
