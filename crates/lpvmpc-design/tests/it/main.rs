//! The design tools against the paper's numbers, certified data and second routes.

mod paper;

mod ballbot_parameters;
mod embedding_check;
mod frozen_stability;
mod least_squares_failures;
mod linearize;
mod lqr;
mod nist;
mod riccati;
mod rk4_step;
mod shooting;
