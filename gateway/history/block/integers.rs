//! Integers as differences: order 0 (themselves), 1 (steps) or 2 (steps of steps), whichever takes fewest bits, then
//! zigzag and varint. A ramp has equal steps, a clock equal steps of steps; a value that never changes is written once.

use super::varint::{Bytes, append_varint, unzigzag, zigzag};

/// The order of integers that are all the same.
const CONSTANT: u8 = 3;

/// Appends the order in one byte, then one varint per integer.
pub(crate) fn encode_integers(integers: &[i64], out: &mut Vec<u8>) {
    if let [first, rest @ ..] = integers
        && rest.iter().all(|value| value == first)
    {
        out.push(CONSTANT);
        return append_varint(out, zigzag(*first));
    }
    let order = best_order(integers);
    out.push(order);
    out.reserve(integers.len() * 2);
    let (mut last, mut step) = (0i64, 0i64);
    match order {
        0 => integers.iter().for_each(|value| append_varint(out, zigzag(*value))),
        1 => {
            for value in integers {
                append_varint(out, zigzag(value.wrapping_sub(last)));
                last = *value;
            }
        }
        _ => {
            for value in integers {
                let next = value.wrapping_sub(last);
                append_varint(out, zigzag(next.wrapping_sub(step)));
                (last, step) = (*value, next);
            }
        }
    }
}

fn best_order(integers: &[i64]) -> u8 {
    let mut bits = [0u32; 3];
    let (mut last, mut step) = (0i64, 0i64);
    for value in integers {
        let next = value.wrapping_sub(last);
        bits[0] += count_bits(*value);
        bits[1] += count_bits(next);
        bits[2] += count_bits(next.wrapping_sub(step));
        (last, step) = (*value, next);
    }
    // A lower order wins a tie: it decodes faster and its bytes repeat more.
    if bits[0] <= bits[1] && bits[0] <= bits[2] { 0 } else { 1 + u8::from(bits[2] < bits[1]) }
}

fn count_bits(value: i64) -> u32 {
    64 - zigzag(value).leading_zeros()
}

/// Reads `count` integers; `None` when the bytes are not what [`encode_integers`] writes.
pub(crate) fn decode_integers(bytes: &mut Bytes<'_>, count: usize) -> Option<Vec<i64>> {
    let order = bytes.read_byte()?;
    if order == CONSTANT {
        return Some(vec![unzigzag(bytes.read_varint()?); count]);
    }
    if order > CONSTANT || bytes.0.len() < count {
        return None;
    }
    let mut integers = Vec::with_capacity(count);
    let (mut last, mut step) = (0i64, 0i64);
    for _ in 0..count {
        let coded = unzigzag(bytes.read_varint()?);
        match order {
            0 => last = coded,
            1 => last = last.wrapping_add(coded),
            _ => {
                step = step.wrapping_add(coded);
                last = last.wrapping_add(step);
            }
        }
        integers.push(last);
    }
    Some(integers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_clock_takes_one_byte_per_tick() {
        let ticks: Vec<i64> = (0..600).map(|tick| 1_700_000_000_000_000_000 + tick * 100_000_000).collect();
        let mut out = Vec::new();
        encode_integers(&ticks, &mut out);
        assert!(out.len() < 620, "{}", out.len());
        assert_eq!(decode_integers(&mut Bytes(&out), 600), Some(ticks));
    }

    proptest! {
        #[test]
        fn a_constant_takes_no_room(value in any::<i64>(), count in 1usize..1000) {
            let mut out = Vec::new();
            encode_integers(&vec![value; count], &mut out);
            prop_assert!(out.len() <= 11);
            prop_assert_eq!(decode_integers(&mut Bytes(&out), count), Some(vec![value; count]));
        }

        #[test]
        fn every_list_survives(integers in prop::collection::vec(any::<i64>(), 0..60)) {
            let mut out = Vec::new();
            encode_integers(&integers, &mut out);
            prop_assert_eq!(decode_integers(&mut Bytes(&out), integers.len()), Some(integers));
        }

        #[test]
        fn no_bytes_make_it_panic(input in prop::collection::vec(any::<u8>(), 0..40), count in 0usize..100) {
            let _ = decode_integers(&mut Bytes(&input), count);
        }
    }
}
