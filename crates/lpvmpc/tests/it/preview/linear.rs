//! Linear plants: the sample's problem is a quadratic program, here written out densely and solved by
//! another solver.

use super::case::{Case, Hardness, Row, Settings};
use super::dense::{self, Answer, sampled};
use super::plants::{NU, NX, Scheduled};
use lpvmpc::{
    Bounds, Controller, ControllerMemory, ControllerSettings, InputReference, Iterations, Penalty,
    Predictor, Preview, Reference, Rk4, Scalar, Scheduling, Solution, SolverSettings, Status,
    TerminalIngredient, Weights, Workspace,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, SVector};

/// The paper's loop, also with the frozen predictor, and the descent.
fn ways() -> [(Iterations<f64>, Predictor); 4] {
    let rk4 = Rk4 { substeps: 1 };
    let descent = Iterations::descent(1e-9, 30);
    [
        (Iterations::Fixed(1), Predictor::StageConsistent(rk4)),
        (Iterations::Fixed(2), Predictor::FrozenRk4(rk4)),
        (descent, Predictor::StageConsistent(rk4)),
        (descent, Predictor::FrozenRk4(rk4)),
    ]
}

/// Held by the paper's loop with the frozen predictor: the plant's own; what is told from outside takes its place.
fn scheduling(iterations: Iterations<f64>, predictor: Predictor) -> Scheduling<f64, 1> {
    match (iterations, predictor) {
        (Iterations::Fixed(_), Predictor::FrozenRk4(_)) => Scheduling::Held(SVector::zeros()),
        _ => Scheduling::Predicted,
    }
}

fn plan(case: &Case, settings: Settings) -> (Solution<f64, NX, NU>, f64) {
    let most = case.rows.iter().map(Vec::len).max().unwrap_or(0);
    let room = settings.capacity().with_own_stages();
    let room = room.with_general_rows(most);
    // Beside the rows, every state bound may be exceeded.
    let room = lpvmpc::Capacity {
        rows: room.rows + (case.horizon + 1) * NX,
        active: room.active + 2 * (case.horizon + 1) * NX,
        ..room
    };
    let memory = ControllerMemory::allocate(room);
    let mut controller = Controller::new(case.plant.clone(), settings, memory).unwrap();
    let mut workspace = Workspace::allocate(room);
    let rows = case.row_lists();
    let preview = case.preview(&rows);
    let plan = controller.step_with(&case.x0, &preview, &mut workspace);
    let plan = plan.clone();
    let cost = controller.tracking_cost_with(&case.x0, &preview);
    (plan, cost)
}

/// J of the inputs, prices included, and by how much hard bounds are exceeded: a simulation.
fn simulate(case: &Case, settings: &Settings, u: &[SVector<f64, NU>]) -> (f64, f64, f64) {
    let (mut x, mut tracking, mut prices, mut beyond) = (case.x0, 0.0, 0.0, 0.0_f64);
    let n = case.horizon;
    let mut pay = |value: f64, lower: f64, upper: f64, soft: Option<Penalty<f64>>| {
        let excess = (lower - value).max(value - upper).max(0.0);
        match soft {
            Some(price) => prices += price.linear * excess + price.quadratic * excess.powi(2) / 2.0,
            None => beyond = beyond.max(excess),
        }
    };
    let InputReference::Given(otherwise) = settings.input_reference else {
        panic!("given in every case");
    };
    for i in 0..=n {
        let pick = |length: usize| i.min(length.saturating_sub(1));
        let error = x - case.x_ref[i];
        if i > 0 {
            let bounds = case.x.get(pick(case.x.len())).unwrap_or(&settings.x);
            let soft = case.soft_x.get(pick(case.soft_x.len()));
            let soft = soft.unwrap_or(&settings.soft_x);
            for j in 0..NX {
                pay(x[j], bounds.lower[j], bounds.upper[j], soft[j]);
            }
        }
        let u_i = u.get(i).copied().unwrap_or_else(SVector::zeros);
        for row in case.rows.get(pick(case.rows.len())).into_iter().flatten() {
            let of_state = row.u.amax() == 0.0;
            if !((of_state && i == 0) || (!of_state && i == n)) {
                pay(
                    row.x.dot(&x) + row.u.dot(&u_i),
                    row.lower,
                    row.upper,
                    row.soft,
                );
            }
        }
        if let Some(price) = case.linear_x.get(pick(case.linear_x.len())) {
            tracking += price.dot(&x);
        }
        if i == n {
            tracking += error.dot(&(case.p * error));
            break;
        }
        let weights = case.weights.get(pick(case.weights.len()));
        let weights = weights.unwrap_or(&settings.weights);
        let u_ref = case.u_ref.get(pick(case.u_ref.len())).unwrap_or(&otherwise);
        tracking += error.dot(&(weights.q * error));
        tracking += (u_i - u_ref).dot(&(weights.r * (u_i - u_ref)));
        if let Some(s) = case.cross.get(pick(case.cross.len())) {
            tracking += 2.0 * (u_i - u_ref).dot(&(s * error));
        }
        if let Some(price) = case.linear_u.get(pick(case.linear_u.len())) {
            tracking += price.dot(&u_i);
        }
        let bounds = case.u.get(pick(case.u.len())).unwrap_or(&settings.u);
        assert!(bounds.contains(&u_i, 0.0), "{u_i} at stage {i}");
        let plant = case
            .models
            .get(pick(case.models.len()))
            .unwrap_or(&case.plant);
        let s = case.scheduling.get(pick(case.scheduling.len()));
        let (a_d, integral) = sampled(&(plant.a + plant.a_s * s.map_or(0.0, |s| s[0])));
        let d = case.disturbance.get(pick(case.disturbance.len()));
        let d = d.copied().unwrap_or_else(SVector::zeros);
        x = a_d * x + integral * (plant.b * u_i + d);
    }
    (tracking, prices, beyond)
}

/// Time-varying weights, references, bounds, prices, rows, disturbances, scheduling and plants at
/// once, each list as long as it happens to be: first input and cost are those of the dense problem.
#[test]
fn the_plan_is_the_optimum_of_the_problem_written_out() {
    let mut solved = 0;
    for seed in 0..250 {
        let case = Case::random(&mut Rng::new(seed), Hardness::Soft);
        for (iterations, predictor) in ways() {
            let settings = Settings {
                predictor,
                scheduling: scheduling(iterations, predictor),
                ..case.settings(iterations)
            };
            let Answer::Solved { u, cost } = dense::solve(&case, &settings) else {
                continue;
            };
            let (plan, tracking_cost) = plan(&case, settings);
            assert!(
                plan.status.is_solved(),
                "{seed} {iterations:?}: {}",
                plan.status
            );
            let (tracking, prices, beyond) = simulate(&case, &settings, &plan.u);
            assert!(beyond < 1e-9, "{seed}: {beyond:e}");
            let total = tracking + prices;
            assert!(
                (total - cost).abs() <= 1e-7 * cost.max(1.0),
                "{seed} {iterations:?} {predictor:?}: {total} for {cost}"
            );
            let error = (plan.u[0] - u[0]).amax();
            assert!(error <= 1e-7, "{seed} {iterations:?}: {error:e}");
            assert!(
                (tracking_cost - tracking).abs() <= 1e-9 * tracking.max(1.0),
                "{seed}"
            );
            solved += 1;
        }
    }
    assert!(solved > 950, "{solved}");
}

/// Hard rows and bounds: kept where they can be kept, and where they cannot, that is said by the
/// paper's loop; the inputs are within their bounds in any case.
#[test]
fn hard_rows_hold_or_are_called_infeasible() {
    let (mut feasible, mut infeasible) = (0, 0);
    for seed in 1000..1250 {
        let case = Case::random(&mut Rng::new(seed), Hardness::Hard);
        for (iterations, predictor) in ways() {
            let settings = Settings {
                predictor,
                scheduling: scheduling(iterations, predictor),
                ..case.settings(iterations)
            };
            let (plan, _) = plan(&case, settings);
            let (tracking, prices, beyond) = simulate(&case, &settings, &plan.u);
            match dense::solve(&case, &settings) {
                Answer::Solved { u, cost } => {
                    feasible += 1;
                    assert!(plan.status.is_solved(), "{seed}: {}", plan.status);
                    assert!(beyond < 1e-6, "{seed} {iterations:?}: {beyond:e}");
                    let total = tracking + prices;
                    assert!(
                        (total - cost).abs() <= 1e-6 * cost.max(1.0),
                        "{seed} {iterations:?} {predictor:?}: {total} for {cost}"
                    );
                    let error = (plan.u[0] - u[0]).amax();
                    assert!(error <= 1e-5, "{seed} {iterations:?}: {error:e}");
                }
                Answer::Infeasible => {
                    infeasible += 1;
                    assert!(beyond > 1e-8);
                    let named =
                        matches!(plan.status, Status::Infeasible(_) | Status::Inaccurate(_));
                    assert!(named, "{seed} {iterations:?}: {}", plan.status);
                }
                Answer::Undecided => {}
            }
        }
    }
    assert!(
        feasible > 200 && infeasible > 100,
        "{feasible} {infeasible}"
    );
}

fn single<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> SMatrix<f32, R, C> {
    m.map(|entry| entry as f32)
}

fn singles<const R: usize>(list: &[SVector<f64, R>]) -> Vec<SVector<f32, R>> {
    list.iter().map(single).collect()
}

fn bounds<const K: usize>(bounds: &Bounds<f64, K>) -> Bounds<f32, K> {
    Bounds {
        lower: single(&bounds.lower),
        upper: single(&bounds.upper),
    }
}

fn weights(weights: &Weights<f64, NX, NU>) -> Weights<f32, NX, NU> {
    Weights {
        q: single(&weights.q),
        r: single(&weights.r),
    }
}

fn price(price: &Option<Penalty<f64>>) -> Option<Penalty<f32>> {
    price.map(|price| Penalty {
        linear: price.linear as f32,
        quadratic: price.quadratic as f32,
    })
}

fn plant(plant: &Scheduled<f64>) -> Scheduled<f32> {
    Scheduled {
        a: single(&plant.a),
        a_s: single(&plant.a_s),
        b: single(&plant.b),
    }
}

fn row(row: &Row) -> lpvmpc::GeneralRow<f32, NX, NU> {
    lpvmpc::GeneralRow {
        x: single(&row.x),
        u: single(&row.u),
        lower: row.lower as f32,
        upper: row.upper as f32,
        soft: price(&row.soft),
    }
}

fn finite<T: Scalar>(u: &[SVector<T, NU>]) -> bool {
    u.iter().all(|u| u.iter().all(|entry| entry.is_finite()))
}

/// The same problems in single precision: the cost of the plan, in double, is near the optimum.
#[test]
fn single_precision_is_close_to_the_optimum() {
    let (mut tried, mut close) = (0, 0);
    for seed in 0..250 {
        let case = Case::random(&mut Rng::new(seed), Hardness::Soft);
        for descent in [false, true] {
            let of_double = case.settings(Iterations::Fixed(1));
            let iterations = if descent {
                Iterations::default()
            } else {
                Iterations::Fixed(1)
            };
            let settings = ControllerSettings {
                t_s: of_double.t_s as f32,
                horizon: case.horizon,
                predictor: of_double.predictor,
                weights: weights(&of_double.weights),
                terminal: TerminalIngredient::Cost(SMatrix::identity()),
                x: bounds(&of_double.x),
                soft_x: of_double.soft_x.each_ref().map(price),
                raise_prices: false,
                u: bounds(&of_double.u),
                scheduling: Scheduling::Predicted,
                iterations,
                input_reference: InputReference::Given(SVector::repeat(0.1)),
                solver: SolverSettings::default(),
            };
            let room = settings.capacity().with_own_stages().with_general_rows(2);
            let room = lpvmpc::Capacity {
                rows: room.rows + (case.horizon + 1) * NX,
                active: room.active + 2 * (case.horizon + 1) * NX,
                ..room
            };
            let memory = ControllerMemory::allocate(room);
            let mut controller = Controller::new(plant(&case.plant), settings, memory).unwrap();
            let x_ref = singles(&case.x_ref);
            let (terminal, stages) = x_ref.split_last().unwrap();
            let rows: Vec<Vec<_>> = case
                .rows
                .iter()
                .map(|rows| rows.iter().map(row).collect())
                .collect();
            let rows: Vec<&[_]> = rows.iter().map(Vec::as_slice).collect();
            let preview = Preview {
                reference: Reference {
                    stages,
                    terminal: *terminal,
                },
                u_ref: &singles(&case.u_ref),
                weights: &case.weights.iter().map(weights).collect::<Vec<_>>(),
                cross: &case.cross.iter().map(single).collect::<Vec<_>>(),
                linear_x: &singles(&case.linear_x),
                linear_u: &singles(&case.linear_u),
                terminal: Some(TerminalIngredient::Cost(single(&case.p))),
                x: &case.x.iter().map(bounds).collect::<Vec<_>>(),
                soft_x: &case
                    .soft_x
                    .iter()
                    .map(|soft| soft.each_ref().map(price))
                    .collect::<Vec<_>>(),
                u: &case.u.iter().map(bounds).collect::<Vec<_>>(),
                rows: &rows,
                disturbance: &singles(&case.disturbance),
                scheduling: &singles(&case.scheduling),
                models: &case.models.iter().map(plant).collect::<Vec<_>>(),
                outputs: None,
            };
            let mut workspace = Workspace::allocate(room);
            let plan = controller.step_with(&single(&case.x0), &preview, &mut workspace);
            assert!(finite(&plan.u));
            let Answer::Solved { cost, .. } = dense::solve(&case, &of_double) else {
                continue;
            };
            tried += 1;
            assert!(plan.status.is_solved(), "{seed} {descent}: {}", plan.status);
            let inputs: Vec<_> = plan.u.iter().map(|u| u.map(f64::from)).collect();
            let inside = Case {
                // A bound in single precision may be a rounding wider.
                u: Vec::new(),
                ..case.clone()
            };
            let wide = Settings {
                u: Bounds::none(),
                ..of_double
            };
            let (tracking, prices, _) = simulate(&inside, &wide, &inputs);
            // The horizon is up to 12 samples of an unstable plant, the price up to 1000 per unit.
            if (tracking + prices - cost).abs() <= 1e-3 * cost.max(1.0) {
                close += 1;
            }
            assert!(
                (tracking + prices - cost).abs() <= 2e-2 * cost.max(1.0),
                "{seed} {descent}: {} for {cost}",
                tracking + prices
            );
        }
    }
    assert!(tried > 480 && close > tried - 10, "{close} of {tried}");
}
