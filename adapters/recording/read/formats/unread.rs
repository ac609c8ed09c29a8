//! Formats that are known and not read: refused by their names, with what to do instead.

use super::super::error::RecordingError;
use super::super::input::Input;

/// What a file is, by its beginning.
struct RefusedFormat {
    start: &'static [u8],
    name: &'static str,
    cure: &'static str,
    cure_zh: &'static str,
}

const fn define_refusal(
    start: &'static [u8],
    name: &'static str,
    cure: &'static str,
    cure_zh: &'static str,
) -> RefusedFormat {
    RefusedFormat { start, name, cure, cure_zh }
}

const PICKLE: &str = "a pickle of Python";
const TO_PARQUET: (&str, &str) = ("write Parquet in its place (to_parquet)", "请改用Parquet（to_parquet）");
const TO_CSV: (&str, &str) = ("export it as CSV or MAT (version 7)", "请导出为CSV或MAT（版本7）");
const UNPACK: (&str, &str) = ("unpack it first", "请先解压");

const REFUSED: &[RefusedFormat] = &[
    define_refusal(
        b"\x89HDF\r\n\x1a\n",
        "HDF5",
        "export it as CSV or Parquet (pandas: to_csv, to_parquet)",
        "请导出为CSV或Parquet（pandas：to_csv、to_parquet）",
    ),
    define_refusal(b"MDF     ", "an MDF file (ASAM)", TO_CSV.0, TO_CSV.1),
    define_refusal(b"UnFinMF ", "an MDF file (ASAM) that was not finished", TO_CSV.0, TO_CSV.1),
    define_refusal(b"|CF,", "a file of imc (FAMOS)", TO_CSV.0, TO_CSV.1),
    define_refusal(b"DEWE", "a file of Dewesoft", TO_CSV.0, TO_CSV.1),
    define_refusal(
        b"SQLite format 3\0",
        "a database of SQLite",
        "a history of this box is written history:FILE",
        "本网关的历史数据库请写作history:文件",
    ),
    define_refusal(
        b"ARROW1",
        "Feather (Arrow)",
        "write Parquet in its place (to_parquet)",
        "请改用Parquet（to_parquet）",
    ),
    define_refusal(b"FEA1", "Feather (version 1)", TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"RIFF", "a sound file", "export it as CSV with its rate", "请连同采样率导出为CSV"),
    define_refusal(b"7z\xbc\xaf", "a 7z archive", UNPACK.0, UNPACK.1),
    define_refusal(b"Rar!", "a RAR archive", UNPACK.0, UNPACK.1),
    define_refusal(b"%PDF", "a PDF", "export the table as CSV or xlsx", "请将表格导出为CSV或xlsx"),
    define_refusal(
        b"\x93NUMPY",
        "an array of NumPy (npy)",
        "write CSV (numpy.savetxt with a header)",
        "请写成CSV（numpy.savetxt并带表头）",
    ),
    define_refusal(b"\x80\x02", PICKLE, TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"\x80\x03", PICKLE, TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"\x80\x04\x95", PICKLE, TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"\x80\x05\x95", PICKLE, TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"ccopy_reg\n", PICKLE, TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"cnumpy", PICKLE, TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"cpandas", PICKLE, TO_PARQUET.0, TO_PARQUET.1),
    define_refusal(b"RDX3\n", "a workspace of R", "write it as CSV (write.csv)", "请导出为CSV（write.csv）"),
    define_refusal(
        b"\x28\xb5\x2f\xfd",
        "a file packed by zstd",
        "unpack it first, or pack it with gzip",
        "请先解压，或用gzip压缩",
    ),
    define_refusal(b"BZh", "a file packed by bzip2", "unpack it first, or pack it with gzip", "请先解压，或用gzip压缩"),
    define_refusal(
        b"\xfd7zXZ",
        "a file packed by xz",
        "unpack it first, or pack it with gzip",
        "请先解压，或用gzip压缩",
    ),
];

/// Endings of names whose first bytes say nothing.
const ENDINGS: [(&str, &str); 4] = [
    (".dxd", "a file of Dewesoft"),
    (".d7d", "a file of Dewesoft"),
    (".dxz", "a file of Dewesoft"),
    (".d7z", "a file of Dewesoft"),
];

/// Refuses what is known and not read.
pub(super) fn refuse_by_name(head: &[u8], input: &Input) -> Result<(), RecordingError> {
    let by_start = REFUSED.iter().find(|format| head.starts_with(format.start));
    if let Some(format) = by_start {
        return Err(build_refusal(input, format.name, (format.cure, format.cure_zh)));
    }
    let lower = input.file.to_lowercase();
    if let Some((_, name)) = ENDINGS.iter().find(|(ending, _)| lower.ends_with(ending)) {
        return Err(build_refusal(input, name, TO_CSV));
    }
    if head.get(257..262) == Some(b"ustar") {
        return Err(build_refusal(input, "a tar archive", UNPACK));
    }
    Ok(())
}

fn build_refusal(input: &Input, name: &str, (cure, cure_zh): (&str, &str)) -> RecordingError {
    RecordingError::with_format_reason(
        &input.file,
        format!("this is {name}, which is not read: {cure}"),
        format!("该文件是{name}，无法读取：{cure_zh}"),
    )
}

/// An archive that is no workbook.
pub(super) fn refuse_archive(bytes: &[u8], input: &Input) -> Result<(), RecordingError> {
    let Ok(archive) = zip::ZipArchive::new(std::io::Cursor::new(bytes)) else { return Ok(()) };
    let is_workbook = |name: &str| name == "mimetype" || name == "[Content_Types].xml" || name.starts_with("xl/");
    let names: Vec<String> = archive.file_names().filter_map(|name| Some(name.ok()?.into_owned())).collect();
    if names.is_empty() || names.iter().any(|name| is_workbook(name)) {
        return Ok(());
    }
    if names.iter().all(|name| name.ends_with(".npy")) {
        let cure = ("write CSV or Parquet, with a name for each column", "请写成CSV或Parquet，并给每列命名");
        return Err(build_refusal(input, "an archive of NumPy (npz)", cure));
    }
    let list = names.iter().take(3).map(String::as_str).collect::<Vec<_>>().join(", ");
    Err(build_refusal(input, &format!("a zip archive ({list})"), UNPACK))
}
