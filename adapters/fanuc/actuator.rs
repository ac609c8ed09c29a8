//! The feed override of a FANUC machine, written in the way that the address names. Only the gate may hold one.
//!
//! | way | what is written | what says that it is in force |
//! |---|---|---|
//! | mailbox | three bytes: 0xA5, percent, heartbeat | the ladder's byte +3, with its state in +4 |
//! | second override | one byte, percent | G013 |
//! | macro | a custom macro variable, percent | the variable |
//! | direct | G012, inverted | G012, after the ladder had its scans |
//!
//! Where the address names the byte with the operator's dial, what is in force is what the control obeys: G012, with the
//! second override or a macro variable its product with that. Feed hold and stop go through a byte of their own, see
//! `ladder_request`. Mailbox and requests are laid out in [`ladder`](super::ladder); the crate `fanuc_server` has the rungs
//! that a machine's maker needs.
//! Nothing is looked at sooner than the settling time after a write: a return code 0 says that a byte has arrived, not
//! that the ladder left it there.

use super::answer::{FocasAnswer, FocasItemResult};
use super::dial::Dial;
use super::feed_override;
use super::item::{Area, FocasItem, Stretch, Write};
use super::ladder::ENABLED;
use super::ladder_request::Asking;
use super::line::{Asked, FanucLine};
use super::poll::find_signal_address;
use crate::address::{FanucOptions, WriteMethod};
use adapter_core::clock::{Clock, TimeNs};
use adapter_core::driver::{Actuator, LadderRequest, LadderRule, SourceError};
use adapter_core::integer::{convert_bounded, saturate_to_ns};
use adapter_core::override_pct::OverridePct;
use std::time::Duration;

/// States of a mailbox, as the ladder's byte +4 tells them.
const TAKEN: [i32; 2] = [1, 3];
const HEARTBEAT_LOST: i32 = 2;

/// Whether the enable byte of a way of writing is on.
type IsLeftOn = fn(i32) -> bool;

/// The way to the feed override of one path.
pub struct FanucActuator {
    name: String,
    line: FanucLine,
    path: u8,
    method: WriteMethod,
    dial: Option<Dial>,
    asking: Option<Asking>,
    settle_ns: i64,
    heartbeat: u8,
    written: Option<(OverridePct, TimeNs)>,
    /// What was in force before the first write; a direct write is taken back to it.
    before: Option<OverridePct>,
    /// The dial that came in the same frame as the last override.
    beside: Option<(OverridePct, TimeNs)>,
}

/// A dial that came with an override stands for a look at the dial this long.
const BESIDE_NS: i64 = 100_000_000;

impl FanucActuator {
    /// `None` when the address names no way of writing.
    #[must_use]
    pub fn new(name: &str, line: FanucLine, path: u8, options: &FanucOptions) -> Option<Self> {
        let settle_ns = saturate_to_ns(options.settle);
        let asking = options.request.map(|at| Asking::new(name, line.clone(), at, settle_ns));
        let (name, method, dial) = (name.to_owned(), options.write, options.dial);
        let (heartbeat, written, before, beside) = (0, None, None, None);
        let actuator = Self { name, line, path, method, dial, asking, settle_ns, heartbeat, written, before, beside };
        (method != WriteMethod::None).then_some(actuator)
    }

    fn build_write(&mut self, wanted: OverridePct) -> Result<Write, SourceError> {
        let percent = i32::from(wanted.percent());
        let bytes = |area, at, values: Vec<i32>| {
            let count = convert_bounded(values.len(), u16::MAX);
            Write::Pmc { stretch: Stretch::from_byte_range(area, at, count), values }
        };
        Ok(match self.method {
            WriteMethod::Mailbox { area, at } => {
                self.heartbeat = self.heartbeat.wrapping_add(1);
                bytes(area, at, vec![i32::from(ENABLED), percent, i32::from(self.heartbeat)])
            }
            WriteMethod::SecondOverride { area, at } if percent > 0 => bytes(area, at, vec![percent]),
            WriteMethod::SecondOverride { .. } => {
                let what = "0 % cannot be asked for: 0 in this byte means no request";
                return Err(self.build_refusal(what, "Stop the feed with feed hold, on the machine"));
            }
            WriteMethod::Macro { variable } => Write::Macro { number: variable, mantissa: percent, places: 0 },
            WriteMethod::Direct => bytes(
                Area::G,
                find_signal_address(feed_override::AT, self.path),
                vec![i32::from(feed_override::encode(wanted))],
            ),
            WriteMethod::None => {
                return Err(self.build_refusal("no way of writing", "Write write=mailbox in the address"));
            }
        })
    }

    fn build_read_item(&self) -> FocasItem {
        match self.method {
            WriteMethod::Mailbox { area, at } => FocasItem::Pmc(Stretch::from_byte_range(area, at, 5)),
            WriteMethod::SecondOverride { .. } => self.build_signal_item(feed_override::SECOND_AT),
            WriteMethod::Macro { variable } => FocasItem::Macro(variable),
            WriteMethod::Direct | WriteMethod::None => self.build_signal_item(feed_override::AT),
        }
    }

    /// A byte of override signals of this path.
    fn build_signal_item(&self, at: u16) -> FocasItem {
        FocasItem::Pmc(Stretch::from_byte_range(Area::G, find_signal_address(at, self.path), 1))
    }

    fn give_back(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        let write = match self.method {
            WriteMethod::Mailbox { area, at } => {
                self.heartbeat = self.heartbeat.wrapping_add(1);
                let values = vec![0, i32::from(OverridePct::FULL.percent()), i32::from(self.heartbeat)];
                Write::Pmc { stretch: Stretch::from_byte_range(area, at, 3), values }
            }
            WriteMethod::SecondOverride { area, at } => {
                Write::Pmc { stretch: Stretch::from_byte_range(area, at, 1), values: vec![0] }
            }
            // Where the ladder writes G012 in every scan this changes nothing; elsewhere it is where the dial was.
            WriteMethod::Direct => self.build_write(self.before.unwrap_or(OverridePct::FULL))?,
            WriteMethod::Macro { .. } | WriteMethod::None => self.build_write(OverridePct::FULL)?,
        };
        self.line.write(clock, &write)?;
        self.written = None;
        Ok(())
    }

    /// The byte that an earlier run may have left on, and what it holds then.
    fn find_leftover(&self) -> Option<(FocasItem, IsLeftOn)> {
        match self.method {
            WriteMethod::Mailbox { area, at } => {
                Some((FocasItem::Pmc(Stretch::from_byte_range(area, at, 1)), |byte| byte == i32::from(ENABLED)))
            }
            WriteMethod::SecondOverride { area, at } => {
                Some((FocasItem::Pmc(Stretch::from_byte_range(area, at, 1)), |byte| byte != 0))
            }
            WriteMethod::Macro { .. } | WriteMethod::Direct | WriteMethod::None => None,
        }
    }

    /// What the way of writing itself says.
    fn decode_override(&self, asked: &Asked, item: FocasItem) -> Result<OverridePct, SourceError> {
        match (asked.find_item_result(item), self.method) {
            (Some(Ok(FocasAnswer::Memory(bytes))), WriteMethod::Mailbox { .. }) => self.of_mailbox(bytes),
            (Some(Ok(FocasAnswer::Memory(_))), WriteMethod::SecondOverride { .. }) => self.override_of(asked, item),
            (Some(Ok(FocasAnswer::Memory(bytes))), _) => self.of_direct(bytes.first().copied().unwrap_or(-1)),
            // A vacant variable asks for nothing.
            (Some(Ok(FocasAnswer::Number(None))), _) => Ok(OverridePct::FULL),
            (Some(Ok(FocasAnswer::Number(Some(value)))), _) => self.convert_percent(*value),
            (other, _) => Err(self.build_unread_error(other)),
        }
    }

    fn find_bytes<'a>(&self, asked: &'a Asked, item: FocasItem) -> Result<&'a [i32], SourceError> {
        match asked.find_item_result(item) {
            Some(Ok(FocasAnswer::Memory(bytes))) => Ok(bytes),
            other => Err(self.build_unread_error(other)),
        }
    }

    /// It was asked for, and this came.
    fn build_unread_error(&self, found: Option<&FocasItemResult>) -> SourceError {
        match found {
            Some(Err(error)) => self.build_refusal(&format!("it cannot be read back: {error}"), error.next()),
            _ => self.build_decode_error("another kind of answer"),
        }
    }

    /// The dial, where it was asked for.
    fn dial_of(&self, asked: &Asked) -> Result<OverridePct, SourceError> {
        let none = || self.build_decode_error("the byte of the dial is no override");
        let dial = self.dial.ok_or_else(none)?;
        dial.read(self.find_bytes(asked, FocasItem::Pmc(dial.to_stretch()))?).ok_or_else(none)
    }

    fn override_of(&self, asked: &Asked, item: FocasItem) -> Result<OverridePct, SourceError> {
        let byte = self.find_bytes(asked, item)?.first().and_then(|byte| u8::try_from(*byte).ok());
        byte.map(feed_override::decode).ok_or_else(|| self.build_decode_error("an override signal is a byte"))
    }

    fn build_refusal(&self, what: &str, next: &str) -> SourceError {
        SourceError::Refused {
            source_name: self.name.clone(),
            request: "the feed override".to_owned(),
            what: what.to_owned(),
            next: next.to_owned(),
        }
    }

    fn build_decode_error(&self, what: &str) -> SourceError {
        SourceError::Decode {
            source_name: self.name.clone(),
            request: "the feed override".to_owned(),
            what: what.to_owned(),
        }
    }

    /// The override that the ladder says it has taken.
    fn of_mailbox(&self, bytes: &[i32]) -> Result<OverridePct, SourceError> {
        let [enabled, _, _, taken, state] = *bytes else {
            return Err(self.build_decode_error("the mailbox has five bytes"));
        };
        let asked = enabled == i32::from(ENABLED) && self.written.is_some();
        if asked && state == HEARTBEAT_LOST {
            let what = "not held: the ladder misses the heartbeat";
            return Err(self.build_refusal(what, "The gateway writes too seldom; look at the load of box and network"));
        }
        if asked && !TAKEN.contains(&state) {
            let what = "not held: no ladder reads the mailbox";
            let next = "Let the machine's maker add the rungs, or compare the mailbox's address with the ladder";
            return Err(self.build_refusal(what, next));
        }
        let taken = u8::try_from(taken).ok().and_then(OverridePct::new);
        if !asked && state == 0 {
            return Ok(OverridePct::FULL);
        }
        taken.ok_or_else(|| self.build_decode_error("the ladder's byte is no override"))
    }

    fn of_direct(&self, byte: i32) -> Result<OverridePct, SourceError> {
        let byte = u8::try_from(byte).map_err(|_| self.build_decode_error("G012 is a byte"))?;
        let found = feed_override::decode(byte);
        match self.written {
            Some((asked, _)) if asked != found => {
                let what = format!("not held: {asked} was written to G012 and the ladder made it {found}");
                Err(self.build_refusal(&what, "Write through a mailbox (write=mailbox); the ladder owns G012"))
            }
            _ => Ok(found),
        }
    }

    fn convert_percent(&self, value: f64) -> Result<OverridePct, SourceError> {
        OverridePct::from_nearest_percent(value)
            .ok_or_else(|| self.build_decode_error(&format!("{value} is no override")))
    }
}

impl Actuator for FanucActuator {
    fn name(&self) -> &str {
        &self.name
    }

    fn write_feed_override(&mut self, clock: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        let write = self.build_write(wanted)?;
        self.line.write(clock, &write)?;
        self.written = Some((wanted, clock.now_ns()));
        Ok(())
    }

    fn read_feed_override(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError> {
        if let Some((_, at_ns)) = self.written {
            clock.sleep_until(at_ns.saturating_add(self.settle_ns));
        }
        let (own, obeyed) = (self.build_read_item(), self.build_signal_item(feed_override::AT));
        let dial = self.dial.map(|dial| FocasItem::Pmc(dial.to_stretch()));
        let items: Vec<FocasItem> = [own].into_iter().chain(dial.into_iter().flat_map(|dial| [obeyed, dial])).collect();
        let asked = self.line.ask_items(clock, &items)?;
        let told = self.decode_override(&asked, own)?;
        if self.written.is_none() {
            self.before = Some(told);
        }
        self.beside = self.dial_of(&asked).ok().zip(Some(asked.ended_ns));
        match (self.dial, self.method) {
            (None, _) | (Some(_), WriteMethod::Direct | WriteMethod::None) => Ok(told),
            (Some(_), WriteMethod::Mailbox { .. }) => self.override_of(&asked, obeyed),
            (Some(_), WriteMethod::SecondOverride { .. } | WriteMethod::Macro { .. }) => {
                Ok(LadderRule::Product.combine_overrides(self.override_of(&asked, obeyed)?, told))
            }
        }
    }

    fn read_dial(&mut self, clock: &dyn Clock) -> Result<Option<OverridePct>, SourceError> {
        let Some(dial) = self.dial else { return Ok(None) };
        if let Some((beside, at_ns)) = self.beside.take()
            && clock.now_ns() - at_ns <= BESIDE_NS
        {
            return Ok(Some(beside));
        }
        let asked = self.line.ask_items(clock, &[FocasItem::Pmc(dial.to_stretch())])?;
        self.dial_of(&asked).map(Some)
    }

    fn ask_ladder(&mut self, clock: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        match &mut self.asking {
            Some(asking) => asking.ask_ladder(clock, request),
            None => Err(SourceError::Refused {
                source_name: self.name.clone(),
                request: request.as_word().to_owned(),
                what: "the address names no byte for it".to_owned(),
                next: "Let the machine's maker add the rungs and write request=R905 in the address".to_owned(),
            }),
        }
    }

    /// The mailbox says that nobody asks, the second override's byte that there is no request; the others get 100 %.
    fn release_override(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        let released = self.give_back(clock);
        let withdrawn = self.asking.as_mut().map_or(Ok(()), |asking| asking.withdraw_request(clock));
        released.and(withdrawn)
    }

    fn withdraw_leftover(&mut self, clock: &dyn Clock) -> Result<bool, SourceError> {
        let Some((item, is_left)) = self.find_leftover() else { return Ok(false) };
        let asked = self.line.ask_items(clock, &[item])?;
        let left = self.find_bytes(&asked, item)?.first().copied().is_some_and(is_left);
        if left {
            self.give_back(clock)?;
        }
        Ok(left)
    }

    fn settles_within(&self) -> Duration {
        Duration::from_nanos(self.settle_ns.unsigned_abs()).max(Duration::from_secs(1))
    }
}
