//! Cuts against brute force: the segments that a blade severs, the ledger of wounds, and the pieces to draw.

mod common;
mod crossings;
mod degenerate;
mod flat_ends;
mod flow;
mod indexed;
mod ledger;
mod random_actions;
mod remains;
mod stumps;
mod withdrawal;
