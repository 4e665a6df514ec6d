//! The closed loops whose optimal costs are known.

use crate::StudyError;
use nalgebra::Vector4;

const DISTANCES: &str = include_str!("../../../../testdata/nonlinear-mpc/distances.csv");
const RANDOM_STARTS: &str = include_str!("../../../../testdata/nonlinear-mpc/random-starts.csv");
const RISING_PRICES: &str =
    include_str!("../../../../testdata/nonlinear-mpc/random-starts-raised.csv");
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
    /// Bounds of theta, phi_dot and theta_dot either way and of the torque, rad, rad/s and N m; without them those of
    /// `single-setpoint`.
    pub bounds: Option<[f64; 4]>,
    /// Whether the prices of state bounds rise with the way to the set point, as in scenarios.
    pub raised: bool,
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

/// From rest, by distance, horizon and sampling time, at prices that are the same everywhere.
///
/// # Errors
/// None should occur, as there is no input.
pub fn distances() -> Result<Vec<Case>, StudyError> {
    read(DISTANCES, false)
}

/// From random states, at prices that are the same everywhere.
///
/// # Errors
/// None should occur, as there is no input.
pub fn random_starts() -> Result<Vec<Case>, StudyError> {
    read(RANDOM_STARTS, false)
}

/// From the same states, at prices that rise with the way.
///
/// # Errors
/// None should occur, as there is no input.
pub fn rising_prices() -> Result<Vec<Case>, StudyError> {
    read(RISING_PRICES, true)
}

/// From rest, within bounds that are narrower, at prices that rise with the way.
///
/// # Errors
/// None should occur, as there is no input.
pub fn narrow_bounds() -> Result<Vec<Case>, StudyError> {
    read(NARROW_BOUNDS, true)
}

/// A row of a table, with the titles of its columns.
struct Row<'a> {
    titles: &'a str,
    line: &'a str,
}

impl Row<'_> {
    /// `None` where there is no such column.
    fn optional(&self, name: &str) -> Option<f64> {
        let column = self.titles.split(',').position(|title| title == name)?;
        self.line.split(',').nth(column)?.parse().ok()
    }

    fn value(&self, name: &str) -> Result<f64, StudyError> {
        self.optional(name)
            .ok_or_else(|| StudyError::ReferenceCosts {
                column: name.to_owned(),
                row: self.line.to_owned(),
            })
    }
}

fn rows(table: &str) -> impl Iterator<Item = Row<'_>> {
    let mut lines = table.lines();
    let titles = lines.next().unwrap_or_default();
    lines.map(move |line| Row { titles, line })
}

fn read(table: &str, raised: bool) -> Result<Vec<Case>, StudyError> {
    let cases = rows(table).map(|row| {
        // From rest, where there are no columns of the state.
        let start = |name| row.optional(name).unwrap_or(0.0);
        let bounds = [
            row.optional("theta_bound_rad"),
            row.optional("phi_dot_bound_rad_s"),
            row.optional("theta_dot_bound_rad_s"),
            row.optional("torque_bound_nm"),
        ];
        let bounds = match bounds {
            [Some(theta), Some(phi_dot), Some(theta_dot), Some(torque)] => {
                Some([theta, phi_dot, theta_dot, torque])
            }
            _ => None,
        };
        let not_converged = row.value("not_converged")? + row.value("not_converged_linear")?;
        Ok(Case {
            horizon: row.value("horizon")? as usize,
            t_s: row.value("t_s_s")?,
            distance: row.value("distance_m")?,
            start: Vector4::new(
                0.0,
                start("theta0_rad"),
                start("phi_dot0_rad_s"),
                start("theta_dot0_rad_s"),
            ),
            duration: row.value("duration_s")?,
            bounds,
            raised,
            nonlinear: row.value("cost_nonlinear")?,
            linear: row.value("cost_linear")?,
            nonlinear_fell: row.value("fell_nonlinear")? > 0.0,
            nonlinear_excess: row.value("largest_excess_nonlinear")?,
            linear_excess: row.value("largest_excess_linear")?,
            not_converged: not_converged as usize,
        })
    });
    cases.collect()
}
