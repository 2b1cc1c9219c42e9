//! Errors and warnings: message, location and remedy. Nothing here prints.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The kind of an [`Error`]; the command line derives its exit code from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The arguments or options make no sense together.
    Usage,
    /// A file that should be read is missing, broken or not supported.
    Input,
    /// A file could not be written.
    Output,
    /// The user asked to stop.
    Interrupted,
}

/// The text of a problem or a warning and its stable code: made of the text alone, or of the pair of both.
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

/// One thing that is wrong in an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Where: a JSON pointer (`/accessors/3/count`), `line 12`, or empty for the whole file.
    pub place: String,
    /// The message, in plain words, with the offending value.
    pub message: String,
    /// A remedy, if known.
    pub help: Option<String>,
    /// The byte range in [`Error::source_text`] that the problem is about.
    pub span: Option<Range<usize>>,
    /// Stable code for programs and tests, such as `texture-missing`; empty where there is none.
    pub code: &'static str,
}

impl Problem {
    /// A problem at a place (JSON pointer or line; empty for the whole file).
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

/// Why something could not be done: the file and all the problems found in it.
#[derive(Clone)]
pub struct Error {
    /// The kind.
    pub kind: ErrorKind,
    /// The file in question, if any.
    pub file: Option<PathBuf>,
    /// All problems found, in file order; never empty.
    pub problems: Vec<Problem>,
    /// The text of the file, where showing a line of it helps (scene files).
    pub source_text: Option<String>,
}

/// The result of everything that can fail.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An input file with one problem that concerns the file as a whole.
    pub fn input(file: &Path, message: impl Into<Message>) -> Error {
        Error::input_problems(file, vec![Problem::new("", message)])
    }

    /// An input file with all its problems.
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

    /// Arguments that make no sense.
    pub fn usage(message: impl Into<Message>) -> Error {
        Error {
            kind: ErrorKind::Usage,
            file: None,
            problems: vec![Problem::new("", message)],
            source_text: None,
        }
    }

    /// Names the file of an error that names none.
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

    /// Adds the problems of another error of the same kind, each with its file.
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

    /// Attaches the text of the file, so that problems with a span can show their line.
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

/// As for users, so that a `main` that returns it says what is wrong.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {}

/// Something that was ignored, approximated or repaired; collected, reported and stored in the picture's metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file it is about, if any.
    pub file: Option<PathBuf>,
    /// Where in the file: JSON pointer or line; empty for the whole file.
    pub place: String,
    /// The message, with counts.
    pub message: String,
    /// Stable code for programs and tests; empty where there is none.
    pub code: &'static str,
}

impl Warning {
    /// A warning about a place in a file.
    pub fn new(file: &Path, place: impl Into<String>, message: impl Into<Message>) -> Warning {
        let Message { text, code } = message.into();
        Warning { file: Some(file.to_path_buf()), place: place.into(), message: text, code }
    }

    /// A warning that belongs to no file.
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

/// Names in a message: the first few in quotation marks, and how many more there are.
pub fn listed(names: &[impl AsRef<str>]) -> String {
    /// Number of items that are named.
    const FIRST: usize = 3;
    let shown = names.len().min(if names.len() == FIRST + 1 { FIRST + 1 } else { FIRST });
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

// Choices of the caller that messages refer to.

/// A choice of the caller that would change what a message is about. Messages name it as the library does; a program with
/// names of its own for choices puts those in their place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Files outside an asset's folder may be read.
    AllowExternal,
    /// Channels beside the picture's own.
    Aovs,
    /// The background.
    Background,
    /// A file beside the model says what its format can't.
    NewSidecar,
    /// Where Blender is.
    Blender,
    /// The caller lights the scene, or wants no light.
    Environment,
    /// Pixels of full precision.
    Float,
    /// Extensions that a file demands may be missing.
    Force,
    /// The look of transparent materials without a volume.
    Glass,
    /// The ground below a bare model.
    Ground,
    /// The unit of lights.
    LightUnits,
    /// The memory that one image may take.
    MemoryLimit,
    /// Settings beside a model don't count.
    NoSidecar,
    /// The size of the points of a point cloud.
    PointRadius,
    /// Normals for meshes without.
    Smooth,
    /// `LoadOptions::subdivision`.
    Subdivide,
    /// The lights of scenes without light.
    Stage,
    /// Which axis of a file points up.
    Up,
    /// From where a bare model is seen.
    ViewFrom,
    /// How large a bare model is in the picture.
    Zoom,
}

impl Choice {
    /// All of them.
    pub const ALL: [Choice; 20] = [
        Choice::AllowExternal,
        Choice::Aovs,
        Choice::Background,
        Choice::NewSidecar,
        Choice::Blender,
        Choice::Environment,
        Choice::Float,
        Choice::Force,
        Choice::Glass,
        Choice::Ground,
        Choice::LightUnits,
        Choice::MemoryLimit,
        Choice::NoSidecar,
        Choice::PointRadius,
        Choice::Smooth,
        Choice::Subdivide,
        Choice::Stage,
        Choice::Up,
        Choice::ViewFrom,
        Choice::Zoom,
    ];
}

/// Its name in the library, between backticks.
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Choice::AllowExternal => "`LoadOptions::allow_external`",
            Choice::Aovs => "`Renderer::aovs`",
            Choice::Background => "`StageOptions::background`",
            Choice::NewSidecar => "`scene_file::sidecar_path`",
            Choice::Blender => "`BlenderOptions::program`",
            Choice::Environment => "`LoadOptions::brings_environment`",
            Choice::Float => "`OutputOptions::float`",
            Choice::Force => "`GltfOptions::force`",
            Choice::Glass => "`GltfOptions::glass`",
            Choice::Ground => "`StageOptions::ground`",
            Choice::LightUnits => "`GltfOptions::light_units`",
            Choice::MemoryLimit => "`LoadOptions::memory_limit`",
            Choice::NoSidecar => "`LoadOptions::no_sidecar`",
            Choice::PointRadius => "`LoadOptions::point_radius`",
            Choice::Smooth => "`LoadOptions::smooth_rad`",
            Choice::Subdivide => "`LoadOptions::subdivision`",
            Choice::Stage => "`StageOptions::light`",
            Choice::Up => "`LoadOptions::up`",
            Choice::ViewFrom => "`StageOptions::view`",
            Choice::Zoom => "`StageOptions::zoom`",
        })
    }
}
