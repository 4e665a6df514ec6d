//! `ballbot linearize`.

use super::CommandError;
use super::model::{ModelArguments, ModelChoice};
use crate::json;
use crate::table::{self, Table, short};
use ballbot_studies::LinearModel;
use clap::Args;
use lpvmpc::LpvModel;
use nalgebra::{Complex, Vector3};
use serde_json::{Value, json};

/// Arguments of `ballbot linearize`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot linearize                              the paper's robot, upright
  ballbot linearize --model p                    the paper's identified linear model
  ballbot linearize --theta 20 --theta-dot -90   the LPV model at this scheduling
  ballbot linearize --parameters robot.toml      another robot

Away from upright these are the matrices A(s), B(s) of the LPV model, with which
x_dot = A(s) x + B(s) u is the nonlinear model exactly; they are not the Jacobian of the nonlinear
model. Upright they are both.")]
pub struct LinearizeArguments {
    /// Robot and linear model.
    #[command(flatten)]
    pub model: ModelArguments,
    /// Tilt, degrees, from -180 to 180 [default: 0]
    #[arg(long, value_name = "DEG", value_parser = tilt, allow_negative_numbers = true)]
    pub theta: Option<f64>,
    /// Tilt rate, degrees per second [default: 0]
    #[arg(
        long,
        value_name = "DEG_PER_S",
        value_parser = crate::arguments::finite,
        allow_negative_numbers = true
    )]
    pub theta_dot: Option<f64>,
    /// Speed of the drive, phi_dot - theta_dot, degrees per second; only Coulomb friction depends
    /// on it [default: 0]
    #[arg(
        long,
        value_name = "DEG_PER_S",
        value_parser = crate::arguments::finite,
        allow_negative_numbers = true
    )]
    pub drive_speed: Option<f64>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

fn tilt(text: &str) -> Result<f64, String> {
    let value = crate::arguments::finite(text)?;
    if value.abs() <= 180.0 {
        Ok(value)
    } else {
        Err(format!("{} is not from -180 to 180 degrees", short(value)))
    }
}

/// The matrices and what they say.
struct Report {
    /// In words.
    title: String,
    /// theta in rad, theta_dot and phi_dot - theta_dot in rad/s.
    scheduling: Vector3<f64>,
    model: LinearModel,
    poles: Vec<Complex<f64>>,
    rank: usize,
}

/// Linearises and reports.
///
/// # Errors
/// The parameters cannot be used, a scheduling is given for the identified linear model, or the
/// model does not exist there.
pub fn run(arguments: &LinearizeArguments) -> Result<String, CommandError> {
    let report = Report::new(arguments)?;
    Ok(if arguments.json {
        json::text(&report.document(arguments))
    } else {
        report.text()
    })
}

impl Report {
    fn new(arguments: &LinearizeArguments) -> Result<Self, CommandError> {
        let LinearizeArguments {
            model: choice,
            theta,
            theta_dot,
            drive_speed,
            ..
        } = arguments;
        let degrees = Vector3::new(
            theta.unwrap_or(0.0),
            theta_dot.unwrap_or(0.0),
            drive_speed.unwrap_or(0.0),
        );
        let scheduling = degrees.map(f64::to_radians);
        let (title, model) = match choice.model {
            ModelChoice::P => {
                refuse_for_p(arguments)?;
                let model = choice.upright(&choice.robot.ballbot()?);
                (choice.model.description().to_owned(), model)
            }
            ModelChoice::B => {
                let title = format!(
                    "LPV model b at the scheduling theta = {} deg, theta_dot = {} deg/s",
                    short(degrees[0]),
                    short(degrees[1])
                );
                let matrices = choice.robot.ballbot()?.matrices(&scheduling);
                (title, LinearModel::from(matrices))
            }
        };
        Ok(Self {
            title,
            scheduling,
            poles: model.poles()?,
            rank: model.controllability_rank()?,
            model,
        })
    }

    fn text(&self) -> String {
        let states = ["phi", "theta", "phi_dot", "theta_dot"];
        let rates = ["phi'", "theta'", "phi_dot'", "theta_dot'"];
        let size = self.model.a.nrows();
        let reach = if self.rank == size {
            "the torque reaches every state"
        } else {
            "the torque does not reach every state"
        };
        format!(
            "{}\nx' = A x + B tau, x = (phi, theta, phi_dot, theta_dot) in rad and rad/s, tau in N m\n\n\
             A\n{}\nB\n{}\nPoles [1/s]\n  {}\n\nControllability rank {} of {size}: {reach}\n",
            self.title,
            Table::of_matrix(states, &rates, &self.model.a),
            Table::of_matrix(["tau"], &rates, &self.model.b),
            table::poles(&self.poles),
            self.rank,
        )
    }

    fn document(&self, arguments: &LinearizeArguments) -> Value {
        json!({
            "model": arguments.model.model.name(),
            "theta_rad": self.scheduling[0],
            "theta_dot_rad_s": self.scheduling[1],
            "drive_speed_rad_s": self.scheduling[2],
            "a": json::matrix(&self.model.a),
            "b": json::matrix(&self.model.b),
            "poles_1_s": json::poles(&self.poles),
            "controllability_rank": self.rank,
        })
    }
}

/// The identified model has no scheduling and no other robot.
fn refuse_for_p(arguments: &LinearizeArguments) -> Result<(), CommandError> {
    let given = [
        ("--theta", arguments.theta.is_some()),
        ("--theta-dot", arguments.theta_dot.is_some()),
        ("--drive-speed", arguments.drive_speed.is_some()),
        ("--parameters", arguments.model.robot.parameters.is_some()),
    ];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => Err(CommandError::Usage(format!(
            "{option} does not go with --model p: p is the paper's linear model, of its robot at \
             the upright equilibrium. Use --model b"
        ))),
        None => Ok(()),
    }
}
