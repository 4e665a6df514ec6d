//! Everything the paper publishes, computed: refinement, model comparison, three scenarios.

pub mod claims;
pub mod drawings;
pub mod guarantee;
pub mod nonlinear;
pub mod optimum;
pub mod report;
pub mod runs;
pub mod tables;

use crate::commands::CommandError;
use crate::progress::Progress;
use ballbot::{Ballbot, LinearParameters};
use ballbot_studies::LinearModel;
use ballbot_studies::ModelComparison;
use ballbot_studies::{Refinement, RefinementProblem};
use ballbot_studies::{Regulator, RegulatorProblem, Time};
use guarantee::Guarantee;
use optimum::Optimum;
use runs::{Run, Runs};

/// All results.
#[derive(Debug)]
pub struct Reproduction {
    /// b from p.
    pub refinement: Refinement,
    /// ||F(b*)|| at the printed b*, with p6 negative and with p6 as printed.
    pub residual_at_printed_b: (f64, f64),
    /// Four models under one input.
    pub models: ModelComparison,
    /// The closed loops.
    pub runs: Runs,
    /// The regulator whose P is the paper's terminal cost, with its Hurwitz check, for the Q of
    /// scenario 1 and of scenario 2.
    pub regulators: [Regulator; 2],
    /// How far the plan's end is from where the nonlinear model ends under it, at the first
    /// sample of scenario 3 with terminal equality: (phi, theta) in rad.
    pub terminal_gap: (f64, f64),
    /// What is guaranteed, beyond the paper.
    pub guarantee: Guarantee,
    /// Closed-loop costs beside the optimum, beyond the paper.
    pub optimum: Optimum,
}

impl Reproduction {
    /// Computes everything.
    ///
    /// # Errors
    /// What went wrong; none of it should, as there is no input.
    pub fn compute() -> Result<Self, CommandError> {
        let progress = Progress::new("reproducing", 6);
        let refinement = RefinementProblem::paper().solve()?;
        progress.set(1);
        let models = ModelComparison::compute()?;
        progress.set(2);
        let runs = Runs::compute()?;
        progress.set(3);
        let terminal_gap = runs.terminal_equality.first_terminal_gap()?;
        let regulators = [regulator(&runs.two_setpoints)?, regulator(&runs.lissajous)?];
        progress.set(4);
        let guarantee = Guarantee::compute()?;
        progress.set(5);
        let optimum = Optimum::compute()?;
        progress.set(6);
        Ok(Self {
            refinement,
            residual_at_printed_b: residual_at_printed_b(),
            models,
            runs,
            regulators,
            terminal_gap,
            guarantee,
            optimum,
        })
    }
}

/// ||p - h(b*)|| for the printed b*, with p6 < 0 and with p6 > 0.
fn residual_at_printed_b() -> (f64, f64) {
    let h = Ballbot::paper().linear_parameters().to_vector();
    let p = LinearParameters::<f64>::paper();
    let printed = LinearParameters { p6: -p.p6, ..p };
    ((p.to_vector() - h).norm(), (printed.to_vector() - h).norm())
}

/// The continuous-time LQR of the linear model p, checked on the plant b* at frozen scheduling.
fn regulator(run: &Run) -> Result<Regulator, CommandError> {
    let weights = &run.prepared.settings.weights;
    let problem = RegulatorProblem {
        linear: LinearModel::from(LinearParameters::paper().matrices()),
        ballbot: Ballbot::paper(),
        q: weights.q.diagonal().into(),
        r: weights.r[0],
        time: Time::Continuous,
    };
    Ok(problem.solve()?)
}
