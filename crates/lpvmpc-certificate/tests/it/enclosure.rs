//! Enclosures must contain what they enclose.

use lpvmpc::{Bivariate, Elementary, Embedding, Number, Rk4};
use lpvmpc_certificate::{Ball, FlowError, Frame, Interval, SampledLaw, TaylorMap, TaylorModel};
use nalgebra::{Matrix1x2, Matrix2, Vector1, Vector2};
use proptest::prelude::*;

use crate::pendulum::Pendulum;

/// A formula with every operation and function, on any kind of number.
fn formula<N: Number>(x: N, y: N) -> N {
    let two = N::constant(2.0);
    let waves =
        (x.sin() * y - y.cos() * x.sinc()) / (two + x * x) - (x * y).sinc() / (two + y.cos());
    let others = (two + x * x).ln() * x.sin().exp() - (two + y * y).sqrt() * (x * y).atan();
    waves + others + (x - y).tanh()
}

/// Plain numbers by the standard library, to compare with.
fn truth(x: f64, y: f64) -> f64 {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
    let waves = (x.sin() * y - y.cos() * sinc(x)) / (2.0 + x * x) - sinc(x * y) / (2.0 + y.cos());
    let others = (2.0 + x * x).ln() * x.sin().exp() - (2.0 + y * y).sqrt() * (x * y).atan();
    waves + others + (x - y).tanh()
}

/// A formula with what [`formula`] has not: inverse and hyperbolic functions, powers, an angle.
fn further<N: Number>(x: N, y: N) -> N {
    let number = N::constant;
    let of = |x: N, function| x.elementary(function);
    let small = x.tanh() / number(1.1);
    let inverses = of(small, Elementary::Asin) - of(small * y.cos(), Elementary::Acos)
        + of(small, Elementary::Atanh) * y
        + of(x * y, Elementary::Asinh)
        - of(number(1.5) + y * y, Elementary::Acosh);
    let waves = of(x, Elementary::Sinh) - of(y, Elementary::Cosh)
        + of(small, Elementary::ExpM1) * of(y * y, Elementary::Ln1p);
    let powers = (number(2.0) + x * x).powf(y) + x.powi(3) - (number(2.0) + y * y).powi(-2);
    let angles = x.atan2(number(2.5) + y) + (number(2.5) + y).atan2(x) - (x - number(2.5)).atan2(y);
    inverses + waves + powers + angles
}

/// Plain numbers by the standard library, to compare with.
fn further_truth(x: f64, y: f64) -> f64 {
    let small = x.tanh() / 1.1;
    let inverses = small.asin() - (small * y.cos()).acos() + small.atanh() * y + (x * y).asinh()
        - (1.5 + y * y).acosh();
    let waves = x.sinh() - y.cosh() + small.exp_m1() * (y * y).ln_1p();
    let powers = (2.0 + x * x).powf(y) + x.powi(3) - (2.0 + y * y).powi(-2);
    let angles = x.atan2(2.5 + y) + (2.5 + y).atan2(x) - (x - 2.5).atan2(y);
    inverses + waves + powers + angles
}

/// The polynomial of a Taylor model at z.
fn at(model: &TaylorModel<2>, z: [f64; 2]) -> f64 {
    let squares = model.squares();
    model.middle
        + model.slopes()[0] * z[0]
        + model.slopes()[1] * z[1]
        + squares[0][0] * z[0] * z[0]
        + squares[0][1] * z[0] * z[1]
        + squares[1][1] * z[1] * z[1]
}

fn map_at(map: &TaylorMap<2, 2, 2>, z: [f64; 2]) -> Matrix2<f64> {
    let entries = map.entries();
    Matrix2::from_fn(|i, j| at(&entries[i][j], z))
}

/// What rounding may make of [`truth`].
const ROUNDING: f64 = 1e-14;

proptest! {
    #[test]
    fn intervals_and_taylor_models_contain_the_values(
        x in -2.0..2.0_f64, y in -2.0..2.0_f64,
        dx in 0.0..0.5_f64, dy in 0.0..0.5_f64,
        zx in -1.0..1.0_f64, zy in -1.0..1.0_f64,
    ) {
        let exact = truth(x + zx * dx, y + zy * dy);
        let range = formula(Interval::around(x, dx), Interval::around(y, dy));
        prop_assert!(range.lower <= exact + ROUNDING && exact - ROUNDING <= range.upper);
        let form = formula(TaylorModel::<2>::symbol(x, dx, 0), TaylorModel::symbol(y, dy, 1));
        let value = at(&form, [zx, zy]);
        prop_assert!((value - exact).abs() <= form.error + ROUNDING, "{form:?} for {exact}");
        let range = form.range();
        prop_assert!(range.lower <= exact + ROUNDING && exact - ROUNDING <= range.upper);
    }

    #[test]
    fn further_functions_are_enclosed(
        x in -1.9..1.9_f64, y in -1.9..1.9_f64,
        dx in 0.0..0.5_f64, dy in 0.0..0.5_f64,
        zx in -1.0..1.0_f64, zy in -1.0..1.0_f64,
    ) {
        let exact = further_truth(x + zx * dx, y + zy * dy);
        let rounding = 1e-12;
        let range = further(Interval::around(x, dx), Interval::around(y, dy));
        prop_assert!(range.lower <= exact + rounding && exact - rounding <= range.upper);
        let form = further(TaylorModel::<2>::symbol(x, dx, 0), TaylorModel::symbol(y, dy, 1));
        let value = at(&form, [zx, zy]);
        prop_assert!((value - exact).abs() <= form.error + rounding, "{form:?} for {exact}");
        // They converge: a point stays next to one, a small box has a small error.
        let range = further(Interval::point(x), Interval::point(y));
        prop_assert!(range.upper - range.lower < 1e-11, "{range:?}");
        let half_width = 1e-3;
        let form = further(
            TaylorModel::<2>::symbol(x, half_width, 0),
            TaylorModel::symbol(y, half_width, 1),
        );
        prop_assert!(form.error < 2e-5, "{form:?}");
    }

    #[test]
    fn points_stay_points(x in -2.0..2.0_f64, y in -2.0..2.0_f64) {
        let range = formula(Interval::point(x), Interval::point(y));
        // Five series of up to forty terms, with two roundings each, of terms that sum up to cosh(4).
        prop_assert!(range.upper - range.lower < 400.0 * f64::EPSILON * 4.0_f64.cosh());
    }

    #[test]
    fn products_of_maps_contain_the_products(
        entries in prop::collection::vec(-1.0..1.0_f64, 48),
        errors in prop::array::uniform2(0.0..0.1_f64),
        z in prop::array::uniform2(-1.0..1.0_f64),
        turn in prop::array::uniform2(-1.0..1.0_f64),
    ) {
        let map = |first: usize, error: f64| {
            let matrix = |k: usize| Matrix2::from_column_slice(&entries[first + 4 * k..][..4]);
            TaylorMap::<2, 2, 2> {
                middle: matrix(0),
                slopes: [matrix(1), matrix(2)],
                squares: [[matrix(3), matrix(4)], [Matrix2::zeros(), matrix(5)]],
                error,
            }
        };
        let maps = [map(0, errors[0]), map(24, errors[1])];
        // A matrix that the map stands for: an error of the full size, in some direction.
        let members = [0, 1].map(|i| {
            let rotation = nalgebra::Rotation2::new(3.0 * turn[i]).into_inner();
            map_at(&maps[i], z) + rotation * errors[i]
        });
        let product = maps[0].times(&maps[1]);
        let miss = (members[0] * members[1] - map_at(&product, z)).singular_values().max();
        prop_assert!(miss <= product.error, "{miss:e} > {:e}", product.error);
        let sum = maps[0].plus(&maps[1]);
        let miss = (members[0] + members[1] - map_at(&sum, z)).singular_values().max();
        prop_assert!(miss <= sum.error * (1.0 + 1e-12) + 1e-14);
        let affine = product.affine();
        let miss = (members[0] * members[1] - map_at(&affine, z)).singular_values().max();
        prop_assert!(miss <= affine.error);
    }

    #[test]
    fn a_sampled_pendulum_stays_in_its_enclosure(
        centre in prop::array::uniform2(-0.5..0.5_f64),
        z in prop::array::uniform2(-1.0..1.0_f64),
        half_width in 0.0..0.05_f64,
    ) {
        let k = Matrix1x2::new(20.0, 5.0);
        let one = [[Interval::point(1.0), Interval::point(0.0)], [Interval::point(0.0), Interval::point(1.0)]];
        let frame = Frame { t: one, inverse: one };
        let law = SampledLaw { k, t_s: 0.05, halvings: 3 };
        let half_widths = Vector2::repeat(half_width);
        let centre = Vector2::from(centre);
        let sample = law.enclose(&Pendulum, &frame, &centre, &half_widths, Ball::EVERYWHERE).unwrap();
        let x = centre + Vector2::new(z[0], z[1]) * half_width;
        let end = Rk4 { substeps: 400 }.advance(&Pendulum, &x, &Vector1::from(-k * x), 0.05);
        let g = Matrix2::from(sample.transition.middle
            + sample.transition.slopes[0] * z[0] + sample.transition.slopes[1] * z[1]);
        let error = (g * x - end).norm();
        let allowed = (sample.error_square * x).dot(&x).sqrt();
        prop_assert!(error <= allowed + 1e-11, "{error:e} > {allowed:e}");
        for i in 0..2 {
            prop_assert!(sample.states[i].lower <= end[i] && end[i] <= sample.states[i].upper);
        }
    }

    #[test]
    fn motions_that_begin_in_a_ball_stay_where_those_of_its_box_need_not(
        centre in prop::array::uniform2(-0.1..0.1_f64),
        half_width in 0.02..0.2_f64,
        radius in 0.15..0.2_f64,
        turn in 0.0..6.3_f64,
    ) {
        let one = [[Interval::point(1.0), Interval::point(0.4)], [Interval::point(0.0), Interval::point(2.0)]];
        let inverse = [[Interval::point(1.0), Interval::point(-0.2)], [Interval::point(0.0), Interval::point(0.5)]];
        let frame = Frame { t: one, inverse };
        let law = SampledLaw { k: Matrix1x2::new(20.0, 5.0), t_s: 0.05, halvings: 3 };
        let (centre, half_widths) = (Vector2::from(centre), Vector2::repeat(half_width));
        let enclose = |ball| law.enclose(&Pendulum, &frame, &centre, &half_widths, ball).unwrap().states;
        let (in_ball, in_box) = (enclose(Ball { radius }), enclose(Ball::EVERYWHERE));
        // The farthest point of the box in this direction that is in the ball.
        let direction = Vector2::new(turn.cos(), turn.sin());
        let inside = |share: f64| {
            let y = centre + direction * (share * half_width);
            (y.norm() <= radius && share * direction.amax() <= 1.0).then_some(y)
        };
        let y = (0..=150).rev().find_map(|i| inside(0.01 * f64::from(i)));
        prop_assume!(y.is_some());
        let x = Matrix2::new(1.0, 0.4, 0.0, 2.0) * y.unwrap();
        for part in 0..=8 {
            let t = 0.05 / 8.0 * f64::from(part);
            let during = Rk4 { substeps: 100 }.advance(&Pendulum, &x, &Vector1::from(-law.k * x), t.max(1e-9));
            for i in 0..2 {
                // What the Runge-Kutta steps and the first nanosecond are off.
                let slack = Interval::new(-1e-7, 1e-7);
                prop_assert!((in_ball[i] + slack).contains(Interval::point(during[i])), "{t}: {during} {in_ball:?}");
            }
        }
        for i in 0..2 {
            prop_assert!(in_box[i].contains(in_ball[i]));
        }
        // Of the box around the ball the corners are left out.
        let around = Vector2::repeat(radius);
        let whole = |ball| law.enclose(&Pendulum, &frame, &Vector2::zeros(), &around, ball).unwrap().states[0].upper;
        let (of_ball, of_box) = (whole(Ball { radius }), whole(Ball::EVERYWHERE));
        prop_assert!(of_ball < 0.95 * of_box);
    }
}

/// Of a kink the value is known, and the mean sign of two numbers as the slope between them.
#[test]
fn kinks_have_values_and_slopes() {
    let zero = Interval::point(0.0);
    for (x, y) in [
        (Interval::new(-0.3, 0.7), zero),
        (Interval::new(-0.3, 0.7), Interval::new(0.1, 0.2)),
        (Interval::new(-0.3, -0.1), Interval::new(0.1, 0.2)),
        (Interval::new(0.1, 0.2), Interval::new(-0.3, -0.1)),
        (Interval::new(0.0, 0.2), Interval::new(0.0, 0.1)),
        (Interval::new(-0.2, 0.0), Interval::new(-0.1, 0.0)),
        (Interval::new(-0.2, 0.1), Interval::new(-0.1, 0.3)),
    ] {
        let size = x.elementary(Elementary::Abs);
        let [mean, min, max] = [Bivariate::MeanSign, Bivariate::Min, Bivariate::Max]
            .map(|function| x.bivariate(y, function));
        assert!(mean.magnitude() <= 1.0 + 1e-12, "{mean:?}");
        for i in 0..=10 {
            for j in 0..=10 {
                let at = |side: Interval, part: i32| {
                    let part = f64::from(part) / 10.0;
                    side.lower * (1.0 - part) + side.upper * part
                };
                let (a, b) = (at(x, i), at(y, j));
                assert!(size.lower <= a.abs() && a.abs() <= size.upper);
                let slope = (a.abs() - b.abs()) / (a - b);
                if slope.is_finite() {
                    let rounding = 1e-15 / (a - b).abs();
                    let within = mean.lower - rounding <= slope && slope <= mean.upper + rounding;
                    assert!(within, "{slope} in {mean:?} at {a}, {b}");
                }
                assert!(min.lower <= a.min(b) && a.min(b) <= min.upper);
                assert!(max.lower <= a.max(b) && a.max(b) <= max.upper);
            }
        }
    }
    let one_sided = Interval::new(0.0, 2.0).bivariate(zero, Bivariate::MeanSign);
    assert_eq!(one_sided, Interval::point(1.0));
}

/// x_dot = 3 |x| + u: with its kink where the motion crosses zero.
struct Kinked;

impl Embedding<1, 1, 1> for Kinked {
    fn scheduling<N: Number>(&self, x: &Vector1<N>, _: &Vector1<N>) -> Vector1<N> {
        *x
    }

    fn matrices<N: Number>(&self, s: &Vector1<N>) -> (Vector1<N>, Vector1<N>) {
        let slope = s[0].bivariate(N::constant(0.0), Bivariate::MeanSign);
        (
            Vector1::new(N::constant(3.0) * slope),
            Vector1::new(N::constant(1.0)),
        )
    }
}

/// From (x, u) after t seconds, by the exponential on either side of zero.
fn kinked(x: f64, u: f64, t: f64) -> f64 {
    let rate = if x < 0.0 || (x == 0.0 && u < 0.0) {
        -3.0
    } else {
        3.0
    };
    let rest = -u / rate;
    let end = rest + (x - rest) * (rate * t).exp();
    if x * end >= 0.0 {
        return end;
    }
    let crossing = (-rest / (x - rest)).ln() / rate;
    kinked(0.0, u, t - crossing)
}

proptest! {
    /// Boxes on one side of the kink, across it, and from which motions cross it.
    #[test]
    fn a_motion_over_a_kink_stays_in_its_enclosure(
        centre in -0.2..0.2_f64,
        z in -1.0..1.0_f64,
        half_width in 0.0..0.05_f64,
        gain in 1.0..20.0_f64,
    ) {
        let one = [[Interval::point(1.0)]];
        let frame = Frame { t: one, inverse: one };
        let law = SampledLaw { k: Vector1::new(gain), t_s: 0.1, halvings: 3 };
        let sizes = (Vector1::new(centre), Vector1::new(half_width));
        let sample = law.enclose(&Kinked, &frame, &sizes.0, &sizes.1, Ball::EVERYWHERE).unwrap();
        let x = centre + z * half_width;
        let g = sample.transition.middle[0] + sample.transition.slopes[0][0] * z;
        let allowed = sample.error_square[0].sqrt() * x.abs();
        for part in [0.3, 0.7, 1.0] {
            let end = kinked(x, -gain * x, 0.1 * part);
            let states = sample.states[0];
            prop_assert!(states.lower <= end + 1e-12 && end - 1e-12 <= states.upper);
        }
        let end = kinked(x, -gain * x, 0.1);
        prop_assert!((g * x - end).abs() <= allowed + 1e-12);
        // The slope is known to 6 at most, for 0.1 s.
        prop_assert!(sample.error_square[0].sqrt() < 1.0);
    }
}

/// A pendulum whose motor is stronger the more it gives: B depends on the input; with or without wind. The same numbers
/// are a map, too.
struct Strong {
    wind: bool,
    period: Option<f64>,
}

impl Embedding<2, 1, 2> for Strong {
    fn period(&self) -> Option<f64> {
        self.period
    }

    fn scheduling<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        Vector2::new(x[0], u[0])
    }

    fn matrices<N: Number>(&self, s: &Vector2<N>) -> (Matrix2<N>, Vector2<N>) {
        let (zero, one) = (N::constant(0.0), N::constant(1.0));
        let gravity = N::constant(9.81) * s[0].sinc();
        let strength = one + N::constant(0.05) * s[1] * s[0].exp();
        (
            Matrix2::new(zero, one, gravity, zero),
            Vector2::new(zero, strength),
        )
    }

    fn offset<N: Number>(&self, _: &Vector2<N>) -> Option<Vector2<N>> {
        let wind = Vector2::new(N::constant(0.0), N::constant(0.1));
        self.wind.then_some(wind)
    }
}

fn strong_law() -> (SampledLaw<2, 1>, Frame<2>) {
    let (zero, one) = (Interval::point(0.0), Interval::point(1.0));
    let identity = [[one, zero], [zero, one]];
    let law = SampledLaw {
        k: Matrix1x2::new(15.0, 4.0),
        t_s: 0.05,
        halvings: 3,
    };
    let frame = Frame {
        t: identity,
        inverse: identity,
    };
    (law, frame)
}

fn sinhc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { x.sinh() / x }
}

/// One function at a time, so that the recursion of each one's coefficients is seen.
#[test]
fn every_function_is_enclosed_with_its_curvature() {
    for (function, truth, middle) in [
        (Elementary::Asin, f64::asin as fn(f64) -> f64, 0.4),
        (Elementary::Asin, f64::asin, -0.85),
        (Elementary::Acos, f64::acos, 0.6),
        (Elementary::Sinh, f64::sinh, -0.5),
        (Elementary::Cosh, f64::cosh, 0.1),
        (Elementary::Sinhc, sinhc, 0.005),
        (Elementary::Sinhc, sinhc, -0.7),
        (Elementary::Sinhc, sinhc, 3.0),
        (Elementary::Asinh, f64::asinh, -3.0),
        (Elementary::Asinh, f64::asinh, 0.7),
        (Elementary::Acosh, f64::acosh, 1.4),
        (Elementary::Atanh, f64::atanh, -0.7),
        (Elementary::ExpM1, f64::exp_m1, 0.01),
        (Elementary::Ln1p, f64::ln_1p, -0.3),
        (Elementary::Ln, f64::ln, 0.3),
        (Elementary::Atan, f64::atan, -0.6),
        (Elementary::Atan, f64::atan, 2.5),
        (Elementary::Tanh, f64::tanh, 0.4),
        (Elementary::Sqrt, f64::sqrt, 0.3),
    ] {
        for half_width in [0.1, 0.01, 0.0] {
            let form = TaylorModel::<1>::symbol(middle, half_width, 0).elementary(function);
            for i in -10..=10 {
                let z = 0.1 * f64::from(i);
                let exact = truth(middle + z * half_width);
                let value = form.middle + form.slopes()[0] * z + form.squares()[0][0] * z * z;
                assert!(
                    (value - exact).abs() <= form.error + 1e-15,
                    "{function:?} {form:?}"
                );
            }
            // Of third order: the largest third derivative, of arcsin, is 943.
            assert!(
                form.error < 200.0 * half_width.powi(3) + 1e-13,
                "{function:?}: {form:?}"
            );
        }
    }
}

#[test]
fn what_has_no_enclosure_is_everything() {
    let around = |middle: f64| Interval::around(middle, 0.5);
    for (function, middle) in [
        (Elementary::Sign, 3.0),
        (Elementary::Floor, 3.3),
        (Elementary::Asin, 0.6),
        (Elementary::Acos, -0.6),
        (Elementary::Atanh, 0.6),
        (Elementary::Acosh, 1.2),
        (Elementary::Ln1p, -0.6),
    ] {
        assert_eq!(
            around(middle).elementary(function),
            Interval::EVERYTHING,
            "{function:?}"
        );
        let form = TaylorModel::<1>::symbol(middle, 0.5, 0).elementary(function);
        assert_eq!(form.range(), Interval::EVERYTHING, "{function:?}");
    }
    for function in [
        Bivariate::Less,
        Bivariate::LessOrEqual,
        Bivariate::Equal,
        Bivariate::IfElseZero,
    ] {
        assert_eq!(
            around(3.0).bivariate(around(9.0), function),
            Interval::EVERYTHING
        );
    }
    // It jumps where x < 0 and y = 0.
    let jump = around(0.0).bivariate(around(-3.0), Bivariate::Atan2);
    assert_eq!(jump, Interval::EVERYTHING);
    // A bounded function of what may have no value may have none.
    for function in [
        Elementary::Sin,
        Elementary::Tanh,
        Elementary::Atan,
        Elementary::Sinc,
        Elementary::Sinhc,
    ] {
        let hole = around(0.0).elementary(Elementary::Ln);
        assert_eq!(
            hole.elementary(function),
            Interval::EVERYTHING,
            "{function:?}"
        );
    }
}

#[test]
fn a_scheduling_that_depends_on_the_input_is_enclosed() {
    let (law, frame) = strong_law();
    let centre = Vector2::new(0.2, -0.3);
    let half_widths = Vector2::repeat(0.05);
    for period in [None, Some(law.t_s)] {
        let wind = false;
        let plant = Strong { wind, period };
        let sample = law
            .enclose(&plant, &frame, &centre, &half_widths, Ball::EVERYWHERE)
            .unwrap();
        for i in -4..=4 {
            for j in -4..=4 {
                let z = Vector2::new(f64::from(i), f64::from(j)) / 4.0;
                let x = centre + z * 0.05;
                let u = Vector1::from(-law.k * x);
                let end = Rk4 { substeps: 400 }.advance(&plant, &x, &u, law.t_s);
                let [by_x, by_rate] = sample.transition.slopes;
                let g = sample.transition.middle + by_x * z[0] + by_rate * z[1];
                let error = (g * x - end).norm();
                let allowed = (sample.error_square * x).dot(&x).sqrt();
                assert!(error <= allowed + 1e-11, "{error:e} > {allowed:e}");
                // A map leads through nothing between its beginning and its end.
                let during = if period.is_none() { end } else { x };
                assert!((0..2).all(|k| sample.states[k].contains(Interval::point(during[k]))));
            }
        }
    }
}

#[test]
fn a_map_with_another_period_is_refused() {
    let (law, frame) = strong_law();
    let (wind, period) = (false, Some(0.1));
    let small = Vector2::repeat(0.01);
    let error = law.enclose(
        &Strong { wind, period },
        &frame,
        &Vector2::zeros(),
        &small,
        Ball::EVERYWHERE,
    );
    let expected = FlowError::Period {
        t_s: 0.05,
        period: 0.1,
    };
    assert_eq!(error.unwrap_err(), expected);
}

/// Motion with an affine term is not linear in x and u: the enclosure would leave the wind out.
#[test]
fn a_plant_with_an_affine_term_is_refused() {
    let (law, frame) = strong_law();
    let plant = Strong {
        wind: true,
        period: None,
    };
    let small = Vector2::repeat(0.01);
    let error = law.enclose(&plant, &frame, &Vector2::zeros(), &small, Ball::EVERYWHERE);
    assert_eq!(error.unwrap_err(), FlowError::AffineTerm);
}

#[test]
fn errors_of_taylor_models_shrink_with_the_third_power_of_the_box() {
    let error = |width: f64| {
        formula(
            TaylorModel::<2>::symbol(0.7, width, 0),
            TaylorModel::symbol(-0.4, width, 1),
        )
        .error
    };
    let order = (error(1e-1) / error(1e-3)).log10() / 2.0;
    assert!((order - 3.0).abs() < 0.15, "order {order}");
}

#[test]
fn what_may_be_divided_by_zero_is_unknown() {
    let range = Interval::point(1.0) / Interval::new(-1.0, 1.0);
    assert_eq!(range, Interval::EVERYTHING);
    let form = TaylorModel::<1>::constant(1.0) / TaylorModel::symbol(0.0, 1.0, 0);
    assert_eq!(form.error, f64::INFINITY);
}

#[test]
fn sets_of_numbers_have_the_matrices_of_numbers() {
    let (a, b) = Embedding::matrices(&Pendulum, &Vector1::new(0.3));
    let (rows, input) = Embedding::matrices(&Pendulum, &Vector1::new(Interval::point(0.3)));
    for i in 0..2 {
        for j in 0..2 {
            assert!((rows[(i, j)].middle() - a[(i, j)]).abs() < 1e-14);
        }
        assert_eq!(input[i].middle(), b[i]);
    }
}

/// The norm and the square of 1e-200 I were 0 with the error 0, and a finite error stood beside
/// coefficients that had overflowed.
#[test]
fn maps_of_tiny_and_huge_numbers_hold_what_is_true() {
    let map = |size: f64| TaylorMap::<2, 2, 2>::constant(Matrix2::identity() * size);
    for size in [
        5e-324, 1e-310, 1e-200, 1e-160, 1e-101, 1e-99, 1e99, 1e101, 1e160, 1e300,
    ] {
        let tried = map(size);
        assert!(tried.norm() >= size, "{size:e}: {:e}", tried.norm());
        let close = tried.norm() <= 1.02 * size + 1e-322;
        assert!(close, "{size:e}: {:e}", tried.norm());
        let square = tried.times(&tried);
        let expected = size * size;
        // 0 and infinity stand for what is beyond the numbers.
        let off = (square.middle[(0, 0)] - expected).abs();
        if expected == 0.0 {
            assert!(square.error > 0.0, "{size:e}");
        } else if expected.is_finite() {
            assert!(off <= square.error && square.error < 1e-12 * expected + 1e-300);
        } else {
            assert_eq!(square.error, f64::INFINITY, "{size:e}");
        }
    }
    // Overflow in the coefficients alone: 64 eps times the sizes is still a number.
    let product = map(1e170).times(&map(1e140));
    assert_eq!(product.error, f64::INFINITY);
    let sum = map(1.5e308).plus(&map(1.5e308));
    assert_eq!(sum.error, f64::INFINITY);
    let model = |value: f64| TaylorModel::<2>::constant(value);
    assert_eq!((model(1e170) * model(1e140)).error, f64::INFINITY);
    assert_eq!((model(1.5e308) + model(1.5e308)).error, f64::INFINITY);
    assert!((model(1e-200) * model(1e-200)).error > 0.0);
    let zero = map(0.0);
    assert_eq!((zero.norm(), zero.times(&map(1e300)).error), (0.0, 0.0));
    assert_eq!(map(f64::NAN).norm(), f64::INFINITY);
    let mut mixed = map(1e-200);
    mixed.squares[0][1] = Matrix2::identity() * 5e-324;
    assert!(mixed.affine().error >= 5e-324);
    assert!(mixed.norm() > 1e-200);
}
