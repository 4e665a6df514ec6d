//! Derivatives by formulas are those by dual numbers.

use crate::reference::{plant, points};
use lpvmpc::{
    AlongMotion, Bivariate, Dual, Dynamics, Elementary, Embedding, LpvModel, Tangent,
    tangent_by_duals,
};
use lpvmpc_plant::{
    Binary, Operation, Plant, PlantData, Signal, SizedEmbedding, SizedPlant, Unary,
};
use nalgebra::{SMatrix, SVector};

/// Arguments at which functions have kinks, zeros, poles and ends, and others; 0.3 is where the slope of sinc changes
/// its formula.
const ARGUMENTS: [f64; 17] = [
    -2.0, -1.0, -0.7, -0.3, -1e-9, -0.0, 0.0, 1e-300, 1e-9, 0.29, 0.3, 0.31, 0.5, 1.0, 1.5, 2.0,
    40.0,
];

const UNARY: [Unary; 25] = [
    Unary::Negative,
    Unary::Square,
    Unary::Inverse,
    Unary::Tan,
    Unary::Elementary(Elementary::Sin),
    Unary::Elementary(Elementary::Cos),
    Unary::Elementary(Elementary::Sinc),
    Unary::Elementary(Elementary::Sinhc),
    Unary::Elementary(Elementary::Atan),
    Unary::Elementary(Elementary::Exp),
    Unary::Elementary(Elementary::Ln),
    Unary::Elementary(Elementary::Sqrt),
    Unary::Elementary(Elementary::Tanh),
    Unary::Elementary(Elementary::Asin),
    Unary::Elementary(Elementary::Acos),
    Unary::Elementary(Elementary::Sinh),
    Unary::Elementary(Elementary::Cosh),
    Unary::Elementary(Elementary::Asinh),
    Unary::Elementary(Elementary::Acosh),
    Unary::Elementary(Elementary::Atanh),
    Unary::Elementary(Elementary::ExpM1),
    Unary::Elementary(Elementary::Ln1p),
    Unary::Elementary(Elementary::Abs),
    Unary::Elementary(Elementary::Sign),
    Unary::Elementary(Elementary::Floor),
];

const BINARY: [Binary; 12] = [
    Binary::Add,
    Binary::Subtract,
    Binary::Multiply,
    Binary::Divide,
    Binary::Bivariate(Bivariate::Power),
    Binary::Bivariate(Bivariate::Atan2),
    Binary::Bivariate(Bivariate::Min),
    Binary::Bivariate(Bivariate::Max),
    Binary::Bivariate(Bivariate::Less),
    Binary::Bivariate(Bivariate::LessOrEqual),
    Binary::Bivariate(Bivariate::Equal),
    Binary::Bivariate(Bivariate::IfElseZero),
];

/// A plant whose one derivative that is not constant is the last of these operations.
fn plant_of(operations: Vec<Operation>) -> SizedPlant<2, 1> {
    let result = operations.len() - 1;
    let data = PlantData {
        name: "one".into(),
        states: vec![Signal::new("x", ""), Signal::new("y", "")],
        inputs: vec![Signal::new("u", "")],
        derivative: vec![result, 0],
        operations,
        ..PlantData::default()
    };
    SizedPlant::new(Plant::new(data).unwrap()).unwrap()
}

fn by_formulas<const NX: usize, const NU: usize>(
    plant: &SizedPlant<NX, NU>,
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
) -> Tangent<f64, NX, NU> {
    let mut tangents = [(SVector::zeros(), SMatrix::zeros(), SMatrix::zeros())];
    assert!(plant.tangent_each(&[*x], &[*u], &mut tangents), "by duals");
    tangents[0]
}

fn by_duals<const NX: usize, const NU: usize>(
    plant: &SizedPlant<NX, NU>,
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
) -> Tangent<f64, NX, NU> {
    tangent_by_duals(
        x,
        u,
        |x: &SVector<Dual<f64, NX>, NX>, u| plant.f(x, u),
        |x, u| plant.f(x, u),
    )
}

/// To rounding; what is infinite is the same infinity. Dual numbers multiply a derivative that is always zero with an
/// infinite one, too, which gives none; a formula leaves it zero, or has the infinite one.
fn same(found: f64, expected: f64) -> bool {
    found == expected
        || (expected.is_nan() && (found == 0.0 || !found.is_finite()))
        || (found - expected).abs() <= 4e-15 * (expected.abs() + f64::MIN_POSITIVE)
}

fn compare(what: &str, plant: &SizedPlant<2, 1>, x: SVector<f64, 2>, u: SVector<f64, 1>) {
    let (f, a, b) = by_formulas(plant, &x, &u);
    let (expected_f, expected_a, expected_b) = by_duals(plant, &x, &u);
    let found = f.iter().chain(a.iter()).chain(b.iter());
    let expected = { expected_f.iter() }
        .chain(expected_a.iter())
        .chain(expected_b.iter());
    for (found, expected) in found.zip(expected) {
        // Where there is no value there is no derivative.
        let none = expected_f[0].is_nan() && !found.is_finite();
        assert!(
            none || same(*found, *expected),
            "{what} at {x:?}, {u:?}: {f:?} {a:?} {b:?} for {expected_f:?} {expected_a:?} {expected_b:?}"
        );
    }
}

#[test]
fn every_function_of_one_number_has_the_slope_of_dual_numbers_everywhere() {
    for function in UNARY {
        // Of the state itself, of a multiple, of a sum with three slopes, and where a slope is zero.
        let of_state = plant_of(vec![Operation::State(0), Operation::Unary(function, 0)]);
        let of_sum = plant_of(vec![
            Operation::State(0),
            Operation::State(1),
            Operation::Input(0),
            Operation::Binary(Binary::Multiply, 1, 2),
            Operation::Binary(Binary::Add, 0, 3),
            Operation::Unary(function, 4),
        ]);
        for x in ARGUMENTS {
            compare(
                &format!("{function:?}"),
                &of_state,
                SVector::from([x, 0.3]),
                SVector::from([0.1]),
            );
            for u in [0.0, 1.0] {
                let (x, u) = (SVector::from([x, 0.0]), SVector::from([u]));
                compare(&format!("{function:?} of a sum"), &of_sum, x, u);
            }
        }
    }
}

#[test]
fn every_function_of_two_numbers_has_the_slopes_of_dual_numbers_everywhere() {
    for function in BINARY {
        let leaves = [
            Operation::State(0),
            Operation::State(1),
            Operation::Input(0),
        ];
        let with = |rest: &[Operation]| plant_of([&leaves, rest].concat());
        let plants = [
            ("of both states", with(&[Operation::Binary(function, 0, 1)])),
            ("of one twice", with(&[Operation::Binary(function, 0, 0)])),
            (
                "of state and input, and a product of both",
                with(&[
                    Operation::Binary(Binary::Multiply, 1, 2),
                    Operation::Binary(function, 0, 3),
                ]),
            ),
        ];
        for (what, plant) in &plants {
            for x in ARGUMENTS {
                for y in ARGUMENTS {
                    let (x, u) = (SVector::from([x, y]), SVector::from([1.0]));
                    compare(&format!("{function:?} {what}"), plant, x, u);
                }
            }
        }
        for constant in [
            -65.0, -3.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 7.0, 64.0, 65.0, 0.3,
        ] {
            let number = [Operation::Constant(constant)];
            let second = with(&[number[0], Operation::Binary(function, 0, 3)]);
            let first = with(&[number[0], Operation::Binary(function, 3, 0)]);
            for x in ARGUMENTS {
                let (x, u) = (SVector::from([x, 0.0]), SVector::from([0.0]));
                for (plant, of) in [(&second, "x and"), (&first, "of x after")] {
                    let what = format!("{function:?} {of} {constant}");
                    let (f, a, _) = by_formulas(plant, &x, &u);
                    let (expected_f, expected_a, _) = by_duals(plant, &x, &u);
                    // A power by multiplication is differentiated product by product: other roundings, and no
                    // number where the power itself is none or a pole.
                    let close = (a[(0, 0)] - expected_a[(0, 0)]).abs()
                        <= 1e-13 * (expected_a[(0, 0)].abs() + f64::MIN_POSITIVE);
                    let none = !expected_f[0].is_finite() && !a[(0, 0)].is_finite();
                    assert!(
                        none || close || same(a[(0, 0)], expected_a[(0, 0)]),
                        "{what} at {x:?}: {a:?} for {expected_a:?}"
                    );
                    assert!(same(f[0], expected_f[0]), "{what} at {x:?}: {f:?}");
                }
            }
        }
    }
}

/// A few steps of a generator of numbers that look random.
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = { self.0 }
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % count
    }

    fn within_one(&mut self) -> f64 {
        self.below(20_001) as f64 / 1e4 - 1.0
    }
}

/// Programs in which all meet all, with zeros, ones and signs to be left out.
#[test]
fn random_programs_have_the_derivatives_of_dual_numbers() {
    let mut random = Random(7);
    for _ in 0..300 {
        let mut operations = vec![
            Operation::State(0),
            Operation::State(1),
            Operation::Input(0),
            Operation::Constant(0.0),
            Operation::Constant(1.0),
            Operation::Constant(-1.0),
            Operation::Constant(0.7),
        ];
        for _ in 0..25 {
            let (i, j) = (
                random.below(operations.len()),
                random.below(operations.len()),
            );
            let function = random.below(15);
            operations.push(match function {
                0..9 => Operation::Binary(BINARY[function % 3], i, j),
                9 => Operation::Unary(Unary::Negative, i),
                // Nothing grows beyond what is comparable.
                10 | 11 => Operation::Unary(Unary::Elementary(Elementary::Tanh), i),
                12 => Operation::Unary(Unary::Elementary(Elementary::Sin), i),
                13 => Operation::Unary(Unary::Elementary(Elementary::Cos), i),
                _ => Operation::Binary(Binary::Bivariate(Bivariate::Min), i, j),
            });
        }
        let last = operations.len() - 1;
        operations.push(Operation::Unary(Unary::Elementary(Elementary::Tanh), last));
        let plant = plant_of(operations);
        for _ in 0..4 {
            let x = SVector::from([random.within_one(), random.within_one()]);
            let u = SVector::from([random.within_one()]);
            let ((f, a, b), (g, c, d)) = (by_formulas(&plant, &x, &u), by_duals(&plant, &x, &u));
            let size = 1.0 + c.amax().max(d.amax());
            let error = (f - g).amax().max((a - c).amax()).max((b - d).amax());
            assert!(
                error <= 1e-10 * size,
                "{error:e}: {:?}",
                plant.plant().to_json()
            );
        }
    }
}

#[test]
fn several_points_at_once_are_as_one_by_one() {
    let cart_pole = SizedEmbedding::<4, 1, 2>::new(plant("cart-pole")).unwrap();
    let zero = (SVector::zeros(), SMatrix::zeros(), SMatrix::zeros());
    for four in points("cart-pole").chunks(4) {
        let x: [_; 4] = std::array::from_fn(|k| SVector::from_column_slice(&four[k].x));
        let u: [_; 4] = std::array::from_fn(|k| SVector::from_column_slice(&four[k].u));
        let (mut tangents, mut embedded) = ([zero; 4], [zero; 4]);
        LpvModel::tangent_each(&cart_pole, &x, &u, &mut tangents);
        LpvModel::embedded_each(&cart_pole, &x, &u, &mut embedded);
        for k in 0..4 {
            assert_eq!(tangents[k], LpvModel::tangent(&cart_pole, &x[k], &u[k]));
            assert_eq!(embedded[k], LpvModel::embedded(&cart_pole, &x[k], &u[k]));
            let (f, a, b) = embedded[k];
            let s = Embedding::scheduling(&cart_pole, &x[k], &u[k]);
            let (expected_a, expected_b) = Embedding::matrices(&cart_pole, &s);
            assert!((a - expected_a).amax() <= 1e-14 * (1.0 + a.amax()));
            assert!((b - expected_b).amax() <= 1e-14 * (1.0 + b.amax()));
            assert!((f - (a * x[k] + b * u[k])).amax() <= 1e-13 * (1.0 + f.amax()));
        }
    }
    let functions = AlongMotion::<_, 5>(SizedPlant::<3, 2>::new(plant("functions")).unwrap());
    for four in points("functions").chunks(4) {
        let x: [_; 4] = std::array::from_fn(|k| SVector::from_column_slice(&four[k].x));
        let u: [_; 4] = std::array::from_fn(|k| SVector::from_column_slice(&four[k].u));
        let mut tangents = [(SVector::zeros(), SMatrix::zeros(), SMatrix::zeros()); 4];
        functions.tangent_each(&x, &u, &mut tangents);
        for k in 0..4 {
            assert_eq!(tangents[k], functions.tangent(&x[k], &u[k]));
        }
    }
}

/// Numbers that stay from one evaluation to the next are those of the plant that is evaluated.
#[test]
fn plants_that_take_turns_keep_their_own_numbers() {
    let one = SizedEmbedding::<4, 1, 2>::new(plant("cart-pole")).unwrap();
    let mut other = one.clone();
    other.set_parameter("pole_mass", 0.5).unwrap();
    for point in points("cart-pole") {
        let (x, u) = (
            SVector::from_column_slice(&point.x),
            SVector::from_column_slice(&point.u),
        );
        let mut found = Vec::new();
        for plant in [&one, &other] {
            let f: SVector<f64, 4> = Embedding::f(plant, &x, &u);
            let lifted = |v: f64| Dual::<f64, 1>::fixed(v);
            let by_duals = Embedding::f(plant, &x.map(lifted), &u.map(lifted));
            assert_eq!(f, by_duals.map(|rate| rate.value));
            let mut tangents = [(SVector::zeros(), SMatrix::zeros(), SMatrix::zeros()); 4];
            LpvModel::tangent_each(plant, &[x; 4], &[u; 4], &mut tangents);
            assert_eq!(tangents[2], LpvModel::tangent(plant, &x, &u));
            found.push(f);
        }
        assert!(found[0] != found[1] || u[0] == 0.0 || x[1] == 0.0);
    }
}

/// Friction that there is none of, 0/sqrt(y^2 + c), is left out with its derivatives; where the root may be zero it is
/// not.
#[test]
fn a_quotient_that_is_always_zero_has_no_derivative() {
    use Operation::{Binary as B, Constant, Input, State, Unary as U};
    let root = Unary::Elementary(Elementary::Sqrt);
    let start = [State(0), State(1), Input(0), Constant(0.0), Constant(1e-3)];
    let of = |rest: &[Operation]| plant_of([&start[..], rest].concat());
    let never_zero = of(&[
        B(Binary::Multiply, 1, 1),
        B(Binary::Add, 5, 4),
        U(root, 6),
        B(Binary::Divide, 3, 7),
        B(Binary::Multiply, 8, 0),
        B(Binary::Add, 9, 2),
    ]);
    let zero_at_rest = of(&[
        B(Binary::Multiply, 1, 1),
        U(root, 5),
        B(Binary::Divide, 3, 6),
        B(Binary::Add, 7, 2),
    ]);
    for x in ARGUMENTS {
        for y in ARGUMENTS {
            let (x, u) = (SVector::from([x, y]), SVector::from([0.7]));
            compare("never zero", &never_zero, x, u);
            let (f, a, b) = by_formulas(&never_zero, &x, &u);
            assert_eq!((f[0], a[(0, 0)], a[(0, 1)], b[0]), (0.7, 0.0, 0.0, 1.0));
            assert_eq!(zero_at_rest.f(&x, &u)[0].is_nan(), y * y == 0.0);
        }
    }
}

#[test]
fn a_changed_parameter_is_seen_by_all_formulas() {
    let mut changed = SizedEmbedding::<4, 1, 2>::new(plant("cart-pole")).unwrap();
    changed.set_parameter("pole_mass", 0.5).unwrap();
    let mut data = plant("cart-pole").data().clone();
    data.parameters[1].value = 0.5;
    let other = SizedEmbedding::<4, 1, 2>::new(Plant::new(data).unwrap()).unwrap();
    for point in points("cart-pole") {
        let (x, u) = (
            SVector::from_column_slice(&point.x),
            SVector::from_column_slice(&point.u),
        );
        assert_eq!(
            LpvModel::tangent(&changed, &x, &u),
            LpvModel::tangent(&other, &x, &u)
        );
        assert_eq!(
            LpvModel::embedded(&changed, &x, &u),
            LpvModel::embedded(&other, &x, &u)
        );
        let f: SVector<f64, 4> = Embedding::f(&changed, &x, &u);
        assert_eq!(f, Embedding::f(&other, &x, &u));
    }
}

/// As long as a file may be: a chain of products of all variables, and sums that are all needed to the end.
#[test]
fn derivatives_that_would_be_too_long_are_left_to_dual_numbers() {
    let count = 99_990;
    let mut operations = vec![
        Operation::State(0),
        Operation::State(1),
        Operation::Input(0),
    ];
    let mut wide = operations.clone();
    while operations.len() < count {
        let last = operations.len() - 1;
        operations.push(Operation::Unary(Unary::Elementary(Elementary::Sin), last));
        operations.push(Operation::Binary(Binary::Multiply, last + 1, last % 2));
    }
    while wide.len() < count / 2 {
        wide.push(Operation::Binary(
            Binary::Multiply,
            wide.len() - 1,
            wide.len() % 3,
        ));
    }
    for i in 3..count / 2 {
        wide.push(Operation::Binary(Binary::Add, wide.len() - 1, i));
    }
    for operations in [operations, wide] {
        let plant = plant_of(operations);
        let (x, u) = (SVector::from([0.3, 0.2]), SVector::from([0.5]));
        let mut tangents = [(SVector::zeros(), SMatrix::zeros(), SMatrix::zeros())];
        assert!(!plant.tangent_each(&[x], &[u], &mut tangents));
        let expected = by_duals(&plant, &x, &u);
        assert_eq!(AlongMotion::<_, 3>(plant).tangent(&x, &u), expected);
    }
}
