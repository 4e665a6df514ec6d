//! The embedding along rays of a plant from a file, and enclosures of its f.

use crate::reference::{file, plant};
use lpvmpc::{AlongRay, Bounds, Dynamics, GaussLegendre, LpvModel};
use lpvmpc_certificate::{Interval, TaylorModel};
use lpvmpc_design::nodes_along_ray;
use lpvmpc_plant::SizedPlant;
use nalgebra::{Matrix4, SVector, Vector1, Vector4};
use serde::Deserialize;

/// Mean derivatives, by an adaptive quadrature of SciPy.
#[derive(Deserialize)]
struct Ray {
    from: Vec<f64>,
    to: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
}

#[test]
fn mean_derivatives_are_those_of_an_adaptive_quadrature() {
    let rays = std::fs::read_to_string(file("rays.json")).unwrap();
    let rays: Vec<Ray> = serde_json::from_str(&rays).unwrap();
    let plant = SizedPlant::<4, 1>::new(plant("cart-pole")).unwrap();
    for Ray { from, to, a, b } in rays {
        let ray = AlongRay::<_, f64, 4, 1, 5> {
            plant: plant.clone(),
            x: Vector4::from_column_slice(&from[..4]),
            u: Vector1::new(from[4]),
            nodes: GaussLegendre::with_nodes(GaussLegendre::MOST),
        };
        let (found_a, found_b) = ray.matrices(&SVector::from_column_slice(&to));
        let a = Matrix4::from_row_slice(&a);
        let b = Vector4::from_column_slice(&b);
        assert!((found_a - a).amax() < 1e-9, "{}", found_a - a);
        assert!((found_b - b).amax() < 1e-9);
    }
}

#[test]
fn as_few_nodes_are_chosen_as_the_tolerance_allows() {
    let plant = SizedPlant::<4, 1>::new(plant("cart-pole")).unwrap();
    let x = Bounds {
        lower: -Vector4::new(1.0, 1.0, 2.0, 3.0),
        upper: Vector4::new(1.0, 1.0, 2.0, 3.0),
    };
    let u = plant.u_bounds();
    let (at_x, at_u) = plant.equilibrium().unwrap();
    let choose = |tolerance| {
        nodes_along_ray::<_, 4, 1, 5>(&plant, (&at_x, &at_u), (&x, &u), tolerance, 200).unwrap()
    };
    let counts = [1e-1, 1e-3, 1e-6].map(|tolerance| {
        let found = choose(tolerance);
        assert!(found.defect.relative <= tolerance, "{found:?}");
        found.nodes.count()
    });
    assert!(
        counts[0] < counts[1] && counts[1] < counts[2] && counts[2] <= 12,
        "{counts:?}"
    );
    // One fewer would not do.
    let fewer = AlongRay::<_, f64, 4, 1, 5> {
        plant: plant.clone(),
        x: at_x,
        u: at_u,
        nodes: GaussLegendre::with_nodes(counts[1] - 1),
    };
    let worst = (0..2000).map(|i| {
        let part = |k: f64| 2.0 * (f64::from(i) * k).fract() - 1.0;
        let x = Vector4::new(
            part(0.3),
            part(0.7325),
            2.0 * part(0.819),
            3.0 * part(0.5698),
        );
        let u = Vector1::new(15.0 * part(0.4301));
        fewer.offset(&fewer.scheduling(&x, &u)).unwrap().amax()
    });
    assert!(worst.fold(0.0, f64::max) > 1e-3);
    // What cannot be reached is told.
    let best = choose(0.0);
    assert_eq!(best.nodes.count(), GaussLegendre::MOST);
    assert!(best.defect.relative > 0.0);
}

/// A plant from a file is proved as one in Rust is.
#[test]
fn enclosures_contain_the_values() {
    let plant = SizedPlant::<4, 1>::new(plant("cart-pole")).unwrap();
    let middle = [0.3, -0.4, 0.2, 1.1, 4.0];
    let half = [0.1, 0.2, 0.1, 0.4, 1.0];
    let symbol = |i: usize| TaylorModel::<5>::symbol(middle[i], half[i], i);
    let model = plant.f(
        &Vector4::from_fn(|i, _| symbol(i)),
        &Vector1::new(symbol(4)),
    );
    let range = |i: usize| Interval::around(middle[i], half[i]);
    let ranges = plant.f(&Vector4::from_fn(|i, _| range(i)), &Vector1::new(range(4)));
    for k in 0..500 {
        let z: [f64; 5] =
            std::array::from_fn(|i| 2.0 * (f64::from(k) * ((2 + i) as f64).sqrt()).fract() - 1.0);
        let at = |i: usize| middle[i] + half[i] * z[i];
        let f: Vector4<f64> = plant.f(&Vector4::from_fn(|i, _| at(i)), &Vector1::new(at(4)));
        for (i, value) in f.iter().enumerate() {
            let form = &model[i];
            let mut polynomial = form.middle;
            for (j, z_j) in z.iter().enumerate() {
                polynomial += form.slopes()[j] * z_j;
                for (k, z_k) in z.iter().enumerate().skip(j) {
                    polynomial += form.squares()[j][k] * z_j * z_k;
                }
            }
            assert!((polynomial - value).abs() <= form.error + 1e-13);
            assert!(ranges[i].lower - 1e-13 <= *value && *value <= ranges[i].upper + 1e-13);
        }
    }
    assert!(model.iter().all(|form| form.error < 0.5), "{model:?}");
}

/// What has no enclosure is unknown, not wrong.
#[test]
fn what_has_no_proof_has_no_enclosure() {
    let plant = SizedPlant::<3, 2>::new(plant("functions")).unwrap();
    let x = SVector::<f64, 3>::new(1.2, 0.7, -1.5).map(Interval::point);
    let f = plant.f(&x, &SVector::<f64, 2>::new(1.0, 2.0).map(Interval::point));
    assert!(f[0] != Interval::EVERYTHING && f[1] != Interval::EVERYTHING);
    assert_eq!(f[2], Interval::EVERYTHING);
}
