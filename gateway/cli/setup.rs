//! `cnc-gateway setup`: the questions that a box needs answered, each tried at once, and the configuration from the answers.

use super::installation::note_data_dir;
use super::{CannotRun, CommandOutcome, CommandResult, lang, print_text};
use crate::access::{self, Persons};
use crate::doctor;
use crate::setup::{AddressRange, SetupAnswers, scan_for_controls};
use ::rules::physics::explain::Language;
use clap::Args;
use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Configuration of a box that the service manager starts.
const CONFIGURATION: &str = "/etc/cnc-gateway/cnc-gateway.toml";
/// Data directory of a box that the service manager starts.
const DATA_DIR: &str = "/var/lib/cnc-gateway";

/// Arguments of `setup`. What is not given is asked for, where there is a terminal.
#[derive(Debug, Args)]
pub(super) struct SetupArguments {
    /// The configuration to write.
    #[arg(long, value_name = "FILE", default_value = CONFIGURATION)]
    out: PathBuf,
    /// Directory of the data of the box.
    #[arg(long, value_name = "DIR", default_value = DATA_DIR)]
    data_dir: PathBuf,
    /// Name of the machine.
    #[arg(long)]
    name: Option<String>,
    /// Address of the control, for example fanuc://192.168.1.10:8193, or none.
    #[arg(long, value_name = "ADDRESS")]
    control: Option<String>,
    /// Address of a meter, for example "modbus-tcp://192.168.1.20?profile=sdm630"; several times, or none.
    #[arg(long, value_name = "ADDRESS")]
    meter: Vec<String>,
    /// Other computers may open the page: over TLS, with a token.
    #[arg(long)]
    page_from_network: bool,
    /// Name of the person who may change everything.
    #[arg(long, value_name = "NAME")]
    admin: Option<String>,
    /// Ask nothing: what is not given has its default.
    #[arg(long)]
    yes: bool,
    /// Look for controls in this range first, for example 192.168.1.0/24.
    #[arg(long, value_name = "RANGE")]
    scan: Option<AddressRange>,
}

/// A text in both languages.
type Words = (&'static str, &'static str);

/// Asks on the terminal, in one language.
struct Dialogue {
    zh: bool,
    asks: bool,
}

impl Dialogue {
    fn pick_text(&self, words: Words) -> &'static str {
        if self.zh { words.1 } else { words.0 }
    }

    fn print_words(&self, words: Words) {
        print_text(&format!("{}\n", self.pick_text(words)));
    }

    /// The answer; empty where nothing is asked or nothing was typed.
    fn ask_question(&self, words: Words, default: &str) -> Result<String, CannotRun> {
        if !self.asks {
            return Ok(default.to_owned());
        }
        let shown = if default.is_empty() { String::new() } else { format!(" [{default}]") };
        print_text(&format!("{}{shown}: ", self.pick_text(words)));
        let _shown = std::io::stdout().flush();
        let mut line = String::new();
        let read = std::io::stdin().lock().read_line(&mut line);
        match read {
            // Answers that are piped in may end before the last question: the rest has its default.
            Ok(0) if !std::io::stdin().is_terminal() => Ok(default.to_owned()),
            Ok(0) | Err(_) => Err(CannotRun::new("the answers ended before the last question", "nothing was written")),
            Ok(_) if line.trim().is_empty() => Ok(default.to_owned()),
            Ok(_) => Ok(line.trim().to_owned()),
        }
    }

    fn ask_confirmation(&self, words: Words, default: bool) -> Result<bool, CannotRun> {
        let answer = self.ask_question(words, if default { "y" } else { "n" })?.to_lowercase();
        Ok(["y", "yes", "j", "是", "1"].contains(&answer.as_str()))
    }
}

pub(super) fn run(arguments: &SetupArguments) -> CommandResult {
    let asks = !arguments.yes;
    let mut dialogue = Dialogue { zh: lang::language() == Language::Zh, asks };
    let language = choose_language(&mut dialogue)?;
    let machine = match &arguments.name {
        Some(name) => name.clone(),
        None => dialogue.ask_question(("Name of the machine", "机床名称"), &host_name())?,
    };
    if let Some(range) = arguments.scan {
        list_controls(&dialogue, range);
    }
    let control = choose_control(&dialogue, arguments.control.as_deref())?;
    let meters = choose_meters(&dialogue, &arguments.meter)?;
    let page_from_network = arguments.page_from_network
        || dialogue.ask_confirmation(
            (
                "May other computers open the page (over TLS, with a token)?",
                "允许其他电脑打开页面吗(TLS 加密,需要令牌)?",
            ),
            false,
        )?;
    if control.is_none() && meters.is_empty() {
        let next = "give --control ADDRESS or --meter ADDRESS; simulated://lathe is a machine to try with";
        return Err(CannotRun::new("a box needs a control or a meter", next));
    }
    note_data_dir(&arguments.data_dir);
    // What is started with this file must find the persons that are made here. Only the service of the package knows its directory by
    // itself, and only for its own configuration.
    let of_service = arguments.out.as_os_str() == CONFIGURATION && arguments.data_dir.as_os_str() == DATA_DIR;
    let data_dir = Some(&arguments.data_dir).filter(|_| !of_service);
    let data_dir = data_dir.map(std::path::absolute).transpose().map_err(CannotRun::from_error)?;
    let answers = SetupAnswers { machine, language, data_dir, control, meters, page_from_network };
    write_configuration(&dialogue, arguments, &answers)?;
    add_administrator(&dialogue, arguments)?;
    dialogue.print_words((
        "Now: systemctl restart cnc-gateway, and open the page. Everything can be changed later, on the page or in the file.",
        "下一步:systemctl restart cnc-gateway,然后打开页面。以后都可以在页面或文件中修改。",
    ));
    Ok(CommandOutcome::Fine)
}

/// Asks in which language the questions and the page are, unless the command line says it. `None`: the page opens in the language of the
/// browser.
fn choose_language(dialogue: &mut Dialogue) -> Result<Option<Language>, CannotRun> {
    if lang::was_asked() || !dialogue.asks {
        return Ok(dialogue.zh.then_some(Language::Zh));
    }
    let default = if dialogue.zh { "zh" } else { "en" };
    let question = ("Language 语言: en, zh", "语言 Language: zh, en");
    loop {
        match dialogue.ask_question(question, default)?.to_lowercase().as_str() {
            "en" | "english" => {
                dialogue.zh = false;
                return Ok(Some(Language::En));
            }
            "zh" | "中文" | "chinese" => {
                dialogue.zh = true;
                return Ok(Some(Language::Zh));
            }
            other => print_text(&format!("  {other}: en, zh\n")),
        }
    }
}

fn host_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    if name.trim().is_empty() { "machine".to_owned() } else { name.trim().to_owned() }
}

fn list_controls(dialogue: &Dialogue, range: AddressRange) {
    let found = scan_for_controls(range);
    if found.is_empty() {
        dialogue.print_words(("Nothing in this range listens where a control would.", "该范围内没有发现数控系统。"));
    }
    for control in found {
        print_text(&format!("  {}\n", control.address));
    }
}

/// What one look at an address says.
enum LookedAt {
    /// It is no address, or cannot be opened.
    Unusable,
    /// It can be used, with problems.
    Doubtful,
    Good,
}

/// Opens the address once and shows what it says.
fn show_address(dialogue: &Dialogue, address: &str) -> LookedAt {
    let report = match doctor::examine_text(address) {
        Ok(report) => report,
        Err(what) => {
            print_text(&format!("  {what}\n"));
            return LookedAt::Unusable;
        }
    };
    let known = report.readings.iter().filter(|(_, value)| value.is_ok()).count();
    let answers = if report.reachable { ("answers", "有应答") } else { ("does not answer", "无应答") };
    print_text(&format!("  {address}: {}, {known} / {}\n", dialogue.pick_text(answers), report.readings.len()));
    for problem in &report.problems {
        print_text(&format!("  ! {}\n    {}\n", problem.what, problem.next));
    }
    if report.problems.is_empty() { LookedAt::Good } else { LookedAt::Doubtful }
}

/// Shows what an address says, and asks where there is a doubt. True when it may be used.
fn try_address(dialogue: &Dialogue, address: &str) -> Result<bool, CannotRun> {
    match show_address(dialogue, address) {
        LookedAt::Unusable => Ok(false),
        LookedAt::Good => Ok(true),
        LookedAt::Doubtful => dialogue.ask_confirmation(("Use it all the same?", "仍然使用吗?"), false),
    }
}

fn choose_control(dialogue: &Dialogue, given: Option<&str>) -> Result<Option<String>, CannotRun> {
    if let Some(given) = given {
        let address = complete_address(given, "fanuc");
        // A control that is off today is written all the same: whoever gave the address means it.
        if let Some(address) = &address {
            show_address(dialogue, address);
        }
        return Ok(address);
    }
    let question = (
        "Control: an address such as fanuc://192.168.1.10, nclink://BROKER/SERIAL, simulated://lathe, \"scan 192.168.1.0/24\", or none",
        "数控系统:地址如 fanuc://192.168.1.10、nclink://BROKER/SERIAL、simulated://lathe,或 \"scan 192.168.1.0/24\",或 none",
    );
    loop {
        let answer = dialogue.ask_question(question, "none")?;
        if let Some(range) = answer.strip_prefix("scan ") {
            match range.trim().parse() {
                Ok(range) => list_controls(dialogue, range),
                Err(error) => print_text(&format!("  {error}\n")),
            }
            continue;
        }
        match complete_address(&answer, "fanuc") {
            None => return Ok(None),
            Some(address) if try_address(dialogue, &address)? => return Ok(Some(address)),
            Some(_) => {}
        }
    }
}

fn choose_meters(dialogue: &Dialogue, given: &[String]) -> Result<Vec<String>, CannotRun> {
    if !given.is_empty() {
        let meters: Vec<String> = given.iter().filter_map(|given| complete_address(given, "modbus-tcp")).collect();
        for meter in &meters {
            show_address(dialogue, meter);
        }
        return Ok(meters);
    }
    let question = (
        "Power meter: an address such as modbus-tcp://192.168.1.20?profile=sdm630 or modbus-rtu:///dev/ttyUSB0?profile=sdm630&unit=1, or none",
        "功率计:地址如 modbus-tcp://192.168.1.20?profile=sdm630 或 modbus-rtu:///dev/ttyUSB0?profile=sdm630&unit=1,或 none",
    );
    let mut meters = Vec::new();
    loop {
        match complete_address(&dialogue.ask_question(question, "none")?, "modbus-tcp") {
            None => return Ok(meters),
            Some(address) => {
                if try_address(dialogue, &address)? {
                    meters.push(address);
                }
            }
        }
    }
}

/// `None` for "none"; a bare host gets the scheme.
fn complete_address(answer: &str, scheme: &str) -> Option<String> {
    match answer.trim() {
        "" | "none" | "无" => None,
        address if address.contains("://") => Some(address.to_owned()),
        host => Some(format!("{scheme}://{host}")),
    }
}

/// Writes the file when `check` passes it. What was there before is kept beside it.
fn write_configuration(
    dialogue: &Dialogue,
    arguments: &SetupArguments,
    answers: &SetupAnswers,
) -> Result<(), CannotRun> {
    let (out, text) = (&arguments.out, answers.render_configuration());
    let base = out.parent().unwrap_or(Path::new(""));
    crate::config::parse(&out.display().to_string(), &text, base, []).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        CannotRun::new(lines.join("\n"), "nothing was written")
    })?;
    let cannot = |error: std::io::Error| {
        CannotRun::new(format!("{}: {error}", out.display()), "run it as root, or name another file with --out")
    };
    if out.exists() {
        let before = out.with_extension("before.toml");
        let text = std::fs::read_to_string(out).map_err(cannot)?;
        crate::files::replace_durably(&before, &text).map_err(cannot)?;
        print_text(&format!("{}: {}\n", dialogue.pick_text(("what was there before", "原来的配置")), before.display()));
    }
    crate::files::replace_durably(out, &text).map_err(cannot)?;
    print_text(&format!("{}: {}\n", dialogue.pick_text(("written", "已写入")), out.display()));
    Ok(())
}

/// The person who may change everything, whose token is shown once. Whom the first start has made is removed: that token may stand in a
/// log.
fn add_administrator(dialogue: &Dialogue, arguments: &SetupArguments) -> Result<(), CannotRun> {
    let path = access::persons_path(&arguments.data_dir);
    let cannot =
        |error: access::PersonsError| CannotRun::new(error.to_string(), "cnc-gateway person add NAME --role admin");
    let mut persons = Persons::read(&path).map_err(cannot)?.unwrap_or_default();
    let is_managed = persons.list_entries().iter().any(|entry| entry.first.is_none());
    if is_managed && arguments.admin.is_none() {
        return Ok(());
    }
    let name = match &arguments.admin {
        Some(name) => name.clone(),
        None => dialogue.ask_question(
            ("Your name (you may change everything on the page)", "您的姓名(可在页面上修改全部内容)"),
            "admin",
        )?,
    };
    let (token, revoked) = persons.replace_first(&name, "setup").map_err(cannot)?;
    persons.write(&path).map_err(cannot)?;
    print_text(&format!(
        "{} {name}: {}\n",
        dialogue.pick_text(("token, shown only now, of", "令牌(仅显示一次):")),
        token.text()
    ));
    if revoked {
        dialogue.print_words(("the token of the first start is worth nothing any more", "首次启动时的令牌已作废"));
    }
    Ok(())
}
