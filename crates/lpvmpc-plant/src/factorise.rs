//! Formulas about a point as matrices times the way from there, exactly: f(z) - f(z_r) = S(z, z_r) (z - z_r).
//!
//! Every operation has its value at z and at z_r, and the row that takes z - z_r to their difference: of a sum the
//! sum of the rows; of a product x y the row of y times the mean of x, and the other way round; of a function g
//! the row times its divided difference (g(v) - g(v_r))/(v - v_r), in a form that has a value at v = v_r, too, such as
//! cos((v + v_r)/2) sinc((v - v_r)/2) of sin. That of an inverse function is one over that of the function itself, at
//! the values: of arctan, cos a cos a_r / sinc(a - a_r) with a = arctan v. Nothing is neglected, so what is proved of S is
//! proved of f.

use crate::derive::{beside, needed};
use crate::operation::{Binary, Operation, Unary};
use crate::program::Program;
use lpvmpc::{Bivariate, Elementary};

/// More operations would take longer than is worth waiting for.
const LONGEST: usize = 30_000;
/// The highest power that is multiplied out; one above is the square of a lower one.
const HIGHEST_POWER: f64 = 16.0;

/// Entries of the matrix [A B] as results of a program.
#[derive(Debug)]
pub(crate) struct Factors {
    /// The program. `["scheduling", i]` is z_i, then z_r.
    pub operations: Vec<Operation>,
    /// The entries that are not always zero: row, column, operation.
    pub entries: Vec<(usize, usize, usize)>,
}

/// Why there are no factors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoFactors {
    /// No form is known for this operation.
    Operation(usize),
    /// The formulas would be too long.
    TooLong,
}

/// A result at z and at z_r, with the entries of its row that are not always zero, each behind its column.
#[derive(Clone, Default)]
struct Factored {
    at: usize,
    base: usize,
    row: Vec<(usize, usize)>,
}

/// Columns with the places of their entries.
type Entries = [(usize, usize)];

impl Factored {
    fn is_fixed(&self) -> bool {
        self.row.is_empty()
    }
}

/// The factors of the `results` of `operations`, of a plant with so many states and inputs; z is both, one after
/// the other.
pub(crate) fn factorise(
    operations: &[Operation],
    results: &[usize],
    (states, inputs): (usize, usize),
) -> Result<Factors, NoFactors> {
    let needed = needed(operations, results);
    let mut program = Program::exact(LONGEST);
    let mut factored = vec![Factored::default(); operations.len()];
    for (index, operation) in operations.iter().enumerate() {
        if !needed[index] {
            continue;
        }
        let found = match *operation {
            // Of numbers alone, too: enclosures have no value of it.
            _ if operation.jumps() => None,
            Operation::State(i) => program.component(i, states + inputs),
            Operation::Input(j) => program.component(states + j, states + inputs),
            Operation::Unary(function, x) => program.factored_unary(function, &factored[x]),
            Operation::Binary(function, x, y) => {
                program.factored_binary(function, &factored[x], &factored[y])
            }
            Operation::Constant(_) | Operation::Parameter(_) | Operation::Scheduling(_) => {
                program.push(*operation).map(|at| fixed(at, at))
            }
        };
        factored[index] = found.ok_or_else(|| match program.is_full() {
            true => NoFactors::TooLong,
            false => NoFactors::Operation(index),
        })?;
    }
    let rows = results.iter().enumerate();
    let entries = rows.flat_map(|(i, result)| {
        let row = &factored[*result].row;
        row.iter().map(move |(column, place)| (i, *column, *place))
    });
    let entries = entries.collect();
    Ok(Factors {
        operations: program.operations().to_vec(),
        entries,
    })
}

fn fixed(at: usize, base: usize) -> Factored {
    Factored {
        at,
        base,
        row: Vec::new(),
    }
}

/// Formulas of factors. `None` where no form is known, or the program would be too long.
impl Program {
    /// z_i of so many.
    fn component(&mut self, i: usize, count: usize) -> Option<Factored> {
        Some(Factored {
            at: self.push(Operation::Scheduling(i))?,
            base: self.push(Operation::Scheduling(count + i))?,
            row: vec![(i, self.constant(1.0)?)],
        })
    }

    /// Half the sum of what `x` is at z and at z_r.
    fn mean(&mut self, x: &Factored) -> Option<usize> {
        if x.is_fixed() {
            return Some(x.at);
        }
        let (sum, half) = (self.add(x.at, x.base)?, self.constant(0.5)?);
        self.multiply(half, sum)
    }

    /// Half the difference.
    fn half_way(&mut self, x: &Factored) -> Option<usize> {
        let (way, half) = (self.subtract(x.at, x.base)?, self.constant(0.5)?);
        self.multiply(half, way)
    }

    fn times_row(&mut self, row: &Entries, factor: usize) -> Option<Vec<(usize, usize)>> {
        let entries = row.iter();
        let product = |(column, entry): &(usize, usize)| {
            let product = self.multiply(*entry, factor)?;
            Some((*column, product))
        };
        entries.map(product).collect()
    }

    /// The sum of two rows, the second one with its sign changed if it is to be subtracted.
    fn rows_together(
        &mut self,
        (x, y): (&Entries, &Entries),
        function: Binary,
    ) -> Option<Vec<(usize, usize)>> {
        let zero = self.constant(0.0)?;
        let columns = beside(x, y);
        let joined = columns.map(|(column, a, b)| {
            let entry = self.binary(function, a.unwrap_or(zero), b.unwrap_or(zero))?;
            Some((column, entry))
        });
        joined.collect()
    }

    fn factored_unary(&mut self, function: Unary, x: &Factored) -> Option<Factored> {
        let at = self.unary(function, x.at)?;
        if x.is_fixed() {
            return Some(fixed(at, at));
        }
        let base = self.unary(function, x.base)?;
        let slope = self.divided_difference(function, x, (at, base))?;
        let row = self.times_row(&x.row, slope)?;
        Some(Factored { at, base, row })
    }

    /// (g(v) - g(v_r))/(v - v_r), where g is `at` and `base`.
    fn divided_difference(
        &mut self,
        function: Unary,
        x: &Factored,
        (at, base): (usize, usize),
    ) -> Option<usize> {
        use Elementary::{Cos, Cosh, Exp, ExpM1, Sin, Sinc, Sinh, Sinhc, Tanh};
        let function = match function {
            Unary::Negative => return self.constant(-1.0),
            Unary::Square => return self.add(x.at, x.base),
            Unary::Inverse => {
                let product = self.multiply(at, base)?;
                return self.negative(product);
            }
            Unary::Tan => return self.of_tangent((Cos, Sinc), x),
            Unary::Elementary(Elementary::Abs) => {
                return self.bivariate(Bivariate::MeanSign, x.at, x.base);
            }
            Unary::Elementary(function) => function,
        };
        // A function of the mean times sin(h)/h or sinh(h)/h of half the difference.
        let (of_mean, of_half) = match function {
            Sin => (Cos, Sinc),
            Cos => (Sin, Sinc),
            Exp | ExpM1 => (Exp, Sinhc),
            Sinh => (Cosh, Sinhc),
            Cosh => (Sinh, Sinhc),
            Tanh => return self.of_tangent((Cosh, Sinhc), x),
            _ => {
                let row = x.row.clone();
                let values = Factored { at, base, row };
                let straight = inverted(function)?;
                let slope = self.divided_difference(straight, &values, (x.at, x.base))?;
                return self.inverse(slope);
            }
        };
        let (mean, half) = (self.mean(x)?, self.half_way(x)?);
        let (mean, half) = (
            self.elementary(of_mean, mean)?,
            self.elementary(of_half, half)?,
        );
        let product = self.multiply(mean, half)?;
        if function == Cos {
            self.negative(product)
        } else {
            Some(product)
        }
    }

    /// sinc(v - v_r)/(cos v cos v_r), or the same of hyperbolic functions.
    fn of_tangent(&mut self, (cos, sinc): (Elementary, Elementary), x: &Factored) -> Option<usize> {
        let way = self.subtract(x.at, x.base)?;
        let (first, second) = (self.elementary(cos, x.at)?, self.elementary(cos, x.base)?);
        let (above, below) = (self.elementary(sinc, way)?, self.multiply(first, second)?);
        self.divide(above, below)
    }

    fn factored_binary(
        &mut self,
        function: Binary,
        x: &Factored,
        y: &Factored,
    ) -> Option<Factored> {
        match function {
            Binary::Bivariate(Bivariate::Power) => return self.factored_power(x, y),
            Binary::Bivariate(Bivariate::Atan2) => return self.factored_angle(x, y),
            Binary::Bivariate(Bivariate::Max) => return self.factored_choice(Binary::Add, x, y),
            Binary::Bivariate(Bivariate::Min) => {
                return self.factored_choice(Binary::Subtract, x, y);
            }
            _ => {}
        }
        // That of zero and zero is zero for a plant, and any number from -1 to 1 as a slope.
        if function == Binary::Bivariate(Bivariate::MeanSign) {
            return None;
        }
        let at = self.binary(function, x.at, y.at)?;
        if x.is_fixed() && y.is_fixed() {
            return Some(fixed(at, at));
        }
        let base = self.binary(function, x.base, y.base)?;
        let row = match function {
            Binary::Add | Binary::Subtract => self.rows_together((&x.row, &y.row), function)?,
            Binary::Multiply => self.crossed((x, y), Binary::Add)?,
            Binary::Divide => {
                // x/y - x_r/y_r = (x - x_r - x_r/y_r (y - y_r))/y.
                let inverse = self.inverse(y.at)?;
                let moved = self.times_row(&y.row, base)?;
                let above = self.rows_together((&x.row, &moved), Binary::Subtract)?;
                self.times_row(&above, inverse)?
            }
            // What jumps, and what only such formulas have.
            Binary::Bivariate(_) => return None,
        };
        Some(Factored { at, base, row })
    }

    /// The larger of x and y, half of x + y + |x - y|, or with its last sign (`function`) changed the smaller one.
    fn factored_choice(
        &mut self,
        function: Binary,
        x: &Factored,
        y: &Factored,
    ) -> Option<Factored> {
        let sum = self.factored_binary(Binary::Add, x, y)?;
        let way = self.factored_binary(Binary::Subtract, x, y)?;
        let apart = self.factored_unary(Unary::Elementary(Elementary::Abs), &way)?;
        let both = self.factored_binary(function, &sum, &apart)?;
        let half = self.constant(0.5)?;
        self.factored_binary(Binary::Multiply, &fixed(half, half), &both)
    }

    /// The row of x times the mean of y, plus or minus (`function`) the row of y times the mean of x.
    fn crossed(
        &mut self,
        (x, y): (&Factored, &Factored),
        function: Binary,
    ) -> Option<Vec<(usize, usize)>> {
        let (of_x, of_y) = (self.mean(x)?, self.mean(y)?);
        let (of_x, of_y) = (self.times_row(&y.row, of_x)?, self.times_row(&x.row, of_y)?);
        self.rows_together((&of_y, &of_x), function)
    }

    /// The angle a of the point (y, x): with its distance r from the origin, r r_r sin(a - a_r) = x y_r - y x_r, which is
    /// (x - x_r) times the mean of y less (y - y_r) times the mean of x.
    fn factored_angle(&mut self, x: &Factored, y: &Factored) -> Option<Factored> {
        let at = self.bivariate(Bivariate::Atan2, x.at, y.at)?;
        if x.is_fixed() && y.is_fixed() {
            return Some(fixed(at, at));
        }
        let base = self.bivariate(Bivariate::Atan2, x.base, y.base)?;
        let way = self.subtract(at, base)?;
        let sinc = self.elementary(Elementary::Sinc, way)?;
        let (here, there) = (self.distance(x.at, y.at)?, self.distance(x.base, y.base)?);
        let distances = self.multiply(here, there)?;
        let below = self.multiply(distances, sinc)?;
        let inverse = self.inverse(below)?;
        let above = self.crossed((x, y), Binary::Subtract)?;
        let row = self.times_row(&above, inverse)?;
        Some(Factored { at, base, row })
    }

    /// The root of x^2 + y^2.
    fn distance(&mut self, x: usize, y: usize) -> Option<usize> {
        let (x, y) = (self.multiply(x, x)?, self.multiply(y, y)?);
        let sum = self.add(x, y)?;
        self.elementary(Elementary::Sqrt, sum)
    }

    /// x^y: of a constant y that is whole or half of an odd number by products and roots, for any x that has such a
    /// power; else exp(y ln x).
    fn factored_power(&mut self, x: &Factored, y: &Factored) -> Option<Factored> {
        let power = Binary::Bivariate(Bivariate::Power);
        if x.is_fixed() && y.is_fixed() {
            let at = self.binary(power, x.at, y.at)?;
            return Some(fixed(at, at));
        }
        let halves = |exponent: &f64| (2.0 * exponent).fract() == 0.0;
        let Some(exponent) = self.number(y.at).filter(halves) else {
            let logarithm = self.factored_unary(Unary::Elementary(Elementary::Ln), x)?;
            let product = self.factored_binary(Binary::Multiply, y, &logarithm)?;
            return self.factored_unary(Unary::Elementary(Elementary::Exp), &product);
        };
        if exponent < 0.0 {
            let power = self.constant_power(x, -exponent)?;
            return self.factored_unary(Unary::Inverse, &power);
        }
        if exponent.fract() != 0.0 {
            let root = self.factored_unary(Unary::Elementary(Elementary::Sqrt), x)?;
            let whole = self.constant_power(x, exponent - 0.5)?;
            return self.factored_binary(Binary::Multiply, &whole, &root);
        }
        if exponent > HIGHEST_POWER {
            let half = self.constant_power(x, (0.5 * exponent).floor())?;
            let even = self.factored_unary(Unary::Square, &half)?;
            return match exponent % 2.0 {
                0.0 => Some(even),
                _ => self.factored_binary(Binary::Multiply, &even, x),
            };
        }
        self.multiplied_out(x, exponent as usize)
    }

    fn constant_power(&mut self, x: &Factored, exponent: f64) -> Option<Factored> {
        let exponent = self.constant(exponent)?;
        self.factored_power(x, &fixed(exponent, exponent))
    }

    /// v^n - v_r^n = (v - v_r) times the sum of v^i v_r^(n-1-i).
    fn multiplied_out(&mut self, x: &Factored, n: usize) -> Option<Factored> {
        let one = self.constant(1.0)?;
        let (mut at, mut base, mut slope) = (one, one, self.constant(0.0)?);
        for _ in 0..n {
            let raised = self.multiply(slope, x.at)?;
            slope = self.add(raised, base)?;
            (at, base) = (self.multiply(at, x.at)?, self.multiply(base, x.base)?);
        }
        let row = match n {
            0 => Vec::new(),
            _ => self.times_row(&x.row, slope)?,
        };
        Some(Factored { at, base, row })
    }
}

/// The function whose inverse this one is, up to a constant.
fn inverted(function: Elementary) -> Option<Unary> {
    Some(match function {
        Elementary::Sqrt => Unary::Square,
        Elementary::Ln | Elementary::Ln1p => Unary::Elementary(Elementary::Exp),
        Elementary::Atan => Unary::Tan,
        Elementary::Asin => Unary::Elementary(Elementary::Sin),
        Elementary::Acos => Unary::Elementary(Elementary::Cos),
        Elementary::Asinh => Unary::Elementary(Elementary::Sinh),
        Elementary::Acosh => Unary::Elementary(Elementary::Cosh),
        Elementary::Atanh => Unary::Elementary(Elementary::Tanh),
        _ => return None,
    })
}
