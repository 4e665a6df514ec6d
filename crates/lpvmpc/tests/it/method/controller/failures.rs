//! Samples that go wrong: the status says how, the input can be applied all the same, and the
//! next good sample is as good as ever.

use super::{along, assert_safe, controller, moving, settings, tilted};
use lpvmpc::{
    Bounds, ControllerSettings, Quantity, Reference, Scheduling, Side, Solution, Status,
    TerminalIngredient,
};
use nalgebra::{Vector1, Vector2, Vector4};

const N: usize = 15;

/// States with one entry that is no finite number.
fn broken_states() -> impl Iterator<Item = Vector4<f64>> {
    let entries = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    (0..4).flat_map(move |component| {
        entries.map(|entry| {
            let mut x = tilted();
            x[component] = entry;
            x
        })
    })
}

/// Bounds that do not contain zero, so that zero is no way out.
fn always_pushing() -> Bounds<f64, 1> {
    Bounds {
        lower: Vector1::new(2.0),
        upper: Vector1::new(15.0),
    }
}

/// A state with a NaN, in the first sample, after good ones, and several in a row.
#[test]
fn a_state_that_is_not_finite() {
    let upright = Scheduling::Held(Vector2::zeros());
    for scheduling in [Scheduling::Predicted, upright] {
        for u in [settings(N).u, always_pushing()] {
            for broken in broken_states() {
                survives_broken_states(
                    ControllerSettings {
                        scheduling,
                        u,
                        ..settings(N)
                    },
                    &broken,
                );
            }
        }
    }
}

fn survives_broken_states(settings: ControllerSettings<f64, 4, 1, 2>, broken: &Vector4<f64>) {
    let states = moving(N, 0);
    let reference = along(&states);
    let mut fresh = controller(settings);
    let mut workspace = fresh.workspace();
    let expected = fresh.step(&tilted(), &reference, &mut workspace).clone();

    let mut tried = controller(settings);
    for good_samples in [0, 3] {
        for _ in 0..good_samples {
            tried.step(&tilted(), &reference, &mut workspace);
        }
        for _ in 0..2 {
            let plan = tried.step(broken, &reference, &mut workspace);
            assert_eq!(plan.status, Status::NotFinite, "{broken}");
            assert!(plan.active.is_empty());
            assert_safe(plan, &settings.u);
        }
        // There is no past to build on: the next good sample is a first one.
        let plan = tried.step(&tilted(), &reference, &mut workspace);
        assert_eq!(plan, &expected, "{broken}");
    }
}

/// A finite but absurd sample. The window of the next one comes from its rollout (Algorithm 2), so
/// that plan may be of no use either; the one after it is built on good states alone.
#[test]
fn a_spike_is_forgotten_after_one_good_sample() {
    let states = moving(N, 0);
    let reference = along(&states);
    let mut workspace = controller(settings(N)).workspace();
    for component in 0..4 {
        for spike in [1e3, -1e6, 1e20, -1e200, f64::MAX] {
            let mut tried = controller(settings(N));
            let mut x = tilted();
            x[component] = spike;
            for state in [tilted(), x, tilted()] {
                let plan = tried.step(&state, &reference, &mut workspace);
                assert_safe(plan, &settings(N).u);
            }
            let plan = tried.step(&tilted(), &reference, &mut workspace);
            assert_eq!(plan.status, Status::Solved, "{spike:e} in {component}");
            assert_safe(plan, &settings(N).u);
        }
    }
}

/// `reset` forgets the last plan's inputs too: a broken first sample must not replay them.
#[test]
fn a_broken_state_after_a_reset_is_a_broken_first_sample() {
    let states = moving(N, 0);
    let reference = along(&states);
    let mut workspace = controller(settings(N)).workspace();
    for broken in broken_states() {
        let mut fresh = controller(settings(N));
        let expected = &fresh.step(&broken, &reference, &mut workspace).u;
        let mut used = controller(settings(N));
        used.step(&tilted(), &reference, &mut workspace);
        used.reset();
        let plan = used.step(&broken, &reference, &mut workspace);
        assert_eq!(&plan.u, expected, "{broken}");
    }
}

#[test]
fn a_reference_that_is_not_finite() {
    for terminal in [settings(N).terminal, TerminalIngredient::Equality] {
        let settings = ControllerSettings {
            terminal,
            ..settings(N)
        };
        let mut tried = controller(settings);
        let mut workspace = tried.workspace();
        let x = Vector4::new(0.0, 0.1, 0.0, 0.0);
        for entry in [f64::NAN, f64::INFINITY] {
            for (stage, component) in [(N / 2, 0), (N, 1)] {
                let good = moving(N, 0);
                let mut broken = good.clone();
                broken[stage][component] = entry;
                let plan = tried.step(&x, &along(&broken), &mut workspace);
                assert_eq!(plan.status, Status::NotFinite);
                assert_safe(plan, &settings.u);
                let plan = tried.step(&x, &along(&good), &mut workspace);
                assert_eq!(plan.status, Status::Solved);
            }
        }
    }
}

/// In 15 samples of 0.05 s a force of 15 N moves 1.3 kg by some 3 m; 100 m are asked for.
#[test]
fn a_terminal_equality_that_cannot_be_met() {
    let settings = ControllerSettings {
        terminal: TerminalIngredient::Equality,
        ..settings(N)
    };
    let mut tried = controller(settings);
    let mut workspace = tried.workspace();
    let far = Reference::constant(Vector4::new(100.0, 0.0, 0.0, 0.0));
    let x = Vector4::new(0.0, 0.02, 0.0, 0.0);
    let plan = tried.step(&x, &far, &mut workspace);
    assert_safe(plan, &settings.u);
    let Status::Infeasible(bound) = plan.status else {
        panic!("{}", plan.status);
    };
    // It is a bound that the program has, and no force: those alone contradict nothing.
    match (bound.quantity, bound.side) {
        (Quantity::State(0), Side::Lower | Side::Upper) => {
            assert!((1..=N).contains(&bound.stage));
        }
        (Quantity::State(0..4), Side::Equality) => assert_eq!(bound.stage, N),
        other => panic!("{other:?} is not bounded"),
    }
    let message = plan.status.to_string();
    assert!(message.starts_with("infeasible: "), "{message}");
    assert!(
        message.contains(&format!("stage {}", bound.stage)),
        "{message}"
    );

    let near = Reference::constant(Vector4::zeros());
    let plan = tried.step(&x, &near, &mut workspace);
    assert_eq!(plan.status, Status::Solved);
}

/// The track's end is behind the cart, which drives on.
#[test]
fn a_state_bound_that_cannot_be_met() {
    let mut tried = controller(settings(N));
    let beyond = Vector4::new(3.0, 0.0, 1.0, 0.0);
    let mut workspace = tried.workspace();
    let plan = tried.step(&beyond, &along(&moving(N, 0)), &mut workspace);
    assert_safe(plan, &settings(N).u);
    let Status::Infeasible(bound) = plan.status else {
        panic!("{}", plan.status);
    };
    // The track, not the force that cannot keep to it, and where it is first exceeded.
    assert_eq!(
        (bound.quantity, bound.stage),
        (Quantity::State(0), 1),
        "{bound}"
    );
}

/// The answer at full room, and that it needs several changes and rows.
fn full_answer() -> Solution<f64, 4, 1> {
    let mut full = controller(settings(N));
    let mut workspace = full.workspace();
    let plan = full.step(&tilted(), &along(&moving(N, 0)), &mut workspace);
    assert_eq!(plan.status, Status::Solved);
    assert!(plan.changes >= 2 && plan.active.len() >= 2);
    plan.clone()
}

#[test]
fn the_cap_on_changes_is_kept() {
    let needed = full_answer().changes;
    for max_changes in 0..=needed {
        let mut settings = settings(N);
        settings.solver.max_changes = Some(max_changes);
        let mut tried = controller(settings);
        let mut workspace = tried.workspace();
        let plan = tried.step(&tilted(), &along(&moving(N, 0)), &mut workspace);
        assert_safe(plan, &settings.u);
        assert!(plan.changes <= max_changes);
        if max_changes < needed {
            assert_eq!(plan.status, Status::MaxChanges);
        } else {
            assert_eq!(plan, &full_answer());
        }
    }
}
