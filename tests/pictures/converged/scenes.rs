//! The scenes of `tests/references/`, and how their pictures are made; `tools/references` reads this file, too.

/// A scene with a converged reference.
pub struct Converged {
    /// Of its files: `NAME.ref.exr` and `NAME.var.exr`.
    pub name: &'static str,
    /// Arguments of `oscura render`, from the project's folder.
    pub arguments: &'static [&'static str],
    /// Samples per pixel of each of the parts that the reference is the mean of.
    pub part_samples: u32,
}

/// What all of them are rendered with: 64 x 64 pixels that share no samples, as 32-bit numbers.
pub const COMMON: &[&str] =
    &["--width", "64", "--height", "64", "--filter", "box", "--float", "--quiet", "--path-reuse", "off"];

/// Diffuse interreflection, glass, rough metal between lights, an image environment, textures, hundreds of lights. No strong
/// caustics: their fireflies are uninformative at this size.
pub const SCENES: &[Converged] = &[
    Converged {
        name: "cornell",
        arguments: &["assets/cornell-box.gltf", "--depth", "100"],
        part_samples: 2048,
    },
    Converged { name: "glass", arguments: &["scenes/thesis/glass.toml"], part_samples: 256 },
    Converged { name: "metal", arguments: &["scenes/thesis/fuzzy-metal-lights.toml"], part_samples: 256 },
    Converged {
        name: "environment",
        arguments: &["scenes/sky.toml", "--env", "scenes/textures/world-map.png"],
        part_samples: 1024,
    },
    Converged { name: "textures", arguments: &["scenes/triplanar.toml"], part_samples: 1024 },
    Converged { name: "many-lights", arguments: &["scenes/many-lights.toml"], part_samples: 512 },
];
