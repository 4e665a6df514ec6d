//! What a step is told stage by stage.

use crate::plants::{cart_pole, chain};
use lpvmpc_any::{Limits, LinearModels, Mpc, MpcSettings, Preview, StateBounds, Terminal, lqr};
use lpvmpc_plant::Plant;
use nalgebra::{DMatrix, DVector};

fn settings() -> MpcSettings {
    MpcSettings {
        u_bounds: Some(Limits {
            lower: vec![-10.0],
            upper: vec![10.0],
        }),
        ..MpcSettings::new(0.05, 30, &[10.0, 10.0, 0.1, 0.1], &[0.01])
    }
}

/// A push that is told ahead costs less than one that is not.
#[test]
fn a_disturbance_that_is_known_ahead_is_met_before_it_comes() {
    let mut mpc = Mpc::new(&cart_pole(), &settings()).unwrap();
    let mut disturbance = vec![DVector::zeros(4); 10];
    disturbance.push(DVector::from_row_slice(&[0.0, 0.0, 3.0, 0.0]));
    disturbance.push(DVector::zeros(4));
    let told = Preview {
        disturbance,
        ..Preview::default()
    };
    let plan = mpc.step(&[0.0; 4], &told).unwrap();
    assert!(plan.is_solved(), "{}", plan.status);
    // It leans against the push before stage 10.
    assert!((1..10).any(|i| plan.x[(i, 0)].abs() > 1e-3), "{}", plan.x);
    mpc.reset();
    let calm = mpc.step(&[0.0; 4], &Preview::default()).unwrap();
    assert!(
        calm.u.amax() < 1e-9 && calm.cost < 1e-12,
        "{} {}",
        calm.u,
        calm.cost
    );
}

/// They are as soft as those of the settings: hard, they would leave no plan from outside of them.
#[test]
fn bounds_of_states_that_are_told_are_soft_unless_the_settings_say_otherwise() {
    let told = Preview {
        x_bounds: vec![Limits {
            lower: vec![f64::NEG_INFINITY; 4],
            upper: vec![0.2, f64::INFINITY, f64::INFINITY, f64::INFINITY],
        }],
        ..Preview::default()
    };
    let outside = [0.5, 0.0, 1.0, 0.0];
    let mut mpc = Mpc::new(&cart_pole(), &settings()).unwrap();
    let plan = mpc.step(&outside, &told).unwrap();
    assert!(plan.is_solved(), "{}", plan.status);
    let words = plan.active_bounds();
    assert!(words.contains("position <= 0.2 m (exceeded)"), "{words}");
    // Where it can be kept, it is kept to rounding.
    let reachable = Preview {
        x_ref: Preview::to(&[0.5, 0.0, 0.0, 0.0]).x_ref,
        ..told.clone()
    };
    mpc.reset();
    let plan = mpc.step(&[0.0; 4], &reachable).unwrap();
    assert!(plan.is_solved(), "{}", plan.status);
    assert!(plan.x.column(0).max() <= 0.2 + 1e-6, "{}", plan.x);
    assert!(plan.x.column(0).max() > 0.19, "{}", plan.x);
    // The same bounds in the settings make the same plan.
    let set = MpcSettings {
        x_bounds: Some(told.x_bounds[0].clone()),
        ..settings()
    };
    let mut other = Mpc::new(&cart_pole(), &set).unwrap();
    let same = other.step(&[0.0; 4], &Preview::to(&[0.5, 0.0, 0.0, 0.0]));
    assert!((same.unwrap().u - plan.u).amax() < 1e-6);

    let hard = MpcSettings {
        state_bounds: StateBounds::Hard,
        ..settings()
    };
    let mut mpc = Mpc::new(&cart_pole(), &hard).unwrap();
    let plan = mpc.step(&outside, &told).unwrap();
    assert!(!plan.is_solved(), "{}", plan.status);
}

/// With equal weights, about a state in which the pole leans.
#[test]
fn a_regulator_is_about_a_steady_state() {
    let (q, r) = (DMatrix::identity(4, 4), DMatrix::identity(1, 1));
    let about = |angle: f64| {
        lqr(
            &cart_pole(),
            0.05,
            (&q, &r),
            (&[0.0, angle, 0.0, 0.0], &[0.0]),
        )
    };
    assert!(about(0.0).is_ok());
    let message = about(0.1).unwrap_err().to_string();
    assert!(message.contains("does not stand where"), "{message}");
    assert!(about(f64::NAN).is_err());
}

#[test]
fn bounds_and_weights_hold_where_they_are_said() {
    let mut mpc = Mpc::new(&cart_pole(), &settings()).unwrap();
    let of = |force: f64| Limits {
        lower: vec![-force],
        upper: vec![force],
    };
    let mut u_bounds = vec![of(0.0); 5];
    u_bounds.push(of(4.0));
    let preview = Preview {
        u_bounds,
        ..Preview::to(&[0.5, 0.0, 0.0, 0.0])
    };
    let plan = mpc.step(&[0.0; 4], &preview).unwrap();
    assert!(plan.is_solved(), "{}", plan.status);
    for i in 0..30 {
        let most = if i < 5 { 0.0 } else { 4.0 };
        assert!(
            plan.u[(i, 0)].abs() <= most + 1e-9,
            "stage {i}: {}",
            plan.u[(i, 0)]
        );
    }
    assert!(plan.u.amax() > 1.0);
}

/// Whatever linear models the programs have, a descent ends at the same plan; from afar it may be
/// another one.
#[test]
fn the_linear_models_do_not_decide_where_a_descent_ends() {
    let costs = [
        LinearModels::AlongMotion,
        LinearModels::AlongRay { nodes: 8 },
        LinearModels::Own,
    ]
    .map(|linear_models| {
        let settings = MpcSettings {
            linear_models,
            iterations: lpvmpc_any::Iterations::descent(1e-10, 100),
            ..settings()
        };
        let mut mpc = Mpc::new(&cart_pole(), &settings).unwrap();
        let plan = mpc
            .step(&[0.0, 0.3, 0.0, 0.0], &Preview::default())
            .unwrap();
        assert_eq!(plan.status, "converged");
        plan.cost
    });
    for cost in costs {
        assert!((cost / costs[0] - 1.0).abs() < 1e-8, "{costs:?}");
    }
}

/// Sixteen states and six inputs come to rest.
#[test]
fn the_largest_plant_is_held() {
    let settings = MpcSettings::new(0.1, 10, &[1.0; 16], &[0.1; 6]);
    let mut mpc = Mpc::new(&chain::<16, 6>(), &settings).unwrap();
    let mut x: Vec<f64> = (0..16).map(|i| 0.5 * f64::from(i).sin()).collect();
    for _ in 0..200 {
        let plan = mpc.step(&x, &Preview::default()).unwrap();
        assert!(plan.is_solved(), "{}", plan.status);
        x = plan.x.row(1).iter().copied().collect();
    }
    let largest = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    assert!(largest < 1e-2, "{largest}");
}

/// A set point, an input and a bound beyond the horizon were read as if they held at its end.
#[test]
fn what_is_beyond_the_horizon_is_not_read() {
    let here = DVector::zeros(4);
    let there = DVector::from_row_slice(&[1.0, 0.0, 0.0, 0.0]);
    let (inside, outside) = (
        DVector::from_row_slice(&[0.0]),
        DVector::from_row_slice(&[3.0]),
    );
    let wide = Limits {
        lower: vec![-1.0, -1.0, -5.0, -5.0],
        upper: vec![1.0, 1.0, 5.0, 5.0],
    };
    let narrow = Limits {
        lower: vec![-1e-3; 4],
        upper: vec![1e-3; 4],
    };
    let lengthened = |entries: usize, rest: usize| Preview {
        x_ref: [vec![here.clone(); entries], vec![there.clone(); rest]].concat(),
        u_ref: [vec![inside.clone(); entries], vec![outside.clone(); rest]].concat(),
        x_bounds: [vec![wide.clone(); entries], vec![narrow.clone(); rest]].concat(),
        ..Preview::default()
    };
    let without_u_ref = |preview: Preview| Preview {
        u_ref: Vec::new(),
        ..preview
    };
    let changes = DMatrix::from_element(1, 1, 0.1);
    for (terminal, r_du) in [
        (Terminal::Lqr, None),
        (Terminal::Equality, None),
        (Terminal::Lqr, Some(changes)),
    ] {
        let settings = MpcSettings {
            terminal,
            r_du,
            ..settings()
        };
        let plan = |told: &Preview| {
            let mut mpc = Mpc::new(&cart_pole(), &settings).unwrap();
            mpc.step(&[0.1, 0.05, 0.0, 0.0], told).unwrap()
        };
        let (cut, long) = (lengthened(31, 0), lengthened(31, 20));
        assert_eq!(plan(&cut), plan(&long));
        assert_eq!(plan(&without_u_ref(cut)), plan(&without_u_ref(long)));
        // One entry less: the last of the states is then at the end, too.
        let moves = plan(&lengthened(30, 1));
        assert!((moves.x - plan(&lengthened(31, 0)).x).amax() > 1e-3);
    }
}

/// x_dot = u - rate x.
fn decay() -> Plant {
    Plant::from_json(
        r#"{
        "schema": 1,
        "name": "decay",
        "states": [{"name": "x", "unit": ""}],
        "inputs": [{"name": "u", "unit": ""}],
        "parameters": [{"name": "rate", "unit": "1/s", "value": 1.0}],
        "operations": [["state", 0], ["input", 0], ["parameter", 0], ["mul", 2, 0], ["sub", 1, 3]],
        "derivative": [4]
    }"#,
    )
    .unwrap()
}

/// They were taken as they came: a pole too fast for the steps of the prediction made a plan that is nonsense.
#[test]
fn parameters_that_are_told_are_checked_as_others_are() {
    let fast = decay();
    let settings = MpcSettings::new(0.1, 10, &[1.0], &[1.0]);
    let mut mpc = Mpc::new(&fast, &settings).unwrap();
    let expected = mpc.set_parameter("rate", 100.0).unwrap_err().to_string();
    let told = |rates: &[f64]| Preview {
        parameters: rates.iter().map(|rate| vec![*rate]).collect(),
        ..Preview::default()
    };
    let mut message = |rates: &[f64]| {
        let plan = mpc.step(&[1.0], &told(rates));
        plan.map_or_else(|error| error.to_string(), |plan| plan.status)
    };
    assert_eq!(message(&[100.0]), expected);
    assert_eq!(message(&[2.0]), "converged");
    assert_eq!(message(&[100.0]), expected);
    let mut by_stage = vec![1.0; 10];
    by_stage[9] = 100.0;
    assert_eq!(message(&by_stage), expected);
    by_stage[9] = 2.0;
    assert_eq!(message(&by_stage), "converged");
    // Beyond the horizon.
    by_stage.push(100.0);
    assert_eq!(message(&by_stage), "converged");
    assert_eq!(message(&by_stage[1..]), expected);
    // With more steps it is right, and with fewer again wrong.
    let finer = MpcSettings {
        substeps: 8,
        ..settings.clone()
    };
    mpc.set_settings(&finer).unwrap();
    assert!(mpc.step(&[1.0], &told(&[100.0])).is_ok());
    mpc.set_settings(&settings).unwrap();
    assert!(mpc.step(&[1.0], &told(&[100.0])).is_err());
}

/// A plan that rests at first, goes somewhere and comes back does not run away, however small the state is that it begins
/// with: the last sample's plan is gone on from.
#[test]
fn a_plan_that_leaves_and_comes_back_is_gone_on_from() {
    let told = |sample: usize| {
        let stages = sample..sample + 31;
        let x_ref = stages.clone().map(|k| {
            let away = if (14..24).contains(&k) { 0.2 } else { 0.0 };
            DVector::from_row_slice(&[away, 0.0, 0.0, 0.0])
        });
        let u_bounds = stages.map(|k| {
            let most = if k < 8 { 0.0 } else { 5.0 };
            Limits {
                lower: vec![-most],
                upper: vec![most],
            }
        });
        Preview {
            x_ref: x_ref.collect(),
            u_ref: vec![DVector::zeros(1)],
            u_bounds: u_bounds.collect(),
            ..Preview::default()
        }
    };
    for size in [0.0, 1e-300, 1e-12] {
        let mut mpc = Mpc::new(&cart_pole(), &settings()).unwrap();
        let x = [size, 0.0, 0.0, 0.0];
        let first = mpc.step(&x, &told(0)).unwrap();
        assert!(first.x.amax() > 0.01, "{}", first.x.amax());
        let next = mpc.step(&x, &told(1)).unwrap();
        assert!(
            next.is_solved() && next.problems <= 2,
            "{size}: {}",
            next.problems
        );
    }
}
