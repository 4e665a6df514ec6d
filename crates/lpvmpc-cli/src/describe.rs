//! `lpvmpc plant`: what a plant is.

use crate::arguments::PlantArguments;
use crate::error::CommandError;
use lpvmpc_any::AT_REST;
use lpvmpc_design::controllability_rank;
use lpvmpc_plant::{Plant, Signal};
use lpvmpc_terminal::table::{self, Table, short};
use lpvmpc_words::read_text;
use nalgebra::{Complex, DMatrix};
use serde_json::{Value, json};
use std::path::Path;

/// The plant in the file at `path`.
pub fn load(path: &Path) -> Result<Plant, CommandError> {
    let text = read_text(path).map_err(|source| CommandError::Read {
        path: path.to_owned(),
        source,
    })?;
    Plant::from_json(&text).map_err(|source| CommandError::Plant {
        path: path.to_owned(),
        source,
    })
}

/// The rows of a matrix.
pub fn matrix(matrix: &DMatrix<f64>) -> Value {
    let rows = matrix.row_iter();
    rows.map(|row| row.iter().copied().collect::<Vec<f64>>())
        .collect()
}

/// Complex numbers, each as `{"re": .., "im": ..}`.
pub fn poles(poles: &[Complex<f64>]) -> Value {
    let poles = poles.iter();
    poles
        .map(|one| json!({ "re": one.re, "im": one.im }))
        .collect()
}

/// A matrix with the names of its rows and columns.
pub fn named(rows: &[Signal], columns: &[Signal], matrix: &DMatrix<f64>) -> Table {
    let headers = columns.iter().map(|one| one.name.clone());
    let mut table = Table::new(std::iter::once(String::new()).chain(headers));
    for (row, entries) in rows.iter().zip(matrix.row_iter()) {
        let numbers = entries.iter().map(|entry| table::number(*entry));
        table.row(std::iter::once(row.name.clone()).chain(numbers));
    }
    table
}

/// The largest change of a state at `x` under `u`, in its unit per second, or per period of a plant in discrete time;
/// NaN where the plant has no value.
pub fn residual(plant: &Plant, x: &[f64], u: &[f64]) -> Result<f64, CommandError> {
    let motion: Vec<f64> = match plant.period() {
        None => plant.derivative(x, u)?,
        Some(_) => {
            let next = plant.next(x, u)?;
            next.iter().zip(x).map(|(next, x)| next - x).collect()
        }
    };
    Ok(match motion.iter().any(|one| one.is_nan()) {
        true => f64::NAN,
        false => motion
            .iter()
            .fold(0.0, |most: f64, one| most.max(one.abs())),
    })
}

/// What is found about a plant where it is linearised.
struct Linearisation {
    /// The largest entry of f(x, u), or of F(x, u) - x.
    residual: f64,
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    eigenvalues: Vec<Complex<f64>>,
    controllable: usize,
}

impl Linearisation {
    fn new(plant: &Plant, x: &[f64], u: &[f64]) -> Result<Self, CommandError> {
        let (a, b) = lpvmpc_any::jacobian(plant, x, u)?;
        Ok(Self {
            residual: residual(plant, x, u)?,
            eigenvalues: lpvmpc_design::poles(&a)?,
            controllable: match b.ncols() {
                0 => 0,
                _ => controllability_rank(&a, &b)?,
            },
            a,
            b,
        })
    }
}

/// Says what the plant of a file is.
pub fn run(arguments: &PlantArguments) -> Result<String, CommandError> {
    let plant = load(&arguments.file)?;
    let (x, u) = plant.operating_point();
    let found = Linearisation::new(&plant, &x, &u)?;
    Ok(match arguments.json {
        true => format!("{:#}\n", document(&plant, &found, (&x, &u))),
        false => report(&plant, &found, (&x, &u)),
    })
}

fn document(plant: &Plant, found: &Linearisation, (x, u): (&[f64], &[f64])) -> Value {
    let data = plant.data();
    json!({
        "name": data.name,
        "period_s": data.period,
        "states": data.states,
        "inputs": data.inputs,
        "outputs": data.outputs,
        "parameters": data.parameters,
        "operations": data.operations.len(),
        "has_embedding": data.embedding.is_some(),
        "names_equilibrium": data.equilibrium.is_some(),
        "x": x,
        "u": u,
        "residual": found.residual,
        "is_equilibrium": found.residual <= AT_REST,
        "a": matrix(&found.a),
        "b": matrix(&found.b),
        "eigenvalues": poles(&found.eigenvalues),
        "controllability_rank": found.controllable,
    })
}

fn report(plant: &Plant, found: &Linearisation, (x, u): (&[f64], &[f64])) -> String {
    let data = plant.data();
    let time = match data.period {
        None => "continuous time".to_owned(),
        Some(period) => format!("discrete time with a period of {} s", short(period)),
    };
    let mut text = format!(
        "{}, in {time}, {} operations\n\n",
        data.name,
        data.operations.len()
    );
    let mut table = Table::new(["", "name", "unit", "lower", "upper"]);
    for (kind, signals) in [
        ("state", &data.states),
        ("input", &data.inputs),
        ("output", &data.outputs),
    ] {
        for one in signals {
            let bound = |bound: Option<f64>| bound.map_or(String::new(), short);
            let (lower, upper) = (bound(one.lower), bound(one.upper));
            table.row([
                kind.to_owned(),
                one.name.clone(),
                one.unit.clone(),
                lower,
                upper,
            ]);
        }
    }
    text += &format!("{table}\n");
    if !data.parameters.is_empty() {
        let mut table = Table::new(["parameter", "value", "unit"]);
        for one in &data.parameters {
            table.row([one.name.clone(), short(one.value), one.unit.clone()]);
        }
        text += &format!("{table}\n");
    }
    let list = |values: &[f64]| {
        let values: Vec<String> = values.iter().map(|value| short(*value)).collect();
        values.join(", ")
    };
    let at = match data.equilibrium {
        Some(_) => "the equilibrium of its file",
        None => "zero, since its file names no equilibrium",
    };
    let rest = match found.residual <= AT_REST {
        true => "the plant stands there",
        false => "the plant does not stand there: this is no equilibrium",
    };
    let (per, stability) = match data.period {
        None => (
            "per second",
            found.eigenvalues.iter().all(|one| one.re < 0.0),
        ),
        Some(_) => (
            "per period",
            found.eigenvalues.iter().all(|one| one.norm() < 1.0),
        ),
    };
    let n = data.states.len();
    let reach = match found.controllable == n {
        true => "the inputs reach every state",
        false => "the inputs do not reach every state",
    };
    text += &format!(
        "Linearised at {at}: x = ({}), u = ({})\n  {rest}; largest change of a state: {} {per}\n\n\
         A\n{}\nB\n{}\nEigenvalues\n  {}\n  {}\n\nControllability rank {} of {n}: {reach}\n",
        list(x),
        list(u),
        short(found.residual),
        named(&data.states, &data.states, &found.a),
        named(&data.states, &data.inputs, &found.b),
        table::poles(&found.eigenvalues),
        match stability {
            true => "asymptotically stable without control",
            false => "not asymptotically stable without control",
        },
        found.controllable,
    );
    text
}
