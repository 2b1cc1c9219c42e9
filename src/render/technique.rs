//! How the samples of a picture are taken: what the first pass decides.

use super::options::{PathReuse, RenderOptions, Splitting};
use crate::compile::CompiledScene;
use crate::error::Warning;
use crate::integrator::reuse::GroupShape;

/// How paths are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Technique {
    /// Each alone, with so many paths from the first surface of each sample on.
    Alone {
        /// A power of two.
        branches: u32,
    },
    /// Shared in groups of pixels.
    Shared(GroupShape),
}

impl Technique {
    /// Each path alone.
    pub const PLAIN: Technique = Technique::Alone { branches: 1 };

    /// In which groups pixels share paths, if they do.
    pub fn shape(self) -> Option<GroupShape> {
        match self {
            Technique::Alone { .. } => None,
            Technique::Shared(shape) => Some(shape),
        }
    }

    /// Paths that go on from the first surface of each sample.
    pub fn branches(self) -> u32 {
        match self {
            Technique::Alone { branches } => branches,
            Technique::Shared(_) => 1,
        }
    }
}

/// Which techniques are still to be tried, and which one holds until then.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    pub now: Technique,
    pub may_share: bool,
    pub may_split: bool,
}

/// Are there surfaces that some paths pass, by chance?
fn has_random_surfaces(scene: &CompiledScene) -> bool {
    scene.materials.iter().any(|material| material.alpha.is_some() || material.passes_straight)
}

impl Choice {
    /// What the options leave open.
    pub fn new(scene: &CompiledScene, options: &RenderOptions) -> Choice {
        // Surfaces that are absent at random let visibility be known at random only.
        // Connections would have to cross media that scatter.
        // They would not know the kinds of rays that they stand for, and what one path found may stand elsewhere at
        // another's time.
        // Paths of other wavelengths have found something else.
        let is_rgb = !scene.shading.spectral;
        let is_plain =
            is_rgb && !has_random_surfaces(scene) && !scene.features.scattering && !scene.is_moving();
        let can_share = is_plain && !scene.features.ray_kinds && !options.catchers && options.max_depth >= 2;
        let branches = match options.splitting {
            Splitting::Into(branches) if options.max_depth >= 1 && !options.catchers => branches,
            _ => 1,
        };
        let open = Choice {
            now: Technique::Alone { branches },
            may_share: can_share
                && options.path_reuse == PathReuse::Auto
                && matches!(options.splitting, Splitting::Auto | Splitting::OFF),
            may_split: options.max_depth >= 1 && options.splitting == Splitting::Auto && !options.catchers,
        };
        match options.path_reuse {
            PathReuse::Groups(shape) if can_share => Choice::decided(Technique::Shared(shape)),
            _ => open,
        }
    }

    /// Is anything still to be tried?
    pub fn is_open(self) -> bool {
        self.may_share || self.may_split
    }

    /// Nothing is open any more.
    pub fn decided(now: Technique) -> Choice {
        Choice { now, may_share: false, may_split: false }
    }

    /// What is said where paths were to be shared and are not.
    pub fn warning(self, scene: &CompiledScene, options: &RenderOptions) -> Option<Warning> {
        let is_refused = matches!(options.path_reuse, PathReuse::Groups(_)) && self.now.shape().is_none();
        let reason = if scene.shading.spectral {
            "they carry wavelengths of their own"
        } else if has_random_surfaces(scene) {
            "the scene has surfaces that are partly transparent"
        } else if scene.features.scattering {
            "the scene has media that scatter"
        } else if options.catchers {
            "the scene has shadow catchers"
        } else if scene.features.links {
            "lights of the scene are linked to some objects only"
        } else if scene.features.ray_kinds {
            "objects or lights of the scene are visible to some kinds of rays only"
        } else if scene.is_moving() {
            "something moves in the scene"
        } else {
            "there is no indirect light with so few bounces"
        };
        is_refused.then(|| Warning::general(format!("paths are not shared between pixels: {reason}")))
    }
}
