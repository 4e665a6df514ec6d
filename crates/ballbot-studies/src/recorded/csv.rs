//! Recorded runs as the text of CSV files.

use ballbot_scenario::{MotorSample, words};
use lpvmpc_sim::{LogRow, Termination, Trajectory};

/// The columns of `trajectory.csv`.
pub const COLUMNS: [&str; 16] = [
    "t_s",
    "phi_rad",
    "theta_rad",
    "phi_dot_rad_s",
    "theta_dot_rad_s",
    "torque_nm",
    "phi_ref_rad",
    "cost",
    "status",
    "step_us",
    "gap_phi_rad",
    "gap_theta_rad",
    "gap_phi_dot_rad_s",
    "gap_theta_dot_rad_s",
    "decision",
    "artificial_set_point_rad",
];

/// A time in s without the rounding of a sum: 0.3, not 0.30000000000000004. Times of samples are
/// far more than a picosecond apart.
pub fn time(t: f64) -> f64 {
    let rounded = (t * 1e12).round() / 1e12;
    if rounded.is_finite() { rounded } else { t }
}

/// `trajectory.csv`: one row per sample, the state at the sample and the torque held after it;
/// a last row with the final state and no torque. After a run that ended early, the last row's
/// status says why.
pub fn trajectory_csv(trajectory: &Trajectory<4, 1>) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for sample in &trajectory.samples {
        let (x, gap) = (&sample.x, &sample.gap);
        let step_us = sample.step_time.as_secs_f64() * 1e6;
        let guarantee = sample.guarantee.map_or_else(
            || ",".to_owned(),
            |guarantee| format!("{},{:?}", guarantee.decision, guarantee.set_point),
        );
        text += &format!(
            "{:?},{:?},{:?},{:?},{:?},{:?},{:?},{:?},{},{step_us:.3},{:?},{:?},{:?},{:?},{guarantee}\n",
            time(sample.t),
            x[0],
            x[1],
            x[2],
            x[3],
            sample.u[0],
            sample.x_ref[0],
            sample.cost,
            sample.status,
            gap[0],
            gap[1],
            gap[2],
            gap[3],
        );
    }
    let x = &trajectory.final_state;
    let status = match &trajectory.termination {
        Termination::Complete => String::new(),
        // Commas would be columns.
        other => words::termination(other).replace(',', ";"),
    };
    text += &format!(
        "{:?},{:?},{:?},{:?},{:?},,{:?},,{status},,,,,,,\n",
        time(trajectory.final_time),
        x[0],
        x[1],
        x[2],
        x[3],
        trajectory.final_reference[0]
    );
    text
}

/// The log of one plane, as a robot would have written it: one row per sample of the sensors,
/// with the torque commanded from there on and the mean torque of the drive until the next row.
/// A missing reading is an empty cell; a row without any reading is left out.
pub fn log_csv(log: &[LogRow<4, 1>]) -> String {
    let mut text =
        "t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_commanded_nm,torque_applied_nm\n".to_owned();
    let cell = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:?}"));
    for row in log {
        let [phi, theta, _, theta_dot] = row.readings.map(|reading| Some(reading?.value));
        if [phi, theta, theta_dot].iter().all(Option::is_none) {
            continue;
        }
        text += &format!(
            "{:?},{},{},{},{:?},{:?}\n",
            time(row.t),
            cell(phi),
            cell(theta),
            cell(theta_dot),
            row.commanded[0],
            row.applied[0]
        );
    }
    text
}

/// `motors.csv`: the three motors' torques, held from each sample to the next, the heading and
/// where it has to be.
pub fn motors_csv(motors: &[MotorSample]) -> String {
    let mut text = "t_s,motor_1_nm,motor_2_nm,motor_3_nm,heading_rad,heading_ref_rad\n".to_owned();
    for sample in motors {
        let [first, second, third] = sample.torques.into();
        text += &format!(
            "{:?},{first:?},{second:?},{third:?},{:?},{:?}\n",
            time(sample.t),
            sample.heading,
            sample.target
        );
    }
    text
}
