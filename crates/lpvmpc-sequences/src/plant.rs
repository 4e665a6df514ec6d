//! What a sequence is made of: a plant, and what its inputs are to do.

use lpvmpc::Ocp;
use nalgebra::SVector;

/// A linear time-varying plant and its task.
pub trait Plant<const NX: usize, const NU: usize> {
    /// What the plant keeps of the state that the model predicts.
    const KEPT: f64;

    /// The plant of a seed.
    fn new(seed: u64) -> Self;

    /// The state in which the loop begins.
    fn start(&self) -> SVector<f64, NX>;

    /// The states that are bounded where states are.
    fn bounded_states(&self) -> impl Iterator<Item = usize>;

    /// The problem without bounds at sample `k`, from `x0`.
    fn problem(&self, k: usize, x0: SVector<f64, NX>, horizon: usize) -> Ocp<f64, NX, NU>;
}

/// Two parabolas that together look like a sine of amplitude 1. Sine and cosine differ between machines in the last
/// bit.
pub fn wave(turns: f64) -> f64 {
    let turn = turns - turns.floor();
    if turn < 0.5 {
        16.0 * turn * (0.5 - turn)
    } else {
        -16.0 * (turn - 0.5) * (1.0 - turn)
    }
}
