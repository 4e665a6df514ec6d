//! The closed loops: a plane's, a whole robot's, and one in which a person takes part.

pub(crate) mod excited;
mod excited_robot;
pub(crate) mod motor_sample;
pub(crate) mod planes;
pub(crate) mod record;
pub(crate) mod session;
mod whole_robot;
mod whole_run;
