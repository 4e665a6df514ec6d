//! experiment
use ballbot_scenario::Scenario;
use lpvmpc::{Controller, Reference, Status, Workspace};
use nalgebra::Vector4;
use std::{env, error::Error, path::Path, time::Instant};

const N: usize = 80;
const M: usize = 400;

fn main() -> Result<(), Box<dyn Error>> {
    std::thread::Builder::new()
        .stack_size(256 << 20)
        .spawn(|| run().map_err(|e| e.to_string()))
        .unwrap()
        .join()
        .unwrap()?;
    Ok(())
}
fn run() -> Result<(), Box<dyn Error>> {
    let path = env::args().nth(1).unwrap();
    let most: usize = env::args().nth(2).map_or(8, |s| s.parse().unwrap());
    let only: Option<usize> = env::args().nth(3).map(|s| s.parse().unwrap());
    let text = std::fs::read_to_string(&path)?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let col = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let mut base = Scenario::load("single-setpoint")?;
    base.controller.predictor = None;
    base.controller.terminal = Default::default();
    let mut workspace = Box::new(Workspace::<f64, 4, 1, N, M>::new());
    let mut ratios = vec![];
    for (row, line) in lines.enumerate() {
        if only.is_some_and(|o| o != row) {
            continue;
        }
        let f: Vec<&str> = line.split(',').collect();
        if f.len() < header.len() {
            continue;
        }
        let num = |name: &str| f[col(name)].parse::<f64>().unwrap();
        let horizon = num("horizon") as usize;
        let t_s = num("t_s_s");
        let d = num("distance_m");
        let x0 = if header.contains(&"theta0_rad") {
            Vector4::new(
                0.0,
                num("theta0_rad"),
                num("phi_dot0_rad_s"),
                num("theta_dot0_rad_s"),
            )
        } else {
            Vector4::zeros()
        };
        base.controller.t_s = t_s;
        base.controller.horizon = horizon;
        let mut p = base.prepare(Path::new("."))?;
        if let lpvmpc::Iterations::Descent { most: m, .. } = &mut p.settings.iterations {
            *m = most;
        }
        let mut c = Box::new(Controller::<_, f64, 4, 1, 3, N, M>::new(
            p.ballbot, p.settings,
        )?);
        let goal = Vector4::new(d / 0.12, 0.0, 0.0, 0.0);
        let reference = Reference::constant(goal);
        let mut x = x0;
        let mut cost = 0.0;
        let samples = (num("duration_s") / t_s).round() as usize;
        let (mut programs, mut worst, mut times) = (0, 0, vec![]);
        let mut statuses = std::collections::BTreeMap::<String, usize>::new();
        let mut outside: f64 = 0.0;
        for k in 0..samples {
            let start = Instant::now();
            c.step(&x, &reference, &mut workspace);
            times.push(start.elapsed().as_secs_f64() * 1e6);
            let plan = c.solution();
            let u = plan.u[0];
            *statuses.entry(format!("{}", plan.status)).or_default() += 1;
            if only.is_some() {
                println!(
                    "{k} x {:.3} {:.3} {:.3} {:.3} u {:.4} {} programs {} active {} changes {} us {:.0}",
                    x[0],
                    x[1],
                    x[2],
                    x[3],
                    u[0],
                    plan.status,
                    c.problems(),
                    plan.active.len(),
                    plan.changes,
                    times[k]
                );
            }
            programs += c.problems();
            let plan = c.solution();
            worst = worst.max(c.problems());
            let _ = matches!(plan.status, Status::Solved);
            let e = x - goal;
            cost += 200.0 * e[0] * e[0]
                + e[1] * e[1]
                + 0.1 * e[2] * e[2]
                + 0.1 * e[3] * e[3]
                + 1000.0 * u[0] * u[0];
            match lpvmpc_sim::advance(&p.ballbot, &x, &u, t_s, p.tolerances) {
                Ok(next) => x = next,
                Err(_) => {
                    cost = f64::INFINITY;
                    break;
                }
            }
            let lim = [
                f64::INFINITY,
                1.0471975511965976,
                31.41592653589793,
                6.283185307179586,
            ];
            for j in 1..4 {
                outside = outside.max(x[j].abs() / lim[j] - 1.0);
            }
            if x[1].abs() > 1.57 {
                cost = f64::INFINITY;
                break;
            }
        }
        times.sort_by(f64::total_cmp);
        let best = num("cost_nonlinear");
        let r = cost / best;
        ratios.push((r, row, programs as f64 / samples as f64, worst));
        println!(
            "{row:4} N {horizon:2} ts {t_s:.3} d {d:6.2} x0 {:.2} {:.2} {:.2} ratio {r:.5} linear {:.4} mean programs {:.2} worst {worst} med {:.1} us max {:.1} out {:.4} {:?}",
            x0[1],
            x0[2],
            x0[3],
            num("cost_linear") / best,
            programs as f64 / samples as f64,
            times[times.len() / 2],
            times[times.len() - 1],
            outside,
            statuses
        );
    }
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = ratios.len();
    println!(
        "n {n} median {:.5} 90% {:.5} 95% {:.5} 99% {:.5} worst {:?}",
        ratios[n / 2].0,
        ratios[n * 9 / 10].0,
        ratios[n * 95 / 100].0,
        ratios[n * 99 / 100].0,
        &ratios[n.saturating_sub(8)..]
    );
    Ok(())
}
