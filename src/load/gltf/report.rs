//! Problems, warnings and notes about a glTF file.

use crate::error::{Message, Problem, Warning};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Maximum number of listed problems.
const MAX_PROBLEMS: usize = 32;
/// Maximum number of listed warnings with the same text.
const MAX_REPEATED: usize = 8;

/// Severity of a message.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Severity {
    /// Something was ignored, approximated or repaired.
    Warning,
    /// A choice among several valid interpretations.
    Note,
}

/// Proof that a problem or a warning was reported; only [`Report`] creates it. Failing readers return it, so that no
/// error is silent.
#[derive(Clone, Copy, Debug)]
pub(in crate::load::gltf) struct Reported(());

/// A result whose error was already reported.
pub(in crate::load::gltf) type Valid<T> = Result<T, Reported>;

/// One warning or note.
struct Entry {
    kind: Severity,
    /// Concerns an object that is read once for all time samples.
    is_lasting: bool,
    warning: Warning,
}

/// Problems, warnings and notes, without duplicates, in the order of their detection.
pub(in crate::load::gltf) struct Report {
    file: PathBuf,
    problems: Vec<Problem>,
    unlisted: usize,
    entries: Vec<Entry>,
    seen: HashSet<(String, String)>,
    /// New entries concern an object that is read once for all time samples.
    is_lasting: bool,
}

impl Report {
    /// An empty report for a file.
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

    /// Begins another time sample: drops all but lasting entries.
    pub fn begin_time(&mut self) {
        self.entries.retain(|e| e.is_lasting);
        self.seen =
            self.entries.iter().map(|e| (e.warning.place.clone(), e.warning.message.clone())).collect();
    }

    /// Runs `work` for an object that is read once: its entries are kept for later time samples.
    pub fn lasting<T>(&mut self, work: impl FnOnce(&mut Report) -> T) -> T {
        let before = std::mem::replace(&mut self.is_lasting, true);
        let result = work(self);
        self.is_lasting = before;
        result
    }

    /// Adds a problem.
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

    /// Runs `work` for an optional part of the file, whose problems aren't added to the report.
    ///
    /// # Errors
    /// The first problem.
    pub fn optional<T>(&mut self, work: impl FnOnce(&mut Report) -> Valid<T>) -> Result<T, Problem> {
        let (problems, unlisted) = (std::mem::take(&mut self.problems), self.unlisted);
        let result = work(self);
        let new_problems = std::mem::replace(&mut self.problems, problems);
        self.unlisted = unlisted;
        for problem in &new_problems {
            self.seen.remove(&(problem.place.clone(), problem.message.clone()));
        }
        // The problem of a shared object was reported earlier.
        let earlier = || Problem::new("", "can't be read: an object that it refers to has a problem");
        result.map_err(|_| new_problems.into_iter().next().unwrap_or_else(earlier))
    }

    /// Adds a warning.
    pub fn warn(&mut self, pointer: impl Into<String>, message: impl Into<Message>) -> Reported {
        let warning = Warning::new(&self.file, pointer, message);
        self.add_entry(Severity::Warning, warning);
        Reported(())
    }

    /// Adds a note about a choice among several valid interpretations.
    pub fn note(&mut self, pointer: impl Into<String>, message: impl Into<Message>) {
        let note = Warning::new(&self.file, pointer, message);
        self.add_entry(Severity::Note, note);
    }

    fn add_entry(&mut self, kind: Severity, warning: Warning) {
        if self.seen.insert((warning.place.clone(), warning.message.clone())) {
            self.entries.push(Entry { kind, is_lasting: self.is_lasting, warning });
        }
    }

    /// Adds warnings with their own locations.
    pub fn extend(&mut self, warnings: &[Warning]) {
        self.append(Severity::Warning, warnings);
    }

    /// Adds notes with their own locations.
    pub fn extend_notes(&mut self, notes: &[Warning]) {
        self.append(Severity::Note, notes);
    }

    fn append(&mut self, kind: Severity, list: &[Warning]) {
        let is_lasting = self.is_lasting;
        self.entries.extend(list.iter().map(|warning| Entry { kind, is_lasting, warning: warning.clone() }));
    }

    /// All problems; the last one counts those beyond the maximum.
    pub fn take_problems(&mut self) -> Vec<Problem> {
        let mut problems = std::mem::take(&mut self.problems);
        if self.unlisted > 0 {
            problems
                .push(Problem::new("", ("more-problems", format!("and {} more problems", self.unlisted))));
        }
        problems
    }

    /// All warnings. Beyond a maximum, warnings with the same text are only counted.
    pub fn warnings(&self) -> Vec<Warning> {
        self.list(Severity::Warning)
    }

    /// All notes, likewise.
    pub fn notes(&self) -> Vec<Warning> {
        self.list(Severity::Note)
    }

    fn list(&self, kind: Severity) -> Vec<Warning> {
        let (mut list, mut counts) = (Vec::new(), HashMap::<&str, usize>::new());
        for entry in self.entries.iter().filter(|e| e.kind == kind) {
            let count = counts.entry(&entry.warning.message).or_default();
            *count += 1;
            if *count <= MAX_REPEATED {
                list.push(entry.warning.clone());
            }
        }
        let mut many: Vec<(&str, usize)> = counts.into_iter().filter(|(_, n)| *n > MAX_REPEATED).collect();
        many.sort();
        let rest = |(message, n)| format!("{} more places: {message}", n - MAX_REPEATED);
        list.extend(many.into_iter().map(|m| Warning::new(&self.file, "", rest(m))));
        list
    }
}
