//! Which characters the bytes of a text are, and the text they give.
//!
//! UTF-8 is what holds over the whole file; only where it does not, another encoding is guessed from all of its bytes, and told.

use super::error::RecordingError;
use super::input::Input;
use chardetng::{EncodingDetector, Iso2022JpDetection, Utf8Detection};
use encoding_rs::{CoderResult, Decoder, DecoderResult, Encoding, UTF_8, UTF_16BE, UTF_16LE};
use std::io::Read;

const CHUNK: usize = 64 << 10;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct DetectedEncoding {
    pub(super) encoding: &'static Encoding,
    /// A byte order mark stands before it.
    pub(super) has_mark: bool,
}

/// Looks at every byte of the file, unless a mark at its beginning says it.
pub(super) fn detect_encoding(input: &Input) -> Result<DetectedEncoding, RecordingError> {
    let head = input.read_head(4096)?;
    if head.starts_with(&[0xff, 0xfe, 0, 0]) || head.starts_with(&[0, 0, 0xfe, 0xff]) {
        return Err(RecordingError::with_format_reason(
            &input.file,
            "the text is UTF-32: save it as UTF-8",
            "文本为UTF-32编码，请另存为UTF-8",
        ));
    }
    if let Some((encoding, _)) = Encoding::for_bom(&head) {
        return Ok(DetectedEncoding { encoding, has_mark: true });
    }
    // Without a mark every second byte of Latin text in UTF-16 is zero.
    let zeros = |odd: usize| head.iter().skip(odd).step_by(2).filter(|byte| **byte == 0).count();
    let many = head.len() / 5;
    if head.len() > 20 && zeros(1) > many && zeros(0) == 0 {
        return Ok(DetectedEncoding { encoding: UTF_16LE, has_mark: false });
    }
    if head.len() > 20 && zeros(0) > many && zeros(1) == 0 {
        return Ok(DetectedEncoding { encoding: UTF_16BE, has_mark: false });
    }
    Ok(DetectedEncoding { encoding: guess_encoding(input)?, has_mark: false })
}

/// UTF-8 where every byte of the file fits; only else the bytes are weighed.
fn guess_encoding(input: &Input) -> Result<&'static Encoding, RecordingError> {
    if is_utf8(input)? {
        return Ok(UTF_8);
    }
    let mut bytes = input.open()?;
    let mut detector = EncodingDetector::new(Iso2022JpDetection::Deny);
    let mut sample = Vec::new();
    let mut chunk = vec![0; CHUNK];
    loop {
        let length = bytes.read(&mut chunk).map_err(|error| input.build_io_error(error))?;
        let last = length == 0;
        detector.feed(&chunk[..length], last);
        if sample.len() < CHUNK && !chunk[..length].is_ascii() {
            sample.extend_from_slice(&chunk[..length]);
        }
        if last {
            return Ok(guess_legacy_encoding(&detector, &sample));
        }
    }
}

fn is_utf8(input: &Input) -> Result<bool, RecordingError> {
    if let Some(bytes) = input.bytes_in_memory() {
        return Ok(std::str::from_utf8(bytes).is_ok());
    }
    let mut bytes = input.open()?;
    let mut check = UTF_8.new_decoder_without_bom_handling();
    let (mut chunk, mut text) = (vec![0; CHUNK], vec![0; 3 * CHUNK + 16]);
    loop {
        let length = bytes.read(&mut chunk).map_err(|error| input.build_io_error(error))?;
        let last = length == 0;
        let (result, ..) = check.decode_to_utf8_without_replacement(&chunk[..length], &mut text, last);
        if matches!(result, DecoderResult::Malformed(..)) {
            return Ok(false);
        }
        if last {
            return Ok(true);
        }
    }
}

/// Signs of the field's words in Chinese and in Japanese; Japanese syllables count as well.
const CHINESE: &str = "主轴转速进给率功电流压温度时间日期切深宽工件刀具程序冷却液备注状态力扭矩批次试验机床号数值最大小平均报警运行序倍负载位置信息正常";
const JAPANESE: &str =
    "主軸回転数速度送電力流圧温日付時刻間経過工具番号切込負荷平均最大小値測定加計名状態冷却油機械位置運転軸記録単試験";

/// So many signs of the field are no accident: of signs read in the wrong encoding one in some hundred is among them.
const JAPANESE_MIN: usize = 4;

/// A few Chinese words look like Japanese or Korean ones as well; in a machine shop they are Chinese, unless read as Japanese they hold
/// more of the field's signs.
fn guess_legacy_encoding(detector: &EncodingDetector, sample: &[u8]) -> &'static Encoding {
    let first = detector.guess(None, Utf8Detection::Deny);
    let is_eastern =
        [encoding_rs::EUC_JP, encoding_rs::EUC_KR, encoding_rs::BIG5, encoding_rs::SHIFT_JIS].contains(&first);
    if !is_eastern {
        return first;
    }
    let chinese = detector.guess(Some(b"cn"), Utf8Detection::Deny);
    let count = |encoding: &'static Encoding, signs: &str| {
        let (text, _) = encoding.decode_without_bom_handling(sample);
        text.chars()
            .filter(|c| signs.contains(*c) || signs == JAPANESE && ('\u{3041}'..='\u{30ff}').contains(c))
            .count()
    };
    let found = count(encoding_rs::SHIFT_JIS, JAPANESE);
    if found >= JAPANESE_MIN && found > 2 * count(chinese, CHINESE) { encoding_rs::SHIFT_JIS } else { chinese }
}

/// Bytes of any encoding as UTF-8. What cannot be decoded becomes U+FFFD.
pub(super) struct Decoded<R> {
    bytes: R,
    decoder: Decoder,
    chunk: Vec<u8>,
    /// What of the chunk is not decoded yet.
    left: std::ops::Range<usize>,
    text: Vec<u8>,
    /// What of the text is not taken yet.
    ready: std::ops::Range<usize>,
    at_end: bool,
    done: bool,
}

impl<R: Read> Decoded<R> {
    pub(super) fn new(bytes: R, encoding: DetectedEncoding) -> Self {
        let decoder = encoding.encoding.new_decoder_with_bom_removal();
        let (chunk, text) = (vec![0; CHUNK], vec![0; CHUNK]);
        Self { bytes, decoder, chunk, left: 0..0, text, ready: 0..0, at_end: false, done: false }
    }
}

impl<R: Read> Read for Decoded<R> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        while self.ready.is_empty() && !self.done {
            if self.left.is_empty() && !self.at_end {
                let length = self.bytes.read(&mut self.chunk)?;
                self.left = 0..length;
                self.at_end = length == 0;
            }
            let (result, read, written, _) =
                self.decoder.decode_to_utf8(&self.chunk[self.left.clone()], &mut self.text, self.at_end);
            self.left.start += read;
            self.ready = 0..written;
            self.done = self.at_end && result == CoderResult::InputEmpty;
        }
        let count = to.len().min(self.ready.len());
        to[..count].copy_from_slice(&self.text[self.ready.start..self.ready.start + count]);
        self.ready.start += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text_of(bytes: &[u8]) -> (&'static str, String) {
        let input = Input::from_memory(bytes.to_vec(), "t.csv");
        let found = detect_encoding(&input).expect("readable");
        let mut text = String::new();
        Decoded::new(bytes, found).read_to_string(&mut text).expect("text");
        (found.encoding.name(), text)
    }

    #[test]
    fn the_bytes_say_which_characters_they_are() {
        assert_eq!(text_of(b"\xef\xbb\xbftime_s,a\n"), ("UTF-8", "time_s,a\n".to_owned()));
        assert_eq!(text_of(b"\xff\xfea\0b\0\n\0").1, "ab\n");
        let wide: Vec<u8> = "time_s,power_w\n0,1\n".bytes().flat_map(|byte| [byte, 0]).collect();
        assert_eq!(text_of(&wide).1, "time_s,power_w\n0,1\n");
        let line = "时间,主轴转速,主轴功率,备注\n1,800,310,正常切削\n".repeat(20);
        let (gbk, ..) = encoding_rs::GBK.encode(&line);
        assert_eq!(text_of(&gbk), ("GBK", line));
        let line = "Zeit;Kühlmittel;Prüfer\n0;1;Müller\n".repeat(20);
        let (latin, ..) = encoding_rs::WINDOWS_1252.encode(&line);
        assert_eq!(text_of(&latin), ("windows-1252", line));
    }

    #[test]
    fn japanese_words_of_the_field_are_japanese() {
        let line = "日付,時刻,電流[A],電力[kW],主軸回転速度[min-1]\n2026/03/17,08:15:00,0.9,0.3,1200\n".repeat(3);
        let (bytes, ..) = encoding_rs::SHIFT_JIS.encode(&line);
        assert_eq!(text_of(&bytes), ("Shift_JIS", line));
    }

    #[test]
    fn one_foreign_cell_at_the_end_of_a_long_file_decides() {
        let mut bytes = "time_s,run,spindle_speed_rpm\n".repeat(20_000).into_bytes();
        bytes.extend(encoding_rs::GBK.encode("1,粗车,800\n").0.iter());
        let (name, text) = text_of(&bytes);
        assert!(name.starts_with("GB") && text.ends_with("1,粗车,800\n"), "{name}");
    }
}
