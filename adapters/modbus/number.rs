//! Registers to numbers and back.
//!
//! A register is 16 bits, high byte first (Modbus Application Protocol 1.1b3, 4.2). How two or four of them make a number
//! is the meter's own choice.

use adapter_core::integer::{take_low_u16, take_low_u32};
use serde::Deserialize;

/// How a number lies in registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// One register without sign.
    U16,
    /// One register, two's complement.
    I16,
    /// One register, the highest bit is the sign.
    Sm16,
    /// Two registers without sign.
    U32,
    /// Two registers, two's complement.
    I32,
    /// Two registers, the highest bit is the sign.
    Sm32,
    /// Two registers, IEEE 754.
    F32,
    /// Four registers, two's complement.
    I64,
    /// Four registers, IEEE 754.
    F64,
}

/// In which order the bytes of a number come; A is the highest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WordOrder {
    /// ABCD: the high word first, its high byte first.
    #[default]
    #[serde(alias = "abcd")]
    Big,
    /// CDAB: the low word first, the high byte of each first.
    #[serde(alias = "cdab")]
    Little,
    /// BADC: the high word first, the low byte of each first.
    Badc,
    /// DCBA: the low word first, the low byte of each first.
    Dcba,
}

impl WordOrder {
    /// The order of this name, as a profile writes it.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Some(match name {
            "big" | "abcd" => Self::Big,
            "little" | "cdab" => Self::Little,
            "badc" => Self::Badc,
            "dcba" => Self::Dcba,
            _ => return None,
        })
    }

    /// A register with its high byte first.
    fn to_big_endian(self, register: u16) -> u16 {
        if matches!(self, Self::Badc | Self::Dcba) { register.swap_bytes() } else { register }
    }

    fn low_word_first(self) -> bool {
        matches!(self, Self::Little | Self::Dcba)
    }
}

impl Format {
    /// Registers that a number takes, 1 to 4.
    #[must_use]
    pub fn register_count(self) -> u16 {
        match self {
            Self::U16 | Self::I16 | Self::Sm16 => 1,
            Self::U32 | Self::I32 | Self::Sm32 | Self::F32 => 2,
            Self::I64 | Self::F64 => 4,
        }
    }

    /// Bits of a whole number without its sign, and whether it has none: what a counter can hold.
    pub(super) fn find_counter_bits(self) -> Option<(i32, bool)> {
        match self {
            Self::U16 => Some((16, true)),
            Self::U32 => Some((32, true)),
            Self::I16 | Self::Sm16 => Some((15, false)),
            Self::I32 | Self::Sm32 => Some((31, false)),
            Self::I64 => Some((63, false)),
            Self::F32 | Self::F64 => None,
        }
    }

    /// The format of this name, as a profile writes it.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        const NAMES: [(&str, Format); 9] = [
            ("u16", Format::U16),
            ("i16", Format::I16),
            ("sm16", Format::Sm16),
            ("u32", Format::U32),
            ("i32", Format::I32),
            ("sm32", Format::Sm32),
            ("f32", Format::F32),
            ("i64", Format::I64),
            ("f64", Format::F64),
        ];
        NAMES.iter().find(|(known, _)| *known == name).map(|(_, format)| *format)
    }

    /// The bits in these registers; `None` when they are too few.
    #[must_use]
    pub fn extract_bits(self, registers: &[u16], order: WordOrder) -> Option<u64> {
        Some(join_bits(registers.get(..usize::from(self.register_count()))?, order))
    }

    /// Bits that stand for no value unless a profile says otherwise: the ends of the range of a whole number, where meters
    /// put what they do not measure. An IEEE number has its own.
    #[must_use]
    pub fn no_values(self) -> &'static [u64] {
        match self {
            Self::U16 | Self::Sm16 => &[0xFFFF],
            Self::I16 => &[0x8000, 0x7FFF],
            Self::U32 | Self::Sm32 => &[0xFFFF_FFFF],
            Self::I32 => &[0x8000_0000, 0x7FFF_FFFF],
            Self::I64 => &[0x8000_0000_0000_0000, 0x7FFF_FFFF_FFFF_FFFF],
            Self::F32 | Self::F64 => &[],
        }
    }

    /// The number in these registers; `None` when they are too few, or an IEEE number is none.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "no meter counts beyond 2^53")]
    pub fn decode(self, registers: &[u16], order: WordOrder) -> Option<f64> {
        let bits = join_bits(registers.get(..usize::from(self.register_count()))?, order);
        let number = match self {
            Self::U16 | Self::U32 => bits as f64,
            Self::I16 => f64::from(take_low_u16(bits).cast_signed()),
            Self::I32 => f64::from(take_low_u32(bits).cast_signed()),
            Self::Sm16 => decode_sign_magnitude(bits, 15),
            Self::Sm32 => decode_sign_magnitude(bits, 31),
            Self::F32 => f64::from(f32::from_bits(take_low_u32(bits))),
            Self::I64 => bits.cast_signed() as f64,
            Self::F64 => f64::from_bits(bits),
        };
        number.is_finite().then_some(number)
    }

    /// The registers that hold the number, at the nearest end of the range where it does not fit.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a cast from a double saturates, which is meant")]
    pub fn encode(self, number: f64, order: WordOrder) -> Vec<u16> {
        let whole = number.round();
        let bits = match self {
            Self::U16 => u64::from(whole.clamp(0.0, 65535.0) as u16),
            Self::I16 => u64::from((whole as i16).cast_unsigned()),
            Self::Sm16 => signed_magnitude(whole, 15),
            Self::U32 => u64::from(whole.clamp(0.0, f64::from(u32::MAX)) as u32),
            Self::I32 => u64::from((whole as i32).cast_unsigned()),
            Self::Sm32 => signed_magnitude(whole, 31),
            Self::F32 => u64::from((number as f32).to_bits()),
            Self::I64 => (whole as i64).cast_unsigned(),
            Self::F64 => number.to_bits(),
        };
        let words = (0..self.register_count()).map(|word| take_low_u16(bits >> (16 * word)));
        let words = words.map(|word| order.to_big_endian(word));
        if order.low_word_first() { words.collect() } else { words.rev().collect() }
    }
}

fn join_bits(registers: &[u16], order: WordOrder) -> u64 {
    let join = |bits: u64, register: &u16| (bits << 16) | u64::from(order.to_big_endian(*register));
    if order.low_word_first() { registers.iter().rev().fold(0, join) } else { registers.iter().fold(0, join) }
}

#[expect(clippy::cast_precision_loss, reason = "31 bits fit a double")]
fn decode_sign_magnitude(bits: u64, sign: u32) -> f64 {
    let size = (bits & ((1 << sign) - 1)) as f64;
    if bits >> sign & 1 == 1 { -size } else { size }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range before")]
fn signed_magnitude(whole: f64, sign: u32) -> u64 {
    let greatest = f64::from(u32::MAX >> (32 - sign));
    let size = whole.abs().min(greatest) as u64;
    if whole < 0.0 { size | 1 << sign } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Format; 9] = [
        Format::U16,
        Format::I16,
        Format::Sm16,
        Format::U32,
        Format::I32,
        Format::Sm32,
        Format::F32,
        Format::I64,
        Format::F64,
    ];

    #[test]
    fn a_known_number_in_every_order() {
        // 230.2 V as IEEE 754 is 43 66 33 33 hex, the example of the Eastron manual.
        let words = [0x4366, 0x3333];
        let volts = Format::F32.decode(&words, WordOrder::Big).expect("a number");
        assert!((volts - 230.2).abs() < 1e-4);
        let [high, low] = words;
        assert_eq!(Format::F32.decode(&[low, high], WordOrder::Little), Some(volts));
        // The same four bytes 43 66 33 33 as B A D C and D C B A.
        assert_eq!(Format::F32.decode(&[0x6643, 0x3333], WordOrder::Badc), Some(volts));
        assert_eq!(Format::F32.decode(&[0x3333, 0x6643], WordOrder::Dcba), Some(volts));
        assert_eq!(WordOrder::of_name("cdab"), Some(WordOrder::Little));
    }

    #[test]
    fn negative_power_stays_negative() {
        assert_eq!(Format::I16.decode(&[0xFFFF], WordOrder::Big), Some(-1.0));
        assert_eq!(Format::Sm16.decode(&[0x8001], WordOrder::Big), Some(-1.0));
        assert_eq!(Format::I32.decode(&[0xFFFF, 0xFFFE], WordOrder::Big), Some(-2.0));
        assert_eq!(Format::Sm32.decode(&[0x8000, 0x0002], WordOrder::Big), Some(-2.0));
    }

    #[test]
    fn no_number_and_too_few_registers_are_none() {
        assert_eq!(Format::F32.decode(&[0x7FC0, 0], WordOrder::Big), None);
        assert_eq!(Format::F32.decode(&[0x4366], WordOrder::Big), None);
    }

    proptest::proptest! {
        #[test]
        fn what_is_encoded_is_decoded(whole in -30000_i32..30000, which in 0_usize..9, order in 0_usize..4) {
            let orders = [WordOrder::Big, WordOrder::Little, WordOrder::Badc, WordOrder::Dcba];
            let (format, order) = (ALL[which], orders[order]);
            let signed = !matches!(format, Format::U16 | Format::U32);
            let number = f64::from(if signed { whole } else { whole.abs() });
            proptest::prop_assert_eq!(format.decode(&format.encode(number, order), order), Some(number));
        }
    }
}
