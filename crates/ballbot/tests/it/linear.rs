//! h(b), its Jacobian, and the linear model's poles.

use crate::robots;
use ballbot::{Ballbot, DriveFriction, Geometry, LinearParameters};
use fastrand::Rng;
use lpvmpc::LpvModel;
use nalgebra::{Matrix4, SMatrix, Vector3, Vector4, Vector6};

#[test]
fn h_is_the_embedding_upright() {
    let mut rng = Rng::with_seed(5);
    for robot in std::iter::once(Ballbot::paper())
        .chain((0..1000).map(|_| without_drive_friction(robots::rigid(&mut rng))))
    {
        let (a, b) = robot.linear_parameters().matrices();
        let (a_upright, b_upright) = robot.matrices(&Vector3::zeros());
        assert!((a - a_upright).norm() <= 1e-14 * a.norm(), "{a}{a_upright}");
        assert!((b - b_upright).norm() <= 1e-14 * b.norm(), "{b}{b_upright}");
    }
}

/// How much larger than d = b1 b3 - k^2 its terms are.
fn cancellation(robot: &Ballbot<f64>) -> f64 {
    let mass = robot.mass(0.0);
    let largest = (mass[(0, 0)] * mass[(1, 1)]).max(mass[(0, 1)].powi(2));
    largest / mass.determinant().abs()
}

/// The Jacobian by a five-point stencil, whose error is of order four. p has a pole where d = 0:
/// steps are a thousandth of the way there.
fn numerical_jacobian(robot: &Ballbot<f64>) -> SMatrix<f64, 6, 4> {
    let mut jacobian = SMatrix::<f64, 6, 4>::zeros();
    let mass = robot.mass(0.0);
    let sizes = [mass[(0, 0)], mass[(0, 1)], mass[(1, 1)], robot.b4];
    for (column, size) in sizes.into_iter().enumerate() {
        let step = 1e-3 * size / cancellation(robot);
        let at = |steps: f64| -> Vector6<f64> {
            let mut moved = *robot;
            let parameters = [&mut moved.b1, &mut moved.b2, &mut moved.b3, &mut moved.b4];
            *parameters[column] += steps * step;
            moved.linear_parameters().to_vector()
        };
        let difference = (at(1.0) - at(-1.0)) * 8.0 - (at(2.0) - at(-2.0));
        jacobian.set_column(column, &(difference / (12.0 * step)));
    }
    jacobian
}

#[test]
fn the_jacobian_is_the_derivative() {
    let mut rng = Rng::with_seed(6);
    for robot in std::iter::once(Ballbot::paper())
        .chain((0..1000).map(|_| without_drive_friction(robots::rigid(&mut rng))))
    {
        let found = robot.linear_parameters_jacobian();
        let expected = numerical_jacobian(&robot);
        // (1e-3)^4, and the rounding of d divided by the step.
        let accuracy = 1e-10 + 1e-12 * cancellation(&robot);
        for (found, expected) in found.column_iter().zip(expected.column_iter()) {
            assert!(
                (found - expected).norm() <= accuracy * expected.norm(),
                "{robot:?}: {found} for {expected}"
            );
        }
    }
}

fn residual(robot: &Ballbot<f64>, p: &LinearParameters<f64>) -> Vector6<f64> {
    p.to_vector() - robot.linear_parameters().to_vector()
}

/// The paper's structure has no friction in the drive.
fn without_drive_friction(robot: Ballbot<f64>) -> Ballbot<f64> {
    Ballbot {
        drive: DriveFriction::none(),
        ..robot
    }
}

/// One Gauss-Newton step of F(b) = p - h(b) -> 0 from `robot`, by the normal equations.
fn gauss_newton_step(robot: &Ballbot<f64>) -> Vector4<f64> {
    let jacobian = robot.linear_parameters_jacobian();
    let transposed = jacobian.transpose();
    let residual = residual(robot, &LinearParameters::paper());
    let normal = (transposed * jacobian).cholesky();
    let normal = normal.expect("the columns of the Jacobian are independent");
    normal.solve(&(transposed * residual))
}

/// b of the paper's least-squares problem, from the starting point b0 = (0.0025, 0.06, 0.14,
/// -0.07), and the number of steps there.
fn least_squares() -> (Ballbot<f64>, usize) {
    let mut robot = Ballbot {
        b1: 0.0025,
        b2: 0.06,
        b3: 0.14,
        b4: -0.07,
        drive: DriveFriction::none(),
        geometry: Geometry::paper(),
    };
    for steps in 0..20 {
        let step = gauss_newton_step(&robot);
        if step.norm() < 1e-10 {
            return (robot, steps);
        }
        robot.b1 += step[0];
        robot.b2 += step[1];
        robot.b3 += step[2];
        robot.b4 += step[3];
    }
    panic!("Gauss-Newton does not converge: {robot:?}");
}

#[test]
fn the_papers_b_fits_the_papers_p_with_p6_negative() {
    let robot = Ballbot::paper();
    let p = LinearParameters::<f64>::paper();
    let printed = LinearParameters { p6: -p.p6, ..p };
    let norm = residual(&robot, &p).norm();
    assert!((norm - 0.433_34).abs() < 5e-6, "{norm}");
    let norm = residual(&robot, &printed).norm();
    assert!((norm - 503.68).abs() < 5e-3, "{norm}");
}

#[test]
fn gauss_newton_with_this_jacobian_ends_at_the_least_squares_b() {
    let (robot, steps) = least_squares();
    assert!((4..=5).contains(&steps), "{steps} steps");
    for (found, expected, digits) in [
        (robot.b1, 0.002_483_22, 1e-8),
        (robot.b2, 0.059_325_7, 1e-7),
        (robot.b3, 0.143_093_25, 1e-8),
        (robot.b4, -0.074_360_78, 1e-8),
    ] {
        assert!((found - expected).abs() < digits, "{found} for {expected}");
    }
    let norm = residual(&robot, &LinearParameters::paper()).norm();
    assert!((norm - 0.432_969).abs() < 5e-7, "{norm}");
}

fn assert_poles(a: &Matrix4<f64>, expected: [f64; 4], digits: f64) {
    let mut poles: Vec<_> = a.complex_eigenvalues().iter().copied().collect();
    poles.sort_by(|one, other| one.re.total_cmp(&other.re));
    for (pole, expected) in poles.iter().zip(expected) {
        assert!(
            (pole.re - expected).abs() <= digits && pole.im.abs() <= 1e-12,
            "{pole} for {expected}"
        );
    }
}

#[test]
fn the_poles_of_both_linear_models() {
    let (a, _) = least_squares().0.linear_parameters().matrices();
    assert_poles(&a, [-51.8017, -5.1484, 0.0, 4.0497], 5e-5);
    let (a, _) = LinearParameters::paper().matrices();
    assert_poles(&a, [-51.7, -5.49, 0.0, 4.33], 5e-2);
}
