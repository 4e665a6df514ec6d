//! A statement proved on a box by proving it on the parts that bisection leaves.

use lpvmpc_design::each;
use nalgebra::SVector;

/// The points with |x_i - centre_i| <= half_widths_i.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell<const N: usize> {
    pub centre: SVector<f64, N>,
    pub half_widths: SVector<f64, N>,
}

impl<const N: usize> Cell<N> {
    /// Its centre alone.
    pub fn middle(&self) -> Self {
        Self {
            half_widths: SVector::zeros(),
            ..*self
        }
    }

    /// Two cells that cover this one, cut across component `across`. They may overlap by rounding.
    fn halves(&self, across: usize) -> [Self; 2] {
        let half = 0.5 * self.half_widths[across];
        [-half, half].map(|shift| {
            let mut part = *self;
            part.centre[across] += shift;
            // The rounded centre may lie off by an ulp of it.
            let slack = self.centre[across].abs() * f64::EPSILON;
            part.half_widths[across] = (half + slack).next_up();
            part
        })
    }
}

/// What was found out about a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Finding {
    /// Nothing is claimed there.
    Outside,
    /// The statement holds, with this much to spare.
    Holds {
        /// Estimated distance to where it would not.
        spare: f64,
    },
    /// The statement is false at the centre, for certain.
    Fails,
    /// This way of proof cannot succeed here, whether the statement is true or not.
    Hopeless,
    /// Not decided; a cut across this component promises most.
    Open {
        /// Component, counted from 0.
        across: usize,
    },
}

/// A statement that was proved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Covered {
    /// Cells on which it was proved.
    pub cells: usize,
    /// The smallest spare.
    pub spare: f64,
}

/// A statement that was not proved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Uncovered<const N: usize> {
    /// It is false here.
    False { at: SVector<f64, N> },
    /// It could not be decided near here: the way of proof cannot succeed, or not with so many
    /// cells.
    Undecided { at: SVector<f64, N>, cells: usize },
}

/// A cell is not cut more often than this.
const MOST_CUTS: u32 = 60;
/// Cells that are looked at together, on as many threads as there are; a number of its own, so
/// that the result is the same on any number of threads.
const TOGETHER: usize = 64;

/// Proves a statement on `whole` by looking at `most_cells` cells at most. `progress` hears which
/// share of it is done.
pub(crate) fn cover<const N: usize>(
    whole: Cell<N>,
    most_cells: usize,
    examine: impl Fn(&Cell<N>) -> Finding + Sync,
    progress: &dyn Fn(f64),
) -> Result<Covered, Uncovered<N>> {
    let mut open = vec![(whole, 0_u32)];
    let mut covered = Covered {
        cells: 0,
        spare: f64::INFINITY,
    };
    let (mut examined, mut share) = (0, 0.0);
    while !open.is_empty() {
        let batch = open.split_off(open.len().saturating_sub(TOGETHER));
        let findings = each(&batch, |_, (cell, _)| examine(cell));
        for ((cell, cuts), finding) in batch.into_iter().zip(findings) {
            examined += 1;
            let at = cell.centre;
            match finding {
                Finding::Fails => return Err(Uncovered::False { at }),
                Finding::Hopeless => {
                    return Err(Uncovered::Undecided {
                        at,
                        cells: examined,
                    });
                }
                Finding::Open { .. } if cuts == MOST_CUTS || examined >= most_cells => {
                    return Err(Uncovered::Undecided {
                        at,
                        cells: examined,
                    });
                }
                Finding::Open { across } => {
                    open.extend(cell.halves(across).map(|half| (half, cuts + 1)));
                    continue;
                }
                Finding::Holds { spare } => {
                    covered.cells += 1;
                    covered.spare = covered.spare.min(spare);
                }
                Finding::Outside => {}
            }
            share += 0.5_f64.powi(cuts as i32);
        }
        progress(share);
    }
    Ok(covered)
}
