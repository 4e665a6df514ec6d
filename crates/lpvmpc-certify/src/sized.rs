//! Certificates in a size that was compiled.

use crate::certificate::{Certificate, EquilibriumClaim, PlantName, Record, matrix, plant_hash};
use crate::design::Design;
use crate::equilibrium::{enclosed, refined, refuted};
use crate::error::CertifyError;
use crate::settings::CertifySettings;
use lpvmpc_certificate::{
    ClaimError, MOST_BOXES, Proof, SampledClaim, TerminalClaim, TerminalProblem,
};
use lpvmpc_design::checked_symmetric;
use lpvmpc_plant::{AboutEquilibrium, Plant, Signal};
use nalgebra::{DMatrix, SMatrix, SVector};

/// The contraction that is claimed, of the one that was designed: the rest is left to the proof.
const CLAIMED_SHARE: f64 = 0.01;
/// Limits are met to rounding by the design, and with this by the claim.
const INSIDE: f64 = 1.0 - 1e-6;
/// How often a level is lowered because the states go beyond a limit between the samples.
const MOST_LOWERED: u32 = 3;
/// Sizes of sets that are tried: the bounds, and halves of them.
const MOST_HALVINGS: i32 = 8;
/// What an equilibrium that is not exact is claimed to be known to, at best.
const NEARLY: f64 = 1e-15;
/// And from where the plant stands a claim's equilibrium may be as far as this, beside its size: what solving for it leaves.
const FARTHEST: f64 = 1e-9;
/// Up to so many states a box takes milliseconds, beyond up to a second.
const FEW_STATES: usize = 8;
/// A level that is higher by less is not worth a proof.
const WORTH_IT: f64 = 1.05;

/// What was proved of a certificate.
#[derive(Debug, Clone, PartialEq)]
pub struct Verified {
    /// Boxes of states on which the decrease was proved.
    pub boxes: usize,
    /// Where |x - x_eq| is at and between the samples, at most; state units.
    pub reach: Vec<f64>,
}

/// Places that are left over decay by e each sample.
fn spare_rate(t_s: f64) -> f64 {
    1.0 / t_s
}

type About<const NX: usize, const NU: usize, const NS: usize> = AboutEquilibrium<NX, NU, NS>;

pub(crate) fn certify<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    settings: &CertifySettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Certificate, CertifyError> {
    let data = plant.data();
    let (n, m) = (data.states.len(), data.inputs.len());
    let q = weight(&settings.q, n, "q")?;
    let r = with_ones(weight(&settings.r, m, "r")?, m);
    let wanted = wanted(plant, settings)?;
    let ends: Vec<(f64, f64)> = wanted.iter().map(|value| (*value, *value)).collect();
    let about = About::<NX, NU, NS>::new(plant, &ends, spare_rate(settings.t_s))?;
    let at = refined(plant, about.clone(), &wanted)?;
    let ends = enclosed(plant, about.clone(), &at)?;
    let about = about.about(&ends)?;
    let limits =
        |bounds: &Option<(Vec<f64>, Vec<f64>)>, signals: &[Signal], first: usize, place| {
            limits(bounds, signals, &ends[first..first + signals.len()], place)
        };
    let x_limits = limits(&settings.x_bounds, &data.states, 0, "x_bounds")?;
    let u_limits = limits(&settings.u_bounds, &data.inputs, n, "u_bounds")?;
    let problem = TerminalProblem {
        t_s: settings.t_s,
        q,
        r,
        state_limits: filled(&x_limits),
        input_limits: filled(&u_limits),
        contraction: 0.0,
        level: 1.0,
    };
    let design = Design::new(&about, problem.clone(), (n, m), settings.enlargement)?;
    let few = if n > FEW_STATES { 8 } else { 4000 };
    let most_boxes = settings.most_boxes.unwrap_or(few).clamp(1, MOST_BOXES);
    let claim = |size: f64| -> Result<_, CertifyError> {
        // There is none yet of the proof.
        let found = design.ingredients(size, &|| progress(0.0))?;
        let mut claim = SampledClaim {
            t_s: settings.t_s,
            q: problem.q,
            r: problem.r,
            state_limits: problem.state_limits,
            input_limits: problem.input_limits,
            terminal: TerminalClaim {
                k: found.k,
                p: found.p,
                level: found.level * INSIDE,
                contraction: design.problem.contraction * CLAIMED_SHARE,
            },
            states: n,
        };
        let mut lowered = 0;
        loop {
            match claim.prove(&about, most_boxes, progress) {
                Ok(proof) => return Ok((claim, proof)),
                // The design knows the limits at the samples; between them the states go a little farther. Where they
                // go grows with the root of the level, roughly.
                Err(ClaimError::LimitNotShown { reach, limit, .. })
                    if lowered < MOST_LOWERED && limit < reach && reach.is_finite() =>
                {
                    claim.terminal.level *= (limit / reach).powi(2) * INSIDE;
                    lowered += 1;
                }
                Err(error) => return Err(error.into()),
            }
        }
    };
    let halvings = if design.is_linear() { 0 } else { MOST_HALVINGS };
    let raised = |found| raised(&about, found, settings.trials, most_boxes, progress);
    let mut best: Result<(SampledClaim<NX, NU>, Proof<NX>), _> = claim(1.0).map(&raised);
    for i in 1..=halvings {
        let found = claim(0.5_f64.powi(i)).map(&raised);
        // One law has to cope with all plants of a box: of a smaller one the set may be larger.
        let done = best.is_ok();
        best = match (best, found) {
            (Ok(best), Ok(found)) if volume(&found.0) > volume(&best.0) => Ok(found),
            (Err(_), Ok(found)) => Ok(found),
            (best, _) => best,
        };
        if done {
            break;
        }
    }
    let (claim, proof) = best?;
    let within = ends.iter().zip(&at).map(|((lower, upper), value)| {
        let distance = (upper - value).max(value - lower);
        // A figure for people, and not less than a number of this size is known to.
        let rounding = NEARLY * (1.0 + value.abs());
        if distance > 0.0 {
            distance.next_up().max(rounding)
        } else {
            0.0
        }
    });
    let tight = |limit: f64, reach: f64| Some(limit.min(reach * (2.0 - INSIDE)));
    let finite = |limit: f64| Some(limit).filter(|limit| limit.is_finite());
    Ok(Certificate {
        written_by: settings.written_by.clone(),
        plant: PlantName {
            name: data.name.clone(),
            sha256: plant_hash(plant)?,
        },
        t_s: claim.t_s,
        equilibrium: EquilibriumClaim {
            x: at[..n].to_vec(),
            u: at[n..].to_vec(),
            within: within.collect(),
        },
        q: rows(&claim.q, n, n),
        r: rows(&claim.r, m, m),
        state_limits: (0..n)
            .map(|i| tight(claim.state_limits[i], proof.reach[i]))
            .collect(),
        input_limits: (0..m).map(|i| finite(claim.input_limits[i])).collect(),
        k: rows(&claim.terminal.k, m, n),
        p: rows(&claim.terminal.p, n, n),
        level: claim.terminal.level,
        contraction: claim.terminal.contraction,
        record: Record {
            boxes: proof.boxes,
            smallest_contraction: proof.smallest_contraction,
        },
    })
}

/// The logarithm of the set's volume, up to a constant.
fn volume<const NX: usize, const NU: usize>(claim: &SampledClaim<NX, NU>) -> f64 {
    let n = claim.states;
    let form = claim.terminal.p.view((0, 0), (n, n)) / claim.terminal.level;
    let diagonal = form
        .into_owned()
        .cholesky()
        .map(|factor| factor.l().diagonal());
    diagonal.map_or(f64::NEG_INFINITY, |diagonal| -diagonal.map(f64::ln).sum())
}

/// With the highest level that was proved, by halves (in ratio) between what is proved and what cannot be.
fn raised<const NX: usize, const NU: usize, const NS: usize>(
    about: &About<NX, NU, NS>,
    found: (SampledClaim<NX, NU>, Proof<NX>),
    trials: usize,
    most_boxes: usize,
    progress: &(dyn Fn(f64) + Sync),
) -> (SampledClaim<NX, NU>, Proof<NX>) {
    if trials == 0 {
        return found;
    }
    let base = found.0.clone();
    // Of places left over there is no bound.
    let mut reach = found.1.reach;
    reach.rows_mut(base.states, NX - base.states).fill(0.0);
    let (mut low, mut high) = (1.0, base.highest_factor(about, &reach) * INSIDE);
    let mut best = found;
    for trial in 0..trials {
        if high < low * WORTH_IT {
            break;
        }
        // What is in the way may be a limit, and the highest level provable.
        let factor = if trial == 0 {
            high
        } else {
            f64::sqrt(low * high)
        };
        let mut claim = base.clone();
        claim.terminal.level *= factor;
        match claim.prove(about, most_boxes, progress) {
            Ok(proof) => {
                low = factor;
                best = (claim, proof);
            }
            Err(_) => high = factor,
        }
    }
    best
}

pub(crate) fn verify<const NX: usize, const NU: usize, const NS: usize>(
    certificate: &Certificate,
    plant: &Plant,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Verified, CertifyError> {
    let data = plant.data();
    let (n, m) = (data.states.len(), data.inputs.len());
    let EquilibriumClaim { x, u, within } = &certificate.equilibrium;
    check_length("equilibrium.x", x.len(), n)?;
    check_length("equilibrium.u", u.len(), m)?;
    check_length("equilibrium.within", within.len(), n + m)?;
    let at = [x.as_slice(), u.as_slice()].concat();
    for (value, within) in at.iter().zip(within) {
        if !(value.is_finite() && *within >= 0.0 && within.is_finite()) {
            let fault = "it must have finite numbers, and distances that are not negative";
            return Err(CertifyError::setting("equilibrium", fault));
        }
        // The law is about the numbers of the file, and the proof about where the plant stands.
        let most = FARTHEST * (1.0 + value.abs());
        if *within > most {
            let fault = format!(
                "the plant may stand {within} away from {value}; a claim about that number must be within {most}"
            );
            return Err(CertifyError::setting("equilibrium.within", fault));
        }
    }
    if !(certificate.t_s > 0.0 && certificate.t_s.is_finite()) {
        let fault = format!(
            "it is {}; it must be a positive number of seconds",
            certificate.t_s
        );
        return Err(CertifyError::setting("t_s", fault));
    }
    let ends: Vec<(f64, f64)> = at.iter().map(|value| (*value, *value)).collect();
    let about = About::<NX, NU, NS>::new(plant, &ends, spare_rate(certificate.t_s))?;
    let claimed = at.iter().zip(within);
    let claimed = claimed.map(|(v, w)| ((v - w).next_down(), (v + w).next_up()));
    refuted(plant, &claimed.collect::<Vec<_>>())?;
    let ends = enclosed(plant, about.clone(), &at)?;
    let near = { ends.iter().zip(&at).zip(within) }
        .all(|(((lower, upper), v), within)| *upper - v <= *within && v - *lower <= *within);
    if !near {
        return Err(CertifyError::EquilibriumNotShown {
            within: "within the claimed distance",
            hint: "there may be one all the same",
        });
    }
    let about = about.about(&ends)?;
    let mut p = placed(&matrix(&certificate.p, (n, n), "p")?, n, "p")?;
    for i in n..NX {
        p[(i, i)] = certificate.level;
    }
    let claim = SampledClaim {
        t_s: certificate.t_s,
        q: placed(&matrix(&certificate.q, (n, n), "q")?, n, "q")?,
        r: with_ones(placed(&matrix(&certificate.r, (m, m), "r")?, m, "r")?, m),
        state_limits: filled(&claimed_limits(
            &certificate.state_limits,
            n,
            "state_limits",
        )?),
        input_limits: filled(&claimed_limits(
            &certificate.input_limits,
            m,
            "input_limits",
        )?),
        terminal: TerminalClaim {
            k: {
                let k = matrix(&certificate.k, (m, n), "k")?;
                SMatrix::from_fn(|i, j| k.get((i, j)).copied().unwrap_or(0.0))
            },
            p,
            level: certificate.level,
            contraction: certificate.contraction,
        },
        states: n,
    };
    let proof = claim
        .prove(&about, MOST_BOXES, progress)
        .map_err(|error| truncated(error, n))?;
    Ok(Verified {
        boxes: proof.boxes,
        reach: proof.reach.as_slice()[..n].to_vec(),
    })
}

/// Without the places left over of a state.
fn truncated(error: ClaimError, n: usize) -> CertifyError {
    let mut error = error;
    if let ClaimError::Limit { state, .. }
    | ClaimError::NoDecrease { state, .. }
    | ClaimError::DecreaseNotShown { state, .. } = &mut error
    {
        state.truncate(n);
    }
    CertifyError::Claim(error)
}

/// The equilibrium that is asked for: states, then inputs.
fn wanted(plant: &Plant, settings: &CertifySettings) -> Result<Vec<f64>, CertifyError> {
    let data = plant.data();
    let (n, m) = (data.states.len(), data.inputs.len());
    let given = settings.equilibrium.clone();
    let (x, u) = given.unwrap_or_else(|| plant.operating_point());
    check_length("equilibrium x", x.len(), n)?;
    check_length("equilibrium u", u.len(), m)?;
    let wanted = [x, u].concat();
    if wanted.iter().all(|value| value.is_finite()) {
        return Ok(wanted);
    }
    Err(CertifyError::setting(
        "equilibrium",
        "it must have finite numbers",
    ))
}

/// How far each component may be from its enclosed equilibrium; infinite where nothing bounds it.
fn limits(
    bounds: &Option<(Vec<f64>, Vec<f64>)>,
    signals: &[Signal],
    ends: &[(f64, f64)],
    place: &'static str,
) -> Result<Vec<f64>, CertifyError> {
    if let Some((lower, upper)) = bounds {
        check_length(place, lower.len(), signals.len())?;
        check_length(place, upper.len(), signals.len())?;
    }
    let limit = |(i, signal): (usize, &Signal)| {
        let (lower, upper) = match bounds {
            Some((lower, upper)) => (lower[i], upper[i]),
            None => (
                signal.lower.unwrap_or(f64::NEG_INFINITY),
                signal.upper.unwrap_or(f64::INFINITY),
            ),
        };
        let room = (upper - ends[i].1).min(ends[i].0 - lower);
        let room = if room.is_finite() {
            room.next_down()
        } else {
            room
        };
        // Negated, so that NaN fails.
        if !(room > 0.0) {
            let fault = format!(
                "{} is {} at the equilibrium, and its bounds are {lower} to {upper}; it must lie between them",
                signal.name, ends[i].0
            );
            return Err(CertifyError::setting(place, fault));
        }
        Ok(room)
    };
    signals.iter().enumerate().map(limit).collect()
}

fn check_length(place: &str, found: usize, count: usize) -> Result<(), CertifyError> {
    if found == count {
        return Ok(());
    }
    let fault = format!("it has {found} entries; there must be {count}");
    Err(CertifyError::setting(place, fault))
}

/// A square matrix of `count` rows in more places, zero in those left over.
fn placed<const N: usize>(
    matrix: &DMatrix<f64>,
    count: usize,
    place: &str,
) -> Result<SMatrix<f64, N, N>, CertifyError> {
    if matrix.shape() != (count, count) {
        let (rows, columns) = matrix.shape();
        let fault = format!("it is {rows} x {columns}; it must be {count} x {count}");
        return Err(CertifyError::setting(place, fault));
    }
    Ok(SMatrix::from_fn(|i, j| {
        matrix.get((i, j)).copied().unwrap_or(0.0)
    }))
}

/// The symmetric part of a weight that is symmetric up to rounding, in more places: of a claim's the entries are
/// mirrored exactly.
fn weight<const N: usize>(
    matrix: &DMatrix<f64>,
    count: usize,
    place: &'static str,
) -> Result<SMatrix<f64, N, N>, CertifyError> {
    let symmetric = checked_symmetric(place, matrix);
    let symmetric = symmetric.map_err(|error| CertifyError::setting("weights", error))?;
    placed(&symmetric, count, place)
}

/// With one on the diagonal behind `count` rows.
fn with_ones<const N: usize>(matrix: SMatrix<f64, N, N>, count: usize) -> SMatrix<f64, N, N> {
    let mut matrix = matrix;
    for i in count..N {
        matrix[(i, i)] = 1.0;
    }
    matrix
}

fn filled<const N: usize>(limits: &[f64]) -> SVector<f64, N> {
    SVector::from_fn(|i, _| limits.get(i).copied().unwrap_or(f64::INFINITY))
}

fn claimed_limits(
    limits: &[Option<f64>],
    count: usize,
    place: &str,
) -> Result<Vec<f64>, CertifyError> {
    check_length(place, limits.len(), count)?;
    Ok(limits
        .iter()
        .map(|limit| limit.unwrap_or(f64::INFINITY))
        .collect())
}

fn rows<const R: usize, const C: usize>(
    matrix: &SMatrix<f64, R, C>,
    n: usize,
    m: usize,
) -> Vec<Vec<f64>> {
    (0..n)
        .map(|i| (0..m).map(|j| matrix[(i, j)]).collect())
        .collect()
}
