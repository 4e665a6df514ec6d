//! What defines a controller besides its plant.

use lpvmpc::{Iterations, Penalty};
use nalgebra::{DMatrix, DVector};

/// Everything that defines a controller besides its plant. `n` states, `m` inputs, in the order and in the
/// units of the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct MpcSettings {
    /// Sampling time, s; of a plant in discrete time its period.
    pub t_s: f64,
    /// Prediction horizon in samples, 1 to 1000.
    pub horizon: usize,
    /// Runge-Kutta steps per sample, at least 1; a plant in discrete time has none.
    pub substeps: usize,
    /// Q, n x n, symmetric positive semidefinite: (x - x_ref)'Q (x - x_ref) per sample.
    pub q: DMatrix<f64>,
    /// R, m x m, symmetric positive definite: (u - u_ref)'R (u - u_ref) per sample.
    pub r: DMatrix<f64>,
    /// What stands at the end of the horizon.
    pub terminal: Terminal,
    /// Bounds of x_1 to x_N; `None` means those of the plant.
    pub x_bounds: Option<Limits>,
    /// What becomes of a plan that cannot keep the bounds of the states.
    pub state_bounds: StateBounds,
    /// Bounds of the inputs, always kept; `None` means those of the plant.
    pub u_bounds: Option<Limits>,
    /// u_ref, the input that costs nothing; `None` means the input that holds the end of the reference,
    /// from the nonlinear model.
    pub u_ref: Option<DVector<f64>>,
    /// Linear rows that hold at every stage: those of states alone at 1 to N, those with inputs at 0 to N - 1.
    pub rows: Vec<Row>,
    /// Q_y, for p outputs p x p, symmetric positive semidefinite: (y - y_ref)'Q_y (y - y_ref) per sample on top.
    pub q_y: Option<DMatrix<f64>>,
    /// Bounds of the outputs; `None` means those of the plant. Of an output that depends on the input they
    /// hold at the stages 0 to N - 1, of another at 1 to N. A constraint h(x, u) <= 0 is an output with the
    /// upper bound 0.
    pub y_bounds: Option<Limits>,
    /// What becomes of a plan that cannot keep them. A program has them linear about the plan, so hard ones of a
    /// nonlinear output may be infeasible there although some plan keeps them; soft ones at a price above their
    /// multiplier, which then lead to the same plan, are not.
    pub output_bounds: StateBounds,
    /// R_du, m x m, symmetric positive semidefinite: (u_i - u_{i-1})'R_du (u_i - u_{i-1}) per sample on top; u_{-1} is
    /// the input that was applied last ([`crate::Mpc::set_last_input`]).
    pub r_du: Option<DMatrix<f64>>,
    /// Bounds of the changes u_i - u_{i-1} from sample to sample, hard. Where u_{-1} is too far beyond the bounds of the
    /// input, the first change is as large as these ask for.
    pub du_bounds: Option<Limits>,
    /// Which linear models the programs have.
    pub linear_models: LinearModels,
    /// Quadratic programs per sample.
    pub iterations: Iterations<f64>,
}

/// Quadratic programs of a sample without a plan from the one before, at most, where no number is given: at a start nobody
/// knows how far the regulator's own closed loop is from a good plan.
pub const FIRST_PROGRAMS: usize = 50;

impl MpcSettings {
    /// What a controller must be told, with the diagonals of Q and R; the rest serves as a rule: one Runge-Kutta step
    /// per sample, the cost of the linear-quadratic regulator at the end, the bounds of the plant,
    /// those of states soft, and a descent of at most eight programs per sample, fifty where it has no plan to begin with.
    pub fn new(t_s: f64, horizon: usize, q: &[f64], r: &[f64]) -> Self {
        let diagonal = |entries: &[f64]| DMatrix::from_diagonal(&DVector::from_row_slice(entries));
        Self {
            t_s,
            horizon,
            substeps: 1,
            q: diagonal(q),
            r: diagonal(r),
            terminal: Terminal::Lqr,
            x_bounds: None,
            state_bounds: StateBounds::Soft,
            u_bounds: None,
            u_ref: None,
            rows: Vec::new(),
            q_y: None,
            y_bounds: None,
            output_bounds: StateBounds::Soft,
            r_du: None,
            du_bounds: None,
            linear_models: LinearModels::default(),
            iterations: Iterations::Descent {
                tolerance: Iterations::<f64>::TOLERANCE,
                most: Iterations::<f64>::MOST,
                first: FIRST_PROGRAMS,
            },
        }
    }
}

/// What stands at the end of the horizon.
#[derive(Debug, Clone, PartialEq)]
pub enum Terminal {
    /// The cost of the linear-quadratic regulator from there on, about the plant's steady state; about zero
    /// where the plant's file names none, if it stands there.
    Lqr,
    /// (x_N - x_ref)'P (x_N - x_ref) with this P, n x n, symmetric positive semidefinite.
    Cost(DMatrix<f64>),
    /// x_N = x_ref. With [`MpcSettings::r_du`] or [`MpcSettings::du_bounds`], where the last input counts as a state,
    /// u_{N-1} = u_ref, too, so that the plant can stay there without a change of the input.
    Equality,
    /// Cost and set of a certificate, with which the loop is guaranteed: see [`TerminalSet`].
    Certified(Box<TerminalSet>),
}

/// A terminal law, cost and set about an equilibrium, as `lpvmpc-certify` proves them, and what they were proved for: for
/// every state with (x - x_eq)'P (x - x_eq) <= level, u = u_eq - K (x - x_eq), held, stays within the limits, leads into the
/// set again, and lowers that cost by at least the stage cost. The controller takes it at its word.
///
/// It goes to this equilibrium, or to one moved along states that no formula of the plant reads
/// ([`lpvmpc_plant::PlantData::is_invariant_along`]): there the reference may be anything, stage by stage, and what the bounds
/// have no room for is gone to as far as they have. It applies no plan that a rollout of the nonlinear plant does not confirm
/// ([`crate::Plan::decision`]). Once there is a plan, there is one at every later sample, states at the samples and
/// inputs keep their bounds, and the plan's cost falls by at least the stage cost while references beyond the horizon stay,
/// for the plant as its rollouts have it, with the measured state exact, no delay and no disturbance. By
/// [`crate::Mpc::decide`] that is said of the model from the estimated state, not of the plant. Rollouts are by Runge-Kutta steps, four for each
/// of `substeps`; their error is not enclosed, and a thousandth of the distance to each bound is kept for it. Between
/// the samples the bounds hold in the terminal set only.
#[derive(Debug, Clone, PartialEq)]
pub struct TerminalSet {
    /// x_eq.
    pub x: DVector<f64>,
    /// u_eq.
    pub u: DVector<f64>,
    /// K, m x n.
    pub k: DMatrix<f64>,
    /// P, n x n, symmetric positive definite.
    pub p: DMatrix<f64>,
    /// Largest (x - x_eq)'P (x - x_eq) in the set.
    pub level: f64,
    /// The sampling time that it was proved for, s.
    pub t_s: f64,
    /// The Q that it was proved for.
    pub q: DMatrix<f64>,
    /// The R that it was proved for.
    pub r: DMatrix<f64>,
    /// |x - x_eq| in the set, at most.
    pub state_limits: Vec<f64>,
    /// |u - u_eq| in the set, at most.
    pub input_limits: Vec<f64>,
}

/// A lower and an upper bound for each component; infinite where there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// The least values.
    pub lower: Vec<f64>,
    /// The largest values.
    pub upper: Vec<f64>,
}

/// What becomes of a plan that cannot keep the bounds of the states, or of the outputs.
#[derive(Debug, Clone, PartialEq)]
pub enum StateBounds {
    /// They are exceeded as little as possible, at the price of [`lpvmpc::exact_prices`], far from the end of the references
    /// [raised](lpvmpc::ControllerSettings::raise_prices); of outputs at one
    /// that is made in the same way of their derivatives where the plant stands.
    Soft,
    /// It is infeasible.
    Hard,
    /// Each state, or output, has a price of its own per unit of excess, in the unit of the cost; hard where it
    /// has none.
    Priced(Vec<Option<Penalty<f64>>>),
}

/// A linear row lower <= x'x_i + u'u_i <= upper.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its name in messages.
    pub name: String,
    /// Coefficients of the states.
    pub x: DVector<f64>,
    /// Coefficients of the inputs.
    pub u: DVector<f64>,
    /// The least value; minus infinity for none.
    pub lower: f64,
    /// The largest value; infinity for none.
    pub upper: f64,
    /// The price of exceeding it; hard without.
    pub soft: Option<Penalty<f64>>,
}

/// Which linear models the programs of a sample have. All are exact on the motion that is expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinearModels {
    /// The plant's own embedding where it has one, otherwise as [`AlongRay`](Self::AlongRay) with
    /// two nodes.
    #[default]
    Own,
    /// The derivatives of f along the expected motion.
    AlongMotion,
    /// The mean derivatives from the plant's steady state to the expected motion, over so many nodes (1 to 16).
    AlongRay {
        /// Nodes of the Gauss-Legendre formula.
        nodes: usize,
    },
}
