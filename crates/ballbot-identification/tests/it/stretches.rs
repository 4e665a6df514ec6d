//! What is between two stretches of a log does not reach into them.

use crate::chain::identified_from;
use crate::laboratory::{Laboratory, Record, csv, healthy};
use ballbot_identification::{Parameter, Verdict};

fn laboratory() -> Laboratory {
    Laboratory {
        rate: 100.0,
        duration: 16.0,
        ..healthy()
    }
}

/// The record with its clock set anew, or ahead, after half of the rows.
fn with_clock(record: &Record, shift: f64) -> String {
    let mut record = record.clone();
    let half = record.run.time.len() / 2;
    for time in &mut record.run.time[half..] {
        *time += shift;
    }
    csv(&record)
}

/// Rows were looked for by their time in the whole log: after the clock had begun anew, the torque was
/// that of other rows.
#[test]
fn a_clock_that_begins_anew_is_no_other_robot() {
    let laboratory = Laboratory {
        delay: 0.01,
        ..laboratory()
    };
    let record = laboratory.record(3);
    let config = "[fit]\nheld_back = 0.0";
    let ahead = identified_from(&with_clock(&record, 40.0), config);
    let anew = identified_from(&with_clock(&record, -8.0), config);
    assert_eq!(anew.simulated.len(), ahead.simulated.len());
    for parameter in Parameter::ALL {
        let (found, right) = (
            anew.estimate.values[parameter],
            ahead.estimate.values[parameter],
        );
        // The same data, but for the rounding of times: both searches end within a hundredth of what
        // noise leaves open.
        let most = 0.01 * ahead.standard_deviation(parameter);
        assert!(
            (found - right).abs() <= most,
            "{parameter}: {found} for {right}"
        );
    }
}

/// With a delay of whole rows a segment begins with the row after the missing torque, which a
/// difference by the delay, or the rounding of times, brought in.
#[test]
fn a_missing_torque_is_not_read_by_the_segment_after_it() {
    for delay in [0.0, 0.02] {
        let laboratory = Laboratory {
            delay,
            ..laboratory()
        };
        let mut record = laboratory.record(3);
        for row in [301, 702, 1003] {
            record.run.torque[row] = f64::NAN;
        }
        let text = csv(&record).replace("NaN", "");
        let config =
            format!("[fit]\nheld_back = 0.0\n[parameters]\ndelay_s = {{ fixed = {delay:?} }}");
        let found = identified_from(&text, &config);
        for segment in &found.simulated {
            assert_eq!(segment.simulated.len(), segment.time.len(), "{delay} s");
        }
        let verdicts = found.verdicts();
        let alarm = verdicts
            .iter()
            .any(|verdict| matches!(verdict, Verdict::DelayAlarm { .. }));
        assert!(!alarm, "{delay} s: {verdicts:?}");
        let delay_score = found
            .scores
            .iter()
            .find(|score| score.parameter == Parameter::Delay);
        assert!(delay_score.is_some(), "{delay} s: {:?}", found.scores);
    }
}
