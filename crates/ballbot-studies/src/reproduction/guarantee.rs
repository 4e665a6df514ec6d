//! What is guaranteed, beside the paper's scheme, and at what price.

use super::nonlinear::{self, NonlinearRun};
use super::runs::Run;
use crate::StudyError;
use crate::timing::Clock;
use ballbot_scenario::{
    CertifiedTable, IterationsTable, PredictorTable, Scenario, ScenarioError, TerminalTable,
};

/// The runs beyond the paper.
#[derive(Debug)]
pub struct Guarantee {
    /// Scenario 3 as in the paper.
    pub frozen: Run,
    /// Scenario 3 with the stage-consistent predictor, one program per sample.
    pub consistent: Run,
    /// The same, each plan repeated until it stays as it is.
    pub converged: Run,
    /// Scenario 1 with the stage-consistent predictor and one program per sample.
    pub fine: Run,
    /// Scenario 3, guaranteed, one program per sample.
    pub guaranteed_once: Run,
    /// Scenario 3, guaranteed, three programs per sample.
    pub guaranteed_single: Run,
    /// Scenario 1, guaranteed, three programs per sample.
    pub guaranteed: Run,
    /// Far set points, guaranteed.
    pub far: Run,
    /// Scenario 1 by nonlinear MPC with the predictor of `fine`.
    pub nonlinear: NonlinearRun,
}

/// The fine predictor of the runs of scenarios 1 and 3.
const FINE: PredictorTable = PredictorTable::StageConsistent { substeps: Some(2) };

/// That of the guaranteed ones: their margin carries deviations on by the predictor's derivatives, which
/// must be accurate to one per cent.
const GUARANTEED: PredictorTable = PredictorTable::StageConsistent { substeps: Some(4) };

impl Guarantee {
    /// Runs all of them; `clock` is for the time per step.
    ///
    /// # Errors
    /// None should occur, as there is no input.
    pub fn compute(clock: Clock<'_>) -> Result<Self, StudyError> {
        let scenario_3 = |iterations| -> Result<Scenario, ScenarioError> {
            let mut scenario = Scenario::load("single-setpoint-terminal")?;
            scenario.controller.predictor = Some(FINE);
            scenario.controller.iterations = Some(iterations);
            Ok(scenario)
        };
        let converged = IterationsTable::Descent {
            tolerance: 1e-6,
            most: 100,
            first: None,
        };
        let mut fine = Scenario::load("two-setpoints")?;
        fine.controller.predictor = Some(FINE);
        let guaranteed = |scenario: &Scenario, programs| {
            let mut scenario = scenario.clone();
            scenario.controller.predictor = Some(GUARANTEED);
            scenario.controller.terminal = TerminalTable::Certified(CertifiedTable::default());
            scenario.controller.iterations = Some(IterationsTable::Fixed(programs));
            Run::of("guaranteed", &scenario, clock)
        };
        let guaranteed_single = guaranteed(&scenario_3(converged)?, 3)?;
        let guaranteed_once = guaranteed(&scenario_3(converged)?, 1)?;
        let guaranteed = guaranteed(&fine, 3)?;
        let fine = Run::of("LPV MPC", &fine, clock)?;
        Ok(Self {
            frozen: Run::compute("single-setpoint-terminal", clock)?,
            consistent: Run::of(
                "one program",
                &scenario_3(IterationsTable::Fixed(1))?,
                clock,
            )?,
            converged: Run::of("until converged", &scenario_3(converged)?, clock)?,
            nonlinear: nonlinear::run(&fine.prepared)?,
            fine,
            guaranteed_once,
            guaranteed_single,
            guaranteed,
            far: Run::compute("far-setpoints", clock)?,
        })
    }

    /// Samples of the far set points with a guaranteed decision.
    pub fn samples_guaranteed(&self) -> usize {
        let samples = self.far.trajectories[0].samples.iter();
        samples
            .filter(|sample| {
                sample
                    .guarantee
                    .is_some_and(|guarantee| guarantee.decision.is_guaranteed())
            })
            .count()
    }
}
