//! The record as text: tool versions, then a scene and its count per line.

use crate::Result;

/// Prefix of the line with tool versions.
const MADE_WITH: &str = "# ";

/// Instruction counts.
#[derive(Debug, PartialEq)]
pub struct Record {
    /// Versions of the tools that affect the counts.
    pub made_with: String,
    /// By scene.
    pub counts: Vec<(String, u64)>,
}

impl Record {
    /// The count of a scene.
    pub fn count(&self, scene: &str) -> Option<u64> {
        self.counts.iter().find(|(name, _)| name == scene).map(|(_, count)| *count)
    }

    /// The record as text.
    pub fn to_text(&self) -> String {
        let lines: String = self.counts.iter().map(|(scene, count)| format!("{scene} {count}\n")).collect();
        format!("{MADE_WITH}{}\n{lines}", self.made_with)
    }

    /// Parses such a text.
    ///
    /// # Errors
    /// The first line that is not a scene with a positive count.
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
fn records_round_trip() {
    let record =
        Record { made_with: "a 1, b 2".into(), counts: vec![("x".into(), 3), ("y".into(), u64::MAX)] };
    assert_eq!(Record::parse(&record.to_text()).expect("sound"), record);
    assert_eq!((record.count("y"), record.count("z")), (Some(u64::MAX), None));
    assert!(Record::parse("x 0").is_err() && Record::parse("x").is_err());
}
