//! `lpvmpc simulate` and `lpvmpc bench`.

use crate::PROGRAM;
use crate::arguments::{ExperimentArguments, SimulateArguments};
use crate::closed_loop::Run;
use crate::error::CommandError;
use crate::experiment::Experiment;
use crate::figure::{band, figure, label};
use lpvmpc_plant::Signal;
use lpvmpc_terminal::output;
use lpvmpc_terminal::results::ResultFolder;
use lpvmpc_terminal::table::{Table, short};
use serde_json::{Value, json};
use std::path::PathBuf;

const FILES: [&str; 4] = ["trajectory.csv", "summary.json", "figure.svg", "figure.png"];

/// The unit of what adds to a signal's derivative; in discrete time, of what adds to its next value.
fn per_second(signal: &Signal, period: Option<f64>) -> String {
    match (period, signal.unit.as_str()) {
        (Some(_), unit) => unit.to_owned(),
        (None, "") => "1/s".to_owned(),
        (None, unit) => format!("{unit}/s"),
    }
}

impl Experiment {
    /// The disturbances that its estimator finds, as signals of their own.
    pub fn disturbances(&self) -> Vec<Signal> {
        let data = self.plant.data();
        let found = self.estimator.iter().flat_map(|one| &one.disturbances);
        let signal = |on: &String| {
            let of = |signals: &[Signal]| signals.iter().find(|one| one.name == *on).cloned();
            // Where an input and a state have one name, it is the input.
            let unit = of(&data.inputs)
                .map(|one| one.unit)
                .or_else(|| of(&data.states).map(|one| per_second(&one, self.plant.period())));
            Signal::new(&format!("{on} disturbance"), &unit.unwrap_or_default())
        };
        found.map(|one| signal(&one.on)).collect()
    }
}

/// A bound that is exceeded by less, of a unit, is kept: rounding.
const KEPT: f64 = 1e-9;

/// Runs an experiment and writes what happened.
pub fn run(arguments: &SimulateArguments) -> Result<String, CommandError> {
    let experiment = Experiment::load(&arguments.experiment)?;
    experiment
        .too_late()
        .iter()
        .for_each(|told| output::warn(told));
    let usual = || PathBuf::from("out").join(&experiment.name);
    let out = arguments.out.clone().unwrap_or_else(usual);
    let folder = ResultFolder::open(PROGRAM, &out, &FILES)?;
    let run = Run::new(&experiment)?;
    let summary = summary(&experiment, &run);
    let mut files = vec![
        (
            FILES[0].to_owned(),
            trajectory(&experiment, &run).into_bytes(),
        ),
        (FILES[1].to_owned(), format!("{summary:#}\n").into_bytes()),
    ];
    // What happened is worth keeping without its picture.
    match figure(&experiment, &run).files("figure") {
        Ok(pair) => files.extend(pair),
        Err(error) => output::warn(&format!("the figure could not be drawn: {error}")),
    }
    folder.write(&files, &FILES)?;
    if let Some((t, status)) = &run.first_unsolved {
        return Err(CommandError::NoResult(format!(
            "from t = {t:.6} s on there was not always a plan; there: {status}. The run is in {}",
            out.display()
        )));
    }
    Ok(match arguments.json {
        true => format!("{summary:#}\n"),
        false => {
            let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
            let told = report(&experiment, &run);
            format!(
                "{told}\nWritten: {} with {}\n",
                out.display(),
                names.join(", ")
            )
        }
    })
}

/// Times the steps of the controller along the loop of an experiment.
pub fn bench(arguments: &ExperimentArguments) -> Result<String, CommandError> {
    let experiment = Experiment::load(&arguments.experiment)?;
    let run = Run::new(&experiment)?;
    if arguments.json {
        return Ok(format!("{:#}\n", times(&run)));
    }
    Ok(format!(
        "{} steps\n{}",
        run.step_times.len(),
        time_table(&run)
    ))
}

/// Signals, their values, and the bounds that broke: by how much, and at how many samples.
fn broken(experiment: &Experiment, run: &Run) -> Vec<(String, f64, usize)> {
    let (data, settings) = (experiment.plant.data(), &experiment.settings);
    let kinds: [(&[Signal], _, &[Vec<f64>]); 3] = [
        (&data.states, &settings.x_bounds, &run.x),
        (&data.inputs, &settings.u_bounds, &run.u),
        (&data.outputs, &settings.y_bounds, &run.y),
    ];
    let mut found = Vec::new();
    for (signals, limits, rows) in kinds {
        for (i, signal) in signals.iter().enumerate() {
            let band = band(limits, signal, i);
            let beyond = |row: &Vec<f64>| (band.lower - row[i]).max(row[i] - band.upper);
            let beyond: Vec<f64> = rows.iter().map(beyond).filter(|e| *e > KEPT).collect();
            if !beyond.is_empty() {
                let most = beyond.iter().copied().fold(0.0, f64::max);
                found.push((label(signal), most, beyond.len()));
            }
        }
    }
    found
}

fn times(run: &Run) -> Value {
    json!({
        "steps": run.step_times.len(),
        "median_s": run.step_time(0.5),
        "p99_s": run.step_time(0.99),
        "worst_s": run.step_time(1.0),
    })
}

fn time_table(run: &Run) -> Table {
    let mut table = Table::new(["time of a step", "[ms]"]);
    for (name, quantile) in [("median", 0.5), ("99 %", 0.99), ("worst", 1.0)] {
        table.row([
            name.to_owned(),
            format!("{:.4}", 1e3 * run.step_time(quantile)),
        ]);
    }
    table
}

/// Sum over the samples of (x - x_ref)'Q (x - x_ref), without the inputs; where no reference is given, it is the plant's
/// equilibrium, or zero.
fn state_cost(experiment: &Experiment, run: &Run) -> f64 {
    let (rest, _) = experiment.plant.operating_point();
    let q = experiment.settings.q.diagonal();
    let samples = run.x.iter().take(run.u.len()).enumerate();
    let cost = samples.map(|(k, x)| {
        let x_ref = run.x_ref.get(k).unwrap_or(&rest);
        let errors = x.iter().zip(x_ref).zip(q.iter());
        errors
            .map(|((x, x_ref), q)| q * (x - x_ref).powi(2))
            .sum::<f64>()
    });
    cost.sum()
}

fn summary(experiment: &Experiment, run: &Run) -> Value {
    let exceeded = broken(experiment, run).into_iter();
    let exceeded: Vec<Value> = exceeded
        .map(
            |(signal, most, samples)| json!({ "signal": signal, "most": most, "samples": samples }),
        )
        .collect();
    let mut summary = json!({
        "name": experiment.name,
        "plant": experiment.plant.data().name,
        "samples": run.u.len(),
        "t_s": experiment.settings.t_s,
        "state_cost": state_cost(experiment, run),
        "final_state": run.x.last(),
        "bounds_exceeded": exceeded,
        "statuses": run.statuses,
        "times": times(run),
    });
    if let Some(estimator) = &experiment.estimator {
        let names = estimator.disturbances.iter().map(|one| one.on.clone());
        let last = run.disturbances.last().into_iter().flatten();
        let found: serde_json::Map<_, _> = names.zip(last.map(|one| json!(one))).collect();
        summary["final_disturbances"] = Value::Object(found);
    }
    summary
}

fn report(experiment: &Experiment, run: &Run) -> String {
    let statuses: Vec<String> = { run.statuses.iter() }
        .map(|(status, count)| format!("{status} {count}"))
        .collect();
    let broken: Vec<String> = { broken(experiment, run).into_iter() }
        .map(|(signal, most, samples)| {
            format!("{signal} by {} at most, at {samples} samples", short(most))
        })
        .collect();
    let broken = match broken.is_empty() {
        true => "none".to_owned(),
        false => broken.join("; "),
    };
    let last = run.disturbances.last().into_iter().flatten();
    let signals = experiment.disturbances();
    let found: Vec<String> = { signals.iter().zip(last) }
        .map(|(signal, value)| format!("{} {} {}", signal.name, short(*value), signal.unit))
        .map(|text| text.trim_end().to_owned())
        .collect();
    let found = match found.is_empty() {
        true => String::new(),
        false => format!("  found at the end {}\n", found.join(", ")),
    };
    format!(
        "{}: {} samples of {} s\n  plans            {}\n  bounds exceeded  {broken}\n  \
         cost of states   {}, without the inputs\n{found}\n{}",
        experiment.name,
        run.u.len(),
        short(experiment.settings.t_s),
        statuses.join(", "),
        short(state_cost(experiment, run)),
        time_table(run),
    )
}

/// The run as CSV: numbers in as few digits as give the same bits again. The last line, the end, has no inputs.
fn trajectory(experiment: &Experiment, run: &Run) -> String {
    let data = experiment.plant.data();
    let quoted = |name: &str| match name.contains([',', '"', '\n']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name.to_owned(),
    };
    let mut header = vec!["t [s]".to_owned()];
    let mut add = |signals: &[Signal], suffix: &str| {
        header.extend(signals.iter().map(|one| match one.unit.is_empty() {
            true => quoted(&format!("{}{suffix}", one.name)),
            false => quoted(&format!("{}{suffix} [{}]", one.name, one.unit)),
        }));
    };
    add(&data.states, "");
    add(&data.inputs, "");
    add(&data.outputs, "");
    if !run.x_ref.is_empty() {
        add(&data.states, " reference");
    }
    if !run.estimates.is_empty() {
        add(&data.states, " estimate");
    }
    add(&experiment.disturbances(), "");
    let columns = header.len();
    let mut text = header.join(",") + "\n";
    for (k, x) in run.x.iter().enumerate() {
        let t = k as f64 * experiment.settings.t_s;
        let (estimates, disturbances) = (&run.estimates, &run.disturbances);
        let rest = [&run.u, &run.y, &run.x_ref, estimates, disturbances];
        let rest = rest.into_iter().filter_map(|rows| rows.get(k)).flatten();
        let cells = std::iter::once(&t).chain(x).chain(rest);
        let mut cells: Vec<String> = cells.map(f64::to_string).collect();
        cells.resize(columns, String::new());
        text += &(cells.join(",") + "\n");
    }
    text
}
