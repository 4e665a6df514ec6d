//! Plants in Rust become data with the same values.

use crate::printed::cart_pole::CartPole;
use crate::printed::functions::Functions;
use crate::reference::points;
use lpvmpc::{Dynamics, Embedding};
use lpvmpc_plant::{Plant, PlantData, SizedEmbedding, SizedPlant};
use nalgebra::{SMatrix, SVector};

#[test]
fn a_plant_in_rust_becomes_a_file_with_the_same_values() {
    let data = PlantData::of_dynamics("functions", &Functions::default());
    let text = Plant::new(data).unwrap().to_json();
    let from_file = SizedPlant::<3, 2>::new(Plant::from_json(&text).unwrap()).unwrap();
    for point in points("functions") {
        let (x, u) = (
            SVector::from_column_slice(&point.x),
            SVector::from_column_slice(&point.u),
        );
        let (found, expected): (SVector<f64, 3>, _) =
            (from_file.f(&x, &u), Functions::default().f(&x, &u));
        assert_eq!(found, expected);
    }
}

#[test]
fn an_embedding_in_rust_becomes_a_file_with_the_same_matrices() {
    let in_rust = CartPole {
        pole_mass: 0.2,
        ..CartPole::default()
    };
    let plant = Plant::new(PlantData::of_embedding("cart-pole", &in_rust)).unwrap();
    assert_eq!(plant.data().states[3].name, "x3");
    let from_file = SizedEmbedding::<4, 1, 2>::new(plant).unwrap();
    for point in points("cart-pole") {
        let (x, u) = (
            SVector::from_column_slice(&point.x),
            SVector::from_column_slice(&point.u),
        );
        let (found, expected): (SVector<f64, 4>, _) = (from_file.f(&x, &u), in_rust.f(&x, &u));
        assert_eq!(found, expected);
        let s = in_rust.scheduling(&x, &u);
        assert_eq!(from_file.scheduling(&x, &u), s);
        let matrices: (SMatrix<f64, 4, 4>, _) = from_file.matrices(&s);
        assert_eq!(matrices, in_rust.matrices(&s));
    }
}
