//! What the programs `ballbot` and `lpvmpc` share: files that are whole or not there, folders of results in
//! which others' files are safe, interrupts, progress, and tables of numbers.
#![cfg_attr(
    test,
    allow(clippy::unwrap_used, reason = "a test that cannot go on must fail")
)]

pub mod interrupt;
pub mod output;
pub mod progress;
pub mod results;
pub mod table;
