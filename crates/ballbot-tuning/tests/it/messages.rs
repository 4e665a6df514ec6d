//! What makes no sense is refused with its key, its value and what would be right.

use crate::{PROGRAM, TWO_GOALS};
use ballbot_tuning::{Tuning, TuningSource};
use std::fs;

fn message(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tuning.toml");
    fs::write(&path, text).unwrap();
    let source = match TuningSource::load(&path) {
        Ok(source) => source,
        Err(error) => return error.to_string(),
    };
    match Tuning::new(&source, source.folder(), PROGRAM) {
        Ok(_) => panic!("{text} is taken"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn mistakes_are_named() {
    for (from, to, parts) in [
        (
            "patience = 3",
            "patiense = 3",
            ["patiense", "did you mean `patience`?"],
        ),
        (
            "measure = \"rms_error_rad\"",
            "measure = \"rms_eror_rad\"",
            ["rms_eror_rad", "did you mean `rms_error_rad`?"],
        ),
        (
            "statistic = \"mean\"",
            "statistic = \"men\"",
            ["men", "did you mean `mean`?"],
        ),
        (
            "log_uniform = [20.0",
            "log_unifrom = [20.0",
            ["log_unifrom", "did you mean `log_uniform`?"],
        ),
        (
            "\"controller.horizon\" =",
            "\"controller.horizn\" =",
            ["controller.horizn", "say one with `start`"],
        ),
        (
            "{ integers = [8, 24] }",
            "{ integers = [24, 8] }",
            ["integers = [24, 8]", "the smaller one first"],
        ),
        (
            "{ integers = [8, 24] }",
            "{ integers = [8, 12] }",
            [
                "parameters.\"controller.horizon\" = 20",
                "not among the values",
            ],
        ),
        (
            "{ integers = [8, 24] }",
            "{ uniform = [8.0, 24.0] }",
            ["horizon", "whole number"],
        ),
        (
            "{ integers = [8, 24] }",
            "{ }",
            ["controller.horizon", "exactly one"],
        ),
        (
            "log_uniform = [100.0",
            "log_uniform = [-100.0",
            ["controller.r", "positive"],
        ),
        (
            "\"controller.r\" =",
            "\"controller.q\" =",
            ["controller.q", "parameters has a value for it already"],
        ),
        (
            "\"controller.r\" =",
            "\"duration_s\" =",
            ["duration_s", "worlds.set has a value"],
        ),
        (
            "\"controller.r\" =",
            "\"initial_state.theta_rad\" =",
            ["initial_state.theta_rad", "worlds.vary has a value"],
        ),
        (
            "measure = \"rms_error_rad\"\n",
            "",
            ["goal[0].measure = (absent)", "needs a measure"],
        ),
        (
            "measure = \"rms_error_rad\"",
            "measure = \"mean_step_us\"",
            ["goal[0].measure = mean_step_us", "differs"],
        ),
        (
            "measure = \"rms_error_rad\"",
            "measure = \"closed_loop_cost\"",
            ["closed_loop_cost", "own weights"],
        ),
        (
            "measure = \"rms_torque_nm\"\nstatistic = \"worst\"",
            "measure = \"rms_error_rad\"\nstatistic = \"mean\"\nat_most = 0.1",
            ["goal[1] = ", "goal[0] is the same; leave one of them out"],
        ),
        (
            "statistic = \"worst\"",
            "statistic = { quantile = 1.5 }",
            ["goal[1].statistic.quantile = 1.5", "below 1"],
        ),
        (
            "at_most = 0.0\n",
            "at_most = -1.0\n",
            ["limit[0].at_most = -1.0", "0 or more"],
        ),
        (
            "[held_out]",
            "[held_out]\nseed = 1",
            ["held_out.seed = 1", "differ"],
        ),
        (
            "runs = 6",
            "runs = 0",
            ["held_out.runs = 0", "it must be from 1"],
        ),
        (
            "[held_out]",
            "[held_out]\nconfidence = 95",
            ["held_out.confidence = 95.0", "0.95"],
        ),
        (
            "evaluations = 60",
            "evaluations = 35",
            ["search.evaluations = 35", "from 36, for the start"],
        ),
        (
            "patience = 3",
            "step = 0.0",
            ["search.step = 0.0", "above 0"],
        ),
        (
            "patience = 3",
            "patience = 10001",
            ["search.patience = 10001", "from 1 to 10000 generations"],
        ),
        (
            "uniform = [-0.1, 0.1]",
            "uniform = [0.1, -0.1]",
            ["vary[0]", "the smaller one first"],
        ),
        (
            "single-setpoint-terminal",
            "single-setpoint-termnal",
            ["unknown scenario", "did you mean"],
        ),
    ] {
        assert!(TWO_GOALS.contains(from), "{from}");
        let said = message(&TWO_GOALS.replacen(from, to, 1));
        for part in parts {
            assert!(said.contains(part), "{to}: {said}");
        }
    }
    let goals = TWO_GOALS.to_owned()
        + &"[[goal]]\nmeasure = \"settling_s\"\nstatistic = \"mean\"\n".repeat(2);
    assert!(
        message(&goals).contains("goal = (4): 1 to 3 goals"),
        "{}",
        message(&goals)
    );
}

/// A candidate with a longer sampling time won with fewer samples to be summed or counted, and `also` hid
/// weights.
#[test]
fn what_does_not_mean_the_same_for_all_candidates_is_refused() {
    let of_period = TWO_GOALS
        .replace(
            "\"controller.q.0\" = { log_uniform = [20.0, 2000.0] }\n",
            "",
        )
        .replace(
            "\"controller.r\" = { log_uniform = [100.0, 10000.0] }",
            "\"controller.t_s\" = { list = [0.025, 0.05] }",
        );
    let goal = "measure = \"rms_torque_nm\"";
    let success = "largest_tilt_rad.at_most = 0.6";
    for (from, to, parts) in [
        (
            goal,
            "measure = \"closed_loop_cost\"",
            [
                "goal[1].measure = closed_loop_cost",
                "a longer controller.t_s",
            ],
        ),
        (
            goal,
            "measure = \"violations\"",
            ["goal[1].measure = violations", "a longer controller.t_s"],
        ),
        (
            success,
            "infeasible.at_most = 3",
            ["worlds.success.infeasible", "a longer controller.t_s"],
        ),
    ] {
        let said = message(&of_period.replace(from, to));
        for part in parts {
            assert!(said.contains(part), "{to}: {said}");
        }
    }
    let none = of_period
        .replace(success, "violations.at_most = 0")
        .replace(
            "statistic = \"failure_share\"",
            "measure = \"infeasible\"\nstatistic = \"worst\"",
        );
    let (_folder, source) = crate::written(&none);
    Tuning::new(&source, source.folder(), PROGRAM).unwrap();

    let hidden = of_period
        .replace(goal, "measure = \"closed_loop_cost\"")
        .replace(
            "\"controller.t_s\" = { list = [0.025, 0.05] }",
            "\"initial_state.phi_dot_rad_s\" = { uniform = [0.0, 9.0], start = 1.0, also = [\"controller.q.0\"] }",
        );
    let said = message(&hidden);
    assert!(said.contains("own weights"), "{said}");
}

/// A table in `[worlds.set]` used to stand for all keys below it.
#[test]
fn beside_a_key_of_the_worlds_another_one_of_the_same_table_is_searched_over() {
    let text = TWO_GOALS.replace(
        "[worlds.set]\nduration_s = 1.0",
        "[worlds.set]\nduration_s = 1.0\ncontroller.model = \"linear\"",
    );
    assert_ne!(text, TWO_GOALS);
    let (_folder, source) = crate::written(&text);
    Tuning::new(&source, source.folder(), PROGRAM).unwrap();
    let twice = text.replace("controller.model = \"linear\"", "controller.r = 900.0");
    let message = message(&twice);
    for part in ["controller.r", "worlds.set has a value"] {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}
