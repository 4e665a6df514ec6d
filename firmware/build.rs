//! Hands cortex-m-rt's linker script and this board's memory map to the linker. The map has a folder of its own, since the
//! linker looks into the workspace's first, for `no-panic`, too, which has another.

fn main() {
    println!(
        "cargo::rustc-link-search={}/board",
        env!("CARGO_MANIFEST_DIR")
    );
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-examples=-Tlink.x");
    println!("cargo::rerun-if-changed=board/memory.x");
}
