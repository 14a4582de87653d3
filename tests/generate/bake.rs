//! Textures from the command line.

use crate::{Folder, failure, generate};
use serde_json::Value;
use std::fs;

/// A square of so many cells as an OBJ file, with texture coordinates or without.
fn square(has_uvs: bool) -> String {
    const CELLS: usize = 8;
    let mut text = String::new();
    for row in 0..=CELLS {
        for column in 0..=CELLS {
            let [x, y] = [column, row].map(|at| at as f32 / CELLS as f32);
            text += &format!("v {x} {y} 0\n");
            if has_uvs {
                text += &format!("vt {x} {y}\n");
            }
        }
    }
    for row in 0..CELLS {
        for column in 0..CELLS {
            let a = row * (CELLS + 1) + column + 1;
            let [b, c, d] = [a + 1, a + CELLS + 2, a + CELLS + 1];
            text += &match has_uvs {
                true => format!("f {a}/{a} {b}/{b} {c}/{c} {d}/{d}\n"),
                false => format!("f {a} {b} {c} {d}\n"),
            };
        }
    }
    text
}

fn files(line: &Value) -> Vec<String> {
    let files = line["bake"]["files"].as_array().expect("files");
    files.iter().filter_map(|file| file.as_str().map(str::to_owned)).collect()
}

#[test]
fn vessels_are_baked_into_textures_of_the_mesh() {
    let folder = Folder::new("bake");
    fs::write(folder.path("square.obj"), square(true)).expect("a mesh");
    let (mesh, out) = (folder.path("square.obj"), folder.path("out"));
    let maps = "--maps=albedo,normal,height,roughness,id,depth";
    // Vessels as wide as a texel, so that texels lie within them.
    let wide = "--set=arterial.terminal_radius=0.01";
    let arguments = ["--tissue", &mesh, "--mode=surface", "--bake=64", wide, maps, "--out", &out];
    let lines = generate(&arguments);
    let bake = &lines[0]["bake"];
    assert!(bake["ms"].as_f64().is_some_and(|ms| ms > 0.0));
    assert_eq!((bake["texels"].as_u64(), bake["charts"].as_u64()), (Some(64 * 64), Some(1)));
    let files = files(&lines[0]);
    assert_eq!(files.len(), 6);
    for file in &files {
        let picture = image::open(file).expect("a picture");
        assert_eq!((picture.width(), picture.height()), (64, 64), "{file}");
    }
    assert!(files[4].ends_with("_000001_id.png"), "{}", files[4]);
    let ids = image::open(&files[4]).expect("ids").to_rgba8();
    let texels = ids.pixels().filter(|texel| texel.0[3] > 0).count();
    assert!(texels > 50, "vessels in {texels} texels");
    // What is there is not baked again, and its figures are those of the bake.
    let again = generate(&[&arguments[..], &["--resume"]].concat());
    assert_eq!(again[0]["bake"], lines[0]["bake"]);
    // Another size is another run.
    let other = generate(&["--tissue", &mesh, "--mode=surface", "--bake=32", "--map-format=ktx2", "--out", &out]);
    let others = self::files(&other[0]);
    assert!(others.len() == 2 && others.iter().all(|file| !files.contains(file)));
    assert!(fs::read(&others[0]).is_ok_and(|bytes| bytes.starts_with(b"\xABKTX 20\xBB")));
}

#[test]
fn a_mesh_without_texture_coordinates_is_unwrapped_and_written() {
    let folder = Folder::new("unwrap");
    fs::write(folder.path("bare.obj"), square(false)).expect("a mesh");
    let (mesh, out) = (folder.path("bare.obj"), folder.path("out"));
    let lines = generate(&["--tissue", &mesh, "--mode=surface", "--bake=64", "--out", &out]);
    let files = files(&lines[0]);
    assert_eq!(files.len(), 3);
    let text = fs::read_to_string(&files[2]).expect("a mesh");
    assert_eq!(text.lines().filter(|line| line.starts_with("f ")).count(), 128);
    assert!(text.lines().filter(|line| line.starts_with("vt ")).count() >= 81);
}

#[test]
fn what_cannot_be_baked_is_said() {
    let (code, text) = failure(&["--bake=64"]);
    assert!(code == 2 && text.contains("--bake is for the mesh of an organ"), "{text}");
    let (code, text) = failure(&["--bake=100"]);
    assert!(code == 2 && text.contains("power of two from 16 to 8192"), "{text}");
    let (code, _) = failure(&["--maps=albedo"]);
    assert_eq!(code, 2, "maps without a bake");
}
