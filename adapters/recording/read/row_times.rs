//! Time and line of every row while a table is read, in few bytes: a file of two columns has twenty million rows.

use adapter_core::clock::TimeNs;

/// One row's time, as the file says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RawTime {
    /// Seconds on a clock that begins anywhere.
    Seconds(f64),
    /// Nanoseconds since 1970, UTC.
    Utc(TimeNs),
    /// The same on the clock of the place.
    Local(TimeNs),
    /// Nanoseconds since midnight.
    OfDay(i64),
}

/// Which of [`RawTime`] a time is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TimeSort {
    Seconds,
    Utc,
    Local,
    OfDay,
}

/// The times of rows as the file says them: eight bytes each.
#[derive(Debug, Default)]
pub(super) struct RawTimes {
    bits: Vec<u64>,
    /// From which row on they are of which sort.
    sorts: Vec<(usize, TimeSort)>,
}

fn split_time(time: RawTime) -> (TimeSort, u64) {
    match time {
        RawTime::Seconds(seconds) => (TimeSort::Seconds, seconds.to_bits()),
        RawTime::Utc(at_ns) => (TimeSort::Utc, at_ns.cast_unsigned()),
        RawTime::Local(at_ns) => (TimeSort::Local, at_ns.cast_unsigned()),
        RawTime::OfDay(at_ns) => (TimeSort::OfDay, at_ns.cast_unsigned()),
    }
}

fn join_time(sort: TimeSort, bits: u64) -> RawTime {
    let at_ns: TimeNs = bits.cast_signed();
    match sort {
        TimeSort::Seconds => RawTime::Seconds(f64::from_bits(bits)),
        TimeSort::Utc => RawTime::Utc(at_ns),
        TimeSort::Local => RawTime::Local(at_ns),
        TimeSort::OfDay => RawTime::OfDay(at_ns),
    }
}

impl RawTimes {
    pub(super) fn push(&mut self, time: RawTime) {
        let (sort, bits) = split_time(time);
        if self.sorts.last().is_none_or(|(_, last)| *last != sort) {
            self.sorts.push((self.bits.len(), sort));
        }
        if self.bits.len() == self.bits.capacity() {
            // Doubled, a long column would hold as much again that is never used.
            self.bits.reserve_exact(1024 + self.bits.len() / 8);
        }
        self.bits.push(bits);
    }

    pub(super) fn len(&self) -> usize {
        self.bits.len()
    }

    pub(super) fn has(&self, sort: TimeSort) -> bool {
        self.sorts.iter().any(|(_, known)| *known == sort)
    }

    /// What becomes of each of them, in their place where it takes as many bytes.
    pub(super) fn map<T>(self, mut convert: impl FnMut(RawTime) -> T) -> Vec<T> {
        let Self { bits, sorts } = self;
        let (mut row, mut next) = (0, 0);
        bits.into_iter()
            .map(|bits| {
                if sorts.get(next).is_some_and(|(start, _)| *start == row) {
                    next += 1;
                }
                row += 1;
                convert(join_time(sorts[next - 1].1, bits))
            })
            .collect()
    }
}

impl FromIterator<RawTime> for RawTimes {
    fn from_iter<I: IntoIterator<Item = RawTime>>(iter: I) -> Self {
        let mut times = Self::default();
        iter.into_iter().for_each(|time| times.push(time));
        times
    }
}

/// The lines of rows, of which most follow the row before at once.
#[derive(Debug, Default)]
pub(super) struct RowLines {
    rows: usize,
    /// Rows that do not, and their lines.
    jumps: Vec<(usize, u64)>,
}

impl RowLines {
    pub(super) fn push(&mut self, line: u64) {
        if self.rows == 0 || self.line_of(self.rows) != line {
            self.jumps.push((self.rows, line));
        }
        self.rows += 1;
    }

    /// The line of a row; of one that has not come yet, the line that follows.
    pub(super) fn line_of(&self, row: usize) -> u64 {
        let place = self.jumps.partition_point(|(first, _)| *first <= row);
        let (first, line) = place.checked_sub(1).map_or((0, 1), |place| self.jumps[place]);
        line + (row - first) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_lines_come_back_as_they_went() {
        let times = [
            RawTime::Utc(5),
            RawTime::Utc(-6),
            RawTime::Local(7),
            RawTime::Utc(8),
            RawTime::Seconds(-0.25),
            RawTime::OfDay(9),
        ];
        let raw: RawTimes = times.into_iter().collect();
        assert_eq!(raw.len(), 6);
        assert!(raw.has(TimeSort::Local) && !RawTimes::default().has(TimeSort::Local));
        assert_eq!(raw.map(|time| time), times);
        let lines = [2, 3, 4, 9, 10, 5_000_000_000, 5_000_000_001];
        let mut rows = RowLines::default();
        lines.iter().for_each(|line| rows.push(*line));
        assert_eq!((0..lines.len()).map(|row| rows.line_of(row)).collect::<Vec<_>>(), lines);
        assert_eq!(rows.jumps.len(), 3);
    }
}
