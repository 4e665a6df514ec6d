//! A step with a preview, taken in two parts.

use super::plants::PENDULUM;
use super::short_case::{Settings, along, moving, settings};
use lpvmpc::{
    Bounds, Controller, ControllerMemory, GeneralRow, Iterations, Penalty, Predictor, Preview, Rk4,
    Workspace,
};
use nalgebra::{Vector1, Vector2};

type Pushes = Vec<Vector2<f64>>;

/// Pushes and bounds that move on with the samples.
fn told(k: usize) -> (Pushes, Vec<Bounds<f64, 1>>) {
    let push = |i: usize| Vector2::new(0.05, 2.0 * (0.4 * (k + i) as f64).sin().signum());
    let bound = |i: usize| 2.5 + f64::from(u8::from((k + i) % 7 < 3)) * 3.0;
    let bounds = |i: usize| Bounds {
        lower: Vector1::new(-bound(i)),
        upper: Vector1::new(bound(i)),
    };
    ((0..25).map(push).collect(), (0..25).map(bounds).collect())
}

fn row() -> GeneralRow<f64, 2, 1> {
    GeneralRow {
        x: Vector2::new(2.0, 0.3),
        u: Vector1::new(1.0),
        lower: -2.0,
        upper: 2.0,
        soft: Some(Penalty {
            linear: 0.5,
            quadratic: 1.0,
        }),
    }
}

/// A loop along which the two ways differ by what `compare` is given: inputs of the same sample.
fn loops(settings: Settings, mut compare: impl FnMut(usize, f64, f64)) {
    let room = settings.capacity().with_own_stages().with_general_rows(1);
    let [mut whole, mut parts] = [(); 2]
        .map(|()| Controller::new(PENDULUM, settings, ControllerMemory::allocate(room)).unwrap());
    let [mut memory, mut other] = [(); 2].map(|()| Workspace::allocate(room));
    let mut x = Vector2::new(0.1, 0.0);
    for k in 0..80 {
        let ((pushes, bounds), states) = (told(k), moving(k));
        let preview = Preview {
            disturbance: &pushes,
            u: &bounds,
            rows: &[&[row()]],
            ..Preview::new(along(&states))
        };
        parts.prepare_with(&preview, &mut other);
        let found = parts.feedback_with(&x, &preview, &mut other).u[0];
        let expected = whole.step_with(&x, &preview, &mut memory).u[0];
        assert!(bounds[0].contains(&found, 0.0));
        compare(k, found[0], expected[0]);
        let f = |x: Vector2<f64>| {
            let rate = 9.81 * x[0].sin() - 0.1 * x[1] + expected[0];
            Vector2::new(x[1], rate) + pushes[0]
        };
        for _ in 0..500 {
            x += f(x + f(x) * 0.5e-4) * 1e-4;
        }
    }
    assert!(x.amax() < 0.5, "{x}");
}

/// Of the paper's loop, to rounding: the program does not depend on the measured state, and the rest
/// of a step is made up for with what was told of its samples.
#[test]
fn a_step_of_the_paper_with_a_preview_can_be_taken_in_two_parts() {
    let rk4 = Rk4 { substeps: 2 };
    for predictor in [
        Predictor::FrozenRk4(rk4),
        Predictor::StageConsistent(rk4),
        Predictor::FrozenExact(rk4),
    ] {
        let settings = Settings {
            iterations: Iterations::Fixed(1),
            predictor,
            ..settings()
        };
        loops(settings, |k, found, expected| {
            let error = (found - expected).abs();
            assert!(error < 1e-9, "{predictor:?}, sample {k}: {error:e}");
        });
    }
}

/// Of a descent, one program of an up-to-date plan: near the converged step.
#[test]
fn a_descent_with_a_preview_can_be_taken_in_two_parts() {
    let mut sum = 0.0;
    loops(settings(), |_, found, expected| {
        sum += (found - expected).abs()
    });
    assert!(sum / 80.0 < 2e-2, "{}", sum / 80.0);
}
