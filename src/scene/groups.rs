//! Groups of lights, which pictures may hold apart.

use super::Scene;

/// The group of what has no other.
pub const DEFAULT_GROUP: &str = "default";

/// The key of `extras` in glTF files that names a group.
pub const GROUP_KEY: &str = "light_group";

/// The name of a group, which users may leave empty.
pub fn group_or_default(name: &str) -> &str {
    if name.is_empty() { DEFAULT_GROUP } else { name }
}

impl Scene {
    /// The groups of everything that shines, in alphabetical order. Every light is in exactly one.
    pub fn light_groups(&self) -> Vec<String> {
        let emitters = self.materials.iter().filter(|m| m.emission.is_some()).map(|m| &m.light_group);
        let environment = (self.environment != super::Environment::Black).then_some(&self.environment_group);
        let all = emitters
            .chain(self.instances.iter().filter_map(|instance| instance.light_group.as_ref()))
            .chain(self.lights.iter().map(|l| &l.group))
            .chain(environment);
        let mut names: Vec<String> = all.map(|name| group_or_default(name).to_string()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }
}

/// May a group be called so? Its name becomes part of the names of channels.
pub fn is_group_name(name: &str) -> bool {
    let is_right = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    (1..=64).contains(&name.len()) && name.chars().all(is_right)
}
