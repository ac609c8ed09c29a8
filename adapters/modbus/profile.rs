//! Which register of a meter holds what: profiles as TOML, shipped in the program and in a directory of the user's.
//!
//! ```toml
//! format = "meter/1"
//! meter = "Eastron SDM630"         # who it is, as people call it
//! registers = "input"              # input (function 4) or holding (function 3)
//! word_order = "big"               # which register of a number comes first: the high word (big) or the low one
//! values = "primary"               # primary: transformers are counted in; secondary: multiply by ct= and pt=
//! period_s = 0.1                   # pace of polling, unless the configuration says otherwise
//! block_max = 125                  # so many registers at once at most
//! block_gap = 40                   # registers nobody asked for that a block may run across
//! confirmed = true                 # false: the map is believed, not seen; says so wherever the meter is shown
//! source = "where the map comes from"
//!
//! [[value]]
//! quantity = "power"               # or channel = "bearing_temperature_c" with name = "front bearing"
//! address = 0x34                   # protocol address, from 0
//! type = "f32"                     # u16 i16 sm16 u32 i32 sm32 f32 i64 f64; sm: the highest bit is the sign
//! unit = "W"                       # W kW A mA V mV C, or "1"
//! scale = 1.0                      # the register times this is the number in that unit
//! ```
//!
//! Quantities: `power`, `power_l1` to `_l3`, `current_l1` to `_l3`, `voltage_l1` to `_l3` (against neutral), `voltage_l12`
//! (between phases). Where the meter sits decides the channel: `circuit=machine` in the address gives `total_power_w`,
//! `circuit=spindle` gives `spindle_power_w` and `spindle_current_a` (mean of the phases); both give `supply_voltage_v`.
//! Without `power` the sum of the phases is taken.

use super::number::{Format, WordOrder};
use super::pdu::{REGISTERS_MAX, RegisterTable};
use crate::channel::{self, CHANNELS, ChannelId};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::time::Duration;
use thiserror::Error;

/// At most so many values in one profile.
const VALUES_MAX: usize = 64;
/// A profile file is no longer than this.
const BYTES_MAX: u64 = 256 * 1024;

/// The shipped profiles: name and text.
pub const SHIPPED: [(&str, &str); 9] = [
    ("sdm630", include_str!("profiles/sdm630.toml")),
    ("iem3000", include_str!("profiles/iem3000.toml")),
    ("pm5xxx", include_str!("profiles/pm5xxx.toml")),
    ("pac", include_str!("profiles/pac.toml")),
    ("adl400", include_str!("profiles/adl400.toml")),
    ("adw300", include_str!("profiles/adw300.toml")),
    ("eda9033a", include_str!("profiles/eda9033a.toml")),
    ("temperature8", include_str!("profiles/temperature8.toml")),
    ("generic", include_str!("profiles/generic.toml")),
];

/// What a register means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegisterMeaning {
    /// Of all phases together, W.
    Power,
    /// Of one phase, 0 to 2, W.
    PhasePower(usize),
    /// Of one phase, 0 to 2, A.
    Current(usize),
    /// One phase against neutral, 0 to 2, V.
    Voltage(usize),
    /// Between the first two phases, V.
    LineVoltage,
    /// A channel by its name, in its unit.
    Channel(ChannelId),
}

/// One number of the meter.
#[derive(Debug, Clone, PartialEq)]
pub struct MeterRegister {
    /// What it means.
    pub quantity: RegisterMeaning,
    /// Protocol address of its first register.
    pub address: u16,
    /// How it lies there.
    pub format: Format,
    /// The number in the register times this is W, A, V or the channel's unit.
    pub factor: f64,
    /// What the point is called on this machine.
    pub name: Option<String>,
}

/// A meter's map.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// As it is named in an address.
    pub name: String,
    /// The meter.
    pub meter: String,
    /// Where its numbers are.
    pub table: RegisterTable,
    /// Which word comes first.
    pub word_order: WordOrder,
    /// Are the numbers those of the secondary side of transformers?
    pub secondary: bool,
    /// Pace of polling.
    pub period: Duration,
    /// Registers per request at most.
    pub block_max: u16,
    /// Registers nobody asked for that a block may run across.
    pub block_gap: u16,
    /// Has the map been seen to be right?
    pub confirmed: bool,
    /// Where the map comes from.
    pub source: String,
    /// Its numbers.
    pub registers: Vec<MeterRegister>,
}

/// A profile that cannot be used, with everything that is wrong with it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{place}: {}", .problems.join("; "))]
pub struct ProfileError {
    /// The file, or the name that was asked for.
    pub place: String,
    /// Each problem, with what to do.
    pub problems: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawProfile {
    format: String,
    meter: String,
    registers: RawTable,
    #[serde(default)]
    word_order: WordOrder,
    #[serde(default)]
    values: RawSide,
    #[serde(default = "tenth")]
    period_s: f64,
    #[serde(default = "most")]
    block_max: u16,
    #[serde(default = "most")]
    block_gap: u16,
    #[serde(default)]
    confirmed: bool,
    #[serde(default)]
    source: String,
    value: Vec<RawValue>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum RawTable {
    Holding,
    Input,
}

#[derive(Deserialize, Clone, Copy, Default, PartialEq)]
#[serde(rename_all = "lowercase")]
enum RawSide {
    #[default]
    Primary,
    Secondary,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawValue {
    quantity: Option<String>,
    channel: Option<String>,
    address: u16,
    r#type: Format,
    unit: String,
    #[serde(default = "one")]
    scale: f64,
    name: Option<String>,
}

fn tenth() -> f64 {
    0.1
}

fn one() -> f64 {
    1.0
}

fn most() -> u16 {
    REGISTERS_MAX
}

/// The profile of this name: the user's own file goes before a shipped one of the same name.
///
/// # Errors
/// No such profile, or everything that is wrong with it.
pub fn find(name: &str, directory: Option<&Path>) -> Result<Profile, ProfileError> {
    let file: PathBuf = directory.unwrap_or(Path::new("")).join(format!("{name}.toml"));
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'));
    if directory.is_some() && plain && file.exists() {
        return of_file(name, &file);
    }
    if let Some((_, text)) = SHIPPED.iter().find(|(shipped, _)| *shipped == name) {
        return parse(name, name, text);
    }
    let names: Vec<&str> = SHIPPED.iter().map(|(shipped, _)| *shipped).collect();
    let hint = channel::nearest(name, names.iter().copied())
        .map_or_else(|| format!("there are {}", names.join(", ")), |near| format!("did you mean {near}?"));
    let own = "a file of your own is found with profiles=DIRECTORY";
    Err(ProfileError { place: format!("profile {name}"), problems: vec![format!("not known; {hint}; {own}")] })
}

fn of_file(name: &str, file: &Path) -> Result<Profile, ProfileError> {
    let place = file.display().to_string();
    let refused = |what: String| ProfileError { place: place.clone(), problems: vec![what] };
    let size = std::fs::metadata(file).map_err(|error| refused(error.to_string()))?.len();
    if size > BYTES_MAX {
        return Err(refused(format!("{size} bytes; a profile has at most {BYTES_MAX}")));
    }
    let text = std::fs::read_to_string(file).map_err(|error| refused(error.to_string()))?;
    parse(name, &place, &text)
}

/// The profile in a text. `place` is where it stands, for messages.
///
/// # Errors
/// Everything that is wrong with it.
pub fn parse(name: &str, place: &str, text: &str) -> Result<Profile, ProfileError> {
    let refused = |problems| ProfileError { place: place.to_owned(), problems };
    let raw: RawProfile = toml::from_str(text).map_err(|error| refused(vec![error.to_string().trim().to_owned()]))?;
    let mut problems = of_whole(&raw);
    let mut registers = Vec::new();
    for (index, value) in raw.value.iter().enumerate() {
        match register(value) {
            Ok(register) => registers.push(register),
            Err(problem) => problems.push(format!("value {}: {problem}", index + 1)),
        }
    }
    if !problems.is_empty() {
        return Err(refused(problems));
    }
    Ok(Profile {
        name: name.to_owned(),
        meter: raw.meter,
        table: if matches!(raw.registers, RawTable::Input) { RegisterTable::Input } else { RegisterTable::Holding },
        word_order: raw.word_order,
        secondary: raw.values == RawSide::Secondary,
        period: Duration::from_secs_f64(raw.period_s),
        block_max: raw.block_max,
        block_gap: raw.block_gap,
        confirmed: raw.confirmed,
        source: raw.source,
        registers,
    })
}

fn of_whole(raw: &RawProfile) -> Vec<String> {
    let mut problems = Vec::new();
    let mut ask = |good: bool, what: String| {
        if !good {
            problems.push(what);
        }
    };
    ask(raw.format == "meter/1", format!("format = {:?}: this version reads meter/1", raw.format));
    ask((0.01..=3600.0).contains(&raw.period_s), format!("period_s = {}: give 0.01 to 3600", raw.period_s));
    ask((4..=REGISTERS_MAX).contains(&raw.block_max), format!("block_max = {}: give 4 to 125", raw.block_max));
    let values = raw.value.len();
    ask((1..=VALUES_MAX).contains(&values), format!("{values} values: there are 1 to {VALUES_MAX}"));
    problems
}

fn register(raw: &RawValue) -> Result<MeterRegister, String> {
    let (quantity, base) = match (&raw.quantity, &raw.channel) {
        (Some(quantity), None) => of_quantity(quantity)?,
        (None, Some(channel)) => of_channel(channel)?,
        _ => return Err("give quantity or channel, one of the two".to_owned()),
    };
    let unit = unit_factor(&raw.unit, base)?;
    if !(raw.scale.is_finite() && raw.scale != 0.0) {
        return Err(format!("scale = {}: give a number that is not 0", raw.scale));
    }
    if u32::from(raw.address) + u32::from(raw.r#type.registers()) > 65536 {
        return Err(format!("address = {}: the number does not end within the 65536 registers", raw.address));
    }
    let factor = raw.scale * unit;
    Ok(MeterRegister { quantity, address: raw.address, format: raw.r#type, factor, name: raw.name.clone() })
}

const QUANTITIES: [(&str, RegisterMeaning, &str); 11] = [
    ("power", RegisterMeaning::Power, "W"),
    ("power_l1", RegisterMeaning::PhasePower(0), "W"),
    ("power_l2", RegisterMeaning::PhasePower(1), "W"),
    ("power_l3", RegisterMeaning::PhasePower(2), "W"),
    ("current_l1", RegisterMeaning::Current(0), "A"),
    ("current_l2", RegisterMeaning::Current(1), "A"),
    ("current_l3", RegisterMeaning::Current(2), "A"),
    ("voltage_l1", RegisterMeaning::Voltage(0), "V"),
    ("voltage_l2", RegisterMeaning::Voltage(1), "V"),
    ("voltage_l3", RegisterMeaning::Voltage(2), "V"),
    ("voltage_l12", RegisterMeaning::LineVoltage, "V"),
];

fn of_quantity(name: &str) -> Result<(RegisterMeaning, &'static str), String> {
    if let Some((_, quantity, base)) = QUANTITIES.iter().find(|(known, ..)| *known == name) {
        return Ok((*quantity, base));
    }
    let names = QUANTITIES.iter().map(|(known, ..)| *known);
    let hint = channel::nearest(name, names).map(|near| format!("; did you mean {near}?")).unwrap_or_default();
    Err(format!("no quantity {name:?}{hint}"))
}

fn of_channel(name: &str) -> Result<(RegisterMeaning, &'static str), String> {
    let id = ChannelId::of(name).filter(|id| !id.channel().unit.is_empty());
    if let Some(id) = id {
        return Ok((RegisterMeaning::Channel(id), id.channel().unit));
    }
    let names = CHANNELS.iter().map(|channel| channel.name);
    let hint = channel::nearest(name, names).map(|near| format!("; did you mean {near}?")).unwrap_or_default();
    Err(format!("no channel {name:?} that holds a number{hint}"))
}

/// A number in `unit` times this is one in `base`.
fn unit_factor(unit: &str, base: &str) -> Result<f64, String> {
    let same = match base {
        "°C" => unit == "C" || unit == base,
        _ => unit == base,
    };
    match (unit, base) {
        _ if same => Ok(1.0),
        ("kW", "W") => Ok(1e3),
        ("MW", "W") => Ok(1e6),
        ("mA", "A") | ("mV", "V") => Ok(1e-3),
        ("kV", "V") => Ok(1e3),
        _ => Err(format!("unit = {unit:?} is no unit for a number in {base}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_profile_can_be_used() {
        for (name, _) in SHIPPED {
            let profile = find(name, None).unwrap_or_else(|error| panic!("{error}"));
            assert!(!profile.source.is_empty() && !profile.registers.is_empty(), "{name}");
        }
    }

    #[test]
    fn a_misspelt_name_gets_a_suggestion() {
        let error = find("sdm63", None).expect_err("no such profile").to_string();
        assert!(error.contains("sdm630") && error.contains("profiles="), "{error}");
        assert!(find("../sdm630", Some(Path::new("/tmp"))).is_err());
    }

    #[test]
    fn everything_wrong_is_told_at_once() {
        let text = "format = \"meter/2\"\nmeter = \"x\"\nregisters = \"input\"\nblock_max = 200\n\
                    [[value]]\nquantity = \"powr\"\naddress = 1\ntype = \"f32\"\nunit = \"W\"\n\
                    [[value]]\nquantity = \"power\"\naddress = 65535\ntype = \"f32\"\nunit = \"W\"\n\
                    [[value]]\nchannel = \"ambient_temperature_c\"\naddress = 1\ntype = \"i16\"\nunit = \"W\"\n";
        let error = parse("x", "x.toml", text).expect_err("nothing is right").to_string();
        for part in ["meter/1", "block_max", "did you mean power?", "value 2: address", "value 3: unit"] {
            assert!(error.contains(part), "{part}: {error}");
        }
        let misspelt = parse("x", "x.toml", "format = \"meter/1\"\nmetre = 1\n").expect_err("unknown key").to_string();
        assert!(misspelt.contains("metre") && misspelt.contains("line 2"), "{misspelt}");
    }

    #[test]
    fn the_users_own_file_goes_before_a_shipped_one() {
        let directory = tempfile::tempdir().expect("a directory");
        let text = SHIPPED[0].1.replace("Eastron SDM630", "My meter");
        std::fs::write(directory.path().join("sdm630.toml"), text).expect("written");
        assert_eq!(find("sdm630", Some(directory.path())).expect("found").meter, "My meter");
        assert_eq!(find("pac", Some(directory.path())).expect("found").name, "pac");
    }
}
