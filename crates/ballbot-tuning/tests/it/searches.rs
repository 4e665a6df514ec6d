//! The search on functions whose optimum or front is known.

use ballbot_tuning::{
    Outcome, Plan, Problem, SearchEnd, Searched, front, search, value, weightings,
};
use std::convert::Infallible;

/// A function of points, with what was asked of it.
struct Known<F> {
    function: F,
    points: Vec<Vec<f64>>,
    outcomes: Vec<Outcome>,
    /// How many were left because they are hopeless.
    left: usize,
}

impl<F: Fn(&[f64]) -> Outcome> Problem for Known<F> {
    type Error = Infallible;

    fn evaluate(
        &mut self,
        points: &[Vec<f64>],
        is_hopeless: &(dyn Fn(&Outcome) -> bool + Sync),
    ) -> Result<Vec<Outcome>, Infallible> {
        let all = points.iter().map(|point| {
            assert!(point.iter().all(|u| (0.0..=1.0).contains(u)), "{point:?}");
            let outcome = (self.function)(point);
            // Half of what it is, as half of its runs would say.
            let bound = Outcome {
                goals: outcome.goals.iter().map(|goal| 0.5 * goal).collect(),
                violation: 0.5 * outcome.violation,
                exact: false,
            };
            let outcome = if is_hopeless(&bound) { bound } else { outcome };
            self.left += usize::from(!outcome.exact);
            self.points.push(point.clone());
            self.outcomes.push(outcome.clone());
            outcome
        });
        Ok(all.collect())
    }

    fn evaluations(&self) -> u64 {
        self.points.len() as u64
    }
}

fn outcome(goals: &[f64], violation: f64) -> Outcome {
    Outcome {
        goals: goals.to_vec(),
        violation,
        exact: true,
    }
}

fn plan(goals: usize, dimensions: usize, evaluations: u64) -> Plan {
    Plan {
        weightings: weightings(goals),
        evaluations,
        population: 4 + (3.0 * (dimensions as f64).ln()) as usize,
        step: 0.2,
        patience: 60,
        seed: 7,
    }
}

/// Searches from a start.
fn run<F: Fn(&[f64]) -> Outcome>(
    plan: &Plan,
    start: &[f64],
    function: F,
) -> (Known<F>, Vec<Searched>) {
    let first = function(start);
    let mut known = Known {
        function,
        points: vec![start.to_vec()],
        outcomes: vec![first.clone()],
        left: 0,
    };
    let Ok(searches) = search(plan, (start.to_vec(), first), &mut known);
    (known, searches)
}

/// The best point of all that were evaluated as a whole.
fn best<F>(known: &Known<F>) -> &[f64] {
    let exact = known
        .outcomes
        .iter()
        .zip(&known.points)
        .filter(|(outcome, _)| outcome.exact);
    let of = |outcome: &Outcome| value(outcome, &[1.0]);
    let least = exact.min_by(|a, b| of(a.0).total_cmp(&of(b.0)));
    least.unwrap().1
}

#[test]
fn the_optimum_of_a_long_ellipsoid_is_found() {
    let optimum = [0.3, 0.8, 0.45, 0.6];
    let ellipsoid = |x: &[f64]| {
        // Turned, so that no axis is one of its own.
        let turned = [x[0] + x[1], x[0] - x[1], x[2] + x[3], x[2] - x[3]];
        let centre = [1.1, -0.5, 1.05, -0.15];
        let terms = turned.iter().zip(centre).zip([1.0, 100.0, 10.0, 1000.0]);
        outcome(
            &[terms.map(|((x, c), scale)| scale * (x - c).powi(2)).sum()],
            0.0,
        )
    };
    let (known, _) = run(&plan(1, 4, 1500), &[0.9, 0.1, 0.9, 0.1], ellipsoid);
    for (found, optimum) in best(&known).iter().zip(optimum) {
        assert!((found - optimum).abs() < 1e-3, "{:?}", best(&known));
    }
    assert!(
        known.left > 100,
        "candidates were left early: {}",
        known.left
    );
}

/// The nearest point of a half-plane, from a start outside of it.
#[test]
fn a_limit_is_kept_and_the_optimum_lies_on_it() {
    let function = |x: &[f64]| {
        let distance = (x[0] - 0.2).hypot(x[1] - 0.2);
        outcome(&[distance], (1.0 - x[0] - x[1]).max(0.0))
    };
    let (known, _) = run(&plan(1, 2, 800), &[0.1, 0.3], function);
    let found = best(&known);
    assert!(found[0] + found[1] >= 1.0, "{found:?}");
    for x in found {
        assert!((x - 0.5).abs() < 2e-3, "{found:?}");
    }
}

/// Of the distances from two points the front is known: their sum is the distance of the points.
#[test]
fn the_front_of_two_distances_is_found_along_its_length() {
    let (one, other) = ([0.2, 0.3, 0.5], [0.8, 0.7, 0.4]);
    let distance = |x: &[f64], from: [f64; 3]| {
        x.iter()
            .zip(from)
            .map(|(x, from)| (x - from).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let function = |x: &[f64]| outcome(&[distance(x, one), distance(x, other)], 0.0);
    let (known, searches) = run(&plan(2, 3, 1200), &[0.5, 0.1, 0.9], function);
    assert_eq!(searches.len(), 5);
    let whole = distance(&one, other);
    let front = front(&known.outcomes);
    let goals = |place: &usize| &known.outcomes[*place].goals;
    // Close to the front at its middle and near its ends.
    for share in [0.1, 0.25, 0.5, 0.75, 0.9] {
        let near = front.iter().map(|place| {
            let goals = goals(place);
            (goals[0] - share * whole).hypot(goals[1] - (1.0 - share) * whole)
        });
        let nearest = near.fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.05 * whole, "{share}: {nearest} of {whole}");
    }
    // What is in front is no worse than something else, checked one by one.
    for place in &front {
        let sum: f64 = goals(place).iter().sum();
        assert!(sum >= whole - 1e-12);
        assert!(known.outcomes.iter().all(|other| {
            !other.exact || other.goals[0] >= goals(place)[0] || other.goals[1] >= goals(place)[1]
        }));
    }
}

#[test]
fn the_seed_alone_decides() {
    let function = |x: &[f64]| outcome(&[(x[0] - 0.3).abs() + (x[1] - 0.6).abs()], 0.0);
    let with_seed = |seed| {
        let plan = Plan {
            seed,
            ..plan(1, 2, 100)
        };
        run(&plan, &[0.5, 0.5], function).0.points
    };
    assert_eq!(with_seed(1), with_seed(1));
    assert_ne!(with_seed(1), with_seed(2));
}

#[test]
fn a_search_ends_for_a_reason() {
    let end = |plan: &Plan, function: fn(&[f64]) -> Outcome| {
        let (known, searches) = run(plan, &[0.5, 0.5], function);
        (searches[0].end, known.evaluations())
    };
    let short = Plan {
        patience: 4,
        ..plan(1, 2, 2000)
    };
    // Flat: nothing is ever better.
    let (ended, evaluations) = end(&short, |_| outcome(&[1.0], 0.0));
    assert_eq!((ended, evaluations), (SearchEnd::NoImprovement, 1 + 4 * 6));
    // A target that is reached.
    let (ended, evaluations) = end(&short, |x| outcome(&[(x[0] - 0.4).max(0.0)], 0.0));
    assert!(
        ended == SearchEnd::Reached && evaluations < 50,
        "{ended:?} {evaluations}"
    );
    // A generation that would exceed the budget is not begun.
    let (ended, evaluations) = end(&plan(1, 2, 30), |x| outcome(&[1.0 + x[0] + x[1]], 0.0));
    assert_eq!((ended, evaluations), (SearchEnd::Budget, 25));
}

#[test]
fn values_rank_as_they_should() {
    let [better, worse] =
        [[1.0, 2.0], [1.5, 2.0]].map(|goals| value(&outcome(&goals, 0.0), &[0.5, 0.5]));
    // The worst goal is the same, the other one tells them apart.
    assert!(better < worse && worse < 1.0);
    let [near, far] =
        [0.1, 0.2].map(|violation| value(&outcome(&[0.0, 0.0], violation), &[0.5, 0.5]));
    assert!(worse < near && near < far);
    let refused = value(&outcome(&[f64::INFINITY, 0.0], f64::INFINITY), &[0.5, 0.5]);
    assert_eq!(refused, 2.0);
}

#[test]
fn weightings_are_a_lattice_from_its_middle_out() {
    assert_eq!(weightings(1), [[1.0]]);
    let two = weightings(2);
    assert_eq!((two.len(), two[0].as_slice()), (5, [0.5, 0.5].as_slice()));
    assert!(two.contains(&vec![1.0, 0.02]) && two.contains(&vec![0.25, 0.75]));
    let three = weightings(3);
    assert_eq!(three.len(), 10);
    assert!(
        three[0]
            .iter()
            .all(|weight| (weight - 1.0 / 3.0).abs() < 1e-12)
    );
}
