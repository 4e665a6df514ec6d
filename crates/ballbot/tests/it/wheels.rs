//! The torque map of eq. (6).

use ballbot::{Heading, PlaneTorques, Wheels};
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

/// The largest motor torque over all headings.
fn worst_heading(wheels: &Wheels<f64>, planes: &Vector2<f64>, yaw: f64) -> f64 {
    let torques = (0..720).map(|step| {
        let heading = Heading::new(f64::from(step) * PI / 360.0);
        wheels.motors(&heading.to_robot(planes).push(yaw)).amax()
    });
    torques.fold(0.0, f64::max)
}

#[test]
fn what_is_left_for_the_planes_uses_a_motor_up_in_some_heading_and_no_more() {
    for zenith_angle in [0.5, 0.8, 1.2] {
        let wheels = Wheels::new(zenith_angle).expect("within the open interval");
        for yaw in [0.0, 0.3, -0.3] {
            let left = wheels.plane_torques(1.0, yaw);
            let both = left.equal();
            for planes in [
                Vector2::new(left.alone(), 0.0),
                Vector2::new(0.0, left.alone()),
                Vector2::new(both, both),
                Vector2::new(-both, both),
                Vector2::new(0.6, 0.8) * left.alone(),
            ] {
                let most = worst_heading(&wheels, &planes, yaw);
                // Between two of the headings it can be more by (pi/720)^2 / 2.
                assert!(most < 1.0 + 1e-12 && most > 1.0 - 1e-5, "{most}");
            }
        }
        let nothing = wheels.plane_torques(1.0, 10.0);
        assert_eq!((nothing.alone(), nothing.equal()), (0.0, 0.0));
        assert_eq!(nothing.first([0.3, 0.2]), (0, 0.0));
    }
}

#[test]
fn a_bound_for_each_plane_alone_lets_a_motor_be_asked_for_more_than_it_has() {
    let wheels = Wheels::<f64>::paper();
    let alone = wheels.plane_torques(1.0, 0.0).alone();
    // What each plane may have while the other one rests, in both at once.
    let most = worst_heading(&wheels, &Vector2::new(alone, alone), 0.0);
    assert!((most - SQRT_2).abs() < 1e-5, "{most}");
}

#[test]
fn whatever_the_planes_ask_for_no_motor_gets_more_than_its_limit() {
    let mut random = fastrand::Rng::with_seed(5);
    let mut between = |lower: f64, upper: f64| lower + (upper - lower) * random.f64();
    let mut contested = 0;
    for _ in 0..20_000 {
        let zenith_angle: f64 = between(0.2, 1.4);
        let wheels = Wheels::new(zenith_angle).expect("within the open interval");
        let limit: f64 = between(0.1, 3.0);
        let yaw = between(-0.5, 0.5) * limit;
        let left = wheels.plane_torques(limit, yaw);
        let needs: [f64; 2] = std::array::from_fn(|_| {
            let need = between(0.0, 3.0);
            if need < 2.0 {
                need * limit
            } else {
                f64::INFINITY
            }
        });
        // What the planes would like to have now, which their last plans did not know.
        let wishes: [f64; 2] = std::array::from_fn(|_| between(-3.0, 3.0) * limit);
        let (first, bound) = left.first(needs);
        let mut planes = Vector2::zeros();
        planes[first] = wishes[first].clamp(-bound, bound);
        let rest = left.rest(planes[first].abs());
        let second = 1 - first;
        planes[second] = wishes[second].clamp(-rest, rest);

        let heading = Heading::new(between(-PI, PI));
        let motors = wheels.motors(&heading.to_robot(&planes).push(yaw));
        assert!(
            motors.amax() <= limit * (1.0 + 1e-12),
            "{motors} of {limit}"
        );
        assert!(
            bound >= left.equal() * (1.0 - 1e-12),
            "{bound} for the first"
        );
        let kept = needs[second].min(left.equal());
        // The squares are taken off each other, so rounding is relative to the disc's.
        let rounding = 4.0 * f64::EPSILON * left.alone() * left.alone();
        assert!(
            rest * rest >= kept * kept - rounding,
            "{rest} for the second, {kept} kept"
        );
        contested += usize::from(planes.norm() > 0.999 * left.alone());
    }
    assert!(
        contested > 5_000,
        "the limit mattered in {contested} cases only"
    );
}

#[test]
fn a_plane_that_is_at_rest_leaves_everything_to_the_other() {
    let left = Wheels::<f64>::paper().plane_torques(1.0, 0.0);
    let most = left.alone();
    assert_eq!(left.first([f64::INFINITY, 0.0]), (0, most));
    assert_eq!(left.first([0.0, 0.1]), (1, most));
    // Both cut off: equal shares, in any order.
    let (_, bound) = left.first([f64::INFINITY; 2]);
    assert!((bound - left.equal()).abs() < 1e-15, "{bound}");
    assert!((left.rest(bound) - left.equal()).abs() < 1e-15);
}

#[test]
fn a_plan_that_reaches_its_bound_needs_more_than_it_shows() {
    assert_eq!(PlaneTorques::need([0.1, -0.4, 0.2], 0.5), 0.4);
    assert_eq!(PlaneTorques::need([0.1, -0.5, 0.2], 0.5), f64::INFINITY);
    assert_eq!(PlaneTorques::need([f64::NAN], 0.0), f64::INFINITY);
    // What is not a number takes nothing from the limit.
    let left = Wheels::<f64>::paper().plane_torques(1.0, 0.0);
    assert_eq!(left.rest(f64::NAN), 0.0);
    assert_eq!(left.rest(f64::INFINITY), 0.0);
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
