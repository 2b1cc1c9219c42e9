//! 3MF: packages of XML models.

use super::archives::zip;
use crate::codes::code_of;
use crate::files::{load_files_by, refused_copies};
use oscura::error::Error;
use oscura::load::{LoadOptions, Loaded};
use oscura::math::{DMat3, DVec3};
use oscura::scene::{Mapping, Model, Texture, Wrap};

const RELATIONS: &[u8] = b"<?xml version='1.0'?><Relationships xmlns='r'><Relationship Id='a' Type='t/thumbnail' \
    Target='/x.png'/><Relationship Id='b' Type='http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel' \
    Target='/3D/start.model'/></Relationships>";

/// A tetrahedron corner with edges of length 10.
const CORNER: &str = "<mesh><vertices><vertex x='0' y='0' z='0'/><vertex x='10' y='0' z='0'/><vertex x='0' y='10' z='0'/>\
    <vertex x='0' y='0' z='10'/></vertices><triangles><triangle v1='0' v2='2' v3='1'/><triangle v1='0' v2='1' v3='3'/>\
    <triangle v1='1' v2='2' v3='3'/><triangle v1='2' v2='0' v3='3'/></triangles></mesh>";

fn read_files(files: &[(&str, &[u8])]) -> Result<Loaded, Error> {
    let package = zip(&[&[("_rels/.rels", RELATIONS)], files].concat());
    let options = LoadOptions { up: oscura::load::Up::Y, ..LoadOptions::default() };
    load_files_by(&[("a.3mf", package)], &options)
}

/// A model with resources and a build.
fn model(unit: &str, resources: &str, build: &str) -> String {
    format!(
        "<?xml version='1.0' encoding='UTF-8'?>\n<!-- c -->\n<model {unit} xmlns='core' xmlns:m='m' xmlns:p='p'>\n\
         <metadata name='Title'>a &amp; b</metadata><resources>{resources}</resources>\n<build>{build}</build></model>"
    )
}

fn read(unit: &str, resources: &str, build: &str) -> Result<Loaded, Error> {
    read_files(&[("3D/start.model", model(unit, resources, build).as_bytes())])
}

fn good(resources: &str, build: &str) -> Loaded {
    read("", resources, build).unwrap_or_else(|e| panic!("{e}"))
}

/// The tetrahedron as an object with attributes.
fn object(attributes: &str) -> String {
    format!("<object id='1' {attributes}>{CORNER}</object>")
}

/// Messages about the file itself, not about the stage.
fn messages(loaded: &Loaded) -> Vec<String> {
    loaded.warnings.iter().filter(|w| w.file.is_some()).map(|w| w.message.clone()).collect()
}

#[test]
fn build_items_and_units() {
    for (unit, metres) in [
        ("", 1e-3),
        ("unit='millimeter'", 1e-3),
        ("unit='micron'", 1e-6),
        ("unit='centimeter'", 1e-2),
        ("unit='inch'", 0.0254),
        ("unit='foot'", 0.3048),
        ("unit='meter'", 1.0),
    ] {
        let loaded = read(unit, &object(""), "<item objectid='1'/>").unwrap_or_else(|e| panic!("{e}"));
        let scene = &loaded.scene;
        assert_eq!((scene.meshes.len(), scene.instances.len(), messages(&loaded).len()), (1, 1, 0));
        assert_eq!(scene.instances[0].world_from_object.matrix3, DMat3::from_diagonal(DVec3::splat(metres)));
        let mesh = &scene.meshes[0];
        assert_eq!((mesh.positions.len(), mesh.triangles[0], mesh.colors.len()), (4, [0, 2, 1], 0));
    }
    assert!(read("unit='mile'", &object(""), "<item objectid='1'/>").is_err());
}

/// The file's matrices are row vectors' images of the axes; parents are applied after children.
#[test]
fn components() {
    let resources = object("name='corner'")
        + "<object id='2'><components><component objectid='1' transform='0 1 0 -1 0 0 0 0 1 5 0 0'/>\
           <component objectid='1'/></components></object>";
    let loaded =
        good(&resources, "<item objectid='2' transform='2 0 0 0 2 0 0 0 2 0 0 100'/><item objectid='1'/>");
    let scene = &loaded.scene;
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 3));
    let at =
        |i: usize, p: [f64; 3]| scene.instances[i].world_from_object.transform_point3(DVec3::from(p)) * 1e3;
    let near = |a: DVec3, b: [f64; 3]| assert!((a - DVec3::from(b)).length() < 1e-9, "{a} {b:?}");
    near(at(0, [10.0, 0.0, 0.0]), [10.0, 20.0, 100.0]);
    near(at(1, [10.0, 0.0, 0.0]), [20.0, 0.0, 100.0]);
    near(at(2, [10.0, 0.0, 0.0]), [10.0, 0.0, 0.0]);
    assert!(scene.instances.iter().all(|i| i.name == "corner"));
}

#[test]
fn materials_and_colours() {
    let groups = "<basematerials id='5'><base name='a' displaycolor='#FF0000'/><base name='b'/></basematerials>\
                  <m:colorgroup id='6'><m:color color='#00FF00'/><m:color color='#0000FFFF'/></m:colorgroup>";
    let of = |object: &str| {
        let loaded = good(&format!("{groups}{object}"), "<item objectid='1'/>");
        assert!(
            loaded.scene.materials[0].use_vertex_colors && messages(&loaded).is_empty(),
            "{:?}",
            messages(&loaded)
        );
        loaded.scene.meshes[0].clone()
    };
    let (red, green, blue) = ([1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
    let all = of(&object("pid='5' pindex='0'"));
    assert_eq!((all.positions.len(), &all.colors[..]), (4, &[red; 4][..]));
    let mixed = CORNER.replacen("v3='1'/>", "v3='1' pid='6' p1='0' p2='1' p3='1'/>", 1).replacen(
        "v3='3'/>",
        "v3='3' pid='5' p1='0'/>",
        1,
    );
    let mesh = of(&format!("<object id='1'>{mixed}</object>"));
    let colors = |t: usize| mesh.triangles[t].map(|i| mesh.colors[i as usize]);
    assert_eq!(colors(0), [green, blue, blue]);
    assert_eq!(colors(1), [red; 3]);
    // Triangles without one are grey, and vertices are split.
    assert_eq!(colors(2), [[0.8, 0.8, 0.8, 1.0]; 3]);
    assert!(mesh.positions.len() > 4 && mesh.triangles.len() == 4 && mesh.parts.len() == 1);
    let transparent = good(
        &(groups.replace("#00FF00", "#00FF0080") + &object("pid='6' pindex='0'")),
        "<item objectid='1'/>",
    );
    assert_eq!(messages(&transparent), ["1 transparent colours are rendered opaque"]);
}

#[test]
fn texture_coordinates_point_up() {
    let picture = include_bytes!("obj_ply/pixel.png");
    let textured = CORNER.replacen("v3='1'/>", "v3='1' pid='9' p1='0' p2='1' p3='2'/>", 1);
    let resources = format!(
        "<m:texture2d id='8' path='/3D/Textures/T.png' contenttype='image/png' tilestyleu='mirror' tilestylev='clamp'/>\
         <m:texture2dgroup id='9' texid='8'><m:tex2coord u='0' v='0'/><m:tex2coord u='0.25' v='1'/><m:tex2coord u='1' v='0.5'/>\
         </m:texture2dgroup><object id='1'>{textured}</object>"
    );
    let start = model("", &resources, "<item objectid='1'/>");
    let loaded = read_files(&[("3D/start.model", start.as_bytes()), ("3D/Textures/t.png", picture)]);
    let loaded = loaded.unwrap_or_else(|e| panic!("{e}"));
    let scene = &loaded.scene;
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.parts.iter().map(|p| p.triangle_count).collect::<Vec<_>>(), [3, 1]);
    let places = mesh.triangles[3].map(|i| mesh.uv_sets[0][i as usize]);
    assert_eq!(places, [[0.0, 1.0], [0.25, 0.0], [1.0, 0.5]]);
    let Model::Lambert { albedo } = &scene.materials[mesh.parts[1].material.index()].model else {
        panic!("no texture")
    };
    let texture = &scene.textures[albedo.texture.expect("a texture").index()];
    let Texture::Image { wrap_u, wrap_v, mapping, .. } = texture else { panic!("{texture:?}") };
    assert_eq!((*wrap_u, *wrap_v, *mapping), (Wrap::Mirror, Wrap::Clamp, Mapping::default()));
    // Without its file only the texture is lost.
    let lost = read_files(&[("3D/start.model", start.as_bytes())]).unwrap_or_else(|e| panic!("{e}"));
    assert!(messages(&lost)[0].contains("T.png'"), "{:?}", messages(&lost));
}

/// Slicers store each object in its own part.
#[test]
fn objects_in_other_parts() {
    let start = model("", "", "<item objectid='1' p:path='/3D/Objects/a.model'/>");
    let other = model("unit='millimeter'", &object("type='model'"), "");
    let loaded =
        read_files(&[("3D/start.model", start.as_bytes()), ("3D/Objects/a.model", other.as_bytes())]);
    assert_eq!(loaded.unwrap_or_else(|e| panic!("{e}")).scene.instances.len(), 1);
    let lost = read_files(&[("3D/start.model", start.as_bytes())]).expect_err("it is missing").to_string();
    assert!(lost.contains("/3D/Objects/a.model"), "{lost}");
}

#[test]
fn errors_are_reported_with_their_location() {
    let refusal = |resources: &str, build: &str| read("", resources, build).expect_err("it is refused");
    assert_eq!(code_of(&refusal("", "")), "no-surface");
    let undefined = refusal("", "<item objectid='7'/>");
    assert_eq!(code_of(&undefined), "object-undefined");
    assert!(undefined.problems[0].place.ends_with("object 7"), "{undefined}");
    let beams = "<object id='1'><mesh><b:beamlattice><b:beams><b:beam v1='0'/></b:beams></b:beamlattice></mesh></object>";
    let beams = refusal(beams, "<item objectid='1'/>");
    assert!(code_of(&beams) == "no-surface" && beams.to_string().contains("beams"), "{beams}");
    let cycle = "<object id='1'><components><component objectid='1'/></components></object>";
    assert_eq!(code_of(&refusal(cycle, "<item objectid='1'/>")), "object-cycle");
    let bad = CORNER.replace("y='10'", "y='ten'");
    let bad = refusal(&format!("<object id='1'>{bad}</object>"), "<item objectid='1'/>");
    let bad = bad.to_string();
    assert!(bad.contains("3D/start.model, line 4: ") && bad.contains("'ten'"), "{bad}");
    let short = refusal(&object(""), "<item objectid='1' transform='1 0 0'/>");
    let short = short.to_string();
    assert!(short.contains("line 5: '1 0 0'"), "{short}");
    assert!(
        read_files(&[("3D/other.model", b"")]).expect_err("no start").to_string().contains("start.model")
    );
    assert!(
        read_files(&[("3D/start.model", b"<a/>")]).expect_err("no model").to_string().contains("'model'")
    );
    assert!(
        read_files(&[("3D/start.model", b"<model><a")]).expect_err("cut").to_string().contains("damaged")
    );

    let index = good(&object("").replacen("v2='2'", "v2='9'", 1), "<item objectid='1'/>");
    assert_eq!(index.scene.meshes[0].triangles.len(), 3);
    assert_eq!(messages(&index), ["1 triangles with a missing vertex: left out"]);
    let number = good(&object("").replacen("z='10'", "z='NaN'", 1), "<item objectid='1'/>");
    assert_eq!(number.scene.meshes[0].triangles.len(), 1);
    assert_eq!(number.scene.meshes[0].parts[0].triangle_count, 1);
    let unread = good(&(object("") + "<m:multiproperties id='4'/>"), "<item objectid='1'/>");
    assert_eq!(messages(&unread), ["layered properties are not supported"]);
    let support = good(
        &(object("") + "<object id='3' type='support'><mesh/></object>"),
        "<item objectid='1'/><item objectid='3'/>",
    );
    assert!(support.left_out[0].starts_with("1 "), "{:?}", support.left_out);
    // Each level doubles: there would be 2^40 objects.
    let level = |i: u32| {
        let c = format!("<component objectid='{}'/>", i - 1);
        format!("<object id='{i}'><components>{c}{c}</components></object>")
    };
    let levels: String = (2..42).map(level).collect();
    assert_eq!(code_of(&refusal(&(object("") + &levels), "<item objectid='41'/>")), "too-many-objects");
}

#[test]
fn damaged_models_never_panic() {
    let whole = model("", &object("pid='5' pindex='0'"), "<item objectid='1'/>").into_bytes();
    let refused =
        refused_copies(&whole, b"<>'/ 9", 1500, |bytes| read_files(&[("3D/start.model", bytes)]).is_err());
    assert!(refused > 400, "only {refused} of 1500 were refused");
}
