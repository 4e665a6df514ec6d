//! Certifies a plant file: `cargo run --release -p lpvmpc-certify --example certify plant.json T_S Q,... R,...`, with the
//! diagonals of Q and R; prints the certificate's figures and how long it took to find it and to prove it again.

use lpvmpc_certify::{CertifySettings, certify, verify};
use lpvmpc_plant::Plant;
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, t_s, q, r, rest @ ..] = arguments.as_slice() else {
        return Err("plant.json T_S Q,... R,... [ENLARGEMENT [BOXES [TRIALS]]]".into());
    };
    let list = |text: &str| -> Result<Vec<f64>, _> { text.split(',').map(str::parse).collect() };
    let plant = Plant::load(path)?;
    let mut settings = CertifySettings::new(t_s.parse()?, &list(q)?, &list(r)?);
    if let Some(enlargement) = rest.first() {
        settings.enlargement = enlargement.parse()?;
    }
    if let Some(boxes) = rest.get(1) {
        settings.most_boxes = Some(boxes.parse()?);
    }
    if let Some(trials) = rest.get(2) {
        settings.trials = trials.parse()?;
    }
    let start = Instant::now();
    let certificate = certify(&plant, &settings, &|_| ())?;
    let found = start.elapsed();
    let start = Instant::now();
    let verified = verify(&certificate, &plant, &|_| ())?;
    let proved = start.elapsed();
    println!(
        "{}: level {:.5}, {} boxes, contraction {:.5}; found in {:.2} s, proved again in {:.2} s",
        certificate.plant.name,
        certificate.level,
        verified.boxes,
        certificate.contraction,
        found.as_secs_f64(),
        proved.as_secs_f64(),
    );
    println!("  |x - x_eq| at most {:?}", verified.reach);
    println!("  K = {:?}", certificate.k);
    println!(
        "  equilibrium known within {:?}",
        certificate.equilibrium.within
    );
    Ok(())
}
