//! What no other candidate is better than.

use crate::judge::Outcome;

/// Whether one is at least as good in all goals, and better in one.
pub fn dominates(one: &Outcome, other: &Outcome) -> bool {
    let pairs = || one.goals.iter().zip(&other.goals);
    pairs().all(|(a, b)| a <= b) && pairs().any(|(a, b)| a < b)
}

/// The places of those that keep all limits and that no other one of these dominates, in their order;
/// of equal ones the first. Lower bounds are left out.
pub fn front(outcomes: &[Outcome]) -> Vec<usize> {
    let counts = |outcome: &Outcome| outcome.exact && outcome.violation == 0.0;
    let all = || {
        outcomes
            .iter()
            .enumerate()
            .filter(|(_, outcome)| counts(outcome))
    };
    let is_in_front = |(place, outcome): &(usize, &Outcome)| {
        !all().any(|(other_place, other)| {
            dominates(other, outcome) || (other_place < *place && other.goals == outcome.goals)
        })
    };
    all().filter(is_in_front).map(|(place, _)| place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_dominated_repeated_or_outside_a_limit_is_not_in_front() {
        let outcome = |goals: [f64; 2], violation| Outcome {
            goals: goals.into(),
            violation,
            exact: true,
        };
        let mut all = [
            outcome([1.0, 3.0], 0.0),
            outcome([2.0, 2.0], 0.0),
            outcome([2.0, 3.0], 0.0), // behind both
            outcome([0.0, 0.0], 0.1), // keeps no limit
            outcome([2.0, 2.0], 0.0), // again
            outcome([3.0, 0.5], 0.0),
        ];
        assert_eq!(front(&all), [0, 1, 5]);
        all[5].exact = false;
        assert_eq!(front(&all), [0, 1]);
    }
}
