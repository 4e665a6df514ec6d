//! Derivatives of the accelerations against those of a second route: central differences of f.

use crate::robots;
use ballbot::{Ballbot, DriveFriction};
use fastrand::Rng;
use nalgebra::Vector4;

/// A change of the state or of a parameter, by its size.
type Move = fn(&mut Ballbot<f64>, &mut Vector4<f64>, &mut f64, f64);

const MOVES: [Move; 10] = [
    |_, x, _, by| x[1] += by,
    |_, x, _, by| x[2] += by,
    |_, x, _, by| x[3] += by,
    |_, _, torque, by| *torque += by,
    |robot, _, _, by| robot.b1 += by,
    |robot, _, _, by| robot.b2 += by,
    |robot, _, _, by| robot.b3 += by,
    |robot, _, _, by| robot.b4 += by,
    |robot, _, _, by| robot.drive.viscous += by,
    |robot, _, _, by| robot.drive.coulomb += by,
];

#[test]
fn every_derivative_is_that_of_differences() {
    let mut rng = Rng::with_seed(31);
    for trial in 0..200 {
        let mut robot = robots::rigid(&mut rng);
        robot.drive = DriveFriction {
            viscous: 0.03 * rng.f64(),
            // Some robots have no Coulomb friction: what it would do is asked of them, too.
            coulomb: if trial % 3 == 0 { 0.0 } else { 0.2 * rng.f64() },
        };
        let mut within = |size: f64| size * (2.0 * rng.f64() - 1.0);
        let x = Vector4::new(within(5.0), within(1.2), within(6.0), within(6.0));
        let torque = within(2.0);
        let found = robot.sensitivity(&x, torque);
        let f = robot.f(&x, torque);
        for i in 0..2 {
            assert!((found.accelerations[i] - f[2 + i]).abs() <= 1e-12 * (1.0 + f[2 + i].abs()));
        }
        let slopes = found.by_state.into_iter();
        let slopes = slopes.chain([found.by_torque]).chain(found.by_parameters);
        for (place, (slope, change)) in slopes.zip(MOVES).enumerate() {
            let by = 1e-7;
            let at = |by: f64| {
                let (mut robot, mut x, mut torque) = (robot, x, torque);
                change(&mut robot, &mut x, &mut torque, by);
                robot.f(&x, torque)
            };
            let difference = (at(by) - at(-by)) / (2.0 * by);
            for i in 0..2 {
                let (slope, difference) = (slope[i], difference[2 + i]);
                let size = 1.0 + difference.abs() + f[2 + i].abs();
                assert!(
                    (slope - difference).abs() <= 1e-5 * size,
                    "trial {trial}, {place}, {i}: {slope} for {difference}"
                );
            }
        }
    }
}
