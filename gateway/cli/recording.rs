//! `cnc-gateway recording`: how a foreign file is read, and the map that says it.

use super::lang::{localize_text, pick_text};
use super::{CannotRun, CommandOutcome, CommandResult, print_text};
use crate::diagnosis::map_file::{MapProposal, ProposalError, first_rows, verify_proposal};
use crate::diagnosis::{describe_reading, describe_refusals, loses_too_much, write_output};
use adapters::channel::ChannelId;
use adapters::channel::unit::Unit;
use adapters::recording::Mapping;
use adapters::recording::read::{Preview, preview_recording};
use clap::{Args, Subcommand};
use std::io::{BufRead, IsTerminal};
use std::path::{Path, PathBuf};

/// Rows and columns that are shown.
const SHOWN: (usize, usize) = (5, 8);

#[derive(Debug, Args)]
pub(super) struct RecordingArguments {
    #[command(subcommand)]
    what: RecordingCommand,
}

#[derive(Debug, Subcommand)]
enum RecordingCommand {
    /// Tell how a file is read, and show its first rows.
    Show(RecordingFile),
    /// Propose the map of a file (map/1), ask where something is unsure, write it beside the file.
    Map {
        #[command(flatten)]
        file: RecordingFile,
        /// Where the map goes; - for standard output. Without it FILE.map.toml, which is found by itself when FILE is read.
        #[arg(long, value_name = "MAP.toml")]
        out: Option<PathBuf>,
        /// Ask nothing: what is unsure keeps its own name.
        #[arg(long)]
        yes: bool,
    },
}

#[derive(Debug, Args)]
struct RecordingFile {
    /// The file: CSV, Excel, OpenDocument, LabVIEW (lvm, tdms), MATLAB (to version 7), Parquet, MTConnect.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// A map that is taken into account.
    #[arg(long, value_name = "MAP.toml")]
    map: Option<PathBuf>,
}

pub(super) fn run(arguments: &RecordingArguments) -> CommandResult {
    match &arguments.what {
        RecordingCommand::Show(file) => show_file(file),
        RecordingCommand::Map { file, out, yes } => map(file, out.as_deref(), *yes),
    }
}

fn preview_file(file: &RecordingFile) -> Result<(Preview, Mapping), CannotRun> {
    let beside = Mapping::build_path_beside(&file.file);
    let path = file.map.clone().or_else(|| beside.is_file().then_some(beside));
    let mapping = path
        .map_or_else(|| Ok(Mapping::default()), |path| Mapping::read(&path))
        .map_err(|wrong| CannotRun::new(wrong.to_string(), ""))?;
    let found = preview_recording(&file.file, &mapping)
        .map_err(|error| CannotRun::new(pick_text(&error.to_string(), &error.describe_in_chinese()), ""))?;
    Ok((found, mapping))
}

fn show_file(file: &RecordingFile) -> CommandResult {
    let (found, _) = preview_file(file)?;
    print_preview(&found, &file.file)
}

/// What was assumed, and the first rows. Where more is refused than a recording may lose, the answer is no.
fn print_preview(found: &Preview, path: &Path) -> CommandResult {
    let name = path.display().to_string();
    let read = found
        .read
        .as_ref()
        .map_err(|error| CannotRun::new(pick_text(&error.to_string(), &error.describe_in_chinese()), ""))?;
    describe_reading(&name, read).iter().for_each(|line| print_text(&format!("{}\n", localize_text(line))));
    let rows = read.recording.count_rows();
    let refused = read.refused;
    print_text(pick_text(&format!("{rows} rows, {refused} refused\n"), &format!("{rows}行，拒绝{refused}行\n")));
    print_text(&first_rows(&read.recording, SHOWN.0, SHOWN.1));
    if let Some(refusals) = describe_refusals(&name, read) {
        print_text(&format!("{}\n", localize_text(&refusals)));
    }
    Ok(if loses_too_much(read) { CommandOutcome::No } else { CommandOutcome::Fine })
}

fn map(file: &RecordingFile, out: Option<&Path>, yes: bool) -> CommandResult {
    let beside = Mapping::build_path_beside(&file.file);
    let out = out.unwrap_or(&beside);
    if out.is_file() {
        return keep_map(file, out);
    }
    let (found, base) = preview_file(file)?;
    let mut proposal = MapProposal::from_preview(&found, &base);
    let asks = !yes && std::io::stdin().is_terminal();
    let answered = if asks { ask_all(&mut proposal, &found) } else { Vec::new() };
    let statement =
        found.read.as_ref().map(adapters::recording::ReadRecording::describe_assumptions).unwrap_or_default();
    let name = file.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let text = proposal.to_toml(&statement, &name);
    let after = verify_proposal(&file.file, &text, found, &answered).map_err(|error| {
        let zh = match &error {
            ProposalError::ReadsOtherwise(difference) => {
                format!("未写入映射文件：按它读取结果会不同（{}）；不用映射文件即可读取", difference.zh)
            }
            ProposalError::Invalid(wrong) => format!("映射文件无效：{wrong}"),
        };
        CannotRun::new(pick_text(&error.to_string(), &zh), "")
    })?;
    write_output(out, &text).map_err(CannotRun::from_error)?;
    if out.as_os_str() == "-" {
        return Ok(CommandOutcome::Fine);
    }
    let unsure = if asks { 0 } else { proposal.open_questions().len() };
    let path = out.display();
    if unsure > 0 {
        let en = format!("{unsure} columns are not sure and keep their names; they are marked in {path}\n");
        print_text(pick_text(&en, &format!("{unsure}列不能确定，保留原名；已在{path}中标出\n")));
    }
    let outcome = print_preview(&after, &file.file)?;
    print_text(pick_text(&format!("written: {path}\n"), &format!("已写入：{path}\n")));
    Ok(outcome)
}

/// A map that is there already may hold what a person has written: a unit, a factor, a zone. It stays, and is shown.
fn keep_map(file: &RecordingFile, map: &Path) -> CommandResult {
    let outcome = show_file(&RecordingFile { file: file.file.clone(), map: Some(map.to_owned()) })?;
    let path = map.display();
    print_text(pick_text(
        &format!("kept: {path}; edit it, remove it first, or name another with --out\n"),
        &format!("保留：{path}；请编辑它、先删除它，或用--out指定其他文件\n"),
    ));
    Ok(outcome)
}

/// One question for each column that may be one of ours, and one for the time where none is known. Names, before and after, of the columns that a
/// person has decided about.
fn ask_all(proposal: &mut MapProposal, found: &Preview) -> Vec<String> {
    if found.read.is_err() && proposal.columns.iter().all(|column| !column.is_time) {
        ask_time(proposal);
    }
    let mut answered = Vec::new();
    for index in proposal.open_questions() {
        let column = proposal.columns[index].clone();
        let mut options: Vec<String> = column.candidates.iter().map(|name| (*name).to_owned()).collect();
        options.push(pick_text("keep its own name", "保留原名").to_owned());
        options.push(pick_text("leave it out", "不读取").to_owned());
        print_text(&format!(
            "{}\n",
            pick_text(&format!("{}: what is it?", column.name), &format!("{}：是什么？", column.name))
        ));
        let Some(chosen) = ask_choice(&options) else { continue };
        let own = column.to.clone().unwrap_or_else(|| column.name.clone());
        let to = match options.len() - chosen {
            1 => String::new(),
            2 => own.clone(),
            _ => options[chosen].clone(),
        };
        let unit =
            unit_needed(&to, &found.columns[index_of(found, &column.from)].unit).then(|| ask_unit(&to)).flatten();
        answered.extend([own, to.clone()]);
        (proposal.columns[index].to, proposal.columns[index].unit) = (Some(to), unit);
    }
    answered
}

/// Which column is the time, or at which step the rows follow one another.
fn ask_time(proposal: &mut MapProposal) {
    let mut options: Vec<String> = proposal.columns.iter().map(|column| column.from.clone()).collect();
    options.push(pick_text("none: the rows follow one another at an even step", "没有：各行等间隔").to_owned());
    print_text(pick_text("Which column is the time?\n", "哪一列是时间？\n"));
    match ask_choice(&options) {
        Some(index) if index + 1 == options.len() => {
            print_text(pick_text("how many seconds from one row to the next?\n", "相邻两行间隔多少秒？\n"));
            let step_s = read_typed_line().and_then(|text| text.replace(',', ".").parse::<f64>().ok());
            proposal.step = step_s.filter(|step_s| step_s.is_finite() && *step_s > 0.0);
        }
        Some(index) => proposal.time = Some(options[index].clone()),
        None => {}
    }
}

fn index_of(found: &Preview, from: &str) -> usize {
    found.columns.iter().position(|column| column.from == from).unwrap_or(0)
}

/// A number of ours whose unit the file does not say.
fn unit_needed(to: &str, said: &Option<String>) -> bool {
    said.is_none() && ChannelId::from_name(to).is_some_and(|id| !["", "1"].contains(&id.channel().unit))
}

fn ask_unit(to: &str) -> Option<String> {
    let own = ChannelId::from_name(to)?.channel().unit;
    print_text(pick_text(&format!("in which unit? (Enter: {own})\n"), &format!("单位是什么？（回车：{own}）\n")));
    let text = read_typed_line()?;
    let known = Unit::from_symbol(&text).is_some();
    if !known && !text.is_empty() {
        print_text(pick_text("that unit is not known; the file says what stands there\n", "未知单位，忽略\n"));
    }
    known.then_some(text)
}

/// Shows numbered choices; `None` where nothing usable was typed.
fn ask_choice(options: &[String]) -> Option<usize> {
    for (index, option) in options.iter().enumerate() {
        print_text(&format!("  {} {option}\n", index + 1));
    }
    read_typed_line()?.parse::<usize>().ok()?.checked_sub(1).filter(|index| *index < options.len())
}

/// What was typed; `None` at the end of the input.
pub(super) fn read_typed_line() -> Option<String> {
    let mut text = String::new();
    std::io::stdin().lock().read_line(&mut text).ok().filter(|length| *length > 0)?;
    Some(text.trim().to_owned())
}
