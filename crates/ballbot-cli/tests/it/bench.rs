//! `ballbot bench`.

use crate::{failure, json};

#[test]
fn every_sequence_has_its_times() {
    let result = json(&["bench", "--passes", "1", "--json", "-"]);
    let sequences = result["sequences"].as_array().unwrap();
    let names = [
        "two-setpoints",
        "lissajous",
        "single-setpoint-terminal",
        "tight-bounds",
        "many-bounds-8x2",
        "many-bounds-12x4",
        "long-4x1",
    ];
    assert_eq!(sequences.len(), names.len());
    for (sequence, name) in sequences.iter().zip(names) {
        assert_eq!(sequence["name"], name);
        let time = |of: &str, statistic: &str| sequence[of][statistic].as_f64().unwrap();
        for of in ["qp_us", "qp_cold_us", "step_us", "step_cold_us"] {
            let [median, p99, max] = ["median", "p99", "max"].map(|statistic| time(of, statistic));
            assert!(0.0 < median && median <= p99 && p99 <= max, "{name}: {of}");
        }
        let active = sequence["max_active"].as_u64().unwrap();
        let many = name.starts_with("many") || name.starts_with("long");
        assert_eq!(active > 30, many, "{name}: {active} active");
    }
}

#[test]
fn a_time_needs_a_pass() {
    assert!(failure(&["bench", "--passes", "0"], 2).contains("--passes"));
}

#[test]
fn a_scenario_that_does_not_exist_has_no_times() {
    assert!(failure(&["bench", "no-such-scenario"], 1).contains("no-such-scenario"));
}
