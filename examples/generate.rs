//! Grows vessels without a window, one organ after the other: the command for batches and cluster jobs.
//!
//! ```text
//! cargo run --release --example generate -- --tissue disc --seed 1 --count 100 --out networks --format swc,csv --json
//! ```
//!
//! You see a progress bar and a line per organ; `--help` lists all options. Organ number k has seed `--seed` + k and is
//! the same for any count, shard and number of threads, so an array job uses `--shard $TASK/$TASKS`.

#[path = "generate/command.rs"]
mod command;

use clap::Parser;
use std::process::{ExitCode, exit};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the user has asked to stop.
static STOP: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    let options = command::Options::parse();
    // Asked once, the command ends cleanly; asked again, at once.
    let stop = || {
        if STOP.swap(true, Ordering::Relaxed) {
            exit(130);
        }
    };
    if let Err(error) = ctrlc::set_handler(stop) {
        eprintln!("generate: warning: an interruption will leave temporary files: {error}");
    }
    match command::run(&options, &mut std::io::stdout().lock(), &STOP) {
        Ok(summary) => {
            // Beside the lines for scripts, not among them.
            if options.count > 1 {
                eprint!("{summary}");
            }
            ExitCode::SUCCESS
        }
        Err(failure) => {
            eprintln!("generate: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}
