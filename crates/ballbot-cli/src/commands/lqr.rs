//! `ballbot lqr`.

use super::CommandError;
use super::model::ModelArguments;
use crate::arguments::{finite, positive};
use crate::json;
use crate::table::{self, Table, complex, number, short};
use ballbot::{Ballbot, limits};
use ballbot_scenario::bryson;
use ballbot_studies::{Regulator, RegulatorError, RegulatorProblem, Time};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use lpvmpc::Rk4;
use lpvmpc_design::{MOST_RK4_SUBSTEPS, accurate_rk4_substeps};
use serde_json::{Value, json};

/// Arguments of `ballbot lqr`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot lqr                                the paper's robot
  ballbot lqr --substeps 1                   the paper's predictor: one step of 0.05 s
  ballbot lqr --ts 0.02                      another sampling time
  ballbot lqr --model p --continuous         the gain and terminal cost that the paper uses
  ballbot lqr --q 1000,1,0.1,0.1 --r 500     other weights
  ballbot lqr --parameters robot.toml        another robot, weights for it by Bryson's rule

The gain is for u = -K x with x = (phi, theta, phi_dot, theta_dot) in rad and rad/s and u in N m.
With --model p it is designed for p and checked on the nonlinear model b.")]
pub struct LqrArguments {
    /// Robot and linear model.
    #[command(flatten)]
    pub model: ModelArguments,
    /// Weights of phi, theta, phi_dot and theta_dot [default: 200,1,0.1,0.1 of the paper; with
    /// --parameters those of Bryson's rule in the robot's own units, as in a scenario]
    #[arg(long, value_name = "Q1,Q2,Q3,Q4", value_parser = state_weights)]
    pub q: Option<[f64; 4]>,
    /// Weight of the torque [default: 1000 of the paper; with --parameters as for --q]
    #[arg(long, value_parser = positive)]
    pub r: Option<f64>,
    /// Sampling time, s
    #[arg(long, value_name = "SECONDS", default_value = "0.05", value_parser = positive)]
    pub ts: f64,
    /// Runge-Kutta steps per sample [default: as in a scenario, by the fastest pole]
    #[arg(long, value_parser = RangedU64ValueParser::<usize>::new().range(1..=MOST_RK4_SUBSTEPS as u64))]
    pub substeps: Option<usize>,
    /// Design in continuous time: P is then about t_s times that of discrete time
    #[arg(long, conflicts_with_all = ["ts", "substeps"])]
    pub continuous: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

fn state_weights(text: &str) -> Result<[f64; 4], String> {
    let weights = text.split(',').map(finite).collect::<Result<Vec<_>, _>>()?;
    if let Some(negative) = weights.iter().find(|weight| **weight < 0.0) {
        return Err(format!("the weight {} is negative", short(*negative)));
    }
    <[f64; 4]>::try_from(weights).map_err(|weights| {
        format!(
            "{} weights, but there are 4 states: phi, theta, phi_dot, theta_dot",
            weights.len()
        )
    })
}

impl LqrArguments {
    /// Q's diagonal and R.
    fn weights(&self, ballbot: &Ballbot<f64>) -> Result<([f64; 4], f64), CommandError> {
        const PAPER: ([f64; 4], f64) = ([200.0, 1.0, 0.1, 0.1], 1000.0);
        match (self.q, self.r) {
            (Some(q), Some(r)) => Ok((q, r)),
            (q, r) if self.model.robot.parameters.is_none() => {
                Ok((q.unwrap_or(PAPER.0), r.unwrap_or(PAPER.1)))
            }
            (None, None) => {
                let weights = bryson(ballbot)?;
                Ok((weights.q.diagonal().into(), weights.r[0]))
            }
            _ => Err(CommandError::Usage(
                "only the ratio of --q and --r matters: with --parameters give both, or leave both \
                 out for Bryson's rule on this robot"
                    .to_owned(),
            )),
        }
    }
}

/// Designs and reports.
///
/// # Errors
/// The parameters cannot be used, the sampling time is too long for the predictor, or there is no
/// gain.
pub fn run(arguments: &LqrArguments) -> Result<String, CommandError> {
    let ballbot = arguments.model.robot.ballbot()?;
    let linear = arguments.model.upright(&ballbot);
    let time = if arguments.continuous {
        Time::Continuous
    } else {
        let substeps = match arguments.substeps {
            Some(substeps) => substeps,
            None => accurate_rk4_substeps(&linear.a, arguments.ts).map_err(RegulatorError::from)?,
        };
        Time::Sampled {
            t_s: arguments.ts,
            predictor: Rk4 { substeps },
        }
    };
    let (q, r) = arguments.weights(&ballbot)?;
    let problem = RegulatorProblem {
        linear,
        ballbot,
        q,
        r,
        time,
    };
    let regulator = problem.solve()?;
    Ok(if arguments.json {
        json::text(&document(arguments, &problem, &regulator))
    } else {
        report(arguments, &problem, &regulator)
    })
}

fn report(arguments: &LqrArguments, problem: &RegulatorProblem, regulator: &Regulator) -> String {
    let states = ["phi", "theta", "phi_dot", "theta_dot"];
    let with_units = [
        "phi [rad]",
        "theta [rad]",
        "phi_dot [rad/s]",
        "theta_dot [rad/s]",
    ];
    let (cost, poles) = match problem.time {
        Time::Continuous => ("integral over time, s", "Poles of A - B K [1/s]"),
        Time::Sampled { .. } => (
            "sum over samples",
            "Poles of A_d - B_d K, inside the unit circle",
        ),
    };
    format!(
        "LQR for {}, {}\n\
         cost: {cost}, of x'Q x + R u^2 with Q = diag({}), R = {}\n\n\
         Gain for u = -K x [N m per unit of the state]\n{}\n\
         P: x'P x is the cost from x on\n{}\n\
         {poles}\n  {}\n\n{}",
        arguments.model.model.description(),
        time(problem, regulator),
        problem.q.map(short).join(", "),
        short(problem.r),
        Table::of_matrix(with_units, &["K"], &regulator.lqr.k),
        Table::of_matrix(states, &states, &regulator.lqr.p),
        table::poles(&regulator.lqr.poles),
        frozen(regulator),
    )
}

fn time(problem: &RegulatorProblem, regulator: &Regulator) -> String {
    let Time::Sampled { t_s, predictor } = problem.time else {
        return "continuous time".to_owned();
    };
    let longest = regulator
        .step
        .map_or(f64::INFINITY, |step| step.longest_step);
    format!(
        "sampled every {} s\npredictor: Runge-Kutta, {} per sample, each {} s (stable up to {} s)",
        short(t_s),
        match predictor.substeps {
            1 => "1 step".to_owned(),
            steps => format!("{steps} steps"),
        },
        short(t_s / predictor.substeps as f64),
        short(longest)
    )
}

fn frozen(regulator: &Regulator) -> String {
    let found = &regulator.frozen;
    let verdict = if found.is_hurwitz() {
        "stable at each of them"
    } else {
        "NOT stable at each of them"
    };
    format!(
        "Frozen loops A(s) - B(s) K of the nonlinear model b, |theta| <= {} deg, |theta_dot| <= {} deg/s\n  \
         {verdict} ({} points)\n  \
         slowest pole {} 1/s, at theta = {} deg, theta_dot = {} deg/s\n  \
         This is no proof: with a scheduling that moves, a loop that is stable at every frozen \
         one can\n  still be unstable.\n",
        limits::THETA.to_degrees().round(),
        limits::THETA_DOT.to_degrees().round(),
        found.points,
        complex(found.pole),
        number(found.scheduling[0].to_degrees()),
        number(found.scheduling[1].to_degrees()),
    )
}

fn document(arguments: &LqrArguments, problem: &RegulatorProblem, regulator: &Regulator) -> Value {
    let time = match problem.time {
        Time::Continuous => json!("continuous"),
        Time::Sampled { t_s, predictor } => json!({
            "t_s": t_s,
            "substeps": predictor.substeps,
            "longest_stable_step_s": regulator.step.map(|step| step.longest_step),
        }),
    };
    let found = &regulator.frozen;
    json!({
        "model": arguments.model.model.name(),
        "time": time,
        "q": problem.q,
        "r": problem.r,
        "k": regulator.lqr.k.as_slice(),
        "p": json::matrix(&regulator.lqr.p),
        "poles": json::poles(&regulator.lqr.poles),
        "frozen_stability": {
            "hurwitz": found.is_hurwitz(),
            "slowest_pole_1_s": json::pole(found.pole),
            "theta_rad": found.scheduling[0],
            "theta_dot_rad_s": found.scheduling[1],
            "points": found.points,
            "theta_limit_rad": limits::THETA,
            "theta_dot_limit_rad_s": limits::THETA_DOT,
        },
    })
}
