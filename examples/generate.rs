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
use std::process::ExitCode;

fn main() -> ExitCode {
    let options = command::Options::parse();
    match command::run(&options, &mut std::io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("generate: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}
