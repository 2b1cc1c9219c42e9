//! Moving pictures of turntables and sequences: GIF, APNG and video.

use super::args::RenderArgs;
use oscura::error::{Error, Result};
use oscura::film::Film;
use oscura::output::{
    Animation, AnimationFormat, PngOptions, Video, VideoFormat, check_target, write_atomically,
};
use std::path::{Path, PathBuf};

/// Does the name of a file ask for a moving picture?
pub(crate) fn is_moving(path: &Path) -> bool {
    AnimationFormat::of(path).is_some() || VideoFormat::of(path).is_some()
}

/// The files of single pictures among those that are asked for.
pub(crate) fn still(paths: &[PathBuf]) -> Vec<PathBuf> {
    paths.iter().filter(|path| !is_moving(path)).cloned().collect()
}

/// Moving pictures that are being made.
pub(super) struct MovingPictures {
    /// Frames for those that are encoded at the end.
    animation: Animation,
    animations: Vec<(PathBuf, AnimationFormat)>,
    videos: Vec<(PathBuf, Video)>,
    frames_a_second: f64,
}

impl MovingPictures {
    /// Those that the arguments ask for.
    ///
    /// # Errors
    /// If one of them can't be written, or there is no encoder for it.
    pub fn new(args: &RenderArgs) -> Result<MovingPictures> {
        let frames_a_second = args.fps;
        let (mut animations, mut videos) = (Vec::new(), Vec::new());
        for path in args.output.iter().filter(|path| is_moving(path)) {
            if args.long.resume {
                let message = "--resume leaves out frames that exist, and a moving picture takes them all";
                return Err(
                    Error::usage(format!("{}: {message}", path.display())).with_help("leave one of both out")
                );
            }
            check_target(path)?;
            animations.extend(AnimationFormat::of(path).map(|format| (path.clone(), format)));
            videos.extend(Video::new(path, frames_a_second)?.map(|video| (path.clone(), video)));
        }
        Ok(MovingPictures { animation: Animation::default(), animations, videos, frames_a_second })
    }

    /// Can they hold pictures of this size?
    ///
    /// # Errors
    /// A usage error for the first that can't.
    pub fn check_size(&self, width: u32, height: u32) -> Result<()> {
        self.videos.iter().try_for_each(|(_, video)| video.check_size(width, height))
    }

    /// Says that none of them is written, since the run ended before its last frame.
    pub fn say_unfinished(&self, args: &RenderArgs) {
        if args.quiet {
            return;
        }
        let videos = self.videos.iter().map(|(path, _)| path);
        for path in self.animations.iter().map(|(path, _)| path).chain(videos) {
            say!("{} is not written, as not all frames are there", path.display());
        }
    }

    /// Adds a picture to all of them.
    ///
    /// # Errors
    /// An output error if an encoder fails.
    pub fn add(&mut self, film: &Film, png: &PngOptions) -> Result<()> {
        if !self.animations.is_empty() {
            self.animation.add_film(film, png);
        }
        self.videos.iter_mut().try_for_each(|(_, video)| video.add_film(film, png))
    }

    /// Writes them.
    ///
    /// # Errors
    /// An output error for the first that can't be written.
    pub fn finish(self, args: &RenderArgs) -> Result<()> {
        let say = |path: &Path| {
            if !args.quiet {
                say!("wrote    {}", path.display());
            }
        };
        for (path, format) in &self.animations {
            let bytes = self.animation.encode(*format, self.frames_a_second);
            write_atomically(path, &bytes.map_err(|message| Error::output(path, message))?)?;
            say(path);
        }
        for (path, video) in self.videos {
            video.finish()?;
            say(&path);
        }
        Ok(())
    }
}
