//! A recorded run as arrays and as text, and what it amounts to.

mod csv;

pub use csv::{COLUMNS, log_csv, motors_csv, time, trajectory_csv};

use ballbot_scenario::{Plane, Prepared};
use lpvmpc::Guarantee;
use lpvmpc_sim::Trajectory;

/// A trajectory as the arrays that figures take.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// Times, the final one included, s.
    pub time: Vec<f64>,
    /// States at those times.
    pub states: Vec<[f64; 4]>,
    /// Torque held after each of them but the last, N m.
    pub torque: Vec<f64>,
    /// Cost J of each plan.
    pub cost: Vec<f64>,
    /// phi_ref at those times, rad.
    pub phi_reference: Vec<f64>,
    /// Rolled-out minus predicted state at the end of each plan's horizon.
    pub gap: Vec<[f64; 4]>,
    /// What each torque was backed by, and the artificial set point in rad, where there is a
    /// guarantee.
    pub guarantee: Vec<Guarantee<f64>>,
}

impl From<&Trajectory<4, 1>> for Columns {
    fn from(trajectory: &Trajectory<4, 1>) -> Self {
        let samples = &trajectory.samples;
        let times = samples.iter().map(|sample| sample.t);
        let references = samples.iter().map(|sample| sample.x_ref[0]);
        Self {
            time: times.chain([trajectory.final_time]).collect(),
            states: trajectory.states().map(|x| (*x).into()).collect(),
            torque: samples.iter().map(|sample| sample.u[0]).collect(),
            cost: samples.iter().map(|sample| sample.cost).collect(),
            phi_reference: references.chain([trajectory.final_reference[0]]).collect(),
            gap: samples.iter().map(|sample| sample.gap.into()).collect(),
            guarantee: samples
                .iter()
                .filter_map(|sample| sample.guarantee)
                .collect(),
        }
    }
}

/// What one plane's run amounts to.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Metrics {
    /// Samples at which a torque was applied.
    pub samples: usize,
    /// Largest |theta|, rad.
    pub largest_tilt_rad: f64,
    /// Largest |phi_dot|, rad/s.
    pub largest_phi_dot_rad_s: f64,
    /// Largest |theta_dot|, rad/s.
    pub largest_theta_dot_rad_s: f64,
    /// Largest |torque|, N m.
    pub largest_torque_nm: f64,
    /// Root mean square of phi - phi_ref over the samples, rad.
    pub rms_error_rad: f64,
    /// Largest |phi - phi_ref|, rad.
    pub largest_error_rad: f64,
    /// phi_ref at the end of the run, rad.
    pub final_reference_rad: f64,
    /// The set point that a shaped reference was on its way to at the end of the run, rad; none where it had arrived.
    pub unreached_set_point_rad: Option<f64>,
    /// Samples at which the plant's state was outside its bounds.
    pub violations: usize,
    /// Samples whose torque was not backed by a guarantee, where the loop has one.
    pub not_guaranteed: Option<usize>,
    /// Most bounds active in one plan.
    pub most_active_bounds: usize,
    /// Closed-loop cost: the sum of ||x - x_ref||_Q^2 + ||u||_R^2 over the run.
    pub closed_loop_cost: f64,
    /// Mean time per step, microseconds.
    pub mean_step_us: f64,
    /// Its standard deviation, microseconds.
    pub deviation_step_us: f64,
    /// Longest step, microseconds.
    pub longest_step_us: f64,
}

/// A state may lie outside a bound by this much, relative, before it counts as a violation: the
/// accuracy of the solver and of the plant's integration.
const OUTSIDE: f64 = 1e-6;

impl Metrics {
    /// The metrics of one plane.
    pub fn new(prepared: &Prepared, plane: &Plane, trajectory: &Trajectory<4, 1>) -> Self {
        let largest = |index: usize| {
            let values = trajectory.states().map(|x| x[index].abs());
            values.fold(0.0, f64::max)
        };
        let t_s = prepared.settings.t_s;
        let errors: Vec<f64> = trajectory
            .states()
            .enumerate()
            .map(|(k, x)| x[0] - plane.reference.at(k as f64 * t_s))
            .collect();
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        let bounds = &prepared.settings.x;
        let outside = trajectory.states().filter(|x| !bounds.contains(x, OUTSIDE));
        let weights = &prepared.settings.weights;
        let cost = trajectory.samples.iter().map(|sample| {
            let error = sample.x - sample.x_ref;
            error.dot(&(weights.q * error)) + weights.r[0] * sample.u[0] * sample.u[0]
        });
        let samples = &trajectory.samples;
        let torques = samples.iter().map(|sample| sample.u[0].abs());
        let active = samples.iter().map(|sample| sample.active_bounds);
        let times: Vec<f64> = samples
            .iter()
            .map(|sample| sample.step_time.as_secs_f64() * 1e6)
            .collect();
        let (mean, deviation) = mean_and_deviation(&times);
        Self {
            samples: samples.len(),
            largest_tilt_rad: largest(1),
            largest_phi_dot_rad_s: largest(2),
            largest_theta_dot_rad_s: largest(3),
            largest_torque_nm: torques.fold(0.0, f64::max),
            rms_error_rad: (squares / errors.len() as f64).sqrt(),
            largest_error_rad: errors.iter().fold(0.0, |most, error| most.max(error.abs())),
            final_reference_rad: plane.reference.at(prepared.end()),
            unreached_set_point_rad: plane.reference.on_its_way_to(prepared.end()),
            violations: outside.count(),
            not_guaranteed: prepared.guaranteed().map(|_| {
                let guarantees = samples.iter().filter_map(|sample| sample.guarantee);
                samples.len()
                    - guarantees
                        .filter(|guarantee| guarantee.decision.is_guaranteed())
                        .count()
            }),
            most_active_bounds: active.max().unwrap_or(0),
            closed_loop_cost: cost.sum(),
            mean_step_us: mean,
            deviation_step_us: deviation,
            longest_step_us: times.into_iter().fold(0.0, f64::max),
        }
    }
}

impl Metrics {
    /// What a person wants to know of a run: names with units, and numbers with as many digits as
    /// matter.
    pub fn lines(&self) -> [(&'static str, String); 10] {
        let guarantee = || "no guarantee".to_owned();
        let backed = self.not_guaranteed;
        [
            (
                "largest tilt [rad]",
                format!("{:.4}", self.largest_tilt_rad),
            ),
            (
                "largest torque [N m]",
                format!("{:.4}", self.largest_torque_nm),
            ),
            (
                "tracking error, rms [rad]",
                format!("{:.4}", self.rms_error_rad),
            ),
            (
                "tracking error, largest [rad]",
                format!("{:.4}", self.largest_error_rad),
            ),
            ("closed-loop cost", format!("{:.1}", self.closed_loop_cost)),
            ("samples outside the bounds", self.violations.to_string()),
            (
                "samples not backed by a guarantee",
                backed.map_or_else(guarantee, |count| count.to_string()),
            ),
            ("most active bounds", self.most_active_bounds.to_string()),
            (
                "time per step, mean [us]",
                format!("{:.1}", self.mean_step_us),
            ),
            (
                "time per step, longest [us]",
                format!("{:.1}", self.longest_step_us),
            ),
        ]
    }
}

/// Mean and standard deviation; zero for no values.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / count;
    (mean, variance.sqrt())
}
