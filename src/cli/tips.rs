//! What clap's messages leave open: a scene without its extension in place of a command, an option of another command.

use super::scene_args::scenes_named;
use clap::Command;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

/// The error with what probably was meant.
pub(super) fn with_tips(error: Error, command: &mut Command) -> Error {
    match error.kind() {
        ErrorKind::InvalidSubcommand => of_command(error, command),
        ErrorKind::UnknownArgument => of_option(error, command),
        ErrorKind::InvalidValue => of_view(error),
        _ => error,
    }
}

fn context(error: &Error, kind: ContextKind) -> Option<String> {
    match error.get(kind)? {
        ContextValue::String(text) => Some(text.clone()),
        ContextValue::Strings(texts) => texts.first().cloned(),
        _ => None,
    }
}

/// A word that is neither a command nor a file: files of that name with an extension, or the nearest command.
fn of_command(error: Error, command: &mut Command) -> Error {
    let Some(word) = context(&error, ContextKind::InvalidSubcommand) else { return error };
    let files = scenes_named(&word);
    let near = context(&error, ContextKind::SuggestedSubcommand);
    let tip = match (files.first(), near) {
        (Some(_), _) => format!("\n\n  tip: scenes of that name: {}", files.join(", ")),
        (None, Some(near)) => format!("\n\n  tip: a similar command exists: '{near}'"),
        (None, None) => String::new(),
    };
    command.error(ErrorKind::InvalidSubcommand, format!("'{word}' is neither a command nor a file{tip}"))
}

/// An option of another command.
fn of_option(mut error: Error, command: &Command) -> Error {
    let Some(option) = context(&error, ContextKind::InvalidArg) else { return error };
    let name = option.trim_start_matches('-');
    let has_option = |command: &&Command| {
        let mut arguments = command.get_arguments().filter(|arg| !arg.is_hide_set());
        arguments.any(|arg| arg.get_long_and_visible_aliases().is_some_and(|names| names.contains(&name)))
    };
    let others: Vec<String> = command
        .get_subcommands()
        .filter(has_option)
        .map(|command| format!("'oscura {}'", command.get_name()))
        .collect();
    if !others.is_empty() {
        let tip = format!("'{option}' is an option of {}", others.join(", "));
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(tip)]));
    }
    error
}

/// `--view` is looked for by those who want to see the page.
fn of_view(mut error: Error) -> Error {
    if context(&error, ContextKind::InvalidArg).is_some_and(|arg| arg.starts_with("--view ")) {
        let tip = StyledStr::from("'oscura view SCENE' shows a scene live in the browser");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
    }
    error
}
