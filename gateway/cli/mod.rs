//! The command line: one file per subcommand, each with its arguments and one function.
//!
//! Exit codes: 0 fine, 1 the answer is no, 2 could not run. Without a subcommand the box runs.

mod annotate;
mod arm;
mod audit;
mod backup;
mod bench;
mod check;
mod commission;
mod devices;
mod diagnose;
mod diagnosis_child;
mod doctor;
mod doctor_words;
mod effects;
#[cfg(feature = "fleet")]
mod fleet;
#[cfg(feature = "fleet")]
mod fleet_resend;
mod gateway_options;
mod help;
mod help_zh;
mod history;
mod history_upkeep;
mod identify;
mod installation;
mod lang;
mod metrics;
mod model;
mod package_files;
mod person;
mod pulses;
mod recording;
mod replay;
mod rules;
mod run;
mod serve;
mod setup;
mod simulate;
mod update;
mod vendor_child;

pub(crate) use crate::cannot_run::CannotRun;
use crate::config::LogConfig;
use crate::log::{self, LogFormat};
use crate::reload::read_directory;
use ::rules::physics::explain::Language;
use ::rules::script::{Host, ScriptProblem, list_shipped_scripts};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use installation::load_configuration;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// How a command ended when it could run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandOutcome {
    /// The command ran and its answer is yes: exit code 0.
    Fine,
    /// The command ran and its answer is no: exit code 1.
    No,
}

/// What every subcommand returns.
pub type CommandResult = Result<CommandOutcome, CannotRun>;

/// The edge box of one CNC machine: polls, merges, infers, decides, remembers and explains.
#[derive(Debug, Parser)]
#[command(name = "cnc-gateway", version, args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
struct Arguments {
    #[command(flatten)]
    log: LogArguments,
    /// Language of everything that is printed; without it that of the computer (LANG).
    #[arg(long, global = true, value_enum, value_name = "LANG")]
    lang: Option<lang::Lang>,
    #[command(subcommand)]
    command: Option<CliCommand>,
    #[command(flatten)]
    run: run::RunArguments,
}

/// The engineer's log, where the command line says something about it.
#[derive(Debug, Clone, Copy, Args)]
struct LogArguments {
    /// Engineer's log on standard error: off, text or json. The operator's lines on standard output stay.
    #[arg(long, global = true, value_enum, value_name = "FORM")]
    log: Option<LogFormat>,
    /// Least level of the engineer's log: error, warn, info, debug or trace.
    #[arg(long, global = true, value_name = "LEVEL")]
    log_level: Option<tracing::Level>,
}

impl LogArguments {
    /// Starts the log; `config` is what the configuration says.
    fn start_log(self, config: &LogConfig) {
        log::start_engineer_log(self.log.unwrap_or(config.format), self.log_level.unwrap_or(config.level));
    }
}

#[derive(Debug, Subcommand)]
enum CliCommand {
    /// Poll, merge, infer, decide, store and serve (the default).
    Run(run::RunArguments),
    /// Let the gate of the gateway that runs on this box write to the machine for a time.
    Arm(arm::ArmArguments),
    /// End that at once: the machine is given back to its dial.
    Disarm(arm::OrderArguments),
    /// A feed hold or stop was seen to: the next one may pass.
    Acknowledge(arm::OrderArguments),
    /// Who may do more than read on the page: names, roles, tokens.
    Person(person::PersonArguments),
    /// Tell everything that is wrong with configuration, scripts, model and recordings.
    Check(check::CheckArguments),
    /// Run recordings through the same pipeline as fast as possible.
    Replay(replay::ReplayArguments),
    /// Measure how many ticks per second this computer can do, and what each stage costs.
    Bench(bench::BenchArguments),
    /// Ask what the box remembers: query, export, info.
    History(history::HistoryArguments),
    /// Run a model over a recording's inputs.
    Simulate(simulate::SimulateArguments),
    /// Compare a model with recordings: where they differ, which physics was left out, the model with it.
    Diagnose(diagnose::DiagnoseArguments),
    /// How a file of another program is understood; its map.
    Recording(recording::RecordingArguments),
    /// A first model of a machine; whether a model fits a recording.
    Model(model::ModelArguments),
    /// The catalogue of physical effects.
    Effects(effects::EffectsArguments),
    /// Learn a machine's numbers from recordings of it.
    Identify(identify::IdentifyArguments),
    /// What is known of this machine, what is missing, which cut or idle run to make next and why.
    Commission(commission::CommissionArguments),
    /// Everything that makes this box decide as it does, as an archive; with --history also a copy of the history.
    Backup(backup::BackupArguments),
    /// Put a backup in its place.
    Restore(backup::RestoreArguments),
    /// Note what only a person can measure: flank wear, gauge, probe, the file of a torque sensor.
    Annotate(annotate::AnnotateArguments),
    /// Insert pulses into encoder lines, prove it with a decoder, write vectors to test a device against.
    Pulses(pulses::PulsesArguments),
    /// What scripts can see, call and set.
    Rules(rules::RulesArguments),
    /// Try one address: who is there, what it answers, what is wrong and what to do next.
    Doctor(doctor::DoctorArguments),
    /// Write the devices.xml with which an MTConnect agent reads this machine (sink shdr://).
    Devices(devices::DevicesArguments),
    /// Dashboard and alert rules for Grafana and Prometheus.
    #[command(subcommand)]
    Metrics(metrics::Metrics),
    /// Many boxes, one database: NATS JetStream into PostgreSQL.
    #[cfg(feature = "fleet")]
    #[command(subcommand)]
    Fleet(fleet::Fleet),
    /// Serve the simulated machine over a real protocol, to try clients and scripts without a machine.
    #[command(subcommand)]
    Serve(serve::Served),
    /// Ask what the box needs to know, try it, and write the configuration.
    Setup(setup::SetupArguments),
    /// Install another version of the program, with the way back; at the box, as root.
    Update(update::UpdateArguments),
    /// Chapters of the handbook, and what a command takes.
    Help(help::HelpArguments),
    /// Man pages and completions of shells, for whoever makes a package.
    #[command(hide = true)]
    PackageFiles(package_files::PackageFilesArguments),
    /// The child process around a vendor's library; started by the gateway itself.
    #[command(hide = true)]
    VendorChild(vendor_child::VendorChildArguments),
    /// The child process that makes a diagnosis; started by the gateway itself.
    #[command(hide = true)]
    DiagnosisChild,
}

/// Parses the arguments of this process and does what they say.
#[must_use]
pub fn main() -> ExitCode {
    let language = lang::asked_in(std::env::args_os()).unwrap_or_else(lang::of_computer);
    let matches = build_command(language).get_matches_from(lang::move_behind_command(std::env::args_os().collect()));
    let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    lang::choose_language(arguments.lang);
    let done = dispatch_command(arguments);
    installation::hand_over_data();
    log::flush();
    match done {
        Ok(CommandOutcome::Fine) => ExitCode::SUCCESS,
        Ok(CommandOutcome::No) => ExitCode::from(1),
        Err(cannot) => {
            eprintln!("cnc-gateway: {cannot}");
            ExitCode::from(2)
        }
    }
}

/// The command line, its help in this language.
fn build_command(language: Language) -> clap::Command {
    let command = Arguments::command();
    if language == Language::Zh { help_zh::translate_command(command) } else { command }
}

fn dispatch_command(arguments: Arguments) -> CommandResult {
    let command = arguments.command.unwrap_or(CliCommand::Run(arguments.run));
    if !matches!(command, CliCommand::Run(_)) {
        arguments.log.start_log(&LogConfig { format: LogFormat::Off, level: tracing::Level::INFO });
    }
    match command {
        CliCommand::Run(run) => run::run(run, arguments.log),
        CliCommand::Arm(arm) => arm::arm_gate(arm),
        CliCommand::Disarm(order) => arm::disarm_gate(order),
        CliCommand::Acknowledge(order) => arm::acknowledge_request(order),
        CliCommand::Person(person) => person::run(person),
        CliCommand::Backup(arguments) => backup::run_backup(&arguments),
        CliCommand::Restore(arguments) => backup::run_restore(&arguments),
        CliCommand::Bench(bench) => bench::run(&bench),
        CliCommand::Check(check) => check::run(&check),
        CliCommand::Replay(replay) => replay::run(replay),
        CliCommand::History(history) => history::run(history),
        CliCommand::Simulate(simulate) => simulate::run_simulation(simulate),
        CliCommand::Diagnose(diagnose) => diagnose::diagnose_recordings(diagnose),
        CliCommand::Recording(recording) => recording::run(&recording),
        CliCommand::Model(model) => model::run(model),
        CliCommand::Effects(effects) => effects::print_effects(effects),
        CliCommand::Identify(identify) => identify::run_identification(&identify),
        CliCommand::Commission(commission) => commission::run(&commission),
        CliCommand::Annotate(annotate) => annotate::run(annotate),
        CliCommand::Pulses(pulses) => pulses::run(&pulses),
        CliCommand::Rules(rules) => rules::run(&rules),
        CliCommand::Doctor(doctor) => doctor::run_doctor(&doctor),
        CliCommand::Devices(devices) => devices::run(&devices),
        CliCommand::Metrics(metrics) => metrics::run(metrics),
        #[cfg(feature = "fleet")]
        CliCommand::Fleet(fleet) => fleet::run(fleet),
        CliCommand::Serve(served) => serve::run(&served),
        CliCommand::Setup(setup) => setup::run(&setup),
        CliCommand::Update(update) => update::run(&update),
        CliCommand::PackageFiles(files) => package_files::run(&files),
        CliCommand::Help(topic) => help::print_help(&topic),
        CliCommand::VendorChild(child) => vendor_child::run(&child),
        CliCommand::DiagnosisChild => diagnosis_child::run(),
    }
}

/// The command line as a description, for man pages and completions.
fn command_line() -> clap::Command {
    Arguments::command()
}

/// Would this process take these arguments? The first one is the name of the program.
///
/// # Errors
/// What would be printed in place of an answer.
pub fn check_arguments<T: Into<std::ffi::OsString> + Clone>(
    arguments: impl IntoIterator<Item = T>,
) -> Result<(), String> {
    match Arguments::try_parse_from(arguments) {
        Ok(_) => Ok(()),
        Err(asked) if !asked.use_stderr() => Ok(()),
        Err(refused) => Err(refused.to_string()),
    }
}

/// Prints to standard output; a reader who has gone is no error.
fn print_text(text: &str) {
    let _reader_has_gone = std::io::stdout().write_all(text.as_bytes());
}

/// Prints a document on lines of its own.
fn print_json(document: &serde_json::Value) {
    print_text(&format!("{document:#}\n"));
}

/// The operations recipe in a file.
fn recipe_from(path: &Path) -> Result<::rules::operations::Recipe, CannotRun> {
    crate::operations::read(path).map(|loaded| loaded.recipe).map_err(refuse_scripts)
}

/// Files of the user that cannot be used.
fn refuse_scripts(problems: Vec<ScriptProblem>) -> CannotRun {
    let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
    CannotRun::new(lines.join("\n"), "")
}

/// The scripts of a directory, or those that come with the gateway.
fn scripts_from(directory: Option<&Path>) -> Result<Host, CannotRun> {
    let files = directory.map_or_else(|| Ok(list_shipped_scripts()), read_directory).map_err(refuse_scripts)?;
    let mut host = Host::new();
    host.load_scripts(&files).map_err(refuse_scripts)?;
    Ok(host)
}
