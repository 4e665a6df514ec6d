//! Work on all cores, where the feature `rayon` is on.

#[cfg(feature = "rayon")]
use rayon::prelude::*;

/// f(i, item) of each item, in their order. With the feature `rayon` on all cores; the result is the
/// same to the bit, however many there are.
pub fn each<A: Sync, B: Send>(items: &[A], f: impl Fn(usize, &A) -> B + Sync + Send) -> Vec<B> {
    each_with(items, || (), |(), i, item| f(i, item))
}

/// [`each`] with scratch memory that `init` makes, which serves for many items one after the other.
pub fn each_with<A: Sync, B: Send, S>(
    items: &[A],
    init: impl Fn() -> S + Sync + Send,
    f: impl Fn(&mut S, usize, &A) -> B + Sync + Send,
) -> Vec<B> {
    #[cfg(feature = "rayon")]
    {
        let items = items.par_iter().enumerate();
        let of = |scratch: &mut S, (i, item): (usize, &A)| f(scratch, i, item);
        items.map_init(init, of).collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut scratch = init();
        let items = items.iter().enumerate();
        items.map(|(i, item)| f(&mut scratch, i, item)).collect()
    }
}
