//! Feed hold and stop, asked of the ladder through a byte of its data.
//!
//! The gateway switches a bit on, the ladder latches it in the byte behind and shows it there until the operator has
//! acknowledged, and the gateway switches the bit off again. So a request counts once however often it is sent, a line
//! that breaks in between leaves nothing that asks a second time, and a ladder without the rungs is found out.

use super::answer::FocasAnswer;
use super::item::{Area, FocasItem, Stretch, Write};
use super::ladder::request_bit;
use super::line::FanucLine;
use adapter_core::clock::Clock;
use adapter_core::driver::{LadderRequest, SEE_DOCTOR, SourceError};

/// The ladder is looked at this often before it counts as silent.
const LOOKS: u8 = 3;

/// The way to the ladder's requests.
pub(super) struct Asking {
    name: String,
    line: FanucLine,
    address: (Area, u16),
    settle_ns: i64,
    /// May a bit of ours still be on?
    is_on: bool,
}

impl Asking {
    /// `at` is the gateway's byte; the ladder's is the next one.
    pub(super) fn new(name: &str, line: FanucLine, at: (Area, u16), settle_ns: i64) -> Self {
        Self { name: name.to_owned(), line, address: at, settle_ns, is_on: false }
    }

    /// Asks, and waits until the ladder has latched it. What is latched already is asked for no second time.
    ///
    /// # Errors
    /// The line, or a ladder that does not latch it.
    pub(super) fn ask_ladder(&mut self, clock: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        let bit = i32::from(request_bit(request));
        let (on, latched) = self.read_request_bytes(clock, request)?;
        if latched & bit != 0 {
            return self.withdraw_request(clock);
        }
        if on != 0 {
            // Left over from before: a bit has to come on to count.
            self.write_request_bits(clock, 0)?;
            self.wait_for_scans(clock);
        }
        self.write_request_bits(clock, bit)?;
        let taken = self.is_taken(clock, request, bit);
        self.withdraw_request(clock)?;
        if taken? { Ok(()) } else { Err(self.build_silence_error(request)) }
    }

    /// Switches off what may still be on.
    ///
    /// # Errors
    /// The line.
    pub(super) fn withdraw_request(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        if self.is_on { self.write_request_bits(clock, 0) } else { Ok(()) }
    }

    fn is_taken(&self, clock: &dyn Clock, request: LadderRequest, bit: i32) -> Result<bool, SourceError> {
        for _ in 0..LOOKS {
            self.wait_for_scans(clock);
            if self.read_request_bytes(clock, request)?.1 & bit != 0 {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Several scans of the ladder.
    fn wait_for_scans(&self, clock: &dyn Clock) {
        clock.sleep_until(clock.now_ns().saturating_add(self.settle_ns));
    }

    /// The gateway's byte and the ladder's.
    fn read_request_bytes(&self, clock: &dyn Clock, request: LadderRequest) -> Result<(i32, i32), SourceError> {
        let item = FocasItem::Pmc(Stretch::from_byte_range(self.address.0, self.address.1, 2));
        match self.line.ask_items(clock, &[item])?.find_item_result(item) {
            Some(Ok(FocasAnswer::Memory(bytes))) if bytes.len() == 2 => Ok((bytes[0], bytes[1])),
            Some(Err(error)) => {
                Err(self.build_refusal(request, format!("its bytes cannot be read: {error}"), error.next()))
            }
            _ => Err(self.build_refusal(
                request,
                "its bytes cannot be read: another kind of answer".to_owned(),
                SEE_DOCTOR,
            )),
        }
    }

    fn write_request_bits(&mut self, clock: &dyn Clock, bits: i32) -> Result<(), SourceError> {
        // Unknown until the answer is there.
        self.is_on = true;
        self.line.write(
            clock,
            &Write::Pmc { stretch: Stretch::from_byte_range(self.address.0, self.address.1, 1), values: vec![bits] },
        )?;
        self.is_on = bits != 0;
        Ok(())
    }

    fn build_silence_error(&self, request: LadderRequest) -> SourceError {
        let (area, at) = (self.address.0.letter(), self.address.1);
        let what = format!("no rung latches the bit of {area}{at} in {area}{}", at.saturating_add(1));
        self.build_refusal(request, what, "Let the machine's maker add the rungs, or compare request= with the ladder")
    }

    fn build_refusal(&self, request: LadderRequest, what: String, next: &str) -> SourceError {
        SourceError::Refused {
            source_name: self.name.clone(),
            request: request.as_word().to_owned(),
            what,
            next: next.to_owned(),
        }
    }
}
