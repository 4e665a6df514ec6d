//! `lpvmpc lqr`: the regulator of the sampled plant.

use crate::arguments::ExperimentArguments;
use crate::describe::{matrix, named, poles, residual};
use crate::error::CommandError;
use crate::experiment::Experiment;
use lpvmpc_any::AT_REST;
use lpvmpc_terminal::table;
use serde_json::json;

/// Designs the regulator about the plant's equilibrium (zero where it names none), and reports.
pub fn run(arguments: &ExperimentArguments) -> Result<String, CommandError> {
    let experiment = Experiment::load(&arguments.experiment)?;
    let (plant, settings) = (&experiment.plant, &experiment.settings);
    let (x, u) = plant.operating_point();
    let residual = residual(plant, &x, &u)?;
    if !(residual <= AT_REST) {
        return Err(CommandError::NoResult(format!(
            "{}: a state changes by {residual} at x = {x:?}, u = {u:?}; a regulator needs an equilibrium. Name one in \
             the plant's file",
            plant.data().name
        )));
    }
    let weights = (&settings.q, &settings.r);
    let lqr = lpvmpc_any::lqr(plant, settings.t_s, weights, (&x, &u))
        .map_err(|error| experiment.refused("controller", &error))?;
    if arguments.json {
        let document = json!({
            "plant": plant.data().name,
            "t_s": settings.t_s,
            "x_eq": x,
            "u_eq": u,
            "k": matrix(&lqr.k),
            "p": matrix(&lqr.p),
            "closed_loop_eigenvalues": poles(&lqr.poles),
        });
        return Ok(format!("{document:#}\n"));
    }
    let data = plant.data();
    Ok(format!(
        "LQR of {}, sampled every {} s: u = u_eq - K (x - x_eq)\n\nK\n{}\nP\n{}\n\
         Eigenvalues of the closed loop\n  {}\n",
        data.name,
        table::short(settings.t_s),
        named(&data.inputs, &data.states, &lqr.k),
        named(&data.states, &data.states, &lqr.p),
        table::poles(&lqr.poles),
    ))
}
