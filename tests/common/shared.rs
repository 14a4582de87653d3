//! The folder `shared` beside the checkout, with organs and vessels that are not a part of it.

use std::path::{Path, PathBuf};

/// Set to 1 where these tests must not be skipped, as `.ci/run` does where it finds the folder.
const REQUIRED: &str = "BEVY_VESSELS_REQUIRE_SHARED";

/// A file or folder below `shared`. Without it the test is skipped, with a message.
///
/// # Panics
/// Without it, if tests that need it are required.
pub fn folder(below: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(below);
    if path.exists() {
        return Some(path);
    }
    let is_required = std::env::var_os(REQUIRED).is_some_and(|value| value == "1");
    assert!(!is_required, "{REQUIRED} is set, but there is no {}", path.display());
    println!("skipped: there is no {}", path.display());
    None
}
