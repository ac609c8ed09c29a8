//! The one table of configuration keys: what is read, refused, suggested, printed by `check --keys` and explained.

pub use super::shown::{example, table};

/// What a key accepts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Any text that is not empty.
    Text,
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// A number from the first to the second limit, both included.
    Number(f64, f64),
    /// `true` or `false`.
    Flag,
    /// A file or directory.
    Path,
    /// `HOST:PORT` to listen on.
    Listen,
    /// The address of a source, as listed in the table of sources.
    Address,
}

/// What happens when a key is not written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Absent {
    /// The file is refused.
    Required,
    /// The gateway does without, or decides by itself as the text of the key says.
    Optional,
    /// This value, written as in the file.
    Default(&'static str),
}

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// The section it belongs to.
    pub section: &'static str,
    /// Its name in that section; the unit comes last.
    pub name: &'static str,
    /// What it accepts.
    pub kind: Kind,
    /// What holds when it is absent.
    pub absent: Absent,
    /// What it does, in English.
    pub en: &'static str,
    /// What it does, in Chinese.
    pub zh: &'static str,
}

/// A section of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Section {
    /// Its name.
    pub name: &'static str,
    /// Written as `[[name]]`, any number of times.
    pub repeated: bool,
    /// What it is about, in English.
    pub en: &'static str,
}

const fn section(name: &'static str, en: &'static str) -> Section {
    Section { name, repeated: false, en }
}

/// Every section, in the order of the example file.
pub const SECTIONS: &[Section] = &[
    section("gateway", "the box itself"),
    Section { name: "source", repeated: true, en: "one controller or meter; write the section once for each" },
    section("alignment", "one time base: how late each power meter is against the controller"),
    section("scripts", "the rules that the integrator edits"),
    section("operations", "how each stretch of an NC program cuts, which no controller can be asked for"),
    section("gate", "what may be written to the machine"),
    section("gate.offset", "thermal offsets that scripts propose, written between programs; needs the same arming"),
    section("history", "what is remembered"),
    section("http", "the page and the interface on the network"),
    section("twin", "the simulation that the machine is compared with"),
    section("log", "what is written to the standard error output"),
];

const fn key(
    path: (&'static str, &'static str),
    kind: Kind,
    absent: Absent,
    en: &'static str,
    zh: &'static str,
) -> Key {
    Key { section: path.0, name: path.1, kind, absent, en, zh }
}

use Absent::{Default, Optional, Required};
use Kind::{Address, Flag, Listen, Number, OneOf, Path, Text};

/// Every key the gateway knows.
pub const KEYS: &[Key] = &[
    key(
        ("gateway", "name"),
        Text,
        Default("\"cnc-gateway\""),
        "Name of the machine on the page and in exports",
        "机床名称",
    ),
    key(
        ("gateway", "tick_hz"),
        Number(0.1, 1000.0),
        Default("10.0"),
        "Ticks per second: merge, infer, decide, store",
        "每秒节拍数",
    ),
    key(
        ("gateway", "language"),
        OneOf(&["auto", "en", "zh"]),
        Default("\"auto\""),
        "Language in which the page opens; auto takes that of the browser, and the reader may switch",
        "页面打开时的语言；auto 取浏览器语言，读者可切换",
    ),
    key(
        ("gateway", "data_dir"),
        Path,
        Default("\"cnc-gateway-data\""),
        "Directory of everything the gateway writes; relative to this file",
        "数据目录",
    ),
    key(
        ("source", "address"),
        Address,
        Required,
        "Which controller, meter or recording, and how to reach it",
        "数据源地址",
    ),
    key(("source", "name"), Text, Optional, "Short name in messages and in [gate]; default: the address", "数据源名称"),
    key(
        ("source", "period_s"),
        Number(0.001, 3600.0),
        Optional,
        "Time between two polls; default: the driver's own pace",
        "轮询周期（秒）",
    ),
    key(
        ("source", "deadline_s"),
        Number(0.01, 60.0),
        Default("3.0"),
        "A poll that takes longer has failed",
        "轮询超时（秒）",
    ),
    key(
        ("alignment", "spindle_power"),
        OneOf(&["off", "show", "merge"]),
        Default("\"show\""),
        "Lag of the source of spindle_power_w behind the spindle speed: show it, or also put its readings back by it",
        "主轴功率计的滞后：off 不估计，show 仅显示，merge 用于校正",
    ),
    key(
        ("alignment", "total_power"),
        OneOf(&["off", "show", "merge"]),
        Default("\"show\""),
        "The same for the source of total_power_w, where that is another one",
        "整机功率计的滞后",
    ),
    key(
        ("scripts", "directory"),
        Path,
        Default("\"scripts\""),
        "Directory of the .rhai scripts; relative to data_dir",
        "脚本目录",
    ),
    key(
        ("scripts", "reload"),
        Flag,
        Default("true"),
        "Look for changed scripts every second",
        "脚本修改后自动重新加载",
    ),
    key(
        ("operations", "path"),
        Path,
        Optional,
        "Operations recipe (operations/1): program and blocks to depth of cut, diameter, tool, material; relative to this file",
        "工序配方文件",
    ),
    key(
        ("gate", "mode"),
        OneOf(&["off", "shadow", "armed"]),
        Default("\"shadow\""),
        "off: decide nothing. shadow: decide and record, write nothing. armed: may be armed on the box",
        "写入方式：关闭、影子、允许",
    ),
    key(("gate", "source"), Text, Optional, "Name of the source whose feed override may be written", "可写入的数据源"),
    key(
        ("gate", "min_pct"),
        Number(10.0, 100.0),
        Default("50.0"),
        "Least feed override ever written; no script can widen the band",
        "最小进给倍率",
    ),
    key(
        ("gate", "max_pct"),
        Number(100.0, 200.0),
        Default("120.0"),
        "Greatest feed override ever written; no script can widen the band",
        "最大进给倍率",
    ),
    key(
        ("gate", "slew_up_pct_per_s"),
        Number(0.1, 100.0),
        Default("10.0"),
        "Greatest rise of the override per second",
        "倍率上升速率限制",
    ),
    key(
        ("gate", "slew_down_pct_per_s"),
        Number(0.1, 254.0),
        Default("50.0"),
        "Greatest fall of the override per second",
        "倍率下降速率限制",
    ),
    key(
        ("gate", "above_dial"),
        Flag,
        Default("false"),
        "The ladder multiplies the dial with the gateway's override, which may then exceed it; false: it takes the lesser one",
        "梯形图将面板倍率与网关倍率相乘（可高于面板）；false：取较小者",
    ),
    key(
        ("gate", "dead_band_pct"),
        Number(0.0, 20.0),
        Default("2.0"),
        "A request that differs less than this from the one in force changes nothing; 100 is always taken",
        "倍率死区",
    ),
    key(
        ("gate", "min_interval_s"),
        Number(0.0, 10.0),
        Default("0.2"),
        "Least time between two changes of the override; going back to 100 never waits",
        "两次修改的最短间隔（秒）",
    ),
    key(
        ("gate", "heartbeat_s"),
        Number(0.05, 5.0),
        Default("0.3"),
        "The sign of life is written this often while armed; at most a third of the time after which the ladder falls back",
        "心跳周期（秒）",
    ),
    key(
        ("gate", "stale_s"),
        Number(0.05, 10.0),
        Default("0.5"),
        "Data older than this holds 100 %; at most two polling periods is sensible",
        "数据过期时间（秒）",
    ),
    key(
        ("gate", "armed_for_s"),
        Number(1.0, 86400.0),
        Default("28800.0"),
        "Arming ends by itself after this time",
        "允许写入的有效时间（秒）",
    ),
    key(
        ("gate.offset", "mode"),
        OneOf(&["off", "shadow", "armed"]),
        Default("\"off\""),
        "off: proposals are recorded only. shadow: decide and record. armed: written while the gate is armed on the box",
        "热误差补偿量：关闭、影子、允许写入",
    ),
    key(
        ("gate.offset", "source"),
        Text,
        Optional,
        "Name of the source whose offsets may be written; default: that of [gate]",
        "可写入补偿量的数据源",
    ),
    key(
        ("gate.offset", "axes"),
        Text,
        Optional,
        "Axes that may be shifted, for example \"z\" or \"x z\"",
        "允许补偿的轴",
    ),
    key(
        ("gate.offset", "step_um"),
        Number(1.0, 100.0),
        Default("5.0"),
        "Greatest change of an offset at a time",
        "单次最大修改量（微米）",
    ),
    key(
        ("gate.offset", "total_um"),
        Number(1.0, 500.0),
        Default("50.0"),
        "Greatest shift from what the operator has set",
        "最大总补偿量（微米）",
    ),
    key(
        ("gate.offset", "min_interval_s"),
        Number(1.0, 86400.0),
        Default("60.0"),
        "Least time between two writes of offsets",
        "两次写入的最短间隔（秒）",
    ),
    key(
        ("gate.offset", "on_disarm"),
        OneOf(&["restore", "keep"]),
        Default("\"restore\""),
        "After disarming and at the end: give back what the operator had set, as soon as no program runs, or leave the shift",
        "解除后：恢复操作者设定值，或保持补偿",
    ),
    key(
        ("history", "path"),
        Path,
        Default("\"history.db\""),
        "History database (SQLite); relative to data_dir",
        "历史数据库",
    ),
    key(
        ("history", "retention_days"),
        Number(0.01, 36500.0),
        Default("400.0"),
        "Raw samples older than this are dropped",
        "原始数据保留天数",
    ),
    key(
        ("history", "max_gb"),
        Number(0.01, 10000.0),
        Default("8.0"),
        "Size of the history; beyond it the oldest raw samples go first, alarms and commands last",
        "历史数据最大容量（GB）",
    ),
    key(
        ("history", "commit_s"),
        Number(0.01, 60.0),
        Default("1.0"),
        "At most this much is lost when the power fails",
        "提交间隔（秒）",
    ),
    key(
        ("http", "listen"),
        Listen,
        Default("\"127.0.0.1:8080\""),
        "Address and port of the page; 127.0.0.1 is reachable from this box only",
        "网页监听地址",
    ),
    key(("http", "enabled"), Flag, Default("true"), "Serve the page and the interface at all", "启用网页"),
    key(
        ("http", "tls"),
        Flag,
        Default("false"),
        "Serve over TLS (https); any other address than 127.0.0.1 needs it",
        "使用 TLS（https）；非本机地址必须启用",
    ),
    key(
        ("http", "certificate"),
        Path,
        Optional,
        "Certificate chain (PEM); relative to this file; default: one made at the first start, in tls/ of data_dir",
        "证书链（PEM）；默认首次启动时自动生成",
    ),
    key(
        ("http", "key"),
        Path,
        Optional,
        "Private key of the certificate (PEM); relative to this file",
        "证书私钥（PEM）",
    ),
    key(
        ("http", "tokens"),
        OneOf(&["changes", "always"]),
        Default("\"changes\""),
        "changes: who changes something signs in. always: who reads does too; any other address than 127.0.0.1 needs it",
        "changes：修改需登录；always：查看也需登录，非本机地址必须启用",
    ),
    key(
        ("http", "session_s"),
        Number(10.0, 604_800.0),
        Default("28800.0"),
        "Whoever has signed in is signed out after this time",
        "登录有效时间（秒）",
    ),
    key(
        ("http", "allow_hosts"),
        Text,
        Optional,
        "Names by which browsers reach this box, for example \"gateway.local cnc7\"; its own addresses and localhost always count",
        "浏览器访问本机所用的主机名",
    ),
    key(
        ("http", "allow_arming"),
        Flag,
        Default("false"),
        "The gate may be armed from the page too, by an armer who gives the token once more; false: at the box only",
        "允许在网页上授权写入；false：仅限本机命令行",
    ),
    key(("twin", "model"), Path, Optional, "Model file (model/1); relative to this file", "仿真模型文件"),
    key(
        ("log", "level"),
        OneOf(&["error", "warn", "info", "debug", "trace"]),
        Default("\"info\""),
        "Least important message of the engineer's log; --log-level goes before it",
        "日志级别",
    ),
    key(
        ("log", "format"),
        OneOf(&["off", "text", "json"]),
        Default("\"off\""),
        "Engineer's log on standard error: text for people, json for log collectors; --log goes before it",
        "日志格式",
    ),
];

/// The keys of one section.
pub fn keys_of(section: &str) -> impl Iterator<Item = &'static Key> {
    KEYS.iter().filter(move |key| key.section == section)
}

/// The key of this name in this section.
#[must_use]
pub fn find(section: &str, name: &str) -> Option<&'static Key> {
    KEYS.iter().find(|key| key.section == section && key.name == name)
}

/// The section of this name.
#[must_use]
pub fn find_section(name: &str) -> Option<&'static Section> {
    SECTIONS.iter().find(|section| section.name == name)
}

impl Key {
    /// `section.name`.
    #[must_use]
    pub fn path(&self) -> String {
        format!("{}.{}", self.section, self.name)
    }
}
