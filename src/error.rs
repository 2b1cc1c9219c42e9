//! Errors and warnings: message, location and remedy.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The kind of an [`Error`], which determines the exit code of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Invalid or contradictory arguments or options.
    Usage,
    /// An input file is missing, invalid or not supported.
    Input,
    /// A file could not be written.
    Output,
    /// Cancelled by the user.
    Interrupted,
}

/// The text of a problem or a warning with an optional code: converts from the text, or from the pair (code, text).
#[derive(Clone, Debug)]
pub struct Message {
    text: String,
    code: &'static str,
}

impl From<String> for Message {
    fn from(text: String) -> Message {
        Message { text, code: "" }
    }
}

impl From<&str> for Message {
    fn from(text: &str) -> Message {
        Message::from(text.to_string())
    }
}

impl From<&String> for Message {
    fn from(text: &String) -> Message {
        Message::from(text.clone())
    }
}

impl<T: Into<String>> From<(&'static str, T)> for Message {
    fn from((code, text): (&'static str, T)) -> Message {
        Message { text: text.into(), code }
    }
}

/// A problem in an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The location: a JSON pointer (`/accessors/3/count`), `line 12`, or empty for the whole file.
    pub place: String,
    /// The message, with the offending value.
    pub message: String,
    /// A remedy, if known.
    pub help: Option<String>,
    /// The byte range in [`Error::source_text`] that the problem is about.
    pub span: Option<Range<usize>>,
    /// Stable identifier for programs and tests, such as `texture-missing`, or empty.
    pub code: &'static str,
}

impl Problem {
    /// A problem at a location (JSON pointer or line; empty for the whole file).
    pub fn new(place: impl Into<String>, message: impl Into<Message>) -> Problem {
        let Message { text, code } = message.into();
        Problem { place: place.into(), message: text, help: None, span: None, code }
    }

    /// Adds a remedy.
    pub fn with_help(mut self, help: impl Into<String>) -> Problem {
        self.help = Some(help.into());
        self
    }

    /// Adds a stable code.
    pub fn with_code(mut self, code: &'static str) -> Problem {
        self.code = code;
        self
    }

    /// Adds the byte range in the source text.
    pub fn with_span(mut self, span: Range<usize>) -> Problem {
        self.span = Some(span);
        self
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}

/// An error: the file and all problems in it.
#[derive(Clone)]
pub struct Error {
    /// The kind.
    pub kind: ErrorKind,
    /// The file in question, if any.
    pub file: Option<PathBuf>,
    /// All problems found, in file order; never empty.
    pub problems: Vec<Problem>,
    /// The text of the file, for problems with spans (scene files).
    pub source_text: Option<String>,
}

/// A result with an [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An input file with one problem of the whole file.
    pub fn input(file: &Path, message: impl Into<Message>) -> Error {
        Error::input_problems(file, vec![Problem::new("", message)])
    }

    /// An input file with all of its problems.
    pub fn input_problems(file: &Path, problems: Vec<Problem>) -> Error {
        Error { kind: ErrorKind::Input, file: Some(file.to_path_buf()), problems, source_text: None }
    }

    /// A file that could not be written.
    pub fn output(file: &Path, message: impl Into<Message>) -> Error {
        Error {
            kind: ErrorKind::Output,
            file: Some(file.to_path_buf()),
            problems: vec![Problem::new("", message)],
            source_text: None,
        }
    }

    /// Invalid arguments.
    pub fn usage(message: impl Into<Message>) -> Error {
        Error {
            kind: ErrorKind::Usage,
            file: None,
            problems: vec![Problem::new("", message)],
            source_text: None,
        }
    }

    /// Sets the file of an error without one.
    pub fn in_file(mut self, file: &Path) -> Error {
        self.file.get_or_insert_with(|| file.to_path_buf());
        self
    }

    /// Adds a remedy to the last problem.
    pub fn with_help(mut self, help: impl Into<String>) -> Error {
        if let Some(problem) = self.problems.last_mut() {
            problem.help = Some(help.into());
        }
        self
    }

    /// Adds a stable code to the last problem.
    pub fn with_code(mut self, code: &'static str) -> Error {
        if let Some(problem) = self.problems.last_mut() {
            problem.code = code;
        }
        self
    }

    /// Appends the problems of another error of the same kind, each with its file.
    pub fn append(&mut self, other: Error) {
        let place_of = |file: &Option<PathBuf>, place: String| match file {
            Some(file) if place.is_empty() => file.display().to_string(),
            Some(file) => format!("{}: {place}", file.display()),
            None => place,
        };
        if self.file != other.file {
            let own = self.file.take();
            for problem in &mut self.problems {
                problem.place = place_of(&own, std::mem::take(&mut problem.place));
            }
        }
        self.problems.extend(
            other
                .problems
                .into_iter()
                .map(|p| Problem { place: place_of(&other.file, p.place.clone()), ..p }),
        );
    }

    /// Adds the text of the file, which reports quote at the spans of problems.
    pub fn with_source(mut self, text: impl Into<String>) -> Error {
        self.source_text = Some(text.into());
        self
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        for (i, problem) in self.problems.iter().enumerate() {
            if i > 0 {
                f.write_str("\n  ")?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

/// As [`fmt::Display`], for errors returned from `main`.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {}

/// A warning about something ignored, approximated or repaired; reported and stored in the picture's metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file in question, if any.
    pub file: Option<PathBuf>,
    /// The location in the file: JSON pointer or line; empty for the whole file.
    pub place: String,
    /// The message, with counts.
    pub message: String,
    /// Stable identifier for programs and tests, or empty.
    pub code: &'static str,
}

impl Warning {
    /// A warning about a location in a file.
    pub fn new(file: &Path, place: impl Into<String>, message: impl Into<Message>) -> Warning {
        let Message { text, code } = message.into();
        Warning { file: Some(file.to_path_buf()), place: place.into(), message: text, code }
    }

    /// A warning without a file.
    pub fn general(message: impl Into<Message>) -> Warning {
        let Message { text, code } = message.into();
        Warning { file: None, place: String::new(), message: text, code }
    }

    /// Adds a stable code.
    pub fn with_code(mut self, code: &'static str) -> Warning {
        self.code = code;
        self
    }
}

/// A list of quoted names for a message, abbreviated to the first few and the number of the others.
pub fn listed(names: &[impl AsRef<str>]) -> String {
    const MAX_NAMES: usize = 3;
    let shown = names.len().min(if names.len() == MAX_NAMES + 1 { MAX_NAMES + 1 } else { MAX_NAMES });
    let mut parts: Vec<String> = names[..shown].iter().map(|name| format!("'{}'", name.as_ref())).collect();
    if shown < names.len() {
        parts.push(format!("{} more", names.len() - shown));
    }
    match parts.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => String::new(),
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)
    }
}

named_enum! {
    /// An option of the caller that a message refers to. Messages contain its name in the library, which programs may replace by
    /// the name of their own option.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Choice {
        /// Permission to read files outside an asset's folder.
        AllowExternal = "`LoadOptions::allow_external`",
        /// Additional channels of the picture.
        Aovs = "`Renderer::aovs`",
        /// The background.
        Background = "`StageOptions::background`",
        /// A sidecar file, for settings that the model's format lacks.
        NewSidecar = "`scene_file::sidecar_path`",
        /// The path of Blender.
        Blender = "`BlenderOptions::program`",
        /// An environment by the caller, or none.
        Environment = "`LoadOptions::overrides_environment`",
        /// 32-bit float pixels.
        Float = "`OutputOptions::float`",
        /// Permission to ignore required extensions that are not supported.
        Force = "`GltfOptions::force`",
        /// The interpretation of transparent materials without a volume.
        Glass = "`GltfOptions::glass`",
        /// The ground below a bare model.
        Ground = "`StageOptions::ground`",
        /// The unit of lights.
        LightUnits = "`GltfOptions::light_units`",
        /// The memory limit of an image.
        MemoryLimit = "`LoadOptions::memory_limit`",
        /// Sidecar files are ignored.
        NoSidecar = "`LoadOptions::no_sidecar`",
        /// The radius of the points of a point cloud.
        PointRadius = "`LoadOptions::point_radius`",
        /// Smooth normals for meshes without normals.
        Smooth = "`LoadOptions::smooth_rad`",
        /// The levels of subdivision surfaces.
        Subdivide = "`LoadOptions::subdivision`",
        /// The default lights of scenes without light.
        Stage = "`StageOptions::light`",
        /// The up axis of a file.
        Up = "`LoadOptions::up`",
        /// The default viewpoint of a bare model.
        ViewFrom = "`StageOptions::view`",
        /// The size of a bare model in the picture.
        Zoom = "`StageOptions::zoom`",
    }
}

/// Its name in the library, in backticks.
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
