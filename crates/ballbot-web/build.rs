//! A controller for 200 samples is built on the stack before it goes to the heap; the megabyte
//! that WebAssembly modules get by default is too little for it.

use std::env;

const STACK_BYTES: usize = 8 << 20;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_FAMILY").as_deref() == Ok("wasm") {
        println!("cargo::rustc-link-arg-cdylib=-zstack-size={STACK_BYTES}");
    }
}
