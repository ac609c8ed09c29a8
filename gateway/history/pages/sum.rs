//! The sum of one page.

/// Bytes that `SQLite` leaves free at the end of each page.
pub(super) const ROOM: usize = 8;
/// The least and greatest page of `SQLite`.
const PAGE_BYTES: std::ops::RangeInclusive<usize> = 512..=65_536;

/// Is a piece of the file of this length, from this place on, one whole page?
pub(super) fn is_page(length: usize, offset: u64) -> bool {
    PAGE_BYTES.contains(&length) && length.is_power_of_two() && offset.is_multiple_of(length as u64)
}

/// The number of a page, from 1. `SQLite` has fewer than 2^32 - 1 pages and never writes a later one; a file that claims to be
/// longer gives the greatest number, which fits the sum of none.
pub(super) fn page_number(length: usize, offset: u64) -> u32 {
    u32::try_from(offset / length as u64 + 1).unwrap_or(u32::MAX)
}

fn sum(body: &[u8], number: u32) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    sum.update(body);
    sum.update(&number.to_le_bytes());
    sum.finalize()
}

/// Writes the sum at the end of the page.
pub(super) fn seal_page(page: &mut [u8], number: u32) {
    let Some(at) = page.len().checked_sub(ROOM) else { return };
    let (body, room) = page.split_at_mut(at);
    let (first, second) = room.split_at_mut(4);
    first.copy_from_slice(&sum(body, number).to_le_bytes());
    second.copy_from_slice(&number.to_le_bytes());
}

/// Has anybody sealed the page?
pub(super) fn is_sealed(page: &[u8]) -> bool {
    page.last_chunk::<ROOM>().is_some_and(|room| *room != [0; ROOM])
}

/// Is the page as it was written, as far as it says? Takes the sum out: a page that is copied from here has none.
pub(super) fn unseal_page(page: &mut [u8], number: u32) -> bool {
    let Some((body, room)) = page.split_last_chunk_mut::<ROOM>() else { return true };
    if *room == [0; ROOM] {
        // Nobody has sealed it.
        return true;
    }
    let mut sealed = [0; ROOM];
    sealed[..4].copy_from_slice(&sum(body, number).to_le_bytes());
    sealed[4..].copy_from_slice(&number.to_le_bytes());
    std::mem::replace(room, [0; ROOM]) == sealed
}

/// What a file says of itself in its first hundred bytes (SQLite, *Database File Format*, 1.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FileHeader {
    /// Its pages have sums.
    pub(super) sealed: bool,
    /// Length of a page, bytes.
    pub(super) page: usize,
}

/// Length of the header.
pub(super) const HEADER: usize = 100;

impl FileHeader {
    /// Two places say that pages have sums, so that one changed bit cannot switch the check off.
    pub(super) fn from_header(header: &[u8; HEADER], application: u32) -> Self {
        let room = usize::from(header[20]) == ROOM;
        let named = header[68..72] == application.to_be_bytes();
        let page = usize::from(header[16]) << 8 | usize::from(header[17]) << 16;
        let page = if is_page(page, 0) { page } else { 4_096 };
        Self { sealed: room || named, page }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn one_changed_bit_and_a_wrong_place_are_noticed(
            body in prop::collection::vec(any::<u8>(), 504),
            number in 1u32..9_999,
            bit in 0usize..512 * 8,
        ) {
            let mut page = [body, vec![0; ROOM]].concat();
            seal_page(&mut page, number);
            let sealed = page.clone();
            prop_assert!(unseal_page(&mut page, number));
            prop_assert_eq!(&page[504..], &[0; ROOM]);
            prop_assert!(unseal_page(&mut page, number), "one that nobody has sealed");
            let mut flipped = sealed.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(!unseal_page(&mut flipped, number));
            let mut moved = sealed;
            prop_assert!(!unseal_page(&mut moved, number + 1));
        }
    }

    #[test]
    fn pages_are_told_from_other_reads() {
        assert!(is_page(4_096, 8_192) && is_page(512, 0) && is_page(65_536, 65_536));
        assert!(!is_page(4_096, 100) && !is_page(100, 0) && !is_page(16, 24) && !is_page(4_095, 0));
        assert_eq!((page_number(4_096, 0), page_number(4_096, 8_192)), (1, 3));
    }
}
