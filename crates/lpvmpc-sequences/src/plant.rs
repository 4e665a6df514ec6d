//! The plant: damped oscillators whose frequencies drift, weakly coupled; and the waves that its states
//! follow. Sine and cosine differ between machines in the last bit, so there are none.

use lpvmpc::Stage;
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, SVector};

/// The modulus of the oscillators' eigenvalues.
const DAMPING: f64 = 0.95;

/// A stable linear time-varying plant.
pub struct Plant<const NX: usize, const NU: usize> {
    /// Of each state's oscillator: the tangent of half its angle per sample, and where its drift begins.
    oscillators: [(f64, f64); NX],
    coupling: SMatrix<f64, NX, NX>,
    input: SMatrix<f64, NX, NU>,
    /// Of each state's wave: samples until it comes again, and where it begins (in turns).
    waves: [(f64, f64); NX],
}

impl<const NX: usize, const NU: usize> Plant<NX, NU> {
    /// The plant of a seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let spread = 0.2 / NX as f64;
        let oscillators = std::array::from_fn(|_| (rng.uniform(0.05, 0.25), rng.uniform(0.0, 1.0)));
        let coupling = SMatrix::from_fn(|_, _| rng.uniform(-spread, spread));
        let mut input = SMatrix::from_fn(|_, _| rng.uniform(-0.1, 0.1));
        for j in 0..NU {
            input[(Self::driven(j), j)] = rng.uniform(0.3, 0.6);
        }
        let waves = std::array::from_fn(|_| (rng.uniform(12.0, 24.0), rng.uniform(0.0, 1.0)));
        Self {
            oscillators,
            coupling,
            input,
            waves,
        }
    }

    /// The state that input `j` moves most.
    pub fn driven(j: usize) -> usize {
        j * NX / NU
    }

    /// Dynamics at sample `k`, and the linear cost by which the states follow their waves with unit
    /// weight.
    pub fn stage(&self, k: usize) -> Stage<f64, NX, NU> {
        let t = k as f64;
        let swing = wave(t / 40.0);
        Stage {
            a: self.state_matrix(t) + self.coupling * (1.0 + 0.5 * swing),
            b: self.input * (1.0 + 0.2 * swing),
            linear_x: -self.reference(k),
            ..Stage::new()
        }
    }

    /// What the states follow at sample `k`.
    pub fn reference(&self, k: usize) -> SVector<f64, NX> {
        SVector::from_fn(|i, _| {
            let (period, begin) = self.waves[i];
            wave(k as f64 / period + begin)
        })
    }

    /// Pairs of states turn; a last one without a partner decays.
    fn state_matrix(&self, t: f64) -> SMatrix<f64, NX, NX> {
        let mut a = SMatrix::identity() * DAMPING;
        for i in (0..NX.saturating_sub(1)).step_by(2) {
            let (tangent, begin) = self.oscillators[i];
            let tangent = tangent * (1.0 + 0.3 * wave(t / 30.0 + begin));
            let scale = DAMPING / (1.0 + tangent * tangent);
            let cosine = (1.0 - tangent * tangent) * scale;
            let sine = 2.0 * tangent * scale;
            (a[(i, i)], a[(i + 1, i + 1)]) = (cosine, cosine);
            (a[(i, i + 1)], a[(i + 1, i)]) = (sine, -sine);
        }
        a
    }
}

/// Two parabolas that together look like a sine of amplitude 1.
fn wave(turns: f64) -> f64 {
    let turn = turns - turns.floor();
    if turn < 0.5 {
        16.0 * turn * (0.5 - turn)
    } else {
        -16.0 * (turn - 0.5) * (1.0 - turn)
    }
}
