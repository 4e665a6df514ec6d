//! Outputs that cost something or are bounded, and where a plant stands for them.

use crate::plants::limits;
use crate::quadratic::{Affine, Quadratic};
use lpvmpc_any::{
    Iterations, Limits, LinearModels, Mpc, MpcSettings, Penalty, Preview, StateBounds, Terminal,
};
use lpvmpc_plant::{Matrices, Plant, PlantData};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

const HORIZON: usize = 18;

fn matrices() -> Matrices {
    Matrices {
        a: dmatrix![0.98, 0.19; -0.21, 0.95],
        b: dmatrix![0.02; 0.19],
        c: Some(dmatrix![1.0, 0.4; -0.2, 1.0]),
        d: Some(dmatrix![0.0; 0.3]),
        period: Some(0.2),
        ..Matrices::default()
    }
}

fn linear(settings: &MpcSettings) -> Mpc {
    let plant = Plant::new(PlantData::of_matrices("linear", &matrices()).unwrap()).unwrap();
    Mpc::new(&plant, settings).unwrap()
}

/// Weights that are no diagonal, references and bounds by stage, one output that depends on the input, a hard and a
/// soft bound: as Clarabel has it.
#[test]
fn plans_of_a_linear_plant_are_those_of_clarabel() {
    let q_y = dmatrix![4.0, 1.0; 1.0, 2.0];
    let price = 3.0;
    for most in [Iterations::default(), Iterations::Fixed(1)] {
        let settings = MpcSettings {
            u_bounds: limits(&[1.5]),
            u_ref: Some(dvector![0.0]),
            terminal: Terminal::Cost(dmatrix![8.0, 2.0; 2.0, 5.0]),
            q_y: Some(q_y.clone()),
            output_bounds: StateBounds::Priced(vec![
                None,
                Some(Penalty {
                    linear: price,
                    quadratic: 0.0,
                }),
            ]),
            iterations: most,
            ..MpcSettings::new(0.2, HORIZON, &[0.2, 0.1], &[0.3])
        };
        let y_ref: Vec<DVector<f64>> = (0..12)
            .map(|k| dvector![(0.4 * k as f64).sin(), 0.1 * k as f64 - 0.4])
            .collect();
        let bound = |k: usize| [0.45 - 0.01 * k as f64, 0.35];
        let x0 = [0.5, -0.5];
        // Inputs, and the excess of either side of the soft bound.
        let mut program = Quadratic::new(3 * HORIZON);
        let Matrices { a, b, c, d, .. } = matrices();
        let mut x: Affine = program.given(&x0);
        for k in 0..HORIZON {
            let u = program.unknown(k, 1);
            let y = x
                .times(c.as_ref().unwrap())
                .plus(&u.times(d.as_ref().unwrap()));
            program.weigh(&x, &settings.q);
            program.weigh(&u, &settings.r);
            program.weigh(&y.shifted(&-y_ref.get(k).or(y_ref.last()).unwrap()), &q_y);
            program.within(&u, -1.5, 1.5);
            let [first, second] = bound(k);
            if k > 0 {
                program.within(&y.times(&dmatrix![1.0, 0.0]), -first, first);
            }
            for (side, place) in [(1.0, HORIZON + k), (-1.0, 2 * HORIZON + k)] {
                let excess = program.unknown(place, 1);
                program.price(&excess, price);
                program.within(&excess, 0.0, 1e3);
                program.at_most(&y.times(&dmatrix![0.0, side]).minus(&excess), second);
            }
            x = x.times(&a).plus(&u.times(&b));
        }
        // The one without an input is bounded at the end, too.
        let [first, _] = bound(HORIZON);
        program.within(&x.times(&dmatrix![1.0, 0.4]), -first, first);
        program.weigh(&x, &dmatrix![8.0, 2.0; 2.0, 5.0]);
        let (with_prices, u) = program.solve();
        let preview = Preview {
            x_ref: vec![dvector![0.0, 0.0]],
            y_ref: y_ref.clone(),
            y_bounds: (0..=HORIZON).map(|k| limits(&bound(k)).unwrap()).collect(),
            ..Preview::default()
        };
        let plan = linear(&settings).step(&x0, &preview).unwrap();
        assert!(plan.is_solved(), "{}", plan.status);
        let mut cost = plan.cost;
        for (k, u) in u.iter().enumerate().take(HORIZON) {
            assert!(
                (plan.u[(k, 0)] - u).abs() < 2e-4,
                "{k}: {} {}",
                plan.u[(k, 0)],
                u
            );
            let y = plan.x.row(k) * dmatrix![-0.2; 1.0] + plan.u.row(k) * 0.3;
            cost += price * (y[0].abs() - 0.35).max(0.0);
        }
        assert!(
            (cost - with_prices).abs() < 1e-6 * cost,
            "{cost} {with_prices}"
        );
        let active = plan.active_bounds();
        assert!(active.contains("y0 ") && active.contains("y1 "), "{active}");
    }
}

/// A car with its distance from a round obstacle, that from a mast, and its lateral acceleration.
fn car(case: &[f64]) -> Plant {
    let text = format!(
        r#"{{"schema": 1, "name": "car",
        "states": [{{"name": "x", "unit": "m"}}, {{"name": "y", "unit": "m"}},
            {{"name": "heading", "unit": "rad"}}, {{"name": "speed", "unit": "m/s"}}],
        "inputs": [{{"name": "acceleration", "unit": "m/s^2", "lower": -2, "upper": 2}},
            {{"name": "turning", "unit": "rad/s", "lower": -1.5, "upper": 1.5}}],
        "parameters": [{{"name": "obstacle_x", "unit": "m", "value": {}}},
            {{"name": "obstacle_y", "unit": "m", "value": {}}}, {{"name": "radius", "unit": "m", "value": {}}}],
        "outputs": [{{"name": "within the obstacle", "unit": "m^2", "upper": 0}},
            {{"name": "range", "unit": "m"}},
            {{"name": "lateral acceleration", "unit": "m/s^2", "lower": -{grip}, "upper": {grip}}}],
        "operations": [["state", 0], ["state", 1], ["state", 2], ["state", 3], ["input", 0], ["input", 1],
            ["parameter", 0], ["parameter", 1], ["parameter", 2],
            ["cos", 2], ["mul", 3, 9], ["sin", 2], ["mul", 3, 11],
            ["sub", 0, 6], ["sq", 13], ["sub", 1, 7], ["sq", 15], ["add", 14, 16], ["sq", 8], ["sub", 18, 17],
            ["constant", 1], ["add", 1, 20], ["sq", 21], ["sq", 0], ["add", 22, 23], ["constant", 0.01],
            ["add", 24, 25], ["sqrt", 26], ["mul", 3, 5]],
        "derivative": [10, 12, 5, 4], "output": [19, 27, 28]}}"#,
        case[6],
        case[7],
        case[8],
        grip = case[11],
    );
    Plant::from_json(&text).unwrap()
}

fn car_settings(weight: f64) -> MpcSettings {
    let grip = Penalty {
        linear: 8.0,
        quadratic: 1.0,
    };
    // Above its multiplier, so that it is as if it were hard; but no program along a plan is infeasible.
    let obstacle = Penalty {
        linear: 1000.0,
        quadratic: 0.0,
    };
    MpcSettings {
        q_y: Some(DMatrix::from_diagonal(&dvector![0.0, weight, 0.0])),
        output_bounds: StateBounds::Priced(vec![Some(obstacle), None, Some(grip)]),
        terminal: Terminal::Cost(DMatrix::from_diagonal(&dvector![5.0, 5.0, 1.0, 1.0])),
        u_ref: Some(dvector![0.0, 0.0]),
        r_du: Some(DMatrix::from_diagonal(&dvector![0.5, 0.3])),
        du_bounds: limits(&[0.6, 0.5]),
        linear_models: LinearModels::AlongMotion,
        iterations: Iterations::descent(1e-8, 200),
        ..MpcSettings::new(0.1, 20, &[1.0, 1.0, 0.1, 0.2], &[0.1, 0.2])
    }
}

/// Nonlinear costs, a constraint that is not convex, a soft one that depends on the input, changes of the input:
/// the plans of a descent beside the best that IPOPT finds from eight starts.
#[test]
fn plans_of_a_car_are_those_of_ipopt() {
    let text = include_str!("../../../../testdata/outputs/optima.csv");
    let (mut same, mut total, mut worst_excess) = (0, 0, 0.0_f64);
    for line in text.lines().skip(1) {
        let case: Vec<f64> = line
            .split(',')
            .map(|number| number.parse().unwrap())
            .collect();
        let (weight, grip) = (case[10], case[11]);
        let mut mpc = Mpc::new(&car(&case), &car_settings(weight)).unwrap();
        mpc.set_last_input(&case[4..6]).unwrap();
        let preview = Preview {
            x_ref: vec![DVector::zeros(4)],
            y_ref: vec![dvector![0.0, case[9], 0.0]],
            ..Preview::default()
        };
        let plan = mpc.step(&case[..4], &preview).unwrap();
        assert!(plan.is_solved(), "{line}: {}", plan.status);
        let mut cost = plan.cost;
        for k in 0..20 {
            let beyond = ((plan.x[(k, 3)] * plan.u[(k, 1)]).abs() - grip).max(0.0);
            cost += 8.0 * beyond + 0.5 * beyond * beyond;
            let (x, y) = (plan.x[(k + 1, 0)] - case[6], plan.x[(k + 1, 1)] - case[7]);
            worst_excess = worst_excess.max(case[8].powi(2) - x * x - y * y);
        }
        total += 1;
        let best = case[12];
        println!(
            "{:.6} {best:.6} {:+.2e} {} {}",
            cost,
            cost / best - 1.0,
            plan.problems,
            plan.status
        );
        assert!(cost > best * (1.0 - 1e-6), "{line}: {cost}");
        if cost < best * (1.0 + 1e-6) {
            same += 1;
            assert!(
                (plan.u[(0, 0)] - case[13]).abs() < 2e-3
                    && (plan.u[(0, 1)] - case[14]).abs() < 2e-3
            );
        }
    }
    println!("{same} of {total}, {worst_excess:e}");
    assert!(worst_excess < 1e-6, "{worst_excess}");
    assert!(same * 10 >= total * 8, "{same} of {total}");
}

/// Where a pendulum stands with the tip at a height: the input that holds it comes with it.
#[test]
fn a_reference_of_an_output_has_a_target() {
    let plant = Plant::from_json(
        r#"{"schema": 1, "name": "pendulum",
        "states": [{"name": "angle", "unit": "rad"}, {"name": "rate", "unit": "rad/s"}],
        "inputs": [{"name": "torque", "unit": "N m", "lower": -8, "upper": 8}],
        "outputs": [{"name": "sideways", "unit": "m"}],
        "operations": [["state", 0], ["state", 1], ["input", 0], ["constant", 9.81],
            ["sin", 0], ["mul", 3, 4], ["add", 5, 2]],
        "derivative": [1, 6], "output": [4]}"#,
    )
    .unwrap();
    for last_input in [false, true] {
        let settings = MpcSettings {
            q_y: Some(dmatrix![30.0]),
            r_du: last_input.then(|| dmatrix![0.1]),
            ..MpcSettings::new(0.05, 30, &[1.0, 0.1], &[0.1])
        };
        let mut mpc = Mpc::new(&plant, &settings).unwrap();
        let mut x = vec![0.0, 0.0];
        let mut plan = mpc.step(&x, &Preview::default()).unwrap();
        assert!(plan.cost.abs() < 1e-12, "{}", plan.cost);
        for _ in 0..80 {
            plan = mpc.step(&x, &Preview::to_outputs(&[0.3])).unwrap();
            assert!(plan.is_solved(), "{}", plan.status);
            x = plan.x.row(1).iter().copied().collect();
        }
        let target = plan.target.unwrap();
        assert!((target.x[0].sin() - 0.3).abs() < 1e-6 && target.x[1].abs() < 1e-9);
        assert!((target.u[0] + 9.81 * 0.3).abs() < 1e-5);
        assert!((x[0].sin() - 0.3).abs() < 1e-5, "{x:?}");
        // A height that cannot be held is approached as far as the torque goes.
        plan = mpc.step(&x, &Preview::to_outputs(&[0.95])).unwrap();
        let target = plan.target.unwrap();
        assert!((target.u[0] + 8.0).abs() < 1e-6 && (target.x[0].sin() - 8.0 / 9.81).abs() < 1e-5);
        // With a reference of the state the outputs are those of that.
        plan = mpc.step(&x, &Preview::to(&[0.2, 0.0])).unwrap();
        assert!((plan.target.unwrap().x[0] - 0.2).abs() < 1e-6);
    }
}

/// Linear plants whose inputs are bounded: y = G u at rest, and the best u within the bounds is that of the best of its nine
/// sets of bounds. An input that was held once stayed held, and some targets were not the nearest.
#[test]
fn the_target_of_outputs_is_the_nearest() {
    let mut random = Rng::new(5);
    let mut corners = 0;
    for _ in 0..60 {
        let a = dmatrix![-random.uniform(0.5, 2.0), random.uniform(-1.0, 1.0); 0.0, -random.uniform(0.5, 2.0)];
        let b = DMatrix::from_fn(2, 2, |_, _| random.uniform(-2.0, 2.0));
        let c = DMatrix::from_fn(2, 2, |_, _| random.uniform(-1.0, 1.0));
        let gain = -&c * a.clone().try_inverse().unwrap() * &b;
        let matrices = Matrices {
            a,
            b,
            c: Some(c),
            ..Matrices::default()
        };
        let mut data = PlantData::of_matrices("tanks", &matrices).unwrap();
        for input in &mut data.inputs {
            (input.lower, input.upper) = (Some(-0.5), Some(1.0));
        }
        let plant = Plant::new(data).unwrap();
        let settings = MpcSettings {
            q_y: Some(DMatrix::identity(2, 2)),
            ..MpcSettings::new(0.1, 10, &[0.0, 0.0], &[1.0, 1.0])
        };
        let y_ref = DVector::from_fn(2, |_, _| random.uniform(-3.0, 3.0));
        let distance = |u: &DVector<f64>| (&gain * u - &y_ref).norm();
        let sides = [None, Some(-0.5), Some(1.0)];
        let mut best = f64::INFINITY;
        for (first, second) in sides
            .iter()
            .flat_map(|one| sides.map(|other| (*one, other)))
        {
            // The others follow from least squares.
            let held = [first, second];
            let mut u = DVector::from_iterator(2, held.map(|side| side.unwrap_or(0.0)));
            let free: Vec<_> = (0..2).filter(|k| held[*k].is_none()).collect();
            if !free.is_empty() {
                let part = gain.select_columns(&free);
                let rest = &y_ref - &gain * &u;
                let solved = part.svd(true, true).solve(&rest, 1e-12).unwrap();
                free.iter()
                    .zip(&solved)
                    .for_each(|(k, value)| u[*k] = *value);
            }
            if u.iter().all(|u| (-0.5..=1.0).contains(u)) {
                best = best.min(distance(&u));
            }
        }
        let mut mpc = Mpc::new(&plant, &settings).unwrap();
        let preview = Preview::to_outputs(y_ref.as_slice());
        let target = mpc.step(&[0.0; 2], &preview).unwrap().target.unwrap();
        let u = DVector::from_vec(target.u);
        corners += usize::from(u.iter().all(|u| *u == -0.5 || *u == 1.0));
        assert!(
            distance(&u) < best + 1e-6 * (1.0 + best),
            "{u}: {} for {best}",
            distance(&u)
        );
        let at_rest = plant.derivative(&target.x, u.as_slice()).unwrap();
        assert!(at_rest.iter().all(|rate| rate.abs() < 1e-6), "{at_rest:?}");
    }
    println!("{corners} with both inputs at their bounds");
    assert!(corners > 10, "{corners}");
}

/// A target is a place where the plant stands; there is none where it cannot.
#[test]
fn a_target_is_at_rest() {
    // An input that is to follow an output, and cannot be where the state's bound keeps the plant from standing.
    let lag = Matrices {
        a: dmatrix![-1.0],
        b: dmatrix![1.0],
        c: Some(dmatrix![1.0; 0.5]),
        d: Some(dmatrix![0.0; 1.0]),
        ..Matrices::default()
    };
    let mut data = PlantData::of_matrices("lag", &lag).unwrap();
    (data.inputs[0].lower, data.inputs[0].upper) = (Some(0.0), Some(1.0));
    data.states[0].upper = Some(0.5);
    let settings = MpcSettings {
        q_y: Some(DMatrix::identity(2, 2)),
        ..MpcSettings::new(0.1, 20, &[0.0], &[1.0])
    };
    let mut mpc = Mpc::new(&Plant::new(data).unwrap(), &settings).unwrap();
    let plan = mpc.step(&[0.0], &Preview::to_outputs(&[5.0, 5.0])).unwrap();
    let target = plan.target.unwrap();
    assert!(
        (target.x[0] - 0.5).abs() < 1e-6 && (target.u[0] - 0.5).abs() < 1e-6,
        "{target:?}"
    );

    // x+ = x + u with u > 0 never stands.
    let integrator = Matrices {
        a: dmatrix![1.0],
        b: dmatrix![1.0],
        period: Some(1.0),
        ..Matrices::default()
    };
    let mut data = PlantData::of_matrices("integrator", &integrator).unwrap();
    (data.inputs[0].lower, data.inputs[0].upper) = (Some(0.2), Some(0.6));
    let settings = MpcSettings {
        r_du: Some(dmatrix![0.1]),
        terminal: Terminal::Cost(dmatrix![1.0]),
        ..MpcSettings::new(1.0, 5, &[1.0], &[1.0])
    };
    let mut mpc = Mpc::new(&Plant::new(data).unwrap(), &settings).unwrap();
    let plan = mpc.step(&[0.0], &Preview::to(&[3.0])).unwrap();
    assert!(plan.target.is_none(), "{:?}", plan.target);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let settings = MpcSettings::new(0.2, 10, &[1.0, 1.0], &[0.1]);
    let said = |change: &dyn Fn(&mut MpcSettings), preview: &Preview| {
        let mut settings = settings.clone();
        change(&mut settings);
        let plant = Plant::new(PlantData::of_matrices("linear", &matrices()).unwrap()).unwrap();
        match Mpc::new(&plant, &settings) {
            Ok(mut mpc) => mpc.step(&[0.0; 2], preview).unwrap_err().to_string(),
            Err(error) => error.to_string(),
        }
    };
    let nothing = Preview::default();
    let weighted = |s: &mut MpcSettings| s.q_y = Some(DMatrix::identity(2, 2));
    for (found, expected) in [
        (
            said(&|s| s.q_y = Some(DMatrix::identity(1, 1)), &nothing),
            "q_y: it is 1 x 1; it must be 2 x 2 (y0, y1 by y0, y1)",
        ),
        (
            said(&|s| s.y_bounds = limits(&[1.0, f64::NAN]), &nothing),
            "y_bounds: y1 must lie from NaN to NaN; the lower bound must not exceed the upper one",
        ),
        (
            said(&|s| s.output_bounds = StateBounds::Priced(vec![]), &nothing),
            "output_bounds: there are 0 prices for 2 outputs",
        ),
        (
            said(&|_| {}, &Preview::to_outputs(&[0.0, 0.0])),
            "y_ref: the settings have no weight q_y for it",
        ),
        (
            said(&weighted, &Preview::to_outputs(&[0.0])),
            "y_ref, stage 0: it has 1 entries; there must be 2 (y0, y1)",
        ),
        (
            said(
                &weighted,
                &Preview {
                    y_bounds: vec![Limits {
                        lower: vec![0.0, 2.0],
                        upper: vec![0.0, 1.0],
                    }],
                    ..Preview::default()
                },
            ),
            "y_bounds, stage 0: y1 must lie from 2 to 1; the lower bound must not exceed the upper one",
        ),
    ] {
        assert_eq!(found, expected);
    }
}

/// Bounds of outputs that only a step has were hard, although bounds of outputs are soft as a rule: what they ask for in
/// vain had no plan.
#[test]
fn bounds_of_outputs_that_only_a_step_has_are_soft_as_those_of_the_settings() {
    let within = Limits {
        lower: vec![f64::NEG_INFINITY, f64::NEG_INFINITY],
        upper: vec![0.1, f64::INFINITY],
    };
    let settings = MpcSettings {
        u_bounds: limits(&[0.2]),
        ..MpcSettings::new(0.2, HORIZON, &[1.0, 0.1], &[0.3])
    };
    let own = MpcSettings {
        y_bounds: Some(within.clone()),
        ..settings.clone()
    };
    let x0 = [1.0, 1.0];
    let expected = linear(&own).step(&x0, &Preview::default()).unwrap();
    assert!(expected.active_bounds().contains("exceeded"));
    let told = Preview {
        y_bounds: vec![within],
        ..Preview::default()
    };
    let plan = linear(&settings).step(&x0, &told).unwrap();
    assert_eq!(plan, expected);
    let hard = MpcSettings {
        output_bounds: StateBounds::Hard,
        ..settings
    };
    assert!(!linear(&hard).step(&x0, &told).unwrap().is_solved());
}

/// Without a reference of the states they are wanted where the outputs are nearest to theirs, also where it is said which input
/// costs nothing: then they were wanted at rest.
#[test]
fn states_follow_the_reference_of_outputs_whatever_input_costs_nothing() {
    let matrices = Matrices {
        a: dmatrix![1.0, 0.1; 0.0, 1.0],
        b: dmatrix![0.005; 0.1],
        c: Some(dmatrix![1.0, 0.0]),
        period: Some(0.1),
        ..Matrices::default()
    };
    let plant = Plant::new(PlantData::of_matrices("mass", &matrices).unwrap()).unwrap();
    let settings = MpcSettings {
        q_y: Some(dmatrix![1.0]),
        ..MpcSettings::new(0.1, HORIZON, &[1.0, 0.1], &[0.1])
    };
    let mut mpc = Mpc::new(&plant, &settings).unwrap();
    let told = Preview {
        u_ref: vec![dvector![0.0]],
        ..Preview::to_outputs(&[2.0])
    };
    let plan = mpc.step(&[2.0, 0.0], &told).unwrap();
    // It stands there, and that costs nothing.
    assert!(plan.cost < 1e-9 && plan.u.amax() < 1e-6, "{}", plan.u);
    assert_eq!(plan.target, None);
}
