//! Plants with inverse functions, logarithms and powers: friction, tyres, a heat exchanger.

use crate::claims::check;
use crate::plants::{p, signal};
use lpvmpc::{Bivariate, Dynamics, Elementary, Number};
use lpvmpc_certify::{CertifySettings, certify, verify};
use lpvmpc_plant::{Plant, PlantData};
use nalgebra::{Vector1, Vector2, Vector4};

/// A pendulum near upright whose friction saturates: angle (rad) and rate; the torque over the inertia (1/s^2).
struct RubbedPendulum;

impl Dynamics<2, 1> for RubbedPendulum {
    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let friction = number(2.0) * (number(5.0) * x[1]).atan();
        Vector2::new(x[1], number(9.81) * x[0].sin() - friction + u[0])
    }
}

/// The race car of the gallery (Liniger, Domahidi, Morari 2015) at a constant 1.5 m/s on a straight: distance from the line
/// (m), heading (rad), speed aside (m/s) and yaw rate (rad/s); the steering angle (rad). Tyres by Pacejka's formula.
struct Bicycle;

impl Dynamics<4, 1> for Bicycle {
    fn f<N: Number>(&self, x: &Vector4<N>, u: &Vector1<N>) -> Vector4<N> {
        let number = N::constant;
        let (mass, inertia) = (number(0.041), number(27.8e-6));
        let (ahead, to_front, to_rear) = (number(1.5), number(0.029), number(0.033));
        let tyre = |slip: N, (b, c, d): (f64, f64, f64)| {
            number(d) * (number(c) * (number(b) * slip).atan()).sin()
        };
        let slip = (x[2] + to_front * x[3]).atan2(ahead);
        let front = tyre(u[0] - slip, (2.579, 1.2, 0.192));
        let slip = (x[2] - to_rear * x[3]).atan2(ahead);
        let rear = tyre(-slip, (3.3852, 1.2691, 0.1737));
        let (sin, cos) = x[1].sin_cos();
        let straight = front * u[0].cos();
        Vector4::new(
            ahead * sin + x[2] * cos,
            x[3],
            (rear + straight) / mass - ahead * x[3],
            (straight * to_front - rear * to_rear) / inertia,
        )
    }
}

/// A tank (degrees Celsius) heated by a wall (degrees Celsius) of natural convection, cooled by water that enters with 15
/// and leaves with 30 degrees: the logarithmic mean of the differences counts. Time in minutes, the heat of the wall in kW.
struct HeatedTank;

impl Dynamics<2, 1> for HeatedTank {
    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let convected = number(0.6) * (x[1] - x[0]).powf(number(1.25));
        let (inlet, outlet) = (x[0] - number(15.0), x[0] - number(30.0));
        let cooled = number(1.2) * (inlet - outlet) / (inlet / outlet).ln();
        Vector2::new(
            (convected - cooled) / number(40.0),
            (number(60.0) * u[0] - convected) / number(5.0),
        )
    }
}

#[test]
fn a_pendulum_with_saturating_friction_is_certified() {
    let mut data = PlantData::of_dynamics("rubbed pendulum", &RubbedPendulum);
    data.inputs = vec![signal("torque", "1/s^2", Some((-8.0, 8.0)))];
    data.states = vec![
        signal("angle", "rad", None),
        signal("rate", "rad/s", Some((-0.6, 0.6))),
    ];
    let plant = Plant::new(data).unwrap();
    let settings = CertifySettings {
        trials: 0,
        ..CertifySettings::new(0.05, &[1.0, 1.0], &[0.1])
    };
    let certificate = certify(&plant, &settings, &|_| ()).unwrap();
    assert!(check::<2, 3>(&plant, &certificate) > 0.0);
    verify(&certificate, &plant, &|_| ()).unwrap();
    // To where friction has a fifth of its slope at rest.
    assert!(certificate.state_limits[1].unwrap() > 0.4);
}

/// A boat of 1 (kg) with the drag of its speed squared, and a fender: aside of the quay (m) and speed (m/s); the thrust (N).
/// The fender pushes beyond 0.2 m.
struct Boat;

impl Dynamics<2, 1> for Boat {
    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let drag = number(0.8) * x[1] * x[1].elementary(Elementary::Abs);
        let pressed = (x[0] - number(0.2)).bivariate(number(0.0), Bivariate::Max);
        Vector2::new(x[1], u[0] - drag - number(3.0) * pressed)
    }
}

/// Dry friction's jump is smoothed by a straight piece: a kink at either end.
struct Slide;

impl Dynamics<2, 1> for Slide {
    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let grip = number(2.0) * x[1];
        let grip = grip.bivariate(number(0.5), Bivariate::Min);
        let grip = grip.bivariate(number(-0.5), Bivariate::Max);
        Vector2::new(x[1], u[0] - grip)
    }
}

/// Kinks at rest and away from it: where motions cross them the decrease is proved all the same.
#[test]
fn plants_with_kinks_are_certified() {
    let bounded = |data: PlantData, reach: f64| {
        Plant::new(PlantData {
            states: vec![
                signal("aside", "m", Some((-reach, reach))),
                signal("speed", "m/s", None),
            ],
            inputs: vec![signal("thrust", "N", Some((-4.0, 4.0)))],
            ..data
        })
        .unwrap()
    };
    let boat = bounded(PlantData::of_dynamics("boat", &Boat), 0.5);
    let slide = bounded(PlantData::of_dynamics("slide", &Slide), 0.5);
    for plant in [boat, slide] {
        let settings = CertifySettings {
            trials: 2,
            ..CertifySettings::new(0.1, &[4.0, 1.0], &[0.5])
        };
        let certificate = certify(&plant, &settings, &|_| ()).unwrap();
        assert!(check::<2, 3>(&plant, &certificate) > 0.0);
        verify(&certificate, &plant, &|_| ()).unwrap();
        // Beyond the kinks.
        assert!(certificate.state_limits[0].unwrap() > 0.3);
        assert!(certificate.state_limits[1].unwrap() > 1.0);
    }
}

#[test]
fn a_bicycle_with_pacejkas_tyres_is_certified() {
    let bound = |size: f64| Some((-size, size));
    let data = PlantData {
        states: vec![
            signal("aside", "m", bound(0.15)),
            signal("heading", "rad", bound(0.15)),
            signal("slipping", "m/s", bound(0.15)),
            signal("yaw rate", "rad/s", bound(2.0)),
        ],
        inputs: vec![signal("steering", "rad", bound(0.35))],
        ..PlantData::of_dynamics("bicycle", &Bicycle)
    };
    let plant = Plant::new(data).unwrap();
    let settings = CertifySettings {
        trials: 0,
        ..CertifySettings::new(0.02, &[100.0, 1.0, 0.01, 0.01], &[1.0])
    };
    let certificate = certify(&plant, &settings, &|_| ()).unwrap();
    assert!(check::<4, 5>(&plant, &certificate) > 0.0);
    // Slip angles to where the tyres' curve is bent.
    assert!(certificate.state_limits[1].unwrap() > 0.04);
}

#[test]
fn a_tank_with_logarithms_and_real_powers_is_certified() {
    let data = PlantData {
        states: vec![
            signal("tank", "degC", Some((50.0, 70.0))),
            signal("wall", "degC", Some((75.0, 115.0))),
        ],
        inputs: vec![signal("heat", "kW", Some((0.0, 2.0)))],
        ..PlantData::of_dynamics("heated tank", &HeatedTank)
    };
    let plant = Plant::new(data).unwrap();
    let settings = CertifySettings {
        equilibrium: Some((vec![60.0, 91.28], vec![0.74])),
        enlargement: 100.0,
        ..CertifySettings::new(0.5, &[1.0, 0.01], &[0.1])
    };
    let certificate = certify(&plant, &settings, &|_| ()).unwrap();
    check::<2, 3>(&plant, &certificate);
    assert!(
        certificate
            .equilibrium
            .within
            .iter()
            .any(|within| *within > 0.0)
    );
    // Of the set itself: the limit is a bound of where its motions are, and says nothing of how large it is.
    let inverse = p::<2>(&certificate).try_inverse().unwrap();
    let reach = (certificate.level * inverse[(0, 0)]).sqrt();
    assert!(reach > 1.7, "{reach}");
}
