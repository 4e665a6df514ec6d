//! The ramped input: the same plant, and a controller that keeps the rate within bounds.

use super::pendulum::PENDULUM;
use crate::pendulum::Pendulum;
use lpvmpc::{
    Bounds, Controller, ControllerSettings, InputReference, Iterations, LpvModel, Planner,
    Predictor, RampedInput, Reference, Rk4, Scheduling, SolverSettings, TerminalIngredient,
    Weights,
};
use nalgebra::{Matrix1, Matrix3, Vector1, Vector2, Vector3};

type Ramped = RampedInput<Pendulum<f64>, 2>;

#[test]
fn its_motion_is_that_of_the_plant_under_a_ramp() {
    let ramped = RampedInput(PENDULUM);
    let (x, u, rate) = (
        Vector2::new(0.4, -0.3),
        Vector1::new(1.2),
        Vector1::new(-5.0),
    );
    let joint: Vector3<f64> = Ramped::join(&x, &u);
    assert_eq!(Ramped::split(&joint), (x, u));
    let steps = 4000;
    let t_s = 0.1;
    let found = Rk4 { substeps: 40 }.advance(&ramped, &joint, &rate, t_s);
    // A staircase through the middles of the ramp's steps: its error falls with their square.
    let mut plain = x;
    let h = t_s / f64::from(steps);
    for i in 0..steps {
        let held = u + rate * (h * (f64::from(i) + 0.5));
        plain = Rk4 { substeps: 1 }.advance(&PENDULUM, &plain, &held, h);
    }
    assert!(
        (found.fixed_rows::<2>(0) - plain).norm() < 1e-8,
        "{found}{plain}"
    );
    assert!((found[2] - (u + rate * t_s)[0]).abs() < 1e-12);
    // f and A, B are the same right-hand side.
    let (a, b) = ramped.matrices(&ramped.scheduling(&joint, &Vector1::zeros()));
    assert!((a * joint + b * rate - ramped.derivative(&joint, &rate)).norm() < 1e-12);
}

const RK4: Rk4 = Rk4 { substeps: 1 };

/// A controller of the rate that ends upright: with these limits of input and rate.
fn settings(limit: f64, rate_limit: f64, t_s: f64) -> ControllerSettings<f64, 3, 1, 1> {
    let infinity = f64::INFINITY;
    ControllerSettings {
        t_s,
        horizon: 20,
        predictor: Predictor::FrozenRk4(RK4),
        weights: Weights {
            q: Matrix3::from_diagonal(&Vector3::new(100.0, 1.0, 0.01)),
            r: Matrix1::new(1e-4),
        },
        terminal: TerminalIngredient::Equality,
        x: Bounds {
            lower: Vector3::new(-infinity, -infinity, -limit),
            upper: Vector3::new(infinity, infinity, limit),
        },
        u: Bounds {
            lower: Vector1::new(-rate_limit),
            upper: Vector1::new(rate_limit),
        },
        soft_x: [None; 3],
        raise_prices: false,
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations: Iterations::Fixed(1),
        solver: SolverSettings::default(),
    }
}

#[test]
fn rate_and_input_stay_within_bounds() {
    let (limit, rate_limit, t_s) = (8.0, 40.0, 0.05);
    let settings = settings(limit, rate_limit, t_s);
    let ramped = RampedInput(PENDULUM);
    let mut controller = Controller::allocate(ramped, settings).unwrap();
    let mut workspace = controller.workspace();
    let upright = Reference::constant(Vector3::zeros());
    let mut joint = Vector3::new(0.4, 0.0, 0.0);
    let mut most = 0.0_f64;
    for _ in 0..100 {
        let plan = controller.step(&joint, &upright, &mut workspace);
        assert!(plan.status.is_solved(), "{}", plan.status);
        let rate = plan.u[0];
        assert!(rate[0].abs() <= rate_limit * (1.0 + 1e-9));
        most = most.max(rate[0].abs());
        joint = RK4.advance(&ramped, &joint, &rate, t_s);
        assert!(joint[2].abs() <= limit * (1.0 + 1e-6), "{joint}");
    }
    assert!(
        (most - rate_limit).abs() < 1e-6,
        "the bound was needed: {most}"
    );
    assert!(joint.norm() < 1e-2, "{joint}");
}

/// Programs without a solution wound the input up beyond its bounds, from where it had to come back.
#[test]
fn an_input_without_a_plan_stays_within_its_bounds() {
    let (limit, t_s) = (8.0, 0.05);
    let controller =
        Controller::allocate(RampedInput(PENDULUM), settings(limit, 40.0, t_s)).unwrap();
    let mut workspace = controller.workspace();
    let mut planner = lpvmpc::Ramped::allocate(controller);
    let allowed = Bounds {
        lower: Vector1::new(-limit),
        upper: Vector1::new(limit),
    };
    let upright = Reference::constant(Vector2::zeros());
    let mut at_limit = false;
    for _ in 0..40 {
        // So far down nothing brings it upright in time.
        let fallen = Vector2::new(1.5, 2.0);
        let nothing = Vector1::zeros();
        let plan = planner.plan(&fallen, &nothing, &allowed, &upright, &mut workspace);
        assert!(!plan.status.is_solved(), "{}", plan.status);
        let mean = planner.input(t_s)[0];
        let input = planner.next_input().unwrap()[0];
        assert!(
            input.abs() <= limit && mean.abs() <= limit,
            "{input}, {mean}"
        );
        at_limit |= input.abs() == limit;
    }
    assert!(at_limit);
}
