//! Points that are to go far away: a chain of integrators for each input, from position over speed to the highest
//! derivative, which the input changes.

use crate::plant::{Plant, wave};
use lpvmpc::{Common, Ocp, Terminal};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, SVector};

/// Weights of a position and of its derivatives, along the way and at the end of the horizon.
const POSITION: f64 = 1.0;
const DERIVATIVES: f64 = 0.01;
const POSITION_AT_END: f64 = 10.0;
const DERIVATIVES_AT_END: f64 = 1.0;

/// Chains of integrators, sampled exactly with inputs that are held, on their way to the origin. The gains of the
/// inputs drift.
pub struct Chains<const NX: usize, const NU: usize> {
    /// Sampling time.
    t_s: f64,
    /// Weight of the inputs.
    weight: f64,
    /// Of each chain: how far away its position begins, and where the drift of its gain begins (in turns).
    chains: [(f64, f64); NU],
}

/// The states of chain `j`: as many as of any other, or one more.
fn states<const NX: usize, const NU: usize>(j: usize) -> std::ops::Range<usize> {
    let first = |j: usize| j * (NX / NU) + j.min(NX % NU);
    first(j)..first(j + 1)
}

/// Whether a state is a position.
fn is_position<const NX: usize, const NU: usize>(state: usize) -> bool {
    (0..NU).any(|j| states::<NX, NU>(j).start == state)
}

impl<const NX: usize, const NU: usize> Chains<NX, NU> {
    fn matrices(&self, k: usize) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        // t_s^p / p!
        let power = |p: usize| (1..=p).fold(1.0, |product, i| product * self.t_s / i as f64);
        let mut a = SMatrix::zeros();
        let mut b = SMatrix::zeros();
        for (j, (_, begin)) in self.chains.iter().enumerate() {
            let gain = 1.0 + 0.2 * wave(k as f64 / 40.0 + begin);
            let chain = states::<NX, NU>(j);
            for row in chain.clone() {
                for column in row..chain.end {
                    a[(row, column)] = power(column - row);
                }
                b[(row, j)] = gain * power(chain.end - row);
            }
        }
        (a, b)
    }
}

impl<const NX: usize, const NU: usize> Plant<NX, NU> for Chains<NX, NU> {
    /// Plans brake as late as they can, so that a state that is rounded up is beyond what can be braked. The states
    /// from which the bounds can be kept are convex and hold the origin: this much of one of them is inside.
    const KEPT: f64 = 1.0 - 1e-6;

    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        Self {
            t_s: rng.uniform(0.1, 0.2),
            weight: rng.uniform(1e-5, 1e-4),
            chains: std::array::from_fn(|_| (rng.uniform(2.0, 20.0), rng.uniform(0.0, 1.0))),
        }
    }

    fn start(&self) -> SVector<f64, NX> {
        let mut x = SVector::zeros();
        for (j, (distance, _)) in self.chains.iter().enumerate() {
            x[states::<NX, NU>(j).start] = -distance;
        }
        x
    }

    /// All but the positions.
    fn bounded_states(&self) -> impl Iterator<Item = usize> {
        (0..NX).filter(|&state| !is_position::<NX, NU>(state))
    }

    fn problem(&self, k: usize, x0: SVector<f64, NX>, horizon: usize) -> Ocp<f64, NX, NU> {
        let weights = |position, derivative| {
            let of_state = |state, _| match is_position::<NX, NU>(state) {
                true => position,
                false => derivative,
            };
            SMatrix::from_diagonal(&SVector::from_fn(of_state))
        };
        let mut ocp = Ocp {
            x0,
            common: Common {
                q: weights(POSITION, DERIVATIVES),
                r: SMatrix::identity() * self.weight,
                ..Common::default()
            },
            terminal: Terminal {
                p: weights(POSITION_AT_END, DERIVATIVES_AT_END),
                ..Terminal::default()
            },
            ..Ocp::allocate(horizon)
        };
        for (i, stage) in ocp.stages.iter_mut().enumerate() {
            (stage.a, stage.b) = self.matrices(k + i);
        }
        ocp
    }
}
