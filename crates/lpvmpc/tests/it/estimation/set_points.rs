//! Set points at which the plant needs an input to stand.

use super::pendulum::PENDULUM;
use lpvmpc::{
    AlongMotion, Bounds, Controller, ControllerSettings, Dynamics, InputReference, Iterations,
    LpvModel, Number, Predictor, RampedInput, Reference, Rk4, Scalar, Scheduling, SolverSettings,
    SteadyStateProblem, TerminalIngredient, Weights,
};
use nalgebra::{
    Matrix1, Matrix1x2, Matrix2, Matrix3, SMatrix, SVector, Vector1, Vector2, Vector3, Vector4,
    convert,
};

const RK4: Rk4 = Rk4 { substeps: 2 };
const T_S: f64 = 0.05;
const N: usize = 30;
const TORQUE: f64 = 8.0;

fn settings(iterations: Iterations<f64>) -> ControllerSettings<f64, 2, 1, 1> {
    ControllerSettings {
        t_s: T_S,
        horizon: N,
        predictor: Predictor::StageConsistent(RK4),
        weights: Weights {
            q: Matrix2::identity(),
            r: Matrix1::new(0.1),
        },
        terminal: TerminalIngredient::Cost(Matrix2::identity() * 20.0),
        x: Bounds::none(),
        soft_x: [None; 2],
        raise_prices: false,
        u: Bounds {
            lower: Vector1::new(-TORQUE),
            upper: Vector1::new(TORQUE),
        },
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations,
        solver: SolverSettings::default(),
    }
}

/// Where the pendulum is after 10 s under `settings`, from upright.
fn arrives(settings: ControllerSettings<f64, 2, 1, 1>, angle: f64) -> (Vector2<f64>, f64) {
    let mut controller = Controller::allocate(PENDULUM, settings).unwrap();
    let mut workspace = controller.workspace();
    let reference = Reference::constant(Vector2::new(angle, 0.0));
    let mut x = Vector2::zeros();
    let mut u = Vector1::zeros();
    for _ in 0..200 {
        let plan = controller.step(&x, &reference, &mut workspace);
        assert!(plan.status.is_solved(), "{angle} rad: {}", plan.status);
        u = plan.u[0];
        x = RK4.advance(&PENDULUM, &x, &u, T_S);
    }
    (x, u[0])
}

/// What holds a pendulum of 1 kg and 1 m: gravity's torque, with the opposite sign.
fn holding(angle: f64) -> f64 {
    -9.81 * angle.sin()
}

#[test]
fn a_pendulum_stands_where_it_is_sent_with_the_torque_that_holds_it() {
    let iterations = [Iterations::Fixed(1), Iterations::default()];
    for iterations in iterations {
        for angle in [-0.85, -0.5, -0.1, 0.0, 0.069, 0.3, 0.5, 0.8] {
            let (x, u) = arrives(settings(iterations), angle);
            assert!((x[0] - angle).abs() < 1e-4, "{angle} rad: {x}");
            assert!((u - holding(angle)).abs() < 1e-2, "{angle} rad: {u} N m");
        }
    }
}

#[test]
fn without_an_input_reference_it_is_drawn_off_its_set_point() {
    // The check above can fail.
    let settings = ControllerSettings {
        input_reference: InputReference::Given(Vector1::zeros()),
        ..settings(Iterations::default())
    };
    let (x, _) = arrives(settings, 0.5);
    assert!((x[0] - 0.5).abs() > 0.1, "{x}");
    // A given one does what the calculated one does.
    let given = ControllerSettings {
        input_reference: InputReference::Given(Vector1::new(holding(0.5))),
        ..settings
    };
    let (x, _) = arrives(given, 0.5);
    assert!((x[0] - 0.5).abs() < 1e-4, "{x}");
}

#[test]
fn what_cannot_be_held_becomes_the_nearest_that_can_and_is_told() {
    let mut controller = Controller::allocate(PENDULUM, settings(Iterations::default())).unwrap();
    let mut workspace = controller.workspace();
    let x = Vector2::zeros();
    let mut target = |angle: f64| {
        let reference = Reference::constant(Vector2::new(angle, 0.0));
        controller.step(&x, &reference, &mut workspace);
        *controller.target().unwrap()
    };
    let farthest = (TORQUE / 9.81).asin();
    for angle in [1.0_f64, 1.2, -1.4] {
        let found = target(angle);
        assert!(!found.reached);
        let expected = Vector2::new(farthest.copysign(angle), 0.0);
        assert!(
            (found.x - expected).norm() < 1e-6,
            "{angle} rad: {}",
            found.x
        );
        assert!((found.u[0] + TORQUE.copysign(angle)).abs() < 1e-6);
    }
    assert!(target(0.9).reached);
    // A rate that never ends is no steady state: it comes to rest at the angle.
    let spinning = Reference::constant(Vector2::new(0.4, 1.0));
    controller.step(&x, &spinning, &mut workspace);
    let found = controller.target().unwrap();
    assert!(!found.reached && found.x[1].abs() < 1e-9, "{}", found.x);
}

#[test]
fn new_bounds_move_the_target() {
    let mut controller = Controller::allocate(PENDULUM, settings(Iterations::default())).unwrap();
    let mut workspace = controller.workspace();
    let reference = Reference::constant(Vector2::new(0.5, 0.0));
    controller.step(&Vector2::zeros(), &reference, &mut workspace);
    assert!(controller.target().unwrap().reached);
    let narrow = Bounds {
        lower: Vector1::new(-2.0),
        upper: Vector1::new(2.0),
    };
    controller.set_bounds(Bounds::none(), narrow).unwrap();
    controller.step(&Vector2::zeros(), &reference, &mut workspace);
    let found = controller.target().unwrap();
    assert!(
        (found.x[0] - (2.0_f64 / 9.81).asin()).abs() < 1e-6,
        "{}",
        found.x
    );
}

#[test]
fn a_ramped_torque_holds_the_pendulum_too() {
    let plain = settings(Iterations::default());
    let mut q = Matrix3::identity();
    q[(2, 2)] = 0.1;
    let unlimited = f64::INFINITY;
    let settings = ControllerSettings {
        t_s: plain.t_s,
        horizon: N,
        predictor: plain.predictor,
        weights: Weights {
            q,
            r: Matrix1::new(1e-3),
        },
        terminal: TerminalIngredient::Cost(q * 20.0),
        x: Bounds {
            lower: Vector3::new(-unlimited, -unlimited, -TORQUE),
            upper: Vector3::new(unlimited, unlimited, TORQUE),
        },
        soft_x: [None; 3],
        raise_prices: false,
        u: Bounds {
            lower: Vector1::new(-40.0),
            upper: Vector1::new(40.0),
        },
        input_reference: InputReference::SteadyState,
        scheduling: plain.scheduling,
        iterations: plain.iterations,
        solver: plain.solver,
    };
    let ramped = RampedInput::<_, 2>(PENDULUM);
    let mut controller = Controller::allocate(ramped, settings).unwrap();
    let mut workspace = controller.workspace();
    let reference = Reference::constant(Vector3::new(0.5, 0.0, 0.0));
    let mut x = Vector3::zeros();
    for _ in 0..200 {
        let plan = controller.step(&x, &reference, &mut workspace);
        assert!(plan.status.is_solved(), "{}", plan.status);
        x = RK4.advance(&ramped, &x, &plan.u[0], T_S);
    }
    let expected = Vector3::new(0.5, 0.0, holding(0.5));
    assert!((x - expected).norm() < 1e-3, "{x}");
}

/// x_dot = -x + u_1 + 2 u_2: two inputs for one state.
struct TwoPumps;

impl LpvModel<f64, 1, 2, 1> for TwoPumps {
    fn scheduling(&self, x: &Vector1<f64>, _: &Vector2<f64>) -> Vector1<f64> {
        *x
    }

    fn matrices(&self, _: &Vector1<f64>) -> (Matrix1<f64>, SMatrix<f64, 1, 2>) {
        (Matrix1::new(-1.0), Matrix1x2::new(1.0, 2.0))
    }
}

#[test]
fn of_several_inputs_that_hold_a_state_the_cheapest_is_taken() {
    let unbounded = SteadyStateProblem {
        x_ref: Vector1::new(3.0),
        q: Vector1::new(1.0),
        r: Vector2::new(1.0, 8.0),
        x: Bounds::none(),
        u: Bounds::none(),
    };
    let found = TwoPumps.steady_state(&unbounded).unwrap();
    // min u_1^2 + 8 u_2^2 with u_1 + 2 u_2 = 3: u_2 = u_1 / 4.
    assert!(
        (found.u - Vector2::new(2.0, 0.5)).norm() < 1e-6,
        "{}",
        found.u
    );
    let bounded = SteadyStateProblem {
        u: Bounds {
            lower: Vector2::zeros(),
            upper: Vector2::new(1.0, 5.0),
        },
        ..unbounded
    };
    let found = TwoPumps.steady_state(&bounded).unwrap();
    assert!(found.reached);
    assert!(
        (found.u - Vector2::new(1.0, 1.0)).norm() < 1e-6,
        "{}",
        found.u
    );
    let weak = SteadyStateProblem {
        u: Bounds {
            lower: Vector2::zeros(),
            upper: Vector2::new(1.0, 0.5),
        },
        ..unbounded
    };
    let found = TwoPumps.steady_state(&weak).unwrap();
    assert!(
        !found.reached && (found.x[0] - 2.0).abs() < 1e-6,
        "{}",
        found.x
    );
    let drained = SteadyStateProblem {
        x_ref: Vector1::new(f64::NAN),
        ..unbounded
    };
    assert!(TwoPumps.steady_state(&drained).is_none());
}

/// A cart with a hanging load, x = (position, angle from upright, their rates): one input that moves
/// both, so that a held angle is out of the question.
struct CartPole;

impl Dynamics<4, 1> for CartPole {
    fn f<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 1>) -> SVector<N, 4> {
        let number = N::constant;
        let (sin, cos) = x[1].sin_cos();
        let speed = (u[0] + number(0.3) * sin * (number(9.81) * cos - number(0.5) * x[3] * x[3]))
            / (number(1.0) + number(0.3) * sin * sin);
        let turning = (number(9.81) * sin + cos * speed) / number(0.5);
        SVector::from([x[2], x[3], speed, turning])
    }
}

#[test]
fn from_where_a_plant_cannot_stand_the_nearest_place_is_found() {
    fn find<T: Scalar + Number>(angle: f64, r: f64) -> [f64; 5] {
        let model = AlongMotion::<_, 5>(CartPole);
        let found = LpvModel::<T, 4, 1, 5>::steady_state(
            &model,
            &SteadyStateProblem {
                x_ref: SVector::<T, 4>::from([1.5, angle, 0.0, 0.0].map(convert::<f64, T>)),
                q: SVector::repeat(T::one()),
                r: Vector1::new(convert::<f64, T>(r)),
                x: Bounds::none(),
                u: Bounds::none(),
            },
        );
        let found = found.unwrap_or_else(|| panic!("nothing from {angle} rad with {r}"));
        let near = convert_to_f64(T::default_epsilon()).powf(0.25);
        assert_eq!(found.reached, angle.abs() <= near);
        let entries = found.x.iter().chain(found.u.iter());
        let entries: Vec<f64> = entries.map(|entry| convert_to_f64(*entry)).collect();
        entries.try_into().unwrap()
    }

    fn convert_to_f64<T: Scalar>(number: T) -> f64 {
        nalgebra::try_convert(number).unwrap()
    }

    // What the input costs beside the state must not matter.
    // Near a quarter turn, where f is level, Newton's steps lead turns away.
    for angle in [0.0, 0.001, 0.05, 0.2, -0.4, 0.8, 1.5, -1.55] {
        for r in [1e-4, 0.01, 1.0, 100.0] {
            for (found, tolerance) in [(find::<f64>(angle, r), 1e-9), (find::<f32>(angle, r), 1e-3)]
            {
                for (entry, expected) in found.iter().zip([1.5, 0.0, 0.0, 0.0, 0.0]) {
                    assert!(
                        (entry - expected).abs() < tolerance,
                        "{angle} {r}: {found:?}"
                    );
                }
            }
        }
    }
}

/// Two pumps and four tanks, of which two run out into the others (Johansson 2000): levels in cm, voltages.
struct FourTanks;

impl Dynamics<4, 2> for FourTanks {
    fn f<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 2>) -> SVector<N, 4> {
        let outlets = [0.071, 0.057, 0.071, 0.057].map(N::constant);
        let [a, b, c, d] =
            std::array::from_fn(|i| outlets[i] * (N::constant(2.0 * 981.0) * x[i]).sqrt());
        let flow = |part: f64, u: N| N::constant(part) * u;
        let [into_a, into_b] = [flow(0.7 * 3.33, u[0]), flow(0.6 * 3.35, u[1])];
        let [into_c, into_d] = [flow(0.4 * 3.35, u[1]), flow(0.3 * 3.33, u[0])];
        let net = [into_a - a + c, into_b - b + d, into_c - c, into_d - d];
        let areas = [28.0, 32.0, 28.0, 32.0].map(N::constant);
        SVector::from_fn(|i, _| net[i] / areas[i])
    }
}

/// Two voltages hold two levels, not four; bounds are met, and beyond them a root has no value. The expected numbers are
/// IPOPT's.
#[test]
fn the_nearest_place_is_found_at_bounds_too() {
    let model = AlongMotion::<_, 6>(FourTanks);
    let cases = [
        (
            [8.491_420, 12.450_344, 16.279_188, 21.816_375],
            [9.228_65, 15.274_43, 2.935_36, 0.5],
            [1.787_08, 4.021_00],
        ),
        (
            [-1.655_729, 15.496_565, 7.062_081, -0.121_884],
            [8.025_84, 12.428_82, 2.275_30, 0.5],
            [1.787_08, 3.540_16],
        ),
    ];
    for (x_ref, x, u) in cases {
        let problem = SteadyStateProblem {
            x_ref: Vector4::from(x_ref),
            q: Vector4::repeat(1.0),
            r: Vector2::repeat(1.0),
            x: Bounds {
                lower: Vector4::repeat(0.5),
                upper: Vector4::repeat(20.0),
            },
            u: Bounds {
                lower: Vector2::zeros(),
                upper: Vector2::repeat(10.0),
            },
        };
        let found = model.steady_state(&problem).unwrap();
        assert!(!found.reached);
        assert!((found.x - Vector4::from(x)).amax() < 1e-5, "{}", found.x);
        assert!((found.u - Vector2::from(u)).amax() < 1e-5, "{}", found.u);
    }
}
