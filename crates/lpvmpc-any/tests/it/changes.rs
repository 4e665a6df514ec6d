//! Bounds and costs of what the input changes from sample to sample.

use crate::plants::{cart_pole, chain, limits};
use crate::quadratic::{Affine, Quadratic};
use lpvmpc::{AlongMotion, Rk4};
use lpvmpc_any::{Limits, Mpc, MpcSettings, Preview, Terminal};
use lpvmpc_plant::{Matrices, Plant, PlantData};
use nalgebra::{DMatrix, DVector, Vector1, Vector4, dmatrix, dvector};

const HORIZON: usize = 15;

fn matrices() -> Matrices {
    Matrices {
        a: dmatrix![1.0, 0.1, 0.0; -0.05, 0.95, 0.02; 0.0, 0.1, 0.9],
        b: dmatrix![0.005, 0.0; 0.1, 0.02; 0.0, 0.1],
        period: Some(0.1),
        ..Matrices::default()
    }
}

fn settings() -> MpcSettings {
    MpcSettings {
        u_bounds: limits(&[2.0, 1.0]),
        terminal: Terminal::Cost(DMatrix::identity(3, 3) * 12.0),
        r_du: Some(dmatrix![0.8, 0.1; 0.1, 0.5]),
        du_bounds: Some(Limits {
            lower: vec![-0.3, f64::NEG_INFINITY],
            upper: vec![0.4, 0.15],
        }),
        ..MpcSettings::new(0.1, HORIZON, &[5.0, 0.5, 1.0], &[0.05, 0.1])
    }
}

/// The plan from `x0` after the input `last`, towards a reference by stage, with the input that costs nothing.
fn optimum(
    settings: &MpcSettings,
    (x0, last): (&[f64], &[f64]),
    x_ref: &[DVector<f64>],
    u_ref: &DVector<f64>,
) -> (f64, Vec<f64>) {
    let Matrices { a, b, .. } = matrices();
    let mut program = Quadratic::new(2 * HORIZON);
    let reference = |k: usize| -x_ref.get(k).or(x_ref.last()).unwrap();
    let mut x: Affine = program.given(x0);
    let mut before = program.given(last);
    for k in 0..HORIZON {
        let u = program.unknown(2 * k, 2);
        program.weigh(&x.shifted(&reference(k)), &settings.q);
        program.weigh(&u.shifted(&-u_ref), &settings.r);
        let change = u.minus(&before);
        program.weigh(&change, settings.r_du.as_ref().unwrap());
        for (row, most) in [(dmatrix![1.0, 0.0], 2.0), (dmatrix![0.0, 1.0], 1.0)] {
            program.within(&u.times(&row), -most, most);
        }
        program.within(&change.times(&dmatrix![1.0, 0.0]), -0.3, 0.4);
        program.at_most(&change.times(&dmatrix![0.0, 1.0]), 0.15);
        x = x.times(&a).plus(&u.times(&b));
        before = u;
    }
    let Terminal::Cost(p) = &settings.terminal else {
        panic!()
    };
    program.weigh(&x.shifted(&reference(HORIZON)), p);
    program.solve()
}

#[test]
fn plans_are_those_of_clarabel() {
    let plant = Plant::new(PlantData::of_matrices("linear", &matrices()).unwrap()).unwrap();
    let x0 = [1.0, -0.2, 0.3];
    let moving: Vec<DVector<f64>> = (0..8).map(|k| dvector![0.1 * k as f64, 0.0, 0.3]).collect();
    let given = dvector![0.2, -0.1];
    for (last, x_ref, u_ref) in [
        ([0.0, 0.0], vec![DVector::zeros(3)], None),
        ([1.8, -0.9], vec![DVector::zeros(3)], Some(&given)),
        ([-1.0, 0.5], moving.clone(), Some(&given)),
        // Not at rest, with the input that holds its end.
        ([-1.0, 0.5], moving, None),
    ] {
        let settings = MpcSettings {
            u_ref: u_ref.cloned(),
            ..settings()
        };
        let mut mpc = Mpc::new(&plant, &settings).unwrap();
        mpc.set_last_input(&last).unwrap();
        let preview = Preview {
            x_ref: x_ref.clone(),
            ..Preview::default()
        };
        let plan = mpc.step(&x0, &preview).unwrap();
        assert!(plan.is_solved(), "{}", plan.status);
        // The target is a steady state of the plant, without a trace of the last input.
        let u_ref = match &plan.target {
            Some(target) => {
                assert_eq!((target.x.len(), target.u.len()), (3, 2));
                let next = plant.next(&target.x, &target.u).unwrap();
                assert!(
                    next.iter()
                        .zip(&target.x)
                        .all(|(a, b)| (a - b).abs() < 1e-9)
                );
                DVector::from_row_slice(&target.u)
            }
            None => u_ref.unwrap().clone(),
        };
        let (cost, u) = optimum(&settings, (&x0, &last), &x_ref, &u_ref);
        assert!(
            (plan.cost - cost).abs() < 1e-6 * cost,
            "{} {cost}",
            plan.cost
        );
        for k in 0..HORIZON {
            let error = (plan.u[(k, 0)] - u[2 * k]).abs() + (plan.u[(k, 1)] - u[2 * k + 1]).abs();
            assert!(error < 2e-4, "stage {k}: {error}");
        }
        assert_eq!(plan.x.shape(), (HORIZON + 1, 3));
    }
}

/// The terminal cost counts the changes beyond the horizon, too.
#[test]
fn the_regulators_cost_does_not_depend_on_the_horizon() {
    let plant = Plant::new(PlantData::of_matrices("linear", &matrices()).unwrap()).unwrap();
    let costs = [2, 60].map(|horizon| {
        let settings = MpcSettings {
            horizon,
            terminal: Terminal::Lqr,
            u_bounds: None,
            du_bounds: None,
            ..settings()
        };
        let mut mpc = Mpc::new(&plant, &settings).unwrap();
        mpc.set_last_input(&[0.5, -0.2]).unwrap();
        mpc.step(&[1.0, -0.2, 0.3], &Preview::default())
            .unwrap()
            .cost
    });
    assert!((costs[0] - costs[1]).abs() < 1e-8 * costs[0], "{costs:?}");
}

/// On a nonlinear plant, disturbed, no input that is sent differs by more from the one before.
#[test]
fn a_closed_loop_keeps_the_bounds_of_changes() {
    let settings = MpcSettings {
        u_bounds: limits(&[10.0]),
        du_bounds: limits(&[1.0]),
        r_du: Some(dmatrix![0.02]),
        ..MpcSettings::new(0.05, 30, &[10.0, 10.0, 0.1, 0.1], &[0.01])
    };
    let mut mpc = Mpc::new(&cart_pole(), &settings).unwrap();
    let model = AlongMotion::<_, 5>(crate::plants::CartPole);
    let (mut x, mut last) = (Vector4::new(0.0, 0.1, 0.0, 0.0), 0.0);
    let mut active = String::new();
    for k in 0..160 {
        let plan = mpc
            .step(x.as_slice(), &Preview::to(&[0.5, 0.0, 0.0, 0.0]))
            .unwrap();
        assert!(plan.is_solved(), "{k}: {}", plan.status);
        let u = plan.u[(0, 0)];
        assert!((u - last).abs() <= 1.0 + 1e-9, "{k}: {last} {u}");
        for i in 1..30 {
            let change = plan.u[(i, 0)] - plan.u[(i - 1, 0)];
            assert!(change.abs() <= 1.0 + 1e-4, "{k}, {i}: {change}");
        }
        if k == 0 {
            active = plan.active_bounds();
        }
        last = u;
        x = Rk4 { substeps: 2 }.advance(&model, &x, &Vector1::new(u), 0.05);
        // A shove.
        x[3] += if k == 40 { 0.2 } else { 0.0 };
    }
    assert!(
        active.contains("change of force <= 1 N at stage"),
        "{active}"
    );
    assert!(active.contains("stages 0 to"), "{active}");
    assert!((x[0] - 0.5).abs() < 0.01, "{x}");
}

#[test]
fn they_may_begin_and_cease_to_count() {
    let without = MpcSettings {
        u_bounds: limits(&[10.0]),
        ..MpcSettings::new(0.05, 20, &[1.0, 10.0, 0.1, 0.1], &[0.01])
    };
    let with = MpcSettings {
        du_bounds: limits(&[0.5]),
        ..without.clone()
    };
    let mut mpc = Mpc::new(&cart_pole(), &without).unwrap();
    let x = [0.0, 0.05, 0.0, 0.0];
    let first = mpc.step(&x, &Preview::default()).unwrap();
    let u = first.u[(0, 0)];
    assert!(u.abs() > 0.5);
    // With a place more, too, horizon and sampling time stay.
    let longer = MpcSettings {
        horizon: 30,
        ..with.clone()
    };
    let said = mpc.set_settings(&longer).unwrap_err().to_string();
    assert!(
        said.contains("cannot change while a controller runs"),
        "{said}"
    );
    mpc.set_settings(&with).unwrap();
    // The last input is known still: from zero, it could not be as far away.
    let plan = mpc
        .step(&[0.3, -0.1, 0.0, 0.0], &Preview::default())
        .unwrap();
    let mut before = u;
    let mut largest = 0.0_f64;
    for u in plan.u.iter() {
        largest = largest.max((u - before).abs());
        before = *u;
    }
    assert!((largest - 0.5).abs() < 1e-6, "{u} {}", plan.u);
    assert!(plan.u[(0, 0)].abs() > 1.0, "{}", plan.u[(0, 0)]);
    mpc.set_settings(&without).unwrap();
    mpc.reset();
    let again = mpc.step(&x, &Preview::default()).unwrap();
    assert!((again.u[(0, 0)] - u).abs() < 1e-9);
    // By stage, and in the preview only where there is a place for it.
    let preview = Preview {
        du_bounds: vec![limits(&[0.1]).unwrap()],
        ..Preview::default()
    };
    let said = mpc.step(&x, &preview).unwrap_err().to_string();
    assert_eq!(
        said,
        "du_bounds: the settings have none, and must for a preview to have any"
    );
    mpc.set_settings(&with).unwrap();
    mpc.set_last_input(&[0.0]).unwrap();
    let plan = mpc.step(&x, &preview).unwrap();
    assert!(
        (plan.u[(0, 0)].abs() - 0.1).abs() < 1e-9,
        "{}",
        plan.u[(0, 0)]
    );
}

/// Something that hovers under its thrust: height and speed.
fn hovering() -> Plant {
    let text = r#"{"schema": 1, "name": "hovering",
        "states": [{"name": "height", "unit": "m"}, {"name": "speed", "unit": "m/s"}],
        "inputs": [{"name": "thrust", "unit": "N"}],
        "parameters": [{"name": "mass", "unit": "kg", "value": 1}],
        "operations": [["state", 1], ["input", 0], ["parameter", 0], ["div", 1, 2], ["constant", 9.81],
            ["sub", 3, 4]],
        "derivative": [0, 5], "equilibrium": {"x": [0, 0], "u": [9.81]}}"#;
    Plant::from_json(text).unwrap()
}

/// The input before the first step is that of the plant's steady state, which goes along with the parameters: it stayed with
/// those of before, and a loop that hovered already began with a change.
#[test]
fn the_input_before_the_first_step_holds_the_plant_with_its_present_parameters() {
    let settings = MpcSettings {
        r_du: Some(dmatrix![1.0]),
        ..MpcSettings::new(0.05, 10, &[1.0, 0.1], &[0.01])
    };
    let first = |mpc: &mut Mpc| {
        let plan = mpc.step(&[0.0; 2], &Preview::default()).unwrap();
        plan.first_input()[0]
    };
    let mut mpc = Mpc::new(&hovering(), &settings).unwrap();
    mpc.set_parameter("mass", 2.0).unwrap();
    let u = first(&mut mpc);
    assert!((u - 19.62).abs() < 1e-6, "{u}");
    // What was applied stays what it was.
    mpc.set_last_input(&[9.81]).unwrap();
    mpc.set_parameter("mass", 1.0).unwrap();
    let u = first(&mut mpc);
    assert!((u - 9.81).abs() < 1e-6, "{u}");
}

/// Other Runge-Kutta steps threw the plan away where changes of the input count, and a descent began anew.
#[test]
fn the_plan_goes_on_with_other_runge_kutta_steps() {
    let settings = MpcSettings {
        u_bounds: limits(&[10.0]),
        r_du: Some(dmatrix![0.01]),
        ..MpcSettings::new(0.05, 20, &[1.0, 10.0, 0.1, 0.1], &[0.01])
    };
    let mut mpc = Mpc::new(&cart_pole(), &settings).unwrap();
    let to = Preview::to(&[3.0, 0.0, 0.0, 0.0]);
    let begin = mpc.step(&[0.0; 4], &to).unwrap();
    let next: Vec<f64> = begin.x.row(1).iter().copied().collect();
    let finer = MpcSettings {
        substeps: 2,
        ..settings.clone()
    };
    mpc.set_settings(&finer).unwrap();
    let goes_on = mpc.step(&next, &to).unwrap();
    mpc.reset();
    mpc.set_last_input(&begin.first_input()).unwrap();
    let anew = mpc.step(&next, &to).unwrap();
    assert!(
        goes_on.problems < anew.problems,
        "{} {}",
        goes_on.problems,
        anew.problems
    );
}

#[test]
fn what_makes_no_sense_is_refused() {
    let refused = |settings: MpcSettings| Mpc::new(&chain::<12, 4>(), &settings).err();
    let sound = MpcSettings {
        r_du: Some(DMatrix::identity(4, 4)),
        ..MpcSettings::new(0.1, 5, &[1.0; 12], &[1.0; 4])
    };
    assert_eq!(refused(sound.clone()), None);
    let wrong = MpcSettings {
        r_du: Some(DMatrix::identity(4, 4) * -1.0),
        ..sound.clone()
    };
    let said = refused(wrong).unwrap().to_string();
    assert!(
        said.starts_with("r_du: R_du is not positive semidefinite"),
        "{said}"
    );
    let wrong = MpcSettings {
        du_bounds: limits(&[1.0; 3]),
        ..sound
    };
    let said = refused(wrong).unwrap().to_string();
    assert_eq!(
        said,
        "du_bounds, lower: it has 3 entries; there must be 4 (u0, u1, u2, u3)"
    );
    let large = MpcSettings {
        r_du: Some(DMatrix::identity(4, 4)),
        ..MpcSettings::new(0.1, 5, &[1.0; 13], &[1.0; 4])
    };
    let said = Mpc::new(&chain::<13, 4>(), &large)
        .err()
        .unwrap()
        .to_string();
    assert!(
        said.contains("13 states and 4 inputs") && said.contains("the last inputs count as states"),
        "{said}"
    );
}
