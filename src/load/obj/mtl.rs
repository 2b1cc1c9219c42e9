//! Filter for the statements of MTL files (Wavefront, "MTL material format", and the PBR keys of Exocortex, tinyobjloader's
//! "PBR extension").
//!
//! `tobj` panics on colours of fewer than three numbers, stops at the first invalid number, has case-sensitive keywords, and
//! reports no line numbers. Therefore it gets validated statements in its own spelling, with the line number before the file
//! name of a texture.

use super::lines::{LineFilter, Words, decoded, float, parse_by_tobj};
use crate::error::Warning;
use crate::load::files;
use crate::load::words::is_utf_16;
use std::io::{Read, Seek};
use std::path::Path;

/// A material of a library, not yet converted.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    pub name: String,
    statements: tobj::Material,
}

impl Mtl {
    /// A colour by its keyword: `Kd`, `Ks`, `Ke`, `Tf`; `None` if the file lacks it.
    pub fn color(&self, key: &str) -> Option<[f32; 3]> {
        let m = &self.statements;
        match key {
            "Kd" => m.diffuse,
            "Ks" => m.specular,
            "Ke" => m.emissive,
            _ => rgb(Words(m.unknown_param.get(key)?.as_bytes())),
        }
    }

    /// A number by its keyword: `Ns`, `Ni`, `d`, `illum`, `Tr`, `Pr`, ...
    pub fn number(&self, key: &str) -> Option<f32> {
        let m = &self.statements;
        match key {
            "Ns" => m.shininess,
            "Ni" => m.optical_density,
            "d" => m.dissolve,
            "illum" => m.illumination_model.map(f32::from),
            _ => m.unknown_param.get(key)?.parse().ok(),
        }
    }

    /// A texture by its keyword: `map_Kd`, `bump`, `norm`, `map_Pr`, ...
    pub fn map(&self, key: &str) -> Option<Map> {
        let m = &self.statements;
        let field = match key {
            "map_Kd" => &m.diffuse_texture,
            "map_Ks" => &m.specular_texture,
            "map_Ns" => &m.shininess_texture,
            "map_d" => &m.dissolve_texture,
            "bump" => &m.normal_texture,
            "map_Ka" => &m.ambient_texture,
            _ => &None,
        };
        let (line, text) = field.as_ref().or_else(|| m.unknown_param.get(key))?.split_once(' ')?;
        Some(map(text, line.parse().ok()?).0)
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
    /// `-clamp on`: edge texels continue outside 0..1.
    pub clamp: bool,
    /// `-bm`: factor on heights.
    pub bump: f32,
    /// `-bm` was given.
    pub has_bump: bool,
    /// `-imfchan r|g|b|m`: channel of data textures.
    pub channel: Option<u8>,
}

/// Keywords of colours, numbers and textures in the spelling of `tobj`; case-insensitive in files.
const COLORS: [&str; 4] = ["Kd", "Ks", "Ke", "Tf"];
const NUMBERS: [&str; 12] =
    ["Ns", "Ni", "d", "Tr", "illum", "Pr", "Pm", "Ps", "Pc", "Pcr", "aniso", "anisor"];
const MAPS: [&str; 16] = [
    "map_Kd", "map_Ka", "map_Ks", "map_Ke", "map_d", "bump", "norm", "map_Pr", "map_Pm", "map_Ps", "map_Tr",
    "map_Ns", "disp", "decal", "refl", "map_RMA",
];

/// The materials of a library, with warnings about ignored statements.
///
/// # Errors
/// The error message about an unreadable file.
pub(super) fn read(path: &Path, warnings: &mut Vec<Warning>) -> Result<Vec<Mtl>, String> {
    let unreadable = |e| format!("can't be read: {e}");
    let mut file = files::open(path)?;
    let mut start = Vec::new();
    file.by_ref().take(16).read_to_end(&mut start).and_then(|_| file.rewind()).map_err(unreadable)?;
    if is_utf_16(&start) {
        return Err("is UTF-16 text; save it as UTF-8".into());
    }
    let (parsed, library) = parse_by_tobj(file, Library::default(), tobj::load_mtl_buf)?;
    let (materials, _) = parsed.map_err(|e| format!("can't be parsed: {e}"))?;
    let ignored = library.ignored.into_iter();
    warnings.extend(ignored.map(|(line, message)| Warning::new(path, format!("line {line}"), message)));
    let named = library.names.into_iter().zip(materials);
    let mut all: Vec<Mtl> = named.map(|(name, statements)| Mtl { name, statements }).collect();
    let changed = take_as_opacity(&mut all, library.is_by_meshlab);
    warnings.extend(changed.map(|message| Warning::new(path, "", message)));
    Ok(all)
}

/// `Tr` is transparency, but old versions of MeshLab and other programs write opacity. `Tr` is taken as opacity if MeshLab
/// wrote the file or all materials would be invisible. Returns a warning.
fn take_as_opacity(all: &mut [Mtl], is_by_meshlab: bool) -> Option<String> {
    let transparency = |m: &Mtl| m.number("Tr").filter(|_| m.number("d").is_none());
    let is_hidden = |m: &Mtl| transparency(m).is_some_and(|t| t >= 1.0);
    if !(is_by_meshlab || !all.is_empty() && all.iter().all(is_hidden)) {
        return None;
    }
    let mut count = 0;
    for material in all {
        let Some(opacity) = transparency(material) else { continue };
        material.statements.dissolve = Some(opacity);
        count += 1;
    }
    let why =
        if is_by_meshlab { "as MeshLab writes it" } else { "as all materials would be invisible otherwise" };
    (count > 0).then(|| format!("'Tr' of {count} materials is taken as their opacity, {why}"))
}

/// Whether a line is a comment that mentions MeshLab or its library.
fn names_meshlab(text: &[u8]) -> bool {
    let text = text.trim_ascii_start();
    text.starts_with(b"#") && {
        let text = text.to_ascii_lowercase();
        [&b"meshlab"[..], b"vcg"].iter().any(|name| text.windows(name.len()).any(|w| w == *name))
    }
}

/// Validates statements and records ignored ones.
#[derive(Default)]
struct Library {
    /// Names of materials, which may be empty.
    names: Vec<String>,
    /// Texture keywords of the current material so far.
    maps: Vec<&'static str>,
    /// Ignored statements: line and message.
    ignored: Vec<(usize, String)>,
    is_by_meshlab: bool,
}

impl LineFilter for Library {
    fn line(&mut self, line: usize, text: &[u8], out: &mut Vec<u8>) {
        let mut words = Words(text);
        let Some(keyword) = words.next() else {
            self.is_by_meshlab |= names_meshlab(text);
            return;
        };
        let keyword = decoded(keyword).to_ascii_lowercase();
        if keyword == "newmtl" {
            out.extend(format!("newmtl {}\n", self.names.len()).as_bytes());
            self.names.push(decoded(words.rest()));
            self.maps.clear();
            return;
        }
        let Some(name) = self.names.last() else {
            self.ignored.push((line, format!("'{keyword}' before the first 'newmtl' is ignored")));
            return;
        };
        match normalize(&keyword, words, line, &mut self.maps) {
            Ok((text, ignored)) => {
                out.extend(text.as_bytes());
                if !ignored.is_empty() {
                    let message = format!("material '{name}': '{keyword}': {} ignored", ignored.join(", "));
                    self.ignored.push((line, message));
                }
            }
            Err(message) => self.ignored.push((line, format!("material '{name}': {message}"))),
        }
    }
}

/// A statement in the spelling of `tobj`, and its unsupported options.
///
/// # Errors
/// A message why the statement is ignored.
fn normalize(
    keyword: &str,
    words: Words,
    line: usize,
    maps: &mut Vec<&'static str>,
) -> Result<(String, Vec<String>), String> {
    let keyword = if keyword == "map_bump" { "bump" } else { keyword };
    let canonical = |list: &[&'static str]| list.iter().copied().find(|k| k.eq_ignore_ascii_case(keyword));
    let broken = || format!("'{keyword}' without its numbers is ignored");
    if let Some(name) = canonical(&COLORS) {
        let [r, g, b] = rgb(words).ok_or_else(broken)?;
        return Ok((format!("{name} {r} {g} {b}\n"), Vec::new()));
    }
    if let Some(name) = canonical(&NUMBERS) {
        // `d -halo 0.5` has an option before its number.
        let value = words.filter_map(float).filter(|v| !v.is_nan()).last().ok_or_else(broken)?;
        // `tobj` stores `illum` as u8.
        let value = if name == "illum" { value.clamp(0.0, 255.0).floor() } else { value };
        return Ok((format!("{name} {value}\n"), Vec::new()));
    }
    match (canonical(&MAPS), keyword) {
        // Of `map_Bump` and `bump` the first is used.
        (Some(name), _) if maps.contains(&name) => Ok(Default::default()),
        (Some(name), _) => {
            let text = decoded(words.rest());
            let (map, ignored) = map(&text, line);
            if map.file.is_empty() {
                return Err(format!("'{keyword}' without a file name is ignored"));
            }
            maps.push(name);
            Ok((format!("{name} {line} {text}\n"), ignored))
        }
        // Without effect in a path tracer: ambient light, antialiasing, sharpness (of `refl`).
        (None, "ka" | "sharpness" | "map_aat") => Ok(Default::default()),
        (None, _) => Err(format!("'{keyword}' is not supported: ignored")),
    }
}

/// Values of `-colorspace` that match the defaults: sRGB for colours, linear for data.
const COLOR_SPACES: [&str; 4] = ["srgb", "srgb_texture", "auto", "raw"];

/// Three numbers, or one for grey.
fn rgb(words: Words) -> Option<[f32; 3]> {
    let values: Vec<f32> = words.map_while(float).collect();
    match values[..] {
        [r, g, b, ..] => Some([r, g, b]),
        [grey, ..] => Some([grey; 3]),
        [] => None,
    }
}

/// A texture statement after its keyword (`-s 2 2 wood grain.png`), and its unsupported options.
fn map(statement: &str, line: usize) -> (Map, Vec<String>) {
    let mut map = Map {
        file: String::new(),
        line,
        offset: [0.0; 2],
        scale: [1.0; 2],
        clamp: false,
        bump: 1.0,
        has_bump: false,
        channel: None,
    };
    let mut ignored = Vec::new();
    let rest = options(&mut map, statement.trim(), &mut ignored);
    // Some exporters write options after the name.
    let behind = rest.match_indices(" -").map(|(at, _)| rest.split_at(at));
    let mut split = behind.filter_map(|(name, tail)| {
        let (mut changed, mut ignored) = (map.clone(), Vec::new());
        let is_complete = options(&mut changed, tail.trim(), &mut ignored).is_empty();
        is_complete.then_some((name, changed, ignored))
    });
    let (name, changed, more) = split.next().unwrap_or((rest, map.clone(), Vec::new()));
    ignored.extend(more);
    (Map { file: name.trim_end().to_string(), ..changed }, ignored)
}

/// Applies the options at the start of a text and records unsupported ones; returns the remaining text.
fn options<'t>(map: &mut Map, text: &'t str, ignored: &mut Vec<String>) -> &'t str {
    let mut rest = text;
    while rest.starts_with('-') {
        let (option, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        // Maximum number of values; options with several values have numbers only.
        let max_values = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            "-blendu" | "-blendv" | "-bm" | "-boost" | "-cc" | "-clamp" | "-colorspace" | "-imfchan"
            | "-texres" | "-type" => 1,
            _ => break,
        };
        let (mut values, mut next) = (Vec::new(), after.trim_start());
        while values.len() < max_values {
            let (value, behind) = next.split_once(char::is_whitespace).unwrap_or((next, ""));
            if value.is_empty() || max_values > 1 && value.parse::<f32>().is_err() {
                break;
            }
            values.push(value);
            next = behind.trim_start();
        }
        rest = next;
        if !apply(map, option, &values) {
            ignored.push(option.to_string());
        }
    }
    rest
}

/// Applies an option; false if it is not supported.
fn apply(map: &mut Map, option: &str, values: &[&str]) -> bool {
    let number = |i: usize| values.get(i).and_then(|v| v.parse::<f32>().ok()).filter(|x| x.is_finite());
    match option {
        "-o" | "-s" | "-bm" if number(0).is_none() => return false,
        "-o" => map.offset = [number(0).unwrap_or(0.0), number(1).unwrap_or(0.0)],
        "-s" => map.scale = [number(0).unwrap_or(1.0), number(1).unwrap_or(1.0)],
        "-bm" => (map.bump, map.has_bump) = (number(0).unwrap_or(1.0), true),
        "-clamp" => {
            map.clamp = values == ["on"];
            return matches!(values, ["on" | "off"]);
        }
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
        // Filtering is controlled by settings of the renderer.
        "-blendu" | "-blendv" | "-boost" | "-texres" => {}
        "-cc" => return values == ["off"],
        // The colour space follows from the keyword.
        "-colorspace" => {
            return values.first().is_some_and(|v| COLOR_SPACES.contains(&v.to_ascii_lowercase().as_str()));
        }
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
    fn texture_options_are_parsed() {
        let (m, ignored) = map("-s 2 3 1 -o 0.5 -clamp on -bm 0.3 -imfchan g wood grain.png", 4);
        assert_eq!((m.scale, m.offset), ([2.0, 3.0], [0.5, 0.0]));
        assert!(m.clamp && m.bump == 0.3 && m.channel == Some(1) && ignored.is_empty());
        assert_eq!((m.file.as_str(), m.line), ("wood grain.png", 4));
        let (m, ignored) = map("-mm 0.1 2 -t 1 -blendu off a.png", 1);
        assert_eq!((m.file.as_str(), ignored), ("a.png", vec!["-mm".to_string(), "-t".to_string()]));
        let (m, ignored) = map("my texture 01.png -bm 0.5 -colorspace sRGB -s 2", 1);
        assert_eq!(
            (m.file.as_str(), m.bump, m.scale, ignored.len()),
            ("my texture 01.png", 0.5, [2.0, 1.0], 0)
        );
        assert_eq!(map("wood -s 2.png", 1).0.file, "wood -s 2.png");
        assert_eq!(map("-colorspace ACEScg a.png", 1).1, ["-colorspace"]);
        assert_eq!(map("-o", 1).0.file, "");
        assert_eq!(map("-my-file.png", 1).0.file, "-my-file.png");
    }

    /// The materials of a library, and the lines of its warnings.
    fn library(content: &[u8]) -> (Vec<Mtl>, Vec<String>) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.mtl");
        std::fs::write(&path, content).expect("written");
        let mut warnings = Vec::new();
        let materials = read(&path, &mut warnings).expect("it can be read");
        (materials, warnings.into_iter().map(|w| w.place).collect())
    }

    #[test]
    fn statements_are_parsed_or_reported() {
        let text = b"Kd 1 1 1\nnewmtl caf\xe9 au lait\nKd 0.5\nKs 1 2 3\nd -halo 0.25\nTR 0.75\nillum 2\n\
                     map_Kd\nfoo 1\nNs x\nKe spectral a.rfl\nbump a.png\nmap_Bump b.png\nKa 1 1 1\nTf 1 0.5 0\n";
        let (materials, warned) = library(text);
        let m = &materials[0];
        assert_eq!(m.name, "caf\u{e9} au lait");
        assert_eq!(
            (m.color("Kd"), m.color("Ks"), m.color("Ke")),
            (Some([0.5; 3]), Some([1.0, 2.0, 3.0]), None)
        );
        assert_eq!((m.number("d"), m.number("Tr"), m.number("illum")), (Some(0.25), Some(0.75), Some(2.0)));
        assert_eq!((m.number("Ns"), m.color("Tf")), (None, Some([1.0, 0.5, 0.0])));
        let bump = m.map("bump").expect("a texture");
        assert_eq!((bump.file.as_str(), bump.line), ("a.png", 12));
        assert_eq!(warned, ["line 1", "line 8", "line 9", "line 10", "line 11"]);
    }

    /// Statements that would make `tobj` panic or reject the whole library.
    #[test]
    fn invalid_statements_do_not_affect_others() {
        let text =
            b"newmtl\nKd\nKd 1 2\nKs nan inf -1\nillum -3.5\nillum 1e9\nillum nan\nNi \xff\nmap_d \xe9.png\n\
                     newmtl a\nnewmtl a\nd 0.5\n \xa0\xc2 1\nPr\nmap_Kd -s\nKd 3";
        let (materials, warned) = library(text);
        let names: Vec<&str> = materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names, ["", "a", "a"]);
        assert_eq!((materials[0].color("Kd"), materials[0].number("illum")), (Some([1.0; 3]), Some(255.0)));
        assert_eq!(materials[0].map("map_d").map(|m| m.file), Some("\u{e9}.png".to_string()));
        assert_eq!((materials[2].number("d"), materials[2].color("Kd")), (Some(0.5), Some([3.0; 3])));
        let expected = [2, 7, 8, 13, 14, 15].map(|line| format!("line {line}"));
        assert_eq!(warned, expected);
    }
}
