//! The controller on the nonlinear plant.

use super::plant::CartPole;
use super::regulator::Regulator;
use lpvmpc::{Reference, Rk4, Status, Weights};
use nalgebra::{Vector1, Vector4};

/// What was measured, applied and reported at one sample.
pub struct Sample {
    /// Measured state.
    pub x: Vector4<f64>,
    /// Force held until the next sample, in N.
    pub u: Vector1<f64>,
    /// The state that the plan expects at the next sample.
    pub predicted: Vector4<f64>,
    /// What the controller says about it.
    pub status: Status<f64>,
}

/// `samples` samples from the state `x`, towards rest in the middle of the track. Between them
/// the plant moves by 50 small Runge-Kutta steps under the held force.
pub fn run(
    plant: &CartPole,
    controller: &mut Regulator,
    mut x: Vector4<f64>,
    samples: usize,
) -> Vec<Sample> {
    let mut workspace = controller.workspace();
    let rest = Reference::constant(Vector4::zeros());
    let t_s = controller.settings().t_s;
    let one_sample = |_| {
        let plan = controller.step(&x, &rest, &mut workspace);
        let sample = Sample {
            x,
            u: plan.u[0],
            predicted: plan.x[0],
            status: plan.status,
        };
        x = Rk4 { substeps: 50 }.advance(plant, &x, &sample.u, t_s);
        sample
    };
    (0..samples).map(one_sample).collect()
}

/// The closed-loop cost: sum of ||x||_Q^2 + ||u||_R^2 over the samples.
pub fn cost(samples: &[Sample], weights: &Weights<f64, 4, 1>) -> f64 {
    let stage = |Sample { x, u, .. }: &Sample| x.dot(&(weights.q * x)) + u.dot(&(weights.r * u));
    samples.iter().map(stage).sum()
}

/// The largest distance of the cart from the middle of the track, in m.
pub fn farthest(samples: &[Sample]) -> f64 {
    samples.iter().map(|s| s.x[0].abs()).fold(0.0, f64::max)
}

/// The largest error of a prediction over one sample, in units of the state.
pub fn prediction_error(samples: &[Sample]) -> Vector4<f64> {
    let pairs = samples.iter().zip(samples.iter().skip(1));
    let errors = pairs.map(|(now, next)| (next.x - now.predicted).abs());
    errors.fold(Vector4::zeros(), |largest, error| largest.sup(&error))
}

/// Whether the pole ends upright and still, the cart near the middle, and never left the track.
pub fn stands(samples: &[Sample], track: f64) -> bool {
    farthest(samples) <= track && samples.last().is_some_and(|last| last.x.amax() < 0.01)
}
