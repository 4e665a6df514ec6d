//! The recorded scenarios, written by the example `firmware_record` of `ballbot-scenario`.

#[rustfmt::skip]
mod lissajous;
#[rustfmt::skip]
mod tight_bounds;

pub use lissajous::RECORDING as LISSAJOUS;
pub use tight_bounds::RECORDING as TIGHT_BOUNDS;
