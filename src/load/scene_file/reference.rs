//! The reference of scene files (`oscura help`, the guide): the module documentation of the parsers.
//! `tests/loading/scene_reference/` compares it with the keys that the parsers accept.

/// One chapter of the reference.
#[derive(Clone, Copy, Debug)]
pub struct Chapter {
    /// Its subject, as written in a scene file.
    pub title: &'static str,
    sections: &'static [Section],
}

/// Module documentation of a source file from a heading (`//! # heading`) to the next one.
#[derive(Clone, Copy, Debug)]
struct Section {
    source: &'static str,
    /// Empty: the text before the first heading.
    heading: &'static str,
}

const fn section(source: &'static str, heading: &'static str) -> Section {
    Section { source, heading }
}

const fn chapter(title: &'static str, sections: &'static [Section]) -> Chapter {
    Chapter { title, sections }
}

/// All chapters, in the order of a scene file.
pub const CHAPTERS: &[Chapter] = &[
    chapter("scene files", &[section(include_str!("mod.rs"), "")]),
    chapter("[camera]", &[section(include_str!("camera.rs"), "")]),
    chapter("[environment]", &[section(include_str!("environment.rs"), "")]),
    chapter("media", &[section(include_str!("media.rs"), "")]),
    chapter("[render]", &[section(include_str!("render_settings.rs"), "")]),
    chapter("[textures]", &[section(include_str!("textures.rs"), "")]),
    chapter("[materials]", &[section(include_str!("materials.rs"), ""), section(include_str!("pbr.rs"), "")]),
    chapter("[[objects]]", &[section(include_str!("objects.rs"), "")]),
    chapter("subdivision", &[section(include_str!("objects.rs"), "subdivision")]),
    chapter("[[curves]]", &[section(include_str!("curves.rs"), "")]),
    chapter("transform", &[section(include_str!("transform.rs"), "")]),
    chapter("motion", &[section(include_str!("transform.rs"), "motion")]),
    chapter(
        "[[lights]]",
        &[section(include_str!("lights.rs"), ""), section(include_str!("traits.rs"), "linking")],
    ),
    chapter("[[portals]]", &[section(include_str!("environment.rs"), "portals")]),
    chapter("sidecar", &[section(include_str!("sidecar.rs"), "")]),
];

impl Chapter {
    /// The text in markdown.
    pub fn markdown(&self) -> String {
        self.sections.iter().map(Section::markdown).collect::<Vec<_>>().join("\n\n")
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

impl Section {
    fn markdown(&self) -> String {
        let lines = self.source.lines().map_while(|l| l.strip_prefix("//!"));
        let lines = lines.map(|l| l.strip_prefix(' ').unwrap_or(l));
        let mut heading = "";
        let lines = lines.filter(|line| {
            let next = line.strip_prefix("# ");
            heading = next.unwrap_or(heading);
            next.is_none() && heading == self.heading
        });
        let text = lines.collect::<Vec<_>>().join("\n");
        // Links to sibling modules become their names.
        text.replace("[`super::", "`").replace("`super::", "`").replace("`]", "`").trim().to_string()
    }
}
