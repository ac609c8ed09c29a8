//! Loading a vendor's library, finding its symbols and calling them.
//!
//! A library is described by [`functions!`](crate::child::functions): the vendor's names with, for every argument, the
//! Rust type that the caller has and the C type that the library takes. Every function is optional: one that the file
//! does not have is [`Missing`] when it is called, and nothing else suffers. What a function fills in is a
//! [`Guarded`] buffer whose margin is larger than anything that was ever seen; whoever reads it looks at the margin
//! first.

#![allow(unsafe_code, reason = "calls into a foreign library")]

use super::Guarded;
use std::ffi::{CStr, c_char, c_void};
use std::path::Path;
use thiserror::Error;

/// The function is not in this library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Missing(pub &'static str);

/// Why a library cannot be loaded, in the system's own words where it has some.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct LoadError(String);

impl LoadError {
    /// What was said of this file, without the name of the file that the system puts before it.
    #[must_use]
    pub fn new(error: &libloading::Error, file: &Path) -> Self {
        let words = std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string);
        Self(words.strip_prefix(&format!("{}: ", file.display())).map_or(words.clone(), str::to_owned))
    }
}

/// A Rust value as the library takes it.
pub trait Argument<Raw> {
    /// The value as the C function takes it.
    fn raw(self) -> Raw;
}

macro_rules! arguments {
    ($($kind:ty => $raw:ty, $self:ident $value:expr;)*) => {
        $(impl Argument<$raw> for $kind {
            fn raw($self) -> $raw { $value }
        })*
    };
}

arguments! {
    i16 => i16, self self;
    u16 => u16, self self;
    // `long` has 32 bits in some libraries and on some systems, 64 on others.
    i32 => i32, self self;
    i32 => i64, self i64::from(self);
    &mut i16 => *mut i16, self self;
    &mut u16 => *mut u16, self self;
    &mut i32 => *mut i32, self self;
    &CStr => *const c_char, self self.as_ptr();
    &mut Guarded => *mut c_void, self self.as_mut_ptr().cast();
}

/// What a function returns.
pub trait Returned {
    /// As it is looked at.
    type Code;
    /// The return code of the C function.
    fn code(self) -> Self::Code;
}

impl Returned for i16 {
    type Code = i16;
    fn code(self) -> i16 {
        self
    }
}

impl Returned for i32 {
    type Code = i32;
    fn code(self) -> i32 {
        self
    }
}

/// Only the low 32 bits of a `long` count, whatever its size.
impl Returned for i64 {
    type Code = i32;
    #[expect(clippy::cast_possible_truncation, reason = "the low half is meant")]
    fn code(self) -> i32 {
        self as i32
    }
}

/// The functions of a library, as `struct Functions` with a method for each: `name(argument: Rust => C, ...) -> C;`.
#[macro_export]
#[doc(hidden)]
macro_rules! vendor_functions {
    ($($name:ident($($argument:ident: $kind:ty => $raw:ty),*) -> $result:ty;)*) => {
        /// The functions that were found. The library stays loaded as long as they can be called.
        #[allow(non_snake_case, reason = "the vendor's names")]
        pub(super) struct Functions {
            $($name: Option<unsafe extern "C" fn($($raw),*) -> $result>,)*
            _library: $crate::child::Library,
        }

        #[allow(non_snake_case, clippy::too_many_arguments, reason = "as the vendor made them")]
        impl Functions {
            /// Loads a library and looks for the functions.
            ///
            /// # Errors
            /// The file is missing, is for another processor, or needs something that is not there.
            pub(super) fn load(path: &std::path::Path) -> Result<Self, $crate::child::LoadError> {
                // SAFETY: loading runs the library's initialisers. This happens only in a child process that holds
                // nothing but its line to the parent, and the user named the file.
                let library = unsafe { $crate::child::Library::new(path) };
                let library = library.map_err(|error| $crate::child::LoadError::new(&error, path))?;
                $(
                    // SAFETY: the signature is that of the vendor's header, as the one who listed it says; the pointer
                    // is kept beside the library and not used after it.
                    let $name = unsafe {
                        let symbol = library.get::<unsafe extern "C" fn($($raw),*) -> $result>(
                            concat!(stringify!($name), "\0").as_bytes(),
                        );
                        symbol.ok().map(|symbol| *symbol)
                    };
                )*
                Ok(Self { $($name,)* _library: library })
            }

            $(
                #[doc = concat!("Calls `", stringify!($name), "`.")]
                pub(super) fn $name(
                    &self,
                    $($argument: $kind),*
                ) -> Result<<$result as $crate::child::Returned>::Code, $crate::child::Missing> {
                    let function = self.$name.ok_or($crate::child::Missing(stringify!($name)))?;
                    // SAFETY: the function belongs to the loaded library; pointers are to live values of the type that
                    // it writes, and structures lie in buffers with a margin beyond anything it was seen to write.
                    let result = unsafe { function($($crate::child::Argument::<$raw>::raw($argument)),*) };
                    Ok($crate::child::Returned::code(result))
                }
            )*
        }
    };
}
