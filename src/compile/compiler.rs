//! Moments of a sequence, each compiled from what it has in common with the one before.

use super::limits::check;
use super::reuse::Sources;
use super::run::compile_after;
use super::scene::{CompileOptions, CompileReport, CompiledScene, ExpectedPicture};
use super::tree::Tree;
use super::view::View;
use crate::bsdf::ShadingModel;
use crate::error::Result;
use crate::gauge::Gauge;
use crate::scene::{Camera, Scene};
use std::sync::Arc;

/// Compiles scenes, the moments of a sequence one after another. What does not change is compiled once: textures, the
/// environment, and in scenes of many triangles the world that stands still and the meshes that move in it as they are.
/// Only what moves is placed anew then, and meshes that change their shape are built. (Where something moves, pictures of
/// such scenes may differ from single ones by rounding: a single picture has all in one world.)
pub struct Compiler {
    is_sequence: bool,
    latest: Option<Arc<CompiledScene>>,
    tree: Tree,
    keeps_uv: bool,
    texture_memory: Option<u64>,
    is_free: bool,
    gauge: Gauge,
}

impl Compiler {
    /// For one moment, or for several that have nothing to do with each other.
    pub fn single() -> Compiler {
        Compiler::new(false)
    }

    /// For the moments of a sequence.
    pub fn sequence() -> Compiler {
        Compiler::new(true)
    }

    fn new(is_sequence: bool) -> Compiler {
        let (tree, gauge) = (Tree::default(), Gauge::default());
        Compiler {
            is_sequence,
            latest: None,
            tree,
            keeps_uv: false,
            texture_memory: None,
            is_free: false,
            gauge,
        }
    }

    /// Tells how far building is.
    pub fn gauge(&self) -> &Gauge {
        &self.gauge
    }

    /// Chooses how good the trees are that rays walk. Default [`Tree::Full`].
    pub fn set_tree(&mut self, tree: Tree) {
        self.tree = tree;
    }

    /// Keeps texture coordinates that no material asks for.
    pub fn keep_uv(&mut self, keeps_uv: bool) {
        self.keeps_uv = keeps_uv;
    }

    /// Limits the bytes that the images of textures take; see [`CompileOptions::texture_memory`]. Default: any number.
    pub fn set_texture_memory(&mut self, bytes: Option<u64>) {
        self.texture_memory = bytes;
    }

    /// Other cameras will look at the same scene: images of textures are kept as they are.
    pub fn expect_other_cameras(&mut self) {
        self.is_free = true;
    }

    /// Compiles a moment for a camera's picture of `width` x `height` pixels. The anchor stays where it was as long as
    /// single precision suffices for that.
    ///
    /// # Errors
    /// As for [`super::compile`], and what [`Camera::validate`] finds.
    pub fn compile(
        &mut self,
        scene: &Scene,
        shading: ShadingModel,
        camera: &Camera,
        (width, height): (u32, u32),
    ) -> Result<(Arc<CompiledScene>, CompileReport)> {
        check(scene.validate())?;
        // It need not be the scene's.
        check(camera.validate())?;
        let suits = |s: &&Arc<CompiledScene>| {
            let keeps = s.sources.as_ref().is_some_and(Sources::keep_geometry);
            keeps && !View::new(s, camera, width, height).needs_new_anchor(s)
        };
        let earlier = self.latest.take();
        let anchor = earlier.as_ref().filter(suits).map(|s| s.anchor);
        let anchor = Some(anchor.unwrap_or(camera.world_from_camera.translation));
        let (tree, keeps_uv, gauge) = (self.tree, self.keeps_uv, self.gauge.clone());
        let picture = (!self.is_free).then(|| ExpectedPicture { camera: camera.clone(), width, height });
        let texture_memory = self.texture_memory;
        let options = CompileOptions { shading, anchor, tree, keeps_uv, gauge, picture, texture_memory };
        // Who still renders the earlier moment keeps it.
        let earlier = earlier.and_then(|scene| Arc::try_unwrap(scene).ok());
        let (compiled, report) = compile_after(earlier, scene, &options, self.is_sequence)?;
        let compiled = Arc::new(compiled);
        if self.is_sequence {
            self.latest = Some(compiled.clone());
        }
        Ok((compiled, report))
    }
}
