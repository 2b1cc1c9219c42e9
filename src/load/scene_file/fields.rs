//! Typed access to the keys of a TOML table that collects all problems instead of stopping at the first.

use crate::error::{Error, Message, Problem, Result};
use crate::math::DVec3;
use std::cell::{OnceCell, RefCell};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Help for a missing file: run the script `build.py` in its folder or the one above, if there is one.
fn help_for_missing(path: &Path) -> String {
    let script = path.ancestors().skip(1).take(2).map(|folder| folder.join("build.py")).find(|s| s.is_file());
    match script {
        Some(script) => format!("a script makes or fetches it: python3 {}", script.display()),
        None => "paths are relative to the folder of the scene file".to_string(),
    }
}

/// The problems found so far.
pub(super) struct Problems<'a> {
    text: &'a str,
    /// A copy of the text for deferred errors, made on demand.
    shared_text: OnceCell<Arc<str>>,
    list: RefCell<Vec<Problem>>,
}

impl<'a> Problems<'a> {
    /// No problems yet in `text`.
    pub fn new(text: &'a str) -> Problems<'a> {
        Problems { text, shared_text: OnceCell::new(), list: RefCell::new(Vec::new()) }
    }

    /// Adds a problem about a range of the text.
    pub fn push(&self, span: Range<usize>, message: impl Into<Message>) {
        self.add(span, message.into(), None);
    }

    /// Adds a problem with help.
    pub fn push_help(&self, span: Range<usize>, message: impl Into<Message>, help: impl Into<String>) {
        self.add(span, message.into(), Some(help.into()));
    }

    /// Adds a problem of a file, once for each message.
    pub fn push_of_file(&self, span: Range<usize>, path: &Path, message: String) {
        if self.list.borrow().iter().all(|problem| problem.message != message) {
            let is_missing = matches!(path.try_exists(), Ok(false));
            self.add(span, message.into(), is_missing.then(|| help_for_missing(path)));
        }
    }

    fn add(&self, span: Range<usize>, message: Message, help: Option<String>) {
        let before = self.text.as_bytes().get(..span.start).unwrap_or_default();
        let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
        let mut problem = Problem::new(format!("line {line}"), message).with_span(span);
        problem.help = help;
        self.list.borrow_mut().push(problem);
    }

    /// A function that makes errors about a range of the text after the text has been dropped.
    pub fn deferred_error(
        &self,
        file: &Path,
        span: Range<usize>,
    ) -> impl Fn(String) -> Error + Send + Sync + use<> {
        let text = self.shared_text.get_or_init(|| self.text.into()).clone();
        let file = file.to_path_buf();
        move |message| {
            let problems = Problems::new(&text);
            problems.push(span.clone(), message);
            Error::input_problems(&file, problems.list.into_inner()).with_source(&*text)
        }
    }

    /// # Errors
    /// All problems, in the order of the text.
    pub fn into_result(self, file: &Path, text: &str) -> Result<()> {
        let mut problems = self.list.into_inner();
        if problems.is_empty() {
            return Ok(());
        }
        problems.sort_by_key(|p| p.span.as_ref().map_or(0, |s| s.start));
        Err(Error::input_problems(file, problems).with_source(text))
    }
}

/// One table. Reading a key marks it as known; [`Fields::finish`] reports unknown keys.
pub(super) struct Fields<'a> {
    /// Name of the table in messages.
    description: String,
    table: &'a DeTable<'a>,
    span: Range<usize>,
    known: RefCell<Vec<&'static str>>,
    pub problems: &'a Problems<'a>,
}

/// A value with its span in the text.
#[derive(Clone)]
pub(super) struct Located<T> {
    pub value: T,
    pub span: Range<usize>,
}

impl<'a> Fields<'a> {
    /// Access to a table at `span`.
    pub fn new(
        description: impl Into<String>,
        table: &'a DeTable<'a>,
        span: Range<usize>,
        problems: &'a Problems<'a>,
    ) -> Fields<'a> {
        Fields { description: description.into(), table, span, known: RefCell::new(Vec::new()), problems }
    }

    /// Access to the table of a value; reports values of other types.
    pub fn of_value(
        description: impl Into<String>,
        value: &'a Spanned<DeValue<'a>>,
        problems: &'a Problems<'a>,
    ) -> Option<Fields<'a>> {
        let description = description.into();
        let Some(table) = value.get_ref().as_table() else {
            problems.push(value.span(), format!("{description} must be a table"));
            return None;
        };
        Some(Fields::new(description, table, value.span(), problems))
    }

    /// Name of the table in messages.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Span of the table in the text.
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    /// Whether the key exists; marks it as known.
    pub fn has(&self, key: &'static str) -> bool {
        self.raw(key).is_some()
    }

    /// Whether the key exists; doesn't mark it as known.
    pub fn is_given(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Marks keys as known without reading them.
    pub fn mark_known(&self, keys: &[&'static str]) {
        self.known.borrow_mut().extend(keys);
    }

    /// The parsed value of a key; marks it as known.
    pub fn raw(&self, key: &'static str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.known.borrow_mut().push(key);
        self.table.get(key)
    }

    /// All keys with their values, for tables with names as keys.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, &'a Spanned<DeValue<'a>>)> + use<'a> {
        self.table.iter().map(|(k, v)| (k.get_ref().as_ref(), v))
    }

    /// The value of a name, for tables with names as keys.
    pub fn entry(&self, name: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table.get(name)
    }

    fn typed<T>(
        &self,
        key: &'static str,
        expected: &str,
        read: impl Fn(&'a DeValue<'a>) -> Option<T>,
    ) -> Option<Located<T>> {
        let value = self.raw(key)?;
        let found = read(value.get_ref());
        if found.is_none() {
            self.problems.push(value.span(), format!("'{key}' of {} must be {expected}", self.description));
        }
        found.map(|v| Located { value: v, span: value.span() })
    }

    /// A finite number.
    pub fn number(&self, key: &'static str) -> Option<Located<f64>> {
        self.typed(key, "a finite number", number)
    }

    pub fn number_in(&self, key: &'static str, range: Range<f64>, default: f64) -> f64 {
        let Some(v) = self.number(key) else { return default };
        if !(range.start <= v.value && v.value <= range.end) {
            let limits = if range.end.is_infinite() {
                format!("at least {}", range.start)
            } else {
                format!("from {} to {}", range.start, range.end)
            };
            self.problems.push(
                v.span,
                format!("'{key}' of {} is {}, but must be {limits}", self.description, v.value),
            );
            return default;
        }
        v.value
    }

    pub fn integer(&self, key: &'static str, min: i64, max: i64) -> Option<i64> {
        let expected = format!("a whole number from {min} to {max}");
        let read =
            |v: &DeValue| number(v).filter(|x| x.fract() == 0.0 && *x >= min as f64 && *x <= max as f64);
        self.typed(key, &expected, read).map(|v| v.value as i64)
    }

    /// A non-negative integer from `min` to `max`.
    pub fn unsigned(&self, key: &'static str, min: u32, max: u32) -> Option<u32> {
        self.integer(key, min.into(), max.into()).map(|n| n as u32)
    }

    /// A boolean.
    pub fn flag(&self, key: &'static str, default: bool) -> bool {
        self.typed(key, "true or false", DeValue::as_bool).map_or(default, |v| v.value)
    }

    pub fn string(&self, key: &'static str) -> Option<Located<&'a str>> {
        self.typed(key, "a string", DeValue::as_str)
    }

    /// The option named by a string.
    pub fn choice<T: Copy>(&self, key: &'static str, options: &[(&str, T)]) -> Option<T> {
        let word = self.string(key)?;
        let found = options.iter().find(|(name, _)| *name == word.value);
        if found.is_none() {
            let names: Vec<&str> = options.iter().map(|o| o.0).collect();
            let message = format!("'{key}' of {} can't be '{}'", self.description, word.value);
            self.problems.push_help(word.span, message, format!("one of: {}", names.join(", ")));
        }
        found.map(|o| o.1)
    }

    /// Exactly `N` finite numbers.
    pub fn numbers<const N: usize>(&self, key: &'static str) -> Option<Located<[f64; N]>> {
        self.typed(key, &format!("a list of {N} finite numbers"), numbers)
    }

    /// A point or vector.
    pub fn vector(&self, key: &'static str) -> Option<Located<DVec3>> {
        self.numbers::<3>(key).map(|v| Located { value: DVec3::from(v.value), span: v.span })
    }

    /// A colour or radiance: three non-negative numbers, or one for grey.
    pub fn color(&self, key: &'static str) -> Option<Located<[f32; 3]>> {
        self.typed(key, "a colour: three numbers, or one for grey, from 0 up", color)
    }

    pub fn table(&self, key: &'static str) -> Option<Fields<'a>> {
        let v = self.typed(key, "a table", DeValue::as_table)?;
        Some(Fields::new(format!("'{key}'"), v.value, v.span, self.problems))
    }

    /// One table, or a list of tables.
    pub fn tables(&self, key: &'static str) -> Vec<Fields<'a>> {
        match self.raw(key).map(Spanned::get_ref) {
            Some(DeValue::Array(list)) => {
                let table = |value: &'a Spanned<DeValue<'a>>| {
                    let table = value.get_ref().as_table();
                    if table.is_none() {
                        self.problems.push(value.span(), format!("each '{key}' must be a table"));
                    }
                    table.map(|t| Fields::new(format!("'{key}'"), t, value.span(), self.problems))
                };
                list.iter().filter_map(table).collect()
            }
            _ => self.table(key).into_iter().collect(),
        }
    }

    pub fn list(&self, key: &'static str) -> Option<&'a [Spanned<DeValue<'a>>]> {
        self.typed(key, "a list", |v| v.as_array().map(|a| &a[..])).map(|v| v.value)
    }

    /// Reports the key as missing if the table doesn't have it.
    pub fn require<T>(&self, key: &str, value: Option<T>) -> Option<T> {
        // A value of the wrong type was reported already.
        if value.is_none() && !self.table.contains_key(key) {
            self.report(format!("{} needs '{key}'", self.description));
        }
        value
    }

    /// Adds a problem of the table.
    pub fn report(&self, message: impl Into<Message>) {
        self.problems.push(self.span(), message);
    }

    /// Adds a problem of the table, with help.
    pub fn report_help(&self, message: impl Into<Message>, help: impl Into<String>) {
        self.problems.push_help(self.span(), message, help);
    }

    /// Reports keys that exclude each other; returns whether the table has at most one of them.
    pub fn exclusive<const N: usize>(&self, keys: [&'static str; N]) -> bool {
        let given: Vec<String> =
            keys.into_iter().filter(|key| self.has(key)).map(|key| format!("'{key}'")).collect();
        if given.len() > 1 {
            let message = format!("{} exclude each other: keep one", given.join(" and "));
            self.report(message);
        }
        given.len() <= 1
    }

    /// Reports all unknown keys.
    pub fn finish(&self) {
        let known = self.known.borrow();
        for (key, _) in self.table.iter() {
            let name: &str = key.get_ref().as_ref();
            if known.contains(&name) {
                continue;
            }
            let message = format!("{} has no key '{name}'", self.description);
            match known_synonym(name, &known).or_else(|| nearest(name, known.iter().copied())) {
                Some(near) => self.problems.push_help(key.span(), message, format!("did you mean '{near}'?")),
                None => {
                    let mut names = known.clone();
                    names.sort_unstable();
                    names.dedup();
                    self.problems.push_help(key.span(), message, format!("known keys: {}", names.join(", ")));
                }
            }
        }
    }
}

/// A finite number.
pub(super) fn number(value: &DeValue) -> Option<f64> {
    let read = match value {
        DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(|i| i as f64),
        DeValue::Float(f) => f.as_str().parse().ok(),
        _ => None,
    };
    read.filter(|x: &f64| x.is_finite())
}

/// Exactly `N` finite numbers.
pub(super) fn numbers<const N: usize>(value: &DeValue) -> Option<[f64; N]> {
    let list: Option<Vec<f64>> = value.as_array()?.iter().map(|v| number(v.get_ref())).collect();
    list?.try_into().ok()
}

/// A colour: three numbers or one, finite as `f32` and not negative.
pub(super) fn color(value: &DeValue) -> Option<[f32; 3]> {
    let rgb = match number(value) {
        Some(grey) => [grey; 3],
        None => numbers::<3>(value)?,
    };
    let rgb = rgb.map(|x| x as f32);
    rgb.iter().all(|x| x.is_finite() && *x >= 0.0).then_some(rgb)
}

/// The table `[materials.NAME]` or `[textures.NAME]` of `all`; `kind` is "material" or "texture". Reports a missing one at
/// `span`, where the name is used.
pub(super) fn named<'a>(
    all: Option<&Fields<'a>>,
    kind: &str,
    name: &str,
    span: Range<usize>,
    problems: &Problems,
) -> Option<&'a Spanned<DeValue<'a>>> {
    let found = all.and_then(|fields| fields.entry(name));
    if found.is_none() {
        let names = all.into_iter().flat_map(|fields| fields.entries()).map(|(n, _)| n);
        let help = suggestion(name, names, format!("add a table [{kind}s.{name}]"));
        problems.push_help(span, format!("there is no {kind} '{name}'"), help);
    }
    found
}

/// Names of keys in other programs and formats, and in scene files.
const SYNONYMS: [(&[&str], &[&str]); 11] = [
    (&["position", "eye", "origin", "location"], &["look_from", "center", "transform"]),
    (&["target", "lookat", "interest"], &["look_at"]),
    (&["fov", "yfov", "field_of_view"], &["vfov"]),
    (&["up"], &["view_up"]),
    (&["spp"], &["samples"]),
    (&["translate", "rotate", "scale", "matrix", "rotation"], &["transform"]),
    (&["albedo", "diffuse", "base_color", "kd"], &["color", "base_color"]),
    (&["intensity", "energy", "strength", "emission"], &["power", "radiance", "intensity"]),
    (&["vertices", "file", "model"], &["mesh", "points"]),
    (&["color", "colour"], &["background"]),
    (&["hdri", "map"], &["image"]),
];

/// The key among `known` that other programs call `name`.
fn known_synonym<'n>(name: &str, known: &[&'n str]) -> Option<&'n str> {
    let keys = SYNONYMS.iter().filter(|(foreign, _)| foreign.contains(&name)).flat_map(|(_, keys)| *keys);
    keys.filter_map(|key| known.iter().find(|other| *other == key)).next().copied()
}

/// Help for an unknown `name`: the nearest of `names`, else `default`.
pub(super) fn suggestion<'n>(name: &str, names: impl Iterator<Item = &'n str>, default: String) -> String {
    nearest(name, names).map_or(default, |near| format!("did you mean '{near}'?"))
}

/// The name nearest to `name` by edit distance, if near enough for a misspelling.
pub(super) fn nearest<'n>(name: &str, names: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let limit = (name.chars().count() / 2).clamp(1, 4);
    names.map(|n| (strsim::osa_distance(name, n), n)).filter(|(d, _)| *d <= limit).min().map(|(_, n)| n)
}
