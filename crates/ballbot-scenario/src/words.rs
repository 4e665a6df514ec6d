//! Statuses and endings for people, with the ballbot's names.

use lpvmpc::Status;
use lpvmpc_sim::Ending;

/// Names of the states, in their order.
pub const STATES: [&str; 4] = ["phi", "theta", "phi_dot", "theta_dot"];

/// Why a run ended, with its time.
pub fn ending(ending: &Ending) -> String {
    match ending {
        Ending::Complete => "complete".to_owned(),
        Ending::OutOfRange { t, component } => {
            let state = STATES.get(*component).copied().unwrap_or("state");
            format!("the robot has fallen: {state} left its range by t = {t:.3} s")
        }
        Ending::NoPlan { t, status } => {
            format!("no plan at t = {t:.3} s: {}", self::status(status))
        }
        Ending::PlantFailed { t, error } => format!("at t = {t:.3} s: {error}"),
    }
}

/// The solver's status.
pub fn status(status: &Status<f64>) -> String {
    let mut text = status.to_string();
    for (index, name) in STATES.iter().enumerate() {
        text = text.replace(&format!("state {index}"), name);
    }
    text.replace("input 0", "the torque")
}
