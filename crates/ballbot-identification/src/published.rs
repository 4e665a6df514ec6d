//! The published way to p: linear regression on signals that were differentiated.
//!
//! It is here to be compared with. Differentiation multiplies the noise, the regressors are noisy
//! themselves, and the controller that holds the robot ties the torque to that noise: the estimate
//! is biased, however long the log. A healthy robot can come out with the sign pattern of no
//! rigid body.

use crate::log::{BallAngle, Run};
use ballbot::LinearParameters;
use nalgebra::{Matrix3, Vector3};

/// p1 to p6 by linear regression, with the standard deviations that such a regression claims.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearRegression {
    /// p.
    pub parameters: LinearParameters<f64>,
    /// Claimed standard deviations of p1 to p6.
    pub standard_deviations: [f64; 6],
}

/// Least squares of phi_ddot and theta_ddot on (theta, phi_dot, torque), all derivatives by central
/// differences from row to row. `None` if the rows do not tell them.
pub fn regression(runs: &[Run], ball_angle: BallAngle) -> Option<LinearRegression> {
    let mut square = Matrix3::zeros();
    let (mut with_ball, mut with_body) = (Vector3::zeros(), Vector3::zeros());
    let (mut ball_square, mut body_square, mut count) = (0.0, 0.0, 0.0);
    for run in runs {
        for stretch in &run.stretches {
            for row in stretch.start + 1..stretch.end.saturating_sub(1) {
                let Some((regressors, ball, body)) = derivatives(run, row, ball_angle) else {
                    continue;
                };
                square += regressors * regressors.transpose();
                with_ball += regressors * ball;
                with_body += regressors * body;
                ball_square += ball * ball;
                body_square += body * body;
                count += 1.0;
            }
        }
    }
    let inverse = square.try_inverse()?;
    let solve = |with: Vector3<f64>, target_square: f64| {
        let factors = inverse * with;
        let variance = (target_square - with.dot(&factors)) / (count - 3.0);
        let deviations = inverse.diagonal().map(|entry| (entry * variance).sqrt());
        (factors, deviations)
    };
    let (ball, ball_deviations) = solve(with_ball, ball_square);
    let (body, body_deviations) = solve(with_body, body_square);
    let finite = (ball.sum() + body.sum()).is_finite() && count > 3.0;
    finite.then(|| LinearRegression {
        parameters: LinearParameters {
            p1: ball[0],
            p2: ball[1],
            p3: ball[2],
            p4: body[0],
            p5: body[1],
            p6: body[2],
        },
        standard_deviations: [
            ball_deviations[0],
            ball_deviations[1],
            ball_deviations[2],
            body_deviations[0],
            body_deviations[1],
            body_deviations[2],
        ],
    })
}

/// ((theta, phi_dot, torque), phi_ddot, theta_ddot) at a row.
fn derivatives(run: &Run, row: usize, ball_angle: BallAngle) -> Option<(Vector3<f64>, f64, f64)> {
    let [before, now, after] = [row - 1, row, row + 1].map(|row| {
        let outputs = run.outputs[row];
        match ball_angle {
            BallAngle::Inertial => outputs[0],
            BallAngle::RelativeToBody => outputs[0] + outputs[1],
        }
    });
    let (earlier, later) = (
        run.time[row] - run.time[row - 1],
        run.time[row + 1] - run.time[row],
    );
    let span = earlier + later;
    let phi_dot = (after - before) / span;
    let phi_ddot = 2.0 * ((after - now) / later - (now - before) / earlier) / span;
    let theta_ddot = (run.outputs[row + 1][2] - run.outputs[row - 1][2]) / span;
    let regressors = Vector3::new(run.outputs[row][1], phi_dot, run.torque[row]);
    let finite = (regressors.sum() + phi_ddot + theta_ddot).is_finite();
    finite.then_some((regressors, phi_ddot, theta_ddot))
}
