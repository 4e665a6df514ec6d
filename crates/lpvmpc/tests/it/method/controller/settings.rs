//! Settings that make no sense are refused by name; those at the edge of sense are not.

use super::{settings, tilted};
use crate::method::plant::CartPole;
use lpvmpc::{
    Bounds, Controller, ControllerArrays, ControllerError, ControllerSettings, Iterations, Penalty,
    Predictor, Reference, Rk4, Scheduling, Status, TerminalIngredient,
};
use nalgebra::{Matrix1, Matrix4, SVector, Vector1, Vector2, Vector4};

const N: usize = 10;
type Settings = ControllerSettings<f64, 4, 1, 2>;

/// The error and its message after `change`.
fn refusal(change: impl Fn(&mut Settings)) -> (ControllerError, String) {
    let mut settings = settings(N);
    change(&mut settings);
    let arrays = Box::leak(Box::new(ControllerArrays::<f64, 4, 1, N, N>::default()));
    let outcome = Controller::new(CartPole::laboratory(), settings, arrays.lend());
    let error = outcome.expect_err("settings that make no sense");
    (error, error.to_string())
}

/// Asserts that `change` is refused with `expected`, whose message contains `words`.
fn assert_refused(change: impl Fn(&mut Settings), expected: ControllerError, words: &[&str]) {
    let (error, message) = refusal(change);
    assert_eq!(error, expected);
    for word in words {
        assert!(message.contains(word), "{word:?} is missing in {message:?}");
    }
}

#[test]
fn sampling_time() {
    for t_s in [0.0, -0.05, f64::NAN, f64::INFINITY] {
        let words = ["sampling time", "positive", "seconds"];
        assert_refused(|s| s.t_s = t_s, ControllerError::SamplingTime, &words);
    }
}

#[test]
fn horizon() {
    for given in [0, N + 1, usize::MAX] {
        let expected = ControllerError::Horizon { given, largest: N };
        let number = given.to_string();
        assert_refused(|s| s.horizon = given, expected, &["horizon", &number, "10"]);
    }
}

#[test]
fn sub_steps() {
    let change = |s: &mut Settings| s.predictor = Predictor::FrozenRk4(Rk4 { substeps: 0 });
    assert_refused(change, ControllerError::Substeps, &["sub-step"]);
}

#[test]
fn weights_with_entries_that_make_no_sense() {
    for entry in [f64::NAN, f64::INFINITY, -1.0] {
        // One corner only: not a number, or not symmetric.
        let q = |s: &mut Settings| s.weights.q[(0, 3)] = entry;
        assert_refused(q, ControllerError::WeightEntries("Q"), &["Q", "symmetric"]);
        let p = |s: &mut Settings| {
            let mut p = Matrix4::identity();
            p[(2, 1)] = entry;
            s.terminal = TerminalIngredient::Cost(p);
        };
        assert_refused(p, ControllerError::WeightEntries("P"), &["P", "symmetric"]);
    }
    let r = |s: &mut Settings| s.weights.r = Matrix1::new(f64::NAN);
    assert_refused(r, ControllerError::WeightEntries("R"), &["R", "finite"]);
}

/// The triangle that a factorisation reads is definite; x'Qx, which the controller minimises, is not.
#[test]
fn weights_whose_one_triangle_is_definite() {
    let q = |s: &mut Settings| {
        s.weights.q = Matrix4::identity();
        s.weights.q[(0, 1)] = 4.0;
    };
    assert_refused(q, ControllerError::WeightEntries("Q"), &["Q", "symmetric"]);
    // The difference that counts as rounding is that of a few numbers of double precision.
    let q = |s: &mut Settings| {
        s.weights.q = Matrix4::identity();
        s.weights.q[(0, 1)] = 1e-13;
    };
    assert_refused(q, ControllerError::WeightEntries("Q"), &["Q", "symmetric"]);
}

#[test]
fn weights_of_the_wrong_sign() {
    let q = |s: &mut Settings| s.weights.q[(2, 2)] = -1e-6;
    let words = ["Q", "positive semidefinite"];
    assert_refused(q, ControllerError::WeightSign("Q"), &words);
    let p = |s: &mut Settings| {
        // Positive on the diagonal, eigenvalues 3 and -1.
        let mut p = Matrix4::identity();
        (p[(0, 1)], p[(1, 0)]) = (2.0, 2.0);
        s.terminal = TerminalIngredient::Cost(p);
    };
    let words = ["P", "positive semidefinite"];
    assert_refused(p, ControllerError::WeightSign("P"), &words);
    for r in [0.0, -1.0] {
        let change = |s: &mut Settings| s.weights.r = Matrix1::new(r);
        let words = ["R", "positive definite"];
        assert_refused(change, ControllerError::WeightSign("R"), &words);
    }
}

#[test]
fn prices_that_are_none() {
    for price in [-1.0, f64::NAN, f64::INFINITY] {
        for (linear, quadratic) in [(price, 0.0), (1.0, price)] {
            let change = |s: &mut Settings| s.soft_x[2] = Some(Penalty { linear, quadratic });
            let words = ["price", "state 2", "finite and not negative"];
            assert_refused(change, ControllerError::Price(2), &words);
        }
    }
}

/// Asserts that `lower`, `upper` are refused on every component of state and input.
fn assert_bounds_refused(lower: f64, upper: f64) {
    fn set<const K: usize>(bounds: &mut Bounds<f64, K>, component: usize, lower: f64, upper: f64) {
        bounds.lower[component] = lower;
        bounds.upper[component] = upper;
    }
    for component in 0..4 {
        let expected = ControllerError::Bounds {
            quantity: "state",
            component,
        };
        let words = [format!("state {component}"), "lower bound".into()];
        let change = |s: &mut Settings| set(&mut s.x, component, lower, upper);
        assert_refused(change, expected, &words.each_ref().map(String::as_str));
    }
    let expected = ControllerError::Bounds {
        quantity: "input",
        component: 0,
    };
    let change = |s: &mut Settings| set(&mut s.u, 0, lower, upper);
    assert_refused(change, expected, &["input 0", "lower bound"]);
}

#[test]
fn bounds() {
    assert_bounds_refused(1.0, -1.0);
    assert_bounds_refused(f64::NAN, 1.0);
    assert_bounds_refused(-1.0, f64::NAN);
    // No number is above plus infinity.
    assert_bounds_refused(f64::INFINITY, f64::INFINITY);
    assert_bounds_refused(f64::NEG_INFINITY, f64::NEG_INFINITY);
}

#[test]
fn held_scheduling() {
    for entry in [f64::NAN, f64::INFINITY] {
        let change = |s: &mut Settings| s.scheduling = Scheduling::Held(Vector2::new(0.0, entry));
        let words = ["held scheduling", "finite"];
        assert_refused(change, ControllerError::HeldScheduling, &words);
    }
    let change = |s: &mut Settings| {
        s.scheduling = Scheduling::Held(Vector2::zeros());
        s.iterations = Iterations::default();
    };
    let words = ["linear MPC", "Iterations::Fixed"];
    assert_refused(change, ControllerError::HeldDescent, &words);
}

/// One step under settings that must be accepted.
fn assert_accepted(change: impl Fn(&mut Settings)) {
    let mut settings = settings(N);
    change(&mut settings);
    let mut controller =
        Controller::allocate(CartPole::laboratory(), settings).expect("settings that make sense");
    let mut workspace = controller.workspace();
    let rest = Reference::constant(Vector4::zeros());
    let plan = controller.step(&(tilted() * 0.1), &rest, &mut workspace);
    assert_eq!(plan.status, Status::Solved);
}

#[test]
fn the_edge_of_sense_is_accepted() {
    assert_accepted(|s| s.horizon = 1);
    assert_accepted(|s| s.horizon = N);
    assert_accepted(|s| s.weights.q = Matrix4::zeros());
    assert_accepted(|s| s.terminal = TerminalIngredient::Cost(Matrix4::zeros()));
    // Semidefinite of rank one, with eigenvalues that rounding may make negative.
    let root = Vector4::new(1.0 / 3.0, -0.1, 1e-3, 7.0);
    assert_accepted(|s| s.weights.q = root * root.transpose());
    assert_accepted(|s| s.weights.r = Matrix1::new(1e-9));
    assert_accepted(|s| s.u = Bounds::none());
    // One side only, and an input that is fixed.
    assert_accepted(|s| s.u.lower = SVector::repeat(f64::NEG_INFINITY));
    assert_accepted(|s| (s.u.lower, s.u.upper) = (Vector1::new(0.5), Vector1::new(0.5)));
}

#[test]
fn solver_tolerance() {
    for tolerance in [f64::NAN, f64::INFINITY, 0.0, -1e-9] {
        let change = |s: &mut Settings| s.solver.tolerance = tolerance;
        assert_refused(
            change,
            ControllerError::Tolerance,
            &["tolerance", "positive"],
        );
    }
}
