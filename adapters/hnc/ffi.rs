//! Loading the library, finding its symbols and calling them: the only `unsafe` of the adapter.
//!
//! Signatures of the V1 headers (`extern "C"`, cdecl): `Bit16` is `short`, `Bit32` is `long`. Every function is optional.

#![allow(unsafe_code, reason = "calls into a foreign library")]

use crate::child::Guarded;
use libloading::Library;
use std::ffi::{CStr, c_char, c_long, c_void};
use std::path::Path;

/// The function is not in this library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Missing(pub(super) &'static str);

/// A Rust value as the library takes it.
trait Argument {
    type Raw;
    fn raw(self) -> Self::Raw;
}

impl Argument for i16 {
    type Raw = i16;
    fn raw(self) -> i16 {
        self
    }
}

impl Argument for u16 {
    type Raw = u16;
    fn raw(self) -> u16 {
        self
    }
}

/// `Bit32`.
impl Argument for i32 {
    type Raw = c_long;
    fn raw(self) -> c_long {
        c_long::from(self)
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

/// What the library returns; only the low 32 bits count, whatever `long` is.
trait Returned {
    fn code(self) -> i32;
}

impl Returned for i16 {
    fn code(self) -> i32 {
        i32::from(self)
    }
}

impl Returned for c_long {
    #[allow(clippy::cast_possible_truncation, trivial_numeric_casts, reason = "the low half is meant")]
    fn code(self) -> i32 {
        self as i32
    }
}

macro_rules! functions {
    ($($name:ident($($argument:ident: $kind:ty => $raw:ty),*) -> $result:ty;)*) => {
        /// The functions that were found. The library stays loaded as long as they can be called.
        #[allow(non_snake_case, reason = "the vendor's names")]
        pub(super) struct Functions {
            $($name: Option<unsafe extern "C" fn($($raw),*) -> $result>,)*
            _library: Library,
        }

        #[allow(non_snake_case, reason = "the vendor's names")]
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
                    // SAFETY: the signature is that of the vendor's V1 header; the pointer is kept beside the library
                    // and not used after it.
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
                pub(super) fn $name(&self, $($argument: $kind),*) -> Result<i32, Missing> {
                    let function = self.$name.ok_or(Missing(stringify!($name)))?;
                    // SAFETY: the function belongs to the loaded library; whatever it fills in lies in buffers with a
                    // margin far beyond what it is asked for.
                    Ok(Returned::code(unsafe { function($(Argument::raw($argument)),*) }))
                }
            )*
        }
    };
}

functions! {
    HNC_NetInit(host: &CStr => *const c_char, port: u16 => u16) -> i16;
    HNC_NetConnect(host: &CStr => *const c_char, port: u16 => u16) -> i16;
    HNC_NetIsConnect(client: i16 => i16) -> i16;
    HNC_SystemGetValue(kind: i32 => c_long, out: &mut Guarded => *mut c_void, client: i16 => i16) -> c_long;
    HNC_ChannelGetValue(kind: i32 => c_long, channel: i32 => c_long, index: i32 => c_long,
        out: &mut Guarded => *mut c_void, client: i16 => i16) -> c_long;
    HNC_AxisGetValue(kind: i32 => c_long, axis: i32 => c_long, out: &mut Guarded => *mut c_void, client: i16 => i16)
        -> c_long;
    HNC_RegGetValue(kind: i32 => c_long, index: i32 => c_long, out: &mut Guarded => *mut c_void, client: i16 => i16)
        -> c_long;
    HNC_RegSetValue(kind: i32 => c_long, index: i32 => c_long, value: &mut Guarded => *mut c_void, client: i16 => i16)
        -> c_long;
    HNC_FprogGetFullName(channel: i32 => c_long, out: &mut Guarded => *mut c_void, client: i16 => i16) -> c_long;
    HNC_AlarmGetNum(kind: i32 => c_long, level: i32 => c_long, out: &mut Guarded => *mut c_void, client: i16 => i16)
        -> c_long;
    HNC_AlarmGetData(kind: i32 => c_long, level: i32 => c_long, index: i32 => c_long,
        number: &mut Guarded => *mut c_void, text: &mut Guarded => *mut c_void, client: i16 => i16) -> c_long;
    HNC_EventGetSysEv(out: &mut Guarded => *mut c_void) -> c_long;
    HNC_SamplSetChannel(count: i32 => c_long, client: i16 => i16) -> c_long;
    HNC_SamplSetPropertyType(channel: i32 => c_long, kind: i32 => c_long, axis: i32 => c_long, client: i16 => i16)
        -> c_long;
    HNC_SamplSetRegType(channel: i32 => c_long, kind: i32 => c_long, offset: i32 => c_long, length: i32 => c_long,
        client: i16 => i16) -> c_long;
    HNC_SamplSetPeriod(channel: i32 => c_long, ticks: i32 => c_long, client: i16 => i16) -> c_long;
    HNC_SamplSetLmt(channel: i32 => c_long, kind: i32 => c_long, count: i32 => c_long, client: i16 => i16) -> c_long;
    HNC_SamplReset(client: i16 => i16) -> c_long;
    HNC_SamplTriggerOn(client: i16 => i16) -> c_long;
    HNC_SamplTriggerOff(client: i16 => i16) -> c_long;
    HNC_SamplGetStat(client: i16 => i16) -> c_long;
    HNC_SamplGetData(channel: i32 => c_long, count: &mut Guarded => *mut c_void, out: &mut Guarded => *mut c_void,
        client: i16 => i16) -> c_long;
}

/// `HNC_NetExit` returns nothing and is looked up when it is needed.
impl Functions {
    /// Ends every connection of the library.
    pub(super) fn exit(&self) {
        // SAFETY: the symbol is a function without arguments and result in the vendor's header.
        let symbol = unsafe { self._library.get::<unsafe extern "C" fn()>(b"HNC_NetExit\0") };
        if let Ok(exit) = symbol {
            // SAFETY: as above; it is called once, by the thread that made every other call.
            unsafe { exit() }
        }
    }
}
