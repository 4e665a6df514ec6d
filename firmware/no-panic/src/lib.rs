//! A panic handler that cannot be linked.
//!
//! It calls a function that exists nowhere. As long as the optimised image contains one path to
//! a panic, the handler is kept and the linker fails; when every path is proved dead, the handler
//! goes and the image links.
#![no_std]

use core::panic::PanicInfo;

unsafe extern "C" {
    fn a_panic_path_is_reachable() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never runs, because an image with this call does not link.
    unsafe { a_panic_path_is_reachable() }
}
