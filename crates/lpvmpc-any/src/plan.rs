//! What a step answers.

use lpvmpc::{Decision, Status};
use nalgebra::DMatrix;

/// The plan of a sample.
///
/// Whatever the status, the inputs are finite and within their bounds; unless
/// [`is_solved`](Self::is_solved) they are a fallback, not an optimum.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// u_0 to u_{N-1}, N x m, in input units; the first is to be applied until the next sample.
    pub u: DMatrix<f64>,
    /// x_0 to x_N, (N + 1) x n, in state units: the measured state and what the model makes of
    /// the inputs.
    pub x: DMatrix<f64>,
    /// What the answer is worth, in words with the plant's names: "converged", "infeasible: ...".
    pub status: String,
    /// The same for programs.
    pub kind: Status<f64>,
    /// Its cost: (x - x_ref)'Q (x - x_ref) + ... along x and u, without the prices of bounds.
    pub cost: f64,
    /// The bounds that hold with equality or are exceeded at a price, by stage.
    pub active: Vec<ActiveBound>,
    /// Quadratic programs that were solved.
    pub problems: usize,
    /// The steady state that it heads for: the nearest to the end of the references. `None` with an input
    /// reference that was given, and where none was found. With a certified terminal set it is the one about which the plan
    /// ends in the set, on the way to the end of the references; `None` where nothing is guaranteed.
    pub target: Option<Target>,
    /// What the first input is backed by, of a controller with a certified terminal set
    /// ([`crate::TerminalSet`]); `None` of any other.
    pub decision: Option<Decision>,
}

/// A steady state.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The state, in the plant's units.
    pub x: Vec<f64>,
    /// The input that holds it.
    pub u: Vec<f64>,
}

/// A bound that the plan runs into.
#[derive(Debug, Clone, PartialEq)]
pub struct ActiveBound {
    /// Stage, from 0 to N.
    pub stage: usize,
    /// The bound in words: "force >= -10 N".
    pub bound: String,
    /// Its Lagrange multiplier, in cost per unit of the quantity.
    pub multiplier: f64,
    /// A soft bound that is exceeded.
    pub exceeded: bool,
}

impl Plan {
    /// Whether the inputs are a plan: an optimum, or a rollout of the nonlinear model that the programs confirm
    /// or improve.
    pub fn is_solved(&self) -> bool {
        self.kind.is_solved()
    }

    /// The input to apply until the next sample.
    pub fn first_input(&self) -> Vec<f64> {
        self.u.row(0).iter().copied().collect()
    }

    /// The active bounds in words: "force >= -10 N at stages 0 to 6", or "no active bound". One that the plan does not
    /// keep says so: "position <= 1 m (exceeded) at stage 4".
    pub fn active_bounds(&self) -> String {
        let pairs = self.active.iter().map(|one| match one.exceeded {
            true => (format!("{} (exceeded)", one.bound), one.stage),
            false => (one.bound.clone(), one.stage),
        });
        let words = crate::words::stages(pairs);
        match words.is_empty() {
            true => "no active bound".to_owned(),
            false => words.join(", "),
        }
    }
}
