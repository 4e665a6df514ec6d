//! What is guaranteed, beside the paper's scheme, and at what price.

use super::nonlinear::{self, NonlinearRun};
use super::runs::Run;
use super::tables::Sheet;
use crate::commands::CommandError;
use crate::html::Drawing;
use crate::pictures::{self, Shown};
use ballbot_scenario::{
    CertifiedTable, IterationsTable, PredictorTable, Prepared, Scenario, ScenarioError,
    TerminalTable,
};
use lpvmpc_figures::Role;

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
    pub guarded_once: Run,
    /// Scenario 3, guaranteed, three programs per sample.
    pub guarded_single: Run,
    /// Scenario 1, guaranteed, three programs per sample.
    pub guarded: Run,
    /// Far set points, guaranteed.
    pub far: Run,
    /// Scenario 1 by nonlinear MPC with the predictor of `fine`.
    pub nonlinear: NonlinearRun,
}

/// The fine predictor of the runs of scenarios 1 and 3.
const FINE: PredictorTable = PredictorTable::StageConsistent { substeps: Some(2) };

impl Guarantee {
    /// Runs all of them.
    ///
    /// # Errors
    /// None should occur, as there is no input.
    pub fn compute() -> Result<Self, CommandError> {
        let scenario_3 = |iterations| -> Result<Scenario, ScenarioError> {
            let mut scenario = Scenario::load("single-setpoint-terminal")?;
            scenario.controller.predictor = Some(FINE);
            scenario.controller.iterations = Some(iterations);
            Ok(scenario)
        };
        let converged = IterationsTable::Descent {
            tolerance: 1e-6,
            most: 100,
        };
        let mut fine = Scenario::load("two-setpoints")?;
        fine.controller.predictor = Some(FINE);
        let guarded = |scenario: &Scenario, programs| {
            let mut scenario = scenario.clone();
            scenario.controller.terminal = TerminalTable::Certified(CertifiedTable::default());
            scenario.controller.iterations = Some(IterationsTable::Fixed(programs));
            Run::of("guaranteed", &scenario)
        };
        let guarded_single = guarded(&scenario_3(converged)?, 3)?;
        let guarded_once = guarded(&scenario_3(converged)?, 1)?;
        let guarded = guarded(&fine, 3)?;
        let fine = Run::of("LPV MPC", &fine)?;
        Ok(Self {
            frozen: Run::compute("single-setpoint-terminal")?,
            consistent: Run::of("one program", &scenario_3(IterationsTable::Fixed(1))?)?,
            converged: Run::of("until converged", &scenario_3(converged)?)?,
            nonlinear: nonlinear::run(&fine.prepared)?,
            fine,
            guarded_once,
            guarded_single,
            guarded,
            far: Run::compute("far-setpoints")?,
        })
    }

    /// Samples of the far set points with a guaranteed decision.
    pub fn samples_guaranteed(&self) -> usize {
        let samples = self.far.trajectories[0].samples.iter();
        samples
            .filter(|sample| {
                sample
                    .guard
                    .is_some_and(|guard| guard.decision.is_guaranteed())
            })
            .count()
    }

    /// Prediction and robot's model at the end of the horizon, scenario 3.
    fn gap_sheet(&self) -> Sheet {
        let title = "Scenario 3: nonlinear rollout minus prediction at the end of the horizon; costs \
                     over the whole 4 s";
        let headers = [
            "",
            "first sample, phi [rad]",
            "first sample, theta [rad]",
            "largest in the run",
            "closed-loop cost",
            "time per step, mean [us]",
        ];
        let mut sheet = Sheet::new("gap", title, &headers);
        for (name, run) in [
            (
                "the paper: frozen scheduling, one Runge-Kutta step",
                &self.frozen,
            ),
            ("stage-consistent, one program per sample", &self.consistent),
            ("stage-consistent, until converged", &self.converged),
        ] {
            let samples = &run.trajectories[0].samples;
            let first = samples
                .first()
                .map_or([f64::NAN; 4], |sample| sample.gap.into());
            let gaps = samples.iter().map(|sample| sample.gap.amax());
            let metrics = &run.metrics[0];
            let cells = [
                format!("{:.1e}", first[0].abs()),
                format!("{:.1e}", first[1].abs()),
                format!("{:.1e}", gaps.fold(0.0, f64::max)),
                format!("{:.1}", metrics.closed_loop_cost),
                format!("{:.1}", metrics.mean_step_us),
            ];
            sheet.row(name, cells);
        }
        sheet
    }

    /// Cost and time of the guarantee. Scenario 3 asks for its set point from the beginning on;
    /// in scenario 1 the loop without guarantee knows of a set point one horizon ahead.
    fn price_sheet(&self) -> Sheet {
        let title = "The price of the guarantee: stage-consistent predictor, two steps per sample; \
                     costs and largest values over the whole 4 s";
        let headers = [
            "",
            "closed-loop cost",
            "largest tilt [rad]",
            "time per step, mean [us]",
            "longest [us]",
        ];
        let mut sheet = Sheet::new("price", title, &headers);
        for (name, run) in [
            (
                "scenario 3, terminal equality, one program",
                &self.consistent,
            ),
            (
                "scenario 3, terminal equality, until converged",
                &self.converged,
            ),
            ("scenario 3, guaranteed, one program", &self.guarded_once),
            (
                "scenario 3, guaranteed, three programs",
                &self.guarded_single,
            ),
            ("scenario 1, terminal cost, no guarantee", &self.fine),
            ("scenario 1, guaranteed, three programs", &self.guarded),
        ] {
            let metrics = &run.metrics[0];
            let cells = [
                format!("{:.1}", metrics.closed_loop_cost),
                format!("{:.3}", metrics.largest_tilt_rad),
                format!("{:.1}", metrics.mean_step_us),
                format!("{:.1}", metrics.longest_step_us),
            ];
            sheet.row(name, cells);
        }
        sheet
    }

    /// The tables of the chapter.
    pub fn sheets(&self) -> [Sheet; 2] {
        [self.gap_sheet(), self.price_sheet()]
    }

    /// The far set points.
    pub fn drawing(&self) -> Drawing {
        let shown = Shown {
            label: "ballbot",
            role: Role::Lpv,
            columns: &self.far.columns[0],
        };
        let Prepared { title, .. } = &self.far.prepared;
        Drawing {
            name: "far-setpoints",
            caption: "Set points far apart, each given at the jump and not before: guaranteed at \
                      every sample."
                .to_owned(),
            figure: pictures::one_plane(title, &self.far.prepared, &[shown]),
        }
    }
}
