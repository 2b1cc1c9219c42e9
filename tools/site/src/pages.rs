//! The pages of the book, in order.

use oscura::load::scene_file::{CHAPTERS, Chapter};

/// A page of the book.
pub(crate) struct Page {
    pub(crate) title: String,
    /// Its file in the book.
    pub(crate) name: String,
    /// Its depth in the table of contents.
    pub(crate) level: usize,
    /// The part that it starts; empty before the first part.
    pub(crate) part: Option<&'static str>,
    pub(crate) text: Text,
}

/// The source of a page.
pub(crate) enum Text {
    /// A file, relative to the root of the repository.
    File(&'static str),
    /// Generated from the program's tables.
    Made(String),
}

/// Part, depth, title, source; the scene file reference follows its page.
const FILES: &[(Option<&str>, usize, &str, &str)] = &[
    (Some(""), 0, "oscura", "README.md"),
    (Some("Using it"), 0, "First picture", "src/guide/first_picture.md"),
    (None, 0, "Gallery", "src/guide/gallery.md"),
    (None, 0, "Models and scans", "src/guide/scans.md"),
    (None, 0, "From Blender", "src/guide/from_blender.md"),
    (None, 0, "Rendering", "src/guide/rendering.md"),
    (None, 0, "Questions", "src/guide/questions.md"),
    (None, 0, "For compositors", "src/guide/compositing.md"),
    (None, 0, "From other renderers", "src/guide/other_renderers.md"),
    (None, 0, "Scene files", SCENE_FILES),
    (None, 0, "File formats", "src/guide/formats.md"),
    (None, 0, "Python", "tools/python/README.md"),
    (Some("What to expect"), 0, "How exact", "src/guide/exactness.md"),
    (None, 0, "How fast", "src/guide/speed.md"),
    (None, 0, "Limits", "src/guide/limits.md"),
    (None, 0, "History", "src/guide/history.md"),
    (Some("Within"), 0, "How it works", "src/guide/internals.md"),
    (None, 1, "Loading", "src/guide/internals_loading.md"),
    (None, 1, "Compiling", "src/guide/internals_compiling.md"),
    (None, 1, "Tracing", "src/guide/internals_tracing.md"),
    (None, 1, "Film and passes", "src/guide/internals_film.md"),
    (None, 1, "Output", "src/guide/internals_output.md"),
    (None, 0, "Adding things", "src/guide/adding.md"),
];

const SCENE_FILES: &str = "src/guide/scene_files.md";

/// All pages of the book.
pub(crate) fn all() -> Vec<Page> {
    let mut pages = Vec::new();
    for &(part, level, title, path) in FILES {
        let name = match path {
            // Not the front page, whose name it would take.
            "tools/python/README.md" => "python.md",
            _ => path.rsplit('/').next().unwrap_or(path),
        };
        pages.push(Page { title: title.into(), name: name.into(), level, part, text: Text::File(path) });
        if path == SCENE_FILES {
            pages.extend(CHAPTERS.iter().map(reference));
        }
    }
    pages
}

/// A chapter of `oscura help scene-file`.
fn reference(chapter: &Chapter) -> Page {
    let name = chapter.name().replace(' ', "-");
    let (title, topic) = match name.as_str() {
        "scene-files" => ("Reference", "scene-file"),
        name => (chapter.title, name),
    };
    // Brackets would start a link.
    let title = title.replace('[', "\\[").replace(']', "\\]");
    let text = format!("# {title}\n\nAs `oscura help {topic}` prints it.\n\n{}\n", chapter.markdown());
    Page { title, name: format!("reference/{name}.md"), level: 1, part: None, text: Text::Made(text) }
}
