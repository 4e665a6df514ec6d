//! Whether an LPV embedding is the plant that it stands for.

use crate::number_text;
use lpvmpc::{Bounds, LpvModel};
use nalgebra::SVector;
use thiserror::Error;

/// The point of a box at which an embedding differs most from f.
#[derive(Debug, Clone, PartialEq)]
pub struct EmbeddingDefect<const NX: usize, const NU: usize> {
    /// The state.
    pub x: SVector<f64, NX>,
    /// The input.
    pub u: SVector<f64, NU>,
    /// A(s) x + B(s) u + c(s) - f(x, u) there, in state units per second.
    pub defect: SVector<f64, NX>,
    /// The largest component of the defect, over the largest |f| of that component that was seen (over 1
    /// where f has none).
    pub relative: f64,
}

/// Why an embedding could not be compared.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EmbeddingCheckError {
    /// A side of the box is missing, or the lower one is above the upper one.
    #[error(
        "the box must be finite: {variable}[{index}] is from {lower} to {upper}",
        lower = number_text(*lower),
        upper = number_text(*upper)
    )]
    Box {
        /// "x" or "u".
        variable: &'static str,
        /// Component, counted from 0.
        index: usize,
        /// Lower side.
        lower: f64,
        /// Upper side.
        upper: f64,
    },
    /// The embedding or f is not finite at a point of the box.
    #[error("{side} is not finite at x = {x:?}, u = {u:?}")]
    NotFinite {
        /// "the embedding" or "f".
        side: &'static str,
        /// The state.
        x: Vec<f64>,
        /// The input.
        u: Vec<f64>,
    },
}

/// Points from which the largest defect is climbed to.
const CLIMBS: usize = 5;
/// Halvings of a climb's step, from a quarter of the box on.
const HALVINGS: usize = 30;

/// Compares the embedding of `model`, A(s) x + B(s) u + c(s) with s = sigma(x, u), with `f`(x, u) over
/// the box of `x` and `u`, and returns the point where they differ most.
///
/// The box is looked at in its middle, at corners and at `points` further points that fill it evenly
/// (additive recurrence with the roots of x^(d+1) = x + 1; M. Roberts, 2018); from the worst of them
/// the defect is climbed along the axes. This finds mistakes; it is no proof that there are none.
///
/// # Errors
/// The box is not finite, or a value at one of its points is not.
pub fn embedding_defect<P, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    f: impl Fn(&SVector<f64, NX>, &SVector<f64, NU>) -> SVector<f64, NX>,
    (x, u): (&Bounds<f64, NX>, &Bounds<f64, NU>),
    points: usize,
) -> Result<EmbeddingDefect<NX, NU>, EmbeddingCheckError>
where
    P: LpvModel<f64, NX, NU, NS>,
{
    let sides = [check("x", x)?, check("u", u)?].concat();
    let comparison = Comparison { model, f, sides };
    let mut scale = SVector::<f64, NX>::zeros();
    let mut seen = Vec::new();
    for share in shares(NX + NU, points) {
        let (defect, rate) = comparison.at(&share)?;
        scale = scale.zip_map(&rate, |most, rate| most.max(rate.abs()));
        seen.push((share, defect));
    }
    let scale = scale.map(|most| if most > 0.0 { most } else { 1.0 });
    let relative = |defect: &SVector<f64, NX>| defect.component_div(&scale).amax();
    seen.sort_by(|(_, a), (_, b)| relative(b).total_cmp(&relative(a)));
    seen.truncate(CLIMBS);
    let mut worst: Option<(Vec<f64>, SVector<f64, NX>)> = None;
    for start in seen {
        let top = comparison.climb(start, &relative)?;
        if worst
            .as_ref()
            .is_none_or(|(_, most)| relative(&top.1) > relative(most))
        {
            worst = Some(top);
        }
    }
    let (share, defect) = worst.unwrap_or((vec![0.5; NX + NU], SVector::zeros()));
    let (x, u) = comparison.point(&share);
    Ok(EmbeddingDefect {
        x,
        u,
        relative: relative(&defect),
        defect,
    })
}

/// A point of the box, by its share of each side, and the defect there.
type Found<const NX: usize> = (Vec<f64>, SVector<f64, NX>);

struct Comparison<'a, P, F> {
    model: &'a P,
    f: F,
    /// The sides of the box, of x, then of u.
    sides: Vec<(f64, f64)>,
}

impl<P, F> Comparison<'_, P, F> {
    /// The state and the input at these shares of the sides.
    fn point<const NX: usize, const NU: usize>(
        &self,
        share: &[f64],
    ) -> (SVector<f64, NX>, SVector<f64, NU>) {
        let at = |i: usize| {
            let (lower, upper) = self.sides[i];
            lower * (1.0 - share[i]) + upper * share[i]
        };
        (
            SVector::from_fn(|i, _| at(i)),
            SVector::from_fn(|i, _| at(NX + i)),
        )
    }

    /// The defect, and f, at a point.
    fn at<const NX: usize, const NU: usize, const NS: usize>(
        &self,
        share: &[f64],
    ) -> Result<(SVector<f64, NX>, SVector<f64, NX>), EmbeddingCheckError>
    where
        P: LpvModel<f64, NX, NU, NS>,
        F: Fn(&SVector<f64, NX>, &SVector<f64, NU>) -> SVector<f64, NX>,
    {
        let (x, u) = self.point(share);
        let scheduling = self.model.scheduling(&x, &u);
        let (a, b) = self.model.matrices(&scheduling);
        let linear = a * x + b * u;
        let embedded = self
            .model
            .offset(&scheduling)
            .map_or(linear, |c| linear + c);
        let rate = (self.f)(&x, &u);
        for (side, value) in [("the embedding", &embedded), ("f", &rate)] {
            if !value.iter().all(|entry| entry.is_finite()) {
                return Err(EmbeddingCheckError::NotFinite {
                    side,
                    x: x.as_slice().to_vec(),
                    u: u.as_slice().to_vec(),
                });
            }
        }
        Ok((embedded - rate, rate))
    }

    /// Uphill along the axes from a point, in steps that are halved where none leads up.
    fn climb<const NX: usize, const NU: usize, const NS: usize>(
        &self,
        start: Found<NX>,
        relative: &impl Fn(&SVector<f64, NX>) -> f64,
    ) -> Result<Found<NX>, EmbeddingCheckError>
    where
        P: LpvModel<f64, NX, NU, NS>,
        F: Fn(&SVector<f64, NX>, &SVector<f64, NU>) -> SVector<f64, NX>,
    {
        let (mut share, mut defect) = start;
        let mut step = 0.25;
        for _ in 0..HALVINGS {
            let mut higher = false;
            for i in 0..share.len() {
                for direction in [-step, step] {
                    let mut moved = share.clone();
                    moved[i] = (moved[i] + direction).clamp(0.0, 1.0);
                    let (found, _) = self.at(&moved)?;
                    if relative(&found) > relative(&defect) {
                        (share, defect, higher) = (moved, found, true);
                    }
                }
            }
            if !higher {
                step *= 0.5;
            }
        }
        Ok((share, defect))
    }
}

fn check<const K: usize>(
    variable: &'static str,
    bounds: &Bounds<f64, K>,
) -> Result<Vec<(f64, f64)>, EmbeddingCheckError> {
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    let checked = sides.enumerate().map(|(index, (lower, upper))| {
        let (lower, upper) = (*lower, *upper);
        if lower.is_finite() && upper.is_finite() && lower <= upper {
            Ok((lower, upper))
        } else {
            Err(EmbeddingCheckError::Box {
                variable,
                index,
                lower,
                upper,
            })
        }
    });
    checked.collect()
}

/// The middle of the unit cube, its corners (at most 1024 of them) and so many `points` between.
fn shares(dimension: usize, points: usize) -> impl Iterator<Item = Vec<f64>> {
    let middle = std::iter::once(vec![0.5; dimension]);
    let corners = (0..1_usize << dimension.min(10)).map(move |corner| {
        let side = |i: usize| {
            if corner >> (i % 10) & 1 == 1 {
                1.0
            } else {
                0.0
            }
        };
        (0..dimension).map(side).collect()
    });
    // The root of x^(d+1) = x + 1 by iteration.
    let ratio = (0..64).fold(1.5_f64, |root, _| {
        (1.0 + root).powf(1.0 / (dimension as f64 + 1.0))
    });
    let between = (1..=points).map(move |point| {
        let along = |i: usize| (0.5 + point as f64 / ratio.powi(i as i32 + 1)).fract();
        (0..dimension).map(along).collect()
    });
    middle.chain(corners).chain(between)
}
