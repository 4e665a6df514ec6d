//! The report: one self-contained HTML file.

use super::tables::Sheet;
use super::{claims, guarantee, optimum};
use crate::html::{self, CaptionedFigure, escape};
use ballbot::{Ballbot, LinearParameters};
use ballbot_studies::reproduction::{Claim, Optimum, Reproduction, Run, SAMPLING_TIME};
use lpvmpc_figures::FigureError;
use std::f64::consts::{PI, TAU};

/// The report's text.
///
/// # Errors
/// A figure cannot be drawn.
pub fn html(
    reproduction: &Reproduction,
    claims: &[Claim],
    sheets: &[Sheet],
    figures: &[CaptionedFigure],
    machine: &str,
) -> Result<String, FigureError> {
    let figures = html::figures(figures)?;
    let (claims_sheet, others) = match sheets.split_first() {
        Some((first, others)) => (table(first), others),
        None => (String::new(), sheets),
    };
    let tables: String = others
        .iter()
        .map(|sheet| format!("<h3>{}</h3>\n{}", escape(sheet.title), table(sheet)))
        .collect();
    let body = format!(
        "<p>D. S. Karachalios and H. S. Abbas, <cite>Parameter Refinement of a Ballbot and \
         Predictive Control for Reference Tracking with Linear Parameter-Varying Embedding</cite>. \
         Every number below was computed by this program; <strong>{}</strong>, within the stated \
         tolerances. Times were taken on {} with {}.\
         </p>\n\
         <h2>Published and computed</h2>\n{claims_sheet}\n\
         <h2>Figures</h2>\n{figures}\n\
         <h2>Tables</h2>\n{tables}\n\
         <h2>What is guaranteed</h2>\n{}\n\
         <h2>How close to the optimum</h2>\n{}\n\
         <h2>Differences from the paper</h2>\n{}\n\
         <h2>What b* means physically</h2>\n{}\n",
        escape(&claims::counts(claims)),
        escape(machine),
        concat!("ballbot ", env!("CARGO_PKG_VERSION")),
        guaranteed(reproduction)?,
        near_the_optimum(&reproduction.optimum)?,
        differences(reproduction),
        verdict(reproduction),
    );
    Ok(html::page("The ballbot paper, reproduced", &body))
}

fn table(sheet: &Sheet) -> String {
    html::table(&sheet.headers, &sheet.rows)
}

/// What holds for the true motion, and its price.
fn guaranteed(reproduction: &Reproduction) -> Result<String, FigureError> {
    let guarantee = &reproduction.guarantee;
    let cost = |run: &Run| run.metrics[0].closed_loop_cost;
    let one_program = cost(&guarantee.fine);
    let nonlinear = &guarantee.nonlinear;
    let [gap, price] = guarantee::sheets(guarantee);
    Ok(format!(
        "<p>The paper's guarantee needs the terminal equality to hold for the nonlinear robot, and \
         its predictor keeps the scheduling frozen over a sample. The first table shows how far \
         prediction and robot are apart where it must hold. A predictor that follows the scheduling \
         within the sample, repeated until the plan stays as it is, closes the gap.</p>\n{}\
         <p>Nor does the paper say what holds when the set point moves. The guaranteed loop aims at \
         an artificial set point, ends in a terminal set that is proved for the sampled nonlinear \
         robot (<code>ballbot verify</code>), and applies no plan that the nonlinear model does not \
         confirm. Below, four set points in a row, up to 120 rad apart: {} of {} samples with a plan \
         that keeps all bounds, {} states outside. <code>ballbot campaign</code> repeats that from \
         thousands of starts; docs/guarantees.md states the theorem and its limits.</p>\n\
         {}\
         <p>The guarantee has its price. The certified set is small, and every plan must end in it \
         after one second, so the robot moves more slowly than it could.</p>\n{}\
         <p>One quadratic program per sample loses little. Nonlinear MPC, solved to convergence at \
         every sample of scenario 1 ({:.1} programs each, last change {:.0e}), costs {:.1}; the LPV \
         controller with the same predictor costs {one_program:.1} ({:+.3} %).</p>\n",
        table(&gap),
        guarantee.samples_guaranteed(),
        guarantee.far.metrics[0].samples,
        guarantee.far.metrics[0].violations,
        html::figures(&[guarantee::figure(guarantee)])?,
        table(&price),
        nonlinear.mean_programs,
        nonlinear.largest_last_step,
        nonlinear.closed_loop_cost,
        100.0 * (one_program / nonlinear.closed_loop_cost - 1.0),
    ))
}

/// What linear, LPV and nonlinear MPC cost on the same problem.
fn near_the_optimum(optimum: &Optimum) -> Result<String, FigureError> {
    Ok(format!(
        "<p>What does a closed loop lose by predicting with the linear model, or with the LPV model, \
         instead of the nonlinear one? {} closed loops of one plane, from rest, {} s long, to a set \
         point that is given at t = 0 without preview. All controllers have the same plant (the \
         printed b*), Q, R, terminal cost (of the sampled LQR), bounds (of the torque hard, of the \
         states soft with an exact penalty), horizon and sampling time of {:.0} ms; LPV and nonlinear \
         MPC have the same four Runge-Kutta steps per sample. The cost is that of the motion, not of \
         the plans: the sum of ||x - x_ref||_Q^2 + ||u||_R^2 over the samples.</p>\n\
         <ul>\n\
         <li><strong>Nonlinear MPC</strong>, the measure: multiple shooting, solved at every sample \
         from several starts by IPOPT. <strong>Linear MPC</strong>: the same program with the \
         linearisation at upright. Both were computed by a program that shares no code with this one \
         and are stored (<code>testdata/nonlinear-mpc/distances.csv</code>); {}.</li>\n\
         <li><strong>LPV MPC</strong>, computed now: the library's default, a descent of at most \
         eight quadratic programs per sample. <strong>One program, taken as it is</strong>: the \
         scheme of the paper on this problem. It needs references that are known ahead or near: far \
         set points, given without preview, are too much for it.</li>\n\
         </ul>\n{}{}\
         <p>In the worst of these loops LPV MPC costs {:.2} % more than nonlinear MPC, linear MPC \
         {:.1} %. <code>ballbot optimality</code> has random starts and other sampling times, \
         docs/descent.md the method and what is not claimed.</p>\n",
        optimum.cases.len(),
        optimum.duration(),
        1e3 * SAMPLING_TIME,
        match optimum.not_converged() {
            0 => "IPOPT converged at every sample of these loops".to_owned(),
            samples => format!("IPOPT did not converge at {samples} of the samples"),
        },
        html::figures(&[optimum::figure(optimum)])?,
        table(&optimum::sheet(optimum)),
        100.0 * (optimum.worst() - 1.0),
        100.0 * (optimum.worst_linear() - 1.0),
    ))
}

/// The paper's errors, and what is done instead.
fn differences(reproduction: &Reproduction) -> String {
    let (negative, positive) = reproduction.residual_at_printed_b;
    let [regulator, _] = &reproduction.regulators;
    let upright = Ballbot::<f64>::paper().linear_parameters();
    let p = LinearParameters::<f64>::paper();
    let (phi, theta) = reproduction.terminal_gap;
    let overshoot = reproduction
        .runs
        .two_setpoints
        .smallest_phi(3.0..f64::INFINITY);
    let (equality, cost) = (
        &reproduction.runs.terminal_equality,
        &reproduction.runs.terminal_cost,
    );
    let items = [
        format!(
            "<strong>Sign of p6.</strong> The Table of p prints p6 = +{:.4}. With it the residual \
             at the printed b* is {positive:.2}; with p6 = {:.4} it is {negative:.5}, and the least-squares \
             optimum has the printed digits. A positive torque lowers the tilt, as the text of \
             scenario 1 says, only if B41 is negative; here it is {:.1}. The negative sign is used.",
            -p.p6, p.p6, upright.p6
        ),
        "<strong>B31.</strong> The Table of elements has an unbalanced bracket. From \
         M<sup>-1</sup>B&#771; it is r_b (b3 - (b2 - l r_b cos theta)) / (r_w d)."
            .to_owned(),
        "<strong>sinc.</strong> It is sin(x)/x, 1 at 0; with the other convention, sin(pi x)/(pi x), \
         A32 and A42 would not be those of the equations of motion."
            .to_owned(),
        format!(
            "<strong>Newton step.</strong> The Jacobian of six equations in four unknowns has no \
             inverse; the step is the Gauss-Newton step (pseudo-inverse). The paper gives no \
             starting point; from b0 = (0.0025, 0.06, 0.14, -0.07) it takes {} steps. It diverges \
             from other points, so the result given to users comes from a damped method \
             (Levenberg-Marquardt), which ends at the same b.",
            reproduction.refinement.gauss_newton.steps()
        ),
        "<strong>sigma.</strong> The footnote multiplies a row vector by a matrix of the wrong \
         shape; sigma picks (theta, theta_dot)."
            .to_owned(),
        format!(
            "<strong>Terminal cost.</strong> P is the solution of the <em>continuous</em> Riccati \
             equation (diagonal {}), used in a sum over samples. The discrete equation's P is about \
             1/t_s = 20 times as large, so the end of the horizon counts 20 times too little. The \
             built-in scenarios do as the paper does; other scenarios default to the discrete P.",
            diagonal(&regulator.lqr.p)
        ),
        "<strong>Predictor.</strong> The fastest pole of the model is -51.8 1/s, so one Runge-Kutta \
         step of 0.05 s has h lambda = -2.59, next to the method's stability limit of -2.785: the \
         sampled pole is 0.743, the exact one 0.075. The built-in scenarios do as the paper does; \
         without a [controller.predictor] table the number of steps follows from the fastest pole, \
         and a step that is too long is refused."
            .to_owned(),
        format!(
            "<strong>Guarantees.</strong> The proof that the paper leans on needs the terminal \
             equality to hold for the nonlinear model. It holds for the predictor with frozen \
             scheduling only: at the first sample of scenario 3 the nonlinear model ends {phi:.2} rad \
             in phi and {theta:.2} rad in theta away from the set point that the plan reaches. The \
             closed loop converges all the same, but that is an observation, not the theorem. \
             Likewise A - BK being Hurwitz at every frozen scheduling (largest real part {:.3} 1/s \
             over the grid) does not prove stability while the scheduling moves.",
            regulator.frozen.largest_real_part
        ),
        format!(
            "<strong>Overshoot.</strong> Scenario 1 is said to reach the origin without overshooting; \
             here phi goes {:.3} rad beyond it, {:.1} % of the jump. In scenario 3 the terminal \
             equality is said to lose performance: its closed-loop cost is higher, but it reaches pi \
             sooner ({:.2} s against {:.2} s to within 2 %), and overshoots by {:.3} rad.",
            -overshoot,
            -100.0 * overshoot / TAU,
            equality.reaches(PI, 0.02 * PI),
            cost.reaches(PI, 0.02 * PI),
            equality.largest_phi() - PI,
        ),
        "<strong>Times.</strong> The paper times single quadratic programs in MATLAB with YALMIP on \
         an Intel i7-8650U; the times here are of this program's whole step on another machine. \
         They show that the method is fit for real time, not which machine is faster."
            .to_owned(),
    ];
    let items: String = items
        .iter()
        .map(|item| format!("<li>{item}</li>\n"))
        .collect();
    format!("<ol>\n{items}</ol>")
}

fn diagonal(p: &nalgebra::DMatrix<f64>) -> String {
    let entries = p.diagonal();
    let entries = entries.iter().map(|entry| format!("{entry:.2}"));
    entries.collect::<Vec<_>>().join(", ")
}

fn verdict(reproduction: &Reproduction) -> String {
    format!(
        "<p>The check of the refined parameters against mechanics, over the tilt range of the \
         constraints, says:</p>\n<pre>{}</pre>\n<p>The closed loops above are still what the paper \
         computes: det M has no zero in that range, so the model is well defined, and controller \
         and plant share it.</p>",
        escape(&reproduction.refinement.consistency.to_string())
    )
}
