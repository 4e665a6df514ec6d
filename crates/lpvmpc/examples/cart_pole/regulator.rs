//! The controller that puts the pole upright over the middle of the track.

use super::plant::CartPole;
use lpvmpc::riccati::{BadPivot, CostToGo, StageFactor};
use lpvmpc::{
    Bounds, Common, Controller, ControllerSettings, Iterations, LpvModel, Predictor, Rk4,
    Scheduling, Stage, TerminalIngredient, Weights,
};
use nalgebra::{Matrix1, Matrix4, Vector1, Vector2, Vector4};

/// Stages of the horizon.
pub const STAGES: usize = 30;
/// The controller: 4 states, 1 input, 2 scheduling parameters.
pub type Regulator = Controller<CartPole, f64, 4, 1, 2>;

/// Largest force, in N.
pub const FORCE: f64 = 15.0;

/// Settings for `plant` on a track that ends `track` metres from its middle on either side;
/// `scheduling` chooses between LPV MPC and linear MPC.
///
/// # Errors
/// [`BadPivot`] from [`terminal_weight`].
pub fn settings(
    plant: &CartPole,
    track: f64,
    scheduling: Scheduling<f64, 2>,
) -> Result<ControllerSettings<f64, 4, 1, 2>, BadPivot<f64>> {
    let t_s = 0.05;
    let predictor = Predictor::FrozenRk4(Rk4 { substeps: 2 });
    let weights = Weights {
        q: Matrix4::from_diagonal(&Vector4::new(10.0, 10.0, 0.1, 0.1)),
        r: Matrix1::new(0.01),
    };
    let (a, b) = plant.matrices(&Vector2::zeros());
    let (a, b) = predictor.discretize(&a, &b, t_s);
    let mut x = Bounds::none();
    x.lower[0] = -track;
    x.upper[0] = track;
    let terminal = TerminalIngredient::Cost(terminal_weight(&a, &b, &weights)?);
    let force = Bounds {
        lower: Vector1::new(-FORCE),
        upper: Vector1::new(FORCE),
    };
    let settings = ControllerSettings::new(t_s, STAGES, weights, terminal, force);
    Ok(ControllerSettings {
        predictor,
        scheduling,
        iterations: Iterations::Fixed(1),
        ..settings.soft_bounds(x)
    })
}

/// P of the discrete-time Riccati equation: the cost of the infinite horizon beyond the last
/// stage, as the limit of the Riccati recursion, to a relative change of 1e-13.
///
/// # Errors
/// [`BadPivot`] if the recursion meets an R + B'PB that is not positive definite.
pub fn terminal_weight(
    a: &Matrix4<f64>,
    b: &Vector4<f64>,
    weights: &Weights<f64, 4, 1>,
) -> Result<Matrix4<f64>, BadPivot<f64>> {
    let stage = Stage {
        a: *a,
        b: *b,
        ..Stage::new()
    };
    let common = Common {
        q: weights.q,
        r: weights.r,
        ..Common::default()
    };
    let mut factor = StageFactor::zeros();
    let mut cost_to_go = CostToGo {
        quadratic: weights.q,
        linear: Vector4::zeros(),
    };
    for _ in 0..10_000 {
        let before = cost_to_go.quadratic;
        factor.eliminate(&stage, &common, &mut cost_to_go)?;
        let p = cost_to_go.quadratic;
        if (p - before).norm() <= 1e-13 * p.norm() {
            break;
        }
    }
    Ok(cost_to_go.quadratic)
}
