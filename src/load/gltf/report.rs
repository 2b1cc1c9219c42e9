//! Problems, warnings and notes about a glTF file.

use crate::error::{Message, Problem, Warning};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Maximum numbers of problems that are listed, and of warnings with the same text.
const MAX_PROBLEMS: usize = 32;
const MAX_ALIKE: usize = 8;

/// How much something matters.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Severity {
    /// Something was ignored, approximated or repaired.
    Warning,
    /// A choice among several valid interpretations.
    Note,
}

/// The proof that a problem or a warning was noted, which only a [`Report`] gives. A reader that fails
/// returns one, so that nothing is dropped silently.
#[derive(Clone, Copy, Debug)]
pub(in crate::load::gltf) struct Reported(());

/// A part of a file, or the proof that its error was noted.
pub(in crate::load::gltf) type Valid<T> = Result<T, Reported>;

/// One warning or note.
struct Entry {
    kind: Severity,
    /// It concerns something that is read once for all time samples.
    is_lasting: bool,
    warning: Warning,
}

/// Errors and repairs, in the order in which they were found; equal ones are listed once.
pub(in crate::load::gltf) struct Report {
    file: PathBuf,
    problems: Vec<Problem>,
    unlisted: usize,
    entries: Vec<Entry>,
    seen: HashSet<(String, String)>,
    /// Entries being added concern something that is read once for all time samples.
    is_lasting: bool,
}

impl Report {
    /// Nothing yet about a file.
    pub fn new(file: &Path) -> Report {
        Report {
            file: file.to_path_buf(),
            problems: Vec::new(),
            unlisted: 0,
            entries: Vec::new(),
            seen: HashSet::new(),
            is_lasting: false,
        }
    }

    /// Begins another time sample: drops all entries but those of things that are read once.
    pub fn begin_time(&mut self) {
        self.entries.retain(|e| e.is_lasting);
        self.seen =
            self.entries.iter().map(|e| (e.warning.place.clone(), e.warning.message.clone())).collect();
    }

    /// Runs `work` for something that is read once: its entries stay for all later time samples.
    pub fn lasting<T>(&mut self, work: impl FnOnce(&mut Report) -> T) -> T {
        let before = std::mem::replace(&mut self.is_lasting, true);
        let result = work(self);
        self.is_lasting = before;
        result
    }

    /// Notes a problem.
    pub fn problem(&mut self, pointer: impl Into<String>, message: impl Into<Message>) -> Reported {
        self.add(Problem::new(pointer, message))
    }

    /// Adds a problem with help.
    pub fn add(&mut self, problem: Problem) -> Reported {
        let is_new = self.seen.insert((problem.place.clone(), problem.message.clone()));
        if is_new && self.problems.len() < MAX_PROBLEMS {
            self.problems.push(problem);
        } else if is_new {
            self.unlisted += 1;
        }
        Reported(())
    }

    /// Runs `work` for an optional part of the file: its first problem is returned, and not counted as one of the file.
    ///
    /// # Errors
    /// The problem.
    pub fn optional<T>(&mut self, work: impl FnOnce(&mut Report) -> Valid<T>) -> Result<T, Problem> {
        let (problems, unlisted) = (std::mem::take(&mut self.problems), self.unlisted);
        let result = work(self);
        let own = std::mem::replace(&mut self.problems, problems);
        self.unlisted = unlisted;
        for problem in &own {
            self.seen.remove(&(problem.place.clone(), problem.message.clone()));
        }
        // An error found before is not reported again.
        let known = || Problem::new("", "can't be read: what it refers to has a problem of its own");
        result.map_err(|_| own.into_iter().next().unwrap_or_else(known))
    }

    /// Notes a warning.
    pub fn warn(&mut self, pointer: impl Into<String>, message: impl Into<Message>) -> Reported {
        let warning = Warning::new(&self.file, pointer, message);
        self.add_entry(Severity::Warning, warning);
        Reported(())
    }

    /// Adds a note about the choice among several valid interpretations.
    pub fn note(&mut self, pointer: impl Into<String>, message: impl Into<Message>) {
        let note = Warning::new(&self.file, pointer, message);
        self.add_entry(Severity::Note, note);
    }

    fn add_entry(&mut self, kind: Severity, warning: Warning) {
        if self.seen.insert((warning.place.clone(), warning.message.clone())) {
            self.entries.push(Entry { kind, is_lasting: self.is_lasting, warning });
        }
    }

    /// Adds warnings from elsewhere.
    pub fn extend(&mut self, warnings: &[Warning]) {
        self.append(Severity::Warning, warnings);
    }

    /// Adds notes with locations of their own.
    pub fn extend_notes(&mut self, notes: &[Warning]) {
        self.append(Severity::Note, notes);
    }

    fn append(&mut self, kind: Severity, list: &[Warning]) {
        let is_lasting = self.is_lasting;
        self.entries.extend(list.iter().map(|warning| Entry { kind, is_lasting, warning: warning.clone() }));
    }

    /// All problems, with a last line for those beyond the list.
    pub fn take_problems(&mut self) -> Vec<Problem> {
        let mut problems = std::mem::take(&mut self.problems);
        if self.unlisted > 0 {
            problems
                .push(Problem::new("", ("more-problems", format!("and {} more problems", self.unlisted))));
        }
        problems
    }

    /// All warnings, with one line for the rest of many with the same text.
    pub fn warnings(&self) -> Vec<Warning> {
        self.list(Severity::Warning)
    }

    /// All notes, likewise.
    pub fn notes(&self) -> Vec<Warning> {
        self.list(Severity::Note)
    }

    fn list(&self, kind: Severity) -> Vec<Warning> {
        let (mut list, mut alike) = (Vec::new(), HashMap::<&str, usize>::new());
        for entry in self.entries.iter().filter(|e| e.kind == kind) {
            let count = alike.entry(&entry.warning.message).or_default();
            *count += 1;
            if *count <= MAX_ALIKE {
                list.push(entry.warning.clone());
            }
        }
        let mut many: Vec<(&str, usize)> = alike.into_iter().filter(|(_, n)| *n > MAX_ALIKE).collect();
        many.sort();
        let rest = |(message, n)| format!("{} more places: {message}", n - MAX_ALIKE);
        list.extend(many.into_iter().map(|m| Warning::new(&self.file, "", rest(m))));
        list
    }
}
