//! Groups of lights, which pictures may hold apart.

use super::Scene;

/// The group of what has no other.
pub const DEFAULT_GROUP: &str = "default";

/// The name of a group as users leave it empty.
pub fn group_or_default(name: &str) -> &str {
    if name.is_empty() { DEFAULT_GROUP } else { name }
}

impl Scene {
    /// The groups of everything that shines, in alphabetical order. Every light is in exactly one.
    pub fn light_groups(&self) -> Vec<String> {
        let emitters = self.materials.iter().filter(|m| m.emission.is_some()).map(|m| &m.light_group);
        let environment = (self.environment != super::Environment::Black).then_some(&self.environment_group);
        let all = emitters.chain(self.lights.iter().map(|l| &l.group)).chain(environment);
        let mut names: Vec<String> = all.map(|name| group_or_default(name).to_string()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// What is wrong with the name of a group, which becomes part of the names of channels: letters, digits, `_` and `-`
    /// are right.
    pub fn check_group(name: &str) -> Option<String> {
        let is_right = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        (!is_right)
            .then(|| format!("the light group '{name}' has other characters than letters, digits, _ and -"))
    }
}
