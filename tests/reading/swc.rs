//! Trees as other programs write them.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    io::{ReadError, SwcReadOptions, read_swc},
    tree::VesselTree,
};

const NODES: &str = "1 0 0 0 0 2 -1\n2 0 0 0 1 1.5 1\n3 0 1 0 2 1 2\n4 0 -1 0 2 1 2\n";

fn read(text: impl AsRef<[u8]>) -> Result<VesselTree, ReadError> {
    read_swc(text.as_ref(), &SwcReadOptions::default())
}

#[test]
fn every_line_is_read_whatever_ends_it() {
    let tree = read(NODES).expect("a tree");
    assert_eq!((tree.len(), tree.parents()), (4, &[u32::MAX, 0, 1, 1][..]));
    for end in ["\r", "\r\n", "\n\n", "\r\r\n", " # why\r"] {
        assert_eq!(read(NODES.replace('\n', end)).expect("a tree"), tree, "{end:?}");
    }
    let wide: Vec<u8> = NODES.encode_utf16().flat_map(u16::to_be_bytes).collect();
    assert!(matches!(read(wide), Err(ReadError::Utf16)));
    let after_lines = read("# one\r\r1 0 0 0 0 2 -1\r2 0 0 x 1 1 1\r").expect_err("a letter").to_string();
    assert!(after_lines.starts_with("line 4: y"), "{after_lines}");
}

#[test]
fn whole_numbers_may_have_decimals() {
    let tree = read(NODES).expect("a tree");
    let numbers = |format: &dyn Fn(f64) -> String| {
        let line = |line: &str| {
            let numbers = line.split(' ').map(|word| format(word.parse().expect("a number")));
            numbers.collect::<Vec<_>>().join("\t") + "\n"
        };
        NODES.lines().map(line).collect::<String>()
    };
    // As `numpy.savetxt` writes them, with and without a format.
    assert_eq!(read(numbers(&|number| format!("{number:.6}"))).expect("a tree"), tree);
    assert_eq!(read(numbers(&|number| format!("{number:.18e}"))).expect("a tree"), tree);
    for line in ["1.5 0 0 0 0 1 -1", "1e300 0 0 0 0 1 -1", "nan 0 0 0 0 1 -1", "inf 0 0 0 0 1 -1", "1 0.5 0 0 0 1 -1"] {
        assert!(matches!(read(line), Err(ReadError::Value { line: 1, .. })), "{line}");
    }
}

#[test]
fn lengths_stay_finite() {
    let line = |x: &str, radius: &str| read(format!("1 0 {x} {x} {x} {radius} -1\n2 0 -{x} -{x} -{x} {radius} 1\n"));
    let tree = line("1e9", "1e9").expect("the largest");
    let length = tree.positions()[0].distance(tree.positions()[1]);
    assert!(length.is_finite() && tree.positions()[0] == Vec3::splat(1e9));
    for (x, radius, column) in [("1.1e9", "1", "x"), ("1e30", "1", "x"), ("1e39", "1", "x"), ("1", "2e9", "radius")] {
        let message = line(x, radius).expect_err("beyond").to_string();
        assert_eq!(message, format!("line 1: {column} must be a number within ±1e9"));
    }
}
