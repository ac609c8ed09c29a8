//! The child's side: items to calls, structures to answers.

use super::dynamic;
use super::ffi::Functions;
use super::layout::{
    LONG_LEN, LoadElm, MAX_AXIS, ODBDY2_ALL_LEN, OdbAct, OdbAlmMsg2, OdbAxDt, OdbExePrg, OdbM, OdbPro, OdbSeq,
    OdbSpLoad, OdbSpn, OdbSt, OdbSys, PMC_HEAD_LEN, ZOFS_LEN,
};
use super::message::{Ask, Tell};
use super::structure::{Bytes, POSITION_PLACES, checked, decimal, filled};
use crate::child::{Guarded, Missing, serve_words};
use crate::fanuc::answer::{Alarm, Answer, ItemError, ItemResult, Status, System};
use crate::fanuc::code::{Consequence, ReturnCode};
use crate::fanuc::item::{Item, Question, Servo, Spindle, Stretch, Width, Write};
use crate::fanuc::opening::{Generation, Opening};
use std::ffi::CString;
use std::mem::{offset_of, size_of};
use std::path::Path;

/// Most alarms, spindles and PMC bytes that are asked for at a time.
const COUNT_MAX: u16 = 64;

/// The modal words by their number on the wire, and as the library numbers them.
const MODAL_WORDS: [(i16, i16); 4] = [(5, 103), (11, 106), (20, 107), (22, 108)];

/// Parameters whose length is known: parts counted, and the bits with the unit of the machine.
const LONG_PARAMETERS: [u16; 3] = [6711, 6712, 6713];
const BIT_PARAMETERS: [u16; 1] = [1001];

/// Answers the parent until it is gone.
///
/// # Errors
/// The line to the parent failed.
pub fn child() -> std::io::Result<()> {
    let mut session: Option<Session> = None;
    serve_words(|ask: Result<Ask, String>, tell| match (ask, &mut session) {
        (Ok(Ask::Read(questions)), Some(session)) => session.read_each(&questions, tell),
        (Ok(ask), _) => tell(&answer(&mut session, ask)),
        (Err(confused), _) => tell(&Tell::Confused(confused)),
    })
}

fn answer(session: &mut Option<Session>, ask: Ask) -> Tell {
    if let Ask::Open { vendor_library, host, port, path, timeout_s } = ask {
        *session = None;
        return match Session::open(&vendor_library, &host, port, path, timeout_s) {
            Ok((opened, opening)) => {
                *session = Some(opened);
                Tell::Opened(opening)
            }
            Err(told) => *told,
        };
    }
    let Some(session) = session else { return Tell::Confused("there is no connection".to_owned()) };
    match ask {
        Ask::Write(write) => session.write(&write),
        Ask::Open { .. } | Ask::Read(_) => Tell::Confused("not on this connection".to_owned()),
    }
}

fn without(name: &str) -> Box<Tell> {
    Box::new(Tell::Unloadable(format!("the library has no {name}")))
}

/// A connection of the library. Whoever opened it closes it, on the same thread.
struct Session {
    functions: Functions,
    handle: u16,
    /// The path that the connection was made for and that is written to.
    own: u8,
    /// The path that the library's questions carry now.
    path: u8,
    /// Places for axes in what the library fills in.
    axes_max: usize,
    /// The call for the positions, which has answered other questions of this poll too.
    dynamic: Option<Bytes>,
}

impl Drop for Session {
    fn drop(&mut self) {
        let _without = self.functions.cnc_freelibhndl(self.handle);
        let _without = self.functions.cnc_exitprocess();
    }
}

fn count(found: i16, most: usize) -> usize {
    usize::try_from(found).unwrap_or(0).min(most)
}

impl Session {
    fn open(library: &Path, host: &str, port: u16, path: u8, timeout_s: i32) -> Result<(Self, Opening), Box<Tell>> {
        let functions = Functions::load(library).map_err(|why| Box::new(Tell::Unloadable(why)))?;
        let host = CString::new(host).map_err(|error| Box::new(Tell::Unloadable(error.to_string())))?;
        // Level 0 never writes a file, whatever is named.
        let started = functions.cnc_startupprocess(0, c"focas.log");
        if let Ok(code @ (i16::MIN..=-1 | 1..)) = started {
            return Err(Box::new(Tell::Code(ReturnCode(code))));
        }
        let mut handle = 0;
        match functions.cnc_allclibhndl3(&host, port, timeout_s, &mut handle) {
            Ok(0) => {}
            Ok(code) => return Err(Box::new(Tell::Code(ReturnCode(code)))),
            Err(Missing(name)) => return Err(without(name)),
        }
        let mut session = Self { functions, handle, own: path, path: 1, axes_max: 0, dynamic: None };
        match session.turn_to(path) {
            Ok(0) => {}
            Ok(code) => return Err(Box::new(Tell::Code(ReturnCode(code)))),
            Err(Missing(name)) => return Err(without(name)),
        }
        let opening = session.opening();
        session.axes_max = usize::from(opening.axes_max).min(MAX_AXIS);
        Ok((session, opening))
    }

    /// The library writes this path into its questions from now on; nothing is sent.
    fn turn_to(&mut self, path: u8) -> Result<i16, Missing> {
        if path == self.path {
            return Ok(0);
        }
        let code = self.functions.cnc_setpath(self.handle, i16::from(path))?;
        if code == 0 {
            (self.path, self.dynamic) = (path, None);
        }
        Ok(code)
    }

    /// The library tells no version word; what is known comes from the series.
    fn opening(&self) -> Opening {
        let system = self.system().ok();
        let of = |text: Option<&str>| text.and_then(|text| text.trim().parse::<u16>().ok()).unwrap_or(0);
        let axes_max = system.as_ref().and_then(|system| u16::try_from(system.axes_max).ok()).unwrap_or(0);
        let axes = of(system.as_ref().map(|system| system.axes.as_str()));
        let (mut path, mut paths) = (0, 0);
        let told = self.functions.cnc_getpath(self.handle, &mut path, &mut paths);
        let paths = if told == Ok(0) { u16::try_from(paths).unwrap_or(0) } else { 0 };
        let generation = Generation::Newer(0);
        Opening { generation, family: 0, axes_max, spindles_max: 0, paths, axes, spindles: 0 }
    }

    /// Reads until an answer cannot be trusted. A connection that is dead answers nothing any more.
    fn read_each(&mut self, questions: &[Question], tell: &mut dyn FnMut(&Tell)) {
        self.dynamic = None;
        let mut dead: Option<ItemError> = None;
        for question in questions {
            let result = match &dead {
                Some(error) => Err(error.clone()),
                None => self.read_on(*question),
            };
            let malformed = matches!(result, Err(ItemError::Malformed(_)));
            dead = result.as_ref().err().filter(|error| is_dead(error)).cloned().or(dead);
            tell(&Tell::Read(result));
            if malformed {
                return;
            }
        }
    }

    fn read_on(&mut self, question: Question) -> ItemResult {
        checked(self.turn_to(question.path))?;
        if matches!(question.item, Item::Position(_, -1)) && self.dynamic.is_none() {
            self.dynamic = Some(self.every_axis()?);
        }
        let known = self.dynamic.as_ref().and_then(|dynamic| dynamic::of(question.item, dynamic, self.axes_max));
        known.map_or_else(|| self.read(question.item), Ok)
    }

    fn read(&self, item: Item) -> ItemResult {
        let (f, h) = (&self.functions, self.handle);
        match item {
            Item::System => self.system().map(Answer::System),
            Item::Status => self.status().map(Answer::Status),
            Item::Feed => filled(size_of::<OdbAct>(), |out| f.cnc_actf(h, out)).map(|bytes| act(&bytes)),
            Item::SpindleSpeed => filled(size_of::<OdbAct>(), |out| f.cnc_acts(h, out)).map(|bytes| act(&bytes)),
            Item::Spindles(Spindle::Load) => self.spindle_meter(0, 0),
            Item::Spindles(Spindle::MotorSpeed) => self.spindle_meter(1, size_of::<LoadElm>()),
            Item::Spindles(Spindle::Gear) => {
                let bytes = filled(size_of::<OdbSpn>(), |out| f.cnc_rdspgear(h, -1, out))?;
                let gear = bytes.i16(offset_of!(OdbSpn, data));
                Ok(Answer::Numbers(vec![Some(f64::from(gear))]))
            }
            Item::Servos(Servo::Load) => self.servo_meter().map(|(_, loads)| Answer::Numbers(loads)),
            Item::AxisNames => self.servo_meter().map(|(names, _)| Answer::Names(names)),
            Item::Servos(Servo::Current) => self.servo_current(),
            Item::Program => {
                let bytes = filled(size_of::<OdbPro>(), |out| f.cnc_rdprgnum(h, out))?;
                let number = |at| i32::from(bytes.i16(at));
                Ok(Answer::Program {
                    running: number(offset_of!(OdbPro, data)),
                    main: number(offset_of!(OdbPro, mdata)),
                })
            }
            Item::ProgramName => {
                let bytes = filled(size_of::<OdbExePrg>(), |out| f.cnc_exeprgname(h, out))?;
                let (number, name) = (bytes.i32(offset_of!(OdbExePrg, o_num)), bytes.text(0, 36));
                Ok(Answer::Named { number, name })
            }
            Item::Sequence => {
                let bytes = filled(size_of::<OdbSeq>(), |out| f.cnc_rdseqnum(h, out))?;
                Ok(Answer::Whole(bytes.i32(offset_of!(OdbSeq, data))))
            }
            Item::AlarmBits => {
                let mut bits = 0;
                checked(f.cnc_alarm2(h, &mut bits)).map(|()| Answer::Whole(bits))
            }
            Item::Alarms(most) => self.alarms(most.min(COUNT_MAX)),
            Item::ModalWord(word) => self.modal(word),
            Item::Macro(number) => self.variable(number),
            Item::Parameter(number, 0) => self.parameter(number),
            Item::Pmc(stretch) => self.memory(stretch),
            Item::WorkOffset(number, axis) => {
                let number = i16::try_from(number).unwrap_or(i16::MAX);
                let bytes = filled(ZOFS_LEN, |out| f.cnc_rdzofs(h, number, axis, 8, out))?;
                Ok(Answer::Number(decimal(bytes.i32(4), POSITION_PLACES)))
            }
            _ => Err(ItemError::NotOffered),
        }
    }

    fn system(&self) -> Result<System, ItemError> {
        let bytes = filled(size_of::<OdbSys>(), |out| self.functions.cnc_sysinfo(self.handle, out))?;
        Ok(System {
            additional: bytes.i16(offset_of!(OdbSys, addinfo)),
            axes_max: bytes.i16(offset_of!(OdbSys, max_axis)),
            kind: bytes.text(offset_of!(OdbSys, cnc_type), 2),
            machine: bytes.text(offset_of!(OdbSys, mt_type), 2),
            series: bytes.text(offset_of!(OdbSys, series), 4),
            version: bytes.text(offset_of!(OdbSys, version), 4),
            axes: bytes.text(offset_of!(OdbSys, axes), 2),
        })
    }

    fn status(&self) -> Result<Status, ItemError> {
        let bytes = filled(size_of::<OdbSt>(), |out| self.functions.cnc_statinfo(self.handle, out))?;
        Ok(Status {
            automatic: bytes.i16(offset_of!(OdbSt, aut)),
            run: bytes.i16(offset_of!(OdbSt, run)),
            motion: bytes.i16(offset_of!(OdbSt, motion)),
            auxiliary: bytes.i16(offset_of!(OdbSt, mstb)),
            emergency: bytes.i16(offset_of!(OdbSt, emergency)),
            alarm: bytes.i16(offset_of!(OdbSt, alarm)),
            edit: bytes.i16(offset_of!(OdbSt, edit)),
        })
    }

    /// Load or speed; the half that was not asked for is not written.
    fn spindle_meter(&self, kind: i16, offset: usize) -> ItemResult {
        let mut found = 4;
        let length = size_of::<OdbSpLoad>() * 4;
        let bytes = filled(length, |out| self.functions.cnc_rdspmeter(self.handle, kind, &mut found, out))?;
        let at = |spindle| spindle * size_of::<OdbSpLoad>() + offset;
        Ok(Answer::Numbers((0..count(found, 4)).map(|spindle| bytes.element(at(spindle))).collect()))
    }

    fn servo_meter(&self) -> Result<(Vec<String>, Vec<Option<f64>>), ItemError> {
        let mut found = i16::try_from(MAX_AXIS).unwrap_or(32);
        let length = size_of::<LoadElm>() * MAX_AXIS;
        let bytes = filled(length, |out| self.functions.cnc_rdsvmeter(self.handle, &mut found, out))?;
        let at = |axis| axis * size_of::<LoadElm>();
        let axes = 0..count(found, MAX_AXIS);
        let names = axes.clone().map(|axis| bytes.text(at(axis) + offset_of!(LoadElm, name), 2)).collect();
        Ok((names, axes.map(|axis| bytes.element(at(axis))).collect()))
    }

    /// Class 2 (axis drives), type 2 (current in amperes).
    fn servo_current(&self) -> ItemResult {
        let (mut kind, mut found) = (2, i16::try_from(MAX_AXIS).unwrap_or(32));
        let length = size_of::<OdbAxDt>() * MAX_AXIS;
        let call = |out: &mut Guarded| self.functions.cnc_rdaxisdata(self.handle, 2, &mut kind, 1, &mut found, out);
        let bytes = filled(length, call)?;
        let value = |axis: usize| {
            let at = axis * size_of::<OdbAxDt>();
            decimal(bytes.i32(at + offset_of!(OdbAxDt, data)), bytes.i16(at + offset_of!(OdbAxDt, dec)))
        };
        Ok(Answer::Numbers((0..count(found, MAX_AXIS)).map(value).collect()))
    }

    fn alarms(&self, most: u16) -> ItemResult {
        let mut found = i16::try_from(most).unwrap_or(8);
        let length = size_of::<OdbAlmMsg2>() * usize::from(most);
        let bytes = filled(length, |out| self.functions.cnc_rdalmmsg2(self.handle, -1, &mut found, out))?;
        let alarm = |index: usize| {
            let at = index * size_of::<OdbAlmMsg2>();
            let length = count(bytes.i16(at + offset_of!(OdbAlmMsg2, msg_len)), 64);
            Alarm {
                number: bytes.i32(at),
                kind: i32::from(bytes.i16(at + offset_of!(OdbAlmMsg2, kind))),
                axis: i32::from(bytes.i16(at + offset_of!(OdbAlmMsg2, axis))),
                text: bytes.text(at + offset_of!(OdbAlmMsg2, alm_msg), length),
            }
        };
        Ok(Answer::Alarms((0..count(found, usize::from(most))).map(alarm).collect()))
    }

    fn modal(&self, word: i16) -> ItemResult {
        let number = MODAL_WORDS.iter().find(|(wire, _)| *wire == word).ok_or(ItemError::NotOffered)?.1;
        let bytes = filled(LONG_LEN, |out| self.functions.cnc_modal(self.handle, number, 0, out))?;
        let [first, second] = bytes.array(8);
        Ok(Answer::Modal { value: bytes.i32(4), flags: [first, second] })
    }

    fn every_axis(&self) -> Result<Bytes, ItemError> {
        let length = i16::try_from(ODBDY2_ALL_LEN).unwrap_or(540);
        filled(ODBDY2_ALL_LEN, |out| self.functions.cnc_rddynamic2(self.handle, -1, length, out))
    }

    fn variable(&self, number: u16) -> ItemResult {
        let number = i16::try_from(number).map_err(|_| ItemError::NotOffered)?;
        let bytes = filled(size_of::<OdbM>(), |out| self.functions.cnc_rdmacro(self.handle, number, 10, out))?;
        let (value, places) = (bytes.i32(offset_of!(OdbM, mcr_val)), bytes.i16(offset_of!(OdbM, dec_val)));
        Ok(Answer::Number(decimal(value, places)))
    }

    fn parameter(&self, wanted: u16) -> ItemResult {
        let (length, kind) = match wanted {
            _ if LONG_PARAMETERS.contains(&wanted) => (8, 3),
            _ if BIT_PARAMETERS.contains(&wanted) => (5, 0),
            _ => return Err(ItemError::NotOffered),
        };
        let number = i16::try_from(wanted).map_err(|_| ItemError::NotOffered)?;
        let bytes = filled(LONG_LEN, |out| self.functions.cnc_rdparam(self.handle, number, 0, length, out))?;
        let value = if kind == 0 { i32::from(bytes.array::<1>(4)[0]) } else { bytes.i32(4) };
        Ok(Answer::Data { kind, values: vec![Some(f64::from(value))] })
    }

    fn memory(&self, stretch: Stretch) -> ItemResult {
        let total = PMC_HEAD_LEN + stretch.len();
        let length = u16::try_from(total).map_err(|_| ItemError::NotOffered)?;
        let (area, width) = pmc_words(stretch);
        let (from, to) = (stretch.from, stretch.to);
        let call = |out: &mut Guarded| self.functions.pmc_rdpmcrng(self.handle, area, width, from, to, length, out);
        let bytes = filled(total, call)?;
        let step = usize::from(stretch.width.bytes());
        let element = |at: usize| match stretch.width {
            Width::Byte => i32::from(bytes.array::<1>(at)[0]),
            Width::Word => i32::from(bytes.i16(at)),
            Width::Long => bytes.i32(at),
        };
        Ok(Answer::Memory((PMC_HEAD_LEN..total).step_by(step).map(element).collect()))
    }

    fn write(&mut self, write: &Write) -> Tell {
        let turned = self.turn_to(self.own);
        match turned.and_then(|code| if code == 0 { self.written(write) } else { Ok(code) }) {
            Ok(0) => Tell::Written,
            Ok(code) => Tell::Code(ReturnCode(code)),
            Err(Missing(name)) => Tell::Confused(format!("the library has no {name}")),
        }
    }

    fn written(&self, write: &Write) -> Result<i16, Missing> {
        let (f, h) = (&self.functions, self.handle);
        let short = |number: u16| i16::try_from(number).unwrap_or(i16::MAX);
        match write {
            Write::Macro { number, mantissa, places } => f.cnc_wrmacro(h, short(*number), 10, *mantissa, *places),
            Write::Pmc { stretch, values } => {
                let (area, width) = pmc_words(*stretch);
                let step = usize::from(stretch.width.bytes());
                let head =
                    [area.to_le_bytes(), width.to_le_bytes(), stretch.from.to_le_bytes(), stretch.to.to_le_bytes()];
                let data = values.iter().flat_map(|value| value.to_le_bytes()[..step].to_vec());
                let bytes: Vec<u8> = head.concat().into_iter().chain(data).collect();
                let mut buffer = Guarded::new(bytes.len());
                buffer.put(&bytes);
                f.pmc_wrpmcrng(h, u16::try_from(bytes.len()).unwrap_or(u16::MAX), &mut buffer)
            }
            Write::WorkOffset { number, axis, value } => {
                let head = [short(*number).to_le_bytes(), axis.to_le_bytes()].concat();
                let mut buffer = Guarded::new(ZOFS_LEN);
                buffer.put(&[head, value.to_le_bytes().to_vec()].concat());
                f.cnc_wrzofs(h, 8, &mut buffer)
            }
            Write::ToolOffset { .. } => Err(Missing("cnc_wrtofs")),
            Write::PanelSignals { .. } => Err(Missing("cnc_wropnlsgnl")),
        }
    }
}

fn act(bytes: &Bytes) -> Answer {
    Answer::Number(Some(f64::from(bytes.i32(offset_of!(OdbAct, data)))))
}

fn is_dead(error: &ItemError) -> bool {
    matches!(error, ItemError::Refused(refusal) if refusal.code.consequence() == Consequence::Reconnect)
}

fn pmc_words(stretch: Stretch) -> (i16, i16) {
    let word = |number: i32| i16::try_from(number).unwrap_or(-1);
    (word(stretch.area.number()), word(stretch.width.number()))
}
