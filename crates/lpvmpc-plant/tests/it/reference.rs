//! Against CasADi, which made the files and tells the values and derivatives at random points.

use lpvmpc::{AlongMotion, Embedding, LpvModel};
use lpvmpc_plant::{Plant, SizedEmbedding, SizedPlant};
use nalgebra::{SMatrix, SVector};
use serde::Deserialize;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/plants")
        .join(name)
}

pub fn plant(name: &str) -> Plant {
    Plant::load(file(&format!("{name}.json"))).unwrap()
}

/// Values at a point; matrices row by row.
#[derive(Deserialize)]
pub struct Point {
    pub x: Vec<f64>,
    pub u: Vec<f64>,
    pub f: Vec<f64>,
    y: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
}

pub fn points(name: &str) -> Vec<Point> {
    let text = std::fs::read_to_string(file("values.json")).unwrap();
    let mut all: HashMap<String, Vec<Point>> = serde_json::from_str(&text).unwrap();
    all.remove(name).unwrap()
}

fn close(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-13 * (1.0 + expected.abs())
}

/// Every value and derivative, in places for `NX` states and `NU` inputs.
fn compare<const NX: usize, const NU: usize, const NS: usize>(name: &str) {
    let plant = plant(name);
    let sized = AlongMotion::<_, NS>(SizedPlant::<NX, NU>::new(plant.clone()).unwrap());
    for point in points(name) {
        let (states, inputs) = (point.x.len(), point.u.len());
        let mut x = SVector::<f64, NX>::repeat(0.4);
        let mut u = SVector::<f64, NU>::repeat(-0.7);
        x.as_mut_slice()[..states].copy_from_slice(&point.x);
        u.as_mut_slice()[..inputs].copy_from_slice(&point.u);
        let (f, a, b) = sized.tangent(&x, &u);
        let y: SVector<f64, 3> = sized.0.output(&x, &u).unwrap();
        let full = |matrix: &[f64], columns: usize, i: usize, j: usize| {
            if i < states && j < columns {
                matrix[i * columns + j]
            } else {
                0.0
            }
        };
        for i in 0..NX {
            let expected = point.f.get(i).copied().unwrap_or(0.0);
            assert!(
                close(f[i], expected),
                "{name}: f[{i}] = {} for {expected}",
                f[i]
            );
            for j in 0..NX {
                let expected = full(&point.a, states, i, j);
                assert!(
                    close(a[(i, j)], expected),
                    "{name}: {} for {expected}",
                    a[(i, j)]
                );
            }
            for j in 0..NU {
                let expected = full(&point.b, inputs, i, j);
                assert!(
                    close(b[(i, j)], expected),
                    "{name}: {} for {expected}",
                    b[(i, j)]
                );
            }
        }
        for (i, found) in y.iter().enumerate() {
            assert!(close(*found, point.y.get(i).copied().unwrap_or(0.0)));
        }
        // With sizes that are known at run time.
        assert_eq!(
            plant.derivative(&point.x, &point.u).unwrap(),
            f.as_slice()[..states]
        );
        assert_eq!(
            plant.output(&point.x, &point.u).unwrap(),
            y.as_slice()[..point.y.len()]
        );
        let narrow: Vec<f32> = { point.x.iter() }.map(|x| *x as f32).collect();
        let inputs: Vec<f32> = { point.u.iter() }.map(|u| *u as f32).collect();
        for (narrow, wide) in plant
            .derivative(&narrow, &inputs)
            .unwrap()
            .iter()
            .zip(&point.f)
        {
            let size: f64 = 1.0
                + point
                    .a
                    .iter()
                    .chain(&point.b)
                    .map(|slope| slope.abs())
                    .sum::<f64>();
            assert!(
                (f64::from(*narrow) - wide).abs() < 1e-5 * size,
                "{narrow} for {wide}"
            );
        }
    }
}

#[test]
fn values_and_derivatives_are_those_of_casadi() {
    compare::<4, 1, 5>("cart-pole");
    compare::<3, 2, 5>("functions");
}

#[test]
fn places_that_are_left_over_change_nothing() {
    compare::<6, 2, 8>("cart-pole");
    compare::<4, 3, 7>("functions");
}

#[test]
fn an_embedding_of_its_own_is_f() {
    let cart_pole = plant("cart-pole");
    let exact = SizedEmbedding::<4, 1, 2>::new(cart_pole.clone()).unwrap();
    let roomy = SizedEmbedding::<5, 2, 4>::new(cart_pole).unwrap();
    for point in points("cart-pole") {
        let (x, u) = (
            SVector::from_column_slice(&point.x),
            SVector::from_column_slice(&point.u),
        );
        let s = Embedding::scheduling(&exact, &x, &u);
        let (a, b) = Embedding::matrices(&exact, &s);
        let f = SVector::<f64, 4>::from_column_slice(&point.f);
        assert!((a * x + b * u - f).amax() < 1e-12 * (1.0 + f.amax()));
        assert!(Embedding::offset(&exact, &s).is_none());
        let x = SVector::<f64, 5>::from_fn(|i, _| *x.get(i).unwrap_or(&9.0));
        let u = SVector::<f64, 2>::from_fn(|i, _| *u.get(i).unwrap_or(&9.0));
        let s = Embedding::scheduling(&roomy, &x, &u);
        let (large_a, large_b) = Embedding::matrices(&roomy, &s);
        assert_eq!(large_a.view((0, 0), (4, 4)), a);
        assert_eq!(large_b.view((0, 0), (4, 1)), b);
        let rest = SMatrix::<f64, 5, 5>::zeros();
        assert_eq!(
            (large_a.row(4), large_a.column(4)),
            (rest.row(4), rest.column(4))
        );
        assert_eq!(large_b.column(1), rest.column(4));
    }
    // At rest, where sin(x)/x is 1.
    let s = SVector::<f64, 2>::zeros();
    let (a, _): (SMatrix<f64, 4, 4>, _) = Embedding::matrices(&exact, &s);
    let d = 4.0 / 3.0 * 1.3 - 0.3;
    assert!((a[(3, 1)] - 1.3 / 0.5 * 9.81 / d).abs() < 1e-14);
}
