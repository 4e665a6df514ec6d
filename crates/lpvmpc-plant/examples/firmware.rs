//! Writes the firmware of a cart-pole into a folder.
//!
//! ```text
//! cargo run -p lpvmpc-plant --example firmware FOLDER
//! cd FOLDER && cargo run --release
//! ```

use lpvmpc::{AlongMotion, Rk4};
use lpvmpc_design::lqr_discrete;
use lpvmpc_plant::{FirmwareSettings, Plant, SizedPlant};
use nalgebra::{DMatrix, DVector};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("which folder?")?;
    let crates = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let plant = Plant::load(format!("{crates}/../testdata/plants/cart-pole.json"))?;
    let model = AlongMotion::<_, 5>(SizedPlant::<4, 1>::new(plant.clone())?);
    let t_s = 0.05;
    let (x, u) = model.0.equilibrium().ok_or("no equilibrium")?;
    let (a, b) = Rk4 { substeps: 1 }.differentiate(&model, &x, &u, t_s);
    let (q, r) = (vec![10.0, 10.0, 0.1, 0.1], vec![0.01]);
    let lqr = lqr_discrete(
        &DMatrix::from_column_slice(4, 4, a.as_slice()),
        &DMatrix::from_column_slice(4, 1, b.as_slice()),
        &DMatrix::from_diagonal(&DVector::from_vec(q.clone())),
        &DMatrix::from_diagonal(&DVector::from_vec(r.clone())),
    )?;
    let rows = lqr.p.row_iter().map(|row| row.iter().copied().collect());
    let settings = FirmwareSettings {
        lpvmpc: format!("{crates}/lpvmpc"),
        t_s,
        horizon: 20,
        p: rows.collect(),
        q,
        r,
        target: vec![0.0; 4],
        start: vec![0.0, 0.3, 0.0, 0.0],
        samples: 100,
    };
    plant.save_firmware(&settings, folder)?;
    Ok(())
}
