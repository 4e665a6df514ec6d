//! Derivatives by formulas are those by dual numbers.

use crate::reference::{plant, points};
use lpvmpc::LpvModel;
use lpvmpc_plant::SizedEmbedding;
use nalgebra::SVector;

#[test]
fn several_points_at_once_are_as_one_by_one() {
    let plant = SizedEmbedding::<4, 1, 2>::new(plant("cart-pole")).unwrap();
    let all = points("cart-pole");
    for four in all.chunks(4) {
        let x: [SVector<f64, 4>; 4] =
            std::array::from_fn(|k| SVector::from_column_slice(&four[k].x));
        let u: [SVector<f64, 1>; 4] =
            std::array::from_fn(|k| SVector::from_column_slice(&four[k].u));
        for (k, (f, a, b)) in LpvModel::tangent_each(&plant, &x, &u)
            .into_iter()
            .enumerate()
        {
            assert_eq!((f, a, b), LpvModel::tangent(&plant, &x[k], &u[k]));
        }
        for (k, (f, a, b)) in LpvModel::embedded_each(&plant, &x, &u)
            .into_iter()
            .enumerate()
        {
            assert_eq!((f, a, b), LpvModel::embedded(&plant, &x[k], &u[k]));
            let (aa, bb) = LpvModel::matrices(&plant, &LpvModel::scheduling(&plant, &x[k], &u[k]));
            assert!((a - aa).amax() < 1e-12, "{a}{aa}");
            assert!((b - bb).amax() < 1e-12);
            assert!(
                (f - LpvModel::<f64, 4, 1, 2>::derivative(&plant, &x[k], &u[k])).amax() < 1e-12
            );
        }
    }
}
