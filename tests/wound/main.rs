//! Cuts against brute force: what a blade severs, the ledger of wounds, and what is left to draw.

mod common;
mod crossings;
mod degenerate;
mod flat_ends;
mod flow;
mod indexed;
mod ledger;
mod random_actions;
mod stumps;
mod withdrawal;
