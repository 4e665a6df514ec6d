//! Damped oscillators whose frequencies drift, weakly coupled, and the waves that their states follow.

use crate::limits::driven;
use crate::plant::{Plant, wave};
use lpvmpc::{Common, Ocp, Stage, Terminal};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, SVector};

/// The modulus of the oscillators' eigenvalues.
const DAMPING: f64 = 0.95;

/// A stable linear time-varying plant.
pub struct Oscillators<const NX: usize, const NU: usize> {
    /// Of each state's oscillator: the tangent of half its angle per sample, and where its drift begins.
    oscillators: [(f64, f64); NX],
    coupling: SMatrix<f64, NX, NX>,
    input: SMatrix<f64, NX, NU>,
    /// Of each state's wave: samples until it comes again, and where it begins (in turns).
    waves: [(f64, f64); NX],
}

impl<const NX: usize, const NU: usize> Oscillators<NX, NU> {
    /// Dynamics at sample `k`, and the linear cost by which the states follow their waves with unit
    /// weight.
    fn stage(&self, k: usize) -> Stage<f64, NX, NU> {
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
    fn reference(&self, k: usize) -> SVector<f64, NX> {
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

impl<const NX: usize, const NU: usize> Plant<NX, NU> for Oscillators<NX, NU> {
    const KEPT: f64 = 1.0;

    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let spread = 0.2 / NX as f64;
        let oscillators = std::array::from_fn(|_| (rng.uniform(0.05, 0.25), rng.uniform(0.0, 1.0)));
        let coupling = SMatrix::from_fn(|_, _| rng.uniform(-spread, spread));
        let mut input = SMatrix::from_fn(|_, _| rng.uniform(-0.1, 0.1));
        for j in 0..NU {
            input[(driven::<NX, NU>(j), j)] = rng.uniform(0.3, 0.6);
        }
        let waves = std::array::from_fn(|_| (rng.uniform(12.0, 24.0), rng.uniform(0.0, 1.0)));
        Self {
            oscillators,
            coupling,
            input,
            waves,
        }
    }

    fn start(&self) -> SVector<f64, NX> {
        SVector::zeros()
    }

    /// Of each input the state that it moves most.
    fn bounded_states(&self) -> impl Iterator<Item = usize> {
        (0..NU).map(driven::<NX, NU>)
    }

    /// All states follow their waves.
    fn problem(&self, k: usize, x0: SVector<f64, NX>, horizon: usize) -> Ocp<f64, NX, NU> {
        let mut ocp = Ocp {
            x0,
            common: Common {
                q: SMatrix::identity(),
                r: SMatrix::identity() * 0.1,
                ..Common::default()
            },
            terminal: Terminal {
                p: SMatrix::identity() * 5.0,
                linear_x: self.reference(k + horizon) * -5.0,
                ..Terminal::default()
            },
            ..Ocp::allocate(horizon)
        };
        for (i, stage) in ocp.stages.iter_mut().enumerate() {
            *stage = self.stage(k + i);
        }
        ocp
    }
}
