//! A small campaign: what is guaranteed holds, and the negative control fails.

use ballbot_scenario::Scenario;
use ballbot_studies::{Campaign, Outcome, Scenarios, Variant};
use std::path::Path;

const SMALL: Campaign = Campaign {
    runs: 200,
    other_runs: 20,
    samples: 60,
    seed: 7,
    threads: 0,
};

fn of(outcomes: &[Outcome], wanted: impl Fn(&Variant) -> bool) -> &Outcome {
    outcomes
        .iter()
        .find(|outcome| wanted(&outcome.variant))
        .unwrap()
}

/// Of any horizon that a scenario may have.
#[test]
fn a_campaign_runs_at_the_scenario_s_own_horizon() {
    let mut scenario = Scenario::load("far-setpoints").unwrap();
    scenario.controller.horizon = 80;
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    let few = Campaign {
        runs: 2,
        other_runs: 1,
        samples: 10,
        ..SMALL
    };
    let outcomes = few.run(&Scenarios::of(prepared).unwrap(), &|_| ()).unwrap();
    let nominal = of(&outcomes, |variant| *variant == Variant::Nominal).tally;
    assert_eq!((nominal.total.samples, nominal.broken_promises()), (20, 0));
}

#[test]
fn the_nominal_loop_keeps_its_promise_and_the_paper_s_scheme_does_not() {
    let outcomes = SMALL.run(&Scenarios::built_in().unwrap(), &|_| ()).unwrap();
    let nominal = of(&outcomes, |variant| *variant == Variant::Nominal).tally;
    assert_eq!(nominal.runs, 200);
    assert_eq!(nominal.total.samples, 200 * 60);
    assert_eq!(nominal.runs_within_bounds, 200);
    assert_eq!(nominal.total.infeasible, 0);
    assert_eq!(nominal.total.violations, 0);
    assert_eq!(nominal.total.cost_growths, 0);
    // The search for something better is no formality.
    assert!(nominal.total.decisions[0] > nominal.total.samples / 2);

    // Whatever the set points and the horizon.
    for Outcome { variant, tally, .. } in &outcomes {
        assert!(
            !variant.is_nominal() || tally.broken_promises() == 0,
            "{variant}: {tally:?}"
        );
    }

    let paper = of(&outcomes, |variant| matches!(variant, Variant::Paper(_))).tally;
    assert!(paper.total.infeasible > 0, "{paper:?}");
    assert!(paper.runs_within_bounds < paper.runs / 2, "{paper:?}");
    // Nothing is guaranteed with wrong parameters; that the cost never grows is the first to go.
    let wrong = of(&outcomes, |variant| *variant == Variant::Parameters(0.2)).tally;
    assert!(wrong.total.cost_growths > 0, "{wrong:?}");
}

/// The same seed gives the same numbers, bit for bit, on one thread and on four.
#[test]
fn the_number_of_threads_changes_nothing() {
    let few = Campaign {
        runs: 8,
        other_runs: 4,
        samples: 30,
        seed: 3,
        threads: 1,
    };
    let scenarios = Scenarios::built_in().unwrap();
    let on = |threads| {
        Campaign { threads, ..few }
            .run(&scenarios, &|_| ())
            .unwrap()
    };
    let one = on(1);
    assert_eq!(one, on(4));
    let other = Campaign { seed: 4, ..few }
        .run(&scenarios, &|_| ())
        .unwrap();
    assert_ne!(one[0].records, other[0].records);
}

/// Starts were drawn around phi = 0, wherever the bounds are.
#[test]
fn a_campaign_starts_within_bounds_that_are_not_around_zero() {
    for bounds in [[5.0, 50.0], [-1.0, 50.0]] {
        let mut scenario = Scenario::load("far-setpoints").unwrap();
        scenario.bounds.phi_rad = bounds;
        let few = Campaign {
            runs: 20,
            other_runs: 1,
            samples: 30,
            ..SMALL
        };
        let scenarios = Scenarios::of(scenario.prepare(Path::new(".")).unwrap()).unwrap();
        let outcomes = few.run(&scenarios, &|_| ()).unwrap();
        for Outcome { variant, tally, .. } in outcomes {
            let broken = tally.broken_promises();
            assert!(!variant.is_nominal() || broken == 0, "{variant}: {tally:?}");
        }
    }
}
