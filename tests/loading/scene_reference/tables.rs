//! The keys of scene files, with two values each, from `tables.txt`.
//!
//! A table starts with `# about`, optionally with its context: `texture` and `material` as such, `alone` without context, others
//! with a material `a`. Lines of `|` precede the keys, lines of `key = value ~ other value` are the keys, lines of `+` are added
//! to the default object after them, and lines of `=` replace it.

/// An object that uses the material `a`.
pub const BALL: &str = "\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n";
/// Shapes with a material.
pub const SHAPE: &str = "[materials]\na = { type = \"lambert\" }\nb = { type = \"phong\" }\n[[objects]]\n";
pub const PLAIN: &str = "[materials]\na = { type = \"lambert\" }\n";
pub const TEXTURED: &str = "[materials]\na = { type = \"lambert\", color = \"t\" }\n[textures.t]\n";

/// Keys of one table, each with two values, and their context.
#[derive(Default)]
pub struct Table {
    /// Tables of the same keys share this.
    pub about: &'static str,
    before: String,
    /// Key, value, other value.
    pub keys: Vec<(&'static str, &'static str, &'static str)>,
    added: String,
    object: String,
}

pub fn tables() -> Vec<Table> {
    let mut tables: Vec<Table> = Vec::new();
    for line in include_str!("tables.txt").lines() {
        let (kind, rest) = line.split_once(' ').expect("a line has words");
        if kind == "#" {
            let (about, start) = rest.split_once(": ").unwrap_or((rest, ""));
            let before = match start {
                "texture" => TEXTURED,
                "material" => "[materials.a]\n",
                "alone" => "",
                _ => PLAIN,
            };
            tables.push(Table { about, before: before.to_string(), ..Table::default() });
            continue;
        }
        let table = tables.last_mut().expect("a head comes first");
        match kind {
            "|" => table.before += &format!("{rest}\n"),
            "+" => table.added += &format!("{rest}\n"),
            "=" => table.object += &format!("{rest}\n"),
            key => {
                let values = rest.strip_prefix("= ").and_then(|values| values.split_once(" ~"));
                let (value, other) = values.expect("two values");
                table.keys.push((key, value, other.trim()));
            }
        }
    }
    tables
}

impl Table {
    /// A scene with the first value of each key, except that one key may have another value (empty: none), and with an extra
    /// line (or none).
    pub fn text(&self, changed: Option<(&str, &str)>, further: &str) -> String {
        // The closing brace of inline tables is added later.
        let is_inline = self.before.ends_with("{\n") || self.before.ends_with(",\n");
        let (between, end) = if is_inline { (", ", " }\n") } else { ("\n", "\n") };
        let before = if is_inline { self.before.trim_end() } else { &self.before };
        let value = |&(key, first, _): &(&'static str, &'static str, &'static str)| {
            changed.filter(|(name, _)| *name == key).map_or(first, |(_, v)| v)
        };
        let set = self.keys.iter().map(|key| (key.0, value(key))).filter(|(_, value)| !value.is_empty());
        let mut set: Vec<String> = set.map(|(key, value)| format!("{key} = {value}")).collect();
        set.extend((!further.is_empty()).then(|| further.to_string()));
        let object = match (self.object.as_str(), self.before.contains("[[objects]]")) {
            ("", true) => "material = \"a\"\n",
            ("", false) => BALL,
            (object, _) => object,
        };
        format!("{before} {}{end}{object}{}", set.join(between), self.added)
    }
}
