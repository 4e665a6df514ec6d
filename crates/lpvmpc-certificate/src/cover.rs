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

/// Cells after which it is looked at whether so many as there may be are enough.
const FEW: usize = 15;
/// Points towards which the whole is cut to see that, and by how many halvings their cells may be smaller than equal
/// cells would be: cells differ in size, and some points lie in the smallest ones.
const DIVES: u32 = 4;
const MARGIN: u32 = 3;

/// Proves a statement on `whole` by looking at `most_cells` cells at most; fewer, where it is clear that so many are not
/// enough. `progress` hears which share of it is done.
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
    let mut enough = false;
    while !open.is_empty() {
        if !enough && examined >= FEW {
            let deepest = most_cells.max(1).ilog2() + MARGIN;
            examined += dive(&whole, deepest, &examine)?;
            enough = true;
        }
        let batch = open.split_off(open.len().saturating_sub(TOGETHER));
        let findings = each(&batch, |_, (cell, _)| examine(cell));
        for ((cell, cuts), finding) in batch.into_iter().zip(findings) {
            examined += 1;
            let at = cell.centre;
            match finding {
                Finding::Fails => return Err(Uncovered::False { at }),
                Finding::Hopeless => return Err(undecided(at, examined)),
                Finding::Open { .. } if cuts == MOST_CUTS || examined >= most_cells => {
                    return Err(undecided(at, examined));
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

/// Cuts `whole` towards a few points, to see of what size the cells are on which the statement can be proved: an error
/// if all of them are cut `deepest` times, or if it fails on the way. Returns how many cells were looked at.
fn dive<const N: usize>(
    whole: &Cell<N>,
    deepest: u32,
    examine: &(impl Fn(&Cell<N>) -> Finding + Sync),
) -> Result<usize, Uncovered<N>> {
    let mut cells: Vec<_> = (0..DIVES)
        .map(|dive| (*whole, inside(whole, dive)))
        .collect();
    let mut looked_at = 0;
    for _ in 0..deepest {
        let findings = each(&cells, |_, (cell, _)| examine(cell));
        looked_at += findings.len();
        for ((cell, towards), finding) in cells.iter_mut().zip(findings) {
            let at = cell.centre;
            match finding {
                Finding::Fails => return Err(Uncovered::False { at }),
                Finding::Hopeless => return Err(undecided(at, looked_at)),
                Finding::Open { across } => {
                    let upper = towards[across] > at[across];
                    *cell = cell.halves(across)[usize::from(upper)];
                }
                Finding::Holds { .. } | Finding::Outside => return Ok(looked_at),
            }
        }
    }
    Err(undecided(cells[0].0.centre, looked_at))
}

fn undecided<const N: usize>(at: SVector<f64, N>, cells: usize) -> Uncovered<N> {
    Uncovered::Undecided { at, cells }
}

/// A point of the ellipsoid in the cell, the same each time, another one for every `number`; they are spread evenly.
fn inside<const N: usize>(cell: &Cell<N>, number: u32) -> SVector<f64, N> {
    let mut state = number;
    // A linear congruential generator (Numerical Recipes), from 0 to 1.
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state) / f64::from(u32::MAX)
    };
    let radius = next().powf(1.0 / N as f64);
    let direction = SVector::<f64, N>::from_fn(|_, _| next() - 0.5);
    let direction = direction / direction.norm().max(f64::MIN_POSITIVE);
    cell.centre + cell.half_widths.component_mul(&direction) * radius
}
