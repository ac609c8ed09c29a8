//! `cnc-gateway model`: a first model of a machine, and whether a model and a recording fit before anything runs.

use super::diagnose::cannot_use_as;
use super::lang::{language, localize_text, pick_text};
use super::recording::read_typed_line;
use super::{CannotRun, CommandOutcome, CommandResult, print_text};
use crate::diagnosis::model_new::{KINDS, MATERIALS, ModelKind, NewModel};
use crate::diagnosis::{Copies, read_model, read_recordings_as, simulation, unit_check, write_output};
use clap::{Args, Subcommand};
use rules::physics::explain::Language;
use rules::twin::diagnosis::find_output_unit;
use rules::twin::text_report::{format_short_number, space_unit};
use rules::twin::{self};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct ModelArguments {
    #[command(subcommand)]
    what: ModelCommand,
}

#[derive(Debug, Subcommand)]
enum ModelCommand {
    /// Write a first model with a word about every line; what is not given is asked.
    New(NewArguments),
    /// Compare a model with the columns of recordings before anything runs: what is there, what is missing, which units are doubtful.
    Check {
        /// The model (model/1).
        #[arg(value_name = "M.toml")]
        model: PathBuf,
        /// The recordings, as for diagnose.
        #[arg(long, value_name = "R", num_args = 1.., required = true)]
        recording: Vec<String>,
        /// The map under which they are read.
        #[arg(long, value_name = "MAP.toml")]
        map: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
struct NewArguments {
    /// What is modelled.
    #[arg(value_enum)]
    kind: Option<ModelKind>,
    /// Name of the machine.
    #[arg(long, value_name = "TEXT")]
    name: Option<String>,
    /// The recorded quantity that is simulated; without it the usual one of the kind.
    #[arg(long, value_name = "COLUMN")]
    output: Option<String>,
    /// Material of the work, for kc1.1 and mc: C45, 42CrMo4, 16MnCr5, C15, X5CrNi18-10, GG25, AlMgSi1, Ti6Al4V.
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Which feed axis: x, y or z.
    #[arg(long, value_name = "AXIS")]
    axis: Option<String>,
    /// Where the model goes; without it to standard output.
    #[arg(long, value_name = "M.toml")]
    out: Option<PathBuf>,
}

pub(super) fn run(arguments: ModelArguments) -> CommandResult {
    match arguments.what {
        ModelCommand::New(new) => create_model(new),
        ModelCommand::Check { model, recording, map } => check_model(&model, &recording, map.as_ref()),
    }
}

fn create_model(arguments: NewArguments) -> CommandResult {
    let asks = std::io::stdin().is_terminal();
    let kind = arguments.kind.or_else(|| asks.then(ask_kind).flatten());
    let kind = kind.ok_or_else(|| {
        CannotRun::new(
            pick_text("which kind of model?", "要建哪种模型？"),
            "model new lathe, mill, drill, axis, spindle, thermal or series",
        )
    })?;
    if let Some(material) = &arguments.material
        && MATERIALS.iter().all(|(known, ..)| !known.eq_ignore_ascii_case(material))
    {
        let known: Vec<&str> = MATERIALS.iter().map(|(known, ..)| *known).collect();
        return Err(CannotRun::new(format!("--material {material}"), known.join(", ")));
    }
    let cuts = matches!(kind, ModelKind::Lathe | ModelKind::Mill | ModelKind::Drill);
    let material = arguments.material.or_else(|| (asks && cuts).then(ask_material).flatten());
    let word = KINDS.iter().find(|(known, ..)| *known == kind).map_or("machine", |(_, word, ..)| word);
    let new = NewModel {
        kind,
        name: arguments.name.unwrap_or_else(|| word.to_owned()),
        output: arguments.output,
        material,
        axis: arguments.axis,
    };
    let out = arguments.out.unwrap_or_else(|| PathBuf::from("-"));
    write_output(&out, &new.to_toml()).map_err(CannotRun::from_error)?;
    if out.as_os_str() != "-" {
        let path = out.display();
        print_text(pick_text(
            &format!("written: {path}\nnext: cnc-gateway model check {path} --recording FILE\n"),
            &format!("已写入：{path}\n下一步：cnc-gateway model check {path} --recording 文件\n"),
        ));
    }
    Ok(CommandOutcome::Fine)
}

fn ask_kind() -> Option<ModelKind> {
    for (index, (_, word, en, zh)) in KINDS.iter().enumerate() {
        print_text(&format!("  {} {word}: {}\n", index + 1, pick_text(en, zh)));
    }
    let text = read_typed_line()?;
    let by_number = text.parse::<usize>().ok().and_then(|number| KINDS.get(number.checked_sub(1)?));
    by_number.or_else(|| KINDS.iter().find(|(_, word, ..)| *word == text)).map(|(kind, ..)| *kind)
}

fn ask_material() -> Option<String> {
    let names: Vec<&str> = MATERIALS.iter().map(|(name, ..)| *name).collect();
    let list = names.join(", ");
    print_text(pick_text(&format!("material ({list}; Enter: C45)?\n"), &format!("工件材料（{list}；回车：C45）？\n")));
    read_typed_line().filter(|text| !text.is_empty())
}

fn check_model(path: &Path, recordings: &[String], map: Option<&PathBuf>) -> CommandResult {
    let model = read_model(path).map_err(|wrong| super::diagnose::cannot_use(&wrong))?;
    let given = read_recordings_as(recordings, map, Copies::CountOnce).map_err(|all| cannot_use_as(&all))?;
    given.warnings.iter().for_each(|warning| print_text(&format!("{}\n", localize_text(warning))));
    let examination = twin::examine_recording(&given.recording, &model);
    let (rows, runs) = (given.recording.count_rows(), given.recording.list_runs().len());
    print_text(pick_text(&format!("{rows} rows in {runs} runs\n"), &format!("{rows}行，{runs}个批次\n")));
    if let Ok(simulation) = simulation::run(&given.recording, &model, false)
        && let Some((rmse, rows)) = simulation.rmse()
    {
        let (error, unit) = (format_short_number(rmse), space_unit(find_output_unit(&model.output)));
        print_text(pick_text(
            &format!("the model as given misses {} by {error}{unit} over {rows} rows\n", model.output),
            &format!("按给定模型，{}的误差为{error}{unit}（{rows}行）\n", model.output),
        ));
    }
    let doubts = unit_check::find_input_doubts(&given.recording, &model);
    for doubt in &doubts {
        print_text(&format!("{}{}\n", pick_text("unit? ", "单位？"), localize_text(&doubt.text)));
    }
    examination.notes.iter().for_each(|note| print_text(&format!("{}{note}\n", pick_text("note: ", "提示："))));
    examination
        .unusable
        .iter()
        .for_each(|problem| print_text(&format!("{}{problem}\n", pick_text("missing: ", "缺少："))));
    let fine = examination.unusable.is_empty() && doubts.is_empty();
    let closing = match (fine, language()) {
        (true, Language::En) => "model and recording fit: cnc-gateway diagnose\n",
        (true, Language::Zh) => "模型与记录相符：可运行cnc-gateway diagnose\n",
        (false, Language::En) => "not yet: see above\n",
        (false, Language::Zh) => "尚不能使用：见上\n",
    };
    print_text(closing);
    Ok(if fine { CommandOutcome::Fine } else { CommandOutcome::No })
}
