//! The direction of the set points: where the plant must not notice that it was moved.

use lpvmpc::{
    Bounds, GuaranteedController, GuaranteedError, GuaranteedIterations, GuaranteedSettings,
    LpvModel, Rk4, Rollout, SolverSettings, TerminalSet, Weights,
};
use nalgebra::{Matrix1, Matrix1x2, Matrix2, Vector1, Vector2};

/// x = (position, speed), pulled back by A[(1, 0)] = `pull`(s), with s = `scheduling`(x).
#[derive(Clone, Copy)]
struct Cart {
    pull: fn(f64) -> f64,
    scheduling: fn(f64, f64) -> f64,
}

impl LpvModel<f64, 2, 1, 1> for Cart {
    fn scheduling(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::new((self.scheduling)(x[0], x[1]))
    }

    fn matrices(&self, s: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        let a = Matrix2::new(0.0, 1.0, -(self.pull)(s[0]), -1.0);
        (a, Vector2::new(0.0, 1.0))
    }
}

fn check(cart: Cart, x: Bounds<f64, 2>) -> Result<(), GuaranteedError> {
    let settings = GuaranteedSettings {
        t_s: 0.1,
        horizon: 4,
        rk4: Rk4 { substeps: 1 },
        rollout: Rollout {
            rk4: Rk4 { substeps: 1 },
            error: Matrix2::zeros(),
            between: Vector2::zeros(),
        },
        weights: Weights {
            q: Matrix2::identity(),
            r: Matrix1::new(1.0),
        },
        terminal: TerminalSet {
            gain: Matrix1x2::new(1.0, 1.0),
            p: Matrix2::identity(),
            level: 1e-2,
        },
        x,
        u: Bounds::none(),
        direction: Vector2::x(),
        set_points: [f64::NEG_INFINITY, f64::INFINITY],
        offset_weight: 1.0,
        margin: 1e-3,
        iterations: GuaranteedIterations {
            known: 1,
            unknown: 1,
        },
        soft_price: 1.0,
        solver: SolverSettings::default(),
    };
    GuaranteedController::allocate(cart, settings).map(|_| ())
}

const FREE: Cart = Cart {
    pull: |_| 0.0,
    scheduling: |_, speed| speed,
};

#[test]
fn a_plant_that_is_the_same_everywhere_is_accepted() {
    let wide = Bounds {
        lower: Vector2::new(-1e3, -50.0),
        upper: Vector2::new(1e3, 50.0),
    };
    for bounds in [Bounds::none(), wide] {
        check(FREE, bounds).unwrap();
    }
}

/// All but the last one passed when A d = 0 was asked for at one point, x = d.
#[test]
fn a_plant_that_notices_where_it_stands_is_refused() {
    let bounds = Bounds {
        lower: Vector2::new(-20.0, -3.0),
        upper: Vector2::new(20.0, 3.0),
    };
    let carts = [
        // A wall beyond a position, a spring that speed stretches, and one in a corner of the box.
        Cart {
            pull: |position| if position > 15.0 { 100.0 } else { 0.0 },
            scheduling: |position, _| position,
        },
        Cart {
            pull: |speed| speed * speed,
            ..FREE
        },
        Cart {
            pull: |sum| if sum > 22.9 { 1.0 } else { 0.0 },
            scheduling: |position, speed| position + speed,
        },
        // A scheduling that moves along; A d = 0 wherever one looks.
        Cart {
            scheduling: |position, _| position,
            ..FREE
        },
        Cart {
            scheduling: |position, speed| speed + 1e-3 * position.sin(),
            ..FREE
        },
        Cart {
            pull: |_| f64::NAN,
            ..FREE
        },
    ];
    for (i, cart) in carts.into_iter().enumerate() {
        assert_eq!(check(cart, bounds), Err(GuaranteedError::Direction), "{i}");
    }
}
