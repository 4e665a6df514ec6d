//! What a message says of a value.

pub use lpvmpc_design::number_text as text;

/// What a message says of a value.
pub(crate) trait Given {
    /// In words, or as a number for a person.
    fn given(&self) -> String;
}

impl Given for f64 {
    fn given(&self) -> String {
        text(*self)
    }
}

impl<T: Given + ?Sized> Given for &T {
    fn given(&self) -> String {
        (**self).given()
    }
}

macro_rules! given_as_it_is {
    ($($kind:ty),*) => { $(
        impl Given for $kind {
            fn given(&self) -> String {
                self.to_string()
            }
        }
    )* };
}

given_as_it_is!(str, String, i32, u64, usize);
