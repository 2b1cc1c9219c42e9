//! The library's names of choices, replaced by those of the options that make them here.

use oscura::error::{Choice, Error, Warning};
use oscura::load::Loaded;

/// How a choice is made on the command line.
fn option(choice: Choice) -> &'static str {
    match choice {
        Choice::AllowExternal => "--allow-external",
        Choice::Aovs => "--aov",
        Choice::Background => "--background",
        Choice::Beside => "the file that 'oscura new --beside FILE' writes",
        Choice::Blender => "--blender PATH",
        Choice::Environment => "--env ''",
        Choice::Float => "--float",
        Choice::Force => "--force",
        Choice::Glass => "--glass",
        Choice::Ground => "--ground",
        Choice::LightUnits => "--light-units",
        Choice::NoSidecar => "--no-sidecar",
        Choice::PointRadius => "--point-radius METRES",
        Choice::Smooth => "--smooth",
        Choice::Subdivide => "--subdivide",
        Choice::Stage => "--stage",
        Choice::Up => "--up AXIS",
        Choice::ViewFrom => "--view-from",
        Choice::Zoom => "--zoom",
    }
}

fn replace(text: &mut String) {
    for choice in Choice::ALL {
        let term = choice.to_string();
        if text.contains(&term) {
            *text = text.replace(&term, option(choice));
        }
    }
}

/// Names options in an error.
pub(crate) fn in_error(mut error: Error) -> Error {
    for problem in &mut error.problems {
        replace(&mut problem.message);
        if let Some(help) = &mut problem.help {
            replace(help);
        }
    }
    error
}

/// Names options in warnings or notes.
pub(crate) fn in_warnings(warnings: &mut [Warning]) {
    warnings.iter_mut().for_each(|warning| replace(&mut warning.message));
}

/// Names options in all that loading said.
pub(crate) fn in_loaded(loaded: &mut Loaded) {
    in_warnings(&mut loaded.warnings);
    in_warnings(&mut loaded.notes);
}
