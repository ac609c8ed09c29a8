//! The structures of the library, little-endian, `long` of 32 bits: measured with buffers filled with a pattern and by
//! compiling the header with that `long`. Only sizes and offsets are used; the bytes are read one by one.

use std::mem::{offset_of, size_of};

#[repr(C)]
pub(super) struct OdbSys {
    pub(super) addinfo: i16,
    pub(super) max_axis: i16,
    pub(super) cnc_type: [u8; 2],
    pub(super) mt_type: [u8; 2],
    pub(super) series: [u8; 4],
    pub(super) version: [u8; 4],
    pub(super) axes: [u8; 2],
}

#[repr(C)]
pub(super) struct OdbSt {
    pub(super) hdck: i16,
    pub(super) tmmode: i16,
    pub(super) aut: i16,
    pub(super) run: i16,
    pub(super) motion: i16,
    pub(super) mstb: i16,
    pub(super) emergency: i16,
    pub(super) alarm: i16,
    pub(super) edit: i16,
}

#[repr(C)]
pub(super) struct OdbAct {
    pub(super) dummy: [i16; 2],
    pub(super) data: i32,
}

/// `SPEEDELM`; `ODBSPEED` is two of them, feed and spindle.
#[repr(C)]
pub(super) struct SpeedElm {
    pub(super) data: i32,
    pub(super) dec: i16,
    pub(super) unit: i16,
    pub(super) disp: i16,
    pub(super) name: u8,
    pub(super) suff: u8,
}

#[repr(C)]
pub(super) struct LoadElm {
    pub(super) data: i32,
    pub(super) dec: i16,
    pub(super) unit: i16,
    pub(super) name: u8,
    pub(super) suff1: u8,
    pub(super) suff2: u8,
    pub(super) reserve: u8,
}

/// `POSELM`; `ODBPOS` is four of them: absolute, machine, relative and to go.
#[repr(C)]
pub(super) struct PosElm {
    pub(super) data: i32,
    pub(super) dec: i16,
    pub(super) unit: i16,
    pub(super) disp: i16,
    pub(super) name: u8,
    pub(super) suff: u8,
}

#[repr(C)]
pub(super) struct OdbSpLoad {
    pub(super) spload: LoadElm,
    pub(super) spspeed: LoadElm,
}

#[repr(C)]
pub(super) struct OdbSpn {
    pub(super) datano: i16,
    pub(super) kind: i16,
    pub(super) data: [i16; 8],
}

#[repr(C)]
pub(super) struct OdbAxDt {
    pub(super) name: [u8; 4],
    pub(super) data: i32,
    pub(super) dec: i16,
    pub(super) unit: i16,
    pub(super) flag: i16,
    pub(super) reserve: i16,
}

#[repr(C)]
pub(super) struct OdbPro {
    pub(super) dummy: [i16; 2],
    pub(super) data: i16,
    pub(super) mdata: i16,
}

#[repr(C)]
pub(super) struct OdbExePrg {
    pub(super) name: [u8; 36],
    pub(super) o_num: i32,
}

#[repr(C)]
pub(super) struct OdbSeq {
    pub(super) dummy: [i16; 2],
    pub(super) data: i32,
}

/// Head of `ODBDY2`; the positions follow, absolute, machine, relative and to go, each as many as the machine could
/// have axes.
#[repr(C)]
pub(super) struct OdbDy2 {
    pub(super) dummy: i16,
    pub(super) axis: i16,
    pub(super) alarm: i32,
    pub(super) prgnum: i32,
    pub(super) prgmnum: i32,
    pub(super) seqnum: i32,
    pub(super) actf: i32,
    pub(super) acts: i32,
}

#[repr(C)]
pub(super) struct OdbAlmMsg2 {
    pub(super) alm_no: i32,
    pub(super) kind: i16,
    pub(super) axis: i16,
    pub(super) dummy: i16,
    pub(super) msg_len: i16,
    pub(super) alm_msg: [u8; 64],
}

#[repr(C)]
pub(super) struct OdbM {
    pub(super) datano: i16,
    pub(super) dummy: i16,
    pub(super) mcr_val: i32,
    pub(super) dec_val: i16,
}

/// Most axes of a machine, for the all-axes form of `cnc_rddynamic2`.
pub(super) const MAX_AXIS: usize = 32;
/// Length of that form.
pub(super) const ODBDY2_ALL_LEN: usize = size_of::<OdbDy2>() + 4 * 4 * MAX_AXIS;
/// `ODBMDL`, `IODBPSD`, `ODBDGN`.
pub(super) const LONG_LEN: usize = 260;
/// `IODBZOFS`.
pub(super) const ZOFS_LEN: usize = 132;
/// `ODBPOS`, of one axis.
pub(super) const POSITIONS_LEN: usize = 4 * size_of::<PosElm>();
/// Head of `IODBPMC`; the bytes follow.
pub(super) const PMC_HEAD_LEN: usize = 8;

const _: () = assert!(size_of::<OdbSys>() == 18 && offset_of!(OdbSys, series) == 8);
const _: () = assert!(size_of::<OdbSt>() == 18 && offset_of!(OdbSt, aut) == 4);
const _: () = assert!(size_of::<OdbAct>() == 8 && offset_of!(OdbAct, data) == 4);
const _: () = assert!(size_of::<SpeedElm>() == 12 && offset_of!(SpeedElm, unit) == 6);
const _: () = assert!(size_of::<PosElm>() == 12 && offset_of!(PosElm, unit) == 6);
const _: () = assert!(size_of::<LoadElm>() == 12 && offset_of!(LoadElm, name) == 8);
const _: () = assert!(size_of::<OdbSpLoad>() == 24);
const _: () = assert!(size_of::<OdbSpn>() == 20 && offset_of!(OdbSpn, data) == 4);
const _: () = assert!(size_of::<OdbAxDt>() == 16 && offset_of!(OdbAxDt, dec) == 8);
const _: () = assert!(size_of::<OdbPro>() == 8 && offset_of!(OdbPro, mdata) == 6);
const _: () = assert!(size_of::<OdbExePrg>() == 40 && offset_of!(OdbExePrg, o_num) == 36);
const _: () = assert!(size_of::<OdbSeq>() == 8);
const _: () = assert!(size_of::<OdbDy2>() == 28 && ODBDY2_ALL_LEN == 540);
const _: () = assert!(size_of::<OdbAlmMsg2>() == 76 && offset_of!(OdbAlmMsg2, alm_msg) == 12);
const _: () = assert!(size_of::<OdbM>() == 12 && offset_of!(OdbM, dec_val) == 8);
