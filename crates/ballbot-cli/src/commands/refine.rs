//! `ballbot refine`.

use super::CommandError;
use crate::refinement_file::{self, EQUATIONS};
use crate::table::{self, Table, number};
use crate::{input, json, output};
use ballbot_studies::{Refinement, RefinementProblem};
use clap::Args;
use lpvmpc_design::Fit;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Arguments of `ballbot refine`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot refine                             the paper's robot
  ballbot refine --example > robot.toml      a commented file to start from
  ballbot refine robot.toml                  another robot
  ballbot refine robot.toml -o refined.toml  keep b as a [parameters] table, for
                                             `ballbot lqr --parameters refined.toml`

The undamped Gauss-Newton iteration is the paper's; the result is the damped one's
(Levenberg-Marquardt).")]
pub struct RefineArguments {
    /// The linear model p and the geometry [default: the paper's, with p6 negative]
    #[arg(value_name = "FILE.toml")]
    pub file: Option<PathBuf>,
    /// Print a commented input file with the paper's values and stop
    #[arg(long, conflicts_with_all = ["file", "json", "output"])]
    pub example: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Write b and the geometry to this file as a `[parameters]` table; - for standard output, in
    /// place of the report
    #[arg(short, long = "out", alias = "output", value_name = "FILE.toml")]
    pub output: Option<PathBuf>,
}

impl RefineArguments {
    /// Whether the parameters go into a file.
    pub fn writes_a_file(&self) -> bool {
        self.output
            .as_deref()
            .is_some_and(|path| path != Path::new("-"))
    }
}

/// Refines and reports.
///
/// # Errors
/// The file cannot be used, or the damped iteration does not converge.
pub fn run(arguments: &RefineArguments) -> Result<String, CommandError> {
    if arguments.example {
        return Ok(refinement_file::example());
    }
    let problem = match &arguments.file {
        Some(path) => refinement_file::read(path)?,
        None => RefinementProblem::paper(),
    };
    let output = arguments.output.as_deref();
    let file = output.filter(|path| *path != Path::new("-"));
    let given = arguments.file.as_deref();
    file.map(|file| output::check_separate(file, given))
        .transpose()?;
    let refinement = problem.solve()?;
    let table = parameters_toml(&refinement);
    match file {
        Some(path) => output::write_files(&[(path, table.as_bytes())])?,
        None if output.is_some() => return Ok(table),
        None => {}
    }
    Ok(if arguments.json {
        json::text(&document(&refinement))
    } else {
        report(&refinement)
    })
}

fn parameters_toml(refinement: &Refinement) -> String {
    let mut text = "[parameters]\n".to_owned();
    for (key, value) in input::parameter_entries(&refinement.ballbot) {
        // Shortest digits that give the same number again.
        text += &format!("{key} = {value:?}\n");
    }
    text
}

fn report(refinement: &Refinement) -> String {
    let plain = &refinement.gauss_newton;
    let mut text = String::new();
    let sections = [
        (
            "Gauss-Newton, undamped, as published".to_owned(),
            iterations(plain),
        ),
        (
            "Levenberg-Marquardt, damped: the result".to_owned(),
            iterations(&refinement.damped),
        ),
        ("Equations p = h(b)".to_owned(), equations(refinement)),
        ("Poles [1/s]".to_owned(), poles(refinement)),
    ];
    for (title, content) in sections {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{title}\n{content}");
    }
    let _ = writeln!(
        text,
        "As parameters of the nonlinear model\n{}",
        indented(&parameters_toml(refinement))
    );
    let _ = writeln!(
        text,
        "Is this a rigid body?\n{}",
        indented(&refinement.consistency.to_string())
    );
    text
}

fn iterations(fit: &Fit) -> String {
    if !fit.termination.is_converged() {
        return format!(
            "  did not converge in {} steps: {}\n",
            fit.steps(),
            fit.termination
        );
    }
    let mut table = Table::new([
        "step",
        "b1 [m^2]",
        "b2 [m^2]",
        "b3 [m^2]",
        "b4 [m^2/s]",
        "residual norm",
        "step norm",
    ]);
    for (step, iteration) in fit.history.iter().enumerate() {
        let norms = [iteration.residual_norm, iteration.step_norm];
        let numbers = iteration.parameters.iter().chain(&norms);
        let numbers = numbers.map(|value| number(*value));
        table.row(std::iter::once(step.to_string()).chain(numbers));
    }
    format!("{table}  converged: {}\n", fit.termination)
}

fn equations(refinement: &Refinement) -> String {
    let units = ["1/s^2", "1/s", "rad/(s^2 N m)"];
    let mut table = Table::new(["", "p", "h(b)", "p - h(b)", "unit"]);
    for (i, equation) in refinement.equations.iter().enumerate() {
        table.row([
            EQUATIONS[i].to_owned(),
            number(equation.identified),
            number(equation.refined),
            number(equation.difference()),
            units[i % 3].to_owned(),
        ]);
    }
    table.to_string()
}

fn poles(refinement: &Refinement) -> String {
    format!(
        "  of p:    {}\n  of h(b): {}\n",
        table::poles(&refinement.identified_poles),
        table::poles(&refinement.refined_poles)
    )
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("  {line}\n")).collect()
}

fn document(refinement: &Refinement) -> Value {
    let equation = |(i, equation): (usize, &ballbot_studies::Equation)| {
        json!({
            "name": EQUATIONS[i],
            "p": equation.identified,
            "h": equation.refined,
            "difference": equation.difference(),
        })
    };
    let equations = refinement.equations.iter().enumerate().map(equation);
    json!({
        "parameters": json::parameters(&refinement.ballbot),
        "gauss_newton": fit_json(&refinement.gauss_newton),
        "levenberg_marquardt": fit_json(&refinement.damped),
        "equations": equations.collect::<Value>(),
        "poles_of_p_1_s": json::poles(&refinement.identified_poles),
        "poles_of_h_1_s": json::poles(&refinement.refined_poles),
        "consistency": {
            "tilt_rad": refinement.consistency.tilt,
            "physical": refinement.consistency.is_physical(),
            "verdict": refinement.consistency.to_string(),
        },
    })
}

fn fit_json(fit: &Fit) -> Value {
    let iteration = |iteration: &lpvmpc_design::Iteration| {
        json!({
            "b": iteration.parameters.as_slice(),
            "residual_norm": iteration.residual_norm,
            "step_norm": iteration.step_norm,
        })
    };
    json!({
        "converged": fit.termination.is_converged(),
        "termination": fit.termination.to_string(),
        "iterations": fit.history.iter().map(iteration).collect::<Value>(),
    })
}
