//! The quick way for most numbers of most files: a sign, digits, one decimal sign. Everything else is left to [`super::cell::written_number`].

use super::cell::{Decimal, Shape};

/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
/// Up to here every whole number is a double.
const EXACT_MAX: u64 = 1 << 53;
/// So many digits do not overflow.
const DIGITS_MAX: usize = 19;

/// A number and what it says about the decimal sign of its column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlainNumber {
    pub(super) value: f64,
    pub(super) shape: Shape,
}

/// Takes a text as a number under this decimal sign; `None`: the slow way has to look at it. Digits and power of ten are both exact, so that
/// their quotient is the nearest double (W. D. Clinger, How to Read Floating Point Numbers Accurately, 1990).
pub(super) fn scan_plain_number(text: &str, decimal: Decimal) -> Option<PlainNumber> {
    let bytes = text.as_bytes();
    let (is_negative, unsigned) = match bytes.first()? {
        b'-' => (true, &bytes[1..]),
        b'+' => (false, &bytes[1..]),
        _ => (false, bytes),
    };
    let sign = if decimal == Decimal::Point { b'.' } else { b',' };
    let mut mantissa = 0_u64;
    let mut sign_at = None;
    if unsigned.is_empty() || unsigned.len() > DIGITS_MAX {
        return None;
    }
    for (at, byte) in unsigned.iter().enumerate() {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            mantissa = 10 * mantissa + u64::from(digit);
        } else if *byte == sign && sign_at.is_none() {
            sign_at = Some(at);
        } else {
            return None;
        }
    }
    if mantissa > EXACT_MAX || unsigned.len() == usize::from(sign_at.is_some()) {
        return None;
    }
    let decimals = sign_at.map_or(0, |at| unsigned.len() - at - 1);
    #[expect(clippy::cast_precision_loss, reason = "not above 2^53")]
    let value = mantissa as f64 / POWERS.get(decimals)?;
    let shape = match (sign_at, decimal) {
        (None, _) => Shape::Whole,
        (Some(at), _) if decimals == 3 && (1..=3).contains(&at) && unsigned[0] != b'0' => match decimal {
            // 1.250 under a comma would be twelve hundred and fifty, and the other way round.
            Decimal::Point => Shape::PointOrThousands,
            Decimal::Comma => Shape::CommaOrThousands,
        },
        (Some(_), Decimal::Point) => Shape::Point,
        (Some(_), Decimal::Comma) => Shape::Comma,
    };
    Some(PlainNumber { value: if is_negative { -value } else { value }, shape })
}
