//! The key of a page: a random part of its address, which keeps out other users of the machine.

use oscura::error::{Error, Result};
use std::sync::Mutex;

/// Bytes of a key.
const LENGTH: usize = 16;

/// Who knows the key comes in. Browsers are started by an address that is good for one use: others can see it in the list
/// of running programs.
pub(super) struct Door {
    key: String,
    /// The key for one use, until it is used.
    once: Mutex<Option<String>>,
    first: String,
}

/// Where a request goes.
#[derive(Debug, PartialEq)]
pub(super) enum Way<'a> {
    /// To this path of the page, with its query.
    To(&'a str),
    /// The client is sent to another path.
    Elsewhere(String),
    Closed,
}

impl Door {
    /// A door with new keys.
    ///
    /// # Errors
    /// If the system has no random numbers.
    pub fn new() -> Result<Door> {
        let (key, first) = (key()?, key()?);
        Ok(Door { key, once: Mutex::new(Some(first.clone())), first })
    }

    /// The path of the page.
    pub fn page(&self) -> String {
        format!("/{}/", self.key)
    }

    /// The path that leads there once.
    pub fn way_in(&self) -> String {
        format!("/open/{}", self.first)
    }

    pub fn way<'a>(&self, target: &'a str) -> Way<'a> {
        if let Some(key) = target.strip_prefix("/open/") {
            let mut once = self.once.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            return match once.take_if(|own| own == key) {
                Some(_) => Way::Elsewhere(self.page()),
                None => Way::Closed,
            };
        }
        match target.strip_prefix('/').and_then(|rest| rest.strip_prefix(self.key.as_str())) {
            Some("") => Way::Elsewhere(self.page()),
            Some(url) if url.starts_with('/') => Way::To(url),
            _ => Way::Closed,
        }
    }
}

/// A random key in hexadecimal digits.
fn key() -> Result<String> {
    let mut bytes = [0; LENGTH];
    getrandom::fill(&mut bytes)
        .map_err(|e| Error::usage(format!("the system has no random numbers for a page's key: {e}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_who_knows_the_key_comes_in() {
        let door = Door::new().expect("random numbers");
        let page = door.page();
        assert_eq!(page.len(), 2 * LENGTH + 2);
        assert_eq!(door.way(&page), Way::To("/"));
        assert_eq!(door.way(&format!("{page}frame?after=1")), Way::To("/frame?after=1"));
        assert_eq!(door.way(page.trim_end_matches('/')), Way::Elsewhere(page.clone()));
        let other = Door::new().expect("random numbers").page();
        for target in ["/", "/frame", "/open/", &other, &format!("{}x/", page.trim_end_matches('/'))] {
            assert_eq!(door.way(target), Way::Closed, "{target}");
        }
    }

    #[test]
    fn the_way_in_leads_there_once() {
        let door = Door::new().expect("random numbers");
        let way_in = door.way_in();
        assert_eq!(door.way(&format!("{way_in}0")), Way::Closed);
        assert_eq!(door.way(&way_in), Way::Elsewhere(door.page()));
        assert_eq!(door.way(&way_in), Way::Closed);
        assert_ne!(way_in.trim_start_matches("/open/"), door.page().trim_matches('/'));
    }
}
