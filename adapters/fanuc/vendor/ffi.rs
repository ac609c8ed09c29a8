//! The vendor's functions, with `long` of 32 bits whatever the header says.

#![allow(unsafe_code, reason = "calls into a foreign library")]

use device_line::child::{Guarded, functions};
use std::ffi::{CStr, c_char, c_void};

functions! {
    cnc_startupprocess(level: i32 => i32, file: &CStr => *const c_char) -> i16;
    cnc_exitprocess() -> i16;
    cnc_allclibhndl3(host: &CStr => *const c_char, port: u16 => u16, timeout_s: i32 => i32, handle: &mut u16 => *mut u16) -> i16;
    cnc_freelibhndl(handle: u16 => u16) -> i16;
    cnc_setpath(handle: u16 => u16, path: i16 => i16) -> i16;
    cnc_getpath(handle: u16 => u16, path: &mut i16 => *mut i16, paths: &mut i16 => *mut i16) -> i16;
    cnc_sysinfo(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_statinfo(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_actf(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_acts(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdspeed(handle: u16 => u16, kind: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_acts2(handle: u16 => u16, spindle: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_diagnoss(handle: u16 => u16, number: i16 => i16, axis: i16 => i16, length: i16 => i16,
        out: &mut Guarded => *mut c_void) -> i16;
    cnc_getfigure(handle: u16 => u16, kind: i16 => i16, count: &mut i16 => *mut i16,
        entered: &mut Guarded => *mut c_void, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdspdlname(handle: u16 => u16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdtimer(handle: u16 => u16, kind: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdtofs(handle: u16 => u16, number: i16 => i16, kind: i16 => i16, length: i16 => i16,
        out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdexecprog(handle: u16 => u16, length: &mut u16 => *mut u16, block: &mut i16 => *mut i16,
        out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdopmsg3(handle: u16 => u16, kind: i16 => i16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdgcode(handle: u16 => u16, kind: i16 => i16, block: i16 => i16, count: &mut i16 => *mut i16,
        out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdalmhisno(handle: u16 => u16, count: &mut u16 => *mut u16) -> i16;
    cnc_rdalmhistry(handle: u16 => u16, first: u16 => u16, last: u16 => u16, length: u16 => u16,
        out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdtlusegrp(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdlife(handle: u16 => u16, group: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdcount(handle: u16 => u16, group: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdntool(handle: u16 => u16, group: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdspmeter(handle: u16 => u16, kind: i16 => i16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdspgear(handle: u16 => u16, spindle: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdsvmeter(handle: u16 => u16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdaxisdata(handle: u16 => u16, class: i16 => i16, kinds: &mut i16 => *mut i16, kind_count: i16 => i16,
        count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdprgnum(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_exeprgname(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdseqnum(handle: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdposition(handle: u16 => u16, kind: i16 => i16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rddynamic2(handle: u16 => u16, axis: i16 => i16, length: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_modal(handle: u16 => u16, kind: i16 => i16, block: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_rdalmmsg2(handle: u16 => u16, kind: i16 => i16, count: &mut i16 => *mut i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_alarm2(handle: u16 => u16, out: &mut i32 => *mut i32) -> i16;
    cnc_rdmacro(handle: u16 => u16, number: i16 => i16, length: i16 => i16, out: &mut Guarded => *mut c_void) -> i16;
    cnc_wrmacro(handle: u16 => u16, number: i16 => i16, length: i16 => i16, value: i32 => i32, places: i16 => i16) -> i16;
    cnc_rdparam(handle: u16 => u16, number: i16 => i16, axis: i16 => i16, length: i16 => i16,
        out: &mut Guarded => *mut c_void) -> i16;
    pmc_rdpmcrng(handle: u16 => u16, area: i16 => i16, width: i16 => i16, from: u16 => u16, to: u16 => u16,
        length: u16 => u16, out: &mut Guarded => *mut c_void) -> i16;
    pmc_wrpmcrng(handle: u16 => u16, length: u16 => u16, values: &mut Guarded => *mut c_void) -> i16;
    cnc_rdzofs(handle: u16 => u16, number: i16 => i16, axis: i16 => i16, length: i16 => i16,
        out: &mut Guarded => *mut c_void) -> i16;
    cnc_wrzofs(handle: u16 => u16, length: i16 => i16, values: &mut Guarded => *mut c_void) -> i16;
}
