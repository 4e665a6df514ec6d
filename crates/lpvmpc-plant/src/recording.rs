//! Plants in Rust as data: their formulas are evaluated once on numbers that write down what is done
//! with them.

use crate::data::{EmbeddingData, PlantData, numbered};
use crate::operation::{Binary, Operation, Unary};
use lpvmpc::{Bivariate, Dynamics, Elementary, Embedding, Number};
use nalgebra::SVector;
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

thread_local! {
    /// What the numbers of this thread write down.
    static PROGRAM: RefCell<Vec<Operation>> = const { RefCell::new(Vec::new()) };
}

/// The result of an operation that was written down.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Recorded(usize);

impl Recorded {
    fn new(operation: Operation) -> Self {
        PROGRAM.with_borrow_mut(|program| {
            program.push(operation);
            Self(program.len() - 1)
        })
    }

    fn binary(self, function: Binary, other: Self) -> Self {
        Self::new(Operation::Binary(function, self.0, other.0))
    }
}

impl Add for Recorded {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.binary(Binary::Add, other)
    }
}

impl Sub for Recorded {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.binary(Binary::Subtract, other)
    }
}

impl Mul for Recorded {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        self.binary(Binary::Multiply, other)
    }
}

impl Div for Recorded {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        self.binary(Binary::Divide, other)
    }
}

impl Neg for Recorded {
    type Output = Self;

    fn neg(self) -> Self {
        Self::new(Operation::Unary(Unary::Negative, self.0))
    }
}

impl Number for Recorded {
    fn constant(value: f64) -> Self {
        Self::new(Operation::Constant(value))
    }

    fn elementary(self, function: Elementary) -> Self {
        Self::new(Operation::Unary(Unary::Elementary(function), self.0))
    }

    fn bivariate(self, other: Self, function: Bivariate) -> Self {
        self.binary(Binary::Bivariate(function), other)
    }
}

fn leaves<const K: usize>(leaf: fn(usize) -> Operation) -> SVector<Recorded, K> {
    SVector::from_fn(|i, _| Recorded::new(leaf(i)))
}

fn places<const K: usize>(results: &SVector<Recorded, K>) -> Vec<usize> {
    results.iter().map(|result| result.0).collect()
}

/// The formulas of the motion as `derivative` and `next`.
pub(crate) fn by_time(motion: Vec<usize>, period: Option<f64>) -> (Vec<usize>, Vec<usize>) {
    match period {
        None => (motion, Vec::new()),
        Some(_) => (Vec::new(), motion),
    }
}

impl PlantData {
    /// A plant that is written in Rust as data: with the same values, to the last bit. Its states are
    /// named x0, x1 and so on, its inputs u0; names, units and all else are for the caller to fill in. What are
    /// parameters in Rust are constants here.
    ///
    /// ```
    /// use lpvmpc::{Dynamics, Number};
    /// use lpvmpc_plant::{Plant, PlantData, Signal};
    /// use nalgebra::{Vector1, Vector2};
    ///
    /// struct Pendulum;
    /// impl Dynamics<2, 1> for Pendulum {
    ///     fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
    ///         Vector2::new(x[1], N::constant(9.81) * x[0].sin() + u[0])
    ///     }
    /// }
    /// let plant = Plant::new(PlantData {
    ///     states: vec![Signal::new("angle", "rad"), Signal::new("rate", "rad/s")],
    ///     ..PlantData::of_dynamics("pendulum", &Pendulum)
    /// })?;
    /// assert_eq!(plant.derivative(&[0.5, 0.1], &[2.0])?, [0.1, 9.81 * 0.5_f64.sin() + 2.0]);
    /// # Ok::<(), lpvmpc_plant::PlantError>(())
    /// ```
    pub fn of_dynamics<P, const NX: usize, const NU: usize>(name: &str, plant: &P) -> Self
    where
        P: Dynamics<NX, NU>,
    {
        PROGRAM.take();
        let (x, u) = (leaves(Operation::State), leaves(Operation::Input));
        let motion = places(&plant.f(&x, &u));
        let (derivative, next) = by_time(motion, plant.period());
        Self {
            name: name.to_owned(),
            states: numbered("x", NX),
            inputs: numbered("u", NU),
            operations: PROGRAM.take(),
            derivative,
            period: plant.period(),
            next,
            ..Self::default()
        }
    }

    /// The same of a plant with an embedding of its own.
    pub fn of_embedding<P, const NX: usize, const NU: usize, const NS: usize>(
        name: &str,
        plant: &P,
    ) -> Self
    where
        P: Embedding<NX, NU, NS>,
    {
        PROGRAM.take();
        let (x, u) = (leaves(Operation::State), leaves(Operation::Input));
        let motion = places(&plant.f(&x, &u));
        let (derivative, next) = by_time(motion, plant.period());
        let scheduling = places(&plant.scheduling(&x, &u));
        let s = leaves(Operation::Scheduling);
        let (a, b) = plant.matrices(&s);
        let row = |entries: Vec<Recorded>| entries.iter().map(|entry| entry.0).collect();
        let embedding = EmbeddingData {
            scheduling,
            a: a.row_iter()
                .map(|r| row(r.iter().copied().collect()))
                .collect(),
            b: b.row_iter()
                .map(|r| row(r.iter().copied().collect()))
                .collect(),
            c: plant.offset(&s).map(|c| places(&c)),
        };
        Self {
            name: name.to_owned(),
            states: numbered("x", NX),
            inputs: numbered("u", NU),
            operations: PROGRAM.take(),
            derivative,
            period: plant.period(),
            next,
            embedding: Some(embedding),
            ..Self::default()
        }
    }
}
