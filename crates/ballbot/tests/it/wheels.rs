//! The torque map of eq. (6).

use ballbot::{BadWheels, Heading, PlaneTorques, Wheel, Wheels};
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
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
        let wheels = Wheels::of_paper(angle).expect("between 0 and pi/2");
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

/// Three wheels on a ball, in three dimensions: nothing of the torque map is used.
struct Contact {
    /// Contact points on the ball, m.
    points: [Vector3<f64>; 3],
    /// Unit vectors of the wheels' axles.
    axles: [Vector3<f64>; 3],
}

const BALL: f64 = 0.12;
const WHEEL: f64 = 0.05;

impl Contact {
    fn new(zenith: f64, wheels: &[Wheel<f64>; 3]) -> Self {
        // The wheel at azimuth zero, in the plane y = 0, turned about the vertical.
        let standing = |wheel: &Wheel<f64>, at_zero: Vector3<f64>| {
            Rotation3::from_axis_angle(&Vector3::z_axis(), wheel.azimuth) * at_zero
        };
        let point = Vector3::new(zenith.sin(), 0.0, zenith.cos()) * BALL;
        // Square to the line from the ball's centre. A right-handed turn about it takes the wheel's
        // rim, at the contact point, along -y; a ball turned counter-clockwise moves along +y
        // there and takes the wheel with it.
        let axle = Vector3::new(zenith.cos(), 0.0, -zenith.sin());
        Self {
            points: wheels.each_ref().map(|wheel| standing(wheel, point)),
            axles: wheels.each_ref().map(|wheel| {
                let sense = if wheel.reversed { -1.0 } else { 1.0 };
                standing(wheel, axle) * sense
            }),
        }
    }

    /// The wheels' rates when the ball turns with the angular velocity `ball` against the body.
    fn rates(&self, ball: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|i, _| {
            let (point, axle) = (self.points[i], self.axles[i]);
            let surface = ball.cross(&point);
            // From the wheel's centre, which lies outside the ball, to the contact point.
            let arm = -point.normalize() * WHEEL;
            // The rollers let go along the axle; across it there is no slip.
            let rolling = axle.cross(&arm);
            surface.dot(&rolling) / rolling.norm_squared()
        })
    }

    /// The torque on the ball under the motors' torques: forces at the contact points.
    fn torque(&self, motors: &Vector3<f64>) -> Vector3<f64> {
        let turned = (0..3).map(|i| {
            let (point, axle) = (self.points[i], self.axles[i]);
            let along = axle.cross(&-point.normalize()).normalize();
            point.cross(&(along * motors[i] / WHEEL))
        });
        turned.sum()
    }
}

/// The angular velocity of a ball on the floor whose centre moves with this velocity.
fn rolling(velocity: Vector2<f64>) -> Vector3<f64> {
    // The point at the floor stands still: v + omega x (-r e_z) = 0.
    Vector3::z().cross(&velocity.push(0.0)) / BALL
}

fn any_wheels(random: &mut fastrand::Rng) -> (f64, [Wheel<f64>; 3]) {
    let first = 2.0 * PI * random.f64();
    let gaps = [1.2 + 1.2 * random.f64(), 1.2 + 1.2 * random.f64()];
    let mut azimuths = [first, first + gaps[0], first + gaps[0] + gaps[1]];
    random.shuffle(&mut azimuths);
    let wheels = azimuths.map(|azimuth| Wheel {
        azimuth: azimuth - 2.0 * PI * f64::from(random.u8(0..3)),
        reversed: random.bool(),
    });
    (0.3 + 0.9 * random.f64(), wheels)
}

/// The planes of notation.md: in the x plane the ball's torque (r_b / r_w) tau_x makes it roll
/// along x, in the y plane along y; yaw turns it counter-clockwise.
#[test]
fn any_wheels_do_what_contact_in_three_dimensions_says() {
    let mut random = fastrand::Rng::with_seed(11);
    for _ in 0..2000 {
        let (zenith, arranged) = any_wheels(&mut random);
        let wheels = Wheels::new(zenith, arranged).expect("apart");
        let contact = Contact::new(zenith, &arranged);
        let gear = BALL / WHEEL;
        let planes = Vector3::new(random.f64(), random.f64(), random.f64()) * 2.0;
        let on_ball = contact.torque(&wheels.motors(&planes));
        let expected = Vector3::new(-planes.y, planes.x, planes.z) * gear;
        assert!(
            (on_ball - expected).norm() < 1e-12,
            "{on_ball} for {expected}"
        );

        // Rolling with phi_dot = (v_x, v_y) / r_b, and turning.
        let (velocity, yaw) = (Vector2::new(random.f64(), -random.f64()), random.f64());
        let ball = rolling(velocity) + Vector3::z() * yaw;
        let m = contact.rates(&ball);
        let turned = Vector3::new(velocity.x / BALL, velocity.y / BALL, yaw);
        assert!((wheels.motor_angles(gear) * turned - m).norm() < 1e-11);
        let psi = wheels.matrix().transpose() * m;
        assert!((psi / gear - turned).norm() < 1e-11, "{psi}");
        for (found, wheel) in wheels.arrangement().iter().zip(&arranged) {
            assert!(((found.azimuth - wheel.azimuth) / 2.0).sin().abs() < 1e-12);
            assert_eq!(found.reversed, wheel.reversed);
        }
    }
}

/// Wheel 1 was said to stand on the x axis. On a robot where it does, a ball that rolls along +x
/// shows (0, -1) in the planes of eq. (6), and the robot fell.
#[test]
fn the_papers_first_wheel_stands_at_minus_90_degrees() {
    let at = |degrees: [f64; 3]| {
        degrees.map(|azimuth| Wheel {
            azimuth: azimuth.to_radians(),
            reversed: false,
        })
    };
    let psi = |degrees: [f64; 3]| {
        let contact = Contact::new(PI / 4.0, &at(degrees));
        let m = contact.rates(&rolling(Vector2::x() * BALL));
        (Wheels::<f64>::paper().matrix().transpose() * m).xy() * WHEEL / BALL
    };
    assert!((psi([0.0, 120.0, 240.0]) - Vector2::new(0.0, -1.0)).norm() < 1e-14);
    let of_paper = [-90.0, 30.0, 150.0];
    assert!((psi(of_paper) - Vector2::new(1.0, 0.0)).norm() < 1e-14);
    let any = Wheels::new(PI / 4.0, at(of_paper)).expect("apart");
    assert!((any.matrix() - Wheels::paper().matrix()).amax() < 1e-15);
    for (found, expected) in Wheels::<f64>::paper().arrangement().iter().zip(of_paper) {
        assert!((found.azimuth.to_degrees() - expected).abs() < 1e-12);
    }
}

#[test]
fn wheels_at_one_place_are_refused() {
    let wheels = |azimuths: [f64; 3]| {
        Wheels::new(
            0.8,
            azimuths.map(|azimuth| Wheel {
                azimuth,
                reversed: false,
            }),
        )
    };
    for azimuths in [
        [0.0, 0.0, 2.0],
        [0.0, 2.0 * PI, 3.0],
        [1.0, 1.01, 3.0],
        [f64::NAN, 1.0, 2.0],
        [0.0, f64::INFINITY, 2.0],
    ] {
        let error = wheels(azimuths).expect_err("refused");
        assert!(matches!(error, BadWheels::Azimuths(_)), "{error}");
        assert!(
            error.to_string().contains("apart from each other"),
            "{error}"
        );
    }
    assert!(wheels([0.0, 1.0, 2.0]).is_ok());
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
        let error = Wheels::of_paper(angle).expect_err("refused");
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
        let wheels = Wheels::of_paper(zenith_angle).expect("within the open interval");
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
        let wheels = Wheels::of_paper(zenith_angle).expect("within the open interval");
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

/// A limit that is no number left everything, and a plan that is none needed nothing.
#[test]
fn what_is_no_number_leaves_nothing() {
    let wheels = Wheels::<f64>::paper();
    for (motor, yaw) in [(f64::NAN, 0.0), (1.0, f64::NAN)] {
        assert_eq!(wheels.plane_torques(motor, yaw).alone(), 0.0);
    }
    for plan in [[f64::NAN, 0.1], [0.1, f64::NAN]] {
        assert_eq!(PlaneTorques::need(plan, 1.0), f64::INFINITY);
    }
    assert_eq!(PlaneTorques::need([-0.2, 0.1], 1.0), 0.2);
}
