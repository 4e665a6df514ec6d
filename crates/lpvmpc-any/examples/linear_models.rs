//! Closed loops of a cart-pole from random starts under each kind of linear models: what they cost, and
//! the quadratic programs that they take.
//!
//! ```text
//! cargo run --release -p lpvmpc-any --example linear_models
//! ```

use lpvmpc_any::{Limits, LinearModels, Mpc, MpcSettings, Preview};
use lpvmpc_plant::Plant;
use std::error::Error;

const STARTS: usize = 200;
const SAMPLES: usize = 100;

/// Costs of the closed loops, and programs per sample.
fn run(plant: &Plant, linear_models: LinearModels) -> Result<(Vec<f64>, f64), Box<dyn Error>> {
    let mut random = fastrand::Rng::with_seed(1);
    let mut within = |half: f64| half * (2.0 * random.f64() - 1.0);
    let (mut costs, mut problems) = (Vec::new(), 0);
    for start in 0..STARTS {
        // Half of them upright at a distance, half of them leaning.
        let (aside, lean) = if start % 2 == 0 {
            (4.0, 0.1)
        } else {
            (0.5, 0.9)
        };
        let mut x = vec![within(aside), within(lean), within(1.0), within(1.0)];
        let settings = MpcSettings {
            substeps: 2,
            u_bounds: Some(Limits {
                lower: vec![-15.0],
                upper: vec![15.0],
            }),
            linear_models,
            ..MpcSettings::new(0.04, 40, &[10.0, 10.0, 0.1, 0.1], &[0.01])
        };
        let mut mpc = Mpc::new(plant, &settings)?;
        let mut cost = 0.0;
        for _ in 0..SAMPLES {
            let plan = mpc.step(&x, &Preview::default())?;
            problems += plan.problems;
            for (i, x) in x.iter().enumerate() {
                cost += settings.q[(i, i)] * x * x;
            }
            cost += settings.r[(0, 0)] * plan.u[(0, 0)].powi(2);
            // The plan is a rollout of the plant.
            x = plan.x.row(1).iter().copied().collect();
        }
        let upright = x.iter().all(|x| x.abs() < 0.3);
        costs.push(if upright { cost } else { f64::INFINITY });
    }
    Ok((costs, problems as f64 / (STARTS * SAMPLES) as f64))
}

fn main() -> Result<(), Box<dyn Error>> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/plants");
    let plant = Plant::load(format!("{root}/cart-pole.json"))?;
    let kinds = [
        ("along the motion", LinearModels::AlongMotion),
        ("ray, 2 nodes", LinearModels::AlongRay { nodes: 2 }),
        ("ray, 3 nodes", LinearModels::AlongRay { nodes: 3 }),
        ("ray, 6 nodes", LinearModels::AlongRay { nodes: 6 }),
        ("own embedding", LinearModels::Own),
    ];
    let runs = kinds.map(|(name, models)| Ok::<_, Box<dyn Error>>((name, run(&plant, models)?)));
    let mut all = Vec::new();
    for run in runs {
        all.push(run?);
    }
    let best: Vec<f64> = (0..STARTS)
        .map(|i| { all.iter() }.fold(f64::INFINITY, |least, (_, (costs, _))| least.min(costs[i])))
        .collect();
    println!("linear models     programs  not upright  above the best by 1 %  by 10 %  worst");
    for (name, (costs, programs)) in all {
        let ratios: Vec<f64> = { costs.iter().zip(&best) }
            .filter(|(cost, _)| cost.is_finite())
            .map(|(cost, best)| cost / best)
            .collect();
        let above = |limit: f64| ratios.iter().filter(|ratio| **ratio > limit).count();
        let worst = ratios
            .iter()
            .fold(1.0_f64, |worst, ratio| worst.max(*ratio));
        println!(
            "{name:16} {programs:9.2} {:12} {:22} {:8} {worst:6.2}",
            STARTS - ratios.len(),
            above(1.01),
            above(1.1)
        );
    }
    Ok(())
}
