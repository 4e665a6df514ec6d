//! An identification in words, for the screen.

use super::tables;
use ballbot_identification::{IdentifiedRobot, OfPlane, Weight};
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
            mark(verdict.1.weight()),
            told(robot, &verdict)
        );
    }
    text
}

/// A verdict, with the plane that it is of.
pub fn told(robot: &IdentifiedRobot, (plane, verdict): &OfPlane) -> String {
    match plane.and_then(|plane| robot.plane_name(plane)) {
        Some(name) => format!("plane {name}: {verdict}"),
        None => verdict.to_string(),
    }
}

/// How a verdict is introduced.
pub fn mark(weight: Weight) -> &'static str {
    match weight {
        Weight::Good => "good:",
        Weight::Note => "note:",
        Weight::Warning => "WARNING:",
        Weight::Refusal => "NO RESULT:",
    }
}
