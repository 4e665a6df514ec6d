//! Where each number of a problem stands: x_0, the blocks of the stages, the block of the end. Matrices
//! are stored by columns.

use crate::ProblemError;
use lpvmpc::{Bounds, GeneralRow, List, Ocp, Penalty, SoftBounds};
use nalgebra::{SMatrix, SVector};

/// Parts of a stage's block, in this order: A, B, c, Q, R, S, linear cost of x and u; bounds of x (lower,
/// upper) and their prices (linear, quadratic); bounds of u (lower, upper); general rows: coefficients of x
/// and u, bounds (lower, upper), prices (linear, quadratic).
pub const STAGE_PARTS: usize = 20;

/// Parts of the block of the end: P, its linear cost; bounds of x and their prices; general rows:
/// coefficients of x, bounds, prices.
pub const END_PARTS: usize = 11;

/// Sizes of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// States.
    pub nx: usize,
    /// Inputs.
    pub nu: usize,
    /// Stages.
    pub horizon: usize,
    /// General rows of each stage and of the end.
    pub rows: usize,
}

/// The parts of a stage's block; `None` leaves what there is.
pub type StageParts<'a> = [Option<&'a [f64]>; STAGE_PARTS];
/// The parts of the block of the end; `None` leaves what there is.
pub type EndParts<'a> = [Option<&'a [f64]>; END_PARTS];

impl Sizes {
    /// Sizes of a problem of `lpvmpc`.
    pub fn of<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Self {
        Self {
            nx: NX,
            nu: NU,
            horizon: ocp.length(),
            rows: ocp.rows_per_stage,
        }
    }

    /// Numbers in each part of a stage's block.
    pub fn of_stage(&self) -> [usize; STAGE_PARTS] {
        let Self { nx, nu, rows, .. } = *self;
        let (weights, row) = ([nx * nx, nu * nu, nu * nx], rows);
        [
            nx * nx,
            nx * nu,
            nx,
            weights[0],
            weights[1],
            weights[2],
            nx,
            nu,
            nx,
            nx,
            nx,
            nx,
            nu,
            nu,
            rows * nx,
            rows * nu,
            row,
            row,
            row,
            row,
        ]
    }

    /// Numbers in each part of the block of the end.
    pub fn of_end(&self) -> [usize; END_PARTS] {
        let Self { nx, rows, .. } = *self;
        [
            nx * nx,
            nx,
            nx,
            nx,
            nx,
            nx,
            rows * nx,
            rows,
            rows,
            rows,
            rows,
        ]
    }

    /// Numbers of a whole problem.
    pub fn of_problem(&self) -> usize {
        let stage: usize = self.of_stage().iter().sum();
        self.nx + self.horizon * stage + self.of_end().iter().sum::<usize>()
    }
}

/// Appends the numbers of `ocp`.
///
/// # Errors
/// [`ProblemError::NotInFormat`]: a terminal equality.
pub fn write<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    numbers: &mut Vec<f64>,
) -> Result<(), ProblemError> {
    if ocp.terminal.equality.is_some() {
        return Err(ProblemError::NotInFormat("terminal equality"));
    }
    numbers.extend(&ocp.x0);
    for (i, stage) in ocp.stages.iter().enumerate().take(ocp.length()) {
        let common = ocp.common_at(i);
        numbers.extend(&stage.a);
        numbers.extend(&stage.b);
        numbers.extend(&stage.c);
        numbers.extend(&common.q);
        numbers.extend(&common.r);
        numbers.extend(&common.s);
        numbers.extend(&stage.linear_x);
        numbers.extend(&stage.linear_u);
        write_bounds(&common.x, &common.soft_x, numbers);
        numbers.extend(&common.u.lower);
        numbers.extend(&common.u.upper);
        write_rows(ocp, i, numbers);
    }
    numbers.extend(&ocp.terminal.p);
    numbers.extend(&ocp.terminal.linear_x);
    write_bounds(&ocp.terminal.x, &ocp.terminal.soft_x, numbers);
    write_rows(ocp, ocp.length(), numbers);
    Ok(())
}

fn write_bounds<const K: usize>(
    bounds: &Bounds<f64, K>,
    soft: &SoftBounds<f64, K>,
    numbers: &mut Vec<f64>,
) {
    numbers.extend(&bounds.lower);
    numbers.extend(&bounds.upper);
    write_prices(soft.iter(), numbers);
}

/// An infinite linear price stands for a hard bound.
fn write_prices<'a>(
    soft: impl Iterator<Item = &'a Option<Penalty<f64>>> + Clone,
    numbers: &mut Vec<f64>,
) {
    let linear = |price: &Option<Penalty<f64>>| price.map_or(f64::INFINITY, |price| price.linear);
    let quadratic = |price: &Option<Penalty<f64>>| price.map_or(0.0, |price| price.quadratic);
    numbers.extend(soft.clone().map(linear));
    numbers.extend(soft.map(quadratic));
}

/// The rows of stage `i` by columns of their coefficients.
fn write_rows<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    i: usize,
    numbers: &mut Vec<f64>,
) {
    let end = i == ocp.length();
    let rows = || (0..ocp.rows_per_stage).filter_map(|j| ocp.row(i, j));
    for column in 0..NX {
        numbers.extend(rows().map(|row| row.x[column]));
    }
    for column in (0..NU).filter(|_| !end) {
        numbers.extend(rows().map(|row| row.u[column]));
    }
    numbers.extend(rows().map(|row| row.lower));
    numbers.extend(rows().map(|row| row.upper));
    write_prices(rows().map(|row| &row.soft), numbers);
}

/// A problem of these sizes with no cost but unit input weights, and no bounds. With `common` weights and
/// bounds are kept once for all stages.
///
/// # Errors
/// [`ProblemError::Size`].
pub fn empty<const NX: usize, const NU: usize>(
    sizes: &Sizes,
    common: bool,
) -> Result<Ocp<f64, NX, NU>, ProblemError> {
    for (what, found, wanted) in [("nx", sizes.nx, NX), ("nu", sizes.nu, NU)] {
        if found != wanted {
            return Err(ProblemError::Size {
                what,
                found,
                wanted,
            });
        }
    }
    let mut ocp = Ocp::allocate(sizes.horizon);
    if !common {
        ocp.own = List::repeat(ocp.common, sizes.horizon);
    }
    ocp.rows_per_stage = sizes.rows;
    ocp.rows = List::repeat(GeneralRow::default(), (sizes.horizon + 1) * sizes.rows);
    Ok(ocp)
}

/// Takes over the numbers of a whole problem.
///
/// # Errors
/// [`ProblemError::Length`].
pub fn read<const NX: usize, const NU: usize>(
    numbers: &[f64],
    ocp: &mut Ocp<f64, NX, NU>,
) -> Result<(), ProblemError> {
    let sizes = Sizes::of(ocp);
    let wanted = sizes.of_problem();
    let found = numbers.len();
    if found != wanted {
        return Err(ProblemError::Length { found, wanted });
    }
    let (x0, mut rest) = numbers.split_at(NX);
    ocp.x0 = SVector::from_column_slice(x0);
    for i in 0..sizes.horizon {
        let parts = split(&mut rest, sizes.of_stage());
        put_stage(&parts, i, ocp)?;
    }
    put_end(&split(&mut rest, sizes.of_end()), ocp)
}

/// The next parts of these lengths, taken from `rest`, which must hold as many numbers.
fn split<'a, const PARTS: usize>(
    rest: &mut &'a [f64],
    lengths: [usize; PARTS],
) -> [Option<&'a [f64]>; PARTS] {
    lengths.map(|length| {
        let (part, behind) = rest.split_at_checked(length)?;
        *rest = behind;
        Some(part)
    })
}

/// Takes over the parts of stage `i`. Where weights and bounds are kept once, those of any stage hold at all.
///
/// # Errors
/// [`ProblemError::Size`]: no such stage. [`ProblemError::Length`]: a part of another length.
pub fn put_stage<const NX: usize, const NU: usize>(
    parts: &StageParts<'_>,
    i: usize,
    ocp: &mut Ocp<f64, NX, NU>,
) -> Result<(), ProblemError> {
    check_lengths(parts, &Sizes::of(ocp).of_stage())?;
    let wanted = ocp.length();
    let no_stage = || ProblemError::Size {
        what: "stage",
        found: i,
        wanted,
    };
    let stage = ocp.stages.get_mut(i).ok_or_else(no_stage)?;
    let [
        a,
        b,
        c,
        q,
        r,
        s,
        linear_x,
        linear_u,
        x @ ..,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
    ] = parts;
    put(a, &mut stage.a);
    put(b, &mut stage.b);
    put(c, &mut stage.c);
    put(linear_x, &mut stage.linear_x);
    put(linear_u, &mut stage.linear_u);
    let common = ocp.own.get_mut(i).unwrap_or(&mut ocp.common);
    put(q, &mut common.q);
    put(r, &mut common.r);
    put(s, &mut common.s);
    put_bounds(x, &mut common.x, &mut common.soft_x);
    let [.., u_lower, u_upper, x, u, lower, upper, linear, quadratic] = parts;
    put(u_lower, &mut common.u.lower);
    put(u_upper, &mut common.u.upper);
    put_rows([x, u, lower, upper, linear, quadratic], i, ocp);
    Ok(())
}

/// Takes over the parts of the end.
///
/// # Errors
/// [`ProblemError::Length`]: a part of another length.
pub fn put_end<const NX: usize, const NU: usize>(
    parts: &EndParts<'_>,
    ocp: &mut Ocp<f64, NX, NU>,
) -> Result<(), ProblemError> {
    check_lengths(parts, &Sizes::of(ocp).of_end())?;
    let [p, linear_x, bounds @ .., x, lower, upper, linear, quadratic] = parts;
    put(p, &mut ocp.terminal.p);
    put(linear_x, &mut ocp.terminal.linear_x);
    put_bounds(bounds, &mut ocp.terminal.x, &mut ocp.terminal.soft_x);
    let end = ocp.length();
    put_rows([x, &None, lower, upper, linear, quadratic], end, ocp);
    Ok(())
}

fn check_lengths(parts: &[Option<&[f64]>], lengths: &[usize]) -> Result<(), ProblemError> {
    for (part, wanted) in parts.iter().zip(lengths) {
        let found = part.map_or(*wanted, <[f64]>::len);
        if found != *wanted {
            return Err(ProblemError::Length {
                found,
                wanted: *wanted,
            });
        }
    }
    Ok(())
}

fn put<const R: usize, const C: usize>(part: &Option<&[f64]>, place: &mut SMatrix<f64, R, C>) {
    if let Some(numbers) = part {
        place.copy_from_slice(numbers);
    }
}

fn put_bounds<const K: usize>(
    [lower, upper, linear, quadratic]: &[Option<&[f64]>; 4],
    bounds: &mut Bounds<f64, K>,
    soft: &mut SoftBounds<f64, K>,
) {
    put(lower, &mut bounds.lower);
    put(upper, &mut bounds.upper);
    for (j, place) in soft.iter_mut().enumerate() {
        put_price(linear, quadratic, j, place);
    }
}

/// Price `j`, if there are linear prices; without quadratic ones these are zero.
fn put_price(
    linear: &Option<&[f64]>,
    quadratic: &Option<&[f64]>,
    j: usize,
    place: &mut Option<Penalty<f64>>,
) {
    let at = |prices: &Option<&[f64]>| prices.and_then(|prices| prices.get(j).copied());
    if let Some(linear) = at(linear) {
        let quadratic = at(quadratic).unwrap_or(0.0);
        let price = Penalty { linear, quadratic };
        *place = linear.is_finite().then_some(price);
    }
}

fn put_rows<const NX: usize, const NU: usize>(
    [x, u, lower, upper, linear, quadratic]: [&Option<&[f64]>; 6],
    i: usize,
    ocp: &mut Ocp<f64, NX, NU>,
) {
    let count = ocp.rows_per_stage;
    let rows = ocp.rows.iter_mut().skip(i * count).take(count);
    for (j, row) in rows.enumerate() {
        let of_row = |part: &Option<&[f64]>, place: &mut [f64]| {
            let numbers = part
                .iter()
                .flat_map(|part| part.iter().skip(j).step_by(count));
            place
                .iter_mut()
                .zip(numbers)
                .for_each(|(to, from)| *to = *from);
        };
        of_row(x, row.x.as_mut_slice());
        of_row(u, row.u.as_mut_slice());
        of_row(lower, std::slice::from_mut(&mut row.lower));
        of_row(upper, std::slice::from_mut(&mut row.upper));
        put_price(linear, quadratic, j, &mut row.soft);
    }
}
