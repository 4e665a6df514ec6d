//! Sequences of problems for a made-up stable linear time-varying plant, of any size and horizon.

use crate::BenchmarkError;
use crate::comparison::Contender;
use crate::contenders::Own;
use lpvmpc::{Bounds, Common, Ocp, SolverSettings, Stage, Terminal};
use nalgebra::{SMatrix, SVector};

/// Problems in a sequence.
pub const SAMPLES: usize = 20;
/// Where bounds that never matter lie, as a multiple of what the plan without bounds needs.
const FAR: f64 = 3.0;
/// Where the active bounds lie, as fractions of what the plan without bounds needs.
const TIGHT_INPUT: f64 = 0.5;
const TIGHT_STATE: f64 = 0.7;

/// Whether the bounds matter. They are there in either case, on every input and on the first
/// state, so that a solver has the same rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Far away from every plan.
    Inactive,
    /// Close enough that the plan without bounds violates them all along the horizon.
    Active,
}

/// Bounds +-input on every input, +-state on the first state.
#[derive(Clone, Copy)]
struct Limits {
    input: f64,
    state: f64,
}

/// [`SAMPLES`] problems with so many stages, of a loop that is closed with our solver; each begins where the first
/// input of the one before has led.
///
/// # Errors
/// [`BenchmarkError::NotSolved`].
pub fn problems<const NX: usize, const NU: usize>(
    stages: usize,
    activity: Activity,
) -> Result<Vec<Ocp<f64, NX, NU>>, BenchmarkError> {
    let unbounded = Limits {
        input: f64::INFINITY,
        state: f64::INFINITY,
    };
    let needed = needed_limits::<NX, NU>(problem(stages, 0, SVector::zeros(), unbounded))?;
    let (input, state) = match activity {
        Activity::Inactive => (FAR, FAR),
        Activity::Active => (TIGHT_INPUT, TIGHT_STATE),
    };
    let limits = Limits {
        input: input * needed.input,
        state: state * needed.state,
    };
    let mut problems = Vec::with_capacity(SAMPLES);
    let mut x = SVector::zeros();
    for k in 0..SAMPLES {
        let ocp = problem(stages, k, x, limits);
        let mut own = Own::new(std::slice::from_ref(&ocp), SolverSettings::default());
        let u = own.solve(0)?;
        x = state_matrix(k as f64) * x + input_matrix(k as f64) * u;
        problems.push(ocp);
    }
    Ok(problems)
}

fn needed_limits<const NX: usize, const NU: usize>(
    ocp: Ocp<f64, NX, NU>,
) -> Result<Limits, BenchmarkError> {
    let mut own = Own::new(std::slice::from_ref(&ocp), SolverSettings::default());
    own.solve(0)?;
    let plan = own.solution();
    let input = plan.u.iter().map(SVector::amax).fold(0.0, f64::max);
    let state = plan.x.iter().map(|x| x[0].abs()).fold(0.0, f64::max);
    Ok(Limits { input, state })
}

/// The problem at sample `k`, from `x0`: all states follow waves.
fn problem<const NX: usize, const NU: usize>(
    stages: usize,
    k: usize,
    x0: SVector<f64, NX>,
    limits: Limits,
) -> Ocp<f64, NX, NU> {
    let q = SMatrix::identity();
    let mut x = Bounds::none();
    x.lower[0] = -limits.state;
    x.upper[0] = limits.state;
    let mut ocp = Ocp {
        x0,
        common: Common {
            q,
            r: SMatrix::identity() * 0.1,
            x,
            u: Bounds {
                lower: SVector::repeat(-limits.input),
                upper: SVector::repeat(limits.input),
            },
            ..Common::default()
        },
        terminal: Terminal {
            p: q * 5.0,
            linear_x: wave(k + stages) * -5.0,
            x,
            ..Terminal::default()
        },
        ..Ocp::allocate(stages)
    };
    for (i, stage) in ocp.stages.iter_mut().enumerate() {
        *stage = Stage {
            a: state_matrix((k + i) as f64),
            b: input_matrix((k + i) as f64),
            linear_x: -wave(k + i),
            ..Stage::default()
        };
    }
    ocp
}

/// Damped oscillators whose frequencies drift, coupled weakly through every entry.
fn state_matrix<const NX: usize>(t: f64) -> SMatrix<f64, NX, NX> {
    SMatrix::from_fn(|i, j| {
        let pair = (i / 2) as f64;
        let angle = 0.3 + 0.1 * pair + 0.1 * (0.3 * t + pair).sin();
        let coupling = 0.02 * (1.0 + i as f64 * 1.7 + j as f64 * 2.3 + 0.2 * t).sin();
        let rotation = match (i / 2 == j / 2, i.cmp(&j)) {
            (false, _) => 0.0,
            (true, std::cmp::Ordering::Equal) => angle.cos(),
            (true, std::cmp::Ordering::Less) => angle.sin(),
            (true, std::cmp::Ordering::Greater) => -angle.sin(),
        };
        0.95 * rotation + coupling
    })
}

fn input_matrix<const NX: usize, const NU: usize>(t: f64) -> SMatrix<f64, NX, NU> {
    SMatrix::from_fn(|i, j| 0.3 * (0.7 + i as f64 * 1.3 + j as f64 * 2.9 + 0.1 * t).sin())
}

fn wave<const NX: usize>(k: usize) -> SVector<f64, NX> {
    SVector::from_fn(|j, _| (0.4 * k as f64 + j as f64).sin())
}
