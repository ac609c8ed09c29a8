//! Numbers of a column with typed absence. A thousand cells stand together in the fewest bytes that give each of them back to the last
//! bit: what was written with a few digits is a whole number over a power of ten. So a recording takes less memory than its text.

/// Cells that stand together.
const BLOCK: usize = 1024;
/// One over what a cell may be a whole multiple of: up to nine digits behind the point.
const POWERS: [f64; 10] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];

/// Numbers with typed absence.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Numbers {
    blocks: Vec<NumberBlock>,
    /// The cells after the last whole block; an absent one is zero.
    tail: Vec<f64>,
    tail_present: Vec<bool>,
}

/// A thousand cells, packed together.
#[derive(Debug, Clone, PartialEq)]
struct NumberBlock {
    values: Packed,
    /// `None`: every cell has a value.
    present: Option<Box<[bool]>>,
}

/// Values as whole numbers over a power of ten, or as they are.
#[derive(Debug, Clone, PartialEq)]
enum Packed {
    Bytes(f64, Box<[i8]>),
    Shorts(f64, Box<[i16]>),
    Longs(f64, Box<[i32]>),
    Doubles(Box<[f64]>),
}

/// The whole number of this many parts that is nearest to a value.
#[expect(clippy::cast_possible_truncation, reason = "saturates, and whoever asks compares what comes back")]
fn count_parts(value: f64, parts: f64) -> i32 {
    let scaled = value * parts;
    (scaled + 0.5_f64.copysign(scaled)) as i32
}

/// The fewest digits by which each value is a whole number of parts, as the power of ten; `None` where there are none.
fn find_parts(values: &[f64]) -> Option<f64> {
    let is_whole = |value: f64, parts: f64| (f64::from(count_parts(value, parts)) / parts).to_bits() == value.to_bits();
    let mut digits = 0;
    for value in values {
        while !is_whole(*value, *POWERS.get(digits)?) {
            digits += 1;
        }
    }
    let parts = *POWERS.get(digits)?;
    // More digits than a value was tried with may be too many for it.
    values.iter().all(|value| value.abs() * parts < f64::from(i32::MAX)).then_some(parts)
}

impl Packed {
    fn from_values(values: &[f64]) -> Self {
        let Some(parts) = find_parts(values) else { return Self::Doubles(values.into()) };
        let counts: Vec<i32> = values.iter().map(|value| count_parts(*value, parts)).collect();
        if let Some(bytes) = counts.iter().map(|count| i8::try_from(*count).ok()).collect() {
            return Self::Bytes(parts, bytes);
        }
        match counts.iter().map(|count| i16::try_from(*count).ok()).collect() {
            Some(shorts) => Self::Shorts(parts, shorts),
            None => Self::Longs(parts, counts.into()),
        }
    }

    fn value_at(&self, row: usize) -> f64 {
        match self {
            Self::Bytes(parts, counts) => f64::from(counts[row]) / parts,
            Self::Shorts(parts, counts) => f64::from(counts[row]) / parts,
            Self::Longs(parts, counts) => f64::from(counts[row]) / parts,
            Self::Doubles(values) => values[row],
        }
    }
}

impl NumberBlock {
    fn get(&self, row: usize) -> Option<f64> {
        let is_present = self.present.as_ref().is_none_or(|present| present[row]);
        is_present.then(|| self.values.value_at(row))
    }

    fn count_present(&self) -> usize {
        self.present.as_ref().map_or(BLOCK, |present| count_true(present))
    }
}

fn count_true(present: &[bool]) -> usize {
    present.iter().filter(|present| **present).count()
}

impl Numbers {
    /// A column with a value in every row.
    #[must_use]
    pub fn from_values(values: Vec<f64>) -> Self {
        values.into_iter().map(Some).collect()
    }

    /// Appends a row. A number that is not finite counts as absent.
    pub fn push(&mut self, value: Option<f64>) {
        let value = value.filter(|value| value.is_finite());
        self.tail.push(value.unwrap_or(0.0));
        self.tail_present.push(value.is_some());
        if self.tail.len() == BLOCK {
            let is_full = self.tail_present.iter().all(|present| *present);
            let present = (!is_full).then(|| self.tail_present.as_slice().into());
            self.blocks.push(NumberBlock { values: Packed::from_values(&self.tail), present });
            self.tail.clear();
            self.tail_present.clear();
        }
    }

    /// The value in `row`, if there is one.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<f64> {
        if let Some(block) = self.blocks.get(row / BLOCK) {
            return block.get(row % BLOCK);
        }
        let row = row - self.blocks.len() * BLOCK;
        (*self.tail_present.get(row)?).then(|| self.tail[row])
    }

    /// The cells row by row; `None` is absent.
    pub fn iter(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        (0..self.len()).map(|row| self.get(row))
    }

    /// The values that are present.
    pub fn present_values(&self) -> impl Iterator<Item = f64> + '_ {
        self.iter().flatten()
    }

    /// How many rows have a value.
    #[must_use]
    pub fn count_present(&self) -> usize {
        self.blocks.iter().map(NumberBlock::count_present).sum::<usize>() + count_true(&self.tail_present)
    }

    /// How many rows, absent cells included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.blocks.len() * BLOCK + self.tail.len()
    }

    /// No rows at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// So many rows: those beyond are cut, missing ones are absent.
    pub(crate) fn resize(&mut self, rows: usize) {
        if rows < self.len() {
            *self = (0..rows).map(|row| self.get(row)).collect();
        }
        while self.len() < rows {
            self.push(None);
        }
    }
}

impl FromIterator<Option<f64>> for Numbers {
    fn from_iter<I: IntoIterator<Item = Option<f64>>>(iter: I) -> Self {
        let mut numbers = Self::default();
        iter.into_iter().for_each(|value| numbers.push(value));
        numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes that the values of the first block take.
    fn width(numbers: &Numbers) -> usize {
        match &numbers.blocks[0].values {
            Packed::Bytes(..) => 1,
            Packed::Shorts(..) => 2,
            Packed::Longs(..) => 4,
            Packed::Doubles(..) => 8,
        }
    }

    #[test]
    fn every_value_comes_back_to_the_last_bit_in_the_fewest_bytes() {
        let of = |value: &dyn Fn(f64) -> f64| (0..3 * BLOCK + 7).map(|row| value(row as f64)).collect::<Vec<f64>>();
        let cases: [(&dyn Fn(f64) -> f64, usize); 9] = [
            (&|row| row % 2.0, 1),
            (&|row| (row % 2000.0 - 1000.0) / 10.0, 2),
            (&|row| (row % 100.0) / 10.0, 1),
            (&|row| (row * 7919.0 % 1e6) / 1e3, 4),
            (&|row| row.sqrt(), 8),
            (&|row| 1e300 * (row + 1.0), 8),
            (&|row| if row == 5.0 { 2e9 } else { 0.1 }, 8),
            (&|row| if row == 5.0 { -0.0 } else { 1.0 }, 8),
            (&|row| (row + 1.0) * 1e-12, 8),
        ];
        for (number, (value, bytes)) in cases.into_iter().enumerate() {
            let values = of(value);
            let numbers = Numbers::from_values(values.clone());
            assert_eq!(width(&numbers), bytes, "case {number}");
            let same = |(was, is): (&f64, Option<f64>)| is.is_some_and(|is| is.to_bits() == was.to_bits());
            assert!(values.iter().zip(numbers.iter()).all(same), "case {number}");
            assert_eq!((numbers.len(), numbers.count_present()), (values.len(), values.len()));
            assert_eq!(numbers.get(values.len()), None);
        }
    }

    #[test]
    fn what_is_absent_stays_absent_in_whole_blocks_and_after_them() {
        let cell = |row: usize| (!row.is_multiple_of(3)).then_some(row as f64 / 4.0);
        let rows = 2 * BLOCK + 10;
        let mut numbers: Numbers = (0..rows).map(cell).collect();
        assert!((0..rows).all(|row| numbers.get(row) == cell(row)));
        assert_eq!(numbers.count_present(), (0..rows).filter_map(cell).count());
        numbers.resize(rows + 3 * BLOCK);
        assert_eq!((numbers.len(), numbers.get(rows + 1)), (rows + 3 * BLOCK, None));
        numbers.resize(BLOCK + 5);
        assert_eq!(numbers, (0..BLOCK + 5).map(cell).collect());
        assert_eq!(Numbers::from_values(vec![f64::NAN, 1.0]).count_present(), 1);
    }
}
