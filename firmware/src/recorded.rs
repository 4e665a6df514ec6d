//! The recorded scenarios, written by the example `firmware_record` of `ballbot-scenario`.

#[rustfmt::skip]
mod lissajous;
#[rustfmt::skip]
mod tight_bounds;
#[rustfmt::skip]
mod whole_robot;

pub use lissajous::RECORDING as LISSAJOUS;
pub use tight_bounds::RECORDING as TIGHT_BOUNDS;
pub use whole_robot::RECORDING as WHOLE_ROBOT;
