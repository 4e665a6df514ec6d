//! The controller: Algorithm 2, its settings, and what it does when a sample goes wrong.

mod algorithm;
mod descent;
mod failures;
mod run_time_bounds;
mod settings;

use crate::plant::CartPole;
use crate::regulator;
use lpvmpc::{Bounds, Controller, ControllerSettings, Reference, Scheduling, Solution, Workspace};
use nalgebra::{SVector, Vector4};

/// The example's regulator with another horizon and another room for active bounds.
type Sized<const N: usize, const M: usize> = Controller<CartPole<f64>, f64, 4, 1, 2, N, M>;
type Memory<const N: usize, const M: usize> = Workspace<f64, 4, 1, N, M>;

/// The example's settings with a horizon of `horizon` samples, on a track that ends at 2.4 m.
fn settings(horizon: usize) -> ControllerSettings<f64, 4, 1, 2> {
    let plant = CartPole::laboratory();
    ControllerSettings {
        horizon,
        soft_x: [None; 4],
        ..regulator::settings(&plant, 2.4, Scheduling::Predicted).unwrap()
    }
}

fn controller<const N: usize, const M: usize>(
    settings: ControllerSettings<f64, 4, 1, 2>,
) -> Sized<N, M> {
    Controller::new(CartPole::laboratory(), settings).unwrap()
}

/// A pole leaning by 30 degrees: the force is at its bound for several samples.
fn tilted() -> Vector4<f64> {
    Vector4::new(0.1, 30_f64.to_radians(), -0.2, 0.1)
}

/// A reference that differs from stage to stage and moves with the sample `k`.
fn moving_reference<const N: usize>(k: usize) -> Reference<f64, 4, N> {
    let at = |i: usize| {
        let t = 0.05 * (k + i) as f64;
        Vector4::new(
            0.3 * t.sin(),
            0.01 * t.cos(),
            0.3 * t.cos(),
            -0.01 * t.sin(),
        )
    };
    Reference {
        stages: std::array::from_fn(at),
        terminal: at(N),
    }
}

/// What holds whatever happens: inputs that an actuator can take.
fn assert_safe<const NU: usize, const N: usize, const M: usize>(
    solution: &Solution<f64, 4, NU, N, M>,
    bounds: &Bounds<f64, NU>,
) {
    let safe = |u: &SVector<f64, NU>| u.iter().all(|u| u.is_finite()) && bounds.contains(u, 0.0);
    assert!(solution.u.iter().all(safe), "{:?}", solution.u);
}
