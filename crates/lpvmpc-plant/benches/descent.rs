//! Which linear models of a cart-pole make a descent short: its derivatives, their means along rays
//! from the upright, or its own embedding.
//!
//! ```text
//! cargo bench -p lpvmpc-plant --bench descent
//! ```

use lpvmpc::{
    AlongMotion, AlongRay, Bounds, Controller, ControllerSettings, GaussLegendre, LpvModel,
    Reference, Rk4, TerminalIngredient, Weights,
};
use lpvmpc_design::lqr_discrete;
use lpvmpc_plant::{Plant, SizedEmbedding, SizedPlant};
use nalgebra::{DMatrix, Matrix1, Matrix4, Vector1, Vector4};
use std::error::Error;

const T_S: f64 = 0.04;
const HORIZON: usize = 40;
const RK4: Rk4 = Rk4 { substeps: 2 };

/// Start and largest force in N, towards rest at 0.
const TASKS: [(&str, [f64; 4], f64); 6] = [
    ("tilt of 0.3 rad", [0.0, 0.3, 0.0, 0.0], 15.0),
    ("tilt of 0.6 rad", [0.0, 0.6, 0.0, 0.0], 15.0),
    ("tilt of 1.0 rad", [0.0, 1.0, 0.0, 0.0], 30.0),
    ("1 m aside", [1.0, 0.0, 0.0, 0.0], 15.0),
    ("4 m aside", [4.0, 0.0, 0.0, 0.0], 15.0),
    ("swing up", [0.0, 3.1, 0.0, 0.0], 30.0),
];

/// Programs of the first sample and of all, and the cost of the closed loop; infinite if it does not end
/// upright.
fn run<P, const NS: usize>(
    model: P,
    (start, force): ([f64; 4], f64),
) -> Result<(usize, usize, f64), Box<dyn Error>>
where
    P: LpvModel<f64, 4, 1, NS>,
{
    let q = Matrix4::from_diagonal(&Vector4::new(10.0, 10.0, 0.1, 0.1));
    let r = Matrix1::new(0.01);
    let (a, b) = RK4.differentiate(&model, &Vector4::zeros(), &Vector1::zeros(), T_S);
    let lqr = lqr_discrete(
        &DMatrix::from_column_slice(4, 4, a.as_slice()),
        &DMatrix::from_column_slice(4, 1, b.as_slice()),
        &DMatrix::from_column_slice(4, 4, q.as_slice()),
        &DMatrix::from_column_slice(1, 1, r.as_slice()),
    )?;
    let bounds = Bounds {
        lower: Vector1::new(-force),
        upper: Vector1::new(force),
    };
    let terminal = TerminalIngredient::Cost(Matrix4::from_column_slice(lqr.p.as_slice()));
    let mut settings = ControllerSettings::new(T_S, HORIZON, Weights { q, r }, terminal, bounds);
    settings.predictor = lpvmpc::Predictor::StageConsistent(RK4);
    let mut controller = Controller::allocate(model, settings)?;
    let mut workspace = controller.workspace();
    let mut x = Vector4::from(start);
    let (mut first, mut all, mut cost) = (0, 0, 0.0);
    let rest = Reference::constant(Vector4::zeros());
    for sample in 0..150 {
        let u = controller.step(&x, &rest, &mut workspace).first_input();
        if sample == 0 {
            first = controller.problems();
        }
        all += controller.problems();
        cost += x.dot(&(q * x)) + r[0] * u[0] * u[0];
        x = RK4.advance(controller.model(), &x, &u, T_S);
    }
    if x.amax() > 0.05 {
        cost = f64::INFINITY;
    }
    Ok((first, all, cost))
}

fn main() -> Result<(), Box<dyn Error>> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/plants");
    let plant = Plant::load(format!("{root}/cart-pole.json"))?;
    let sized = SizedPlant::<4, 1>::new(plant.clone())?;
    println!("                                  programs, closed-loop cost (inf: not upright)");
    println!("task             models         first  150 samples");
    for (name, start, force) in TASKS {
        let row = |models: &str, (first, all, cost): (usize, usize, f64)| {
            println!("{name:16} {models:14} {first:5} {all:8} {cost:15.1}");
        };
        row(
            "derivatives",
            run(AlongMotion::<_, 5>(sized.clone()), (start, force))?,
        );
        for count in [1, 3, 6] {
            let ray = AlongRay::<_, f64, 4, 1, 5> {
                plant: sized.clone(),
                x: Vector4::zeros(),
                u: Vector1::zeros(),
                nodes: GaussLegendre::with_nodes(count),
            };
            row(&format!("ray, {count} nodes"), run(ray, (start, force))?);
        }
        row(
            "own embedding",
            run(
                SizedEmbedding::<4, 1, 2>::new(plant.clone())?,
                (start, force),
            )?,
        );
    }
    Ok(())
}
