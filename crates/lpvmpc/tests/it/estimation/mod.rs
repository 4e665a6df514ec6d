//! Estimator, delay line, ramped input, set points and smooth moves.

mod clock;
mod delay;
mod estimator;
mod gate;
mod late;
mod pendulum;
mod ramp;
mod regulator;
mod set_points;
mod shaping;
mod told;
