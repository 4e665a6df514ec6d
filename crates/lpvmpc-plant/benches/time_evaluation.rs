//! How long a cart-pole from a file takes beside one that is written in Rust.
//!
//! ```text
//! cargo bench -p lpvmpc-plant --bench time_evaluation
//! ```

use lpvmpc::{AlongMotion, Dynamics, LpvModel, Number, Tangent};
use lpvmpc_plant::{Plant, PlantError, SizedPlant};
use nalgebra::{Matrix4, Vector1, Vector4};
use std::hint::black_box;
use std::time::Instant;

/// The plant of testdata/plants/cart-pole.json in Rust.
struct CartPole {
    cart: f64,
    pole: f64,
    half: f64,
    friction: f64,
    gravity: f64,
}

impl Dynamics<4, 1> for CartPole {
    fn f<N: Number>(&self, x: &Vector4<N>, u: &Vector1<N>) -> Vector4<N> {
        let number = N::constant;
        let (pole, half) = (number(self.pole), number(self.half));
        let total = number(self.cart + self.pole);
        let gravity = number(self.gravity);
        let four_thirds = number(4.0 / 3.0);
        let (sin, cos) = x[1].sin_cos();
        let force = u[0] - number(self.friction) * x[2] + pole * half * x[3] * x[3] * sin;
        let d = four_thirds * total - pole * cos * cos;
        Vector4::new(
            x[2],
            x[3],
            (four_thirds * force - pole * gravity * sin * cos) / d,
            (total * gravity * sin - cos * force) / (half * d),
        )
    }
}

impl CartPole {
    /// f and its derivatives by hand.
    fn tangent(&self, x: &Vector4<f64>, u: &Vector1<f64>) -> Tangent<f64, 4, 1> {
        let Self {
            cart,
            pole,
            half,
            friction,
            gravity,
        } = *self;
        let (sin, cos) = Number::sin_cos(x[1]);
        let total = cart + pole;
        let swing = pole * half * x[3];
        let force = u[0] - friction * x[2] + swing * x[3] * sin;
        let over_d = 1.0 / (4.0 / 3.0 * total - pole * cos * cos);
        let over_half = over_d / half;
        // By the tilt.
        let d_slope = 2.0 * pole * cos * sin;
        let force_slope = swing * x[3] * cos;
        let speed = (4.0 / 3.0 * force - pole * gravity * sin * cos) * over_d;
        let rate = (total * gravity * sin - cos * force) * over_half;
        let speed_slope =
            (4.0 / 3.0 * force_slope - pole * gravity * (cos * cos - sin * sin) - speed * d_slope)
                * over_d;
        let rate_slope =
            (total * gravity * cos + sin * force - cos * force_slope - rate * half * d_slope)
                * over_half;
        let by_force = [4.0 / 3.0 * over_d, -cos * over_half];
        let by_rate = 2.0 * swing * sin;
        #[rustfmt::skip]
        let a = Matrix4::new(
            0.0, 0.0, 1.0, 0.0,
            0.0, 0.0, 0.0, 1.0,
            0.0, speed_slope, -friction * by_force[0], by_rate * by_force[0],
            0.0, rate_slope, -friction * by_force[1], by_rate * by_force[1],
        );
        let b = Vector4::new(0.0, 0.0, by_force[0], by_force[1]);
        (Vector4::new(x[2], x[3], speed, rate), a, b)
    }
}

/// The least of several averages of one call, in ns.
fn time(mut call: impl FnMut()) -> f64 {
    const CALLS: u32 = 20_000;
    let average = |_| {
        let start = Instant::now();
        (0..CALLS).for_each(|_| call());
        start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS)
    };
    (0..20).map(average).fold(f64::INFINITY, f64::min)
}

fn main() -> Result<(), PlantError> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/plants");
    let plant = Plant::load(format!("{root}/cart-pole.json"))?;
    let from_file = AlongMotion::<_, 5>(SizedPlant::<4, 1>::new(plant)?);
    let in_rust = AlongMotion::<_, 5>(CartPole {
        cart: 1.0,
        pole: 0.3,
        half: 0.5,
        friction: 0.1,
        gravity: 9.81,
    });
    let (x, u) = (Vector4::new(0.1, 0.4, -0.3, 1.2), Vector1::new(2.0));
    let (f, a, b) = in_rust.0.tangent(&x, &u);
    for (other_f, other_a, other_b) in [in_rust.tangent(&x, &u), from_file.tangent(&x, &u)] {
        let error = (other_f - f)
            .amax()
            .max((other_a - a).amax())
            .max((other_b - b).amax());
        assert!(error < 1e-13, "they differ by {error:e}");
    }
    println!("ns for one call       f   f, df/dx and df/du");
    let row = |name: &str, f: f64, tangent: f64| println!("{name:15} {f:7.0} {tangent:20.0}");
    row(
        "from a file",
        time(|| {
            black_box(from_file.derivative(black_box(&x), black_box(&u)));
        }),
        time(|| {
            black_box(from_file.tangent(black_box(&x), black_box(&u)));
        }),
    );
    row(
        "in Rust",
        time(|| {
            black_box(in_rust.derivative(black_box(&x), black_box(&u)));
        }),
        time(|| {
            black_box(in_rust.tangent(black_box(&x), black_box(&u)));
        }),
    );
    let by_hand = time(|| {
        black_box(in_rust.0.tangent(black_box(&x), black_box(&u)));
    });
    println!("by hand {by_hand:36.0}");
    Ok(())
}
