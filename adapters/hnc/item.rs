//! What can be asked of the library: the numbers of the vendor's headers, each with the width of its value.

use nclink::mailbox::ControllerRegister;
use serde::{Deserialize, Serialize};

/// How a value lies in the buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum HncWidth {
    /// The low four bytes, signed, whatever `Bit32` is.
    Whole,
    /// A `fBit64` of the header: eight bytes, a double.
    Real,
    /// Text up to the first zero, GBK.
    Text,
}

/// A value that the library can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum HncItem {
    /// `HNC_SystemGetValue`: type of the value.
    System(i32, HncWidth),
    /// `HNC_ChannelGetValue` of channel 0: type, index.
    Channel(i32, i32, HncWidth),
    /// `HNC_AxisGetValue`: type, logical axis.
    Axis(i32, i32, HncWidth),
    /// `HNC_RegGetValue`: type and index of the register.
    Register(i32, i32),
    /// `HNC_CrdsGetValue` of channel 0: its external zero offset, of a logical axis.
    ExternalZero(i32),
    /// `HNC_FprogGetFullName` of channel 0.
    Program,
    /// `HNC_AlarmGetNum` and `HNC_AlarmGetData`: errors of every kind.
    Alarms,
}

/// Version of the controller.
pub const NC_VERSION: HncItem = HncItem::System(24, HncWidth::Text);
/// Serial number of the controller.
pub const SERIAL: HncItem = HncItem::System(25, HncWidth::Text);
/// Counts of a position per millimetre.
pub const MOVE_UNIT: HncItem = HncItem::System(1, HncWidth::Whole);

/// A whole number of channel 0.
#[must_use]
pub const fn define_whole_item(kind: i32) -> HncItem {
    HncItem::Channel(kind, 0, HncWidth::Whole)
}

/// A real number of channel 0.
#[must_use]
pub const fn define_real_item(kind: i32) -> HncItem {
    HncItem::Channel(kind, 0, HncWidth::Real)
}

/// `HNC_CRDS_CH_G5X_OFFSET_ZERO`: the channel's external zero offset, in counts of [`MOVE_UNIT`].
pub const EXTERNAL_ZERO: i32 = 9;

/// Types of the values of a channel, numbers of `HncChannel`.
pub mod channel {
    /// Actual feed, a real number.
    pub const ACT_FEEDRATE: i32 = 7;
    /// Programmed feed, a real number.
    pub const PROG_FEEDRATE: i32 = 8;
    /// Feed override, a whole number.
    pub const FEED_OVERRIDE: i32 = 9;
    /// Number of the tool in use.
    pub const TOOL_USE: i32 = 14;
    /// 0 reset, 1 automatic, 2 jog, 3 step, 4 handwheel, 5 reference, 6 PLC, 7 single block or MDI.
    pub const MODE: i32 = 16;
    /// Is the channel in MDI?
    pub const IS_MDI: i32 = 17;
    /// A program runs? Setting it would start one; that is never done.
    pub const CYCLE: i32 = 18;
    /// Feed hold? Setting it would hold; that is never done.
    pub const HOLD: i32 = 19;
    /// A thread is cut?
    pub const IS_THREADING: i32 = 22;
    /// Is a thread tapped rigidly?
    pub const IS_RIGID: i32 = 23;
    /// Is the emergency stop active?
    pub const IS_ESTOP: i32 = 25;
    /// Is the channel being reset?
    pub const IS_RESETTING: i32 = 26;
    /// The program is only checked?
    pub const VERIFY: i32 = 31;
    /// Line of the program that runs.
    pub const RUN_ROW: i32 = 32;
    /// Counter of finished parts.
    pub const PART_CNTR: i32 = 36;
    /// Logical axis of the spindle.
    pub const SPDL_LAX: i32 = 45;
    /// Commanded spindle speed, f64.
    pub const CMD_SPDL_SPEED: i32 = 47;
    /// Actual spindle speed, f64.
    pub const ACT_SPDL_SPEED: i32 = 48;
    /// Spindle override, a whole number.
    pub const SPDL_OVERRIDE: i32 = 49;
}

/// Types of the values of an axis, numbers of `HncAxis`.
pub mod axis {
    /// Name of the axis, a text.
    pub const NAME: i32 = 0;
    /// Actual position, counts of [`MOVE_UNIT`](super::MOVE_UNIT).
    pub const ACT_POS: i32 = 6;
    /// Actual speed, a real number.
    pub const ACT_VEL: i32 = 18;
    /// Load current, a real number.
    pub const LOAD_CUR: i32 = 29;
}

/// Number of a register's kind (`HncRegType`).
#[must_use]
pub fn register_type(at: ControllerRegister) -> Option<i32> {
    let at = ['X', 'Y', 'F', 'G', 'R', 'W', 'D', 'B', 'P'].iter().position(|kind| *kind == at.kind)?;
    i32::try_from(at).ok()
}

/// A register as the library numbers it; `None` where it has no number for the kind, or the index exceeds 31 bits.
pub(super) fn define_register(at: ControllerRegister) -> Option<HncItem> {
    Some(HncItem::Register(register_type(at)?, i32::try_from(at.index).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_have_the_numbers_of_the_header() {
        let of = |kind| register_type(ControllerRegister { kind, index: 0 });
        assert_eq!(['X', 'G', 'R', 'D', 'P'].map(of), [0, 3, 4, 6, 8].map(Some));
        assert_eq!(of('Q'), None);
        assert_eq!(define_register(ControllerRegister { kind: 'R', index: 1 << 31 }), None);
    }
}
