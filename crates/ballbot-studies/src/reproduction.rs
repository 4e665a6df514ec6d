//! Everything the paper publishes, computed: refinement, model comparison, three scenarios.

mod claims;
mod guarantee;
mod nonlinear;
mod optimum;
mod runs;

pub use claims::{Claim, Published, Source};
pub use guarantee::Guarantee;
pub use nonlinear::NonlinearRun;
pub use optimum::{HORIZONS, Optimum, SAMPLING_TIME};
pub use runs::{Run, Runs};

use crate::timing::Clock;
use crate::{
    LinearModel, ModelComparison, Refinement, RefinementProblem, Regulator, RegulatorProblem,
    StudyError, Time,
};
use ballbot::{Ballbot, LinearParameters};

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
    /// Parts of [`compute`](Self::compute), for who shows its progress.
    pub const PARTS: usize = 6;

    /// Computes everything. `clock` is for the time per step; `progress` is told how many of the
    /// [`PARTS`](Self::PARTS) are done.
    ///
    /// # Errors
    /// What went wrong; none of it should, as there is no input.
    pub fn compute(clock: Clock<'_>, progress: &dyn Fn(usize)) -> Result<Self, StudyError> {
        let refinement = RefinementProblem::paper().solve()?;
        progress(1);
        let models = ModelComparison::compute()?;
        progress(2);
        let runs = Runs::compute(clock)?;
        progress(3);
        let terminal_gap = runs.terminal_equality.first_terminal_gap()?;
        let regulators = [regulator(&runs.two_setpoints)?, regulator(&runs.lissajous)?];
        progress(4);
        let guarantee = Guarantee::compute(clock)?;
        progress(5);
        let optimum = Optimum::compute()?;
        progress(6);
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
fn regulator(run: &Run) -> Result<Regulator, StudyError> {
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
