//! The report of an identification: one self-contained HTML file.

use super::published;
use super::tables::{self, Sheet};
use crate::html::{self, CaptionedFigure, escape};
use ballbot_identification::{IdentifiedRobot, Weight};
use lpvmpc_figures::FigureError;

/// The report's text.
///
/// # Errors
/// A figure cannot be drawn.
pub fn html(robot: &IdentifiedRobot, figures: &[CaptionedFigure]) -> Result<String, FigureError> {
    let (fitted, held_back) = robot.first().times;
    let logs: String = robot
        .findings()
        .iter()
        .map(|(name, findings)| {
            let findings = findings.iter().map(|finding| escape(&finding.to_string()));
            let mut findings: Vec<String> = findings.collect();
            if findings.is_empty() {
                findings.push("nothing odd".to_owned());
            }
            format!("<li>{}: {}</li>\n", escape(name), findings.join("; "))
        })
        .collect();
    let body = format!(
        "<p>{fitted:.1} s of the log were fitted, {held_back:.1} s held back to judge the fit. \
         {} The fit is to {} values.</p>\n\
         <h2>Verdict</h2>\n{}\n<h2>Parameters</h2>\n{}\n<p>{}</p>\n\
         <h2>Logs</h2>\n<ul>\n{logs}</ul>\n<h2>Figures</h2>\n{}\n\
         <h2>Poles at the upright position</h2>\n<p>With the half-widths of their 95 % \
         intervals.</p>\n{}\n<h2>Residuals</h2>\n{}\n\
         <h2>Structures of friction</h2>\n{}\n<h2>Correlations of the parameters</h2>\n{}\n\
         <h2>The published chain, to compare with</h2>\n{}",
        mechanics(robot),
        robot.estimate().fit.values,
        verdicts(robot),
        table(&tables::parameters(robot)),
        intervals(robot),
        html::figures(figures)?,
        table(&tables::poles(robot)),
        table(&tables::residuals(robot)),
        table(&tables::structures(robot)),
        table(&tables::correlations(robot)),
        chains(robot),
    );
    Ok(html::page("A ballbot, identified", &body))
}

/// The published chain, plane by plane.
fn chains(robot: &IdentifiedRobot) -> String {
    let planes = robot.planes.iter().enumerate();
    planes
        .map(|(place, plane)| {
            let title = robot
                .plane_name(place)
                .map(|name| format!("<h3>Plane {name}</h3>\n"));
            format!(
                "{}{}\n<pre>{}</pre>\n",
                title.unwrap_or_default(),
                table(&published::linear_parameters(plane)),
                escape(&published::refined(plane))
            )
        })
        .collect()
}

fn mechanics(robot: &IdentifiedRobot) -> &'static str {
    if robot.first().physical {
        "A positive mass matrix and dissipating friction were imposed."
    } else {
        "Mechanics was not imposed."
    }
}

fn intervals(robot: &IdentifiedRobot) -> &'static str {
    if robot.is_white() {
        "The intervals are those of white residuals."
    } else if robot.first().has_few_segments() {
        "The residuals are not white: in the intervals they count as the fewer white ones that they \
         are worth."
    } else {
        "The residuals are not white: the intervals are taken from the scatter of the segments, or, \
         where that is less, from residuals counted as the fewer white ones that they are worth."
    }
}

fn verdicts(robot: &IdentifiedRobot) -> String {
    let items = robot.verdicts();
    let items = items.iter().map(|verdict| {
        let weight = verdict.1.weight();
        let class = match weight {
            Weight::Good => "agrees",
            Weight::Note => "",
            Weight::Warning | Weight::Refusal => "differs",
        };
        format!(
            "<li><span class=\"{class}\">{}</span> {}</li>\n",
            weight.mark(),
            typeset(&robot.told(verdict)).replace('\n', "<br>")
        )
    });
    format!("<ul>\n{}</ul>", items.collect::<String>())
}

fn table(sheet: &Sheet) -> String {
    if sheet.rows.is_empty() {
        return "<p>None.</p>".to_owned();
    }
    typeset_signs(&html::table(&sheet.headers, &sheet.rows))
}

/// Text as a page shows it, with the signs that a terminal may not have.
fn typeset(text: &str) -> String {
    typeset_signs(&escape(text))
}

fn typeset_signs(html: &str) -> String {
    html.replace("chi^2", "\u{3c7}\u{b2}")
        .replace("^2", "\u{b2}")
        .replace("+-", "\u{b1}")
        .replace(">-", ">\u{2212}")
}
