//! The child's side: one session, items to calls.

use super::answer::{HncAnswer, HncItemError, HncItemResult, HncReturnCode};
use super::decode::text_of;
use super::ffi::Functions;
use super::item::{EXTERNAL_ZERO, HncItem, HncWidth};
use super::line::DEAD_LINK;
use super::message::{HncReply, HncRequest};
use super::sampling::{Columns, POINTS_MAX, SAMPLED_MAX, SampledItem};
use adapter_core::integer::{convert_bounded, length_to_i64, saturate_to_ms};
use device_line::child::{Guarded, Missing, serve_words};
use std::ffi::CString;
use std::path::Path;
use std::time::Instant;

/// Room for any single value: the longest text of the library is 64 bytes.
const VALUE_LEN: usize = 256;
/// `SEventElement`: source, code, 128 bytes.
const EVENT_LEN: usize = 132;
/// Source and codes of the events about the connection.
const NET_EVENT: (u16, u16, u16) = (0x400, 0xA060, 0xA061);
/// At most so many events are taken at a time.
const EVENTS_MAX: usize = 64;
/// At most so many alarms are asked for.
const ALARMS_MAX: i32 = 16;
/// Alarms of every kind, errors only.
const ALARM_ALL: i32 = 9;
const LEVEL_ERROR: i32 = 0;

/// Answers the parent until it is gone.
///
/// # Errors
/// The line to the parent failed.
pub fn serve_parent() -> std::io::Result<()> {
    let mut session: Option<HncSession> = None;
    serve_words(|ask: Result<HncRequest, _>, tell| match (ask, &session) {
        (Ok(HncRequest::Read(items)), Some(session)) => session.read_each(&items, tell),
        (Ok(ask), _) => tell(&answer_request(&mut session, ask)),
        (Err(confused), _) => tell(&HncReply::Confused(confused.to_string())),
    })
}

fn answer_request(session: &mut Option<HncSession>, ask: HncRequest) -> HncReply {
    if let HncRequest::Open { vendor_library, local_host, local_port, host, port, long_bytes } = ask {
        // The library's own connections are global: an old session goes before a new one.
        *session = None;
        let opened = HncSession::open(&vendor_library, (&local_host, local_port), (&host, port), long_bytes);
        return match opened {
            Ok(opened) => {
                *session = Some(opened);
                HncReply::Opened
            }
            Err(told) => told,
        };
    }
    let Some(session) = session else { return HncReply::Confused("there is no connection".to_owned()) };
    match ask {
        HncRequest::Alive => session.report_connection(),
        HncRequest::Write(kind, index, value) => session.write(kind, index, value),
        HncRequest::WriteZero(axis, counts) => session.write_zero(axis, counts),
        HncRequest::Sample(items) => session.start_sampling(&items),
        HncRequest::Sampled => session.read_samples(),
        HncRequest::Open { .. } | HncRequest::Read(_) => HncReply::Confused("not on this connection".to_owned()),
    }
}

struct HncSession {
    functions: Functions,
    client: i16,
    long_bytes: usize,
    connected: u64,
    lost: u64,
    columns: i32,
}

impl Drop for HncSession {
    fn drop(&mut self) {
        if self.columns > 0 {
            let _without = self.functions.HNC_SamplTriggerOff(self.client);
        }
        self.functions.end_connections();
    }
}

fn check_code(code: Result<i32, Missing>) -> Result<(), HncItemError> {
    match code.map_err(|_| HncItemError::NotOffered)? {
        0 => Ok(()),
        1 => Err(HncItemError::NotYet),
        code => Err(HncItemError::Refused(code)),
    }
}

/// A value that a call fills in; on any code but 0 nothing of it is looked at.
fn fill_value(length: usize, call: impl FnOnce(&mut Guarded) -> Result<i32, Missing>) -> Result<Vec<u8>, HncItemError> {
    let mut buffer = Guarded::new(length);
    check_code(call(&mut buffer))?;
    buffer.read_bytes().map_err(|overrun| HncItemError::Malformed(overrun.to_string()))
}

fn decode_whole(bytes: &[u8]) -> i32 {
    bytes.first_chunk::<4>().map_or(0, |low| i32::from_le_bytes(*low))
}

fn decode_value(bytes: &[u8], width: HncWidth) -> HncItemResult {
    match width {
        HncWidth::Whole => Ok(HncAnswer::Whole(decode_whole(bytes))),
        HncWidth::Text => Ok(HncAnswer::Text(text_of(bytes))),
        HncWidth::Real => {
            let real = bytes.first_chunk::<8>().map_or(f64::NAN, |bytes| f64::from_le_bytes(*bytes));
            if real.is_finite() {
                Ok(HncAnswer::Real(real))
            } else {
                Err(HncItemError::Malformed("not a number".to_owned()))
            }
        }
    }
}

/// Sets a value that lies in eight bytes with its sign: right however many of them the library takes.
fn write_value(name: &str, value: i64, set: impl FnOnce(&mut Guarded) -> Result<i32, Missing>) -> HncReply {
    let mut buffer = Guarded::new(8);
    buffer.write_bytes(&value.to_le_bytes());
    match set(&mut buffer) {
        Ok(0) => HncReply::Done,
        Ok(code) => HncReply::Code(name.to_owned(), HncReturnCode(code)),
        Err(Missing(name)) => HncReply::Confused(format!("the library has no {name}")),
    }
}

impl HncSession {
    fn open(library: &Path, local: (&str, u16), at: (&str, u16), long_bytes: usize) -> Result<Self, HncReply> {
        let functions = Functions::load(library).map_err(|why| HncReply::Unloadable(why.to_string()))?;
        let text = |text: &str| CString::new(text).map_err(|error| HncReply::Unloadable(error.to_string()));
        let (local_host, host) = (text(local.0)?, text(at.0)?);
        let without = |Missing(name)| HncReply::Unloadable(format!("the library has no {name}"));
        let mut session = Self { functions, client: -1, long_bytes, connected: 0, lost: 0, columns: 0 };
        match session.functions.HNC_NetInit(&local_host, local.1).map_err(without)? {
            0 => {}
            code => return Err(HncReply::Code("HNC_NetInit".to_owned(), HncReturnCode(i32::from(code)))),
        }
        match session.functions.HNC_NetConnect(&host, at.1).map_err(without)? {
            client @ 0..=254 => session.client = client,
            code => return Err(HncReply::Code("HNC_NetConnect".to_owned(), HncReturnCode(i32::from(code)))),
        }
        Ok(session)
    }

    fn report_connection(&mut self) -> HncReply {
        self.count_events();
        match self.functions.HNC_NetIsConnect(self.client) {
            Ok(code) => HncReply::Alive { code: i32::from(code), connected: self.connected, lost: self.lost },
            Err(Missing(name)) => HncReply::Confused(format!("the library has no {name}")),
        }
    }

    /// Events about the connection; others are not for us.
    fn count_events(&mut self) {
        for _ in 0..EVENTS_MAX {
            let Ok(bytes) = fill_value(EVENT_LEN, |out| self.functions.HNC_EventGetSysEv(out)) else { return };
            let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
            let (net, up, down) = NET_EVENT;
            self.connected += u64::from((word(0), word(2)) == (net, up));
            self.lost += u64::from((word(0), word(2)) == (net, down));
        }
    }

    /// Reads until an answer cannot be trusted or the link is dead.
    fn read_each(&self, items: &[HncItem], tell: &mut dyn FnMut(&HncReply)) {
        for item in items {
            let began = Instant::now();
            let result = self.read(*item);
            if began.elapsed() > DEAD_LINK {
                return tell(&HncReply::DeadLink(saturate_to_ms(began.elapsed())));
            }
            let malformed = matches!(result, Err(HncItemError::Malformed(_)));
            tell(&HncReply::Read(result));
            if malformed {
                return;
            }
        }
    }

    fn read(&self, item: HncItem) -> HncItemResult {
        let (f, c) = (&self.functions, self.client);
        match item {
            HncItem::System(kind, width) => {
                decode_value(&fill_value(VALUE_LEN, |out| f.HNC_SystemGetValue(kind, out, c))?, width)
            }
            HncItem::Channel(kind, index, width) => {
                decode_value(&fill_value(VALUE_LEN, |out| f.HNC_ChannelGetValue(kind, 0, index, out, c))?, width)
            }
            HncItem::Axis(kind, axis, width) => {
                decode_value(&fill_value(VALUE_LEN, |out| f.HNC_AxisGetValue(kind, axis, out, c))?, width)
            }
            HncItem::Register(kind, index) => {
                decode_value(&fill_value(VALUE_LEN, |out| f.HNC_RegGetValue(kind, index, out, c))?, HncWidth::Whole)
            }
            HncItem::ExternalZero(axis) => decode_value(
                &fill_value(VALUE_LEN, |out| f.HNC_CrdsGetValue(EXTERNAL_ZERO, axis, out, 0, 0, c))?,
                HncWidth::Whole,
            ),
            HncItem::Program => {
                decode_value(&fill_value(VALUE_LEN, |out| f.HNC_FprogGetFullName(0, out, c))?, HncWidth::Text)
            }
            HncItem::Alarms => self.read_alarms(),
        }
    }

    fn read_alarms(&self) -> HncItemResult {
        let (f, c) = (&self.functions, self.client);
        let count = decode_whole(&fill_value(VALUE_LEN, |out| f.HNC_AlarmGetNum(ALARM_ALL, LEVEL_ERROR, out, c))?);
        let alarm = |index| {
            let mut number = Guarded::new(8);
            let call = |text: &mut Guarded| f.HNC_AlarmGetData(ALARM_ALL, LEVEL_ERROR, index, &mut number, text, c);
            let text = fill_value(VALUE_LEN, call)?;
            let number = number.read_bytes().map_err(|overrun| HncItemError::Malformed(overrun.to_string()))?;
            Ok((decode_whole(&number), text_of(&text)))
        };
        let alarms: Result<Vec<_>, HncItemError> = (0..count.clamp(0, ALARMS_MAX)).map(alarm).collect();
        alarms.map(HncAnswer::Alarms)
    }

    fn write(&self, kind: i32, index: i32, value: i64) -> HncReply {
        let set = |value: &mut Guarded| self.functions.HNC_RegSetValue(kind, index, value, self.client);
        write_value("HNC_RegSetValue", value, set)
    }

    fn write_zero(&self, axis: i32, counts: i32) -> HncReply {
        let set = |value: &mut Guarded| self.functions.HNC_CrdsSetValue(EXTERNAL_ZERO, axis, value, 0, 0, self.client);
        write_value("HNC_CrdsSetValue", i64::from(counts), set)
    }

    /// Configures and starts the sampling channels, one millisecond each, without end.
    fn start_sampling(&mut self, items: &[SampledItem]) -> HncReply {
        let (f, c) = (&self.functions, self.client);
        let items = &items[..items.len().min(SAMPLED_MAX)];
        let count = convert_bounded(items.len(), i32::MAX);
        let configure = || -> Result<(), HncItemError> {
            check_code(f.HNC_SamplReset(c))?;
            check_code(f.HNC_SamplSetChannel(count, c))?;
            for (channel, item) in (0..).zip(items) {
                check_code(match *item {
                    SampledItem::OfAxis { kind, axis } => f.HNC_SamplSetPropertyType(channel, kind, axis, c),
                    SampledItem::OfRegister { kind, offset, length } => {
                        f.HNC_SamplSetRegType(channel, kind, offset, length, c)
                    }
                })?;
                check_code(f.HNC_SamplSetPeriod(channel, 1, c))?;
                check_code(f.HNC_SamplSetLmt(channel, 0, 0, c))?;
            }
            check_code(f.HNC_SamplTriggerOn(c))
        };
        // Channels that run already belong to somebody's oscilloscope at the panel: they are left alone.
        if matches!(f.HNC_SamplGetStat(c), Ok(1)) && self.columns == 0 {
            return HncReply::Code("HNC_SamplGetStat".to_owned(), HncReturnCode(1));
        }
        match configure() {
            Ok(()) => {
                self.columns = count;
                HncReply::Done
            }
            Err(HncItemError::Refused(code)) => {
                HncReply::Code("the sampling functions".to_owned(), HncReturnCode(code))
            }
            Err(other) => HncReply::Confused(format!("{other:?}")),
        }
    }

    fn read_samples(&self) -> HncReply {
        let mut columns = Vec::new();
        for channel in 0..self.columns {
            match self.read_column(channel) {
                Ok(values) => columns.push(values),
                Err(HncItemError::NotYet) => return HncReply::Sampled(Columns::default()),
                Err(HncItemError::Refused(code)) => {
                    return HncReply::Code("HNC_SamplGetData".to_owned(), HncReturnCode(code));
                }
                Err(other) => return HncReply::Confused(format!("{other:?}")),
            }
        }
        HncReply::Sampled(Columns { values: columns })
    }

    /// The values of one sampling channel. A count beyond what was asked for is an answer without sense.
    fn read_column(&self, channel: i32) -> Result<Vec<i32>, HncItemError> {
        let mut count = Guarded::new(8);
        count.write_bytes(&length_to_i64(POINTS_MAX).to_le_bytes());
        let call = |out: &mut Guarded| self.functions.HNC_SamplGetData(channel, &mut count, out, self.client);
        let bytes = fill_value(POINTS_MAX * self.long_bytes, call)?;
        let count = count.read_bytes().map_err(|overrun| HncItemError::Malformed(overrun.to_string()))?;
        let found = usize::try_from(decode_whole(&count)).ok().filter(|found| *found <= POINTS_MAX);
        let found = found.ok_or_else(|| HncItemError::Malformed(format!("{} points", decode_whole(&count))))?;
        Ok(bytes.chunks_exact(self.long_bytes).take(found).map(decode_whole).collect())
    }
}
