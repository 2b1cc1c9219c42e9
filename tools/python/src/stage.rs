//! The stage for bare models.

use super::choices;
use super::errors::usage;
use oscura::load::stage::{Background, StageOptions};
use pyo3::prelude::*;

/// The background, from Python.
#[derive(FromPyObject)]
pub enum BackgroundArgument {
    Word(String),
    Color([f32; 3]),
}

/// Stage options as strings.
pub struct Stage<'a> {
    pub stage: &'a str,
    pub ground: Option<&'a str>,
    pub background: Option<BackgroundArgument>,
    pub view_from: Option<&'a str>,
    pub zoom: f64,
    pub fov: f64,
}

impl Stage<'_> {
    /// No background colour is set that has to be displayed exactly.
    pub fn is_view_open(&self) -> bool {
        self.stage != "white" && !matches!(self.background, Some(BackgroundArgument::Color(_)))
    }

    pub fn options(self) -> PyResult<StageOptions> {
        let light = choices::stage(self.stage)?;
        if !(0.001..=1000.0).contains(&self.zoom) || !(0.1..=170.0).contains(&self.fov) {
            return Err(usage("zoom must be 0.001 to 1000 and fov 0.1 to 170 degrees"));
        }
        let background = match self.background {
            None => None,
            Some(BackgroundArgument::Color(color)) => Some(Background::Color(color)),
            Some(BackgroundArgument::Word(word)) if word == "transparent" => Some(Background::Transparent),
            Some(BackgroundArgument::Word(word)) => {
                let message = "is neither 'transparent' nor three numbers (linear red, green, blue)";
                return Err(usage(format!("background='{word}' {message}")));
            }
        };
        Ok(StageOptions {
            light,
            ground: self.ground.map(choices::ground).transpose()?,
            background,
            view: self.view_from.map(choices::view_from).transpose()?.unwrap_or_default(),
            is_view_chosen: self.view_from.is_some(),
            zoom: self.zoom,
            vfov_degrees: self.fov,
            ..StageOptions::default()
        })
    }
}
