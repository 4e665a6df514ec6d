//! A plant for tests of the guaranteed loop's parts.

use super::plan::{Plan, PlannedStage};
use super::{GuaranteedIterations, GuaranteedSettings, Rollout, TerminalSet};
use crate::list::List;
use crate::model::LpvModel;
use crate::ocp::Bounds;
use crate::predictor::Rk4;
use crate::settings::Weights;
use crate::solver_settings::SolverSettings;
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix1, Matrix1x3, Matrix3, SVector, Vector1, Vector3};

/// The horizon.
pub const N: usize = 12;

/// Place, speed and the lag of a drive; drag grows with the speed squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carriage {
    pub drag: f64,
    pub lag: f64,
}

impl LpvModel<f64, 3, 1, 1> for Carriage {
    fn scheduling(&self, x: &Vector3<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::new(x[1] * x[1])
    }

    fn matrices(&self, s: &Vector1<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        let drag = -self.drag * s[0];
        let a = Matrix3::new(0.0, 1.0, 0.0, 0.0, drag, 1.0, 0.0, 0.0, -self.lag);
        (a, Vector3::new(0.0, 0.0, self.lag))
    }
}

/// Each component at most of this `size`.
pub fn vector<const K: usize>(random: &mut Rng, size: f64) -> SVector<f64, K> {
    SVector::from_fn(|_, _| random.uniform(-size, size))
}

/// Positive definite, of random size.
fn weight(random: &mut Rng) -> Matrix3<f64> {
    let root = Matrix3::from_fn(|_, _| random.uniform(-1.0, 1.0));
    (root * root.transpose() + Matrix3::identity() * 0.01) * random.power_of_ten(-1.0, 3.0)
}

/// Random weights, sets and prices.
pub fn settings(random: &mut Rng) -> GuaranteedSettings<f64, 3, 1> {
    GuaranteedSettings {
        t_s: 0.1,
        horizon: N,
        rk4: Rk4 { substeps: 1 },
        rollout: Rollout {
            rk4: Rk4 { substeps: 2 },
            error: Matrix3::from_diagonal_element(1e-6),
            between: Vector3::repeat(1e-3),
        },
        weights: Weights {
            q: weight(random),
            r: Matrix1::new(random.power_of_ten(-2.0, 2.0)),
        },
        terminal: TerminalSet {
            gain: Matrix1x3::new(1.0, 1.5, 0.5),
            p: weight(random) * 10.0,
            level: random.power_of_ten(0.0, 6.0),
        },
        x: Bounds {
            lower: Vector3::new(f64::NEG_INFINITY, -3.0, -3.0),
            upper: Vector3::new(f64::INFINITY, 3.0, 3.0),
        },
        u: Bounds {
            lower: Vector1::new(-2.0),
            upper: Vector1::new(2.0),
        },
        direction: Vector3::x(),
        set_points: [f64::NEG_INFINITY, f64::INFINITY],
        offset_weight: random.power_of_ten(-1.0, 4.0),
        margin: 4e-3,
        iterations: GuaranteedIterations {
            known: 1,
            unknown: 10,
        },
        soft_price: 1e3,
        solver: SolverSettings::default(),
    }
}

/// A plan of nothing yet.
pub fn plan() -> Plan<f64, 3, 1> {
    Plan::new(List::repeat(PlannedStage::zeros(), N))
}
