//! Enclosures must contain what they enclose.

use lpvmpc::{LpvModel, Rk4};
use lpvmpc_design::{Affine, AnalyticModel, Arithmetic, Frame, Interval, SampledLaw};
use nalgebra::{Matrix1x2, Matrix2, Vector1, Vector2};
use proptest::prelude::*;

use crate::pendulum::Pendulum;

/// A formula with every operation, on any arithmetic.
fn formula<T: Arithmetic>(x: T, y: T) -> T {
    let two = T::constant(2.0);
    (x.sin() * y - y.cos() * x.sinc()) / (two + x * x) - (x * y).sinc() / (two + y.cos())
}

/// Plain numbers, to compare with.
fn truth(x: f64, y: f64) -> f64 {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
    (x.sin() * y - y.cos() * sinc(x)) / (2.0 + x * x) - sinc(x * y) / (2.0 + y.cos())
}

/// What rounding may make of [`truth`].
const ROUNDING: f64 = 1e-14;

proptest! {
    #[test]
    fn intervals_and_affine_forms_contain_the_values(
        x in -2.0..2.0_f64, y in -2.0..2.0_f64,
        dx in 0.0..0.5_f64, dy in 0.0..0.5_f64,
        zx in -1.0..1.0_f64, zy in -1.0..1.0_f64,
    ) {
        let exact = truth(x + zx * dx, y + zy * dy);
        let range = formula(Interval::around(x, dx), Interval::around(y, dy));
        prop_assert!(range.lower <= exact + ROUNDING && exact - ROUNDING <= range.upper);
        let form = formula(Affine::<2>::symbol(x, dx, 0), Affine::symbol(y, dy, 1));
        let value = form.middle + form.slopes[0] * zx + form.slopes[1] * zy;
        prop_assert!((value - exact).abs() <= form.error + ROUNDING, "{form:?} for {exact}");
    }

    #[test]
    fn points_stay_points(x in -2.0..2.0_f64, y in -2.0..2.0_f64) {
        let range = formula(Interval::point(x), Interval::point(y));
        // Two hundred roundings, of terms of sinc's series that sum up to cosh(4).
        prop_assert!(range.upper - range.lower < 200.0 * f64::EPSILON * 4.0_f64.cosh());
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
        let sample = law.enclose(&Pendulum, &frame, &centre, &half_widths).unwrap();
        let x = centre + Vector2::new(z[0], z[1]) * half_width;
        let end = Rk4 { substeps: 400 }.advance(&Pendulum, &x, &Vector1::from(-k * x), 0.05);
        let g = Matrix2::from(sample.transition.middle
            + sample.transition.slopes[0] * z[0] + sample.transition.slopes[1] * z[1]);
        let error = (g * x - end).norm();
        prop_assert!(error <= sample.transition.error * x.norm() + 1e-11, "{error:e}");
        for i in 0..2 {
            prop_assert!(sample.states[i].lower <= end[i] && end[i] <= sample.states[i].upper);
        }
    }
}

#[test]
fn errors_of_affine_forms_shrink_with_the_square_of_the_box() {
    let error = |width: f64| {
        formula(
            Affine::<2>::symbol(0.7, width, 0),
            Affine::symbol(-0.4, width, 1),
        )
        .error
    };
    let order = (error(1e-1) / error(1e-3)).log10() / 2.0;
    assert!((order - 2.0).abs() < 0.15, "order {order}");
}

#[test]
fn what_may_be_divided_by_zero_is_unknown() {
    let range = Interval::point(1.0) / Interval::new(-1.0, 1.0);
    assert_eq!(range, Interval::EVERYTHING);
    let form = Affine::<1>::constant(1.0) / Affine::symbol(0.0, 1.0, 0);
    assert_eq!(form.error, f64::INFINITY);
}

#[test]
fn both_forms_of_the_pendulum_agree() {
    let (a, b) = LpvModel::matrices(&Pendulum, &Vector1::new(0.3));
    let (rows, input) = AnalyticModel::matrices(&Pendulum, &[Interval::point(0.3)]);
    for i in 0..2 {
        for j in 0..2 {
            assert!((rows[i][j].middle() - a[(i, j)]).abs() < 1e-14);
        }
        assert_eq!(input[i][0].middle(), b[i]);
    }
}
