//! What makes no sense is refused with its key, its value and what would be right.

use crate::{NOISY, PROGRAM, written};
use ballbot_campaign::{Campaign, Source};

fn message(text: &str) -> String {
    let (_folder, path) = written(text);
    let source = match Source::load(&path) {
        Ok(source) => source,
        Err(error) => return error.to_string(),
    };
    match Campaign::new(&source, source.folder(), PROGRAM) {
        Ok(_) => panic!("{text} is taken"),
        Err(error) => error.to_string(),
    }
}

/// `NOISY` with one part replaced.
fn edited(from: &str, to: &str) -> String {
    assert!(NOISY.contains(from), "{from}");
    NOISY.replacen(from, to, 1)
}

#[test]
fn mistakes_are_named() {
    for (text, parts) in [
        (edited("seed = 3", "sede = 3"), ["sede", "seed"]),
        (edited("runs = 24", "runs = 0"), ["runs = 0", "from 1"]),
        (edited("runs = 24\n", ""), ["runs = (absent)", "grid"]),
        (
            edited("single-setpoint", "no-such"),
            ["no-such", "unknown scenario"],
        ),
        (
            edited("controller.horizon", "controller.horizn"),
            ["horizn", "horizon"],
        ),
        (
            edited("integers = [10, 30]", "uniform = [10.0, 30.0]"),
            ["horizon", "whole number"],
        ),
        (
            edited("[0.0, 0.1]", "[-0.2, -0.1]"),
            ["run 0 draws", "world.delay.transport_s"],
        ),
        (
            edited("\"initial_state.theta_rad\"", "\"controller.horizon\""),
            ["vary.key", "varies it already"],
        ),
        (
            edited("duration_s = 1.0", "\"controller.horizon\" = 4"),
            ["set.controller.horizon", "varies"],
        ),
        (
            // It was ignored.
            edited("duration_s = 1.0", "\"controller.q.0\" = 9.0")
                + "[[vary]]\nkey = \"controller.q\"\nlist = [[1.0, 1.0, 1.0, 1.0]]\n",
            [
                "set.controller.q.0 = 9.0",
                "stands in `controller.q`, which varies",
            ],
        ),
        (
            // All runs used to be failures.
            edited(
                "largest_tilt_rad.at_most = 0.5",
                "not_guaranteed.at_most = 0",
            ),
            ["success.not_guaranteed", "no guarantee"],
        ),
        (
            edited("largest_tilt_rad.at_most = 0.5", "settling_s.at_most = 0.5")
                .replace("\"single-setpoint\"", "\"lissajous\"")
                .replace("initial_state.theta_rad", "world.floor.slope_x_deg"),
            ["success.settling_s", "changes until the end"],
        ),
        (
            edited("runs = 24\n", "").replace("[success]\nlargest_tilt_rad.at_most = 0.5\n", "")
                + "[rare]\nmeasure = \"not_guaranteed\"\nabove = 0.0\n",
            ["rare.measure = not_guaranteed", "no guarantee"],
        ),
        (
            edited("largest_tilt_rad.at_most", "largest_tilt.at_most"),
            ["largest_tilt", "largest_tilt_rad"],
        ),
        (
            edited("largest_tilt_rad.at_most = 0.5", "largest_tilt_rad = {}"),
            ["success.largest_tilt_rad", "at_least"],
        ),
        (
            edited("largest_tilt_rad.at_most", "mean_step_us.at_most"),
            ["success.mean_step_us", "differs"],
        ),
        (
            edited("seed = 3", "seed = 3\nmeasure = [\"end_s\"]"),
            ["success.largest_tilt_rad", "`measure`"],
        ),
        (
            edited("seed = 3", "seed = 3\nmeasure = [\"end_s\", \"end_s\"]"),
            ["measure = end_s", "twice"],
        ),
        (
            edited("[success]", "[stop]\nfailure_share_within = 2.0\n[success]"),
            ["stop.failure_share_within = 2.0", "0.5"],
        ),
        (
            edited(
                "[success]",
                "[stop]\nfailure_share_within = 0.1\nconfidence = nan\n[success]",
            ),
            ["stop.confidence", "0.95"],
        ),
        (
            edited(
                "[success]",
                "[rare]\nmeasure = \"end_s\"\nabove = 1.0\n[success]",
            ),
            ["rare", "leave runs"],
        ),
        (
            // Refused draws used to count as safe ones, with which nothing fails.
            edited("runs = 24", "refused = \"count\"")
                .replace("[success]\nlargest_tilt_rad.at_most = 0.5\n", "")
                + "[rare]\nmeasure = \"largest_tilt_rad\"\nabove = 1.0\n",
            ["refused = \"count\"", "no draw is left out"],
        ),
        (String::from("title ="), ["not a valid campaign", "line 1"]),
    ] {
        let message = message(&text);
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
}

/// Each run on its own may be wrong: which, and what it draws, is said.
#[test]
fn a_run_that_makes_no_scenario_says_what_it_draws() {
    let text = edited("[0.0, 0.1]", "[-0.001, 0.1]");
    let (_folder, path) = written(&text);
    let source = Source::load(&path).unwrap();
    let campaign = Campaign::new(&source, source.folder(), PROGRAM).unwrap();
    let refused =
        (0..10_000).find_map(|run| campaign.scenario(&campaign.draw(run)).err().map(|_| run));
    let message = campaign
        .run(refused.unwrap(), crate::NO_CLOCK)
        .unwrap_err()
        .to_string();
    for part in [
        "draws world.delay.transport_s = -",
        "refused = \"count\"",
        "not negative",
    ] {
        assert!(message.contains(part), "{message}");
    }
}
