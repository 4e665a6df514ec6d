//! Studies against what is known from elsewhere.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod optimality;
