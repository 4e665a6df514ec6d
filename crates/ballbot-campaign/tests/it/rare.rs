//! A rare failure of a closed loop whose probability is known.

use crate::{NO_CLOCK, with};
use ballbot_campaign::RareTable;

/// A robot that is let go at a tilt that is normally distributed, with a deviation of 0.02 rad, is
/// never tilted more than then: it is beyond 4.892 deviations with a probability of 1e-6.
#[test]
fn a_known_probability_of_one_in_a_million_is_found() {
    let text = "title = \"Let go\"\nscenario = \"single-setpoint\"\nseed = 5\n\
        [set]\nduration_s = 0.3\n\
        reference.set_points.points = [{ time_s = 0.0, phi_rad = 0.0 }]\n\
        [[vary]]\nkey = \"initial_state.theta_rad\"\nnormal = { mean = 0.0, deviation = 0.02 }\n\
        [rare]\nmeasure = \"largest_tilt_rad\"\nabove = 0.09783277\nlevel_runs = 500\n";
    let text = text.replace(
        "reference.set_points.points",
        "\"reference.set_points.points\"",
    );
    with(&text, |campaign| {
        let rare: RareTable = campaign.source().file().rare.unwrap();
        let found = campaign.rare(&rare, NO_CLOCK, &|| ()).unwrap();
        let interval = found.probability;
        assert!(
            interval.lower < 1e-6 && 1e-6 < interval.upper,
            "{interval:?}"
        );
        assert!(interval.upper / interval.lower < 20.0, "{interval:?}");
        assert!(found.runs < 4000 && !found.failures.is_empty());
        for point in &found.failures {
            let drawn = campaign.drawn_at(point);
            assert!(
                drawn.values[0].as_float().unwrap().abs() > 0.0978,
                "{drawn:?}"
            );
        }
    });
}
