//! CRC-16 of an RTU frame.
//!
//! Source: Modbus over Serial Line 1.02, 6.2.2: polynomial 0xA001 reflected, start 0xFFFF, low byte first on the wire.

/// The check of these bytes, low byte first.
#[must_use]
pub(super) fn compute_crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xFFFF_u16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xA001 } else { crc >> 1 };
        }
    }
    crc.to_le_bytes()
}

/// Does the frame end in its check?
#[must_use]
pub(super) fn is_whole(frame: &[u8]) -> bool {
    frame.len() >= 4 && frame.split_last_chunk::<2>().is_some_and(|(body, check)| compute_crc(body) == *check)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_of_the_specification() {
        // The specification's example: 02 07 has the CRC 1241 hex, sent as 41 12.
        assert_eq!(compute_crc(&[0x02, 0x07]), [0x41, 0x12]);
        assert!(is_whole(&[0x02, 0x07, 0x41, 0x12]) && !is_whole(&[0x02, 0x07, 0x41, 0x13]) && !is_whole(&[]));
    }
}
