//! Light linking in scene files and sidecars.

use crate::files::load_files;
use oscura::error::Error;
use oscura::load::Loaded;
use oscura::scene::{LightLinks, Link, ObjectSets};

const SCENE: &str = r#"
[materials]
a = { type = "lambert" }
lamp = { type = "emissive", radiance = [3, 3, 3] }
[[objects]]
name = "ball"
sphere = { center = [0, 0, 0], radius = 1 }
material = "a"
[[objects]]
name = "box"
box = { min = [2, 0, 0], max = [3, 1, 1] }
material = "a"
[[objects]]
name = "board"
quad = { corner = [0, 5, 0], u = [1, 0, 0], v = [0, 0, 1] }
material = "lamp"
"#;

fn scene(more: &str) -> Result<Loaded, Error> {
    load_files(&[("scene.toml", format!("{SCENE}{more}\n"))])
}

/// The sets that contain the sphere and the sides of the box.
fn members(loaded: &Loaded) -> [ObjectSets; 2] {
    let scene = &loaded.scene;
    let ball = scene.shapes.iter().find(|s| s.name == "ball").expect("a ball");
    let sides: Vec<ObjectSets> = (scene.quads.iter().filter(|q| q.name == "box").map(|q| q.traits.sets))
        .chain(scene.instances.iter().filter(|i| i.name == "box").map(|i| i.traits.sets))
        .collect();
    assert!(!sides.is_empty() && sides.iter().all(|sets| *sets == sides[0]), "all sides of the box");
    [ball.traits.sets, sides[0]]
}

#[test]
fn lights_and_emissive_objects_are_linked_by_name() {
    let lights = r#"light_link = { exclude = ["box"] }
[[lights]]
light_link = { include = ["ball"] }
shadow_link = { include = ["ball", "box"], exclude = ["ball"] }
point = { position = [0, 9, 0], power = 1 }
[[lights]]
name = "lamp"
shadow_link = { include = ["ball"] }
area = { center = [0, 3, 0], direction = [0, -1, 0], size = [1, 1], power = 1 }
"#;
    let loaded = scene(lights).unwrap_or_else(|e| panic!("{e}"));
    let [ball, cube] = members(&loaded);
    let quad = |name: &str| loaded.scene.quads.iter().find(|q| q.name == name).expect("a quad").traits.links;
    let LightLinks { receivers, blockers } = loaded.scene.lights[0].links;
    assert!(receivers.includes(ball) && !receivers.includes(cube), "{receivers:?}");
    assert!(!blockers.includes(ball) && blockers.includes(cube), "{blockers:?}");
    let board = quad("board");
    assert!(board.receivers.includes(ball) && !board.receivers.includes(cube) && board.blockers == Link::All);
    assert!(board.receivers.includes(ObjectSets::NONE) && !receivers.includes(ObjectSets::NONE));
    // The same names give the same set.
    assert_eq!(quad("lamp"), LightLinks { receivers: Link::All, blockers: receivers });
    assert_eq!(members(&scene("").unwrap_or_else(|e| panic!("{e}"))), [ObjectSets::NONE; 2]);
}

#[test]
fn linking_errors_are_reported_with_their_line() {
    let with = |links: &str| {
        let lights = format!("[[lights]]\n{links}\npoint = {{ position = [0, 9, 0], power = 1 }}");
        scene(&lights).expect_err(links).to_string()
    };
    let wrong = with("light_link = { include = [\"bal\"], exclude = [\"sky\"] }");
    assert!(wrong.contains("'bal'") && wrong.contains("'ball'"), "{wrong}");
    assert!(wrong.contains("'sky'"), "{wrong}");
    assert!(with("shadow_link = {}").contains("'exclude'"));
    assert!(with("shadow_link = { include = [3] }").contains("'include'"));
    assert!(with("light_link = { includes = [\"ball\"] }").contains("include"));
    let many = |count: usize| {
        let light = |i: usize| {
            let names = vec!["\"ball\""; i + 1].join(", ");
            format!(
                "[[lights]]\nlight_link = {{ include = [{names}] }}\npoint = {{ position = [0, 9, 0], power = 1 }}\n"
            )
        };
        scene(&(0..count).map(light).collect::<String>())
    };
    assert!(many(64).is_ok());
    assert!(many(65).expect_err("one too many").to_string().contains("64"));
}
