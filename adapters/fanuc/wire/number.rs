//! The eight bytes in which a controller writes a number: mantissa, base, exponent.

use super::{Cursor, WireError};

/// `mantissa / base^exponent`; exponent -1 stands for no value at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Number {
    /// The number without its point.
    pub mantissa: i32,
    /// 10 in newer controllers, 2 in the macro variables of older ones. Some answers carry garbage here.
    pub base: u16,
    /// Places after the point.
    pub exponent: i16,
}

impl Number {
    /// Bytes on the wire.
    pub const LEN: usize = 8;

    /// No value: a macro variable that is vacant.
    pub const VACANT: Self = Self { mantissa: 0, base: 0xFFFF, exponent: -1 };

    /// The number `mantissa / 10^places`.
    #[must_use]
    pub fn from_decimal(mantissa: i32, places: i16) -> Self {
        Self { mantissa, base: 10, exponent: places }
    }

    /// The base-2 form of `mantissa / 10^places` that older controllers use.
    #[must_use]
    pub fn from_decimal_as_binary(mantissa: i32, places: i16) -> Self {
        Self::binary_of(f64::from(mantissa) / 10f64.powi(i32::from(places)))
    }

    /// The base-2 form of a value: the mantissa fills 31 bits and is cut off towards zero.
    #[must_use]
    pub fn binary_of(value: f64) -> Self {
        if value == 0.0 || !value.is_finite() {
            return Self { mantissa: 0, base: 2, exponent: 0 };
        }
        #[expect(clippy::cast_possible_truncation, reason = "the logarithm of a finite double fits")]
        let exponent = (30 - value.abs().log2().floor() as i16).clamp(0, 60);
        #[expect(clippy::cast_possible_truncation, reason = "cut off towards zero, as the controllers do; saturates")]
        let mantissa = (value * 2f64.powi(i32::from(exponent))) as i32;
        Self { mantissa, base: 2, exponent }
    }

    /// The base-10 form of a value with the fewest places (at most 8) that show it to nine digits.
    #[must_use]
    pub fn decimal_of(value: f64) -> Self {
        let scaled = |places: i16| value * 10f64.powi(i32::from(places));
        let exact = |places: &i16| (scaled(*places) - scaled(*places).round()).abs() <= scaled(*places).abs() * 1e-9;
        let fits = |places: &i16| scaled(*places).abs() < 1e9;
        let places = (0..=8).find(exact).unwrap_or_else(|| (0..=8).rev().find(fits).unwrap_or(0));
        #[expect(clippy::cast_possible_truncation, reason = "saturates, which is what a controller shows")]
        let mantissa = scaled(places).round() as i32;
        Self::from_decimal(mantissa, places)
    }

    /// Reads eight bytes.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn read(cursor: &mut Cursor<'_>) -> Result<Self, WireError> {
        Ok(Self { mantissa: cursor.read_i32()?, base: cursor.read_u16()?, exponent: cursor.read_i16()? })
    }

    /// The bytes on the wire.
    #[must_use]
    pub fn to_bytes(self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..4].copy_from_slice(&self.mantissa.to_be_bytes());
        bytes[4..6].copy_from_slice(&self.base.to_be_bytes());
        bytes[6..].copy_from_slice(&self.exponent.to_be_bytes());
        bytes
    }

    /// The value of a macro variable; `None` when it is vacant or the number makes no sense.
    #[must_use]
    pub fn value(self) -> Option<f64> {
        match (self.base, self.exponent) {
            (2, 0..=62) => Some(f64::from(self.mantissa) / 2f64.powi(i32::from(self.exponent))),
            (_, 0..=9) => Some(f64::from(self.mantissa) / 10f64.powi(i32::from(self.exponent))),
            _ => None,
        }
    }

    /// The value of a measured quantity, whose base word is not to be trusted: the exponent counts decimals.
    #[must_use]
    pub fn measured_value(self) -> Option<f64> {
        Self { base: 10, ..self }.value()
    }
}
