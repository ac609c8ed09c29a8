//! `doctor --box`: the computer that the gateway runs on. What it is, what of it wears out, and what is wrong for this use.
//!
//! Everything is read from files of the system; where a computer does not tell something, that is said.

use super::Trouble;
use adapters::driver::Fact;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// Less free space than this is told: some days of history and a copy of it for a migration.
const FREE_MIN_GB: f64 = 1.0;
/// A processor above this lowers its clock soon; ticks come late then.
const TEMPERATURE_MAX_C: f64 = 85.0;
/// eMMC tells its wear in tenths; at eight tenths a card is ordered.
const WEAR_MAX_TENTHS: u32 = 8;
/// The priority that the tick asks for.
const REAL_TIME_MIN: u64 = 40;
/// Memory that a day under load needs besides, MB.
const MEMORY_MIN_MB: u64 = 200;

/// What is known of the computer that the gateway runs on, and what is wrong with it.
#[derive(Debug, Clone, Default)]
pub struct ComputerReport {
    /// Figures and words; the name of a figure ends in its unit.
    pub facts: Vec<Fact>,
    /// What is wrong, each with what to do.
    pub problems: Vec<Trouble>,
}

impl ComputerReport {
    fn add_text(&mut self, name: &str, value: impl Into<String>) {
        self.facts.push(Fact::from_text(name, value));
    }

    fn add_number(&mut self, name: &str, value: f64) {
        self.facts.push(Fact::from_number(name, value));
    }

    fn add_problem(&mut self, what: String, next: &str) {
        self.problems.push(Trouble { what, next: next.to_owned() });
    }

    /// The document `doctor-box/1`, as `doctor --box --json` prints it.
    #[must_use]
    pub fn to_json(&self) -> Value {
        use adapters::driver::FactValue;
        let facts: serde_json::Map<String, Value> = self
            .facts
            .iter()
            .map(|fact| match &fact.value {
                FactValue::Number(number) => (fact.name.to_string(), json!(number)),
                FactValue::Text(text) => (fact.name.to_string(), json!(text)),
            })
            .collect();
        let problems: Vec<Value> =
            self.problems.iter().map(|problem| json!({ "what": problem.what, "next": problem.next })).collect();
        json!({ "schema": "doctor-box/1", "facts": facts, "problems": problems })
    }
}

/// Where the system tells what it is. Another folder in tests.
#[derive(Debug, Clone)]
pub struct SystemFiles {
    root: PathBuf,
}

impl Default for SystemFiles {
    fn default() -> Self {
        Self { root: PathBuf::from("/") }
    }
}

impl SystemFiles {
    /// Files below this folder.
    #[must_use]
    pub fn from_root(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    fn read(&self, path: &str) -> Option<String> {
        fs::read_to_string(self.root.join(path)).ok().map(|text| text.trim().to_owned())
    }

    fn list_names(&self, path: &str) -> Vec<String> {
        let entries = fs::read_dir(self.root.join(path)).ok();
        let names =
            entries.into_iter().flatten().flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    fn exists(&self, path: &str) -> bool {
        self.root.join(path).exists()
    }
}

/// Examines the computer, with the disk that holds this directory.
#[must_use]
pub fn examine_computer(system: &SystemFiles, data_dir: &Path) -> ComputerReport {
    let mut report = ComputerReport::default();
    examine_kernel(system, &mut report);
    examine_memory(system, &mut report);
    examine_space(data_dir, &mut report);
    examine_wear(system, &mut report);
    examine_clock(system, &mut report);
    examine_temperature(system, &mut report);
    examine_priority(system, &mut report);
    report
}

fn examine_kernel(system: &SystemFiles, report: &mut ComputerReport) {
    let version = system.read("proc/sys/kernel/osrelease").unwrap_or_else(|| "unknown".to_owned());
    let real_time = system.read("sys/kernel/realtime").as_deref() == Some("1");
    report.add_text("kernel", version);
    report.add_text("real-time kernel", if real_time { "yes" } else { "no" });
    report.add_text("program", env!("CARGO_PKG_VERSION"));
}

fn examine_memory(system: &SystemFiles, report: &mut ComputerReport) {
    let text = system.read("proc/meminfo").unwrap_or_default();
    let field = |name: &str| -> Option<u64> {
        let line = text.lines().find(|line| line.starts_with(name))?;
        line.split_whitespace().nth(1)?.parse().ok()
    };
    let Some(available_kb) = field("MemAvailable:") else { return };
    report.add_number("available_memory_mb", (available_kb / 1024) as f64);
    if available_kb / 1024 < MEMORY_MIN_MB {
        let what = format!("{} MB of memory are available", available_kb / 1024);
        report.add_problem(what, "stop other programs; the gateway needs about 100 MB, a diagnosis more");
    }
}

fn examine_space(data_dir: &Path, report: &mut ComputerReport) {
    match rustix::fs::statvfs(data_dir) {
        Ok(space) => {
            let free_gb = space.f_bavail as f64 * space.f_frsize as f64 / 1e9;
            report.add_number("free_space_gb", (free_gb * 100.0).round() / 100.0);
            if free_gb < FREE_MIN_GB {
                let what = format!("{free_gb:.2} GB are free where {} lies", data_dir.display());
                report.add_problem(what, "make room, or lower max_gb under [history]");
            }
        }
        Err(error) => report.add_text("free space", format!("not told: {error}")),
    }
}

/// eMMC and some cards tell their wear; most disks do not.
fn examine_wear(system: &SystemFiles, report: &mut ComputerReport) {
    let mut told = false;
    for disk in system.list_names("sys/block") {
        let Some(life) = system.read(&format!("sys/block/{disk}/device/life_time")) else { continue };
        let tenths =
            life.split_whitespace().filter_map(|word| u32::from_str_radix(word.trim_start_matches("0x"), 16).ok());
        let Some(worst) = tenths.max().filter(|worst| *worst > 0) else { continue };
        told = true;
        report.add_text(&format!("wear of {disk}"), format!("{} to {} %", (worst - 1) * 10, worst * 10));
        if worst > WEAR_MAX_TENTHS {
            let what = format!("{disk} says that {} % of its life is used", (worst - 1) * 10);
            report.add_problem(
                what,
                "back up, and exchange it: cnc-gateway backup --history, then restore on the new one",
            );
        }
    }
    if !told {
        report.add_text("wear of the disk", "not told by this computer; smartctl tells it for SSDs");
    }
}

fn examine_clock(system: &SystemFiles, report: &mut ComputerReport) {
    let source = system.read("sys/devices/system/clocksource/clocksource0/current_clocksource");
    report.add_text("clock source", source.unwrap_or_else(|| "unknown".to_owned()));
    let has_battery = system.exists("dev/rtc0") || system.exists("sys/class/rtc/rtc0");
    let synchronised = system.exists("run/systemd/timesync/synchronized") || system.exists("var/lib/chrony/drift");
    report.add_text("clock with a battery", if has_battery { "yes" } else { "no" });
    report.add_text("clock set over the network", if synchronised { "yes" } else { "not seen" });
    if !has_battery && !synchronised {
        let what = "the clock has no battery and nothing sets it: after a power cut every time is wrong".to_owned();
        report.add_problem(what, "let systemd-timesyncd or chrony set it, from the control or a server of the plant");
    }
}

fn examine_temperature(system: &SystemFiles, report: &mut ComputerReport) {
    let zones = system.list_names("sys/class/thermal").into_iter().filter(|name| name.starts_with("thermal_zone"));
    let read = |zone: String| system.read(&format!("sys/class/thermal/{zone}/temp"))?.parse::<f64>().ok();
    let warmest = zones.filter_map(read).fold(f64::NEG_INFINITY, f64::max) / 1000.0;
    if !warmest.is_finite() {
        report.add_text("temperature", "not told by this computer");
        return;
    }
    report.add_number("temperature_degc", warmest);
    if warmest > TEMPERATURE_MAX_C {
        report.add_problem(format!("the computer is at {warmest:.0} °C"), "look at its cooling and at the cabinet");
    }
}

fn examine_priority(system: &SystemFiles, report: &mut ComputerReport) {
    let limits = system.read("proc/self/limits").unwrap_or_default();
    let line = limits.lines().find(|line| line.starts_with("Max realtime priority")).unwrap_or_default();
    let limit = match line.split_whitespace().nth(3) {
        Some("unlimited") => u64::MAX,
        Some(number) => number.parse().unwrap_or(0),
        None => 0,
    };
    report.add_text("real-time priority", if limit == u64::MAX { "unlimited".to_owned() } else { limit.to_string() });
    if limit < REAL_TIME_MIN {
        let what = format!("real-time priority is limited to {limit}: ticks come up to 2 ms late under load");
        report.add_problem(what, "the service of the package has LimitRTPRIO=40; for a shell: ulimit -r 40 as root");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worn_hot_box_without_a_clock_is_told() {
        let root = tempfile::tempdir().expect("a directory");
        let put = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, text).expect("written");
        };
        put("proc/sys/kernel/osrelease", "6.1.0-rt\n");
        put("sys/kernel/realtime", "1\n");
        put("proc/meminfo", "MemTotal: 900000 kB\nMemAvailable: 90000 kB\n");
        put("sys/block/mmcblk0/device/life_time", "0x02 0x0a\n");
        put("sys/class/thermal/thermal_zone0/temp", "91000\n");
        put("proc/self/limits", "Limit Soft Hard Units\nMax realtime priority     0                    0\n");
        let report = examine_computer(&SystemFiles::from_root(root.path()), root.path());
        let told: Vec<&str> = report.problems.iter().map(|problem| problem.what.as_str()).collect();
        let words = ["memory", "mmcblk0", "battery", "91", "real-time"];
        assert!(words.iter().all(|word| told.iter().any(|text| text.contains(word))), "{told:?}");
        assert_eq!(report.to_json()["facts"]["real-time kernel"], "yes");
    }
}
