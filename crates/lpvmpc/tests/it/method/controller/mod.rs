//! The controller: Algorithm 2, its settings, and what it does when a sample goes wrong.

mod algorithm;
mod descent;
mod failures;
mod memory;
mod run_time_bounds;
mod settings;
mod soft_bounds;

use crate::method::plant::CartPole;
use crate::method::regulator::{self, Regulator};
use lpvmpc::{Bounds, Controller, ControllerSettings, Reference, Scheduling, Solution};
use nalgebra::{SVector, Vector4};

/// The example's settings with a horizon of `horizon` samples, on a track that ends at 2.4 m.
fn settings(horizon: usize) -> ControllerSettings<f64, 4, 1, 2> {
    let plant = CartPole::laboratory();
    ControllerSettings {
        horizon,
        soft_x: [None; 4],
        raise_prices: false,
        ..regulator::settings(&plant, 2.4, Scheduling::Predicted).unwrap()
    }
}

fn controller(settings: ControllerSettings<f64, 4, 1, 2>) -> Regulator {
    Controller::allocate(CartPole::laboratory(), settings).unwrap()
}

/// A pole leaning by 30 degrees: the force is at its bound for several samples.
fn tilted() -> Vector4<f64> {
    Vector4::new(0.1, 30_f64.to_radians(), -0.2, 0.1)
}

/// States from the sample `k` on that differ from stage to stage, the last one at the end of the
/// horizon.
fn moving(horizon: usize, k: usize) -> Vec<Vector4<f64>> {
    let at = |i: usize| {
        let t = 0.05 * (k + i) as f64;
        Vector4::new(
            0.3 * t.sin(),
            0.01 * t.cos(),
            0.3 * t.cos(),
            -0.01 * t.sin(),
        )
    };
    (0..=horizon).map(at).collect()
}

/// Such states as a reference.
fn along(states: &[Vector4<f64>]) -> Reference<'_, f64, 4> {
    let (terminal, stages) = states.split_last().unwrap();
    Reference {
        stages,
        terminal: *terminal,
    }
}

/// What holds whatever happens: inputs that an actuator can take.
fn assert_safe<const NU: usize>(solution: &Solution<f64, 4, NU>, bounds: &Bounds<f64, NU>) {
    let safe = |u: &SVector<f64, NU>| u.iter().all(|u| u.is_finite()) && bounds.contains(u, 0.0);
    assert!(solution.u.iter().all(safe), "{:?}", solution.u);
}
