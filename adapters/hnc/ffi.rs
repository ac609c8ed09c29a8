//! The vendor's functions, with the signatures of the V1 headers (`extern "C"`, cdecl): `Bit16` is `short`, `Bit32` is
//! `long`.

#![allow(unsafe_code, reason = "calls into a foreign library")]

use device_line::child::{Guarded, functions};
use std::ffi::{CStr, c_char, c_long, c_void};

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
    HNC_CrdsGetValue(kind: i32 => c_long, axis: i32 => c_long, out: &mut Guarded => *mut c_void, channel: i32 => c_long,
        system: i32 => c_long, client: i16 => i16) -> c_long;
    HNC_CrdsSetValue(kind: i32 => c_long, axis: i32 => c_long, value: &mut Guarded => *mut c_void,
        channel: i32 => c_long, system: i32 => c_long, client: i16 => i16) -> c_long;
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
    pub(super) fn end_connections(&self) {
        // SAFETY: the symbol is a function without arguments and result in the vendor's header.
        let symbol = unsafe { self._library.get::<unsafe extern "C" fn()>(b"HNC_NetExit\0") };
        if let Ok(exit) = symbol {
            // SAFETY: as above; it is called once, by the thread that made every other call.
            unsafe { exit() }
        }
    }
}
