//! An identification in words, for the screen.

use super::tables;
use ballbot_identification::IdentifiedRobot;
use std::fmt::Write as _;

/// Findings, parameters, poles, verdicts.
pub fn text(robot: &IdentifiedRobot) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    for (name, findings) in robot.findings() {
        for finding in findings {
            let _ = writeln!(text, "{name}: {finding}");
        }
    }
    let (fitted, held_back) = robot.first().times;
    let fit = &robot.estimate().fit;
    let _ = writeln!(
        text,
        "{} segments, {} values, {fitted:.1} s fitted, {held_back:.1} s held back, {} steps{}\n",
        fit.initial.len(),
        fit.values,
        fit.history.len() - 1,
        if robot.first().physical {
            ""
        } else {
            "; mechanics was not imposed"
        }
    );
    for (title, sheet) in [
        ("", tables::parameters(robot)),
        ("Poles, upright", tables::poles(robot)),
        ("Friction, on the data held back", tables::structures(robot)),
    ] {
        if !sheet.rows.is_empty() {
            if !title.is_empty() {
                let _ = writeln!(text, "{title}");
            }
            let _ = writeln!(text, "{}", sheet.on_screen());
        }
    }
    for verdict in robot.verdicts() {
        let _ = writeln!(
            text,
            "{} {}",
            verdict.1.weight().mark(),
            robot.told(&verdict)
        );
    }
    text
}
