//! Every number of a problem, one after the other.

use lpvmpc::{Bounds, Ocp, Penalty, Softness};
use nalgebra::SMatrix;

/// Offers every number of the problem to `visit`, stage by stage, the terminal ones last.
pub fn each<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
    visit: &mut impl FnMut(&mut f64),
) {
    matrix(&mut ocp.x0, visit);
    for stage in &mut ocp.stages {
        matrix(&mut stage.a, visit);
        matrix(&mut stage.b, visit);
        matrix(&mut stage.c, visit);
        matrix(&mut stage.q, visit);
        matrix(&mut stage.r, visit);
        matrix(&mut stage.s, visit);
        matrix(&mut stage.linear_x, visit);
        matrix(&mut stage.linear_u, visit);
        bounds(&mut stage.x, visit);
        prices(&mut stage.soft_x, visit);
        bounds(&mut stage.u, visit);
        matrix(&mut stage.row_x, visit);
        matrix(&mut stage.row_u, visit);
        bounds(&mut stage.rows, visit);
        prices(&mut stage.soft_rows, visit);
    }
    let end = &mut ocp.terminal;
    matrix(&mut end.p, visit);
    matrix(&mut end.linear_x, visit);
    bounds(&mut end.x, visit);
    prices(&mut end.soft_x, visit);
    matrix(&mut end.row_x, visit);
    bounds(&mut end.rows, visit);
    prices(&mut end.soft_rows, visit);
    if let Some(target) = &mut end.equality {
        matrix(target, visit);
    }
}

fn matrix<const R: usize, const C: usize>(
    m: &mut SMatrix<f64, R, C>,
    visit: &mut impl FnMut(&mut f64),
) {
    m.iter_mut().for_each(visit);
}

fn bounds<const K: usize>(bounds: &mut Bounds<f64, K>, visit: &mut impl FnMut(&mut f64)) {
    matrix(&mut bounds.lower, visit);
    matrix(&mut bounds.upper, visit);
}

fn prices<const K: usize>(soft: &mut Softness<f64, K>, visit: &mut impl FnMut(&mut f64)) {
    for Penalty { linear, quadratic } in soft.iter_mut().flatten() {
        visit(linear);
        visit(quadratic);
    }
}
