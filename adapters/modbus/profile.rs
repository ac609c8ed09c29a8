//! Which register of a meter holds what: profiles as TOML, shipped in the program and in a directory of the user's.
//!
//! ```toml
//! format = "meter/1"
//! meter = "Eastron SDM630"         # who it is, as people call it
//! registers = "input"              # input (function 4) or holding (function 3)
//! addresses = "protocol"           # protocol: from 0 as on the wire; manual: 30001 and 40001 are the first ones
//! word_order = "big"               # big (ABCD), little (CDAB), badc, dcba: the bytes of a number, A the highest
//! values = "primary"               # primary: transformers are counted in; secondary: multiply by ct= and pt=
//! period_s = 0.1                   # pace of polling, unless the configuration says otherwise
//! block_max = 125                  # so many registers at once at most
//! block_gap = 40                   # registers nobody asked for that a block may run across
//! confirmed = true                 # false: the map is believed, not seen; says so wherever the meter is shown
//! source = "where the map comes from"
//!
//! [[value]]
//! quantity = "power"               # or channel = "bearing_temperature_c" with name = "front bearing"
//! address = 0x34                   # of its first register
//! type = "f32"                     # u16 i16 sm16 u32 i32 sm32 f32 i64 f64; sm: the highest bit is the sign
//! unit = "W"                       # W kW A mA V mV VA Hz kWh C K bar and so on, or "1"
//! scale = 1.0                      # the register times this is the number in that unit
//! no_value = [0xFFFF]              # what stands for no value; else the ends of the range of a whole number
//! registers = "holding"            # of this value, where it is in the other table
//! word_order = "badc"              # of this value, where it is another one
//! ```
//!
//! Quantities: `power`, `power_l1` to `_l3`, `current_l1` to `_l3`, `voltage_l1` to `_l3` (against neutral), `voltage_l12`
//! (between phases), `energy`, `power_factor`, `apparent_power`, `frequency`. Where the meter sits decides the channel:
//! `circuit=machine` in the address gives `total_power_w`, `total_energy_kwh` and so on, `circuit=spindle` gives `spindle_power_w`
//! and so on and `spindle_current_a` (mean of the phases); both give `supply_voltage_v` and `supply_frequency_hz`. Without
//! `power` the sum of the phases is taken. A channel can be given by its name, too.

use super::number::WordOrder;
use super::pdu::{REGISTERS_MAX, RegisterTable};
use super::register::{self, MeterRegister, RawAddresses, RawTable, RawValue, Whole};
use adapter_core::channel;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::time::Duration;
use thiserror::Error;

/// At most so many values in one profile.
const VALUES_MAX: usize = 64;
/// A profile file is no longer than this.
const BYTES_MAX: u64 = 256 * 1024;

/// The shipped profiles: name and text.
pub const SHIPPED: [(&str, &str); 18] = [
    ("sdm630", include_str!("profiles/sdm630.toml")),
    ("sdm72", include_str!("profiles/sdm72.toml")),
    ("em340", include_str!("profiles/em340.toml")),
    ("em24_e1", include_str!("profiles/em24_e1.toml")),
    ("em24", include_str!("profiles/em24.toml")),
    ("abb_b23", include_str!("profiles/abb_b23.toml")),
    ("umg96", include_str!("profiles/umg96.toml")),
    ("dtsu666", include_str!("profiles/dtsu666.toml")),
    ("wago879", include_str!("profiles/wago879.toml")),
    ("pro380", include_str!("profiles/pro380.toml")),
    ("iem3000", include_str!("profiles/iem3000.toml")),
    ("pm5xxx", include_str!("profiles/pm5xxx.toml")),
    ("pac", include_str!("profiles/pac.toml")),
    ("adl400", include_str!("profiles/adl400.toml")),
    ("adw300", include_str!("profiles/adw300.toml")),
    ("eda9033a", include_str!("profiles/eda9033a.toml")),
    ("temperature8", include_str!("profiles/temperature8.toml")),
    ("generic", include_str!("profiles/generic.toml")),
];

/// Which registers of a kind of meter hold what.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// As it is named in an address.
    pub name: String,
    /// What the meter is called, as the profile writes it.
    pub meter: String,
    /// Where its numbers are.
    pub table: RegisterTable,
    /// Are the numbers those of the secondary side of transformers?
    pub secondary: bool,
    /// From one poll to the next.
    pub period: Duration,
    /// Registers per request at most.
    pub block_max: u16,
    /// Registers nobody asked for that a block may run across.
    pub block_gap: u16,
    /// Has the map been seen to be right?
    pub confirmed: bool,
    /// Where the map comes from.
    pub source: String,
    /// The numbers of the meter, each with its place.
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
    addresses: Option<RawAddresses>,
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

#[derive(Deserialize, Clone, Copy, Default, PartialEq)]
#[serde(rename_all = "lowercase")]
enum RawSide {
    #[default]
    Primary,
    Secondary,
}

fn tenth() -> f64 {
    0.1
}

fn most() -> u16 {
    REGISTERS_MAX
}

/// The profile of this name: the user's own file goes before a shipped one of the same name.
///
/// # Errors
/// No such profile, or everything that is wrong with it.
pub fn find_profile(name: &str, directory: Option<&Path>) -> Result<Profile, ProfileError> {
    let file: PathBuf = directory.unwrap_or(Path::new("")).join(format!("{name}.toml"));
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'));
    if directory.is_some() && plain && file.exists() {
        return of_file(name, &file);
    }
    if let Some((_, text)) = SHIPPED.iter().find(|(shipped, _)| *shipped == name) {
        return parse(name, name, text);
    }
    let names: Vec<&str> = SHIPPED.iter().map(|(shipped, _)| *shipped).collect();
    let hint = channel::find_nearest_name(name, names.iter().copied())
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
    let whole = Whole { registers: raw.registers, addresses: raw.addresses, word_order: raw.word_order };
    for (index, value) in raw.value.iter().enumerate() {
        match register::read(value, whole) {
            Ok(register) => registers.push(register),
            Err(problem) => problems.push(format!("value {}: {problem}", index + 1)),
        }
    }
    problems.extend(register::describe_overlaps(&registers));
    if !problems.is_empty() {
        return Err(refused(problems));
    }
    Ok(Profile {
        name: name.to_owned(),
        meter: raw.meter,
        table: raw.registers.to_table(),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_profile_can_be_used() {
        for (name, _) in SHIPPED {
            let profile = find_profile(name, None).unwrap_or_else(|error| panic!("{error}"));
            assert!(!profile.source.is_empty() && !profile.registers.is_empty(), "{name}");
        }
    }

    #[test]
    fn a_misspelt_name_gets_a_suggestion() {
        let error = find_profile("sdm63", None).expect_err("no such profile").to_string();
        assert!(error.contains("sdm630") && error.contains("profiles="), "{error}");
        assert!(find_profile("../sdm630", Some(Path::new("/tmp"))).is_err());
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
        assert_eq!(find_profile("sdm630", Some(directory.path())).expect("found").meter, "My meter");
        assert_eq!(find_profile("pac", Some(directory.path())).expect("found").name, "pac");
    }
}
