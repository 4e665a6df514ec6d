//! The closed loops whose optimal costs are known.

use crate::StudyError;
use nalgebra::Vector4;

const DISTANCES: &str = include_str!("../../../../testdata/nonlinear-mpc/distances.csv");
const RANDOM_STARTS: &str = include_str!("../../../../testdata/nonlinear-mpc/random-starts.csv");
const NARROW_BOUNDS: &str = include_str!("../../../../testdata/nonlinear-mpc/narrow-bounds.csv");

/// A closed loop to a set point that is given at t = 0 without preview, with the weights and the
/// terminal cost of `testdata/nonlinear-mpc`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Samples of the horizon.
    pub horizon: usize,
    /// Sampling time, s.
    pub t_s: f64,
    /// Where the ball is to roll, m.
    pub distance: f64,
    /// The state at t = 0.
    pub start: Vector4<f64>,
    /// Duration of the loop, s.
    pub duration: f64,
    /// Bounds of theta, phi_dot and theta_dot either way and of the torque, rad, rad/s and N m, at prices that rise with the
    /// way; without them those of `single-setpoint`, at prices that are the same everywhere.
    pub bounds: Option<[f64; 4]>,
    /// Closed-loop cost of nonlinear MPC.
    pub nonlinear: f64,
    /// Closed-loop cost of linear MPC.
    pub linear: f64,
    /// Whether the robot fell under nonlinear MPC: such a cost measures nothing.
    pub nonlinear_fell: bool,
    /// Largest part by which nonlinear MPC exceeded a state bound at a sample.
    pub nonlinear_excess: f64,
    /// The same of linear MPC.
    pub linear_excess: f64,
    /// Samples of both loops at which IPOPT did not converge.
    pub not_converged: usize,
}

/// From rest, by distance, horizon and sampling time.
///
/// # Errors
/// None should occur, as there is no input.
pub fn distances() -> Result<Vec<Case>, StudyError> {
    read(DISTANCES)
}

/// From random states.
///
/// # Errors
/// None should occur, as there is no input.
pub fn random_starts() -> Result<Vec<Case>, StudyError> {
    read(RANDOM_STARTS)
}

/// From rest, within bounds that are narrower.
///
/// # Errors
/// None should occur, as there is no input.
pub fn narrow_bounds() -> Result<Vec<Case>, StudyError> {
    read(NARROW_BOUNDS)
}

fn read(text: &str) -> Result<Vec<Case>, StudyError> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let cases = lines.map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let column = |name: &str| header.iter().position(|title| *title == name);
        let optional =
            |name: &str| column(name).map(|i| cells.get(i).and_then(|cell| cell.parse().ok()));
        let value = |name: &str| -> Result<f64, StudyError> {
            let missing = || StudyError::ReferenceCosts {
                column: name.to_owned(),
                row: line.to_owned(),
            };
            optional(name).flatten().ok_or_else(missing)
        };
        // From rest, where there are no columns of the state.
        let start = |name| optional(name).flatten().unwrap_or(0.0);
        let bound = |name| optional(name).flatten();
        let bounds = [
            bound("theta_bound_rad"),
            bound("phi_dot_bound_rad_s"),
            bound("theta_dot_bound_rad_s"),
            bound("torque_bound_nm"),
        ];
        let bounds = match bounds {
            [Some(theta), Some(phi_dot), Some(theta_dot), Some(torque)] => {
                Some([theta, phi_dot, theta_dot, torque])
            }
            _ => None,
        };
        Ok(Case {
            horizon: value("horizon")? as usize,
            t_s: value("t_s_s")?,
            distance: value("distance_m")?,
            start: Vector4::new(
                0.0,
                start("theta0_rad"),
                start("phi_dot0_rad_s"),
                start("theta_dot0_rad_s"),
            ),
            duration: value("duration_s")?,
            bounds,
            nonlinear: value("cost_nonlinear")?,
            linear: value("cost_linear")?,
            nonlinear_fell: value("fell_nonlinear")? > 0.0,
            nonlinear_excess: value("largest_excess_nonlinear")?,
            linear_excess: value("largest_excess_linear")?,
            not_converged: (value("not_converged")? + value("not_converged_linear")?) as usize,
        })
    });
    cases.collect()
}
