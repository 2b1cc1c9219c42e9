//! Names of nodes of a model, as files beside it give them.

/// Is a name, or several joined by slashes, on the way of names to a node? With a slash before them the way begins so.
pub(super) fn is_on_path(name: &str, path: &str) -> bool {
    let begins = |at: usize, name: &str| {
        let rest = path[at..].strip_prefix(name);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    match name.strip_prefix('/') {
        Some(name) => begins(0, name),
        None => begins(0, name) || path.match_indices('/').any(|(slash, _)| begins(slash + 1, name)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_nodes_on_the_way() {
        assert!(
            is_on_path("Fog", "Fog") && is_on_path("Fog", "Room/Fog") && is_on_path("Room", "Room/Fog/3")
        );
        assert!(is_on_path("a/a", "ba/a/a") && is_on_path("aa", "aaa/aa") && !is_on_path("a", "aa/ba"));
        assert!(is_on_path("/Room", "Room/Fog") && is_on_path("/Room/Fog", "Room/Fog"));
        assert!(!is_on_path("/Fog", "Room/Fog") && !is_on_path("/Room", "House/Room"));
        assert!(
            is_on_path("Room/Fog", "House/Room/Fog")
                && !is_on_path("Fo", "Fog")
                && !is_on_path("Fog", "Foggy/x")
        );
    }
}
