//! The operations of a plant's formulas.

use lpvmpc::{Bivariate, Elementary, Number};

/// One step of a straight-line program: a number that is given, or a function of the results of
/// earlier operations, which are counted from 0 in the order of the program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Operation {
    /// A number.
    Constant(f64),
    /// The state of this index.
    State(usize),
    /// The input of this index.
    Input(usize),
    /// The parameter of this index.
    Parameter(usize),
    /// The scheduling parameter of this index: in the formulas of A(s), B(s) and c(s).
    Scheduling(usize),
    /// A function of one result.
    Unary(Unary, usize),
    /// A function of two results.
    Binary(Binary, usize, usize),
}

/// Functions of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unary {
    /// -x.
    Negative,
    /// x^2.
    Square,
    /// 1/x.
    Inverse,
    /// tan x.
    Tan,
    /// Any other.
    Elementary(Elementary),
}

/// Functions of two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Binary {
    /// x + y.
    Add,
    /// x - y.
    Subtract,
    /// x y.
    Multiply,
    /// x/y.
    Divide,
    /// Any other.
    Bivariate(Bivariate),
}

/// The names of the functions of one number in a file.
pub(crate) const UNARY: [(&str, Unary); 25] = [
    ("neg", Unary::Negative),
    ("sq", Unary::Square),
    ("inv", Unary::Inverse),
    ("sqrt", Unary::Elementary(Elementary::Sqrt)),
    ("sin", Unary::Elementary(Elementary::Sin)),
    ("cos", Unary::Elementary(Elementary::Cos)),
    ("tan", Unary::Tan),
    ("sinc", Unary::Elementary(Elementary::Sinc)),
    ("sinhc", Unary::Elementary(Elementary::Sinhc)),
    ("asin", Unary::Elementary(Elementary::Asin)),
    ("acos", Unary::Elementary(Elementary::Acos)),
    ("atan", Unary::Elementary(Elementary::Atan)),
    ("sinh", Unary::Elementary(Elementary::Sinh)),
    ("cosh", Unary::Elementary(Elementary::Cosh)),
    ("tanh", Unary::Elementary(Elementary::Tanh)),
    ("asinh", Unary::Elementary(Elementary::Asinh)),
    ("acosh", Unary::Elementary(Elementary::Acosh)),
    ("atanh", Unary::Elementary(Elementary::Atanh)),
    ("exp", Unary::Elementary(Elementary::Exp)),
    ("log", Unary::Elementary(Elementary::Ln)),
    ("expm1", Unary::Elementary(Elementary::ExpM1)),
    ("log1p", Unary::Elementary(Elementary::Ln1p)),
    ("abs", Unary::Elementary(Elementary::Abs)),
    ("sign", Unary::Elementary(Elementary::Sign)),
    ("floor", Unary::Elementary(Elementary::Floor)),
];

/// The names of the functions of two numbers in a file.
pub(crate) const BINARY: [(&str, Binary); 13] = [
    ("add", Binary::Add),
    ("sub", Binary::Subtract),
    ("mul", Binary::Multiply),
    ("div", Binary::Divide),
    ("pow", Binary::Bivariate(Bivariate::Power)),
    ("atan2", Binary::Bivariate(Bivariate::Atan2)),
    ("min", Binary::Bivariate(Bivariate::Min)),
    ("max", Binary::Bivariate(Bivariate::Max)),
    ("mean_sign", Binary::Bivariate(Bivariate::MeanSign)),
    ("lt", Binary::Bivariate(Bivariate::Less)),
    ("le", Binary::Bivariate(Bivariate::LessOrEqual)),
    ("eq", Binary::Bivariate(Bivariate::Equal)),
    ("if_else_zero", Binary::Bivariate(Bivariate::IfElseZero)),
];

impl Unary {
    /// Its value.
    #[inline(always)]
    pub(crate) fn of<N: Number>(self, x: N) -> N {
        match self {
            Self::Negative => -x,
            Self::Square => x * x,
            Self::Inverse => N::constant(1.0) / x,
            Self::Tan => x.tan(),
            Self::Elementary(function) => x.elementary(function),
        }
    }

    fn jumps(self) -> bool {
        matches!(self, Self::Elementary(Elementary::Sign | Elementary::Floor))
    }
}

impl Binary {
    /// Its value.
    #[inline(always)]
    pub(crate) fn of<N: Number>(self, x: N, y: N) -> N {
        match self {
            Self::Add => x + y,
            Self::Subtract => x - y,
            Self::Multiply => x * y,
            Self::Divide => x / y,
            Self::Bivariate(function) => x.bivariate(y, function),
        }
    }

    fn jumps(self) -> bool {
        matches!(
            self,
            Self::Bivariate(
                Bivariate::Less | Bivariate::LessOrEqual | Bivariate::Equal | Bivariate::IfElseZero
            )
        )
    }
}

impl Operation {
    /// Its name in a file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Constant(_) => "constant",
            Self::State(_) => "state",
            Self::Input(_) => "input",
            Self::Parameter(_) => "parameter",
            Self::Scheduling(_) => "scheduling",
            Self::Unary(function, _) => name_of(&UNARY, *function),
            Self::Binary(function, ..) => name_of(&BINARY, *function),
        }
    }

    /// Whether it jumps: no proof can be had of a plant that needs it.
    pub fn jumps(&self) -> bool {
        match self {
            Self::Unary(function, _) => function.jumps(),
            Self::Binary(function, ..) => function.jumps(),
            _ => false,
        }
    }

    /// The earlier results that it refers to.
    pub(crate) fn arguments(&self) -> impl Iterator<Item = usize> + use<> {
        let (first, second) = match *self {
            Self::Unary(_, x) => (Some(x), None),
            Self::Binary(_, x, y) => (Some(x), Some(y)),
            _ => (None, None),
        };
        first.into_iter().chain(second)
    }
}

fn name_of<F: PartialEq>(table: &[(&'static str, F)], function: F) -> &'static str {
    let found = table.iter().find(|(_, known)| *known == function);
    found.map_or("", |(name, _)| name)
}
