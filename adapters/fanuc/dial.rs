//! The byte in which the operator's dial of the feed override stands.
//!
//! Where the ladder does not touch G012 on behalf of the gateway (second override, macro variable), G012 is the dial.
//! Where a mailbox is in use, G012 is what the ladder has made of dial and mailbox, and the machine's maker has to leave
//! the dial alone in another byte: the sample ladder leaves it in R907, in percent.

use super::feed_override;
use super::item::{Area, Stretch};
use adapter_core::override_pct::OverridePct;

/// A byte of PMC memory with the dial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dial {
    /// Its area. Signals to the control (G) are coded like G012, inverted; every other area holds plain percent.
    pub area: Area,
    /// Address of the byte within its area.
    pub at: u16,
}

impl Dial {
    /// `R907` or `G12`: the ladder's data, or an override signal.
    #[must_use]
    pub fn from_text(text: &str) -> Option<Self> {
        let mut letters = text.chars();
        let area = Area::of_letter(letters.next()?)?;
        let at = letters.as_str().parse().ok().filter(|at| *at < 60_000)?;
        matches!(area, Area::G | Area::R | Area::D | Area::E).then_some(Self { area, at })
    }

    /// What has to be read.
    #[must_use]
    pub fn to_stretch(self) -> Stretch {
        Stretch::from_byte_range(self.area, self.at, 1)
    }

    /// The dial from what was read; `None` when the byte is no override.
    #[must_use]
    pub fn read(self, bytes: &[i32]) -> Option<OverridePct> {
        let byte = bytes.first().and_then(|byte| u8::try_from(*byte).ok())?;
        if self.area == Area::G { Some(feed_override::decode(byte)) } else { OverridePct::new(byte) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coding_follows_the_area() {
        let read = |text: &str, byte| Dial::from_text(text).expect("usable").read(&[byte]).map(OverridePct::percent);
        assert_eq!(read("R907", 80), Some(80));
        assert_eq!(read("G12", 0xAF), Some(80));
        assert_eq!(read("d20", 255), None, "no percent");
        assert_eq!(Dial { area: Area::R, at: 1 }.read(&[]), None);
        for wrong in ["", "R", "X10", "F12", "G-1", "R70000", "12"] {
            assert_eq!(Dial::from_text(wrong), None, "{wrong}");
        }
    }
}
