//! Procedural organs from the command line.

use crate::{Folder, failure, files_of, generate};

#[test]
fn organs_by_name_have_their_preset_and_tell_their_seed() {
    let folder = Folder::new("procedural");
    let out = folder.path("out");
    for (organ, preset, mode) in
        [("eye", "conjunctiva", "surface"), ("kidney", "kidney", "volume"), ("liver", "liver", "volume")]
    {
        let run = |seed: &str| generate(&["--tissue", organ, "--organ-seed", seed, "--out", &out]);
        let (first, other) = (&run("3")[0], &run("4")[0]);
        assert_eq!((&first["tissue"], &first["preset"], &first["mode"]), (&organ.into(), &preset.into(), &mode.into()));
        assert_eq!((&first["organ_seed"], &other["organ_seed"]), (&3.into(), &4.into()));
        // Another organ is another run, with other names.
        assert_ne!((&first["run"], &first["extent"]), (&other["run"], &other["extent"]));
        let names = files_of(first);
        assert!(!names.is_empty() && names.iter().all(|name| name.contains(&format!("/{organ}-3_"))), "{names:?}");
        assert_eq!(&run("3")[0], first);
    }
    // A preset of the user's choice, and no veins, still come from the hilum.
    let paper = &generate(&["--tissue=kidney", "--preset=paper", "--mode=surface", "--no-veins"])[0];
    assert_eq!((&paper["preset"], &paper["organ_seed"]), (&"paper".into(), &0.into()));
    assert!(paper["venous"].is_null() || paper["venous"]["nodes"] == 0);
}

#[test]
fn a_seed_of_an_organ_needs_an_organ() {
    let (code, text) = failure(&["--organ-seed=3"]);
    assert!(code == 2 && text.contains("--organ-seed is for colon, eye, kidney and liver"), "{text}");
}
