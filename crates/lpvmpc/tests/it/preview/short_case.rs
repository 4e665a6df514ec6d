//! What is empty changes nothing, what was told to one sample is not left to the next, and it does not
//! matter where the memory is.

use super::case::{Case, Hardness};
use super::plants::{NU, NX, PENDULUM, Scheduled};
use lpvmpc::{
    Bounds, Capacity, Controller, ControllerArrays, ControllerMemory, ControllerSettings,
    GeneralRow, Iterations, List, ManyBoundsArrays, Predictor, Preview, Reference, Rk4, Scheduling,
    Solution, TerminalIngredient, Weights, Workspace, WorkspaceArrays,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};

pub type Settings = ControllerSettings<f64, 2, 1, 1>;
pub type Plan = Solution<f64, 2, 1>;
type Row = GeneralRow<f64, 2, 1>;

const N: usize = 25;

/// The pendulum's; bounded angle, soft.
pub fn settings() -> Settings {
    let weights = Weights {
        q: Matrix2::identity(),
        r: Matrix1::new(0.1),
    };
    let terminal = TerminalIngredient::Cost(Matrix2::new(147.006, 40.381, 40.381, 14.758));
    let torque = Bounds {
        lower: Vector1::new(-8.0),
        upper: Vector1::new(8.0),
    };
    let angle = Bounds {
        lower: Vector2::new(-1.2, -2.0),
        upper: Vector2::new(1.2, 2.0),
    };
    Settings::new(0.05, N, weights, terminal, torque).soft_bounds(angle)
}

fn ways() -> [Settings; 6] {
    let rk4 = Rk4 { substeps: 2 };
    let fixed = |most, predictor| Settings {
        iterations: Iterations::Fixed(most),
        predictor,
        ..settings()
    };
    [
        settings(),
        fixed(1, Predictor::FrozenRk4(rk4)),
        fixed(3, Predictor::StageConsistent(rk4)),
        fixed(1, Predictor::FrozenExact(rk4)),
        Settings {
            scheduling: Scheduling::Held(Vector1::new(1.0)),
            ..fixed(1, Predictor::FrozenRk4(rk4))
        },
        Settings {
            soft_x: [None; 2],
            terminal: TerminalIngredient::Equality,
            ..settings()
        },
    ]
}

pub fn moving(k: usize) -> Vec<Vector2<f64>> {
    let at = |i: usize| {
        let t = 0.05 * (k + i) as f64;
        Vector2::new(0.2 * t.sin(), 0.2 * t.cos())
    };
    (0..=N).map(at).collect()
}

pub fn along(states: &[Vector2<f64>]) -> Reference<'_, f64, 2> {
    let (terminal, stages) = states.split_last().unwrap();
    Reference {
        stages,
        terminal: *terminal,
    }
}

fn assert_same(found: &Plan, expected: &Plan) {
    assert_eq!(found.u, expected.u);
    assert_eq!(found.x, expected.x);
    assert_eq!(found.status, expected.status);
    assert_eq!(found.changes, expected.changes);
    assert!(found.active.iter().eq(expected.active.iter()));
}

/// Bit for bit, in one step and in two parts, with references that move and that rest.
#[test]
fn an_empty_preview_is_a_step() {
    for settings in ways() {
        let [mut short, mut long] =
            [(); 2].map(|()| Controller::allocate(PENDULUM, settings).unwrap());
        let [mut memory, mut other] = [short.workspace(), long.workspace()];
        let mut x = Vector2::new(0.6, 0.1);
        for k in 0..40 {
            let states = moving(k);
            let reference = if k % 4 < 2 {
                along(&states)
            } else {
                Reference::constant(Vector2::new(0.1, 0.0))
            };
            let preview = Preview::new(reference);
            if k % 3 == 0 {
                short.prepare(&reference, &mut memory);
                long.prepare_with(&preview, &mut other);
            }
            let expected = short.feedback(&x, &reference, &mut memory).clone();
            let found = long.feedback_with(&x, &preview, &mut other);
            assert_same(found, &expected);
            assert_eq!(long.problems(), short.problems());
            assert_eq!(long.target(), short.target());
            assert_eq!(
                long.tracking_cost_with(&x, &preview),
                short.tracking_cost(&x, &reference)
            );
            x = Rk4 { substeps: 5 }.advance(&PENDULUM, &x, &expected.u[0], 0.05);
        }
    }
}

/// After samples with everything, a step without is that of a workspace that has never seen any.
#[test]
fn nothing_is_left_for_the_next_step() {
    for seed in 0..60 {
        let case = Case::random(&mut Rng::new(seed), Hardness::Soft);
        for iterations in [Iterations::Fixed(1), Iterations::default()] {
            let settings = case.settings(iterations);
            let room = settings.capacity().with_own_stages().with_general_rows(2);
            let mut used = Controller::new(
                case.plant.clone(),
                settings,
                ControllerMemory::allocate(room),
            )
            .unwrap();
            let mut workspace = Workspace::allocate(room);
            let rows = case.row_lists();
            used.step_with(&case.x0, &case.preview(&rows), &mut workspace);
            used.reset();
            let mut fresh = Controller::allocate(case.plant.clone(), settings).unwrap();
            let mut own = fresh.workspace();
            let reference = Reference::constant(case.x_ref[0]);
            let expected = fresh.step(&case.x0, &reference, &mut own);
            let found = used.step(&case.x0, &reference, &mut workspace);
            assert_eq!(found.u, expected.u, "{seed}");
            assert_eq!(found.x, expected.x, "{seed}");
            assert_eq!(workspace.ocp().rows_per_stage, 0);
            assert!(workspace.ocp().own.is_empty());
        }
    }
}

/// Lent arrays, longer than needed, give the answers of the heap.
#[test]
fn lent_arrays_give_the_answers_of_the_heap() {
    const STAGES: usize = 14;
    const ACTIVE: usize = 200;
    type Arrays = WorkspaceArrays<f64, NX, NU, STAGES, ACTIVE, STAGES, { 3 * (STAGES + 1) }>;
    let arrays = Box::leak(Box::new(Arrays::default()));
    let many = Box::leak(Box::new(ManyBoundsArrays::<
        f64,
        NX,
        NU,
        STAGES,
        { 2 * (STAGES + 1) * (NX + NU) },
    >::default()));
    let mut lent_workspace = Workspace::new(arrays.lend().with_many_bounds(many));
    for seed in 0..60 {
        let case = Case::random(&mut Rng::new(seed), Hardness::Hard);
        let settings = case.settings(Iterations::default());
        let room = Capacity {
            rows: ACTIVE,
            active: ACTIVE,
            ..settings.capacity().with_own_stages().with_general_rows(2)
        };
        let mut heap = Controller::new(
            case.plant.clone(),
            settings,
            ControllerMemory::allocate(room),
        )
        .unwrap();
        let arrays = Box::leak(Box::new(
            ControllerArrays::<f64, NX, NU, STAGES, ACTIVE>::default(),
        ));
        let mut lent: Controller<Scheduled<f64>, f64, NX, NU, 1> =
            Controller::new(case.plant.clone(), settings, arrays.lend()).unwrap();
        let rows = case.row_lists();
        let preview = case.preview(&rows);
        let mut workspace = Workspace::allocate(room);
        let expected = heap.step_with(&case.x0, &preview, &mut workspace);
        let found = lent.step_with(&case.x0, &preview, &mut lent_workspace);
        assert_eq!(found.u, expected.u, "{seed}");
        assert_eq!(found.status, expected.status, "{seed}");
    }
}

/// Torque and angle together are bounded, hard.
fn mixed() -> Row {
    Row {
        x: Vector2::new(4.0, 0.0),
        u: Vector1::new(1.0),
        lower: -1.2,
        upper: 1.2,
        soft: None,
    }
}

/// Rows of the controller are those of every preview, in one step and in two parts, until they are
/// taken away.
#[test]
fn rows_of_the_controller_are_those_of_every_sample() {
    for settings in ways() {
        let room = settings.capacity().with_general_rows(1);
        let build =
            || Controller::new(PENDULUM, settings, ControllerMemory::allocate(room)).unwrap();
        let (mut of_controller, mut of_preview) = (build(), build());
        let [mut memory, mut other] = [(); 2].map(|()| Workspace::allocate(room));
        of_controller.set_rows(List::repeat(mixed(), 1)).unwrap();
        let mut x = Vector2::new(0.2, 0.0);
        let mut active = 0;
        for k in 0..30 {
            let states = moving(k);
            let reference = along(&states);
            let preview = Preview {
                rows: &[&[mixed()]],
                ..Preview::new(reference)
            };
            let expected = of_preview.step_with(&x, &preview, &mut other).clone();
            let found = of_controller.step(&x, &reference, &mut memory);
            assert_same(found, &expected);
            let value = mixed().x.dot(&x) + found.u[0][0];
            active += usize::from(value.abs() > 1.2 - 1e-6);
            x = Rk4 { substeps: 5 }.advance(&PENDULUM, &x, &expected.u[0], 0.05);
        }
        assert!(active > 0, "the row has to be in use");
        of_controller.set_rows(List::empty()).unwrap();
        of_controller.reset();
        let mut without = Controller::allocate(PENDULUM, settings).unwrap();
        let mut own = without.workspace();
        let states = moving(0);
        let expected = without.step(&x, &along(&states), &mut own);
        assert_same(
            of_controller.step(&x, &along(&states), &mut memory),
            expected,
        );
    }
}

/// Of the controller's rows, `prepare` and `feedback` are a step of the paper's loop.
#[test]
fn rows_of_the_controller_hold_in_two_parts() {
    let settings = Settings {
        iterations: Iterations::Fixed(1),
        ..settings()
    };
    let room = settings.capacity().with_general_rows(1);
    let [mut whole, mut parts] = [(); 2].map(|()| {
        let memory = ControllerMemory::allocate(room);
        let mut controller = Controller::new(PENDULUM, settings, memory).unwrap();
        controller.set_rows(List::repeat(mixed(), 1)).unwrap();
        controller
    });
    let [mut memory, mut other] = [(); 2].map(|()| Workspace::allocate(room));
    let mut x = Vector2::new(0.2, 0.0);
    for k in 0..30 {
        let states = moving(k);
        let reference = along(&states);
        parts.prepare(&reference, &mut other);
        let found = parts.feedback(&x, &reference, &mut other).u.clone();
        let expected = &whole.step(&x, &reference, &mut memory).u;
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).amax() < 1e-10, "sample {k}");
        }
        x = Rk4 { substeps: 5 }.advance(&PENDULUM, &x, &found[0], 0.05);
    }
}

/// The settings' weights and bounds, told as lists of one entry, change nothing: bit for bit, on far
/// starts whose programs are damped, too.
#[test]
fn the_settings_told_anew_are_the_settings() {
    let mut rng = Rng::new(77);
    for settings in ways() {
        let room = settings.capacity().with_own_stages();
        for _ in 0..40 {
            let mut short = Controller::allocate(PENDULUM, settings).unwrap();
            let mut long =
                Controller::new(PENDULUM, settings, ControllerMemory::allocate(room)).unwrap();
            let [mut memory, mut other] = [(); 2].map(|()| Workspace::allocate(room));
            let mut x = Vector2::new(rng.uniform(-3.0, 3.0), rng.uniform(-6.0, 6.0));
            let reference = Reference::constant(Vector2::new(rng.uniform(-0.5, 0.5), 0.0));
            let preview = Preview {
                weights: &[settings.weights],
                terminal: Some(settings.terminal),
                x: &[settings.x],
                soft_x: &[settings.soft_x],
                u: &[settings.u],
                models: &[PENDULUM],
                ..Preview::new(reference)
            };
            for _ in 0..3 {
                let expected = short.step(&x, &reference, &mut memory).clone();
                let found = long.step_with(&x, &preview, &mut other);
                assert_same(found, &expected);
                assert_eq!(long.problems(), short.problems());
                x = Rk4 { substeps: 5 }.advance(&PENDULUM, &x, &expected.u[0], 0.05);
            }
        }
    }
}

/// The target of a sample under a disturbance is not that of the next one without.
#[test]
fn the_target_is_that_of_its_sample() {
    let mut controller = Controller::allocate(PENDULUM, settings()).unwrap();
    let mut workspace = controller.workspace();
    let x = Vector2::new(0.1, 0.0);
    let reference = Reference::constant(Vector2::zeros());
    let pushed = Preview {
        disturbance: &[Vector2::new(0.0, 2.0)],
        ..Preview::new(reference)
    };
    for _ in 0..2 {
        controller.step(&x, &reference, &mut workspace);
        assert!(controller.target().unwrap().u.amax() < 1e-6);
        controller.step_with(&x, &pushed, &mut workspace);
        assert!((controller.target().unwrap().u[0] + 2.0).abs() < 1e-6);
    }
}
