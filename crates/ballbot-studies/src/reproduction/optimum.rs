//! What linear MPC, LPV MPC and nonlinear MPC cost on the same problem, by the distance of the set
//! point.
//!
//! The LPV loops are run here. Those of linear and of nonlinear MPC come from
//! `testdata/nonlinear-mpc`, whose program shares no code with the crates.

use crate::StudyError;
use crate::optimality::{Case, Outcome, distances, run_all};
use lpvmpc::Iterations;

/// Sampling time of the loops that are shown, s.
pub const SAMPLING_TIME: f64 = 0.05;
/// Their horizons, samples.
pub const HORIZONS: [usize; 2] = [20, 60];

/// The loops, one of each kind per case.
#[derive(Debug)]
pub struct Optimum {
    /// Distances and horizons, with the costs of linear and of nonlinear MPC.
    pub cases: Vec<Case>,
    /// LPV MPC with its defaults, a descent.
    pub descent: Vec<Outcome>,
    /// LPV MPC with one program per sample, taken as it is.
    pub one_program: Vec<Outcome>,
}

impl Optimum {
    /// Runs the LPV loops.
    ///
    /// # Errors
    /// None should occur, as there is no input.
    pub fn compute() -> Result<Self, StudyError> {
        let mut cases = distances()?;
        cases.retain(|case| case.t_s == SAMPLING_TIME && HORIZONS.contains(&case.horizon));
        Ok(Self {
            descent: run_all(&cases, Iterations::default(), &|_| ())?,
            one_program: run_all(&cases, Iterations::Fixed(1), &|_| ())?,
            cases,
        })
    }

    /// Duration of the loops, s.
    pub fn duration(&self) -> f64 {
        let durations = self.cases.iter().map(|case| case.duration);
        durations.fold(0.0, f64::max)
    }

    /// Samples at which IPOPT did not converge.
    pub fn not_converged(&self) -> usize {
        self.cases.iter().map(|case| case.not_converged).sum()
    }

    /// Largest cost of LPV MPC over that of nonlinear MPC.
    pub fn worst(&self) -> f64 {
        let pairs = self.cases.iter().zip(&self.descent);
        let ratios = pairs.map(|(case, run)| run.cost / case.nonlinear);
        ratios.fold(0.0, f64::max)
    }

    /// Largest cost of linear MPC over that of nonlinear MPC.
    pub fn worst_linear(&self) -> f64 {
        let ratios = self.cases.iter().map(|case| case.linear / case.nonlinear);
        ratios.fold(0.0, f64::max)
    }
}
