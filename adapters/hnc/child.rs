//! The child's side: one session, items to calls.

use super::answer::{Answer, ItemError, ItemResult, ReturnCode};
use super::decode::text_of;
use super::ffi::Functions;
use super::item::{EXTERNAL_ZERO, Item, Width};
use super::line::DEAD_LINK;
use super::message::{Ask, Tell};
use super::sampling::{Columns, POINTS_MAX, SAMPLED_MAX, SampledItem};
use crate::child::{Guarded, Missing, serve_words};
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
pub fn child() -> std::io::Result<()> {
    let mut session: Option<Session> = None;
    serve_words(|ask: Result<Ask, String>, tell| match (ask, &session) {
        (Ok(Ask::Read(items)), Some(session)) => session.read_each(&items, tell),
        (Ok(ask), _) => tell(&answer(&mut session, ask)),
        (Err(confused), _) => tell(&Tell::Confused(confused)),
    })
}

fn answer(session: &mut Option<Session>, ask: Ask) -> Tell {
    if let Ask::Open { vendor_library, local_host, local_port, host, port, long_bytes } = ask {
        // The library's own connections are global: an old session goes before a new one.
        *session = None;
        let opened = Session::open(&vendor_library, (&local_host, local_port), (&host, port), long_bytes);
        return match opened {
            Ok(opened) => {
                *session = Some(opened);
                Tell::Opened
            }
            Err(told) => told,
        };
    }
    let Some(session) = session else { return Tell::Confused("there is no connection".to_owned()) };
    match ask {
        Ask::Alive => session.alive(),
        Ask::Write(kind, index, value) => session.write(kind, index, value),
        Ask::WriteZero(axis, counts) => session.write_zero(axis, counts),
        Ask::Sample(items) => session.sample(&items),
        Ask::Sampled => session.sampled(),
        Ask::Open { .. } | Ask::Read(_) => Tell::Confused("not on this connection".to_owned()),
    }
}

struct Session {
    functions: Functions,
    client: i16,
    long_bytes: usize,
    connected: u64,
    lost: u64,
    columns: i32,
}

impl Drop for Session {
    fn drop(&mut self) {
        if self.columns > 0 {
            let _without = self.functions.HNC_SamplTriggerOff(self.client);
        }
        self.functions.exit();
    }
}

fn checked(code: Result<i32, Missing>) -> Result<(), ItemError> {
    match code.map_err(|_| ItemError::NotOffered)? {
        0 => Ok(()),
        1 => Err(ItemError::NotYet),
        code => Err(ItemError::Refused(code)),
    }
}

/// A value that a call fills in; on any code but 0 nothing of it is looked at.
fn filled(length: usize, call: impl FnOnce(&mut Guarded) -> Result<i32, Missing>) -> Result<Vec<u8>, ItemError> {
    let mut buffer = Guarded::new(length);
    checked(call(&mut buffer))?;
    buffer.bytes().map_err(|overrun| ItemError::Malformed(overrun.to_string()))
}

fn whole(bytes: &[u8]) -> i32 {
    bytes.first_chunk::<4>().map_or(0, |low| i32::from_le_bytes(*low))
}

fn value(bytes: &[u8], width: Width) -> ItemResult {
    match width {
        Width::Whole => Ok(Answer::Whole(whole(bytes))),
        Width::Text => Ok(Answer::Text(text_of(bytes))),
        Width::Real => {
            let real = bytes.first_chunk::<8>().map_or(f64::NAN, |bytes| f64::from_le_bytes(*bytes));
            if real.is_finite() { Ok(Answer::Real(real)) } else { Err(ItemError::Malformed("not a number".to_owned())) }
        }
    }
}

/// Sets a value that lies in eight bytes with its sign: right however many of them the library takes.
fn written(name: &str, value: i64, set: impl FnOnce(&mut Guarded) -> Result<i32, Missing>) -> Tell {
    let mut buffer = Guarded::new(8);
    buffer.put(&value.to_le_bytes());
    match set(&mut buffer) {
        Ok(0) => Tell::Done,
        Ok(code) => Tell::Code(name.to_owned(), ReturnCode(code)),
        Err(Missing(name)) => Tell::Confused(format!("the library has no {name}")),
    }
}

impl Session {
    fn open(library: &Path, local: (&str, u16), at: (&str, u16), long_bytes: usize) -> Result<Self, Tell> {
        let functions = Functions::load(library).map_err(Tell::Unloadable)?;
        let text = |text: &str| CString::new(text).map_err(|error| Tell::Unloadable(error.to_string()));
        let (local_host, host) = (text(local.0)?, text(at.0)?);
        let without = |Missing(name)| Tell::Unloadable(format!("the library has no {name}"));
        let mut session = Self { functions, client: -1, long_bytes, connected: 0, lost: 0, columns: 0 };
        match session.functions.HNC_NetInit(&local_host, local.1).map_err(without)? {
            0 => {}
            code => return Err(Tell::Code("HNC_NetInit".to_owned(), ReturnCode(i32::from(code)))),
        }
        match session.functions.HNC_NetConnect(&host, at.1).map_err(without)? {
            client @ 0..=254 => session.client = client,
            code => return Err(Tell::Code("HNC_NetConnect".to_owned(), ReturnCode(i32::from(code)))),
        }
        Ok(session)
    }

    fn alive(&mut self) -> Tell {
        self.events();
        match self.functions.HNC_NetIsConnect(self.client) {
            Ok(code) => Tell::Alive { code: i32::from(code), connected: self.connected, lost: self.lost },
            Err(Missing(name)) => Tell::Confused(format!("the library has no {name}")),
        }
    }

    /// Events about the connection; others are not for us.
    fn events(&mut self) {
        for _ in 0..EVENTS_MAX {
            let Ok(bytes) = filled(EVENT_LEN, |out| self.functions.HNC_EventGetSysEv(out)) else { return };
            let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
            let (net, up, down) = NET_EVENT;
            self.connected += u64::from((word(0), word(2)) == (net, up));
            self.lost += u64::from((word(0), word(2)) == (net, down));
        }
    }

    /// Reads until an answer cannot be trusted or the link is dead.
    fn read_each(&self, items: &[Item], tell: &mut dyn FnMut(&Tell)) {
        for item in items {
            let began = Instant::now();
            let result = self.read(*item);
            if began.elapsed() > DEAD_LINK {
                return tell(&Tell::DeadLink(u64::try_from(began.elapsed().as_millis()).unwrap_or(u64::MAX)));
            }
            let malformed = matches!(result, Err(ItemError::Malformed(_)));
            tell(&Tell::Read(result));
            if malformed {
                return;
            }
        }
    }

    fn read(&self, item: Item) -> ItemResult {
        let (f, c) = (&self.functions, self.client);
        match item {
            Item::System(kind, width) => value(&filled(VALUE_LEN, |out| f.HNC_SystemGetValue(kind, out, c))?, width),
            Item::Channel(kind, index, width) => {
                value(&filled(VALUE_LEN, |out| f.HNC_ChannelGetValue(kind, 0, index, out, c))?, width)
            }
            Item::Axis(kind, axis, width) => {
                value(&filled(VALUE_LEN, |out| f.HNC_AxisGetValue(kind, axis, out, c))?, width)
            }
            Item::Register(kind, index) => {
                value(&filled(VALUE_LEN, |out| f.HNC_RegGetValue(kind, index, out, c))?, Width::Whole)
            }
            Item::ExternalZero(axis) => {
                value(&filled(VALUE_LEN, |out| f.HNC_CrdsGetValue(EXTERNAL_ZERO, axis, out, 0, 0, c))?, Width::Whole)
            }
            Item::Program => value(&filled(VALUE_LEN, |out| f.HNC_FprogGetFullName(0, out, c))?, Width::Text),
            Item::Alarms => self.alarms(),
        }
    }

    fn alarms(&self) -> ItemResult {
        let (f, c) = (&self.functions, self.client);
        let count = whole(&filled(VALUE_LEN, |out| f.HNC_AlarmGetNum(ALARM_ALL, LEVEL_ERROR, out, c))?);
        let alarm = |index| {
            let mut number = Guarded::new(8);
            let call = |text: &mut Guarded| f.HNC_AlarmGetData(ALARM_ALL, LEVEL_ERROR, index, &mut number, text, c);
            let text = filled(VALUE_LEN, call)?;
            let number = number.bytes().map_err(|overrun| ItemError::Malformed(overrun.to_string()))?;
            Ok((whole(&number), text_of(&text)))
        };
        let alarms: Result<Vec<_>, ItemError> = (0..count.clamp(0, ALARMS_MAX)).map(alarm).collect();
        alarms.map(Answer::Alarms)
    }

    fn write(&self, kind: i32, index: i32, value: i64) -> Tell {
        let set = |value: &mut Guarded| self.functions.HNC_RegSetValue(kind, index, value, self.client);
        written("HNC_RegSetValue", value, set)
    }

    fn write_zero(&self, axis: i32, counts: i32) -> Tell {
        let set = |value: &mut Guarded| self.functions.HNC_CrdsSetValue(EXTERNAL_ZERO, axis, value, 0, 0, self.client);
        written("HNC_CrdsSetValue", i64::from(counts), set)
    }

    /// Configures and starts the sampling channels, one millisecond each, without end.
    fn sample(&mut self, items: &[SampledItem]) -> Tell {
        let (f, c) = (&self.functions, self.client);
        let items = &items[..items.len().min(SAMPLED_MAX)];
        let count = i32::try_from(items.len()).unwrap_or(0);
        let configure = || -> Result<(), ItemError> {
            checked(f.HNC_SamplReset(c))?;
            checked(f.HNC_SamplSetChannel(count, c))?;
            for (channel, item) in (0..).zip(items) {
                checked(match *item {
                    SampledItem::OfAxis { kind, axis } => f.HNC_SamplSetPropertyType(channel, kind, axis, c),
                    SampledItem::OfRegister { kind, offset, length } => {
                        f.HNC_SamplSetRegType(channel, kind, offset, length, c)
                    }
                })?;
                checked(f.HNC_SamplSetPeriod(channel, 1, c))?;
                checked(f.HNC_SamplSetLmt(channel, 0, 0, c))?;
            }
            checked(f.HNC_SamplTriggerOn(c))
        };
        // Channels that run already belong to somebody's oscilloscope at the panel: they are left alone.
        if matches!(f.HNC_SamplGetStat(c), Ok(1)) && self.columns == 0 {
            return Tell::Code("HNC_SamplGetStat".to_owned(), ReturnCode(1));
        }
        match configure() {
            Ok(()) => {
                self.columns = count;
                Tell::Done
            }
            Err(ItemError::Refused(code)) => Tell::Code("the sampling functions".to_owned(), ReturnCode(code)),
            Err(other) => Tell::Confused(format!("{other:?}")),
        }
    }

    fn sampled(&self) -> Tell {
        let mut columns = Vec::new();
        for channel in 0..self.columns {
            match self.column(channel) {
                Ok(values) => columns.push(values),
                Err(ItemError::NotYet) => return Tell::Sampled(Columns::default()),
                Err(ItemError::Refused(code)) => {
                    return Tell::Code("HNC_SamplGetData".to_owned(), ReturnCode(code));
                }
                Err(other) => return Tell::Confused(format!("{other:?}")),
            }
        }
        Tell::Sampled(Columns { values: columns })
    }

    /// The values of one sampling channel. A count beyond what was asked for is an answer without sense.
    fn column(&self, channel: i32) -> Result<Vec<i32>, ItemError> {
        let wanted = i32::try_from(POINTS_MAX).unwrap_or(i32::MAX);
        let mut count = Guarded::new(8);
        count.put(&i64::from(wanted).to_le_bytes());
        let call = |out: &mut Guarded| self.functions.HNC_SamplGetData(channel, &mut count, out, self.client);
        let bytes = filled(POINTS_MAX * self.long_bytes, call)?;
        let count = count.bytes().map_err(|overrun| ItemError::Malformed(overrun.to_string()))?;
        let found = usize::try_from(whole(&count)).ok().filter(|found| *found <= POINTS_MAX);
        let found = found.ok_or_else(|| ItemError::Malformed(format!("{} points", whole(&count))))?;
        Ok(bytes.chunks_exact(self.long_bytes).take(found).map(whole).collect())
    }
}
