//! A Linux IIO device in buffered capture as a sampler, through sysfs and the character device alone.
//!
//! Sources: kernel documentation, ABI/testing/sysfs-bus-iio (`scan_elements/*_en`, `*_index`, `*_type`, `*_scale`,
//! `sampling_frequency`, `buffer/enable`) and iio/iio_devbuf. A type reads `[be|le]:[s|u]bits/storagebits>>shift`; elements
//! lie in the order of their index, each at a multiple of its own size. Scales are in milliampere or, where the converter
//! only knows voltage, millivolt: then `a_per_v` says what the transducer makes of an ampere.

use super::frame::WaveformHeader;
use super::producer::Sampler;
use crate::clock::{Clock, SECOND_NS};
use adapter_core::integer::{convert_bounded, count_to_f64};
use std::fs::File;
use std::io::{self, Error, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const CHANNELS_MAX: usize = 8;

/// How one element lies in the buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ElementLayout {
    big: bool,
    signed: bool,
    bits: u32,
    bytes: usize,
    shift: u32,
}

#[derive(Debug, Clone, PartialEq)]
struct Element {
    name: String,
    index: u32,
    layout: ElementLayout,
    /// Ampere per count.
    scale_a: f64,
    timestamp: bool,
    offset: usize,
}

/// A Linux IIO device in buffered capture.
pub struct Iio {
    device: File,
    sysfs: PathBuf,
    elements: Vec<Element>,
    scan_bytes: usize,
    rate_hz: f64,
    block: usize,
    clock: Arc<dyn Clock>,
}

impl Iio {
    /// Starts buffered capture on a device: its directory in sysfs and its file in `/dev`. The channels that are enabled
    /// there (`scan_elements/..._en` is 1) are sampled.
    ///
    /// # Errors
    /// What is missing in sysfs, in words; a device that another program has open.
    pub fn open(sysfs: &Path, device: &Path, a_per_v: f64, clock: Arc<dyn Clock>) -> io::Result<Self> {
        let mut elements = read_elements(sysfs, a_per_v)?;
        let scan_bytes = assign_offsets(&mut elements);
        let rate_hz = read_number(&sysfs.join("sampling_frequency"))?;
        let channels = elements.iter().filter(|element| !element.timestamp).count();
        if !(1..=CHANNELS_MAX).contains(&channels) || !(1.0..=1e6).contains(&rate_hz) {
            let what = format!("{channels} channels enabled in scan_elements at {rate_hz} Hz; 1 to 8 are wanted");
            return Err(Error::new(ErrorKind::InvalidData, what));
        }
        std::fs::write(sysfs.join("buffer/enable"), "1")?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 20 000")]
        let block = ((rate_hz / 50.0).ceil() as usize).clamp(1, 4096);
        let device = File::open(device)?;
        Ok(Self { device, sysfs: sysfs.to_owned(), elements, scan_bytes, rate_hz, block, clock })
    }
}

impl Drop for Iio {
    fn drop(&mut self) {
        // The device is gone, or stops with us; nothing else can be done about either.
        let _ = std::fs::write(self.sysfs.join("buffer/enable"), "0");
    }
}

fn read_number(file: &Path) -> io::Result<f64> {
    let bad = |what: String| Error::new(ErrorKind::InvalidData, format!("{}: {what}", file.display()));
    let text = std::fs::read_to_string(file)
        .map_err(|error| Error::new(error.kind(), format!("{}: {error}", file.display())))?;
    text.trim().parse().map_err(|_| bad(format!("{:?} is no number", text.trim())))
}

fn read_elements(sysfs: &Path, a_per_v: f64) -> io::Result<Vec<Element>> {
    let mut elements = Vec::new();
    for entry in std::fs::read_dir(sysfs.join("scan_elements"))? {
        let file = entry?.file_name().to_string_lossy().into_owned();
        let Some(name) = file.strip_suffix("_en").and_then(|name| name.strip_prefix("in_")) else { continue };
        let scan = |what: &str| sysfs.join("scan_elements").join(format!("in_{name}_{what}"));
        if read_number(&scan("en"))? != 1.0 {
            continue;
        }
        let text = std::fs::read_to_string(scan("type"))?;
        let unknown = || Error::new(ErrorKind::InvalidData, format!("in_{name}_type {:?}", text.trim()));
        let layout = ElementLayout::parse(text.trim()).ok_or_else(unknown)?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let index = read_number(&scan("index"))? as u32;
        let timestamp = name == "timestamp";
        let thousandths = if timestamp { 0.0 } else { read_scale(sysfs, name)? };
        let scale_a = thousandths / 1000.0 * if name.starts_with("voltage") { a_per_v } else { 1.0 };
        elements.push(Element { name: name.to_owned(), index, layout, scale_a, timestamp, offset: 0 });
    }
    elements.sort_by_key(|element| element.index);
    Ok(elements)
}

/// Of the channel itself, or of all channels of its kind.
fn read_scale(sysfs: &Path, name: &str) -> io::Result<f64> {
    let kind = name.trim_end_matches(|c: char| c.is_ascii_digit());
    read_number(&sysfs.join(format!("in_{name}_scale")))
        .or_else(|_| read_number(&sysfs.join(format!("in_{kind}_scale"))))
}

/// Gives each element its place; the size of one scan.
fn assign_offsets(elements: &mut [Element]) -> usize {
    let (mut end, mut widest) = (0_usize, 1);
    for element in elements {
        element.offset = end.next_multiple_of(element.layout.bytes);
        end = element.offset + element.layout.bytes;
        widest = widest.max(element.layout.bytes);
    }
    end.next_multiple_of(widest)
}

impl ElementLayout {
    fn parse(text: &str) -> Option<Self> {
        let (order, rest) = text.split_once(':')?;
        let big = match order {
            "be" => true,
            "le" => false,
            _ => return None,
        };
        let signed = rest.starts_with('s');
        let rest = rest.strip_prefix(['s', 'u'])?;
        let (bits, rest) = rest.split_once('/')?;
        let (storage, shift) = rest.split_once(">>")?;
        let (bits, storage, shift) = (bits.parse().ok()?, storage.parse::<u32>().ok()?, shift.parse().ok()?);
        let whole = matches!(storage, 8 | 16 | 32 | 64) && (1..=storage).contains(&bits) && shift < storage;
        whole.then_some(Self { big, signed, bits, bytes: usize::try_from(storage / 8).ok()?, shift })
    }

    fn read(&self, bytes: &[u8]) -> i64 {
        let join = |sum: u64, byte: &u8| (sum << 8) | u64::from(*byte);
        let word = if self.big { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) };
        let unused = 64 - self.bits;
        let value = (word >> self.shift) << unused;
        if self.signed { value.cast_signed() >> unused } else { (value >> unused).cast_signed() }
    }
}

impl Iio {
    fn iter_channels(&self) -> impl Iterator<Item = &Element> {
        self.elements.iter().filter(|element| !element.timestamp)
    }

    /// Bits beyond sixteen are dropped from below.
    fn count_dropped_bits(element: &Element) -> u32 {
        element.layout.bits.saturating_sub(if element.layout.signed { 16 } else { 15 })
    }

    fn time_ns(&self, scan: &[u8]) -> Option<i64> {
        let element = self.elements.iter().find(|element| element.timestamp)?;
        Some(element.layout.read(&scan[element.offset..element.offset + element.layout.bytes]))
    }
}

impl Sampler for Iio {
    fn header(&self) -> WaveformHeader {
        let names: Vec<&str> = self.iter_channels().map(|element| element.name.as_str()).collect();
        let scale = self
            .iter_channels()
            .map(|element| element.scale_a * f64::from(1_u32 << Self::count_dropped_bits(element)))
            .collect();
        let bits = self.iter_channels().map(|element| element.layout.bits.min(16)).min().unwrap_or(16);
        let full_scale = (i16::MAX >> (16 - bits)).max(1);
        WaveformHeader { scale, ..WaveformHeader::with_currents(self.rate_hz, &names, 1.0, full_scale) }
    }

    fn next(&mut self) -> io::Result<Option<(i64, Vec<i16>)>> {
        let mut bytes = vec![0; self.scan_bytes * self.block];
        match self.device.read_exact(&mut bytes) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
            Err(error) => return Err(error),
        }
        let mut samples = Vec::with_capacity(self.block * self.elements.len());
        for scan in bytes.chunks_exact(self.scan_bytes) {
            for element in self.iter_channels() {
                let value = element.layout.read(&scan[element.offset..element.offset + element.layout.bytes]);
                let value = value >> Self::count_dropped_bits(element);
                samples.push(convert_bounded(value, i16::MAX));
            }
        }
        let count = count_to_f64(self.block);
        #[expect(clippy::cast_possible_truncation, reason = "a block lasts a fiftieth of a second")]
        let block_ns = (count / self.rate_hz * SECOND_NS as f64) as i64;
        let first_ns = self.time_ns(&bytes).unwrap_or_else(|| self.clock.now_ns() - block_ns);
        Ok(Some((first_ns, samples)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::ManualClock;

    #[test]
    fn the_types_of_the_kernels_documentation() {
        let layout = ElementLayout::parse("le:s12/16>>4").expect("a type");
        assert_eq!(layout, ElementLayout { big: false, signed: true, bits: 12, bytes: 2, shift: 4 });
        assert_eq!(layout.read(&[0xF0, 0xFF]), -1);
        assert_eq!(ElementLayout::parse("be:u24/32>>8").expect("a type").read(&[0x01, 0x02, 0x03, 0xFF]), 0x0001_0203);
        assert!(
            ["xx:s16/16>>0", "le:s17/16>>0", "le:s16/12>>0", ""]
                .iter()
                .all(|text| ElementLayout::parse(text).is_none())
        );
    }

    #[test]
    fn a_device_is_read_through_sysfs_and_its_file() {
        let directory = tempfile::tempdir().expect("a directory");
        let sysfs = directory.path();
        let put = |name: &str, text: &str| std::fs::write(sysfs.join(name), text).expect("written");
        std::fs::create_dir(sysfs.join("scan_elements")).expect("made");
        std::fs::create_dir(sysfs.join("buffer")).expect("made");
        put("sampling_frequency", "1000\n");
        put("in_voltage_scale", "2.5\n");
        put("buffer/enable", "0\n");
        for (name, index, kind, on) in
            [("voltage0", 0, "le:s16/16>>0", 1), ("voltage1", 1, "le:s16/16>>0", 1), ("voltage2", 2, "le:s16/16>>0", 0)]
        {
            put(&format!("scan_elements/in_{name}_en"), &on.to_string());
            put(&format!("scan_elements/in_{name}_index"), &index.to_string());
            put(&format!("scan_elements/in_{name}_type"), kind);
        }
        put("scan_elements/in_timestamp_en", "1");
        put("scan_elements/in_timestamp_index", "3");
        put("scan_elements/in_timestamp_type", "le:s64/64>>0");
        let mut scans = Vec::new();
        for k in 0_i16..20 {
            scans.extend((100 + k).to_le_bytes());
            scans.extend((-k).to_le_bytes());
            scans.extend([0; 4]);
            scans.extend((5_000_000_000_i64 + i64::from(k) * 1_000_000).to_le_bytes());
        }
        let device = sysfs.join("device");
        std::fs::write(&device, scans).expect("written");
        let mut iio = Iio::open(sysfs, &device, 10.0, Arc::new(ManualClock::with_time(0))).expect("opens");
        assert_eq!(std::fs::read_to_string(sysfs.join("buffer/enable")).expect("there"), "1");
        let header = iio.header();
        assert_eq!(header.channels, ["voltage0", "voltage1"]);
        assert!((header.scale[0] - 0.025).abs() < 1e-12);
        let (first_ns, samples) = iio.next().expect("reads").expect("a block");
        assert_eq!((first_ns, samples.len(), samples[0], samples[39]), (5_000_000_000, 40, 100, -19));
        assert_eq!(iio.next().expect("reads"), None);
        drop(iio);
        assert_eq!(std::fs::read_to_string(sysfs.join("buffer/enable")).expect("there"), "0");
    }
}
