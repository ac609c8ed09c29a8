//! Loading the library, finding its symbols and calling them: the only `unsafe` of the adapter.
//!
//! Every function is optional. Every structure that a function fills in is a [`Guarded`] buffer, whose length and
//! margin are larger than anything that was ever seen; whoever reads it looks at the margin first.

#![allow(unsafe_code, reason = "calls into a foreign library")]

use crate::child::Guarded;
use libloading::Library;
use std::ffi::{CStr, c_char, c_void};
use std::path::Path;

/// The function is not in this library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Missing(pub(super) &'static str);

/// A Rust value as the library takes it.
trait Argument {
    type Raw;
    fn raw(self) -> Self::Raw;
}

macro_rules! plain {
    ($($kind:ty),*) => { $(impl Argument for $kind {
        type Raw = $kind;
        fn raw(self) -> $kind { self }
    })* };
}
plain!(i16, u16, i32);

impl Argument for &mut i16 {
    type Raw = *mut i16;
    fn raw(self) -> *mut i16 {
        self
    }
}

impl Argument for &mut u16 {
    type Raw = *mut u16;
    fn raw(self) -> *mut u16 {
        self
    }
}

impl Argument for &mut i32 {
    type Raw = *mut i32;
    fn raw(self) -> *mut i32 {
        self
    }
}

impl Argument for &CStr {
    type Raw = *const c_char;
    fn raw(self) -> *const c_char {
        self.as_ptr()
    }
}

impl Argument for &mut Guarded {
    type Raw = *mut c_void;
    fn raw(self) -> *mut c_void {
        self.as_mut_ptr().cast()
    }
}

macro_rules! functions {
    ($($name:ident($($argument:ident: $kind:ty => $raw:ty),*);)*) => {
        /// The functions that were found. The library stays loaded as long as they can be called.
        pub(super) struct Functions {
            $($name: Option<unsafe extern "C" fn($($raw),*) -> i16>,)*
            _library: Library,
        }

        #[allow(clippy::too_many_arguments, reason = "the vendor's functions have as many as they have")]
        impl Functions {
            /// Loads a library and looks for the functions.
            ///
            /// # Errors
            /// The file is missing, is for another processor, or needs something that is not there.
            pub(super) fn load(path: &Path) -> Result<Self, libloading::Error> {
                // SAFETY: loading runs the library's initialisers. This happens only in a child process that holds
                // nothing but its line to the parent, and the user named the file.
                let library = unsafe { Library::new(path) }?;
                $(
                    // SAFETY: the signature is that of the vendor's header with `long` of 32 bits; the pointer is kept
                    // beside the library and not used after it.
                    let $name = unsafe {
                        let symbol = library.get::<unsafe extern "C" fn($($raw),*) -> i16>(
                            concat!(stringify!($name), "\0").as_bytes(),
                        );
                        symbol.ok().map(|symbol| *symbol)
                    };
                )*
                Ok(Self { $($name,)* _library: library })
            }

            $(
                #[doc = concat!("Calls `", stringify!($name), "`.")]
                pub(super) fn $name(&self, $($argument: $kind),*) -> Result<i16, Missing> {
                    let function = self.$name.ok_or(Missing(stringify!($name)))?;
                    // SAFETY: the function belongs to the loaded library; pointers are to live values of the type that
                    // it writes, and structures lie in buffers with a margin beyond anything it was seen to write.
                    Ok(unsafe { function($(Argument::raw($argument)),*) })
                }
            )*
        }
    };
}

functions! {
    cnc_startupprocess(level: i32 => i32, file: &CStr => *const c_char);
    cnc_exitprocess();
    cnc_allclibhndl3(host: &CStr => *const c_char, port: u16 => u16, timeout_s: i32 => i32, handle: &mut u16 => *mut u16);
    cnc_freelibhndl(handle: u16 => u16);
    cnc_setpath(handle: u16 => u16, path: i16 => i16);
    cnc_sysinfo(handle: u16 => u16, out: &mut Guarded => *mut c_void);
    cnc_statinfo(handle: u16 => u16, out: &mut Guarded => *mut c_void);
    cnc_actf(handle: u16 => u16, out: &mut Guarded => *mut c_void);
    cnc_acts(handle: u16 => u16, out: &mut Guarded => *mut c_void);
    cnc_rdspmeter(handle: u16 => u16, kind: i16 => i16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void);
    cnc_rdspgear(handle: u16 => u16, spindle: i16 => i16, out: &mut Guarded => *mut c_void);
    cnc_rdsvmeter(handle: u16 => u16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void);
    cnc_rdaxisdata(handle: u16 => u16, class: i16 => i16, kinds: &mut i16 => *mut i16, kind_count: i16 => i16,
        count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void);
    cnc_rdprgnum(handle: u16 => u16, out: &mut Guarded => *mut c_void);
    cnc_exeprgname(handle: u16 => u16, out: &mut Guarded => *mut c_void);
    cnc_rdseqnum(handle: u16 => u16, out: &mut Guarded => *mut c_void);
    cnc_rddynamic2(handle: u16 => u16, axis: i16 => i16, length: i16 => i16, out: &mut Guarded => *mut c_void);
    cnc_modal(handle: u16 => u16, kind: i16 => i16, block: i16 => i16, out: &mut Guarded => *mut c_void);
    cnc_rdalmmsg2(handle: u16 => u16, kind: i16 => i16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void);
    cnc_alarm2(handle: u16 => u16, out: &mut i32 => *mut i32);
    cnc_rdmacro(handle: u16 => u16, number: i16 => i16, length: i16 => i16, out: &mut Guarded => *mut c_void);
    cnc_wrmacro(handle: u16 => u16, number: i16 => i16, length: i16 => i16, value: i32 => i32, places: i16 => i16);
    cnc_rdparam(handle: u16 => u16, number: i16 => i16, axis: i16 => i16, length: i16 => i16,
        out: &mut Guarded => *mut c_void);
    pmc_rdpmcrng(handle: u16 => u16, area: i16 => i16, width: i16 => i16, from: u16 => u16, to: u16 => u16,
        length: u16 => u16, out: &mut Guarded => *mut c_void);
    pmc_wrpmcrng(handle: u16 => u16, length: u16 => u16, values: &mut Guarded => *mut c_void);
    cnc_rdzofs(handle: u16 => u16, number: i16 => i16, axis: i16 => i16, length: i16 => i16,
        out: &mut Guarded => *mut c_void);
    cnc_wrzofs(handle: u16 => u16, length: i16 => i16, values: &mut Guarded => *mut c_void);
}
