//! PMC memory: areas of bytes, numbers in them little-endian.

use fanuc::item::{Area, PmcWidth, Stretch};
use std::collections::BTreeMap;

/// Bytes of each area. The signals of path 2 begin at G1000 and F1000, those of path 3 at 2000.
const SIZES: [(Area, usize); 11] = [
    (Area::G, 2768),
    (Area::F, 2768),
    (Area::Y, 128),
    (Area::X, 128),
    (Area::A, 250),
    (Area::R, 8000),
    (Area::T, 500),
    (Area::K, 100),
    (Area::C, 400),
    (Area::D, 10000),
    (Area::E, 8000),
];

/// The bytes of all areas of PMC memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Memory {
    areas: BTreeMap<Area, Vec<u8>>,
}

impl Default for Memory {
    fn default() -> Self {
        Self { areas: SIZES.into_iter().map(|(area, size)| (area, vec![0; size])).collect() }
    }
}

impl Memory {
    /// One byte; 0 beyond the end.
    #[must_use]
    pub fn read_byte(&self, area: Area, at: u16) -> u8 {
        self.areas.get(&area).and_then(|bytes| bytes.get(usize::from(at))).copied().unwrap_or(0)
    }

    /// Sets one byte, if it is there.
    pub fn set_byte(&mut self, area: Area, at: u16, byte: u8) {
        if let Some(place) = self.areas.get_mut(&area).and_then(|bytes| bytes.get_mut(usize::from(at))) {
            *place = byte;
        }
    }

    /// Sets one bit of a byte.
    pub fn set_bit(&mut self, area: Area, at: u16, bit: u8, on: bool) {
        let mask = 1u8.checked_shl(u32::from(bit)).unwrap_or(0);
        let byte = self.read_byte(area, at);
        self.set_byte(area, at, if on { byte | mask } else { byte & !mask });
    }

    /// Forgets what is not battery-backed.
    pub fn power_off(&mut self) {
        for (area, bytes) in &mut self.areas {
            if !matches!(area, Area::D | Area::K | Area::T | Area::C) {
                bytes.fill(0);
            }
        }
    }

    fn find_stretch(&self, stretch: Stretch) -> Option<&[u8]> {
        let whole = stretch.len().is_multiple_of(usize::from(stretch.width.byte_count()));
        let range = usize::from(stretch.from)..=usize::from(stretch.to);
        self.areas.get(&stretch.area)?.get(range).filter(|_| whole && !stretch.is_empty())
    }

    /// A stretch as it travels: every element big-endian.
    #[must_use]
    pub fn read(&self, stretch: Stretch) -> Option<Vec<u8>> {
        self.find_stretch(stretch).map(|bytes| swap_bytes(bytes, stretch.width))
    }

    /// Takes a stretch as it travels; `false` when it does not fit.
    pub fn write(&mut self, stretch: Stretch, data: &[u8]) -> bool {
        if self.find_stretch(stretch).is_none_or(|bytes| bytes.len() != data.len()) {
            return false;
        }
        let range = usize::from(stretch.from)..=usize::from(stretch.to);
        let place = self.areas.get_mut(&stretch.area).and_then(|bytes| bytes.get_mut(range));
        place.map(|place| place.copy_from_slice(&swap_bytes(data, stretch.width))).is_some()
    }
}

fn swap_bytes(bytes: &[u8], width: PmcWidth) -> Vec<u8> {
    bytes.chunks(usize::from(width.byte_count())).flat_map(|element| element.iter().rev().copied()).collect()
}
