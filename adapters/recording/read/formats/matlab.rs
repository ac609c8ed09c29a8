//! MAT files of MATLAB and Octave: version 5 (also compressed, also a structure of arrays) and version 4, in which Dymola and OpenModelica
//! write their results. Layouts: "MAT-File Format", MathWorks. Version 7.3 is HDF5 and is refused by name.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::UNPACKED_BYTES_MAX;
use super::super::table::{ColumnCells, ColumnTable};
use super::bytes::{ByteReader, NumberKind};
use adapter_core::bilingual::Bilingual;
use std::io::Read;

const HEADER: usize = 128;
/// Structures within structures that are followed.
const DEPTH_MAX: usize = 3;

/// A variable of numbers, stored column by column.
#[derive(Debug, Clone)]
struct Variable {
    name: String,
    rows: usize,
    values: Vec<f64>,
}

pub(super) fn is_mat(head: &[u8]) -> bool {
    head.starts_with(b"MATLAB 5.0 MAT-file")
        || head.starts_with(b"MATLAB 7.3 MAT-file")
        || header_4(&mut ByteReader::new(head, false)).is_some()
}

pub(super) fn open(input: &Input, wanted: Option<&str>) -> Result<ColumnTable, RecordingError> {
    let bytes = super::read_whole(input)?;
    if bytes.starts_with(b"MATLAB 7.3") {
        return Err(RecordingError::with_format_reason(
            &input.file,
            "a MAT file of version 7.3, which is HDF5 and is not read: save it with save(..., '-v7'), or write CSV with writetable",
            "MAT文件版本7.3（HDF5），无法读取：请用save(..., '-v7')保存，或用writetable导出CSV",
        ));
    }
    let variables = if bytes.starts_with(b"MATLAB 5.0") { version_5(&bytes) } else { version_4(&bytes) };
    let mut variables = variables.ok_or_else(|| {
        RecordingError::with_format_reason(
            &input.file,
            "the MAT file is damaged: save it again",
            "MAT文件已损坏：请重新保存",
        )
    })?;
    if let Some(wanted) = wanted {
        variables.retain(|variable| variable.name == wanted || variable.name.starts_with(&format!("{wanted}.")));
    }
    // A structure that holds everything says nothing by its name.
    let prefix = variables.first().and_then(|variable| Some(variable.name.rsplit_once('.')?.0.to_owned()));
    if let Some(prefix) =
        prefix.filter(|prefix| variables.iter().all(|variable| variable.name.starts_with(&format!("{prefix}."))))
    {
        variables.iter_mut().for_each(|variable| variable.name = variable.name[prefix.len() + 1..].to_owned());
    }
    build_table(variables, input)
}

/// Variables of the commonest length become columns; a matrix becomes several.
fn build_table(variables: Vec<Variable>, input: &Input) -> Result<ColumnTable, RecordingError> {
    let length = |variable: &Variable| if variable.rows > 1 { variable.rows } else { variable.values.len() };
    let mut lengths: Vec<usize> = variables.iter().map(length).filter(|length| *length > 1).collect();
    lengths.sort_unstable();
    let usual =
        lengths.iter().copied().max_by_key(|length| (lengths.iter().filter(|other| *other == length).count(), *length));
    let Some(usual) = usual else {
        return Err(RecordingError::with_format_reason(
            &input.file,
            "the MAT file has no array of numbers",
            "MAT文件中没有数值数组",
        ));
    };
    let others = variables.iter().filter(|variable| length(variable) != usual && length(variable) > 1).count();
    let mut form = vec![Bilingual::new("MAT file", "MAT文件")];
    if others > 0 {
        form.push(Bilingual::new(
            format!("{others} arrays of another length left out"),
            format!("{others}个长度不同的数组未读取"),
        ));
    }
    let mut columns = Vec::new();
    for variable in variables.into_iter().filter(|variable| length(variable) == usual) {
        let parts: Vec<Vec<f64>> = variable.values.chunks(usual).map(<[f64]>::to_vec).collect();
        let count = parts.len();
        for (index, part) in parts.into_iter().enumerate() {
            let name = if count == 1 { variable.name.clone() } else { format!("{}({})", variable.name, index + 1) };
            columns.push((name, ColumnCells::Numbers(part)));
        }
    }
    Ok(ColumnTable { columns, form, ..ColumnTable::default() })
}

fn version_5(bytes: &[u8]) -> Option<Vec<Variable>> {
    let is_big = bytes.get(126..128)? == b"MI";
    let mut left = ByteReader::new(bytes.get(HEADER..)?, is_big);
    let mut found = Vec::new();
    let mut budget = UNPACKED_BYTES_MAX;
    while !left.left.is_empty() {
        let Some((kind, data)) = read_element(&mut left) else { break };
        match kind {
            15 => {
                let mut plain = Vec::new();
                flate2::read::ZlibDecoder::new(data).take(budget + 1).read_to_end(&mut plain).ok()?;
                budget = budget.checked_sub(plain.len() as u64)?;
                let (kind, data) = read_element(&mut ByteReader::new(&plain, is_big))?;
                if kind == 14 {
                    read_matrix(data, is_big, "", DEPTH_MAX, &mut found);
                }
            }
            14 => {
                read_matrix(data, is_big, "", DEPTH_MAX, &mut found);
            }
            _ => {}
        }
    }
    Some(found)
}

/// Type and bytes of the next element; what follows begins at a multiple of eight, except after a compressed one.
fn read_element<'a>(bytes: &mut ByteReader<'a>) -> Option<(u32, &'a [u8])> {
    let tag = bytes.u32()?;
    if tag >> 16 != 0 {
        let data = bytes.take_bytes(4)?;
        return Some((tag & 0xffff, data.get(..usize::try_from(tag >> 16).ok()?)?));
    }
    let length = usize::try_from(bytes.u32()?).ok()?;
    let data = bytes.take_bytes(length)?;
    if tag != 15 {
        let _padding = bytes.take_bytes(length.next_multiple_of(8) - length);
    }
    Some((tag, data))
}

fn number_kind(code: u32) -> Option<NumberKind> {
    use NumberKind::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    Some(match code {
        1 => I8,
        2 => U8,
        3 => I16,
        4 => U16,
        5 => I32,
        6 => U32,
        7 => F32,
        9 => F64,
        12 => I64,
        13 => U64,
        _ => return None,
    })
}

/// Adds the numbers of an array, or of the fields of a structure. `None` where it is damaged.
fn read_matrix(data: &[u8], is_big: bool, parent: &str, depth: usize, found: &mut Vec<Variable>) -> Option<()> {
    let mut bytes = ByteReader::new(data, is_big);
    let (_, flags) = read_element(&mut bytes)?;
    let class = ByteReader::new(flags, is_big).u32()? & 0xff;
    let (_, dimensions) = read_element(&mut bytes)?;
    let dimensions: Vec<f64> = NumberKind::I32.decode_numbers(dimensions, is_big);
    let (_, own) = read_element(&mut bytes)?;
    let own = String::from_utf8_lossy(own).trim_end_matches('\0').to_owned();
    let name = if parent.is_empty() { own } else { parent.to_owned() };
    match class {
        2 if depth > 0 => {
            let (_, length) = read_element(&mut bytes)?;
            let length = usize::try_from(ByteReader::new(length, is_big).u32()?).ok().filter(|length| *length > 0)?;
            let (_, names) = read_element(&mut bytes)?;
            let fields: Vec<String> = names
                .chunks(length)
                .map(|field| String::from_utf8_lossy(field).split('\0').next().unwrap_or("").to_owned())
                .collect();
            for field in fields {
                let (kind, data) = read_element(&mut bytes)?;
                if kind == 14 {
                    read_matrix(data, is_big, &format!("{name}.{field}"), depth - 1, found);
                }
            }
        }
        6..=15 => {
            let (kind, data) = read_element(&mut bytes)?;
            let values = number_kind(kind)?.decode_numbers(data, is_big);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a dimension, as stored")]
            let rows = dimensions.first().map_or(1, |rows| rows.max(0.0) as usize);
            found.push(Variable { name, rows, values });
        }
        _ => {}
    }
    Some(())
}

/// Head of a variable of version 4.
struct Header4 {
    kind: Option<NumberKind>,
    is_big: bool,
    rows: usize,
    columns: usize,
    is_text: bool,
    is_complex: bool,
    name: String,
}

fn header_4(bytes: &mut ByteReader<'_>) -> Option<Header4> {
    let start = *bytes;
    let code = bytes.u32()?;
    let is_big = code > 0xffff;
    let mut read = ByteReader { is_big, ..start };
    let code = read.u32()?;
    let (machine, reserved, precision, kind) = (code / 1000, code / 100 % 10, code / 10 % 10, code % 10);
    let (rows, columns, imaginary, length) = (read.u32()?, read.u32()?, read.u32()?, read.u32()?);
    let plausible = machine <= 1
        && reserved == 0
        && precision <= 5
        && kind <= 1
        && imaginary <= 1
        && (1..=128).contains(&length)
        && rows > 0
        && columns > 0;
    if !plausible {
        return None;
    }
    let name = read.take_bytes(usize::try_from(length).ok()?)?;
    let name = name.strip_suffix(b"\0")?;
    let is_name = name.first().is_some_and(u8::is_ascii_alphabetic)
        && name.iter().all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_');
    if !is_name {
        return None;
    }
    bytes.left = read.left;
    let kinds = [NumberKind::F64, NumberKind::F32, NumberKind::I32, NumberKind::I16, NumberKind::U16, NumberKind::U8];
    Some(Header4 {
        kind: kinds.get(usize::try_from(precision).ok()?).copied(),
        is_big,
        rows: usize::try_from(rows).ok()?,
        columns: usize::try_from(columns).ok()?,
        is_text: kind == 1,
        is_complex: imaginary == 1,
        name: String::from_utf8_lossy(name).into_owned(),
    })
}

fn version_4(bytes: &[u8]) -> Option<Vec<Variable>> {
    let mut left = ByteReader::new(bytes, false);
    let (mut found, mut texts) = (Vec::new(), Vec::new());
    while !left.left.is_empty() {
        let header = header_4(&mut left)?;
        let kind = header.kind?;
        let size = header.rows.checked_mul(header.columns)?.checked_mul(kind.byte_size())?;
        let values = kind.decode_numbers(left.take_bytes(size)?, header.is_big);
        if header.is_complex {
            left.take_bytes(size)?;
        }
        let variable = Variable { name: header.name, rows: header.rows, values };
        if header.is_text || variable.name == "Aclass" { texts.push(variable) } else { found.push(variable) }
    }
    match texts.iter().find(|text| text.name == "name").filter(|_| texts.iter().any(|text| text.name == "Aclass")) {
        Some(names) => expand_modelica(names, &found),
        None => Some(found),
    }
}

/// A result of a Modelica tool: names as columns of letters, `dataInfo` says in which matrix and row each variable stands.
fn expand_modelica(names: &Variable, found: &[Variable]) -> Option<Vec<Variable>> {
    let of = |name: &str| found.iter().find(|variable| variable.name == name);
    let (info, data) = (of("dataInfo")?, of("data_2")?);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "letters and places, as stored")]
    let letter = |code: &f64| *code as u8 as char;
    let names: Vec<String> = names
        .values
        .chunks(names.rows)
        .map(|name| name.iter().map(letter).collect::<String>().trim_matches([' ', '\0']).to_owned())
        .collect();
    let rows = data.values.len() / data.rows.max(1);
    let mut all = Vec::new();
    for (name, info) in names.into_iter().zip(info.values.chunks(info.rows)) {
        let (matrix, place) = (*info.first()?, *info.get(1)?);
        if matrix == 1.0 {
            continue;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "letters and places, as stored")]
        let row = (place.abs() as usize).checked_sub(1)?;
        let values = (0..rows)
            .map(|time| data.values.get(row + time * data.rows).map(|x| x * place.signum()))
            .collect::<Option<Vec<f64>>>()?;
        let name = if name.eq_ignore_ascii_case("time") { "Time [s]".to_owned() } else { name };
        all.push(Variable { name, rows, values });
    }
    Some(all)
}
