//! An identification in words, for the screen.

use super::tables;
use ballbot_identification::{Identification, Weight};
use std::fmt::Write as _;

/// Findings, parameters, poles, verdicts.
pub fn text(identification: &Identification) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    for (name, findings) in &identification.findings {
        for finding in findings {
            let _ = writeln!(text, "{name}: {finding}");
        }
    }
    let (fitted, held_back) = identification.times;
    let _ = writeln!(
        text,
        "{} segments, {} values, {fitted:.1} s fitted, {held_back:.1} s held back, {} steps{}\n",
        identification.simulated.len(),
        identification.estimate.fit.values,
        identification.estimate.fit.history.len() - 1,
        if identification.physical {
            ""
        } else {
            "; mechanics was not imposed"
        }
    );
    for (title, sheet) in [
        ("", tables::parameters(identification)),
        ("Poles, upright", tables::poles(identification)),
        (
            "Friction, on the data held back",
            tables::structures(identification),
        ),
    ] {
        if !sheet.rows.is_empty() {
            if !title.is_empty() {
                let _ = writeln!(text, "{title}");
            }
            let _ = writeln!(text, "{}", sheet.on_screen());
        }
    }
    for verdict in identification.verdicts() {
        let _ = writeln!(text, "{} {verdict}", mark(verdict.weight()));
    }
    text
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
