//! The tests of the plugin, repeated with all jobs in slices, as in a browser.

#[path = "plugin/main.rs"]
mod plugin;
