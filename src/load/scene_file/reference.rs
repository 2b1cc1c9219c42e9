//! What scene files may hold, in words: the documentation of the modules that read them, which is beside the code that
//! reads each key. `tests/loading/scene_reference/` holds it against what the parser takes.

/// One part of the reference.
#[derive(Clone, Copy, Debug)]
pub struct Chapter {
    /// What it is about, as written in a scene file.
    pub title: &'static str,
    /// The sources of the modules that read it.
    sources: &'static [&'static str],
}

const fn chapter(title: &'static str, sources: &'static [&'static str]) -> Chapter {
    Chapter { title, sources }
}

/// All parts, in the order of a scene file.
pub const CHAPTERS: &[Chapter] = &[
    chapter("scene files", &[include_str!("mod.rs")]),
    chapter("[camera]", &[include_str!("camera.rs"), include_str!("projection.rs")]),
    chapter("[environment]", &[include_str!("environment.rs")]),
    chapter("media", &[include_str!("media.rs")]),
    chapter("[render]", &[include_str!("settings.rs")]),
    chapter("[textures]", &[include_str!("textures.rs"), include_str!("spectra.rs")]),
    chapter(
        "[materials]",
        &[
            include_str!("materials.rs"),
            include_str!("metals.rs"),
            include_str!("hair.rs"),
            include_str!("pbr.rs"),
            include_str!("displaced.rs"),
        ],
    ),
    chapter("[[objects]]", &[include_str!("objects.rs"), include_str!("round.rs")]),
    chapter("subdivision", &[include_str!("subdivided.rs")]),
    chapter("[[curves]]", &[include_str!("curves.rs")]),
    chapter("transform", &[include_str!("transform.rs")]),
    chapter("motion", &[include_str!("motion.rs")]),
    chapter("[[lights]]", &[include_str!("lights.rs"), include_str!("linking.rs")]),
    chapter("[[portals]]", &[include_str!("portals.rs")]),
    chapter("sidecar", &[include_str!("sidecar.rs")]),
];

impl Chapter {
    /// The modules' documentation in markdown, of each up to its first heading: derivations follow there.
    pub fn markdown(&self) -> String {
        self.sources.iter().map(|s| documentation(s)).collect::<Vec<_>>().join("\n\n")
    }

    /// The chapter of a title, with or without its brackets.
    pub fn find(title: &str) -> Option<&'static Chapter> {
        CHAPTERS.iter().find(|c| c.name() == title || c.title == title)
    }

    /// The title without brackets.
    pub fn name(&self) -> &'static str {
        self.title.trim_matches(['[', ']'])
    }
}

fn documentation(source: &str) -> String {
    let lines = source.lines().map_while(|l| l.strip_prefix("//!"));
    let lines = lines.take_while(|l| !l.starts_with(" #"));
    let text = lines.map(|l| l.strip_prefix(' ').unwrap_or(l)).collect::<Vec<_>>().join("\n");
    // Links to neighbours become their names.
    text.replace("[`super::", "`").replace("`super::", "`").replace("`]", "`").trim_end().to_string()
}
