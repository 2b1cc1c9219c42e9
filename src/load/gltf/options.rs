//! What the user may choose about a glTF asset.

/// Choices about one glTF asset; the defaults show what the file says is shown, at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfOptions {
    /// The moment of its animations, seconds; `None` shows the pose in which the file rests.
    pub time_s: Option<f64>,
    /// The scene to show, by name or number, in place of the file's default.
    pub scene: Option<String>,
    /// The node to show with all below it, by name or number, in place of a whole scene.
    pub node: Option<String>,
    /// The variant of its materials (KHR_materials_variants), by name or number.
    pub variant: Option<String>,
    /// What the numbers of its lights mean.
    pub light_units: LightUnits,
    /// What transparent materials without a volume are.
    pub glass: Glass,
    /// Go on without the extensions that the file demands and that are not supported.
    pub force: bool,
}

/// Units of the lights of KHR_lights_punctual. The file doesn't say which mode its exporter used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// What the specification says, which is also the default of Blender's exporter; spot lights in files by Blender
    /// fade as they do there.
    #[default]
    Auto,
    /// Candela and lux, turned into watts by 683 lm/W.
    Spec,
    /// Watts per steradian and per square metre (Blender's mode "Unitless").
    Compat,
    /// Watts of the whole light as Blender shows them; sun lights in watts per square metre (Blender's mode "Raw").
    Raw,
}

/// How materials with transmission and without a volume (thickness 0) are understood. Where they become solids, their
/// colour is that of light that has passed the whole body, as in Blender; the colour of solids that the file declares is
/// met at each crossing of their surface, as the specification says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Glass {
    /// Solid in files by Blender, which leaves the volume out for ordinary glass, where the meshes enclose bodies; thin
    /// where they don't, and in all other files, as the specification says. In what was exported of files of Blender here all
    /// is solid, as in Blender, but for open sheets, which bend light all the same.
    #[default]
    Auto,
    /// They refract like the surface of a solid body.
    Solid,
    /// As [`Glass::Auto`]; and flat closed meshes, the panes of windows, become single sheets, whether a volume is declared or
    /// not: light samples pass those, where a solid leaves light behind it to chance. They don't bend light and have no
    /// edges. So do the open sheets of what was exported of files of Blender.
    Panes,
    /// They are thin walls that do not refract, as the specification says.
    Thin,
}

impl GltfOptions {
    /// Finds an entry by name or number; `names` are those of all entries in order.
    ///
    /// # Errors
    /// A remedy in words that lists what there is.
    pub(super) fn find(names: &[String], wanted: &str) -> Result<usize, String> {
        const LISTED: usize = 20;
        let by_number = || wanted.parse::<usize>().ok().filter(|&i| i < names.len());
        names.iter().position(|n| n == wanted).or_else(by_number).ok_or_else(|| {
            let mut list: Vec<String> =
                names.iter().take(LISTED).enumerate().map(|(i, name)| format!("{i} '{name}'")).collect();
            if names.len() > LISTED {
                list.push(format!("and {} more", names.len() - LISTED));
            }
            if list.is_empty() { "the file has none".into() } else { format!("it has: {}", list.join(", ")) }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_before_numbers() {
        let names = ["1".to_string(), "b".to_string(), "c".to_string()];
        assert_eq!(GltfOptions::find(&names, "1"), Ok(0));
        assert_eq!(GltfOptions::find(&names, "2"), Ok(2));
        assert_eq!(GltfOptions::find(&names, "b"), Ok(1));
        let error = GltfOptions::find(&names, "3").expect_err("there is none");
        assert!(error.contains("2 'c'"), "{error}");
    }
}
