//! `[controller]` and `[bounds]`: the problem that the controller solves at every sample.

use crate::error::ScenarioError;
use crate::file::schema::{
    BoundsTable, ControllerTable, IterationsTable, LinearModelTable, ModelKind, PredictorTable,
    StateBounds, TerminalTable,
};
use crate::number::{positive, text};
use ballbot::{Ballbot, ControllerSettings, LinearParameters};
use lpvmpc::{
    Bounds, InputReference, Iterations, LpvModel, Predictor, Rk4, Scheduling, SoftBounds,
    SolverSettings, TerminalIngredient, Weights, exact_prices,
};
use nalgebra::{DMatrix, Matrix4, Vector1, Vector3, Vector4};

/// More Runge-Kutta steps per sample than this would be a slip of the pen, and a run without end.
pub(crate) const MOST_SUBSTEPS: usize = 1000;

/// The same for quadratic programs per sample.
const MOST_PROGRAMS: usize = 1000;

impl From<LinearModelTable> for LinearParameters<f64> {
    fn from(table: LinearModelTable) -> Self {
        let LinearModelTable {
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
        } = table;
        Self {
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
        }
    }
}

impl BoundsTable {
    pub(crate) fn check(&self) -> Result<(Bounds<f64, 4>, Bounds<f64, 1>), ScenarioError> {
        let rows = [
            ("phi_rad", self.phi_rad),
            ("theta_rad", self.theta_rad),
            ("phi_dot_rad_s", self.phi_dot_rad_s),
            ("theta_dot_rad_s", self.theta_dot_rad_s),
            ("torque_nm", self.torque_nm),
        ];
        for (key, [lower, upper]) in rows {
            // Negated, so that NaN fails.
            if !(lower <= upper) || lower == f64::INFINITY || upper == f64::NEG_INFINITY {
                return Err(ScenarioError::value(
                    format!("bounds.{key}"),
                    format!("[{}, {}]", text(lower), text(upper)),
                    "the lower bound must not be above the upper one; use -inf and inf for none",
                ));
            }
        }
        let side = |i: usize| {
            Vector4::new(
                self.phi_rad[i],
                self.theta_rad[i],
                self.phi_dot_rad_s[i],
                self.theta_dot_rad_s[i],
            )
        };
        let x = Bounds {
            lower: side(0),
            upper: side(1),
        };
        let u = Bounds {
            lower: Vector1::new(self.torque_nm[0]),
            upper: Vector1::new(self.torque_nm[1]),
        };
        Ok((x, u))
    }
}

/// A controller with a longer horizon takes more memory and time than can be meant.
const LONGEST_HORIZON: usize = 1000;

fn check_horizon(table: &ControllerTable) -> Result<(), ScenarioError> {
    positive("controller.t_s", table.t_s)?;
    if table.horizon == 0 || table.horizon > LONGEST_HORIZON {
        return Err(ScenarioError::value(
            "controller.horizon",
            table.horizon,
            format!("it must be from 1 to {LONGEST_HORIZON} samples"),
        ));
    }
    Ok(())
}

impl ControllerTable {
    /// The settings of the controller alone, without the feedback pipeline.
    pub(crate) fn settings(
        &self,
        ballbot: &Ballbot<f64>,
        (x, u): (Bounds<f64, 4>, Bounds<f64, 1>),
    ) -> Result<ControllerSettings<f64>, ScenarioError> {
        let weights = self.weights(ballbot)?;
        check_horizon(self)?;
        // At rest Coulomb friction makes the fastest pole; beyond the horizon the robot moves.
        let (stiffest, _) = ballbot.matrices(&Vector3::zeros());
        let predictor = self.predictor(&stiffest)?;
        let upright = ballbot.without_coulomb().matrices(&Vector3::zeros());
        let terminal = self.terminal(upright, &weights, predictor)?;
        let scheduling = match self.model {
            ModelKind::Lpv => Scheduling::Predicted,
            ModelKind::Linear => Scheduling::Held(Vector3::zeros()),
        };
        let iterations = self.iterations(predictor)?;
        let descent = matches!(iterations, Iterations::Descent { .. });
        let soft_x = match self.state_bounds {
            None if !descent => [None; 4],
            Some(StateBounds::Hard) => [None; 4],
            None | Some(StateBounds::Soft) => self.prices(upright, &weights, predictor, &x)?,
        };
        Ok(ControllerSettings {
            t_s: self.t_s,
            horizon: self.horizon,
            predictor,
            weights,
            terminal,
            x,
            soft_x,
            raise_prices: true,
            u,
            input_reference: InputReference::SteadyState,
            scheduling,
            iterations,
            solver: SolverSettings::default(),
        })
    }

    /// Where nothing is said: one program per sample for the paper's predictor, as in the paper; for
    /// linear MPC, whose programs are all the same; and with a certified terminal set.
    fn iterations(&self, predictor: Predictor) -> Result<Iterations<f64>, ScenarioError> {
        let paper = matches!(predictor, Predictor::FrozenRk4(_));
        let certified = matches!(self.terminal, TerminalTable::Certified(_));
        let linear = self.model == ModelKind::Linear;
        let usual = if paper || certified || linear {
            IterationsTable::Fixed(1)
        } else {
            IterationsTable::default()
        };
        let (iterations, key, most) = match self.iterations.unwrap_or(usual) {
            IterationsTable::Fixed(most) => (Iterations::Fixed(most), "fixed", most),
            IterationsTable::Descent { .. } if linear => return Ok(Iterations::Fixed(1)),
            IterationsTable::Descent {
                tolerance,
                most,
                first,
            } => {
                let first = first.unwrap_or(most);
                let iterations = Iterations::Descent {
                    tolerance,
                    most,
                    first,
                };
                match first > most {
                    true => (iterations, "descent.first", first),
                    false => (iterations, "descent.most", most),
                }
            }
        };
        if most > MOST_PROGRAMS {
            return Err(ScenarioError::value(
                format!("controller.iterations.{key}"),
                most,
                format!("at most {MOST_PROGRAMS} programs per sample can be solved"),
            ));
        }
        Ok(iterations)
    }

    /// Prices of soft state bounds, high enough to be exact, from the LQR's cost.
    fn prices(
        &self,
        (a, b): (Matrix4<f64>, Vector4<f64>),
        weights: &Weights<f64, 4, 1>,
        predictor: Predictor,
        x: &Bounds<f64, 4>,
    ) -> Result<SoftBounds<f64, 4>, ScenarioError> {
        let lqr = self.lqr((a, b), weights, predictor)?;
        Ok(exact_prices(&lqr, x))
    }

    /// The cost of the LQR of the sampled plant from a state on.
    fn lqr(
        &self,
        (a, b): (Matrix4<f64>, Vector4<f64>),
        weights: &Weights<f64, 4, 1>,
        predictor: Predictor,
    ) -> Result<Matrix4<f64>, ScenarioError> {
        let (a_d, b_d) = predictor.discretize(&a, &b, self.t_s);
        let (q, r) = (dynamic(&weights.q), dynamic(&weights.r));
        let p = lpvmpc_design::lqr_discrete(&dynamic(&a_d), &dynamic(&b_d), &q, &r)?.p;
        Ok(Matrix4::from_fn(|i, j| p[(i, j)]))
    }

    fn predictor(&self, upright: &Matrix4<f64>) -> Result<Predictor, ScenarioError> {
        let a = dynamic(upright);
        let default = PredictorTable::StageConsistent { substeps: None };
        let table = self.predictor.unwrap_or(default);
        let (kind, given, key): (fn(Rk4) -> Predictor, _, _) = match table {
            PredictorTable::Rk4 { substeps } => (Predictor::FrozenRk4, Some(substeps), "rk4"),
            PredictorTable::Exact { substeps } => (Predictor::FrozenExact, substeps, "exact"),
            PredictorTable::StageConsistent { substeps } => {
                (Predictor::StageConsistent, substeps, "stage_consistent")
            }
        };
        let substeps = match given {
            Some(0) => {
                return Err(ScenarioError::value(
                    format!("controller.predictor.{key}.substeps"),
                    0,
                    "at least one step per sample is needed",
                ));
            }
            Some(substeps) => substeps,
            None => lpvmpc_design::accurate_rk4_substeps(&a, self.t_s)?,
        };
        lpvmpc_design::check_rk4_step(&a, self.t_s, substeps)?;
        if substeps > MOST_SUBSTEPS {
            let (key, value, who) = match given {
                Some(_) => {
                    let key = format!("controller.predictor.{key}.substeps");
                    (key, substeps as f64, String::new())
                }
                None => {
                    let who = format!("the fastest pole asks for {substeps} steps per sample, ");
                    ("controller.t_s".to_owned(), self.t_s, who)
                }
            };
            let expected = format!("{who}at most {MOST_SUBSTEPS} steps per sample can be taken");
            return Err(ScenarioError::value(key, value, expected));
        }
        Ok(kind(Rk4 { substeps }))
    }

    fn terminal(
        &self,
        (a, b): (Matrix4<f64>, Vector4<f64>),
        weights: &Weights<f64, 4, 1>,
        predictor: Predictor,
    ) -> Result<TerminalIngredient<f64, 4>, ScenarioError> {
        let q = dynamic(&weights.q);
        let r = DMatrix::from_element(1, 1, weights.r[0]);
        let cost = |p: DMatrix<f64>| TerminalIngredient::Cost(Matrix4::from_fn(|i, j| p[(i, j)]));
        Ok(match &self.terminal {
            TerminalTable::None => TerminalIngredient::Cost(Matrix4::zeros()),
            TerminalTable::Equality => TerminalIngredient::Equality,
            // The certified cost is the guaranteed controller's; without a guarantee it is as by default.
            TerminalTable::DiscreteRiccati | TerminalTable::Certified(_) => {
                TerminalIngredient::Cost(self.lqr((a, b), weights, predictor)?)
            }
            TerminalTable::ContinuousRiccati { linear_model } => {
                let (a, b) = match linear_model {
                    Some(table) => LinearParameters::from(*table).matrices(),
                    None => (a, b),
                };
                cost(lpvmpc_design::lqr_continuous(&dynamic(&a), &dynamic(&b), &q, &r)?.p)
            }
            TerminalTable::Cost { p } => TerminalIngredient::Cost(terminal_cost(p)?),
        })
    }
}

/// P of a file: its symmetric part, once mirrored entries agree up to the digits that a file may
/// leave out, and no eigenvalue is negative by more than that.
fn terminal_cost(p: &[[f64; 4]; 4]) -> Result<Matrix4<f64>, ScenarioError> {
    const ROUNDING: f64 = 1e-10;
    const KEY: &str = "controller.terminal.cost.p";
    let given = Matrix4::from_fn(|i, j| p[i][j]);
    for (i, row) in p.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            if !entry.is_finite() {
                let key = format!("{KEY}[{i}][{j}]");
                return Err(ScenarioError::value(
                    key,
                    entry,
                    "it must be a finite number",
                ));
            }
        }
    }
    let rounding = ROUNDING * given.amax();
    let below = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
    for (i, j) in below {
        let (entry, mirrored) = (given[(i, j)], given[(j, i)]);
        if (entry - mirrored).abs() > rounding {
            return Err(ScenarioError::value(
                format!("{KEY}[{i}][{j}]"),
                entry,
                format!("P must be symmetric, and p[{j}][{i}] is {mirrored}"),
            ));
        }
    }
    let symmetric = given * 0.5 + given.transpose() * 0.5;
    let smallest = dynamic(&symmetric).symmetric_eigenvalues().min();
    if !(smallest >= -rounding) {
        return Err(ScenarioError::value(
            KEY,
            format!("(smallest eigenvalue {smallest:.3e})"),
            "P must be positive semidefinite",
        ));
    }
    Ok(symmetric)
}

pub(crate) fn dynamic<const R: usize, const C: usize>(
    m: &nalgebra::SMatrix<f64, R, C>,
) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |i, j| m[(i, j)])
}
