//! Files are whole or not there, whatever happens.

use crate::{Folder, obj::obj, random, swc};
use bevy_vessels::synthesis::{
    io::{
        CsvOptions, ObjOptions, SwcOptions, SwcReadOptions, WriteError, load_swc, remove_stale, save_csv, save_obj,
        save_swc, write_atomically,
    },
    tree::VesselKind,
};
use std::fs;
use std::io::{self, Write};

#[test]
fn the_same_tree_gives_the_same_bytes() {
    let tree = random(8, 100);
    assert_eq!(swc(&tree), swc(&tree.clone()));
    let trees = [(VesselKind::Artery, &tree)];
    assert_eq!(obj(&trees, &ObjOptions::default()), obj(&trees, &ObjOptions::default()));
}

#[test]
fn saved_files_hold_what_is_written() {
    let folder = Folder::new("saved");
    let (tree, options) = (random(2, 60), ObjOptions::default());
    let trees = [(VesselKind::Vein, &tree)];
    save_swc(folder.join("a.swc"), &tree, &SwcOptions::default()).expect("a file");
    save_obj(folder.join("a.obj"), &trees, &options).expect("a file");
    save_csv(folder.join("a.csv"), &trees, &CsvOptions::default()).expect("a file");
    assert_eq!(folder.names(), ["a.csv", "a.obj", "a.swc"]);
    let content = |name| fs::read(folder.join(name)).expect("a file");
    assert_eq!(content("a.swc"), swc(&tree));
    assert_eq!(content("a.obj"), obj(&trees, &options));
    assert!(content("a.csv").starts_with(b"system,id,"));
    assert_eq!(load_swc(folder.join("a.swc"), &SwcReadOptions::default()).expect("a tree"), tree);
}

#[test]
fn a_file_is_replaced_whole() {
    let folder = Folder::new("replaced");
    let path = folder.join("tree.swc");
    for content in ["first", "second, longer", "3rd"] {
        write_atomically(&path, |out| out.write_all(content.as_bytes())).expect("a file");
        assert_eq!(fs::read_to_string(&path).expect("a file"), content);
    }
    assert_eq!(folder.names(), ["tree.swc"]);
}

#[test]
fn a_failing_writer_leaves_the_old_file() {
    let folder = Folder::new("failing");
    let path = folder.join("tree.swc");
    fs::write(&path, "old").expect("a file");
    // More than any buffer, so that some data is on the disk when the writer fails.
    let fail = |out: &mut dyn Write| {
        out.write_all(&vec![b'x'; 1 << 20])?;
        Err(io::Error::other("out of ink"))
    };
    let error = write_atomically(&path, fail).expect_err("the writer fails");
    assert!(matches!(&error, WriteError::Write { path: named, .. } if *named == path), "{error:?}");
    assert!(error.to_string().contains("tree.swc") && error.to_string().contains("out of ink"), "{error}");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "old");
    assert_eq!(folder.names(), ["tree.swc"], "nothing is left behind");
    write_atomically(folder.join("new.swc"), fail).expect_err("the writer fails");
    assert_eq!(folder.names(), ["tree.swc"], "nothing half written appears");
    let panicking = path.clone();
    std::thread::spawn(move || write_atomically(panicking, |_| panic!("a bug in a writer")))
        .join()
        .expect_err("a panic");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "old");
    assert_eq!(folder.names(), ["tree.swc"]);
}

#[test]
fn paths_that_cannot_be_written_are_named() {
    let folder = Folder::new("paths");
    let nothing = |_: &mut dyn Write| Ok(());
    let missing = write_atomically(folder.join("no/such/tree.swc"), nothing).expect_err("no folder");
    assert!(matches!(missing, WriteError::Create { .. }) && missing.to_string().contains("tree.swc"), "{missing}");
    fs::create_dir_all(folder.join("taken/full")).expect("a folder");
    let taken = write_atomically(folder.join("taken"), nothing).expect_err("a folder has the name");
    assert!(matches!(taken, WriteError::Replace { .. }), "{taken}");
    assert!(matches!(write_atomically("/", nothing), Err(WriteError::NoFileName { .. })));
    assert!(matches!(write_atomically("..", nothing), Err(WriteError::NoFileName { .. })));
    assert_eq!(folder.names(), ["taken"]);
}

#[test]
fn many_writers_of_one_file_leave_one_whole_content() {
    let folder = Folder::new("many");
    let path = folder.join("tree.csv");
    std::thread::scope(|scope| {
        for writer in 0..8u8 {
            let path = &path;
            scope.spawn(move || {
                for _ in 0..10 {
                    write_atomically(path, |out| out.write_all(&vec![b'a' + writer; 50_000])).expect("a file");
                    let found = fs::read(path).expect("a file");
                    assert!(found.len() == 50_000 && found.iter().all(|byte| *byte == found[0]));
                }
            });
        }
    });
    assert_eq!(folder.names(), ["tree.csv"]);
}

/// Set for the process that must die while it writes.
const VICTIM: &str = "BEVY_VESSELS_TEST_DIE_WRITING";

#[test]
fn a_killed_process_leaves_the_old_file() {
    if let Some(path) = std::env::var_os(VICTIM) {
        let result = write_atomically(path, |out| {
            out.write_all(&vec![b'x'; 1 << 20])?;
            std::process::abort()
        });
        unreachable!("the process is dead: {result:?}");
    }
    let folder = Folder::new("killed");
    let path = folder.join("tree.swc");
    fs::write(&path, "old").expect("a file");
    let victim = std::process::Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", "whole::a_killed_process_leaves_the_old_file", "--nocapture"])
        .env(VICTIM, &path)
        .output()
        .expect("a process");
    assert!(!victim.status.success(), "the process should have died");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "old");
    let leftovers: Vec<String> = folder.names().into_iter().filter(|name| name != "tree.swc").collect();
    assert_eq!(leftovers.len(), 1, "the process died while it wrote: {leftovers:?}");
    assert!(leftovers[0].ends_with(".tmp"));
    write_atomically(&path, |out| out.write_all(b"new")).expect("leftovers are in nobody's way");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "new");
    assert_eq!(remove_stale(&folder.0, |_| false).expect("a folder"), 0, "it may be too new");
    assert_eq!(remove_stale(&folder.0, |_| true).expect("a folder"), 1);
    assert_eq!(folder.names(), ["tree.swc"]);
}

#[test]
fn only_what_nobody_writes_is_stale() {
    let folder = Folder::new("stale");
    let others =
        ["notes.tmp", ".hidden.tmp", ".tree.swc.12-.tmp", ".tree.swc.12-3-4.tmp", "tree.swc.12-3.tmp", ".a.1-2.swc"];
    others.iter().for_each(|name| fs::write(folder.join(name), "mine").expect("a file"));
    fs::create_dir(folder.join(".folder.1-2.tmp")).expect("a folder");
    fs::write(folder.join(".gone.swc.4000000-17.tmp"), "half").expect("a file");
    write_atomically(folder.join("tree.swc"), |out| {
        out.write_all(b"whole")?;
        assert_eq!(remove_stale(&folder.0, |_| true).expect("a folder"), 1, "the other file alone");
        Ok(())
    })
    .expect("a file under way stays");
    assert_eq!(fs::read_to_string(folder.join("tree.swc")).expect("a file"), "whole");
    let mut expected: Vec<String> = others.iter().map(|&name| name.to_owned()).collect();
    expected.extend([".folder.1-2.tmp".to_owned(), "tree.swc".to_owned()]);
    expected.sort();
    assert_eq!(folder.names(), expected);
    assert!(remove_stale(folder.join("missing"), |_| true).is_err());
}
