//! The feed override byte `*FV0` to `*FV7` at G012: every bit is inverted.
//!
//! B-63943EN-1, "Override signals": the override is the sum of 2^i V_i percent with V_i = 1 when `*FV`i is 0. All bits
//! 0 count like all bits 1: 0 %. A wrong byte is a feed hold in the middle of a cut, so this is the only place that
//! makes one.

use adapter_core::override_pct::OverridePct;

/// Address of the byte in the G area, of the first path.
pub const AT: u16 = 12;

/// Address of the second override in the G area, `*AFV0` to `*AFV7`, coded in the same way.
pub const SECOND_AT: u16 = 13;

/// The byte for an override. 0 % is 0xFF; no override makes the byte 0x00, which would be 0 % too.
#[must_use]
pub fn encode(wanted: OverridePct) -> u8 {
    !wanted.percent()
}

/// The override that a byte stands for.
#[must_use]
pub fn decode(byte: u8) -> OverridePct {
    // 0x00 inverted is 255, which does not exist: the control takes it for 0 %.
    OverridePct::new(!byte).or(OverridePct::new(0)).unwrap_or(OverridePct::FULL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_override_survives_its_byte() {
        let mut seen = std::collections::BTreeSet::new();
        for percent in 0..=254 {
            let wanted = OverridePct::new(percent).expect("exists");
            let byte = encode(wanted);
            let by_bits: u32 = (0..8).map(|bit| (1 - u32::from(byte >> bit & 1)) << bit).sum();
            assert_eq!(by_bits, u32::from(percent), "the sum of the inverted bits");
            assert_eq!(decode(byte), wanted);
            assert!(byte != 0x00 && (byte != 0xFF || percent == 0));
            assert!(seen.insert(byte));
        }
        assert_eq!(decode(0x00).percent(), 0, "all bits 0 count like all bits 1");
        assert_eq!((encode(OverridePct::FULL), decode(0x9B)), (0x9B, OverridePct::FULL));
    }
}
