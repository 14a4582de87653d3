//! The tests of the plugin once more, with all jobs done in slices, as in a browser.

#[path = "plugin/main.rs"]
mod plugin;
