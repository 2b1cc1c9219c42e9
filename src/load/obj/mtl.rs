//! The statements of MTL files (Wavefront, "MTL material format", and the PBR keys of Exocortex, tinyobjloader's
//! "PBR extension").

use super::lines::{Lines, Words, decoded, float};
use std::collections::BTreeMap;

/// A material as the file says; what it lacks is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mtl {
    pub name: String,
    /// Line of its `newmtl`.
    pub line: usize,
    /// Diffuse reflectance, linear.
    pub kd: Option<[f32; 3]>,
    /// Specular reflectance.
    pub ks: Option<[f32; 3]>,
    /// Emitted radiance.
    pub ke: Option<[f32; 3]>,
    /// Transmission filter.
    pub tf: Option<[f32; 3]>,
    /// Single numbers by their keyword in small letters: `ns`, `ni`, `d`, `tr`, `illum`, `pr`, `pm`, `ps`, `pc`, `pcr`,
    /// `aniso`, `anisor`.
    pub numbers: BTreeMap<&'static str, f32>,
    /// Textures by their keyword in small letters, without `map_`: `kd`, `ks`, `ke`, `d`, `bump`, `norm`, `pr`, ...
    pub maps: BTreeMap<&'static str, Map>,
}

impl Mtl {
    /// A number, if given.
    pub fn number(&self, key: &str) -> Option<f32> {
        self.numbers.get(key).copied()
    }
}

/// A texture statement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// The file's name as written.
    pub file: String,
    pub line: usize,
    /// `-o`: added to the coordinates, after `-s`.
    pub offset: [f32; 2],
    /// `-s`: factor on the coordinates.
    pub scale: [f32; 2],
    /// `-clamp on`: the border goes on outside 0..1.
    pub clamp: bool,
    /// `-bm`: factor on heights.
    pub bump: f32,
    /// `-imfchan r|g|b|m`: the channel of numbers.
    pub channel: Option<u8>,
}

const NUMBERS: [&str; 12] =
    ["ns", "ni", "d", "tr", "illum", "pr", "pm", "ps", "pc", "pcr", "aniso", "anisor"];

/// Keywords of textures in small letters, and what they are filed under.
const MAPS: [(&str, &str); 16] = [
    ("map_kd", "kd"),
    ("map_ks", "ks"),
    ("map_ke", "ke"),
    ("map_d", "d"),
    ("map_bump", "bump"),
    ("bump", "bump"),
    ("norm", "norm"),
    ("map_pr", "pr"),
    ("map_pm", "pm"),
    ("map_ps", "ps"),
    ("map_tr", "tr"),
    ("map_ns", "ns"),
    ("disp", "disp"),
    ("decal", "decal"),
    ("refl", "refl"),
    ("map_rma", "rma"),
];

/// The materials of a library, and what was ignored: line and message.
pub(super) fn parse(bytes: &[u8]) -> (Vec<Mtl>, Vec<(usize, String)>) {
    let (mut lines, mut materials, mut warnings) = (Lines::new(bytes), Vec::<Mtl>::new(), Vec::new());
    // Reading from memory doesn't fail.
    while let Ok(Some((line, text))) = lines.next() {
        let mut words = Words(text);
        let Some(keyword) = words.next() else { continue };
        let keyword = decoded(keyword).to_ascii_lowercase();
        if keyword == "newmtl" {
            let name = decoded(words.rest());
            materials.push(Mtl { name, line, ..Mtl::default() });
            continue;
        }
        let Some(material) = materials.last_mut() else {
            warnings.push((line, format!("'{keyword}' before the first 'newmtl' is ignored")));
            continue;
        };
        if let Some(message) = statement(material, line, &keyword, words) {
            warnings.push((line, format!("material '{}': {message}", material.name)));
        }
    }
    (materials, warnings)
}

/// Reads a statement into the material; a message if it is ignored.
fn statement(material: &mut Mtl, line: usize, keyword: &str, words: Words) -> Option<String> {
    let color = match keyword {
        "kd" => Some(&mut material.kd),
        "ks" => Some(&mut material.ks),
        "ke" => Some(&mut material.ke),
        "tf" => Some(&mut material.tf),
        _ => None,
    };
    let broken = || Some(format!("'{keyword}' without its numbers is ignored"));
    if let Some(slot) = color {
        *slot = rgb(words.clone());
        return if slot.is_some() { None } else { broken() };
    }
    if let Some(&name) = NUMBERS.iter().find(|n| **n == keyword) {
        // `d -halo 0.5` has an option before its number.
        let Some(value) = words.filter_map(float).last() else { return broken() };
        material.numbers.insert(name, value);
        return None;
    }
    if let Some(&(_, name)) = MAPS.iter().find(|m| m.0 == keyword) {
        let (map, ignored) = map(&decoded(words.rest()), line);
        if map.file.is_empty() {
            return Some(format!("'{keyword}' without a file name is ignored"));
        }
        // Of `map_Bump` and `bump` the first counts.
        material.maps.entry(name).or_insert(map);
        return (!ignored.is_empty()).then(|| format!("'{keyword}': {} ignored", ignored.join(", ")));
    }
    match keyword {
        // Ambient light and antialiasing mean nothing to a path tracer, sharpness nothing without `refl`.
        "ka" | "map_ka" | "sharpness" | "map_aat" => None,
        _ => Some(format!("'{keyword}' is not supported, ignored")),
    }
}

/// Three numbers, or one for grey.
fn rgb(words: Words) -> Option<[f32; 3]> {
    let values: Vec<f32> = words.map_while(float).collect();
    match values[..] {
        [r, g, b, ..] => Some([r, g, b]),
        [grey, ..] => Some([grey; 3]),
        [] => None,
    }
}

/// A texture statement behind its keyword (`-s 2 2 wood grain.png`), and the options that mean nothing here.
fn map(statement: &str, line: usize) -> (Map, Vec<String>) {
    let mut map = Map {
        file: String::new(),
        line,
        offset: [0.0; 2],
        scale: [1.0; 2],
        clamp: false,
        bump: 1.0,
        channel: None,
    };
    let mut ignored = Vec::new();
    let mut rest = statement.trim();
    while rest.starts_with('-') {
        let (option, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        // How many values follow at most; several ones are all numbers.
        let most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            "-blendu" | "-blendv" | "-bm" | "-boost" | "-cc" | "-clamp" | "-imfchan" | "-texres"
            | "-type" => 1,
            _ => break,
        };
        let (mut values, mut next) = (Vec::new(), after.trim_start());
        while values.len() < most {
            let (value, behind) = next.split_once(char::is_whitespace).unwrap_or((next, ""));
            if value.is_empty() || most > 1 && value.parse::<f32>().is_err() {
                break;
            }
            values.push(value);
            next = behind.trim_start();
        }
        rest = next;
        if !apply(&mut map, option, &values) {
            ignored.push(option.to_string());
        }
    }
    map.file = rest.to_string();
    (map, ignored)
}

/// Applies an option; false if it means nothing here.
fn apply(map: &mut Map, option: &str, values: &[&str]) -> bool {
    let number = |i: usize| values.get(i).and_then(|v| v.parse::<f32>().ok()).filter(|x| x.is_finite());
    match option {
        "-o" => map.offset = [number(0).unwrap_or(0.0), number(1).unwrap_or(0.0)],
        "-s" => map.scale = [number(0).unwrap_or(1.0), number(1).unwrap_or(1.0)],
        "-bm" => map.bump = number(0).unwrap_or(1.0),
        "-clamp" => map.clamp = values == ["on"],
        "-imfchan" => {
            map.channel = match values {
                ["r"] => Some(0),
                ["g"] => Some(1),
                ["b"] => Some(2),
                ["m"] => Some(3),
                _ => None,
            };
            return matches!(values, ["r" | "g" | "b" | "m" | "l"]);
        }
        // They steer filtering, which is the renderer's own.
        "-blendu" | "-blendv" | "-boost" | "-texres" => {}
        "-cc" => return values == ["off"],
        "-mm" => return number(0) == Some(0.0) && number(1) == Some(1.0),
        "-t" => return (0..3).all(|i| number(i).unwrap_or(0.0) == 0.0),
        _ => return false,
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_stand_before_a_name_with_blanks() {
        let (m, ignored) = map("-s 2 3 1 -o 0.5 -clamp on -bm 0.3 -imfchan g wood grain.png", 4);
        assert_eq!((m.scale, m.offset), ([2.0, 3.0], [0.5, 0.0]));
        assert!(m.clamp && m.bump == 0.3 && m.channel == Some(1) && ignored.is_empty());
        assert_eq!((m.file.as_str(), m.line), ("wood grain.png", 4));
        let (m, ignored) = map("-mm 0.1 2 -t 1 -blendu off a.png", 1);
        assert_eq!((m.file.as_str(), ignored), ("a.png", vec!["-mm".to_string(), "-t".to_string()]));
        assert_eq!(map("-o", 1).0.file, "");
        assert_eq!(map("-my-file.png", 1).0.file, "-my-file.png");
    }

    #[test]
    fn statements_fill_the_material_or_are_named() {
        let text = b"Kd 1 1 1\nnewmtl caf\xe9 au lait\nKd 0.5\nKs 1 2 3\nd -halo 0.25\nTR 0.75\nillum 2\n\
                     map_Kd\nfoo 1\nNs x\nKe spectral a.rfl\nbump a.png\nmap_Bump b.png\nKa 1 1 1\n";
        let (materials, warnings) = parse(text);
        let m = &materials[0];
        assert_eq!((m.name.as_str(), m.line), ("caf\u{e9} au lait", 2));
        assert_eq!((m.kd, m.ks, m.ke), (Some([0.5; 3]), Some([1.0, 2.0, 3.0]), None));
        assert_eq!((m.number("d"), m.number("tr"), m.number("illum")), (Some(0.25), Some(0.75), Some(2.0)));
        assert_eq!(m.maps["bump"].file, "a.png");
        let lines: Vec<usize> = warnings.iter().map(|w| w.0).collect();
        assert_eq!(lines, [1, 8, 9, 10, 11], "{warnings:?}");
    }
}
