//! Items as calls of the library, and the structures that it fills in as answers.

use super::child::{FocasSession, pmc_words};
use super::layout::{
    LONG_LEN, LoadElm, MAX_AXIS, ODBDY2_ALL_LEN, OdbAct, OdbAlmMsg2, OdbAxDt, OdbExePrg, OdbM, OdbPro, OdbSeq,
    OdbSpLoad, OdbSpn, OdbSt, OdbSys, PMC_HEAD_LEN, POSITIONS_LEN, PosElm, SpeedElm, ZOFS_LEN,
};
use super::structure::{Bytes, POSITION_PLACES, check_code, fill_structure, scale_decimal};
use crate::answer::{Alarm, FocasAnswer, FocasItemError, FocasItemResult, Refusal, SpeedUnit, Status, System};
use crate::code::FocasReturnCode;
use crate::item::{BlockWord, FocasItem, PmcWidth, PositionFrame, Servo, Spindle, Stretch};
use adapter_core::integer::{clamp_count, const_to_i16, convert_bounded};
use device_line::child::Guarded;
use std::mem::{offset_of, size_of};

/// Most alarms, spindles and PMC bytes that are asked for at a time.
const COUNT_MAX: u16 = 64;

/// Axes that every call about all of them is asked for.
const AXES_ASKED: i16 = const_to_i16(MAX_AXIS);

/// Bytes that a value of a parameter or a diagnosis number can have: byte or bits, word, two words, real. The library
/// refuses with `EW_LENGTH` what is too short.
const SIZES: [usize; 4] = [1, 2, 4, 8];

/// A number of an item as the library takes it: what is beyond 32767 it cannot be asked for.
fn convert_number(number: u16) -> Result<i16, FocasItemError> {
    i16::try_from(number).map_err(|_| FocasItemError::NotOffered)
}

impl FocasSession {
    pub(super) fn read(&mut self, item: FocasItem) -> FocasItemResult {
        let (f, h) = (&self.functions, self.handle);
        match item {
            FocasItem::System => self.read_system().map(FocasAnswer::System),
            FocasItem::Status => self.read_status().map(FocasAnswer::Status),
            FocasItem::Feed => {
                fill_structure(size_of::<OdbAct>(), |out| f.cnc_actf(h, out)).map(|bytes| decode_actual_value(&bytes))
            }
            FocasItem::SpindleSpeed => {
                fill_structure(size_of::<OdbAct>(), |out| f.cnc_acts(h, out)).map(|bytes| decode_actual_value(&bytes))
            }
            FocasItem::Spindles(Spindle::Load) => self.spindle_meter(0, 0),
            FocasItem::Spindles(Spindle::MotorSpeed) => self.spindle_meter(1, size_of::<LoadElm>()),
            FocasItem::Spindles(Spindle::Gear) => {
                let bytes = fill_structure(size_of::<OdbSpn>(), |out| f.cnc_rdspgear(h, -1, out))?;
                let gear = bytes.read_i16(offset_of!(OdbSpn, data));
                Ok(FocasAnswer::Numbers(vec![Some(f64::from(gear))]))
            }
            FocasItem::Servos(Servo::Load) => self.servo_meter().map(|(_, loads)| FocasAnswer::Numbers(loads)),
            FocasItem::AxisNames => self.servo_meter().map(|(names, _)| FocasAnswer::Names(names)),
            FocasItem::Servos(Servo::Current) => self.servo_current(),
            FocasItem::Program | FocasItem::ProgramName | FocasItem::Sequence => self.read_program(item),
            FocasItem::AlarmBits => {
                let mut bits = 0;
                check_code(f.cnc_alarm2(h, &mut bits)).map(|()| FocasAnswer::Whole(bits))
            }
            FocasItem::Alarms(most) => self.read_alarms(most.min(COUNT_MAX)),
            FocasItem::ModalWord(word) => self.read_modal_word(word),
            FocasItem::ModalGroup(group @ 0..) => {
                let bytes = fill_structure(LONG_LEN, |out| f.cnc_modal(h, group, 0, out))?;
                Ok(FocasAnswer::Groups(vec![bytes.read_array::<1>(4)[0]]))
            }
            FocasItem::Macro(number) => self.read_macro_variable(number),
            FocasItem::Parameter(..) | FocasItem::Diagnosis(..) => self.read_data(item),
            FocasItem::Timer(timer) => {
                let which = convert_bounded(timer.wire_number(), i16::MAX);
                let bytes = fill_structure(8, |out| f.cnc_rdtimer(h, which, out))?;
                Ok(FocasAnswer::Time { minutes: bytes.read_i32(0), milliseconds: bytes.read_i32(4) })
            }
            FocasItem::ToolOffset(number, kind) => {
                let (number, kind) = (convert_number(number)?, convert_number(kind)?);
                let bytes = fill_structure(8, |out| f.cnc_rdtofs(h, number, kind, 8, out))?;
                Ok(FocasAnswer::Number(scale_decimal(bytes.read_i32(4), POSITION_PLACES)))
            }
            FocasItem::ExecutedText(_) | FocasItem::Messages(_) | FocasItem::GCodes => self.read_text(item),
            FocasItem::HistoryCount | FocasItem::AlarmHistory(..) => self.read_history(item),
            FocasItem::ToolGroup | FocasItem::ToolLife(_) => self.tool_life(item),
            FocasItem::Spindles(Spindle::Speed) => {
                // The call does not say how many spindles there are.
                let mut found = 8;
                fill_structure(4 * 8, |out| f.cnc_rdspdlname(h, &mut found, out))?;
                let bytes = fill_structure(36, |out| f.cnc_acts2(h, -1, out))?;
                let speed = |at: usize| Some(f64::from(bytes.read_i32(4 + 4 * at)));
                Ok(FocasAnswer::Numbers((0..clamp_count(found, 8)).map(speed).collect()))
            }
            FocasItem::PositionUnit(frame) => self.position_units(frame),
            FocasItem::Pmc(stretch) => self.read_memory(stretch),
            FocasItem::WorkOffset(number, axis) => {
                let number = convert_number(number)?;
                let bytes = fill_structure(ZOFS_LEN, |out| f.cnc_rdzofs(h, number, axis, 8, out))?;
                Ok(FocasAnswer::Number(scale_decimal(bytes.read_i32(4), POSITION_PLACES)))
            }
            _ => Err(FocasItemError::NotOffered),
        }
    }

    fn read_program(&self, item: FocasItem) -> FocasItemResult {
        let (f, h) = (&self.functions, self.handle);
        match item {
            FocasItem::Program => {
                let bytes = fill_structure(size_of::<OdbPro>(), |out| f.cnc_rdprgnum(h, out))?;
                let number = |at| i32::from(bytes.read_i16(at));
                Ok(FocasAnswer::Program {
                    running: number(offset_of!(OdbPro, data)),
                    main: number(offset_of!(OdbPro, mdata)),
                })
            }
            FocasItem::ProgramName => {
                let bytes = fill_structure(size_of::<OdbExePrg>(), |out| f.cnc_exeprgname(h, out))?;
                let (number, name) =
                    (bytes.read_i32(offset_of!(OdbExePrg, o_num)), bytes.text_in(0, 36, self.encoding));
                Ok(FocasAnswer::Named { number, name })
            }
            FocasItem::Sequence => {
                let bytes = fill_structure(size_of::<OdbSeq>(), |out| f.cnc_rdseqnum(h, out))?;
                Ok(FocasAnswer::Whole(bytes.read_i32(offset_of!(OdbSeq, data))))
            }
            _ => Err(FocasItemError::NotOffered),
        }
    }

    pub(super) fn read_system(&self) -> Result<System, FocasItemError> {
        let bytes = fill_structure(size_of::<OdbSys>(), |out| self.functions.cnc_sysinfo(self.handle, out))?;
        Ok(System {
            additional: bytes.read_i16(offset_of!(OdbSys, addinfo)),
            axes_max: bytes.read_i16(offset_of!(OdbSys, max_axis)),
            kind: bytes.read_text(offset_of!(OdbSys, cnc_type), 2),
            machine: bytes.read_text(offset_of!(OdbSys, mt_type), 2),
            series: bytes.read_text(offset_of!(OdbSys, series), 4),
            version: bytes.read_text(offset_of!(OdbSys, version), 4),
            axes: bytes.read_text(offset_of!(OdbSys, axes), 2),
        })
    }

    fn read_status(&self) -> Result<Status, FocasItemError> {
        let bytes = fill_structure(size_of::<OdbSt>(), |out| self.functions.cnc_statinfo(self.handle, out))?;
        Ok(Status {
            automatic: bytes.read_i16(offset_of!(OdbSt, aut)),
            run: bytes.read_i16(offset_of!(OdbSt, run)),
            motion: bytes.read_i16(offset_of!(OdbSt, motion)),
            auxiliary: bytes.read_i16(offset_of!(OdbSt, mstb)),
            emergency: bytes.read_i16(offset_of!(OdbSt, emergency)),
            alarm: bytes.read_i16(offset_of!(OdbSt, alarm)),
            edit: bytes.read_i16(offset_of!(OdbSt, edit)),
        })
    }

    /// Load or speed; the half that was not asked for is not written.
    fn spindle_meter(&self, kind: i16, offset: usize) -> FocasItemResult {
        let mut found = 4;
        let length = size_of::<OdbSpLoad>() * 4;
        let bytes = fill_structure(length, |out| self.functions.cnc_rdspmeter(self.handle, kind, &mut found, out))?;
        let at = |spindle| spindle * size_of::<OdbSpLoad>() + offset;
        Ok(FocasAnswer::Numbers((0..clamp_count(found, 4)).map(|spindle| bytes.read_element(at(spindle))).collect()))
    }

    fn servo_meter(&self) -> Result<(Vec<String>, Vec<Option<f64>>), FocasItemError> {
        let mut found = AXES_ASKED;
        let length = size_of::<LoadElm>() * MAX_AXIS;
        let bytes = fill_structure(length, |out| self.functions.cnc_rdsvmeter(self.handle, &mut found, out))?;
        let at = |axis| axis * size_of::<LoadElm>();
        let axes = 0..clamp_count(found, MAX_AXIS);
        let names = axes.clone().map(|axis| bytes.read_text(at(axis) + offset_of!(LoadElm, name), 2)).collect();
        Ok((names, axes.map(|axis| bytes.read_element(at(axis))).collect()))
    }

    /// Class 2 (axis drives), type 2 (current in amperes).
    fn servo_current(&self) -> FocasItemResult {
        let (mut kind, mut found) = (2, AXES_ASKED);
        let length = size_of::<OdbAxDt>() * MAX_AXIS;
        let call = |out: &mut Guarded| self.functions.cnc_rdaxisdata(self.handle, 2, &mut kind, 1, &mut found, out);
        let bytes = fill_structure(length, call)?;
        let value = |axis: usize| {
            let at = axis * size_of::<OdbAxDt>();
            scale_decimal(bytes.read_i32(at + offset_of!(OdbAxDt, data)), bytes.read_i16(at + offset_of!(OdbAxDt, dec)))
        };
        Ok(FocasAnswer::Numbers((0..clamp_count(found, MAX_AXIS)).map(value).collect()))
    }

    fn read_alarms(&self, most: u16) -> FocasItemResult {
        let mut found = convert_bounded(most, i16::MAX);
        let length = size_of::<OdbAlmMsg2>() * usize::from(most);
        let bytes = fill_structure(length, |out| self.functions.cnc_rdalmmsg2(self.handle, -1, &mut found, out))?;
        let alarm = |index: usize| {
            let at = index * size_of::<OdbAlmMsg2>();
            let length = clamp_count(bytes.read_i16(at + offset_of!(OdbAlmMsg2, msg_len)), 64);
            Alarm {
                number: bytes.read_i32(at),
                kind: i32::from(bytes.read_i16(at + offset_of!(OdbAlmMsg2, kind))),
                axis: i32::from(bytes.read_i16(at + offset_of!(OdbAlmMsg2, axis))),
                text: bytes.text_in(at + offset_of!(OdbAlmMsg2, alm_msg), length, self.encoding),
            }
        };
        Ok(FocasAnswer::Alarms((0..clamp_count(found, usize::from(most))).map(alarm).collect()))
    }

    /// Feed with its decimals and its unit, once per poll.
    pub(super) fn feed_with_unit(&mut self) -> Result<(Option<f64>, SpeedUnit), FocasItemError> {
        if let Some(known) = self.speed {
            return Ok(known);
        }
        let call = |out: &mut Guarded| self.functions.cnc_rdspeed(self.handle, 0, out);
        let bytes = fill_structure(2 * size_of::<SpeedElm>(), call)?;
        let feed = scale_decimal(bytes.read_i32(offset_of!(SpeedElm, data)), bytes.read_i16(offset_of!(SpeedElm, dec)));
        let found = (feed, SpeedUnit::of_library(bytes.read_i16(offset_of!(SpeedElm, unit))));
        self.speed = Some(found);
        Ok(found)
    }

    fn read_modal_word(&self, word: BlockWord) -> FocasItemResult {
        let number = word.number_in_library().ok_or(FocasItemError::NotOffered)?;
        let bytes = fill_structure(LONG_LEN, |out| self.functions.cnc_modal(self.handle, number, 0, out))?;
        let [flag, places] = bytes.read_array(8);
        Ok(FocasAnswer::Modal { value: bytes.read_i32(4), flag, places })
    }

    pub(super) fn every_axis(&self) -> Result<Bytes, FocasItemError> {
        const LENGTH: i16 = const_to_i16(ODBDY2_ALL_LEN);
        fill_structure(ODBDY2_ALL_LEN, |out| self.functions.cnc_rddynamic2(self.handle, -1, LENGTH, out))
    }

    /// Places after the point of the positions of every axis: three in millimetres, four in inches on most machines.
    pub(super) fn read_decimal_places(&self) -> Result<Vec<i16>, FocasItemError> {
        let (mut found, mut entered) = (AXES_ASKED, Guarded::new(2 * MAX_AXIS));
        let call = |out: &mut Guarded| self.functions.cnc_getfigure(self.handle, 0, &mut found, &mut entered, out);
        let bytes = fill_structure(2 * MAX_AXIS, call)?;
        Ok((0..clamp_count(found, MAX_AXIS)).map(|axis| bytes.read_i16(2 * axis)).collect())
    }

    /// Units of the positions of every axis: of one that the frame has.
    fn position_units(&self, frame: PositionFrame) -> FocasItemResult {
        let mut found = AXES_ASKED;
        let length = POSITIONS_LEN * MAX_AXIS;
        let (kind, place) = if frame == PositionFrame::Machine { (1, 1) } else { (0, 0) };
        let call = |out: &mut Guarded| self.functions.cnc_rdposition(self.handle, kind, &mut found, out);
        let bytes = fill_structure(length, call)?;
        let unit =
            |axis: usize| bytes.read_i16(axis * POSITIONS_LEN + place * size_of::<PosElm>() + offset_of!(PosElm, unit));
        Ok(FocasAnswer::Units((0..clamp_count(found, MAX_AXIS)).map(unit).collect()))
    }

    fn read_macro_variable(&self, number: u16) -> FocasItemResult {
        let number = i16::try_from(number).map_err(|_| FocasItemError::NotOffered)?;
        let bytes = fill_structure(size_of::<OdbM>(), |out| self.functions.cnc_rdmacro(self.handle, number, 10, out))?;
        let (value, places) = (bytes.read_i32(offset_of!(OdbM, mcr_val)), bytes.read_i16(offset_of!(OdbM, dec_val)));
        Ok(FocasAnswer::Number(scale_decimal(value, places)))
    }

    /// A parameter or a diagnosis number, of no axis, of one or of all. Its size is found out once.
    fn read_data(&mut self, item: FocasItem) -> FocasItemResult {
        let (number, axis) = match item {
            FocasItem::Parameter(number, axis) | FocasItem::Diagnosis(number, axis) => (number, axis),
            _ => return Err(FocasItemError::NotOffered),
        };
        let number = i16::try_from(number).map_err(|_| FocasItemError::NotOffered)?;
        let places = if axis == -1 { MAX_AXIS } else { 1 };
        let known = self.sizes.get(&item).copied();
        for size in SIZES.into_iter().filter(|size| known.is_none_or(|known| known == *size)) {
            let length = convert_bounded(4 + size * places, i16::MAX);
            let (f, h) = (&self.functions, self.handle);
            let found = fill_structure(4 + 8 * MAX_AXIS, |out| match item {
                FocasItem::Parameter(..) => f.cnc_rdparam(h, number, axis, length, out),
                _ => f.cnc_diagnoss(h, number, axis, length, out),
            });
            match found {
                Ok(bytes) => {
                    self.sizes.insert(item, size);
                    let count = if axis == -1 { self.axes_max } else { 1 };
                    let values = (0..count).map(|at| decode_sized(&bytes, 4 + at * size, size)).collect();
                    return Ok(FocasAnswer::Data { kind: convert_bounded(size, i16::MAX), values });
                }
                Err(FocasItemError::Refused(refusal)) if refusal.code == FocasReturnCode::LENGTH => {}
                Err(error) => return Err(error),
            }
        }
        Err(FocasItemError::Refused(Refusal { code: FocasReturnCode::LENGTH, detail: 0 }))
    }

    fn read_memory(&self, stretch: Stretch) -> FocasItemResult {
        let total = PMC_HEAD_LEN + stretch.len();
        let length = u16::try_from(total).map_err(|_| FocasItemError::NotOffered)?;
        let (area, width) = pmc_words(stretch);
        let (from, to) = (stretch.from, stretch.to);
        let call = |out: &mut Guarded| self.functions.pmc_rdpmcrng(self.handle, area, width, from, to, length, out);
        let bytes = fill_structure(total, call)?;
        let step = usize::from(stretch.width.byte_count());
        let element = |at: usize| match stretch.width {
            PmcWidth::Byte => i32::from(bytes.read_array::<1>(at)[0]),
            PmcWidth::Word => i32::from(bytes.read_i16(at)),
            PmcWidth::Long => bytes.read_i32(at),
        };
        Ok(FocasAnswer::Memory((PMC_HEAD_LEN..total).step_by(step).map(element).collect()))
    }
}

/// A value of so many bytes; a real has its places behind it.
fn decode_sized(bytes: &Bytes, at: usize, size: usize) -> Option<f64> {
    match size {
        1 => Some(f64::from(bytes.read_array::<1>(at)[0])),
        2 => Some(f64::from(bytes.read_i16(at))),
        4 => Some(f64::from(bytes.read_i32(at))),
        _ => i16::try_from(bytes.read_i32(at + 4)).ok().and_then(|places| scale_decimal(bytes.read_i32(at), places)),
    }
}

fn decode_actual_value(bytes: &Bytes) -> FocasAnswer {
    FocasAnswer::Number(Some(f64::from(bytes.read_i32(offset_of!(OdbAct, data)))))
}
