//! How near the LPV controller comes to the optimum: its closed-loop costs over those of nonlinear
//! MPC, which another program has solved to convergence with IPOPT (`testdata/nonlinear-mpc`).

mod case;
mod run;
mod summary;

pub use case::{Case, distances, narrow_bounds, random_starts, rising_prices};
pub use run::{Outcome, guaranteed_cost, run, run_all};
pub use summary::Summary;

/// The value below which the part `share` of the `sorted` values lies; NaN without values.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let index = (share * sorted.len() as f64).ceil() as usize;
    sorted
        .get(index.saturating_sub(1))
        .copied()
        .unwrap_or(f64::NAN)
}
