//! Logs as they should not be: each gets a message that says what is wrong, none a panic.

use crate::laboratory::csv;
use crate::laboratory::{Laboratory, healthy};
use ballbot_identification::Config;
use ballbot_identification::log::{self, Log, LogError};
use std::fmt::Write as _;

/// A good log of three seconds.
fn good() -> String {
    let laboratory = Laboratory {
        duration: 3.0,
        rate: 100.0,
        ..healthy()
    };
    csv(&laboratory.record(1))
}

fn read_with(content: &[u8], config: &str) -> Result<Log, LogError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, content).unwrap();
    log::read(&path, &Config::parse(config).unwrap().log, &|_| ())
}

/// The log refused with all of these words.
fn refused(content: impl AsRef<[u8]>, words: &[&str]) {
    let message = read_with(content.as_ref(), "").unwrap_err().to_string();
    assert!(message.contains("log.csv"), "{message}");
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
}

/// The log read, with a finding of these words.
fn found(content: impl AsRef<[u8]>, words: &[&str]) {
    let log = read_with(content.as_ref(), "").unwrap();
    let findings: Vec<String> = log.findings.iter().map(ToString::to_string).collect();
    let said = |finding: &String| words.iter().all(|word| finding.contains(word));
    assert!(
        findings.iter().any(said),
        "{words:?} is not in: {findings:?}"
    );
}

/// The good log with its rows changed: fields of row `row`, counted from 0.
fn changed(change: impl Fn(usize, &mut Vec<String>)) -> String {
    let text = good();
    let mut lines = text.lines();
    let mut result = lines.next().unwrap().to_owned() + "\n";
    for (row, line) in lines.enumerate() {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        change(row, &mut fields);
        if !fields.is_empty() {
            writeln!(result, "{}", fields.join(",")).unwrap();
        }
    }
    result
}

/// One column multiplied, or shifted in some rows.
fn recalculated(column: usize, change: impl Fn(usize, f64) -> f64) -> String {
    changed(|row, fields| {
        let value: f64 = fields[column].parse().unwrap();
        fields[column] = change(row, value).to_string();
    })
}

const DEGREES: f64 = 180.0 / std::f64::consts::PI;

#[test]
fn a_good_log_is_read_without_findings() {
    let log = read_with(good().as_bytes(), "").unwrap();
    assert!(log.findings.is_empty(), "{:?}", log.findings);
    assert_eq!(log.run.time.len(), 300);
    assert_eq!(log.run.stretches.first(), Some(&(0..300)));
}

#[test]
fn files_that_are_no_text() {
    refused("", &["is empty"]);
    refused("\n\n# nothing\n", &["is empty"]);
    refused([0xff, 0xfe, b't', 0], &["UTF-16"]);
    let header = "t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_applied_nm";
    refused(format!("{header}\n\0\0\0"), &["line 2", "binary"]);
    refused(b"t_s,phi\xe9\n", &["line 1, byte 8", "UTF-8"]);
    // A line that does not end: a gigabyte is refused after 64 KiB.
    refused("7".repeat(1 << 20), &["line 1", "65536 bytes"]);
    let folder = tempfile::tempdir().unwrap();
    let columns = Config::default().log;
    let message = log::read(folder.path(), &columns, &|_| ())
        .unwrap_err()
        .to_string();
    assert!(message.contains("folder"), "{message}");
    let missing = folder.path().join("none.csv");
    let message = log::read(&missing, &columns, &|_| ())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("none.csv") && message.contains("cannot be read"),
        "{message}"
    );
}

#[test]
fn headers() {
    refused(
        good().split_once('\n').unwrap().1,
        &["line 1", "numbers", "column names"],
    );
    refused(good().replace(',', ";"), &["`;`", "delimiter"]);
    refused(good().replace(',', "\t"), &["tab", "delimiter"]);
    refused(
        good().replace("theta_rad", "theta_deg"),
        &["`theta_rad`", "did you mean `theta_deg`"],
    );
    refused(
        good().replace("torque_applied_nm", "phi_rad"),
        &["`phi_rad` twice", "fields 2 and 6"],
    );
    let text = good();
    let (header, rows) = text.split_once('\n').unwrap();
    refused(
        format!("{header}\n{rows}{header}\n{rows}"),
        &["line 302", "two logs in one file"],
    );
    refused(header, &["0 rows", "at least 20"]);
    refused(format!("{header}\n0,0,0,0,0,0\n"), &["1 rows"]);
}

#[test]
fn fields() {
    refused(
        changed(|row, fields| {
            if row == 4 {
                fields.truncate(4)
            }
        }),
        &["line 6 has 4 fields", "line 1 has 6"],
    );
    refused(
        changed(|row, fields| {
            if row == 4 {
                fields[1] = "fast".to_owned()
            }
        }),
        &["line 6", "`phi_rad`", "`fast` is not a number"],
    );
    let semicolons = good().replace(',', ";").replace('.', ",");
    let message = read_with(semicolons.as_bytes(), "[log]\ndelimiter = \";\"").unwrap_err();
    assert!(message.to_string().contains("decimal point"), "{message}");
    refused(
        changed(|row, fields| {
            if row == 9 {
                fields[0] = "nan".to_owned()
            }
        }),
        &["line 11", "time stamp is missing"],
    );
    refused(
        changed(|row, fields| {
            if row % 3 > 0 {
                fields[2].clear()
            }
        }),
        &["`theta_rad`", "200 of 300 rows"],
    );
}

#[test]
fn harmless_oddities_are_read_and_said() {
    found(format!("\u{feff}{}", good()), &["byte order mark"]);
    // Below a header that the configuration has, too; what it says of a row names no line of the file.
    let (header, rows) = good()
        .split_once('\n')
        .map(|(a, b)| (a.to_owned(), b.to_owned()))
        .unwrap();
    let named: Vec<String> = header.split(',').map(|name| format!("{name:?}")).collect();
    let config = format!("[log]\nheader = [{}]", named.join(", "));
    let read = read_with(format!("\u{feff}{rows}").as_bytes(), &config).unwrap();
    assert_eq!(read.run.time.len(), 300);
    let message = read_with(format!("1,2\n{rows}").as_bytes(), &config).unwrap_err();
    let message = message.to_string();
    assert!(
        message.contains("the header of the configuration"),
        "{message}"
    );
    let windows = good().replace('\n', "\r\n");
    assert_eq!(
        read_with(windows.as_bytes(), "").unwrap().run.time.len(),
        300
    );
    let text = good();
    found(&text[..text.len() - 30], &["line 301", "cut off"]);
    found(
        changed(|row, fields| {
            if row == 5 || row == 8 {
                fields[2] = "NaN".to_owned()
            }
        }),
        &["`theta_rad`", "2 rows", "line 7", "not filled in"],
    );
    found(
        changed(|row, fields| {
            if row == 5 {
                fields[3] = "1e999".to_owned()
            }
        }),
        &["`theta_dot_rad_s`", "not finite"],
    );
    found(
        changed(|row, fields| {
            if row == 5 {
                fields[5].clear()
            }
        }),
        &["`torque", "1 rows"],
    );
}

#[test]
fn time_stamps() {
    found(
        changed(|row, fields| {
            if (150..170).contains(&row) {
                fields.clear()
            }
        }),
        &["1 gap", "0.21 s"],
    );
    found(
        recalculated(0, |row, time| if row == 100 { time - 0.01 } else { time }),
        &["1 row(s) repeat the time stamp", "line 102"],
    );
    found(
        recalculated(0, |row, time| if row >= 150 { time - 1.4 } else { time }),
        &["goes back 1 time", "line 152"],
    );
    found(
        recalculated(0, |row, time| time + 0.003 * (row % 2) as f64),
        &["not evenly spaced"],
    );
    refused(recalculated(0, |_, _| 3.0), &["`t_s` is 3 in all rows"]);
    refused(
        recalculated(0, |_, time| -time),
        &["`t_s` goes back at", "the earliest first"],
    );
    // To a thirtieth of a second.
    refused(
        recalculated(0, |_, time| (30.0 * time).floor() / 30.0),
        &[
            "no stretch of 1 s",
            "row(s) repeat the time stamp",
            "line 3",
        ],
    );
    refused(recalculated(0, |_, time| time * 1e3), &["10 s apart", "ms"]);
    refused(
        recalculated(0, |_, time| time * 1e-4),
        &["no robot is sampled that fast"],
    );
    refused(
        recalculated(0, |row, time| time + (row / 30) as f64),
        &["no stretch of 1 s"],
    );
}

#[test]
fn a_gap_is_not_bridged() {
    let log = read_with(
        changed(|row, fields| {
            if (150..170).contains(&row) {
                fields.clear()
            }
        })
        .as_bytes(),
        "",
    );
    assert_eq!(log.unwrap().run.stretches, [0..150, 150..280]);
    let log = read_with(
        changed(|row, fields| {
            if row == 100 {
                fields[5].clear()
            }
        })
        .as_bytes(),
        "",
    );
    assert_eq!(log.unwrap().run.stretches, [0..100, 101..300]);
}

#[test]
fn sensors() {
    refused(
        recalculated(1, |_, _| 0.0),
        &["`phi_rad` is 0 in all rows", "did not move"],
    );
    refused(
        recalculated(2, |_, _| 0.1),
        &["`theta_rad` is 0.1 in all rows"],
    );
    refused(recalculated(3, |_, _| 0.0), &["gyroscope is not connected"]);
    refused(
        recalculated(5, |_, _| 0.0),
        &["without torque nothing can be told"],
    );
    found(
        recalculated(1, |row, phi| {
            if row >= 120 {
                phi - std::f64::consts::TAU
            } else {
                phi
            }
        }),
        &["`phi_rad` jumps 1 time", "line 122", "wraps around"],
    );
    found(
        recalculated(1, |row, phi| if row >= 120 { phi + 2.0 } else { phi }),
        &["`phi_rad` jumps 1 time", "a reset or a spike"],
    );
    // It was written with its three hundred digits.
    found(
        recalculated(1, |row, phi| if row == 120 { 1e300 } else { phi }),
        &["`phi_rad` jumps", "first by 1.0e300 in line 122"],
    );
    found(
        recalculated(2, |row, theta| if row == 50 { theta + 0.5 } else { theta }),
        &["`theta_rad` jumps"],
    );
    found(
        recalculated(1, |_, phi| (phi / 0.05).round() * 0.05),
        &["`phi_rad` has steps of 5.00e-2"],
    );
    for (column, name) in [(3, "theta_dot_rad_s"), (5, "torque")] {
        let stands_out = format!("`{name}` has 1 value(s) that stand out, first 20 in line 52");
        let log = recalculated(column, |row, value| if row == 50 { 20.0 } else { value });
        found(&log, &[&stands_out]);
        let log = read_with(log.as_bytes(), "").unwrap();
        assert_eq!(log.run.stretches, [0..50, 51..300]);
    }
    let frozen = |row: usize, theta: f64| {
        if (100..160).contains(&row) {
            0.01
        } else {
            theta
        }
    };
    found(
        recalculated(2, frozen),
        &["`theta_rad` does not change for 0.59 s", "line 102"],
    );
    found(
        recalculated(2, |row, theta| if row >= 250 { theta + 1.5 } else { theta }),
        &["leans beyond 0.8 rad", "50 rows are left out"],
    );
}

#[test]
fn torques() {
    let limit = |_: usize, torque: f64| torque.clamp(-0.5, 0.5);
    found(recalculated(5, limit), &["at its limit of 0.5 N m"]);
    found(recalculated(5, limit), &["differs from the commanded one"]);
    let commanded = recalculated(4, limit).replace("torque_applied_nm", "spare");
    found(
        &commanded,
        &["it is the commanded one", "friction and inertias are wrong"],
    );
}

#[test]
fn units_and_signs_that_contradict_each_other() {
    refused(
        recalculated(2, |_, theta| DEGREES * theta),
        &["tilt seems to be in degrees"],
    );
    refused(
        recalculated(3, |_, rate| DEGREES * rate),
        &["rate seems to be in degrees per second"],
    );
    refused(recalculated(2, |_, theta| -theta), &["other sign"]);
    refused(
        recalculated(3, |_, rate| rate / 9.0),
        &["do not belong together"],
    );
    // Both in degrees: they agree with each other, but no robot leans so far.
    let both = changed(|_, fields| {
        for column in [2, 3] {
            let value: f64 = fields[column].parse().unwrap();
            fields[column] = (DEGREES * value).to_string();
        }
    });
    refused(&both, &["`theta_rad`", "seems to be in degrees"]);
    // Said to be so, they are read as what they are.
    let config = "[log.theta]\ncolumn = \"theta_rad\"\nunit = \"deg\"\n\
                  [log.theta_dot]\ncolumn = \"theta_dot_rad_s\"\nunit = \"deg/s\"";
    let (read, truth) = (
        read_with(both.as_bytes(), config),
        read_with(good().as_bytes(), ""),
    );
    let pairs = read
        .unwrap()
        .run
        .outputs
        .into_iter()
        .zip(truth.unwrap().run.outputs);
    for (read, truth) in pairs {
        assert!((read - truth).norm() < 1e-12);
    }
    // And accepted if the builder insists.
    let log = read_with(both.as_bytes(), "[log]\naccept_suspicious_units = true");
    let accepted = log.map(|log| {
        log.findings
            .iter()
            .any(|f| f.to_string().contains("accepted"))
    });
    assert!(accepted.unwrap_or(true));
}

#[test]
fn units_are_converted_at_the_edge() {
    let config = "[log]\ndelimiter = \";\"\n\
                  [log.time]\ncolumn = \"t_s\"\nunit = \"ms\"\n\
                  [log.phi]\ncolumn = \"phi_rad\"\nunit = \"turn\"\nfactor = 0.5\n\
                  [log.theta_dot]\ncolumn = \"theta_dot_rad_s\"\nunit = \"rpm\"\n\
                  [log.torque]\ncolumn = \"torque_commanded_nm\"\nunit = \"A\"\nfactor = 0.25";
    let turns = std::f64::consts::TAU;
    let text = changed(|_, fields| {
        let factors = [1e3, 2.0 / turns, 1.0, 60.0 / turns, 4.0, 1.0];
        for (field, factor) in fields.iter_mut().zip(factors) {
            *field = (factor * field.parse::<f64>().unwrap()).to_string();
        }
    });
    let read = read_with(text.replace(',', ";").as_bytes(), config)
        .unwrap()
        .run;
    let truth = read_with(good().as_bytes(), "").unwrap().run;
    for row in 0..truth.time.len() {
        assert!((read.time[row] - truth.time[row]).abs() < 1e-9);
        assert!((read.outputs[row] - truth.outputs[row]).norm() < 1e-12);
        assert!((read.torque[row] - truth.torque[row]).abs() < 1e-12);
    }
}

#[test]
fn no_damage_to_a_file_makes_the_reader_panic() {
    let good = good().into_bytes();
    let mut rng = fastrand::Rng::with_seed(11);
    for _ in 0..300 {
        let mut damaged = good.clone();
        for _ in 0..rng.usize(1..6) {
            let place = rng.usize(..damaged.len());
            match rng.u8(..4) {
                0 => damaged[place] = rng.u8(..),
                1 => {
                    let end = (place + rng.usize(..400)).min(damaged.len());
                    damaged.drain(place..end);
                }
                2 => damaged.truncate(place.max(1)),
                _ => {
                    let piece = damaged[place..(place + 60).min(damaged.len())].to_vec();
                    let to = rng.usize(..damaged.len());
                    damaged.splice(to..to, piece);
                }
            }
            if damaged.is_empty() {
                damaged.push(b'\n');
            }
        }
        match read_with(&damaged, "") {
            // What is read is a run: times increase within a stretch, every torque is a number.
            Ok(log) => {
                for stretch in log.run.stretches {
                    let time = &log.run.time[stretch.clone()];
                    assert!(time.windows(2).all(|pair| pair[0] < pair[1]));
                    assert!(
                        log.run.torque[stretch]
                            .iter()
                            .all(|torque| torque.is_finite())
                    );
                }
            }
            Err(error) => assert!(error.to_string().len() > 20),
        }
    }
}

#[test]
fn wheels_that_cannot_turn_the_ball_are_refused() {
    let encoder = "{ column = \"phi_rad\", unit = \"rad\" }";
    let config = |angle: &str, encoder: &str| {
        format!(
            "[log.wheels]\nplane = \"x\"\nzenith_angle_deg = {angle}\n\
             encoders = [{encoder}, {encoder}, {encoder}]"
        )
    };
    let message = |config: &str| {
        read_with(good().as_bytes(), config)
            .unwrap_err()
            .to_string()
    };
    let said = message(&config("90.0", encoder));
    assert!(said.contains("zenith_angle_deg = 90"), "{said}");
    let said = message(&config("45.0", "{ column = \"wheel\", unit = \"rad\" }"));
    assert!(said.contains("`wheel`"), "{said}");
    let said = message(&config("45.0", "{ column = \"phi_rad\", unit = \"Nm\" }"));
    assert!(said.contains("an angle: rad, mrad, deg or turn"), "{said}");
    // Angles and rates cannot be put together.
    let mixed = "[log.wheels]\nplane = \"x\"\nzenith_angle_deg = 45.0\nencoders = [\
                 { column = \"phi_rad\", unit = \"rad\" }, \
                 { column = \"phi_rad\", unit = \"rad/s\" }, \
                 { column = \"phi_rad\", unit = \"rad\" }]";
    let said = message(mixed);
    assert!(said.contains("an angle: rad, mrad, deg or turn"), "{said}");
}

/// The run of the good log.
fn truth() -> log::Run {
    read_with(good().as_bytes(), "").unwrap().run
}

#[test]
fn blanks_between_columns_and_no_header() {
    let text = good();
    let (_, rows) = text.split_once('\n').unwrap();
    let rows = rows.replace(',', "   ");
    let aligned: String = rows.lines().map(|row| format!("  {row} \n")).collect();
    let names = "header = [\"t_s\", \"phi_rad\", \"theta_rad\", \"theta_dot_rad_s\", \"asked\", \
                 \"torque_applied_nm\"]";
    let config = format!("[log]\ndelimiter = \" \"\n{names}");
    let run = read_with(format!("% a comment\n{aligned}").as_bytes(), &config);
    let run = run.unwrap().run;
    assert_eq!(run.outputs, truth().outputs);
    assert_eq!(run.torque, truth().torque);
    // Tabs among them.
    let run = read_with(rows.replace("   ", " \t").as_bytes(), &config);
    assert_eq!(run.unwrap().run.outputs, truth().outputs);
    // The error that leads there.
    refused(good().replace(',', "  "), &["` `", "delimiter"]);
}

#[test]
fn windows_of_time() {
    let read = |keys: &str| {
        let log = read_with(good().as_bytes(), &format!("[log]\n{keys}")).unwrap();
        log.run.stretches
    };
    assert_eq!(read("from_s = 0.495").first(), Some(&(50..300)));
    assert_eq!(read("until_s = 1.995").first(), Some(&(0..200)));
    assert_eq!(read("leave_out = [[1.095, 1.195]]"), [0..110, 120..300]);
    let message = read_with(good().as_bytes(), "[log]\nfrom_s = 2.495").unwrap_err();
    let message = message.to_string();
    for part in ["no stretch of 1 s", "250 of the 300 rows are left out"] {
        assert!(message.contains(part), "{message}");
    }
    // What is left out is not judged: here the robot lies.
    let text = recalculated(2, |row, theta| if row < 50 { theta + 1.5 } else { theta });
    let log = read_with(text.as_bytes(), "[log]\nfrom_s = 0.495").unwrap();
    assert_eq!(log.run.stretches.first(), Some(&(50..300)));
    assert_eq!(log.findings.len(), 1, "{:?}", log.findings);
}

#[test]
fn a_rate_of_the_ball_is_integrated() {
    // Differences between rows, as a driver that counts would give them.
    let truth = truth();
    let text = changed(|row, fields| {
        let last = truth.outputs.len() - 1;
        let (before, after) = (row.saturating_sub(1), (row + 1).min(last));
        let change = truth.outputs[after][0] - truth.outputs[before][0];
        let rate = change / (truth.time[after] - truth.time[before]);
        fields[1] = (rate * 60.0 / std::f64::consts::TAU).to_string();
    });
    let config = "[log.phi]\ncolumn = \"phi_rad\"\nunit = \"rpm\"";
    let log = read_with(text.as_bytes(), config).unwrap();
    let said = log
        .findings
        .iter()
        .any(|one| one.to_string().contains("integrated"));
    assert!(said, "{:?}", log.findings);
    let start = truth.outputs[0][0];
    for (read, truth) in log.run.outputs.iter().zip(&truth.outputs) {
        assert!(
            (read[0] + start - truth[0]).abs() < 5e-3,
            "{read} for {truth}"
        );
    }
    // It does not reach across a missing one.
    let text = changed(|row, fields| {
        if row == 100 {
            fields[1].clear();
        }
    });
    let config = "[log.phi]\ncolumn = \"phi_rad\"\nunit = \"rad/s\"";
    let log = read_with(text.as_bytes(), config).unwrap();
    assert_eq!(log.run.stretches, [0..100, 101..300]);
}

#[test]
fn three_torques_are_those_of_both_planes() {
    let config = |plane: &str| {
        let wheel = |i: usize| format!("{{ column = \"m{i}\", unit = \"mNm\" }}");
        let wheels = [1, 2, 3].map(wheel).join(", ");
        let encoder = |factor: f64| {
            format!("{{ column = \"phi_rad\", unit = \"rad\", factor = {factor:?} }}")
        };
        let encoders = [1.0, 0.2, 0.5].map(encoder).join(", ");
        format!(
            "[log.wheels]\nplane = \"{plane}\"\nzenith_angle_deg = 45.0\n\
             encoders = [{encoders}]\ntorques = [{wheels}]"
        )
    };
    let truth = truth();
    let wheels = ballbot::Wheels::<f64>::paper();
    let rows = truth.torque.iter().enumerate().map(|(row, torque)| {
        let other = (0.1 * row as f64).cos();
        let motors = 1e3 * wheels.motors(&nalgebra::Vector3::new(*torque, other, 0.3));
        let outputs = truth.outputs[row];
        format!(
            "{},{},{},{},{},{},{}\n",
            truth.time[row], outputs[0], outputs[1], outputs[2], motors[0], motors[1], motors[2]
        )
    });
    let text = format!(
        "t_s,phi_rad,theta_rad,theta_dot_rad_s,m1,m2,m3\n{}",
        rows.collect::<String>()
    );
    let x = read_with(text.as_bytes(), &config("x")).unwrap().run;
    let y = read_with(text.as_bytes(), &config("y")).unwrap().run;
    for row in 0..truth.torque.len() {
        assert!((x.torque[row] - truth.torque[row]).abs() < 1e-12);
        assert!((y.torque[row] - (0.1 * row as f64).cos()).abs() < 1e-12);
    }
}

#[test]
fn a_delay_out_of_range_is_refused_however_it_is_given() {
    for given in [
        "{ fixed = 3.0 }",
        "{ start = 3.0 }",
        "{ prior = { mean = 3.0, standard_deviation = 0.01 } }",
    ] {
        let refused = Config::parse(&format!("[parameters]\ndelay_s = {given}")).unwrap_err();
        let message = refused.to_string();
        assert!(message.contains("parameters.delay_s"), "{given}: {message}");
    }
}
