//! Names of nodes of a model, as files beside it give them.

/// Is a name, or several joined by slashes, on the way of names to a node? With a slash before them the way begins so.
pub(super) fn is_on_path(name: &str, path: &str) -> bool {
    if name.starts_with('/') {
        return format!("/{path}/").starts_with(&format!("{name}/"));
    }
    format!("/{path}/").contains(&format!("/{name}/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_nodes_on_the_way() {
        assert!(
            is_on_path("Fog", "Fog") && is_on_path("Fog", "Room/Fog") && is_on_path("Room", "Room/Fog/3")
        );
        assert!(is_on_path("/Room", "Room/Fog") && is_on_path("/Room/Fog", "Room/Fog"));
        assert!(!is_on_path("/Fog", "Room/Fog") && !is_on_path("/Room", "House/Room"));
        assert!(
            is_on_path("Room/Fog", "House/Room/Fog")
                && !is_on_path("Fo", "Fog")
                && !is_on_path("Fog", "Foggy/x")
        );
    }
}
