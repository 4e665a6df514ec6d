//! The readable page of a certificate.

use crate::html;
use ballbot_scenario::TerminalCertificate;
use lpvmpc_certificate::Proof;
use lpvmpc_figures::{Band, Dash, Figure, FigureError, Panel, Role, Series, Style};
use nalgebra::Matrix2;
use std::f64::consts::TAU;

const NAMES: [&str; 4] = ["φ [rad]", "θ [rad]", "φ' [rad/s]", "θ' [rad/s]"];
/// Pairs of states that are drawn: horizontal, vertical.
const PLANES: [[usize; 2]; 4] = [[0, 1], [1, 3], [0, 2], [2, 3]];

/// The set in phase planes: its shadow, which no state of the set leaves.
pub fn figure(title: &str, certificate: &TerminalCertificate) -> Figure {
    let panels = PLANES.map(|[x, y]| {
        let shadow = shadow(certificate, x, y);
        let label = "shadow of x'Px ≤ level";
        let outline = Series::new(
            label,
            &shadow.0,
            &shadow.1,
            Style::Line(Dash::Solid),
            Role::Lpv,
        );
        let section = section(certificate, x, y);
        let label = "section, other states 0";
        let dash = Style::Line(Dash::Dashed);
        let inner = Series::new(label, &section.0, &section.1, dash, Role::RungeKutta);
        let mut panel = Panel::new(NAMES[x], NAMES[y], vec![outline, inner]);
        let limit = certificate.state_limits[y];
        if limit.is_finite() {
            panel.band = Some(Band {
                lower: -limit,
                upper: limit,
            });
        }
        panel
    });
    Figure {
        title: title.to_owned(),
        panels: panels.into(),
        columns: 2,
        width: 900.0,
        height: 760.0,
    }
}

/// A self-contained page: figure, claims, numbers.
///
/// # Errors
/// The figure cannot be drawn.
pub fn html(
    title: &str,
    certificate: &TerminalCertificate,
    proof: &Proof<4>,
) -> Result<String, FigureError> {
    let svg = figure("Phase planes", certificate).svg()?;
    let axes = certificate.terminal.largest_states();
    let bound = |limit: f64| {
        if limit.is_finite() {
            format!("{limit:.4}")
        } else {
            "none".to_owned()
        }
    };
    let rows: String = (0..4)
        .map(|i| {
            format!(
                "<tr><td>{}</td><td>{:.4}</td><td>{:.4}</td><td>{}</td></tr>",
                NAMES[i],
                axes[i],
                proof.reach[i],
                bound(certificate.state_limits[i])
            )
        })
        .collect();
    let terminal = &certificate.terminal;
    let body = format!(
        "<p>For: {}. Robot, weights and bounds are in certificate.json; \
         <code>ballbot verify</code> proves every claim again.</p>\
         <p>For <b>every</b> state with x'Px ≤ {:.3}, the model with exactly these parameters, under \
         the torque u = −K x of the exact state, without delay, held over each sample of {} s,</p><ul>\
         <li>has x'Px smaller after the sample by at least the stage cost x'Qx + u'Ru and {:.2e} \
         of itself, so it never leaves the set,</li>\
         <li>stays within the limits of torque and states, those of the states also between the \
         samples.</li></ul>\
         <p>And A − BK is quadratically stable (rate {} 1/s) for every motion of \
         |θ| ≤ {:.4} rad, |θ'| ≤ {:.4} rad/s in continuous time.</p>\
         <figure>{svg}</figure>\
         <div class=\"scroll\"><table><tr><th>state</th><th>in the set, at most</th>\
         <th>between samples, below</th><th>limit</th></tr>{rows}</table></div>\
         <p>K = {:.6?}, for u = −K x. Proved on {} boxes of states and {} of schedulings.</p>\n",
        html::escape(title),
        terminal.level,
        certificate.t_s,
        terminal.contraction,
        certificate.continuous.rate_1_s,
        certificate.scheduling_limits[0],
        certificate.scheduling_limits[1],
        terminal.k.as_slice(),
        proof.boxes,
        proof.scheduling_boxes,
    );
    Ok(html::page("Certified terminal set", &body))
}

type Outline = (Vec<f64>, Vec<f64>);

/// The projection of the set: the ellipse of the block of P^-1.
fn shadow(certificate: &TerminalCertificate, x: usize, y: usize) -> Outline {
    let inverse = certificate.terminal.p.try_inverse().unwrap_or_default();
    ellipse(block(&inverse, x, y), certificate.terminal.level)
}

/// The cut through the set: the ellipse of the inverse of the block of P.
fn section(certificate: &TerminalCertificate, x: usize, y: usize) -> Outline {
    let inverse = block(&certificate.terminal.p, x, y)
        .try_inverse()
        .unwrap_or_default();
    ellipse(inverse, certificate.terminal.level)
}

fn block(m: &nalgebra::Matrix4<f64>, x: usize, y: usize) -> Matrix2<f64> {
    Matrix2::new(m[(x, x)], m[(x, y)], m[(y, x)], m[(y, y)])
}

/// The points z with z'S^-1 z = level.
fn ellipse(s: Matrix2<f64>, level: f64) -> Outline {
    const POINTS: u32 = 180;
    let factor = s
        .cholesky()
        .map_or_else(Matrix2::zeros, |factor| factor.l());
    let angles = (0..=POINTS).map(|i| TAU * f64::from(i) / f64::from(POINTS));
    angles
        .map(|angle| factor * nalgebra::Vector2::new(angle.cos(), angle.sin()) * level.sqrt())
        .map(|point| (point[0], point[1]))
        .unzip()
}
