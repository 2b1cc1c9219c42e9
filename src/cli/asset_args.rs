//! Arguments about glTF assets, the same for all commands that load them.

use clap::{Args, ValueEnum};
use oscura::load::gltf::{Glass, GltfOptions, LightUnits};

/// Units of lights.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum LightUnitsArg {
    /// As the specification says; so does Blender by default.
    #[default]
    Auto,
    /// Candela and lux, divided by 683 lm/W.
    Spec,
    /// Watts per steradian (Blender's mode Unitless).
    Compat,
    /// Watts of the whole light (Blender's mode Raw).
    Raw,
}

/// What transparent materials without a volume are.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum GlassArg {
    /// Solid in files by Blender where meshes are closed, thin else.
    #[default]
    Auto,
    /// Refracting solids.
    Solid,
    /// As auto, and flat solid panes of windows are single sheets, which light samples pass.
    Panes,
    /// Thin walls, as the specification says.
    Thin,
}

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "glTF assets")]
pub(crate) struct AssetArgs {
    /// Show animations at this moment, seconds [default: the file's rest state].
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = moment)]
    pub time: Option<f64>,
    /// Scene by name or number, from 0 [default: the file's default].
    #[arg(long = "scene", value_name = "SCENE")]
    pub scene_name: Option<String>,
    /// Show only this node, by name or number, with all below it.
    #[arg(long, value_name = "NODE")]
    pub node: Option<String>,
    /// Variant of the materials, by name or number.
    #[arg(long, value_name = "VARIANT")]
    pub variant: Option<String>,
    /// What the numbers of lights mean.
    #[arg(long, value_name = "UNITS", default_value = "auto")]
    pub light_units: LightUnitsArg,
    /// What transparent materials without a volume are.
    #[arg(long, value_name = "KIND", default_value = "auto")]
    pub glass: GlassArg,
    /// Go on without extensions that the file demands and that are not supported.
    #[arg(long)]
    pub force: bool,
}

impl AssetArgs {
    pub(crate) fn options(&self) -> GltfOptions {
        GltfOptions {
            time_s: self.time,
            scene: self.scene_name.clone(),
            node: self.node.clone(),
            variant: self.variant.clone(),
            light_units: match self.light_units {
                LightUnitsArg::Auto => LightUnits::Auto,
                LightUnitsArg::Spec => LightUnits::Spec,
                LightUnitsArg::Compat => LightUnits::Compat,
                LightUnitsArg::Raw => LightUnits::Raw,
            },
            glass: match self.glass {
                GlassArg::Auto => Glass::Auto,
                GlassArg::Solid => Glass::Solid,
                GlassArg::Panes => Glass::Panes,
                GlassArg::Thin => Glass::Thin,
            },
            force: self.force,
        }
    }
}

fn moment(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|t: &f64| t.is_finite());
    value.ok_or_else(|| "not a number of seconds".to_string())
}
