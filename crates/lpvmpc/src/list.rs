//! Memory whose length is chosen when something is built: handed in, or owned.

use core::fmt;
use core::ops::{Deref, DerefMut};

#[cfg(feature = "alloc")]
use alloc::boxed::Box;

/// A list of a length that is chosen at construction: static memory that is handed in, or, with the
/// feature `alloc`, memory of its own. It is a slice in every other respect.
pub enum List<V: 'static> {
    /// Memory that is handed in, such as a microcontroller's static memory.
    Static(&'static mut [V]),
    /// Memory of its own.
    #[cfg(feature = "alloc")]
    Owned(Box<[V]>),
}

impl<V> List<V> {
    /// A list without places.
    pub fn empty() -> Self {
        Self::Static(&mut [])
    }

    /// The first `length` places of it.
    pub fn shortened(self, length: usize) -> Self {
        match self {
            Self::Static(memory) => {
                let length = length.min(memory.len());
                Self::Static(memory.get_mut(..length).unwrap_or_default())
            }
            #[cfg(feature = "alloc")]
            Self::Owned(memory) => {
                let mut memory = memory.into_vec();
                memory.truncate(length);
                Self::Owned(memory.into_boxed_slice())
            }
        }
    }
}

#[cfg(feature = "alloc")]
impl<V: Clone> List<V> {
    /// A list of `length` equal entries, on the heap.
    pub fn repeat(value: V, length: usize) -> Self {
        Self::Owned(alloc::vec![value; length].into_boxed_slice())
    }
}

impl<V> From<&'static mut [V]> for List<V> {
    fn from(memory: &'static mut [V]) -> Self {
        Self::Static(memory)
    }
}

impl<V> Deref for List<V> {
    type Target = [V];

    #[inline(always)]
    fn deref(&self) -> &[V] {
        match self {
            Self::Static(memory) => memory,
            #[cfg(feature = "alloc")]
            Self::Owned(memory) => memory,
        }
    }
}

impl<V> DerefMut for List<V> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [V] {
        match self {
            Self::Static(memory) => memory,
            #[cfg(feature = "alloc")]
            Self::Owned(memory) => memory,
        }
    }
}

impl<'a, V> IntoIterator for &'a List<V> {
    type Item = &'a V;
    type IntoIter = core::slice::Iter<'a, V>;

    #[inline(always)]
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, V> IntoIterator for &'a mut List<V> {
    type Item = &'a mut V;
    type IntoIter = core::slice::IterMut<'a, V>;

    #[inline(always)]
    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

#[cfg(feature = "alloc")]
impl<V: Clone> Clone for List<V> {
    /// On the heap, wherever the original is.
    fn clone(&self) -> Self {
        Self::Owned(Box::from(&**self))
    }
}

impl<V: fmt::Debug> fmt::Debug for List<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

impl<V: PartialEq> PartialEq for List<V> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}
