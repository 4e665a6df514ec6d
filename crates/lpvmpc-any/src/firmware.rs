//! A controller as a program for a microcontroller.

use crate::controller_settings::limits;
use crate::error::MpcError;
use crate::linearise::lqr;
use crate::settings::{FIRST_PROGRAMS, Limits, LinearModels, MpcSettings, StateBounds, Terminal};
use lpvmpc::Iterations;
use lpvmpc_plant::{FirmwareSettings, Plant, PlantError, Signal};
use nalgebra::DMatrix;

/// What a program shows: its controller drives the plant itself, as a stand-in for a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Demonstration {
    /// Where the crate `lpvmpc` is, as it is to stand in the program's Cargo.toml.
    pub lpvmpc: String,
    /// The state at the start, in the plant's units.
    pub start: Vec<f64>,
    /// Where the plant is to go; `None` means its equilibrium, or zero where it names none.
    pub target: Option<Vec<f64>>,
    /// How many samples it runs.
    pub samples: usize,
}

/// What a program for a microcontroller is printed from ([`Plant::save_firmware`]): the plant with its present parameters
/// and the bounds of `settings`, and the controller. The program runs a descent of at most [`Iterations::MOST`] programs
/// per sample, the first one included, with one Runge-Kutta step, and keeps the bounds of inputs and, softly, of states.
///
/// # Errors
/// A setting that such a program has no place for, or a regulator that there is not.
pub fn firmware(
    plant: &Plant,
    settings: &MpcSettings,
    shown: &Demonstration,
) -> Result<(Plant, FirmwareSettings), MpcError> {
    check(plant, settings)?;
    let (x, u) = plant.operating_point();
    let p = match &settings.terminal {
        Terminal::Cost(p) => p.clone(),
        _ => lqr(plant, settings.t_s, (&settings.q, &settings.r), (&x, &u))?.p,
    };
    let rows = p.row_iter().map(|row| row.iter().copied().collect());
    let printed = FirmwareSettings {
        lpvmpc: shown.lpvmpc.clone(),
        t_s: settings.t_s,
        horizon: settings.horizon,
        q: diagonal("q", &settings.q)?,
        r: diagonal("r", &settings.r)?,
        p: rows.collect(),
        target: shown.target.clone().unwrap_or(x),
        start: shown.start.clone(),
        samples: shown.samples,
    };
    Ok((bounded(plant, settings)?, printed))
}

/// A program has the usual settings, apart from those that it prints.
fn check(plant: &Plant, settings: &MpcSettings) -> Result<(), MpcError> {
    let (tolerance, most, first) = match settings.iterations {
        Iterations::Descent {
            tolerance,
            most,
            first,
        } => (tolerance, most, first),
        Iterations::Fixed(_) => return Err(refused("method", "a descent")),
    };
    match &settings.terminal {
        Terminal::Lqr | Terminal::Cost(_) => {}
        Terminal::Equality => return Err(refused("terminal", "a cost")),
        Terminal::Certified(_) => {
            let right = "a cost, such as the certificate's P: it has no guaranteed loop";
            return Err(refused("terminal", right));
        }
    }
    let is_bounded = |signal: &Signal| signal.lower.is_some() || signal.upper.is_some();
    let keeps_outputs = settings.y_bounds.is_some() || plant.data().outputs.iter().any(is_bounded);
    let checks = [
        ("substeps", settings.substeps == 1, "1"),
        (
            "state_bounds",
            settings.state_bounds == StateBounds::Soft,
            "soft",
        ),
        (
            "linear_models",
            settings.linear_models == LinearModels::Own,
            "the plant's own",
        ),
        (
            "tolerance",
            tolerance == Iterations::<f64>::TOLERANCE,
            "the usual one",
        ),
        (
            "max_programs",
            most == Iterations::<f64>::MOST,
            "the usual number",
        ),
        (
            "first_programs",
            // Beside the usual number the one that the program has.
            [FIRST_PROGRAMS, Iterations::<f64>::MOST].contains(&first),
            "left out",
        ),
        ("u_ref", settings.u_ref.is_none(), "left out"),
        ("rows", settings.rows.is_empty(), "left out"),
        ("q_y", settings.q_y.is_none(), "left out"),
        (
            "y_bounds",
            !keeps_outputs,
            "left out, and the plant's outputs without bounds",
        ),
        ("r_du", settings.r_du.is_none(), "left out"),
        ("du_bounds", settings.du_bounds.is_none(), "left out"),
    ];
    match checks.iter().find(|(_, is_kept, _)| !is_kept) {
        Some((place, _, right)) => Err(refused(place, right)),
        None => Ok(()),
    }
}

fn refused(place: &str, right: &str) -> MpcError {
    MpcError::new(place, format!("on a microcontroller it must be {right}"))
}

fn diagonal(place: &str, weight: &DMatrix<f64>) -> Result<Vec<f64>, MpcError> {
    let entries = weight.diagonal();
    if *weight != DMatrix::from_diagonal(&entries) {
        return Err(refused(place, "diagonal"));
    }
    Ok(entries.iter().copied().collect())
}

/// The plant with its present parameters and the bounds of the settings.
fn bounded(plant: &Plant, settings: &MpcSettings) -> Result<Plant, PlantError> {
    let mut data = plant.data().clone();
    let set = |signals: &mut [Signal], limits: &Limits| {
        let pairs = limits.lower.iter().zip(&limits.upper);
        for (signal, (lower, upper)) in signals.iter_mut().zip(pairs) {
            signal.lower = lower.is_finite().then_some(*lower);
            signal.upper = upper.is_finite().then_some(*upper);
        }
    };
    let (x, u) = (
        limits(&settings.x_bounds, &data.states),
        limits(&settings.u_bounds, &data.inputs),
    );
    set(&mut data.states, &x);
    set(&mut data.inputs, &u);
    // A program has no use for it, and these bounds need not contain it.
    data.equilibrium = None;
    let mut plant_with = Plant::new(data)?;
    plant_with.set_parameters(plant.parameters())?;
    Ok(plant_with)
}
