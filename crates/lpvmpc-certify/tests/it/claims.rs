//! What is claimed, looked at by simulation.

use crate::plants::{CART_POLE, REACTOR, cart_pole, edge, random, reactor, reactor_settings};
use lpvmpc::AlongMotion;
use lpvmpc_certify::{Certificate, CertifyError, CertifySettings, certify, verify, verify_text};
use lpvmpc_plant::{Matrices, Plant, PlantData, SizedPlant};
use lpvmpc_sim::{Tolerances, advance};
use nalgebra::{DMatrix, SVector};

const EXACT: Tolerances = Tolerances {
    relative: 1e-12,
    absolute: 1e-12,
};

/// From the edge of the set and from inside, the plant integrated to 1e-12.
pub fn check<const N: usize, const NS: usize>(plant: &Plant, certificate: &Certificate) -> f64 {
    let model = AlongMotion::<_, NS>(SizedPlant::<N, 1>::new(plant.clone()).unwrap());
    let mut random = random();
    let center = SVector::<f64, N>::from_column_slice(&certificate.equilibrium.x);
    let k = SVector::<f64, N>::from_column_slice(&certificate.k[0]);
    let mut nearest = f64::INFINITY;
    for run in 0..150 {
        let x = SVector::<f64, N>::from_column_slice(&edge::<N>(certificate, &mut random));
        let share = [1.0, 0.5, 1e-3][run % 3];
        let x = center + (x - center) * share;
        assert!(certificate.contains(x.as_slice()));
        let v = -k.dot(&(x - center));
        let limit = certificate.input_limits[0].unwrap();
        assert!(v.abs() <= limit);
        let u = SVector::<f64, 1>::new(certificate.equilibrium.u[0] + v);
        let mut at = x;
        for _ in 0..10 {
            at = advance(&model, &at, &u, 0.1 * certificate.t_s, EXACT).unwrap();
            for i in 0..N {
                assert!((at[i] - center[i]).abs() <= certificate.state_limits[i].unwrap());
            }
        }
        let e = x - center;
        let stage: f64 = (0..N).map(|i| certificate.q[i][i] * e[i] * e[i]).sum();
        let stage = stage + certificate.r[0][0] * v * v;
        let before = certificate.value(x.as_slice());
        let bound = (1.0 - certificate.contraction) * before - stage;
        let after = certificate.value(at.as_slice());
        assert!(
            after <= bound + 1e-9 * before,
            "{after} above {bound} from {x}"
        );
        nearest = nearest.min((bound - after) / before);
    }
    nearest
}

#[test]
fn the_cost_falls_and_bounds_hold() {
    let (plant, certificate) = &*CART_POLE;
    let spare = check::<4, 5>(plant, certificate);
    assert!(spare > 0.0, "{spare}");
    // A set worth having: 15 degrees and more.
    assert!(certificate.state_limits[1].unwrap() > 0.26);
    let (plant, certificate) = &*REACTOR;
    check::<2, 3>(plant, certificate);
    let center = &certificate.equilibrium;
    let (limit, x) = (certificate.state_limits[1].unwrap(), center.x[1]);
    assert!(
        limit > 3.0 && x - limit >= 335.0 && x + limit <= 365.0,
        "{limit}"
    );
    // The equilibrium that was given is none: it is corrected, and known to be near.
    let rates = plant.derivative(&center.x, &center.u).unwrap();
    assert!(rates.iter().all(|rate| rate.abs() < 1e-10), "{rates:?}");
    assert!(center.within.iter().any(|within| *within > 0.0));
    assert!(center.within.iter().all(|within| *within < 1e-10));
}

/// Weights that were worked out are symmetric to rounding; they were refused after all the work.
#[test]
fn weights_are_symmetric_up_to_rounding() {
    let mut settings = CertifySettings {
        trials: 0,
        ..reactor_settings()
    };
    let plant = reactor();
    settings.q[(0, 1)] = 1e-3;
    settings.q[(1, 0)] = 1e-3 * (1.0 + f64::EPSILON);
    assert_ne!(settings.q, settings.q.transpose());
    let certificate = certify(&plant, &settings, &|_| ()).unwrap();
    assert_eq!(certificate.q[0][1], certificate.q[1][0]);
    verify(&certificate, &plant, &|_| ()).unwrap();

    // And what is not is refused before any work, of a plant of which nothing can be certified.
    settings.q[(1, 0)] = -1e-3;
    settings.x_bounds = Some((vec![0.0; 2], vec![0.0; 2]));
    let message = certify(&plant, &settings, &|_| ()).unwrap_err().to_string();
    assert!(
        message.starts_with("weights: q is not symmetric"),
        "{message}"
    );
}

#[test]
fn a_document_is_proved_again_from_its_text() {
    let (plant, certificate) = &*REACTOR;
    let text = certificate.to_json().unwrap();
    let (read, verified) = verify_text(&text, plant, &|_| ()).unwrap();
    assert_eq!(read, *certificate);
    assert_eq!(Certificate::from_json(&text).unwrap(), *certificate);
    for (reach, limit) in verified.reach.iter().zip(&certificate.state_limits) {
        assert!(*reach <= limit.unwrap());
    }
    assert_eq!(verified.boxes, certificate.record.boxes);
}

/// A linear plant needs one box, in places of its own size and in larger ones.
#[test]
fn linear_plants_need_one_box() {
    for (n, m) in [(1, 1), (3, 2), (5, 1)] {
        let a = DMatrix::from_fn(n, n, |i, j| if j == i + 1 { 1.0 } else { 0.0 });
        let b = DMatrix::from_fn(n, m, |i, j| if i + j + 1 == n { 1.0 } else { 0.0 });
        let matrices = Matrices {
            a,
            b,
            ..Matrices::default()
        };
        let mut data = PlantData::of_matrices("integrators", &matrices).unwrap();
        for input in &mut data.inputs {
            (input.lower, input.upper) = (Some(-1.0), Some(1.0));
        }
        let plant = Plant::new(data).unwrap();
        let settings = CertifySettings::new(0.1, &vec![1.0; n], &vec![1.0; m]);
        let certificate = certify(&plant, &settings, &|_| ()).unwrap();
        assert_eq!(verify(&certificate, &plant, &|_| ()).unwrap().boxes, 1);
        assert_eq!(certificate.equilibrium.within, vec![0.0; n + m]);
    }
}

#[test]
fn what_cannot_be_certified_is_refused_with_its_reason() {
    let refused = |plant: &Plant, settings: &CertifySettings| {
        certify(plant, settings, &|_| ()).unwrap_err().to_string()
    };
    let plant = reactor();
    let good = reactor_settings();
    let with = |change: &dyn Fn(&mut CertifySettings)| {
        let mut settings = good.clone();
        change(&mut settings);
        refused(&plant, &settings)
    };
    type Change = fn(&mut CertifySettings);
    let cases: [(Change, &str); 9] = [
        (|s| s.t_s = f64::NAN, "t_s: it is NaN s"),
        (|s| s.enlargement = 0.5, "enlargement: it is 0.5"),
        (
            |s| s.q = DMatrix::identity(3, 3),
            "q: it is 3 x 3; it must be 2 x 2",
        ),
        (|s| s.q[(0, 0)] = -1.0, "Q is not positive semidefinite"),
        (|s| s.r[(0, 0)] = 0.0, "R is not positive definite"),
        (
            |s| s.equilibrium = Some((vec![0.5], vec![300.0])),
            "equilibrium x: it has 1 entries",
        ),
        (
            |s| s.equilibrium = Some((vec![0.5, f64::NAN], vec![300.0])),
            "finite numbers",
        ),
        (
            |s| s.equilibrium = Some((vec![0.2, 350.0], vec![300.0])),
            "could not be shown",
        ),
        (
            |s| s.x_bounds = Some((vec![0.5, 0.0], vec![1.0, 400.0])),
            "must lie between them",
        ),
    ];
    for (change, expected) in cases {
        let message = with(&change);
        assert!(message.contains(expected), "{message}");
    }
    let settings = CertifySettings::new(0.1, &[1.0], &[1.0]);
    let none = Matrices {
        a: DMatrix::identity(1, 1),
        b: DMatrix::zeros(1, 1),
        ..Matrices::default()
    };
    let none = Plant::new(PlantData::of_matrices("uncontrolled", &none).unwrap()).unwrap();
    certify(&none, &settings, &|_| ()).unwrap_err();
    // The same plant with another parameter or formula is another one.
    let (_, certificate) = &*REACTOR;
    let error = verify(certificate, &cart_pole(), &|_| ()).unwrap_err();
    assert!(matches!(error, CertifyError::AnotherPlant { .. }) && !error.is_false());
}
