//! The guaranteed loop: what it guarantees, and what it does where it can guarantee nothing.

use super::plant::CartPole;
use super::regulator;
use lpvmpc::riccati::{CostToGo, StageFactor};
use lpvmpc::{
    Bounds, Capacity, Common, Decision, GuaranteedArrays, GuaranteedController, GuaranteedError,
    GuaranteedIterations, GuaranteedSettings, GuaranteedStep, GuaranteedWorkspace,
    GuaranteedWorkspaceArrays, LpvModel, ManyBoundsArrays, Rk4, Rollout, Scheduling,
    SolverSettings, Stage, Status, TerminalSet,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix4, Vector1, Vector2, Vector4};

const N: usize = 20;
const RK4: Rk4 = Rk4 { substeps: 2 };
type Guaranteed = GuaranteedController<CartPole, f64, 4, 1, 2>;
type Settings = GuaranteedSettings<f64, 4, 1>;

fn plant() -> CartPole {
    CartPole::laboratory()
}

fn moves(x: &Vector4<f64>, u: &Vector1<f64>) -> Vector4<f64> {
    RK4.advance(&plant(), x, u, 0.05)
}

/// The regulator's weights and force; tilt within 0.6 rad, speed within 4 m/s; the LQR as
/// terminal law with one and a half times its cost, so that the decrease has a margin.
fn settings() -> Settings {
    let base = regulator::settings(&plant(), f64::INFINITY, Scheduling::Predicted).unwrap();
    let (a, b) = plant().matrices(&Vector2::zeros());
    let (a, b) = RK4.discretize(&a, &b, base.t_s);
    let p: Matrix4<f64> = regulator::terminal_weight(&a, &b, &base.weights).unwrap();
    let stage = Stage {
        a,
        b,
        ..Stage::new()
    };
    let weights = Common {
        q: base.weights.q,
        r: base.weights.r,
        ..Common::default()
    };
    let mut factor = StageFactor::zeros();
    let mut cost_to_go = CostToGo {
        quadratic: p,
        linear: Vector4::zeros(),
    };
    let outcome = factor.eliminate(&stage, &weights, &mut cost_to_go);
    outcome.unwrap();
    let limit = Vector4::new(f64::INFINITY, 0.6, 4.0, f64::INFINITY);
    Settings {
        t_s: base.t_s,
        horizon: N,
        rk4: RK4,
        // The plant of these tests is the rollout itself.
        rollout: Rollout {
            rk4: RK4,
            error: Matrix4::zeros(),
            between: Vector4::zeros(),
        },
        weights: base.weights,
        terminal: TerminalSet {
            gain: -factor.feedback,
            p: p * 1.5,
            level: 5.0,
        },
        x: Bounds {
            lower: -limit,
            upper: limit,
        },
        u: base.u,
        direction: Vector4::new(1.0, 0.0, 0.0, 0.0),
        set_points: [-50.0, 50.0],
        offset_weight: 1e3,
        margin: 1e-3,
        iterations: GuaranteedIterations {
            known: 1,
            unknown: 30,
        },
        soft_price: 1e4,
        solver: SolverSettings::default(),
    }
}

fn guaranteed(settings: Settings) -> Guaranteed {
    Guaranteed::allocate(plant(), settings).unwrap()
}

/// A state of the terminal set around 0, from the middle to the edge.
fn in_terminal_set(rng: &mut Rng) -> Vector4<f64> {
    let terminal = settings().terminal;
    let towards = rng.matrix::<4, 1>();
    let value = (terminal.p * towards).dot(&towards);
    towards * (terminal.level / value).sqrt() * rng.uniform(0.0, 1.0).powf(0.25)
}

/// What the other tests rest on, by sampling: the terminal law keeps set and bounds, and the
/// terminal cost decreases by the stage cost.
#[test]
fn the_terminal_set_is_one() {
    let settings = settings();
    let TerminalSet { gain, p, .. } = settings.terminal;
    let mut rng = Rng::new(21);
    for _ in 0..20_000 {
        let x = in_terminal_set(&mut rng);
        let u = -(gain * x);
        let next = moves(&x, &u);
        let stage = (settings.weights.q * x).dot(&x) + (settings.weights.r * u).dot(&u);
        assert!((p * next).dot(&next) <= (p * x).dot(&x) - stage);
        assert!(settings.u.contains(&u, 0.0) && settings.x.contains(&x, 0.0));
    }
}

/// Asserts what every step guarantees, whatever happens.
fn assert_safe(step: &GuaranteedStep<f64, 4, 1>) {
    assert!(step.u[0].is_finite());
    assert!(settings().u.contains(&step.u, 0.0));
}

/// Jumps of the wanted position up to 100 m, some beyond the admissible ones, at random times,
/// from random states: a plan at every sample, bounds kept, cost falling between the jumps, and
/// the nearest admissible position in the end.
fn jump_about(settings: Settings, seed: u64, decisions: &mut [usize; 5]) {
    let mut rng = Rng::new(seed);
    let mut controller = guaranteed(settings);
    let mut memory = controller.workspace::<5>();
    let mut x = in_terminal_set(&mut rng);
    for _ in 0..4 {
        let wanted = rng.uniform(-100.0, 100.0);
        let mut last = f64::INFINITY;
        for _ in 0..rng.index(200) {
            let step = controller.step(&x, wanted, &mut memory);
            assert_safe(&step);
            assert!(step.decision.is_guaranteed(), "{step:?}");
            decisions[step.decision as usize] += 1;
            // Rounding of a cost whose parts are as large as the offset's.
            assert!(step.cost <= last + 1e-12 * last, "{} {last}", step.cost);
            last = step.cost;
            x = moves(&x, &step.u);
            assert!(settings.x.contains(&x, 0.0), "{x}");
        }
    }
}

#[test]
fn far_jumps_are_never_infeasible() {
    let mut decisions = [0; 5];
    for seed in 0..20 {
        jump_about(settings(), seed, &mut decisions);
    }
    let [new, candidate, ..] = decisions;
    assert!(new > 10 * candidate, "{decisions:?}");
}

/// The guarantee does not rest on the solver: one that gives up in most samples, one that is sloppy.
#[test]
fn a_bad_solver_costs_time_and_nothing_else() {
    let mut decisions = [0; 5];
    for seed in 0..10 {
        let mut bad = settings();
        bad.solver.max_changes = Some(2);
        bad.solver.tolerance = 1e-2;
        jump_about(bad, seed, &mut decisions);
    }
    assert!(
        decisions[Decision::Candidate as usize] > 100,
        "{decisions:?}"
    );
}

#[test]
fn the_nearest_admissible_position_is_reached() {
    for (wanted, reached) in [
        (3.0, 3.0),
        (-70.0, -50.0),
        (1e300, 50.0),
        (f64::NEG_INFINITY, -50.0),
        // Before anything was wanted, where it stands.
        (f64::NAN, 0.0),
    ] {
        let mut controller = guaranteed(settings());
        let mut memory = controller.workspace::<5>();
        let mut x = Vector4::zeros();
        for _ in 0..1200 {
            let step = controller.step(&x, wanted, &mut memory);
            x = moves(&x, &step.u);
        }
        assert!((x[0] - reached).abs() < 1e-2, "{wanted}: {x}");
    }
}

/// So far away that the cost overflows, no plan is called one that guarantees anything.
#[test]
fn what_has_no_finite_cost_is_no_plan() {
    for far in [1e150, 1e160, 1e300] {
        let mut everywhere = settings();
        everywhere.set_points = [f64::NEG_INFINITY, f64::INFINITY];
        let mut controller = guaranteed(everywhere);
        let mut memory = controller.workspace::<5>();
        let x = Vector4::new(far, 0.0, 0.0, 0.0);
        let step = controller.step(&x, 1.0, &mut memory);
        assert!(
            step.cost.is_finite() || !step.decision.is_guaranteed(),
            "{far}: {step:?}"
        );
        assert!(everywhere.u.contains(&step.u, 0.0), "{far}: {step:?}");
    }
}

/// The applied plan is the nonlinear rollout: what it promised is what happens.
#[test]
fn the_plan_happens() {
    let mut controller = guaranteed(settings());
    let mut memory = controller.workspace::<5>();
    let mut x = Vector4::zeros();
    for _ in 0..60 {
        let step = controller.step(&x, 20.0, &mut memory);
        let promised = *controller.rollout().next().unwrap();
        x = moves(&x, &step.u);
        assert!((x - promised).norm() <= 1e-12 * (1.0 + x.norm()));
    }
}

/// Arrays that are lent, larger than the horizon, give the answers of the memory that is made for it:
/// bit for bit, on the way to a far set point and through a push.
#[test]
fn a_shorter_horizon_is_the_one_of_a_smaller_memory() {
    const SHORT: usize = 13;
    let mut short = settings();
    short.horizon = SHORT;
    let arrays = Box::leak(Box::new(GuaranteedArrays::<f64, 4, 1, N>::default()));
    let mut large = Guaranteed::new(plant(), short, arrays.lend()).unwrap();
    let arrays = GuaranteedWorkspaceArrays::<f64, 1, 5, { N + 2 }, 200>::default();
    let many = Box::leak(Box::new(ManyBoundsArrays::<
        f64,
        5,
        1,
        { N + 2 },
        { 12 * (N + 3) },
    >::default()));
    let arrays = Box::leak(Box::new(arrays)).lend();
    let mut large_memory = GuaranteedWorkspace::new(arrays.with_many_bounds(many));
    let mut small = guaranteed(short);
    let mut small_memory = small.workspace::<5>();
    let mut x = Vector4::zeros();
    let mut soft = 0;
    for k in 0..200 {
        if k == 100 {
            x += Vector4::new(0.0, 0.65, 0.0, 0.0);
        }
        let step = large.step(&x, 20.0, &mut large_memory);
        assert_eq!(step, small.step(&x, 20.0, &mut small_memory));
        assert!(large.rollout().eq(small.rollout()));
        let planned = large.rollout().count();
        assert!(planned == 0 || planned == SHORT);
        soft += usize::from(step.decision == Decision::SoftBounds);
        x = moves(&x, &step.u);
    }
    assert!(soft > 0, "the push has no effect");
}

/// One workspace for two controllers with different horizons leaves no trace of the one in the plan of
/// the other. Only the warm start is the workspace's own, and it changes the time alone.
#[test]
fn controllers_that_share_a_workspace_do_not_see_each_other() {
    let mut short = settings();
    (short.horizon, short.soft_price) = (13, 2e4);
    let (mut long, mut short) = (guaranteed(settings()), guaranteed(short));
    let (mut long_alone, mut short_alone) = (long.clone(), short.clone());
    let mut shared = long.workspace::<5>();
    let (mut own, mut other) = (long.workspace::<5>(), short.workspace::<5>());
    let (mut x, mut y) = (Vector4::zeros(), Vector4::new(1.0, 0.1, 0.0, 0.0));
    let mut warm = [shared.warm_start().clone(), shared.warm_start().clone()];
    for k in 0..120 {
        if k == 40 {
            x[1] += 0.65;
        }
        shared.set_warm_start(&warm[0]);
        let step = long.step(&x, 5.0, &mut shared);
        warm[0].copy_from(shared.warm_start());
        assert_eq!(step, long_alone.step(&x, 5.0, &mut own), "sample {k}");
        x = moves(&x, &step.u);

        shared.set_warm_start(&warm[1]);
        let step = short.step(&y, -5.0, &mut shared);
        warm[1].copy_from(shared.warm_start());
        assert_eq!(step, short_alone.step(&y, -5.0, &mut other), "sample {k}");
        y = moves(&y, &step.u);
    }
}

/// A workspace without room for the horizon, or for active bounds: it is said, the inputs stay within
/// their bounds, and the terminal law and the rest of the last plan are followed all the same.
#[test]
fn a_workspace_that_is_too_small_costs_the_new_plans() {
    let room = settings().capacity();
    for (capacity, expected) in [
        (Capacity { stages: 0, ..room }, Status::HorizonTooLong),
        (Capacity { stages: N, ..room }, Status::HorizonTooLong),
        (
            Capacity {
                stages: N + 1,
                ..room
            },
            Status::HorizonTooLong,
        ),
        (Capacity { rows: 0, ..room }, Status::WorkingSetFull),
        (Capacity { active: 0, ..room }, Status::WorkingSetFull),
    ] {
        let mut controller = guaranteed(settings());
        let mut memory = GuaranteedWorkspace::<f64, 1, 5>::allocate(capacity);
        let mut x = Vector4::new(0.2, 0.05, 0.0, 0.0);
        let mut statuses = Vec::new();
        for k in 0..100 {
            if k == 60 {
                x[1] = 0.7;
            }
            let step = controller.step(&x, 20.0, &mut memory);
            assert_safe(&step);
            statuses.push(step.status);
            assert!(
                k >= 60 || step.decision.is_guaranteed(),
                "{capacity:?} {step:?}"
            );
            x = moves(&x, &step.u);
        }
        assert!(statuses.contains(&expected), "{capacity:?}: {statuses:?}");
        if expected == Status::HorizonTooLong {
            assert!(
                statuses.iter().all(|status| *status == expected),
                "{statuses:?}"
            );
        }
    }
}

/// A push beyond the bounds: soft bounds bring the pole back into what is guaranteed.
#[test]
fn after_a_push_the_bounds_are_soft_until_they_hold_again() {
    let mut controller = guaranteed(settings());
    let mut memory = controller.workspace::<5>();
    let mut x = Vector4::zeros();
    let mut seen = [0; 5];
    for k in 0..400 {
        if k == 20 {
            x += Vector4::new(0.0, 0.65, 0.0, 0.0);
        }
        let step = controller.step(&x, 0.0, &mut memory);
        assert_safe(&step);
        seen[step.decision as usize] += 1;
        x = moves(&x, &step.u);
    }
    assert!(seen[Decision::SoftBounds as usize] > 0, "{seen:?}");
    assert!(seen[Decision::NewPlan as usize] > 300, "{seen:?}");
    assert!(x.norm() < 1e-2, "{x}");
}

/// Measurements and set points that are NaN: a safe input, and business as usual afterwards.
#[test]
fn nonsense_is_survived() {
    let mut controller = guaranteed(settings());
    let mut memory = controller.workspace::<5>();
    let mut x = Vector4::new(0.1, 0.05, 0.0, 0.0);
    for k in 0..100 {
        let measured = match k {
            10 => x * f64::NAN,
            11 => x * f64::INFINITY,
            12 => x * 1e200,
            _ => x,
        };
        let wanted = if k == 20 { f64::NAN } else { 0.0 };
        let step = controller.step(&measured, wanted, &mut memory);
        assert_safe(&step);
        if measured.amax() > 1e100 || measured.iter().any(|entry| entry.is_nan()) {
            assert!(!step.decision.is_guaranteed());
        }
        x = moves(&x, &step.u);
    }
    assert!(x.norm() < 1e-2, "{x}");
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let refused = |change: fn(&mut Settings)| {
        let mut changed = settings();
        change(&mut changed);
        Guaranteed::allocate(plant(), changed).err().unwrap()
    };
    let not_positive = [
        refused(|s| s.t_s = 0.0),
        refused(|s| s.terminal.level = f64::NAN),
        refused(|s| s.offset_weight = -1.0),
        refused(|s| s.margin = 0.0),
        refused(|s| s.soft_price = f64::INFINITY),
    ];
    for error in not_positive {
        assert!(matches!(error, GuaranteedError::NotPositive(_)), "{error}");
    }
    assert_eq!(
        refused(|s| s.terminal.gain[0] = f64::NAN),
        GuaranteedError::Gain
    );
    for none in [
        refused(|s| s.set_points = [1.0, -1.0]),
        refused(|s| s.set_points = [f64::INFINITY; 2]),
        refused(|s| s.set_points = [f64::NEG_INFINITY; 2]),
        refused(|s| s.set_points = [0.0, f64::NAN]),
    ] {
        assert_eq!(none, GuaranteedError::SetPoints);
    }
    assert_eq!(
        refused(|s| s.iterations.unknown = 0),
        GuaranteedError::Iterations
    );
    for horizon in [0, N + 1] {
        let mut changed = settings();
        changed.horizon = horizon;
        let message = format!("the horizon is {horizon}; it must be from 1 to {N} samples");
        let arrays = Box::leak(Box::new(GuaranteedArrays::<f64, 4, 1, N>::default()));
        let outcome = Guaranteed::new(plant(), changed, arrays.lend());
        let error = outcome.err().unwrap();
        assert!(error.to_string().contains(&message), "{error}");
    }
    // The tilt is no direction of equilibria.
    let tilted = refused(|s| s.direction = Vector4::new(0.0, 1.0, 0.0, 0.0));
    assert_eq!(tilted, GuaranteedError::Direction);
    assert!(matches!(
        refused(|s| s.x.lower[1] = 2.0),
        GuaranteedError::Controller(_)
    ));
    assert!(tilted.to_string().contains("A d = 0"));
}
