//! Recorded numbers as a text: what they were made with, then a scene and its number in each line.

use crate::Result;

/// Start of the line that says what the numbers were made with.
const MADE_WITH: &str = "# ";

/// Numbers of instructions.
#[derive(Debug, PartialEq)]
pub struct Record {
    /// Versions of what has a part in the numbers.
    pub made_with: String,
    /// By scene.
    pub counts: Vec<(String, u64)>,
}

impl Record {
    /// The number of a scene.
    pub fn count(&self, scene: &str) -> Option<u64> {
        self.counts.iter().find(|(name, _)| name == scene).map(|(_, count)| *count)
    }

    /// The record as text.
    pub fn to_text(&self) -> String {
        let lines: String = self.counts.iter().map(|(scene, count)| format!("{scene} {count}\n")).collect();
        format!("{MADE_WITH}{}\n{lines}", self.made_with)
    }

    /// Reads such a text.
    ///
    /// # Errors
    /// The line that is no scene with a number other than 0.
    pub fn parse(text: &str) -> Result<Record> {
        let mut record = Record { made_with: String::new(), counts: Vec::new() };
        for line in text.lines() {
            if let Some(made_with) = line.strip_prefix(MADE_WITH) {
                record.made_with = made_with.to_string();
                continue;
            }
            let number = |(scene, count): (&str, &str)| Some((scene.to_string(), count.parse().ok()?));
            let entry = line.split_once(' ').and_then(number).filter(|(_, count)| *count > 0);
            record.counts.push(entry.ok_or_else(|| format!("'{line}' is no scene with its number"))?);
        }
        Ok(record)
    }
}

#[test]
fn records_are_read_as_they_are_written() {
    let record =
        Record { made_with: "a 1, b 2".into(), counts: vec![("x".into(), 3), ("y".into(), u64::MAX)] };
    assert_eq!(Record::parse(&record.to_text()).expect("sound"), record);
    assert_eq!((record.count("y"), record.count("z")), (Some(u64::MAX), None));
    assert!(Record::parse("x 0").is_err() && Record::parse("x").is_err());
}
