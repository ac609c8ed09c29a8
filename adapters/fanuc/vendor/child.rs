//! The child's side: the connection of the library, and what the parent asks of it.

use super::dynamic;
use super::ffi::Functions;
use super::layout::{MAX_AXIS, ZOFS_LEN};
use super::message::{FocasReply, FocasRequest};
use super::structure::{Bytes, check_code};
use crate::answer::{FocasAnswer, FocasItemError, FocasItemResult, SpeedUnit};
use crate::code::{Consequence, FocasReturnCode};
use crate::generation::{Generation, Opening};
use crate::item::{FocasItem, Question, Stretch, Write};
use adapter_core::integer::convert_bounded;
use adapter_core::reading::Absence;
use adapter_core::text::TextEncoding;
use device_line::child::{Guarded, Missing, serve_words};
use std::collections::HashMap;
use std::ffi::CString;
use std::path::Path;

/// Answers the parent until it is gone.
///
/// # Errors
/// The line to the parent failed.
pub fn serve_parent() -> std::io::Result<()> {
    let mut session: Option<FocasSession> = None;
    serve_words(|ask: Result<FocasRequest, _>, tell| match (ask, &mut session) {
        (Ok(FocasRequest::Read(questions)), Some(session)) => session.read_each(&questions, tell),
        (Ok(ask), _) => tell(&answer_request(&mut session, ask)),
        (Err(confused), _) => tell(&FocasReply::Confused(confused.to_string())),
    })
}

fn answer_request(session: &mut Option<FocasSession>, ask: FocasRequest) -> FocasReply {
    if let FocasRequest::Open { vendor_library, host, port, path, timeout_s, encoding } = ask {
        *session = None;
        return match FocasSession::open(&vendor_library, &host, port, path, timeout_s) {
            Ok((mut opened, opening)) => {
                opened.encoding = encoding;
                *session = Some(opened);
                FocasReply::Opened(opening)
            }
            Err(told) => *told,
        };
    }
    let Some(session) = session else { return FocasReply::Confused("there is no connection".to_owned()) };
    match ask {
        FocasRequest::Write(write) => session.write(&write),
        FocasRequest::Open { .. } | FocasRequest::Read(_) => FocasReply::Confused("not on this connection".to_owned()),
    }
}

fn build_missing_reply(name: &str) -> Box<FocasReply> {
    Box::new(FocasReply::Unloadable(format!("the library has no {name}")))
}

/// A connection of the library. Whoever opened it closes it, on the same thread.
pub(super) struct FocasSession {
    pub(super) functions: Functions,
    pub(super) handle: u16,
    /// The path that the connection was made for and that is written to.
    own: u8,
    /// The path that the library's questions carry now.
    path: u8,
    /// Character set of the controller's texts.
    pub(super) encoding: TextEncoding,
    /// Places for axes in what the library fills in.
    pub(super) axes_max: usize,
    /// The call for the positions, which has answered other questions of this poll too.
    dynamic: Option<Bytes>,
    /// The feed with its unit, which is one call.
    pub(super) speed: Option<(Option<f64>, SpeedUnit)>,
    /// Bytes of a value of the parameters and diagnosis numbers that have been read.
    pub(super) sizes: HashMap<FocasItem, usize>,
    /// Places after the point of the axes of each path: the calls for positions give whole numbers.
    places: HashMap<u8, Vec<i16>>,
}

impl Drop for FocasSession {
    fn drop(&mut self) {
        let _without = self.functions.cnc_freelibhndl(self.handle);
        let _without = self.functions.cnc_exitprocess();
    }
}

impl FocasSession {
    fn open(
        library: &Path,
        host: &str,
        port: u16,
        path: u8,
        timeout_s: i32,
    ) -> Result<(Self, Opening), Box<FocasReply>> {
        let functions = Functions::load(library).map_err(|why| Box::new(FocasReply::Unloadable(why.to_string())))?;
        let host = CString::new(host).map_err(|error| Box::new(FocasReply::Unloadable(error.to_string())))?;
        // Level 0 never writes a file, whatever is named.
        let started = functions.cnc_startupprocess(0, c"focas.log");
        if let Ok(code @ (i16::MIN..=-1 | 1..)) = started {
            return Err(Box::new(FocasReply::Code(FocasReturnCode(code))));
        }
        let mut handle = 0;
        match functions.cnc_allclibhndl3(&host, port, timeout_s, &mut handle) {
            Ok(0) => {}
            Ok(code) => return Err(Box::new(FocasReply::Code(FocasReturnCode(code)))),
            Err(Missing(name)) => return Err(build_missing_reply(name)),
        }
        let mut session = Self {
            functions,
            handle,
            own: path,
            path: 1,
            encoding: TextEncoding::default(),
            axes_max: 0,
            dynamic: None,
            speed: None,
            sizes: HashMap::new(),
            places: HashMap::new(),
        };
        match session.turn_to(path) {
            Ok(0) => {}
            Ok(code) => return Err(Box::new(FocasReply::Code(FocasReturnCode(code)))),
            Err(Missing(name)) => return Err(build_missing_reply(name)),
        }
        let opening = session.build_opening();
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
            (self.path, self.dynamic, self.speed) = (path, None, None);
        }
        Ok(code)
    }

    /// The library tells no version word; what is known comes from the series.
    fn build_opening(&self) -> Opening {
        let system = self.read_system().ok();
        let of = |text: Option<&str>| text.and_then(|text| text.trim().parse::<u16>().ok()).unwrap_or(0);
        let axes_max = system.as_ref().map_or(0, |system| system.axes_max.max(0).unsigned_abs());
        let axes = of(system.as_ref().map(|system| system.axes.as_str()));
        let (mut path, mut paths) = (0, 0);
        let told = self.functions.cnc_getpath(self.handle, &mut path, &mut paths);
        let paths = if told == Ok(0) { i16::max(paths, 0).unsigned_abs() } else { 0 };
        let generation = Generation::Newer(0);
        Opening { generation, family: 0, axes_max, spindles_max: 0, paths, axes, spindles: 0 }
    }

    /// Reads until an answer cannot be trusted. A connection that is dead answers nothing any more.
    fn read_each(&mut self, questions: &[Question], tell: &mut dyn FnMut(&FocasReply)) {
        (self.dynamic, self.speed) = (None, None);
        let mut dead: Option<FocasItemError> = None;
        for question in questions {
            let result = match &dead {
                Some(error) => Err(error.clone()),
                None => self.read_on(*question),
            };
            let malformed = matches!(result, Err(FocasItemError::Malformed(_)));
            dead = result.as_ref().err().filter(|error| is_dead(error)).cloned().or(dead);
            tell(&FocasReply::Read(result));
            if malformed {
                return;
            }
        }
    }

    fn read_on(&mut self, question: Question) -> FocasItemResult {
        check_code(self.turn_to(question.path))?;
        if matches!(question.item, FocasItem::Position(_, -1)) && self.dynamic.is_none() {
            self.dynamic = Some(self.every_axis()?);
        }
        if matches!(question.item, FocasItem::Position(_, -1)) && !self.places.contains_key(&self.path) {
            let places = self.read_decimal_places()?;
            self.places.insert(self.path, places);
        }
        if matches!(question.item, FocasItem::Feed | FocasItem::FeedUnit) {
            match self.feed_with_unit() {
                Ok((_, unit)) if question.item == FocasItem::FeedUnit => return Ok(FocasAnswer::Unit(unit)),
                Ok((feed, _)) => return Ok(FocasAnswer::Number(feed)),
                // A control or library without this call tells the feed without its unit.
                Err(error) if question.item == FocasItem::Feed && error.to_absence() == Absence::NotSupported => {}
                Err(error) => return Err(error),
            }
        }
        let places = self.places.get(&self.path).map_or(&[][..], Vec::as_slice);
        let known = self
            .dynamic
            .as_ref()
            .and_then(|dynamic| dynamic::decode_item(question.item, dynamic, self.axes_max, places));
        known.map_or_else(|| self.read(question.item), Ok)
    }

    fn write(&mut self, write: &Write) -> FocasReply {
        let turned = self.turn_to(self.own);
        match turned.and_then(|code| if code == 0 { self.call_write_function(write) } else { Ok(code) }) {
            Ok(0) => FocasReply::Written,
            Ok(code) => FocasReply::Code(FocasReturnCode(code)),
            Err(Missing(name)) => FocasReply::Confused(format!("the library has no {name}")),
        }
    }

    fn call_write_function(&self, write: &Write) -> Result<i16, Missing> {
        let (f, h) = (&self.functions, self.handle);
        // What the library's 16 bits do not hold is refused as the library refuses a number that it does not know.
        let (bad_number, bad_length) = (Ok(FocasReturnCode::NUMBER.0), Ok(FocasReturnCode::LENGTH.0));
        match write {
            Write::Macro { number, mantissa, places } => match i16::try_from(*number) {
                Ok(number) => f.cnc_wrmacro(h, number, 10, *mantissa, *places),
                Err(_) => bad_number,
            },
            Write::Pmc { stretch, values } => {
                let (area, width) = pmc_words(*stretch);
                let step = usize::from(stretch.width.byte_count());
                let head =
                    [area.to_le_bytes(), width.to_le_bytes(), stretch.from.to_le_bytes(), stretch.to.to_le_bytes()];
                let data = values.iter().flat_map(|value| value.to_le_bytes()[..step].to_vec());
                let bytes: Vec<u8> = head.concat().into_iter().chain(data).collect();
                let Ok(length) = u16::try_from(bytes.len()) else { return bad_length };
                let mut buffer = Guarded::new(bytes.len());
                buffer.write_bytes(&bytes);
                f.pmc_wrpmcrng(h, length, &mut buffer)
            }
            Write::WorkOffset { number, axis, value } => {
                let Ok(number) = i16::try_from(*number) else { return bad_number };
                let head = [number.to_le_bytes(), axis.to_le_bytes()].concat();
                let mut buffer = Guarded::new(ZOFS_LEN);
                buffer.write_bytes(&[head, value.to_le_bytes().to_vec()].concat());
                f.cnc_wrzofs(h, 8, &mut buffer)
            }
            Write::ToolOffset { .. } => Err(Missing("cnc_wrtofs")),
            Write::PanelSignals { .. } => Err(Missing("cnc_wropnlsgnl")),
        }
    }
}

fn is_dead(error: &FocasItemError) -> bool {
    matches!(error, FocasItemError::Refused(refusal) if refusal.code.consequence() == Consequence::Reconnect)
}

pub(super) fn pmc_words(stretch: Stretch) -> (i16, i16) {
    let word = |number: i32| convert_bounded(number, i16::MAX);
    (word(stretch.area.wire_number()), word(stretch.width.wire_number()))
}
