//! What soft state bounds cost: prices rise with the way to the end of the reference where they are to.

use super::{assert_safe, controller, settings};
use lpvmpc::{
    Bounds, Controller, ControllerSettings, Embedding, Iterations, Number, Ocp, Penalty, Preview,
    Reference, Rk4, TerminalIngredient, Weights,
};
use nalgebra::{Matrix1, Matrix2, Matrix4, SMatrix, SVector, Vector1, Vector2, Vector4};

const N: usize = 20;
type Settings = ControllerSettings<f64, 4, 1, 2>;

/// With soft bounds of angle and speed.
fn soft(iterations: Iterations<f64>) -> Settings {
    let mut x = Bounds::none();
    (x.lower[1], x.upper[1]) = (-0.4, 0.4);
    x.upper[2] = 3.0;
    Settings {
        iterations,
        ..settings(N)
    }
    .soft_bounds(x)
}

fn terminal(settings: &Settings) -> Matrix4<f64> {
    match settings.terminal {
        TerminalIngredient::Cost(p) => p,
        TerminalIngredient::Equality => panic!("the example has a terminal cost"),
    }
}

/// What the documentation says, written out.
fn expected(settings: &Settings, way: Vector4<f64>) -> [Option<f64>; 4] {
    let p = terminal(settings);
    let q = settings.weights.q;
    let still = (way.transpose() * (p + q * N as f64) * way)[(0, 0)];
    let of_way = |j: usize| 4.0 * (p[(j, j)] * still).sqrt();
    let (angle, speed) = (20.0 * p[(1, 1)] * 0.8, 20.0 * p[(2, 2)] * 3.0);
    let raised = settings.raise_prices;
    let price = |own: f64, j| if raised { own.max(of_way(j)) } else { own };
    [None, Some(price(angle, 1)), Some(price(speed, 2)), None]
}

/// The prices of a program, in the unit of J, of which it has a half.
fn posed(soft: &[Option<Penalty<f64>>; 4]) -> [Option<f64>; 4] {
    soft.map(|price| price.map(|price| 2.0 * price.linear))
}

fn assert_close(found: [Option<f64>; 4], expected: [Option<f64>; 4]) {
    for (found, expected) in found.iter().zip(&expected) {
        match (found, expected) {
            (Some(found), Some(expected)) => {
                assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
            }
            _ => assert_eq!(found, expected),
        }
    }
}

fn assert_posed(ocp: &Ocp<f64, 4, 1>, expected: [Option<f64>; 4]) {
    assert_close(posed(&ocp.common.soft_x), expected);
    assert_close(posed(&ocp.terminal.soft_x), expected);
}

#[test]
fn prices_rise_with_the_way() {
    let x = Vector4::new(0.2, 0.05, 0.0, 0.0);
    for iterations in [Iterations::Fixed(1), Iterations::default()] {
        let given = Settings {
            raise_prices: false,
            ..soft(iterations)
        };
        for settings in [soft(iterations), given] {
            let mut tried = controller(settings);
            let mut memory = tried.workspace();
            let mut before = 0.0;
            for goal in [0.3, 5.0, 50.0] {
                let end = Vector4::new(goal, 0.0, 0.0, 0.0);
                tried.reset();
                tried.step(&x, &Reference::constant(end), &mut memory);
                assert_posed(memory.ocp(), expected(&settings, x - end));
                let price = posed(&memory.ocp().common.soft_x)[1].unwrap();
                assert!(price >= before);
                before = price;
            }
            let own = 20.0 * terminal(&settings)[(1, 1)] * 0.8;
            assert_eq!(before > own, settings.raise_prices);
        }
    }
}

/// A step in two parts takes the way from where the plant will be.
#[test]
fn so_do_those_of_a_step_in_two_parts() {
    let settings = soft(Iterations::default());
    let mut tried = controller(settings);
    let mut memory = tried.workspace();
    let end = Vector4::new(5.0, 0.0, 0.0, 0.0);
    let reference = Reference::constant(end);
    tried.step(&Vector4::zeros(), &reference, &mut memory);
    let next = tried.rollout()[0];
    tried.prepare(&reference, &mut memory);
    assert_posed(memory.ocp(), expected(&settings, next - end));
    // After a feedback of the paper's loop it is where that leads to.
    let settings = soft(Iterations::Fixed(1));
    let mut tried = controller(settings);
    tried.step(&Vector4::zeros(), &reference, &mut memory);
    tried.prepare(&reference, &mut memory);
    tried.feedback(&Vector4::new(2.0, 0.05, 0.0, 0.0), &reference, &mut memory);
    tried.prepare(&reference, &mut memory);
    let next = tried.rollout()[0];
    assert!((next[0] - 2.0).abs() < 0.1, "{next}");
    assert_posed(memory.ocp(), expected(&settings, next - end));
}

/// Prices of a preview are raised, too, whether the settings have some or not.
#[test]
fn so_do_those_of_a_preview() {
    let settings = soft(Iterations::default());
    let mut capacity = settings.capacity();
    capacity = capacity.with_own_stages();
    let mut memory = lpvmpc::Workspace::allocate(capacity);
    let end = Vector4::new(50.0, 0.0, 0.0, 0.0);
    let cheap = settings.soft_x.map(|price| {
        price.map(|price| Penalty {
            linear: 1e-3 * price.linear,
            ..price
        })
    });
    let stages = [cheap; N + 1];
    let preview = Preview {
        soft_x: &stages,
        ..Preview::new(Reference::constant(end))
    };
    // So far away the way alone makes the price.
    let expected = expected(&settings, -end);
    for soft_x in [settings.soft_x, [None; 4]] {
        let mut tried = controller(Settings { soft_x, ..settings });
        let plan = tried.step_with(&Vector4::zeros(), &preview, &mut memory);
        assert!(plan.status.is_solved(), "{}", plan.status);
        for common in memory.ocp().own.iter().take(N) {
            assert_close(posed(&common.soft_x), expected);
        }
        assert_close(posed(&memory.ocp().terminal.soft_x), expected);
    }
}

/// Where the way is too long for the number type, or there is no cost of the end, prices are those of the settings.
#[test]
fn a_price_is_a_number() {
    let plain = soft(Iterations::default());
    let own = expected(
        &Settings {
            raise_prices: false,
            ..plain
        },
        Vector4::zeros(),
    );
    let none = Settings {
        terminal: TerminalIngredient::Cost(Matrix4::zeros()),
        ..plain
    };
    let equality = Settings {
        terminal: TerminalIngredient::Equality,
        ..plain
    };
    for (settings, goal) in [(plain, 1e300), (none, 5.0), (equality, 5.0)] {
        let mut tried = controller(settings);
        let mut memory = tried.workspace();
        let reference = Reference::constant(Vector4::new(goal, 0.0, 0.0, 0.0));
        let plan = tried.step(&Vector4::zeros(), &reference, &mut memory);
        assert_safe(plan, &settings.u);
        assert_posed(memory.ocp(), own);
    }
}

/// A mass of 1 kg on a rail, pushed by a force: position and speed.
#[derive(Debug)]
struct Cart;

impl Embedding<2, 1, 0> for Cart {
    fn scheduling<N: Number>(&self, _: &SVector<N, 2>, _: &SVector<N, 1>) -> SVector<N, 0> {
        SVector::repeat(N::constant(0.0))
    }

    fn matrices<N: Number>(&self, _: &SVector<N, 0>) -> (SMatrix<N, 2, 2>, SMatrix<N, 2, 1>) {
        let [zero, one] = [0.0, 1.0].map(N::constant);
        (
            SMatrix::from([[zero, zero], [one, zero]]),
            SMatrix::from([[zero, one]]),
        )
    }
}

/// The speed costs next to nothing itself, but it brings the cart to its goal. Hard bounds keep it, so soft ones have to,
/// with the same motion.
#[test]
fn a_price_is_above_what_an_excess_brings() {
    let (t_s, limit) = (0.1, 0.3);
    for (r, horizon, goal, end) in [
        (0.1, 30, 3.0, 1.0),
        (1e-3, 20, 10.0, 1.0),
        (1.0, 60, 3.0, 0.01),
        (0.1, 10, 100.0, 100.0),
    ] {
        let weights = Weights {
            q: Matrix2::from_diagonal(&Vector2::new(100.0, 0.0)),
            r: Matrix1::new(r),
        };
        let terminal = TerminalIngredient::Cost(Matrix2::from_diagonal(&Vector2::new(100.0, end)));
        let mut speed = Bounds::none();
        (speed.lower[1], speed.upper[1]) = (-limit, limit);
        let u = Bounds {
            lower: Vector1::new(-1.0),
            upper: Vector1::new(1.0),
        };
        let settings = ControllerSettings::new(t_s, horizon, weights, terminal, u);
        let soft = settings.soft_bounds(speed);
        let hard = ControllerSettings {
            x: speed,
            ..settings
        };
        let reference = Reference::constant(Vector2::new(goal, 0.0));
        let [soft, hard] = [soft, hard].map(|settings| {
            let mut controller = Controller::allocate(Cart, settings).unwrap();
            let mut workspace = controller.workspace();
            let mut x = Vector2::zeros();
            (0..200)
                .map(|_| {
                    let plan = controller.step(&x, &reference, &mut workspace);
                    assert!(plan.status.is_solved(), "{}", plan.status);
                    x = Rk4 { substeps: 1 }.advance(&Cart, &x, &plan.u[0], t_s);
                    x
                })
                .collect::<Vec<_>>()
        });
        for (soft, hard) in soft.iter().zip(&hard) {
            assert!(soft[1] <= limit + 1e-9, "{} m/s within {limit}", soft[1]);
            assert!((soft - hard).amax() < 1e-4, "{soft} {hard}");
        }
        assert!(hard.iter().any(|x| x[1] > limit - 1e-6));
    }
}
