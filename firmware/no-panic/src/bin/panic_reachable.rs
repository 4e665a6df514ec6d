//! The negative control: an index that the compiler cannot bound. This image must not link.
#![no_std]
#![no_main]

use core::hint::black_box;
use nalgebra::Vector4;
use no_panic as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    let x = Vector4::<f32>::zeros();
    loop {
        black_box(entry_of(black_box(&x), black_box(3)));
    }
}

#[inline(never)]
fn entry_of(x: &Vector4<f32>, i: usize) -> f32 {
    x[i]
}
