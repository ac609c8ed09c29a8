//! What is asked for, group by group. Every group is a source with its own period; both share one connection. The
//! questions of all paths travel together.

use super::item::{Area, BlockWord, FocasItem, Position, PositionFrame, Question, Servo, Spindle, Stretch};

/// Signals of one path lie this many bytes after those of the one before.
const PATH_STEP: u16 = 1000;

/// Where a signal of path 1 stands for another path: G012 is G1012 for path 2.
#[must_use]
pub fn find_signal_address(at: u16, path: u8) -> u16 {
    at + PATH_STEP * u16::from(path.clamp(1, 10) - 1)
}

/// From the control to the ladder: F000 to F004.
#[must_use]
pub fn control_signals(path: u8) -> Stretch {
    Stretch::from_byte_range(Area::F, find_signal_address(0, path), 5)
}

/// From the ladder to the control: G006 to G030, with the overrides.
#[must_use]
pub fn ladder_signals(path: u8) -> Stretch {
    Stretch::from_byte_range(Area::G, find_signal_address(FIRST_LADDER_BYTE, path), 25)
}

/// From the ladder to the control: G096, the rapid override in steps of one percent.
#[must_use]
pub fn rapid_steps(path: u8) -> Stretch {
    Stretch::from_byte_range(Area::G, find_signal_address(96, path), 1)
}

/// Address of the byte with which [`ladder_signals`] begins on path 1.
pub const FIRST_LADDER_BYTE: u16 = 6;

/// The modal words F, S and T.
pub const MODAL_F: FocasItem = FocasItem::ModalWord(BlockWord::F);
/// The modal word S, the commanded spindle speed.
pub const MODAL_S: FocasItem = FocasItem::ModalWord(BlockWord::S);
/// The modal word T, the commanded tool.
pub const MODAL_T: FocasItem = FocasItem::ModalWord(BlockWord::T);

/// The modal group of feed per minute (0) and per revolution ([`PER_REVOLUTION`]): group 05 of the manuals, G94 and G95
/// on a mill, G98 and G99 on a lathe with the codes of system A.
pub const FEED_GROUP: FocasItem = FocasItem::ModalGroup(4);
/// Feed per revolution in [`FEED_GROUP`]. Source: FOCAS2 manual, `cnc_modal`; `libfwlib32` 1.0.5 takes 1 for it.
pub const PER_REVOLUTION: u8 = 1;

/// The alarms, asked for only when the status says that there are some.
pub const ALARMS: FocasItem = FocasItem::Alarms(8);

/// What changes quickly on every path.
fn list_quick_items(path: u8) -> [FocasItem; 18] {
    [
        FocasItem::Status,
        // Before what the vendor's call for the positions answers besides.
        FocasItem::Position(Position::Machine, -1),
        FocasItem::PositionUnit(PositionFrame::Machine),
        FocasItem::Feed,
        FocasItem::SpindleSpeed,
        FocasItem::Spindles(Spindle::Load),
        FocasItem::Servos(Servo::Load),
        FocasItem::ProgramName,
        FocasItem::Program,
        FocasItem::Sequence,
        MODAL_F,
        MODAL_S,
        MODAL_T,
        FocasItem::FeedUnit,
        FEED_GROUP,
        FocasItem::Pmc(control_signals(path)),
        FocasItem::Pmc(ladder_signals(path)),
        FocasItem::Pmc(rapid_steps(path)),
    ]
}

/// What changes quickly: one frame.
#[must_use]
pub fn list_fast_questions(path: u8) -> Vec<Question> {
    let own = [FocasItem::Servos(Servo::Current), MOTOR_TEMPERATURE];
    list_quick_items(path).into_iter().chain(own).map(|item| item.to_question(path)).collect()
}

/// The same of a path that is read besides.
#[must_use]
pub fn list_further_questions(path: u8) -> Vec<Question> {
    list_quick_items(path).map(|item| item.to_question(path)).to_vec()
}

/// Temperature of the winding of the spindle motor, °C.
pub const MOTOR_TEMPERATURE: FocasItem = FocasItem::Diagnosis(403, 1);

/// Power of the spindle drive, W, in this diagnosis number.
#[must_use]
pub fn build_power_item(diagnosis: u16) -> FocasItem {
    FocasItem::Diagnosis(diagnosis, 1)
}
