//! Large memory on the heap.

/// What is larger than this gets a stack of its own to be built on, bytes. A page's stack is large
/// enough for all (`ballbot-web/build.rs`).
#[cfg(not(target_family = "wasm"))]
const LARGE: usize = 1 << 18;

/// Boxes what `make` makes. It is built on a stack before it is boxed, and the largest workspaces
/// take the 2 MB that a thread has as a rule; so they are built in a thread with a larger stack.
pub(crate) fn boxed<W: Send + 'static>(make: fn() -> W) -> Box<W> {
    #[cfg(not(target_family = "wasm"))]
    if size_of::<W>() > LARGE {
        // Room for a copy or two that an unoptimised build makes on the way.
        let thread = std::thread::Builder::new().stack_size(4 * size_of::<W>());
        let made = thread.spawn(move || boxed_from_stack(make));
        if let Some(made) = made.ok().and_then(|thread| thread.join().ok()) {
            return made;
        }
    }
    // Small, or there are no threads: then this stack has to do.
    boxed_from_stack(make)
}

// Not inlined: the room on the stack is taken only where it is called.
#[inline(never)]
fn boxed_from_stack<W>(make: fn() -> W) -> Box<W> {
    Box::new(make())
}
