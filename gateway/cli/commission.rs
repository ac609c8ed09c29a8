//! `cnc-gateway commission`: what is known of this machine, what is missing, what to do next and why.

use super::{CannotRun, CommandOutcome, CommandResult, load_configuration, print_json, print_text};
use crate::commission::annotations::{self, Annotation};
use crate::commission::columns::Merged;
use crate::commission::learn::{Learned, learn_parts, prepare_recording};
use crate::commission::picture::render_page;
use crate::commission::plan::{self, Limits, Which};
use crate::config::Config;
use crate::diagnosis::write_output;
use crate::history::{Reader, store_wear_model};
use crate::{clock, identification, moment};
use clap::Args;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct CommissionArguments {
    /// Configuration of the box; without it that of the installed box, or the built-in one.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Look at the history from then on: 2026-01-31T08:15:00Z or -8h; without it at all of it.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    from: Option<String>,
    /// Write what was learned where the box reads it: settings into the scripts, the wear model into the library, the thermal law
    /// and a page with the fits into the data directory.
    #[arg(long)]
    write: bool,
    /// Flank wear at which an edge is worn, mm.
    #[arg(long, value_name = "MM", default_value_t = 0.3)]
    criterion_mm: f64,
    /// Print JSON (commission/1).
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    plan: PlanArguments,
}

/// The list to make instead.
#[derive(Debug, Args)]
struct PlanArguments {
    /// Print this list of cuts and idle runs instead.
    #[arg(long = "plan", value_enum, value_name = "LIST")]
    which: Option<Which>,
    /// Write the list as a plan that simulate --machine carries out.
    #[arg(long, value_name = "PLAN.csv", requires = "which")]
    out: Option<PathBuf>,
    /// Speeds to idle at.
    #[arg(long, value_name = "RPM,RPM,..", value_delimiter = ',', default_value = "300,450,600,750,900,1000")]
    speeds_rpm: Vec<f64>,
    /// Three cutting speeds, m/min: of the L27 and of the cuts with the torque sensor.
    #[arg(long, value_name = "A,B,C", value_delimiter = ',', default_value = "100,140,180")]
    cutting_speeds_m_min: Vec<f64>,
    /// Three feeds of the L27, mm/rev.
    #[arg(long, value_name = "A,B,C", value_delimiter = ',', default_value = "0.12,0.2,0.3")]
    feeds_mm: Vec<f64>,
    /// Three depths of the L27, mm.
    #[arg(long, value_name = "A,B,C", value_delimiter = ',', default_value = "0.5,1.5,2.5")]
    depths_mm: Vec<f64>,
    /// Diameter of the work.
    #[arg(long, value_name = "MM", default_value_t = 60.0)]
    diameter_mm: f64,
    /// Seed of the order of the L27.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(super) fn run(arguments: &CommissionArguments) -> CommandResult {
    if let Some(which) = arguments.plan.which {
        return print_plan(which, &arguments.plan);
    }
    let config = load_configuration(arguments.config.as_deref())?;
    let noted = annotations::read(&config.gateway.data_dir).map_err(CannotRun::from_error)?;
    let Some((first_ns, newest_ns)) = read_span(&config.history.path)? else {
        let next = "start the box with this configuration and let it record: `cnc-gateway run --config FILE`";
        return print_answer(
            arguments,
            &format!("nothing is known yet: the history {} is empty\nnext: {next}\n", config.history.path.display()),
            &json!({ "schema": "commission/1", "parts": [], "next": next }),
        );
    };
    let from = arguments
        .from
        .as_deref()
        .map(|text| moment::parse(text, newest_ns))
        .transpose()
        .map_err(CannotRun::from_error)?;
    let (recording, merged) = prepare_recording(&config.history.path, &noted, from).map_err(CannotRun::from_error)?;
    let learned = learn_parts(&recording, merged, &config.gateway.machine.name, arguments.criterion_mm);
    let written = if arguments.write { write(&config, &learned)? } else { Vec::new() };
    let text = describe_learned(&learned, &noted, &written, (from.unwrap_or(first_ns), newest_ns));
    if arguments.write {
        let path = config.gateway.data_dir.join("commission.html");
        write_output(&path, &render_page(&config.gateway.machine.name, &text, &learned.pictures))
            .map_err(CannotRun::from_error)?;
    }
    let document = learned_to_json(&learned, &written, (from.unwrap_or(first_ns), newest_ns));
    print_answer(arguments, &text, &document)
}

fn print_answer(arguments: &CommissionArguments, text: &str, document: &Value) -> CommandResult {
    if arguments.json {
        print_json(document)
    } else {
        print_text(text)
    }
    let missing = document["next"].as_str().is_some_and(|next| !next.is_empty());
    Ok(if missing { CommandOutcome::No } else { CommandOutcome::Fine })
}

fn read_span(history: &Path) -> Result<Option<(i64, i64)>, CannotRun> {
    if !history.exists() {
        return Ok(None);
    }
    Reader::open(history)
        .and_then(|reader| reader.read_present_span())
        .map_err(|error| CannotRun::new(error.to_string(), ""))
}

fn print_plan(which: Which, arguments: &PlanArguments) -> CommandResult {
    let limits = Limits {
        speeds_rpm: arguments.speeds_rpm.clone(),
        cutting_speeds_m_min: arguments.cutting_speeds_m_min.clone(),
        feeds_mm: arguments.feeds_mm.clone(),
        depths_mm: arguments.depths_mm.clone(),
        diameter_mm: arguments.diameter_mm,
        seed: arguments.seed,
    };
    let numbers = [&limits.speeds_rpm, &limits.cutting_speeds_m_min, &limits.feeds_mm, &limits.depths_mm];
    let usable = |number: &f64| number.is_finite() && *number > 0.0;
    if numbers.into_iter().flatten().chain([&limits.diameter_mm]).any(|number| !usable(number)) {
        return Err(CannotRun::new("a speed, feed, depth or diameter of the list is not greater than 0", ""));
    }
    let steps = plan::plan_steps(which, &limits).map_err(CannotRun::from_error)?;
    if let Some(path) = &arguments.out {
        write_output(path, &plan::format_csv(&steps, limits.diameter_mm)).map_err(CannotRun::from_error)?;
    }
    print_text(&plan::format_text(&steps, limits.diameter_mm));
    Ok(CommandOutcome::Fine)
}

/// Writes everything that was learned; what and where.
fn write(config: &Config, learned: &Learned) -> Result<Vec<String>, CannotRun> {
    let mut written = Vec::new();
    let mut file = |path: PathBuf, text: &str| {
        write_output(&path, text).map_err(CannotRun::from_error)?;
        written.push(path.display().to_string());
        Ok::<_, CannotRun>(())
    };
    let say = |error: std::io::Error| CannotRun::new(format!("{}: {error}", config.scripts.directory.display()), "");
    let scripts = [
        ("no_load.rhai", learned.no_load.as_ref().map(|it| it.format_script())),
        ("load_loss.rhai", learned.load_loss.as_ref().map(|it| it.format_script())),
    ];
    for (name, script) in scripts {
        if let Some(script) = script {
            std::fs::create_dir_all(&config.scripts.directory).map_err(say)?;
            file(config.scripts.directory.join(name), &script)?;
        }
    }
    if let Some(model) = &learned.thermal {
        let text = model.to_json_text().map_err(CannotRun::from_error)?;
        file(config.gateway.data_dir.join("thermal_model.json"), &text)?;
        written.push(
            "write model = \"thermal_model.json\" under [thermal], with its path from the configuration file"
                .to_owned(),
        );
    }
    if let Some(record) = &learned.wear {
        let now_ns = clock::now_ns();
        let id = store_wear_model(&config.history.path, now_ns, record)
            .map_err(|error| CannotRun::new(error.to_string(), ""))?;
        written.push(format!("wear model {id} in {}", config.history.path.display()));
    }
    for (subject, found) in &learned.found {
        let path = identification::save_answer(&config.gateway.data_dir, subject, found);
        written.push(path.map_err(CannotRun::from_error)?.display().to_string());
    }
    written.push(config.gateway.data_dir.join("commission.html").display().to_string());
    Ok(written)
}

fn describe_learned(
    learned: &Learned,
    noted: &[Annotation],
    written: &[String],
    (from_ns, to_ns): (i64, i64),
) -> String {
    let mut text = format!(
        "history from {} to {}; {} annotations\n\n",
        moment::format_utc(from_ns),
        moment::format_utc(to_ns),
        noted.len()
    );
    for part in &learned.parts {
        let _ = match &part.known {
            Ok(known) => writeln!(text, "known    {:<10} {known}", part.name),
            Err(why) => writeln!(text, "missing  {:<10} {why}", part.name),
        };
    }
    for merged in &learned.merged {
        text.push_str(&of_file(merged));
    }
    match learned.parts.iter().find(|part| part.known.is_err()) {
        None => text.push_str("\neverything is known\n"),
        Some(part) => {
            let _ = write!(text, "\nnext: {}, about {:.0} min\n  {}\n", part.name, part.minutes, part.next);
        }
    }
    if !written.is_empty() {
        let _ = write!(text, "\nwritten:\n  {}\n", written.join("\n  "));
    }
    text
}

fn of_file(merged: &Merged) -> String {
    match &merged.matched {
        Ok(it) => format!(
            "torque   {}: its clock is {:+.2} s off, drifting {:.0} ppm; correlation {:.3}, elsewhere at most {:.3}\n",
            merged.file,
            it.lag_s,
            1e6 * it.drift,
            it.correlation,
            it.rival
        ),
        Err(why) => format!("torque   {}: cannot be laid beside the history: {why}\n", merged.file),
    }
}

fn learned_to_json(learned: &Learned, written: &[String], (from_ns, to_ns): (i64, i64)) -> Value {
    let parts: Vec<Value> = learned
        .parts
        .iter()
        .map(|part| {
            let (known, why) = match &part.known {
                Ok(known) => (json!(known), Value::Null),
                Err(why) => (Value::Null, json!(why)),
            };
            json!({ "part": part.name, "known": known, "missing": why, "next": part.next, "minutes": part.minutes })
        })
        .collect();
    let files: Vec<Value> = learned
        .merged
        .iter()
        .map(|it| match &it.matched {
            Ok(found) => {
                json!({ "file": it.file, "lag_s": found.lag_s, "drift": found.drift, "correlation": found.correlation })
            }
            Err(why) => json!({ "file": it.file, "refused": why }),
        })
        .collect();
    let next = learned.parts.iter().find(|part| part.known.is_err()).map_or("", |part| part.next.as_str());
    json!({ "schema": "commission/1", "from": moment::format_utc(from_ns), "to": moment::format_utc(to_ns), "parts": parts, "torque": files,
            "load_loss": learned.load_loss, "next": next, "written": written })
}
