//! The torque map of eq. (6).

use ballbot::{Heading, Wheels};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

#[test]
fn at_45_degrees_it_is_the_papers_matrix() {
    // 1/cos(pi/4) = 1/sin(pi/4) = sqrt(2).
    let root_6 = 6_f64.sqrt();
    #[rustfmt::skip]
    let expected = Matrix3::new(
        2.0 * SQRT_2, 0.0,     SQRT_2,
        -SQRT_2,      root_6,  SQRT_2,
        -SQRT_2,      -root_6, SQRT_2,
    ) / 3.0;
    let found = Wheels::<f64>::paper().matrix();
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() <= 1e-15, "{found} for {expected}");
    }
}

#[test]
fn the_inverse_is_the_inverse_at_every_zenith_angle() {
    for step in 1..1000 {
        let angle = FRAC_PI_2 * f64::from(step) / 1000.0;
        let wheels = Wheels::new(angle).expect("between 0 and pi/2");
        for virtual_torques in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let motors = wheels.motors(&virtual_torques);
            assert_eq!(motors, wheels.matrix() * virtual_torques);
            let back = wheels.virtual_torques(&motors);
            assert!((back - virtual_torques).norm() <= 1e-14, "{angle}: {back}");
        }
        // The other way round, with one motor alone.
        let back = wheels.motors(&wheels.virtual_torques(&Vector3::y()));
        let condition = 1.0 / angle.sin().min(angle.cos());
        assert!(
            (back - Vector3::y()).norm() <= 1e-15 * condition,
            "{angle}: {back}"
        );
    }
}

#[test]
fn equal_motor_torques_are_yaw_alone() {
    let wheels = Wheels::<f64>::paper();
    let virtual_torques = wheels.virtual_torques(&Vector3::repeat(1.0));
    // 3 sin(alpha) times one motor's torque.
    let expected = Vector3::new(0.0, 0.0, 1.5 * SQRT_2);
    assert!((virtual_torques - expected).norm() < 1e-15);
}

#[test]
fn bad_zenith_angles_are_refused() {
    for angle in [
        0.0,
        -0.0,
        -0.7,
        FRAC_PI_2,
        PI,
        45.0,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
    ] {
        let error = Wheels::new(angle).expect_err("refused");
        let words = error.to_string();
        for part in [&format!("{angle} rad"), "between 0 and pi/2", "pi/4"] {
            assert!(words.contains(part), "`{part}` is not in: {words}");
        }
    }
}

#[test]
fn plane_limits_keep_every_motor_within_its_own_in_every_heading_and_use_one_up() {
    for zenith_angle in [0.5, 0.8, 1.2] {
        let wheels = Wheels::new(zenith_angle).expect("within the open interval");
        for yaw in [0.0, 0.3] {
            let limit = wheels.plane_limit(1.0, yaw);
            let mut most = 0.0_f64;
            for (corner, step) in (0..4).flat_map(|corner| (0..720).map(move |step| (corner, step)))
            {
                let sign = |bit: u32| if corner & (1 << bit) == 0 { 1.0 } else { -1.0 };
                let heading = Heading::new(f64::from(step) * PI / 360.0);
                let planes = heading.to_robot(&Vector2::new(limit, sign(0) * limit));
                let torques = Vector3::new(planes[0], planes[1], sign(1) * yaw);
                most = most.max(wheels.motors(&torques).amax());
            }
            assert!((most - 1.0).abs() < 1e-12, "{most} of the motors' limit");
        }
        assert!(wheels.plane_limit(1.0, 10.0) < 0.0, "nothing is left");
    }
}

#[test]
fn a_heading_turns_and_turns_back() {
    let heading = Heading::new(PI / 6.0);
    // The robot's x axis, seen from the floor.
    let ahead = heading.to_floor(&Vector2::x());
    assert!(
        (ahead - Vector2::new(0.75_f64.sqrt(), 0.5)).norm() < 1e-15,
        "{ahead}"
    );
    let pair = Vector2::new(0.3, -1.7);
    assert!((heading.to_robot(&heading.to_floor(&pair)) - pair).norm() < 1e-15);
}
