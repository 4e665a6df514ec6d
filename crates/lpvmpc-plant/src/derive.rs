//! Derivatives of formulas as formulas: forward mode on the operations of a program, by the rules of
//! [`Dual`](lpvmpc::Dual) numbers. A derivative that is always zero is not there.

use crate::operation::{Binary, Operation, Unary};
use crate::program::Program;
use lpvmpc::{Bivariate, Elementary, SincSlope};

/// A result and its derivatives, by their places in a program.
#[derive(Clone, Default)]
pub(crate) struct Varying {
    /// The result.
    pub value: usize,
    /// The derivatives that are not always zero, each behind its variable, in the order of these. Variables are the
    /// states, then the inputs.
    pub slopes: Vec<(usize, usize)>,
}

/// The operations that `results` need.
pub(crate) fn needed(operations: &[Operation], results: &[usize]) -> Vec<bool> {
    let mut needed = vec![false; operations.len()];
    results.iter().for_each(|result| needed[*result] = true);
    for index in (0..operations.len()).rev() {
        if needed[index] {
            operations[index].arguments().for_each(|i| needed[i] = true);
        }
    }
    needed
}

/// The `results` of `operations`, of a plant with so many states, and their derivatives by state and input, as
/// parts of `program`. `None` where that would become too long; `most` is how many derivatives there may be of all
/// operations together.
pub(crate) fn derive(
    program: &mut Program,
    operations: &[Operation],
    results: &[usize],
    states: usize,
    most: usize,
) -> Option<Vec<Varying>> {
    let needed = needed(operations, results);
    let mut varying = vec![Varying::default(); operations.len()];
    let mut count = 0;
    for (index, operation) in operations.iter().enumerate() {
        if !needed[index] {
            continue;
        }
        varying[index] = match *operation {
            Operation::State(i) => program.variable(*operation, i)?,
            Operation::Input(j) => program.variable(*operation, states + j)?,
            Operation::Unary(function, x) => program.derived_unary(function, &varying[x])?,
            Operation::Binary(function, x, y) => {
                program.derived_binary(function, &varying[x], &varying[y])?
            }
            Operation::Constant(_) | Operation::Parameter(_) | Operation::Scheduling(_) => {
                Varying {
                    value: program.push(*operation)?,
                    slopes: Vec::new(),
                }
            }
        };
        let is_constant = program.number(varying[index].value).is_some();
        let slopes = &mut varying[index].slopes;
        if is_constant {
            slopes.clear();
        }
        slopes.retain(|(_, slope)| program.number(*slope) != Some(0.0));
        count += slopes.len();
        if count > most {
            return None;
        }
    }
    Some(
        results
            .iter()
            .map(|result| varying[*result].clone())
            .collect(),
    )
}

/// The slopes of two numbers side by side: variable, slope of the first, slope of the second.
pub(crate) fn beside<'a>(
    mut first: &'a [(usize, usize)],
    mut second: &'a [(usize, usize)],
) -> impl Iterator<Item = (usize, Option<usize>, Option<usize>)> + 'a {
    std::iter::from_fn(move || {
        let next = |list: &[(usize, usize)]| list.first().copied();
        let (a, b) = (next(first), next(second));
        let variable = a.iter().chain(&b).map(|(variable, _)| *variable).min()?;
        let take = |list: &mut &'a [(usize, usize)], next: Option<(usize, usize)>| {
            let (_, slope) = next.filter(|(of, _)| *of == variable)?;
            *list = &list[1..];
            Some(slope)
        };
        Some((variable, take(&mut first, a), take(&mut second, b)))
    })
}

/// Formulas of derivatives. `None` where the program would be too long.
impl Program {
    fn variable(&mut self, operation: Operation, variable: usize) -> Option<Varying> {
        Some(Varying {
            value: self.push(operation)?,
            slopes: vec![(variable, self.constant(1.0)?)],
        })
    }

    /// The chain rule: `value`, a function of `x` with this derivative, if it varies at all.
    fn through(
        &mut self,
        value: usize,
        x: &Varying,
        mut slope: impl FnMut(&mut Self) -> Option<usize>,
    ) -> Option<Varying> {
        let mut slopes = Vec::with_capacity(x.slopes.len());
        if !x.slopes.is_empty() {
            let slope = slope(self)?;
            for (variable, of_x) in &x.slopes {
                slopes.push((*variable, self.multiply(*of_x, slope)?));
            }
        }
        Some(Varying { value, slopes })
    }

    fn derived_unary(&mut self, function: Unary, x: &Varying) -> Option<Varying> {
        let value = self.unary(function, x.value)?;
        match function {
            Unary::Negative => self.through(value, x, |program| program.constant(-1.0)),
            Unary::Square => self.through(value, x, |program| program.add(x.value, x.value)),
            Unary::Inverse => {
                let one = Varying {
                    value: self.constant(1.0)?,
                    slopes: Vec::new(),
                };
                self.derived_quotient(value, value, (&one, x))
            }
            Unary::Tan => self.through(value, x, |program| program.one_plus_square(value)),
            Unary::Elementary(Elementary::Sign | Elementary::Floor) => Some(Varying {
                value,
                slopes: Vec::new(),
            }),
            Unary::Elementary(function) => {
                self.through(value, x, |program| program.slope(function, x.value, value))
            }
        }
    }

    /// The derivative of a function at `x`, where its value is `value`.
    fn slope(&mut self, function: Elementary, x: usize, value: usize) -> Option<usize> {
        let one = self.constant(1.0)?;
        let below = match function {
            Elementary::Sin => return self.elementary(Elementary::Cos, x),
            Elementary::Cos => {
                let sin = self.elementary(Elementary::Sin, x)?;
                return self.negative(sin);
            }
            Elementary::Sinc => return self.slope_of_sinc(x, value, Elementary::Cos),
            Elementary::Sinhc => return self.slope_of_sinc(x, value, Elementary::Cosh),
            Elementary::Exp => return Some(value),
            Elementary::Tanh => {
                let square = self.multiply(value, value)?;
                return self.subtract(one, square);
            }
            Elementary::Sinh => return self.elementary(Elementary::Cosh, x),
            Elementary::Cosh => return self.elementary(Elementary::Sinh, x),
            Elementary::ExpM1 => return self.add(value, one),
            Elementary::Abs => {
                let zero = self.constant(0.0)?;
                let below = self.bivariate(Bivariate::Less, x, zero)?;
                let twice = self.add(below, below)?;
                return self.subtract(one, twice);
            }
            Elementary::Sign | Elementary::Floor => return self.constant(0.0),
            // One over something.
            Elementary::Atan => self.one_plus_square(x)?,
            Elementary::Ln => x,
            Elementary::Sqrt => self.add(value, value)?,
            Elementary::Asin => self.root_of_one_minus_square(x)?,
            Elementary::Acos => {
                let root = self.root_of_one_minus_square(x)?;
                self.negative(root)?
            }
            Elementary::Asinh => {
                let sum = self.one_plus_square(x)?;
                self.elementary(Elementary::Sqrt, sum)?
            }
            Elementary::Acosh => {
                let (less, more) = (self.subtract(x, one)?, self.add(x, one)?);
                let less = self.elementary(Elementary::Sqrt, less)?;
                let more = self.elementary(Elementary::Sqrt, more)?;
                self.multiply(less, more)?
            }
            Elementary::Atanh => self.one_minus_square(x)?,
            Elementary::Ln1p => self.add(one, x)?,
        };
        self.inverse(below)
    }

    /// 1 + x^2.
    fn one_plus_square(&mut self, x: usize) -> Option<usize> {
        let (one, square) = (self.constant(1.0)?, self.multiply(x, x)?);
        self.add(one, square)
    }

    /// 1 - x^2, exact near |x| = 1, too.
    fn one_minus_square(&mut self, x: usize) -> Option<usize> {
        let one = self.constant(1.0)?;
        let (less, more) = (self.subtract(one, x)?, self.add(one, x)?);
        self.multiply(less, more)
    }

    fn root_of_one_minus_square(&mut self, x: usize) -> Option<usize> {
        let square = self.one_minus_square(x)?;
        self.elementary(Elementary::Sqrt, square)
    }

    /// See [`SincSlope`].
    fn slope_of_sinc(&mut self, x: usize, sinc: usize, cos: Elementary) -> Option<usize> {
        let square = self.multiply(x, x)?;
        let series = match cos {
            Elementary::Cosh => SincSlope::SERIES.map(f64::abs),
            _ => SincSlope::SERIES,
        };
        let (first, rest) = series.split_first()?;
        let mut sum = self.constant(*first)?;
        for coefficient in rest {
            let coefficient = self.constant(*coefficient)?;
            let product = self.multiply(sum, square)?;
            sum = self.add(product, coefficient)?;
        }
        let by_series = self.multiply(sum, x)?;
        let cos = self.elementary(cos, x)?;
        let difference = self.subtract(cos, sinc)?;
        let by_difference = self.divide(difference, x)?;
        let size = self.elementary(Elementary::Abs, x)?;
        let small = self.constant(SincSlope::SMALL)?;
        let is_small = self.bivariate(Bivariate::LessOrEqual, size, small)?;
        self.either(is_small, by_series, by_difference)
    }

    /// The first one where `condition`, 0 or 1, is 1; else the second one.
    fn either(&mut self, condition: usize, first: usize, second: usize) -> Option<usize> {
        let one = self.constant(1.0)?;
        let otherwise = self.subtract(one, condition)?;
        let first = self.bivariate(Bivariate::IfElseZero, condition, first)?;
        let second = self.bivariate(Bivariate::IfElseZero, otherwise, second)?;
        self.add(first, second)
    }

    /// The slopes of a function of `x` and `y`; `slope` makes one of theirs.
    fn combined(
        &mut self,
        value: usize,
        (x, y): (&Varying, &Varying),
        mut slope: impl FnMut(&mut Self, Option<usize>, Option<usize>) -> Option<usize>,
    ) -> Option<Varying> {
        let mut slopes = Vec::with_capacity(x.slopes.len().max(y.slopes.len()));
        for (variable, a, b) in beside(&x.slopes, &y.slopes) {
            slopes.push((variable, slope(self, a, b)?));
        }
        Some(Varying { value, slopes })
    }

    /// The sum of what there is.
    fn sum(&mut self, first: Option<usize>, second: Option<usize>) -> Option<usize> {
        match (first, second) {
            (Some(first), Some(second)) => self.add(first, second),
            (Some(term), None) | (None, Some(term)) => Some(term),
            (None, None) => self.constant(0.0),
        }
    }

    /// `slope` times `by`, if there is a slope.
    fn part(&mut self, slope: Option<usize>, by: usize) -> Option<Option<usize>> {
        Some(match slope {
            Some(slope) => Some(self.multiply(slope, by)?),
            None => None,
        })
    }

    fn derived_binary(&mut self, function: Binary, x: &Varying, y: &Varying) -> Option<Varying> {
        let value = self.binary(function, x.value, y.value)?;
        let both = (x, y);
        match function {
            Binary::Add => self.combined(value, both, Self::sum),
            Binary::Subtract => self.combined(value, both, |program, a, b| match (a, b) {
                (Some(a), Some(b)) => program.subtract(a, b),
                (None, Some(b)) => program.negative(b),
                (a, None) => program.sum(a, None),
            }),
            Binary::Multiply => self.combined(value, both, |program, a, b| {
                let (a, b) = (program.part(a, y.value)?, program.part(b, x.value)?);
                program.sum(a, b)
            }),
            Binary::Divide if x.slopes.is_empty() && y.slopes.is_empty() => Some(Varying {
                value,
                slopes: Vec::new(),
            }),
            Binary::Divide => {
                let inverse = self.inverse(y.value)?;
                self.derived_quotient(value, inverse, both)
            }
            Binary::Bivariate(function) => self.derived_bivariate(function, value, both),
        }
    }

    /// Of the quotient of both, whose second part has this `inverse`.
    fn derived_quotient(
        &mut self,
        value: usize,
        inverse: usize,
        both: (&Varying, &Varying),
    ) -> Option<Varying> {
        self.combined(value, both, |program, a, b| {
            let numerator = match (a, program.part(b, value)?) {
                (Some(a), Some(b)) => program.subtract(a, b)?,
                (None, Some(b)) => program.negative(b)?,
                (a, None) => program.sum(a, None)?,
            };
            program.multiply(numerator, inverse)
        })
    }

    fn derived_bivariate(
        &mut self,
        function: Bivariate,
        value: usize,
        (x, y): (&Varying, &Varying),
    ) -> Option<Varying> {
        let both = (x, y);
        let fixed = Varying {
            value,
            slopes: Vec::new(),
        };
        match function {
            _ if x.slopes.is_empty() && y.slopes.is_empty() => Some(fixed),
            Bivariate::Less | Bivariate::LessOrEqual | Bivariate::Equal => Some(fixed),
            Bivariate::IfElseZero => {
                let mut slopes = Vec::with_capacity(y.slopes.len());
                for (variable, slope) in &y.slopes {
                    slopes.push((*variable, self.bivariate(function, x.value, *slope)?));
                }
                Some(Varying { value, slopes })
            }
            Bivariate::Min | Bivariate::Max => {
                let (less, more) = match function {
                    Bivariate::Min => (x.value, y.value),
                    _ => (y.value, x.value),
                };
                let first = self.bivariate(Bivariate::LessOrEqual, less, more)?;
                let zero = self.constant(0.0)?;
                self.combined(value, both, |program, a, b| {
                    program.either(first, a.unwrap_or(zero), b.unwrap_or(zero))
                })
            }
            // (1 - value sign x) / (|x| + |y|) by x, by y the same; 0 where both are.
            Bivariate::MeanSign => {
                let sizes = [x, y].map(|one| self.elementary(Elementary::Abs, one.value));
                let [Some(first), Some(second)] = sizes else {
                    return None;
                };
                let (size, one) = (self.add(first, second)?, self.constant(1.0)?);
                let mut slope = |of: &Varying| {
                    let sign = self.elementary(Elementary::Sign, of.value)?;
                    let lost = self.multiply(value, sign)?;
                    let rest = self.subtract(one, lost)?;
                    let slope = self.divide(rest, size)?;
                    self.bivariate(Bivariate::IfElseZero, size, slope)
                };
                let (by_x, by_y) = (slope(x)?, slope(y)?);
                self.combined(value, both, |program, a, b| {
                    let (a, b) = (program.part(a, by_x)?, program.part(b, by_y)?);
                    program.sum(a, b)
                })
            }
            Bivariate::Power => match self.number(y.value) {
                Some(0.0) => Some(fixed),
                Some(0.5) => self.through(value, x, |program| {
                    program.slope(Elementary::Sqrt, x.value, value)
                }),
                Some(exponent) if exponent == exponent.trunc() => {
                    self.through(value, x, |program| program.slope_of_power(x.value, y.value))
                }
                _ => {
                    let by_x = self.slope_of_power(x.value, y.value)?;
                    let by_y = match y.slopes.is_empty() {
                        true => by_x,
                        false => {
                            let logarithm = self.elementary(Elementary::Ln, x.value)?;
                            self.multiply(value, logarithm)?
                        }
                    };
                    self.combined(value, both, |program, a, b| {
                        let a = program.part_if_any(a, by_x)?;
                        let b = program.part_if_any(b, by_y)?;
                        program.sum(a, b)
                    })
                }
            },
            Bivariate::Atan2 => {
                let (first, second) = (
                    self.multiply(x.value, x.value)?,
                    self.multiply(y.value, y.value)?,
                );
                let square = self.add(first, second)?;
                let by_x = self.divide(y.value, square)?;
                let by_y = self.divide(x.value, square)?;
                let by_y = self.negative(by_y)?;
                self.combined(value, both, |program, a, b| {
                    let a = program.part_if_any(a, by_x)?;
                    let b = program.part_if_any(b, by_y)?;
                    program.sum(a, b)
                })
            }
        }
    }

    /// y x^(y - 1).
    fn slope_of_power(&mut self, x: usize, y: usize) -> Option<usize> {
        let one = self.constant(1.0)?;
        let less = self.subtract(y, one)?;
        let lower = self.bivariate(Bivariate::Power, x, less)?;
        self.multiply(y, lower)
    }

    /// `slope` times `by`, zero where the slope is zero even if there is no derivative.
    fn part_if_any(&mut self, slope: Option<usize>, by: usize) -> Option<Option<usize>> {
        Some(match slope {
            Some(slope) => {
                let product = self.multiply(slope, by)?;
                Some(self.bivariate(Bivariate::IfElseZero, slope, product)?)
            }
            None => None,
        })
    }
}
