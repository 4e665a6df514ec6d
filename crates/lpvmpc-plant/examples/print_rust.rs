//! Prints a plant file as Rust.
//!
//! ```text
//! cargo run -p lpvmpc-plant --example print_rust testdata/plants/cart-pole.json > cart_pole.rs
//! ```

use lpvmpc_plant::{Plant, PlantError};

fn main() -> Result<(), PlantError> {
    for path in std::env::args().skip(1) {
        print!("{}", Plant::load(path)?.to_rust());
    }
    Ok(())
}
