//! How much of a file is taken, so that no file can fill the memory of the box. Each bound is told by name when it is met.

/// Columns of one table. A machine with everything that can be measured has some hundred.
pub(crate) const COLUMNS_MAX: usize = 4096;
/// Bytes of one row of text, all its cells together.
pub(crate) const ROW_BYTES_MAX: usize = 4 << 20;
/// Cells of a recording that is read: nine bytes each, so 1.1 GB at most.
pub(crate) const CELLS_MAX: usize = 120_000_000;
/// Cells of formats that have to stand in memory as a whole before they are understood (workbooks, MTConnect): 24 bytes each.
pub(crate) const CELLS_IN_MEMORY_MAX: usize = 20_000_000;
/// Bytes of a text that is put into memory as a whole; a longer one is read from its file in pieces, each time it is gone through.
pub(crate) const TEXT_IN_MEMORY_MAX: u64 = 64 << 20;
/// Bytes of all the different words of one text column.
pub(crate) const WORDS_BYTES_MAX: usize = 64 << 20;
/// Bytes that a compressed workbook may come to.
pub(crate) const UNPACKED_BYTES_MAX: u64 = 1 << 30;
/// Rows that are looked at for the header.
pub(crate) const HEAD_ROWS: usize = 200;
/// Bytes that are looked at for the separator.
pub(crate) const HEAD_BYTES: usize = 256 << 10;
/// Refused rows and unusable cells that are described; the rest is counted.
pub(crate) const DESCRIBED_MAX: usize = 100;
