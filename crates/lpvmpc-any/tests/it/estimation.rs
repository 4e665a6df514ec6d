//! Behind an estimator and a delay.

use crate::plants::limits;
use lpvmpc_any::{Disturbance, EstimatorSettings, Mpc, MpcSettings, Preview, Terminal, Verdict};
use lpvmpc_plant::{Matrices, Plant, PlantData};
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

fn cart_pole() -> Plant {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/plants/");
    Plant::load(format!("{folder}cart-pole.json")).unwrap()
}

/// The plant as it really is, in many small steps.
fn moved(plant: &Plant, x: &DVector<f64>, force: f64, duration: f64) -> DVector<f64> {
    const STEPS: usize = 40;
    let h = duration / STEPS as f64;
    let f = |x: &DVector<f64>| DVector::from_vec(plant.derivative(x.as_slice(), &[force]).unwrap());
    (0..STEPS).fold(x.clone(), |x, _| {
        let half = &x + f(&x) * (h / 2.0);
        &x + f(&half) * h
    })
}

fn settings(with_changes: bool) -> MpcSettings {
    MpcSettings {
        r_du: with_changes.then(|| dmatrix![0.05]),
        du_bounds: with_changes.then(|| limits(&[4.0])).flatten(),
        ..MpcSettings::new(0.04, 40, &[20.0, 10.0, 0.1, 0.1], &[0.01])
    }
}

fn estimator(delay: f64, disturbances: Vec<Disturbance>) -> EstimatorSettings {
    EstimatorSettings {
        delay,
        disturbances,
        initial_state: vec![0.1, 0.1, 0.1, 0.1],
        ..EstimatorSettings::new(
            &["tip_position", "tilt"],
            &[1e-6, 1e-6],
            &[1e-6, 1e-6, 1e-3, 1e-3],
        )
    }
}

/// The last positions of a loop on a cart with a heavier pole, more friction and a constant force, whose input acts
/// late: the mean of the last second.
fn position(with_changes: bool, disturbances: Vec<Disturbance>, delay: usize) -> f64 {
    let mut real = cart_pole();
    real.set_parameter("pole_mass", 0.36).unwrap();
    real.set_parameter("friction", 0.3).unwrap();
    let (t_s, push) = (0.04, 1.5);
    let mut mpc = Mpc::new(&cart_pole(), &settings(with_changes)).unwrap();
    mpc.set_estimator(Some(&estimator(delay as f64 * t_s, disturbances)))
        .unwrap();
    let mut x = dvector![0.0, 0.05, 0.0, 0.0];
    let mut sent = vec![0.0; delay];
    let (mut sum, mut last) = (0.0, 0.0_f64);
    const SAMPLES: usize = 300;
    for k in 0..SAMPLES {
        let y = real.output(x.as_slice(), &[0.0]).unwrap();
        let verdicts = mpc
            .observe(k as f64 * t_s, &[Some(y[0]), Some(x[1])])
            .unwrap();
        assert!(
            verdicts.iter().all(|verdict| verdict.is_used()),
            "{k}: {verdicts:?}"
        );
        let plan = mpc.decide(&Preview::to(&[0.4, 0.0, 0.0, 0.0])).unwrap();
        assert!(plan.is_solved(), "{k}: {}", plan.status);
        let u = plan.first_input()[0];
        assert!(!with_changes || (u - last).abs() <= 4.0 + 1e-9);
        last = u;
        sent.push(u);
        x = moved(&real, &x, sent[k] + push, t_s);
        sum += if k >= SAMPLES - 25 { x[0] / 25.0 } else { 0.0 };
    }
    sum
}

fn force() -> Vec<Disturbance> {
    vec![Disturbance {
        on: "force".to_owned(),
        noise: 0.1,
        initial: 1.0,
    }]
}

/// With the force among what is estimated the cart comes to its place, whatever acts on it and however wrong its
/// parameters are; without it does not.
#[test]
fn a_loop_tracks_without_offset_behind_a_delay() {
    for (with_changes, delay) in [(false, 2), (true, 2), (false, 0)] {
        let position = position(with_changes, force(), delay);
        assert!(
            (position - 0.4).abs() < 1e-4,
            "{with_changes}, {delay}: {position}"
        );
    }
    let without = position(false, Vec::new(), 2);
    assert!((without - 0.4).abs() > 0.02, "{without}");
}

/// Bounds of what the input changes, which need more places for states than the controller has, and finer steps leave the
/// estimate and the inputs on their way as they are; so do settings and parameters that are refused.
#[test]
fn other_settings_leave_the_estimate_as_it_is() {
    let mut mpc = Mpc::new(&cart_pole(), &settings(false)).unwrap();
    mpc.set_estimator(Some(&estimator(0.08, force()))).unwrap();
    let to = Preview::to(&[0.4, 0.0, 0.0, 0.0]);
    let run = |mpc: &mut Mpc, samples: core::ops::Range<i32>| {
        for k in samples {
            let readings = [Some(0.3 + 0.01 * f64::from(k)), Some(0.05)];
            mpc.observe(0.04 * f64::from(k), &readings).unwrap();
            assert!(mpc.decide(&to).unwrap().is_solved(), "{k}");
        }
    };
    run(&mut mpc, 0..8);
    let before = mpc.estimate();
    let finer = MpcSettings {
        substeps: 3,
        ..settings(true)
    };
    for other in [&settings(true), &finer] {
        mpc.set_settings(other).unwrap();
        assert_eq!(mpc.estimate(), before);
        // Without another reading.
        let ahead = mpc.decide(&to).unwrap();
        assert!(ahead.is_solved(), "{}", ahead.status);
    }
    let (known, unknown) = (("pole_mass", 0.36), ("mass_of_nothing", 1.0));
    assert!(mpc.set_parameters([known, unknown]).is_err());
    assert_eq!(*mpc.plant(), cart_pole());
    let refused = MpcSettings {
        r: -DMatrix::identity(1, 1),
        ..settings(true)
    };
    assert!(mpc.set(&refused, None).is_err());
    assert!(
        mpc.set(
            &settings(true),
            Some(&EstimatorSettings::new(&[], &[], &[]))
        )
        .is_err()
    );
    assert_eq!(mpc.estimate(), before);
    run(&mut mpc, 8..12);
}

/// A loop that was reset is the same loop once more, with another parameter, too; a filter that begins elsewhere, or
/// that knows what was sent in place of a plan's input, finds the state from there.
#[test]
fn a_reset_forgets_and_a_start_is_where_it_begins() {
    // The regulator's cost would be another for another plant.
    let settings = MpcSettings {
        terminal: Terminal::Cost(DMatrix::identity(4, 4) * 100.0),
        ..settings(false)
    };
    let mut mpc = Mpc::new(&cart_pole(), &settings).unwrap();
    let run = |mpc: &mut Mpc| -> Vec<f64> {
        (0..5)
            .map(|k| {
                let readings = [Some(0.3), Some(0.05)];
                mpc.observe(10.0 + 0.04 * f64::from(k), &readings).unwrap();
                let plan = mpc.decide(&Preview::to(&[0.4, 0.0, 0.0, 0.0])).unwrap();
                plan.first_input()[0]
            })
            .collect()
    };
    mpc.set_estimator(Some(&estimator(0.08, force()))).unwrap();
    let first = run(&mut mpc);
    mpc.reset();
    assert_eq!(run(&mut mpc), first);
    mpc.reset();
    mpc.set_parameter("pole_mass", 0.36).unwrap();
    let heavier = run(&mut mpc);
    assert_ne!(heavier, first);
    let mut plant = cart_pole();
    plant.set_parameter("pole_mass", 0.36).unwrap();
    let mut other = Mpc::new(&plant, &settings).unwrap();
    other
        .set_estimator(Some(&estimator(0.08, force())))
        .unwrap();
    assert_eq!(run(&mut other), heavier);

    let start = vec![0.2, 0.1, -0.3, 0.4];
    let begun = EstimatorSettings {
        start: Some(start.clone()),
        ..estimator(0.0, Vec::new())
    };
    mpc.set_estimator(None).unwrap();
    mpc.set_estimator(Some(&begun)).unwrap();
    assert_eq!(mpc.estimate().unwrap().x, start);
    mpc.reset();
    assert_eq!(mpc.estimate().unwrap().x, start);
    // Where it is sure, the first readings change nothing.
    let sure = EstimatorSettings {
        initial_state: vec![1e-12; 4],
        ..begun
    };
    mpc.set_estimator(None).unwrap();
    mpc.set_estimator(Some(&sure)).unwrap();
    mpc.observe(0.0, &[Some(0.25), Some(0.11)]).unwrap();
    let found = mpc.estimate().unwrap().x;
    assert!(
        found
            .iter()
            .zip(&start)
            .all(|(x, at)| (x - at).abs() < 1e-6),
        "{found:?}"
    );

    // What was sent moves the estimate: half a newton for a sample, into the speed of the cart.
    let speed = |mpc: &mut Mpc, sent: f64| {
        mpc.reset();
        mpc.observe(0.0, &[Some(0.0), Some(0.0)]).unwrap();
        mpc.decide(&Preview::default()).unwrap();
        mpc.set_last_input(&[sent]).unwrap();
        mpc.observe(0.04, &[None, None]).unwrap();
        mpc.estimate().unwrap().x[2]
    };
    mpc.set_estimator(Some(&estimator(0.0, Vec::new())))
        .unwrap();
    let (without, with) = (speed(&mut mpc, 0.0), speed(&mut mpc, 0.5));
    let expected = moved(&plant, &DVector::zeros(4), 0.5, 0.04)[2];
    assert!(
        (with - without - expected).abs() < 0.05 * expected.abs(),
        "{with} - {without}, {expected}"
    );
}

/// Disturbances of a state and beside an input in discrete time, and one that is known: found to the last digits, and
/// tracked without offset.
#[test]
fn disturbances_of_a_sampled_plant_are_found() {
    let matrices = Matrices {
        a: dmatrix![1.0, 0.1, 0.0; -0.05, 0.95, 0.02; 0.0, 0.1, 0.9],
        b: dmatrix![0.005, 0.0; 0.1, 0.02; 0.0, 0.1],
        c: Some(dmatrix![1.0, 0.0, 0.5; 0.0, 0.0, 1.0]),
        period: Some(0.1),
        ..Matrices::default()
    };
    let plant = Plant::new(PlantData::of_matrices("linear", &matrices).unwrap()).unwrap();
    let settings = MpcSettings {
        q_y: Some(DMatrix::from_diagonal(&dvector![10.0, 5.0])),
        ..MpcSettings::new(0.1, 25, &[0.0, 0.1, 0.0], &[0.05, 0.1])
    };
    let disturbance = |on: &str| Disturbance {
        on: on.to_owned(),
        noise: 1e-3,
        initial: 1.0,
    };
    let estimator = EstimatorSettings {
        disturbances: vec![disturbance("x1"), disturbance("u1")],
        delay: 0.3,
        ..EstimatorSettings::new(&["y0", "y1"], &[1e-8, 1e-8], &[1e-6; 3])
    };
    let mut mpc = Mpc::new(&plant, &settings).unwrap();
    mpc.set_estimator(Some(&estimator)).unwrap();
    let c = matrices.c.as_ref().unwrap();
    let known = |k: usize| dvector![0.0, 0.02 * (0.1 * k as f64).sin(), 0.0];
    let mut x = dvector![0.5, 0.0, -0.2];
    let mut sent = vec![dvector![0.0, 0.0]; 3];
    for k in 0..250 {
        let y = c * &x;
        mpc.observe(0.1 * k as f64, &[Some(y[0]), (k % 3 != 1).then_some(y[1])])
            .unwrap();
        let preview = Preview {
            disturbance: (k + 3..k + 30).map(known).collect(),
            ..Preview::to_outputs(&[0.3, 0.05])
        };
        let plan = mpc.decide(&preview).unwrap();
        assert!(plan.is_solved(), "{k}: {}", plan.status);
        sent.push(DVector::from_vec(plan.first_input()));
        let acting = &sent[k] + dvector![0.0, 0.3];
        // What is known acts from when it was told.
        let known = if k < 3 { DVector::zeros(3) } else { known(k) };
        x = &matrices.a * &x + &matrices.b * acting + dvector![0.0, -0.04, 0.0] + known;
    }
    let estimate = mpc.estimate().unwrap();
    assert!(
        (estimate.disturbances[0] + 0.04).abs() < 1e-4,
        "{estimate:?}"
    );
    assert!(
        (estimate.disturbances[1] - 0.3).abs() < 1e-3,
        "{estimate:?}"
    );
    let y = c * &x;
    assert!(
        (y[0] - 0.3).abs() < 0.02 && (y[1] - 0.05).abs() < 0.02,
        "{y}"
    );
}

#[test]
fn what_makes_no_sense_is_refused() {
    let mut mpc = Mpc::new(&cart_pole(), &settings(false)).unwrap();
    let said = mpc.decide(&Preview::default()).unwrap_err().to_string();
    assert_eq!(said, "estimator: there is none: see `set_estimator`");
    let sound = estimator(0.08, force());
    let mut refused = |change: &dyn Fn(&mut EstimatorSettings)| {
        let mut settings = sound.clone();
        change(&mut settings);
        mpc.set_estimator(Some(&settings)).unwrap_err().to_string()
    };
    for (found, expected) in [
        (
            refused(&|s| s.measured[0] = "tip".to_owned()),
            "estimator, measured: \"tip\" is no state or output; there are position, tilt, speed, rate, tip_position, tip_height",
        ),
        (
            refused(&|s| s.measurement_noise = vec![1.0]),
            "estimator, measurement_noise: it has 1 entries; there must be 2, one for each reading",
        ),
        (
            refused(&|s| s.disturbances[0].on = "wind".to_owned()),
            "estimator, disturbances: \"wind\" is no input or state; there are force, position, tilt, speed, rate",
        ),
        (
            refused(&|s| s.delay = -1.0),
            "estimator, delay: it is -1 s; it must be from 0 to 1000 samples",
        ),
    ] {
        assert_eq!(found, expected);
    }
    // From the tilt alone a force that is constant cannot be told from one that the cart's friction takes.
    let said = refused(&|s| {
        (s.measured, s.measurement_noise) = (vec!["tilt".to_owned()], vec![1e-6]);
        s.disturbances.push(Disturbance {
            on: "speed".to_owned(),
            noise: 0.0,
            initial: 1.0,
        });
    });
    assert!(
        said.contains("2 disturbances cannot be found with 1"),
        "{said}"
    );
    assert_eq!(
        refused(&|s| s.state_noise[0] = f64::NAN),
        "estimator, state_noise: the variance of position is NaN; it must be a number from 0 on"
    );
    let said = refused(&|s| s.gate.deviations = 0.0);
    assert!(
        said.starts_with("estimator, gate: the gate's deviations"),
        "{said}"
    );
    // Nothing was measured yet: the answer says so, and sends nothing.
    mpc.set_estimator(Some(&sound)).unwrap();
    let plan = mpc.decide(&Preview::default()).unwrap();
    assert!(
        !plan.is_solved() && plan.u[(0, 0)] == 0.0,
        "{}",
        plan.status
    );
    assert_eq!(
        mpc.observe(0.0, &[Some(f64::NAN), None]).unwrap(),
        [Verdict::NotFinite, Verdict::Missing]
    );
    assert!(mpc.observe(0.0, &[None]).is_err());
}

/// A plant in discrete time has no state between its periods: readings there are of the nearest one. Each time between them was
/// rounded by itself, so that in ten of them the model took ten steps or none.
#[test]
fn a_plant_in_discrete_time_takes_a_step_for_each_period_however_often_it_is_observed() {
    let matrices = Matrices {
        a: dmatrix![1.0, 0.1; 0.0, 1.0],
        b: dmatrix![0.005; 0.1],
        period: Some(0.1),
        ..Matrices::default()
    };
    let plant = Plant::new(PlantData::of_matrices("mass", &matrices).unwrap()).unwrap();
    let settings = MpcSettings::new(0.1, 10, &[1.0, 0.1], &[0.1]);
    let moving = EstimatorSettings {
        start: Some(vec![0.0, 1.0]),
        ..EstimatorSettings::new(&["x0"], &[1e6], &[0.0, 0.0])
    };
    for parts in [1, 2, 3, 5] {
        let mut mpc = Mpc::new(&plant, &settings).unwrap();
        mpc.set_estimator(Some(&moving)).unwrap();
        mpc.observe(7.0, &[Some(0.0)]).unwrap();
        for k in 1..=10 * parts {
            let t = 7.0 + 0.1 * f64::from(k) / f64::from(parts);
            mpc.observe(t, &[None]).unwrap();
        }
        let x = mpc.estimate().unwrap().x;
        assert!((x[0] - 1.0).abs() < 1e-5, "{parts}: {x:?}");
    }
}
