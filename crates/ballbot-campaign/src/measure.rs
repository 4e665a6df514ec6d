//! What is measured of a run.

use crate::cell::{Cell, Kind};
use ballbot_scenario::{Plane, Prepared};
use ballbot_studies::recorded::Metrics;
use lpvmpc_sim::{Termination, Trajectory};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A measure, by its name in files. Over two planes a largest value is that of the worse plane, a
/// count or a cost the sum, and an rms or final error its length on the floor, in rad of the ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// When the run ended, s.
    EndS,
    /// Samples whose quadratic program has no answer; a guaranteed loop has a plan all the same.
    Infeasible,
    /// Samples at which the state was outside its bounds.
    Violations,
    /// Samples whose torque was not backed by a guarantee, where the loop has one.
    NotGuaranteed,
    /// Largest |theta|, rad.
    LargestTiltRad,
    /// Largest |phi_dot|, rad/s.
    LargestPhiDotRadS,
    /// Largest |theta_dot|, rad/s.
    LargestThetaDotRadS,
    /// Largest |torque|, N m.
    LargestTorqueNm,
    /// Root mean square of phi - phi_ref, rad.
    RmsErrorRad,
    /// Largest |phi - phi_ref|, rad.
    LargestErrorRad,
    /// |phi - phi_ref| at the end, rad.
    FinalErrorRad,
    /// Closed-loop cost: the sum of ||x - x_ref||_Q^2 + ||u||_R^2.
    ClosedLoopCost,
    /// Effort: the integral of the squared torque, (N m)^2 s.
    EffortN2m2S,
    /// Root mean square of the torque, N m.
    RmsTorqueNm,
    /// After the reference's last change: from the largest |phi - phi_ref| until it stays within 2 %
    /// of that, s. There is none where it never does, or the reference changes until the end.
    SettlingS,
    /// Mean time per step, us; differs from machine to machine and run to run.
    MeanStepUs,
    /// Longest step, us; differs from machine to machine and run to run.
    LongestStepUs,
}

impl Measure {
    /// All of them.
    pub const ALL: [Self; 17] = [
        Self::EndS,
        Self::Infeasible,
        Self::Violations,
        Self::NotGuaranteed,
        Self::LargestTiltRad,
        Self::LargestPhiDotRadS,
        Self::LargestThetaDotRadS,
        Self::LargestTorqueNm,
        Self::RmsErrorRad,
        Self::LargestErrorRad,
        Self::FinalErrorRad,
        Self::ClosedLoopCost,
        Self::EffortN2m2S,
        Self::RmsTorqueNm,
        Self::SettlingS,
        Self::MeanStepUs,
        Self::LongestStepUs,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::EndS => "end_s",
            Self::Infeasible => "infeasible",
            Self::Violations => "violations",
            Self::NotGuaranteed => "not_guaranteed",
            Self::LargestTiltRad => "largest_tilt_rad",
            Self::LargestPhiDotRadS => "largest_phi_dot_rad_s",
            Self::LargestThetaDotRadS => "largest_theta_dot_rad_s",
            Self::LargestTorqueNm => "largest_torque_nm",
            Self::RmsErrorRad => "rms_error_rad",
            Self::LargestErrorRad => "largest_error_rad",
            Self::FinalErrorRad => "final_error_rad",
            Self::ClosedLoopCost => "closed_loop_cost",
            Self::EffortN2m2S => "effort_n2m2_s",
            Self::RmsTorqueNm => "rms_torque_nm",
            Self::SettlingS => "settling_s",
            Self::MeanStepUs => "mean_step_us",
            Self::LongestStepUs => "longest_step_us",
        }
    }

    /// Whether it is a time of this machine, which no other run repeats.
    pub fn is_time(self) -> bool {
        matches!(self, Self::MeanStepUs | Self::LongestStepUs)
    }

    /// Whether it counts samples, of which a run has as many as its sampling time leaves.
    pub fn counts_samples(self) -> bool {
        matches!(
            self,
            Self::Infeasible | Self::Violations | Self::NotGuaranteed
        )
    }

    /// Whether an empty cell of a run that came to its end says that the time never comes.
    pub(crate) fn may_never_come(self) -> bool {
        matches!(self, Self::SettlingS)
    }

    /// Why no run of a scenario has it; nothing where one may have it.
    pub(crate) fn never_in(self, prepared: &Prepared) -> Option<&'static str> {
        let last = prepared.samples.saturating_sub(1) as f64 * prepared.settings.t_s;
        let changes =
            |plane: &Plane| plane.reference.at(last) != plane.reference.at(prepared.end());
        match self {
            Self::NotGuaranteed if prepared.guaranteed().is_none() => Some(
                "the loop has no guarantee, so there is no such number; infeasible and violations are of any loop",
            ),
            Self::SettlingS if prepared.planes.iter().any(changes) => Some(
                "the reference changes until the end, so nothing settles; rms_error_rad and final_error_rad are of \
                 any reference",
            ),
            _ => None,
        }
    }

    /// What its column holds.
    pub fn kind(self) -> Kind {
        match self.counts_samples() {
            true => Kind::Whole,
            false => Kind::Real,
        }
    }
}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// After all samples.
    Complete,
    /// The robot fell, or its motion could not be followed any more.
    Fell,
    /// The controller had no plan, and the scenario asks for the end then.
    NoPlan,
}

impl Ending {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Fell => "fell",
            Self::NoPlan => "no_plan",
        }
    }
}

/// What all measures of a run are taken from.
#[derive(Clone, Debug)]
pub struct Measured {
    /// How it ended.
    pub ending: Ending,
    planes: Vec<OfPlane>,
}

/// What is measured of one plane.
#[derive(Clone, Debug)]
struct OfPlane {
    metrics: Metrics,
    end: f64,
    infeasible: usize,
    final_error: f64,
    effort: f64,
    rms_torque: f64,
    settling: Option<f64>,
}

impl Measured {
    /// Of the recorded planes of a run.
    pub fn new(prepared: &Prepared, trajectories: &[Trajectory<4, 1>]) -> Self {
        let planes = prepared.planes.iter().zip(trajectories);
        let endings = trajectories.iter().map(|run| match run.termination {
            Termination::Complete => Ending::Complete,
            Termination::NoPlan { .. } => Ending::NoPlan,
            Termination::OutOfRange { .. } | Termination::PlantFailed { .. } => Ending::Fell,
        });
        Self {
            ending: endings.fold(Ending::Complete, worse),
            planes: planes
                .map(|(plane, run)| OfPlane::new(prepared, plane, run))
                .collect(),
        }
    }

    /// The measure in its column.
    pub fn cell(&self, measure: Measure) -> Cell {
        match measure.kind() {
            Kind::Whole => self
                .count(measure)
                .map_or(Cell::Missing, |count| Cell::Whole(count as i64)),
            _ => Cell::measured(self.number(measure)),
        }
    }

    fn count(&self, measure: Measure) -> Option<usize> {
        let planes = self.planes.iter();
        match measure {
            Measure::Infeasible => Some(planes.map(|plane| plane.infeasible).sum()),
            Measure::Violations => Some(planes.map(|plane| plane.metrics.violations).sum()),
            _ => planes.map(|plane| plane.metrics.not_guaranteed).sum(),
        }
    }

    /// The measure as a number.
    fn number(&self, measure: Measure) -> f64 {
        let largest = |of: fn(&OfPlane) -> f64| self.planes.iter().map(of).fold(0.0, f64::max);
        let sum = |of: fn(&OfPlane) -> f64| self.planes.iter().map(of).sum::<f64>();
        let length = |of: fn(&OfPlane) -> f64| {
            let squares = self.planes.iter().map(|plane| of(plane).powi(2));
            squares.sum::<f64>().sqrt()
        };
        match measure {
            Measure::EndS => self
                .planes
                .iter()
                .map(|plane| plane.end)
                .fold(f64::INFINITY, f64::min),
            Measure::LargestTiltRad => largest(|plane| plane.metrics.largest_tilt_rad),
            Measure::LargestPhiDotRadS => largest(|plane| plane.metrics.largest_phi_dot_rad_s),
            Measure::LargestThetaDotRadS => largest(|plane| plane.metrics.largest_theta_dot_rad_s),
            Measure::LargestTorqueNm => largest(|plane| plane.metrics.largest_torque_nm),
            Measure::RmsErrorRad => length(|plane| plane.metrics.rms_error_rad),
            Measure::LargestErrorRad => largest(|plane| plane.metrics.largest_error_rad),
            Measure::FinalErrorRad => length(|plane| plane.final_error),
            Measure::ClosedLoopCost => sum(|plane| plane.metrics.closed_loop_cost),
            Measure::EffortN2m2S => sum(|plane| plane.effort),
            Measure::RmsTorqueNm => largest(|plane| plane.rms_torque),
            // A plane that does not settle is not left out, as `f64::max` would with NaN.
            Measure::SettlingS => self
                .planes
                .iter()
                .try_fold(0.0, |most: f64, plane| Some(most.max(plane.settling?)))
                .unwrap_or(f64::NAN),
            Measure::MeanStepUs => sum(|plane| plane.metrics.mean_step_us),
            Measure::LongestStepUs => largest(|plane| plane.metrics.longest_step_us),
            Measure::Infeasible | Measure::Violations | Measure::NotGuaranteed => {
                self.count(measure).map_or(f64::NAN, |count| count as f64)
            }
        }
    }
}

impl OfPlane {
    fn new(prepared: &Prepared, plane: &Plane, run: &Trajectory<4, 1>) -> Self {
        let without_plan = run
            .samples
            .iter()
            .filter(|sample| !sample.status.is_solved());
        let ended = matches!(run.termination, Termination::NoPlan { .. });
        let squares = run.samples.iter().map(|sample| sample.u[0] * sample.u[0]);
        let squares = squares.sum::<f64>();
        Self {
            metrics: Metrics::new(prepared, plane, run),
            end: run.final_time,
            infeasible: without_plan.count() + usize::from(ended),
            final_error: (run.final_state[0] - run.final_reference[0]).abs(),
            effort: squares * prepared.settings.t_s,
            // A run that ends before its first torque has none.
            rms_torque: (squares / run.samples.len().max(1) as f64).sqrt(),
            settling: settling(run),
        }
    }
}

/// The share of the largest error that a settled error stays within, as is usual.
const SETTLED: f64 = 0.02;

/// [`Measure::SettlingS`] of one plane.
fn settling(run: &Trajectory<4, 1>) -> Option<f64> {
    let samples = run.samples.iter();
    let samples = samples.map(|sample| (sample.t, sample.x_ref[0], sample.x[0]));
    let end = (run.final_time, run.final_reference[0], run.final_state[0]);
    let all: Vec<(f64, f64, f64)> = samples.chain([end]).collect();
    let changed = all.windows(2).rposition(|pair| pair[0].1 != pair[1].1);
    let resting = &all[changed.map_or(0, |k| k + 1)..];
    if resting.len() < 2 {
        return None;
    }
    let errors = resting
        .iter()
        .map(|(t, reference, phi)| (*t, (phi - reference).abs()));
    let errors: Vec<(f64, f64)> = errors.collect();
    let first = errors.iter().fold((0.0, -1.0), |most: (f64, f64), error| {
        match error.1 > most.1 {
            true => *error,
            false => most,
        }
    });
    let band = SETTLED * first.1;
    let Some(last) = errors.iter().rposition(|(_, error)| *error > band) else {
        return Some(0.0);
    };
    let (&(t, error), &(next, within)) = (errors.get(last)?, errors.get(last + 1)?);
    // Where the straight line between the samples enters the band.
    Some(t + (next - t) * (error - band) / (error - within) - first.0)
}

/// A fall is the worst.
fn worse(one: Ending, other: Ending) -> Ending {
    match (one, other) {
        (Ending::Fell, _) | (_, Ending::Fell) => Ending::Fell,
        (Ending::NoPlan, _) | (_, Ending::NoPlan) => Ending::NoPlan,
        _ => Ending::Complete,
    }
}
