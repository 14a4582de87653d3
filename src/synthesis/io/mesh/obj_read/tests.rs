//! What files may hold, and what they must not.

use super::*;

const SQUARE: &str = "# a square\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
    o one\nusemtl red\nf 1/1 2/2 3/3 4/4\n";

fn read(text: impl AsRef<[u8]>) -> Result<TriangleMesh, MeshDataError> {
    read_obj_mesh(text.as_ref())
}

fn area(text: impl AsRef<[u8]>) -> f64 {
    let text = text.as_ref();
    let mesh = read(text).unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(text)));
    mesh.area()
}

#[test]
fn polygons_and_texture_coordinates_are_read() -> Result<(), MeshDataError> {
    let mesh = read(SQUARE)?;
    assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.area(), 1.0);
    assert_eq!(mesh.uvs().map(|uvs| uvs[0]), Some(Vec2::new(0.0, 1.0)));
    let without = SQUARE.replace("/1", "").replace("/2", "").replace("/3", "").replace("/4", "");
    assert_eq!(read(without)?.uvs(), None);
    // Two charts meet at the edge 1 3: its vertices stand there twice, in the order of the file.
    let seam = SQUARE.replace("f 1/1 2/2 3/3 4/4", "f 1/1 2/2 3/3\nf 1/2 3/4 4/4");
    let mesh = read(seam)?;
    assert_eq!(mesh.triangles(), [[0, 2, 3], [1, 4, 5]]);
    assert_eq!(mesh.positions()[..2], [Vec3::ZERO; 2]);
    Ok(())
}

#[test]
fn what_growth_does_not_use_does_not_decide() {
    let square = |more: &str| SQUARE.replace("o one", more);
    for more in [
        "v nan inf 7",
        "v 9e99 0 0 # unused",
        "vn 0 1",
        "vn",
        "vn x y z",
        "l 1 2 3 99",
        "l",
        "p 1",
        "g C:\\organs\\",
        "s off",
        "vp 1 2",
        "# a comment that ends in \\",
        "\u{c}\u{b}",
        "l 1 2 \\\n3 4",
    ] {
        let mesh = read(square(more)).unwrap_or_else(|error| panic!("{more}: {error}"));
        assert_eq!((mesh.area(), mesh.positions().len()), (1.0, 4), "{more}");
    }
    let latin = [b"o k\xf6rper\n# \xb5m\nusemtl \xff\n", SQUARE.as_bytes()].concat();
    assert_eq!(area(latin), 1.0);
    // Edges as faces of two corners.
    assert_eq!(area(format!("v nan 0 0\n{SQUARE}f 2 -5\nf 3\nf\n").replace("f 1/1 2/2 3/3 4/4", "f 2 3 4 5")), 1.0);
    assert!(read(format!("{SQUARE}f 1 9\n")).is_err(), "an edge to a vertex that is not there");
    for text in [
        SQUARE.replace("vt 0 1", "vt"),
        SQUARE.replace("vt 0 1", "vt nan 1"),
        SQUARE.replace("vt 0 1", "vt a b"),
        SQUARE.replace("4/4", "4"),
    ] {
        assert!(read(&text).is_ok_and(|mesh| mesh.uvs().is_none() && mesh.area() == 1.0), "{text}");
    }
    assert!(read(SQUARE.replace("vt 0 1", "vt 0")).is_ok_and(|mesh| mesh.uvs().is_some_and(|uvs| uvs[3].y == 1.0)));
}

#[test]
fn lines_of_any_form_are_read() {
    assert_eq!(area(format!("\u{feff}{SQUARE}")), 1.0);
    assert_eq!(area(SQUARE.replace('\n', "\r")), 1.0);
    assert_eq!(area(SQUARE.replace('\n', "\r\n")), 1.0);
    assert_eq!(area(SQUARE.replace('\n', " # why\n")), 1.0);
    assert_eq!(area(SQUARE.replace('\n', "# why\n")), 1.0);
    assert_eq!(area(SQUARE.replace("f 1/1 2/2", "f 1/1 \\  \r\n \\\n 2/2 \\\n")), 1.0);
    assert_eq!(area(SQUARE.replace("v 1 1 0", "v\t1 1 0 1 0 0 1")), 1.0);
    assert_eq!(area(SQUARE.replace("v 1 1 0", "  v +1.0 1e0 0.0 1")), 1.0);
    assert_eq!(area(SQUARE.replace("1/1 2/2 3/3 4/4", "-4/-4 -3/-3 -2/-2 -1/-1")), 1.0);
    assert_eq!(area(SQUARE.replace("1/1 2/2 3/3 4/4", "1/ 2// 3 4//")), 1.0);
    assert_eq!(area(SQUARE.replace("f ", "fo ")), 1.0);
    let (vertices, face) = SQUARE.split_at(SQUARE.find("f 1/1").unwrap());
    assert_eq!(area(format!("{face}{vertices}")), 1.0, "a face before its vertices");
    let wide: Vec<u8> = SQUARE.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let message = read(wide).unwrap_err().to_string();
    assert!(message.contains("UTF-16"), "{message}");
}

#[test]
fn errors_name_the_line_and_repeat_nothing() {
    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n";
    for (text, expected) in [
        ("f 1 2 777", "a vertex that is not there"),
        ("f 1/777 2/777 3/777", "a texture coordinate that is not there"),
        ("f 1//777 2//1 3//1", "a normal that is not there"),
        ("f 1//9223372036854775807 2//1 3//1", "refers to nothing"),
        ("f 1//-9223372036854775808 2//1 3//1", "refers to nothing"),
        ("f 4294967295 2 3", "refers to nothing"),
        ("f 4294967296 2 3", "refers to nothing"),
        ("f 0 1 2", "is 0"),
        ("f -777 1 2", "refers to nothing"),
        ("f 99999999999999999999 2 3", "no whole number"),
        ("f secret 2 3", "no whole number"),
        ("f 1.0 2 3", "no whole number"),
        ("f 1/1/1/777 2 3", "vertex/texture/normal"),
        ("f /1 2 3", "vertex/texture/normal"),
        ("v 777 0", "fewer than 3"),
        ("v", "fewer than 3"),
        ("v secret 0 0", "no number"),
        ("v 777,5 0 0", "no number"),
        ("v 0 0 7\\\n77", "without a space"),
        ("surf 0 1 0 1 1 2", "curved surfaces"),
        ("call secret.obj", "calls another file"),
        ("v 0 777e9 0\nf -1 1 2", "not finite or beyond"),
        ("v 0 nan 0\nf -1 1 2", "not finite or beyond"),
        ("v 0.5 0.5 0\nv 1 1 0\nv 0 0 0\nf 1 4 5 6 4 2 3", "crosses itself"),
    ] {
        let message = read(format!("{TRIANGLE}{text}\n")).unwrap_err().to_string();
        let line = if expected == "crosses itself" { 8 } else { 5 };
        assert!(message.starts_with(&format!("line {line}: ")) && message.contains(expected), "{text}: {message}");
        assert!(!message.contains("777") && !message.contains("secret"), "{message}");
    }
    for empty in ["", "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n", "\u{0}\u{1}\u{2}", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3"] {
        assert!(matches!(read(empty), Err(MeshDataError::Mesh(_))), "{empty:?}");
    }
}

#[test]
fn damaged_files_never_panic() {
    let text = SQUARE.as_bytes();
    for end in 0..text.len() {
        // The rest may be a mesh or not.
        let _ = read(&text[..end]);
        let mut bent = text.to_vec();
        bent[end] = bent[end].wrapping_mul(31).wrapping_add(17);
        let _ = read(&bent);
    }
}
