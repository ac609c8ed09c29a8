//! The one table of configuration keys: what is read, refused, suggested, printed by `check --keys` and explained.

use super::channel_keys;
use super::config_key::new_key;
pub use super::config_key::{Absent, ConfigKey, NAME_MAX, ValueKind};
pub use super::key_list::{format_example, format_table};
use super::keys_of_backup::BACKUP;
use super::keys_of_gate::GATE;
use super::keys_of_outputs::OUTPUTS;
use super::keys_of_thermal::THERMAL;

/// A section of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Section {
    /// What stands between the brackets of the head, without them.
    pub name: &'static str,
    /// Written as `[[name]]`, any number of times.
    pub repeated: bool,
    /// What it is about, in English.
    pub en: &'static str,
}

const fn new_section(name: &'static str, en: &'static str) -> Section {
    Section { name, repeated: false, en }
}

/// Every section, in the order of the example file.
pub const SECTIONS: &[Section] = &[
    new_section("gateway", "the box itself"),
    Section { name: "source", repeated: true, en: "one controller or meter; write the section once for each" },
    Section {
        name: channel_keys::SECTION,
        repeated: true,
        en: "below a fanuc:// source: a variable, parameter, diagnosis number or PMC byte as a channel of your own",
    },
    new_section("alignment", "one time base: how late each power meter is against the controller"),
    new_section("scripts", "the rules that the integrator edits"),
    new_section("operations", "how each stretch of an NC program cuts, which no controller can be asked for"),
    new_section("gate", "what may be written to the machine"),
    new_section("gate.offset", "thermal offsets that scripts propose, written between programs; needs the same arming"),
    new_section("history", "what is remembered"),
    Section {
        name: "sink",
        repeated: true,
        en: "one receiver of what leaves the box; write the section once for each",
    },
    new_section("sinks", "all receivers together"),
    new_section("outbox", "what the sinks are sent, and how much of it waits for them during an outage"),
    new_section("http", "the page and the interface on the network"),
    new_section("twin", "the simulation that the machine is compared with"),
    new_section("thermal", "the thermal law that the box runs: predicted error, residual, offset, pulses to insert"),
    new_section("backup", "backups that the box takes by itself, each restored into a scratch folder before it counts"),
    new_section("log", "what is written to the standard error output"),
];

use Absent::{Default, Optional, Required};
use ValueKind::{Address, Flag, Listen, Name, Number, OneOf, Path, PathWord, PlantPath, Text};

/// Every key the gateway knows.
pub static KEYS: &[ConfigKey] = &ALL;

/// The rows of every part of the table, one part behind the other.
static ALL: [ConfigKey;
    CORE.len() + GATE.len() + OUTPUTS.len() + THERMAL.len() + BACKUP.len() + channel_keys::KEYS.len()] = {
    let mut all =
        [CORE[0]; CORE.len() + GATE.len() + OUTPUTS.len() + THERMAL.len() + BACKUP.len() + channel_keys::KEYS.len()];
    let parts: [&[ConfigKey]; 6] = [CORE, GATE, OUTPUTS, THERMAL, BACKUP, &channel_keys::KEYS];
    let (mut part, mut filled) = (0, 0);
    while part < parts.len() {
        let mut index = 0;
        while index < parts[part].len() {
            all[filled] = parts[part][index];
            filled += 1;
            index += 1;
        }
        part += 1;
    }
    all
};

/// Every key but those of the gate, of the outputs, of the thermal law and of channels.
const CORE: &[ConfigKey] = &[
    new_key(
        ("gateway", "name"),
        Name,
        Default("\"cnc-gateway\""),
        "Name of the machine on the page and in exports",
        "机床名称",
    ),
    new_key(
        ("gateway", "path"),
        PlantPath,
        Optional,
        "Where the machine stands: SITE, SITE/LINE, SITE/AREA/LINE or ENTERPRISE/SITE/AREA/LINE. Outputs and fleet know the machine by it, whichever box stands there",
        "机床在工厂中的位置：各输出和机群数据库以此识别机床，更换网关盒不影响机床",
    ),
    new_key(
        ("gateway", "machine"),
        PathWord,
        Optional,
        "Word of the machine at the end of the path; default: the name, with - for blanks",
        "路径末尾的机床代号；默认为名称，空格写作 -",
    ),
    new_key(
        ("gateway", "tick_hz"),
        Number(0.1, 1000.0),
        Default("10.0"),
        "Ticks per second: merge, infer, decide, store",
        "每秒节拍数",
    ),
    new_key(
        ("gateway", "clock_confirm_s"),
        Number(10.0, 86_400.0),
        Default("7200.0"),
        "A reading of the computer's clock that has stood for so long is believed; until then nothing goes because of its age, s",
        "计算机时钟读数稳定多久后才被采信；在此之前不按期限删除任何数据，秒",
    ),
    new_key(
        ("gateway", "language"),
        OneOf(&["auto", "en", "zh"]),
        Default("\"auto\""),
        "Language in which the page opens; auto takes that of the browser, and the reader may switch",
        "页面打开时的语言；auto 取浏览器语言，读者可切换",
    ),
    new_key(
        ("gateway", "data_dir"),
        Path,
        Default("\"cnc-gateway-data\""),
        "Directory of everything the gateway writes; relative to this file",
        "数据目录",
    ),
    new_key(
        ("source", "address"),
        Address,
        Required,
        "Which controller, meter or recording, and how to reach it",
        "数据源地址",
    ),
    new_key(
        ("source", "name"),
        Name,
        Optional,
        "Short name in messages and in [gate]; default: the address",
        "数据源名称",
    ),
    new_key(
        ("source", "period_s"),
        Number(0.001, 3600.0),
        Optional,
        "Time between two polls; default: the driver's own pace",
        "轮询周期（秒）",
    ),
    new_key(
        ("source", "deadline_s"),
        Number(0.01, 60.0),
        Default("3.0"),
        "A poll that takes longer has failed",
        "轮询超时（秒）",
    ),
    new_key(
        ("source", "stand_in"),
        Text,
        Optional,
        "Channels that it delivers while an earlier source that delivers them has no value: \"total_power_w supply_voltage_v\"; default: none",
        "当前面的数据源没有值时，由本数据源代为提供的通道；默认：无",
    ),
    new_key(
        ("alignment", "spindle_power"),
        OneOf(&["off", "show", "merge"]),
        Default("\"show\""),
        "Lag of the source of spindle_power_w behind the spindle speed: show it, or also put its readings back by it",
        "主轴功率计的滞后：off 不估计，show 仅显示，merge 用于校正",
    ),
    new_key(
        ("alignment", "total_power"),
        OneOf(&["off", "show", "merge"]),
        Default("\"show\""),
        "The same for the source of total_power_w, where that is another one",
        "整机功率计的滞后",
    ),
    new_key(
        ("scripts", "directory"),
        Path,
        Default("\"scripts\""),
        "Directory of the .rhai scripts; relative to data_dir",
        "脚本目录",
    ),
    new_key(
        ("scripts", "reload"),
        Flag,
        Default("true"),
        "Look for changed scripts every second",
        "脚本修改后自动重新加载",
    ),
    new_key(
        ("operations", "path"),
        Path,
        Optional,
        "Operations recipe (operations/1): program and blocks to depth of cut, diameter, tool, material; relative to this file",
        "工序配方文件",
    ),
    new_key(
        ("history", "path"),
        Path,
        Default("\"history.db\""),
        "History database (SQLite); relative to data_dir",
        "历史数据库",
    ),
    new_key(
        ("history", "retention_days"),
        Number(0.01, 36500.0),
        Default("400.0"),
        "Raw samples older than this are dropped",
        "原始数据保留天数",
    ),
    new_key(
        ("history", "max_gb"),
        Number(0.01, 10000.0),
        Default("8.0"),
        "Size of the history; beyond it the oldest raw samples go first, alarms and commands last",
        "历史数据最大容量（GB）",
    ),
    new_key(
        ("history", "commit_s"),
        Number(0.01, 60.0),
        Default("1.0"),
        "At most this much is lost when the power fails",
        "提交间隔（秒）",
    ),
    new_key(
        ("http", "listen"),
        Listen,
        Default("\"127.0.0.1:8080\""),
        "Address and port of the page; 127.0.0.1 is reachable from this box only",
        "网页监听地址",
    ),
    new_key(("http", "enabled"), Flag, Default("true"), "Serve the page and the interface at all", "启用网页"),
    new_key(
        ("http", "tls"),
        Flag,
        Default("false"),
        "Serve over TLS (https); any other address than 127.0.0.1 needs it",
        "使用 TLS（https）；非本机地址必须启用",
    ),
    new_key(
        ("http", "certificate"),
        Path,
        Optional,
        "Certificate chain (PEM); relative to this file; default: one made at the first start, in tls/ of data_dir",
        "证书链（PEM）；默认首次启动时自动生成",
    ),
    new_key(
        ("http", "key"),
        Path,
        Optional,
        "Private key of the certificate (PEM); relative to this file",
        "证书私钥（PEM）",
    ),
    new_key(
        ("http", "tokens"),
        OneOf(&["changes", "always"]),
        Default("\"changes\""),
        "changes: who changes something signs in. always: who reads does too; any other address than 127.0.0.1 needs it",
        "changes：修改需登录；always：查看也需登录，非本机地址必须启用",
    ),
    new_key(
        ("http", "session_s"),
        Number(10.0, 604_800.0),
        Default("28800.0"),
        "Whoever has signed in is signed out after this time",
        "登录有效时间（秒）",
    ),
    new_key(
        ("http", "allow_hosts"),
        Text,
        Optional,
        "Names by which browsers reach this box, for example \"gateway.local cnc7\"; its own addresses and localhost always count",
        "浏览器访问本机所用的主机名",
    ),
    new_key(
        ("http", "allow_arming"),
        Flag,
        Default("false"),
        "The gate may be armed from the page too, by an armer who gives the token once more; false: at the box only",
        "允许在网页上授权写入；false：仅限本机命令行",
    ),
    new_key(
        ("http", "shifts"),
        Text,
        Default("\"6:00 14:00 22:00\""),
        "When shifts begin, by the clock of whoever looks: the use of the machine is told for each",
        "班次开始时间（按查看者时钟）",
    ),
    new_key(("twin", "model"), Path, Optional, "Model file (model/1); relative to this file", "仿真模型文件"),
    new_key(
        ("log", "level"),
        OneOf(&["error", "warn", "info", "debug", "trace"]),
        Default("\"info\""),
        "Least important message of the engineer's log; --log-level goes before it",
        "日志级别",
    ),
    new_key(
        ("log", "format"),
        OneOf(&["off", "text", "json"]),
        Default("\"off\""),
        "Engineer's log on standard error: text for people, json for log collectors; --log goes before it",
        "日志格式",
    ),
];

/// The keys of one section.
pub fn keys_of(section: &str) -> impl Iterator<Item = &'static ConfigKey> {
    KEYS.iter().filter(move |key| key.section == section)
}

/// The key of this name in this section.
#[must_use]
pub fn find_key(section: &str, name: &str) -> Option<&'static ConfigKey> {
    KEYS.iter().find(|key| key.section == section && key.name == name)
}

/// The section of this name.
#[must_use]
pub fn find_section(name: &str) -> Option<&'static Section> {
    SECTIONS.iter().find(|section| section.name == name)
}
