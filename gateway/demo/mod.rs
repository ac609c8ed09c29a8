//! What runs when no configuration is given: a simulated lathe that shows in five minutes what the box can do.
//!
//! At real time its whole day takes five minutes: off, power-up, warm-up, parts, an alarm, a pause. It begins in a cut. A tool is
//! nearly worn: the wear model that comes with the demonstration says so within minutes. Estimators and twin remember earlier
//! days (`demo/estimators.json`, `demo/wear.json`, `demo/twin.json`): on those the same machine ran through this program, healthy for sixteen hours
//! and then with more friction in the spindle, which the twin has noticed and still tells. Their times are moved so that those
//! days ended an hour before the start. What is known of the wear (`demo/wear.json`) is from one whole life of an edge and most of the
//! next, 11,100 s of the same machine at `--speed max`; the edges then got the names that the machine gives to its first ones. The wear
//! model counts only for the work material that it was learned with, which the recipe of the demonstration names. The thermal law
//! (`demo/thermal.json`) is what `identify thermal --model` made of four hours of this very address at `--speed max`, from
//! a cold start, with the gauge that it has (`gauge_um=0.5`). Faster than real time the machine works in shifts with short nights.

use crate::clock;
use crate::config::Config;
use crate::files::replace_file;
use crate::history::{HistoryError, Reader, store_wear_model};
use crate::log::{Notice, Severity};
use crate::sources::open::MachineSpeed;
use adapters::clock::SECOND_NS;
use rules::estimators::wear::WearRecord;
use serde_json::{Value, json};
use std::ops::Range;
use std::path::Path;
use thiserror::Error;

/// The model of the lathe.
const MODEL: &str = include_str!("lathe.toml");
/// What the twin has learned under it.
const LEARNED: &str = include_str!("twin.json");
/// What the estimators have learned.
const ESTIMATED: &str = include_str!("estimators.json");
/// What is known of the wear of the edges.
const WORN: &str = include_str!("wear.json");
/// What is cut: no controller can be asked for the material.
const RECIPE: &str = include_str!("operations.toml");
/// Cutting power over the wear, in the cuts of the short part.
const WEAR: &str = include_str!("wear.toml");
/// The thermal error over the temperatures.
const THERMAL: &str = include_str!("thermal.json");

/// The thermal law, in the data directory. Not `thermal.json`: that is what the law learns from readings.
const THERMAL_FILE: &str = "demo-thermal.json";

/// The recipe, in the data directory.
const RECIPE_FILE: &str = "demo-operations.toml";
const HOUR_S: i64 = 3600;
/// 2017 to 2096, in seconds since 1970.
const DECADES_S: Range<f64> = 1.5e9..4e9;

/// The configuration at this speed.
#[must_use]
pub fn config_text(speed: MachineSpeed) -> String {
    let day = match speed {
        MachineSpeed::Real => {
            "day=short&begun_s=44&wear_mm=0.27&change_h=0&change_friction_pct=150&dropouts_per_h=0&gauge_um=0.5"
        }
        MachineSpeed::Times(_) | MachineSpeed::Max => "day=shifts",
    };
    format!("[gateway]\nname = \"Simulated lathe\"\n\n[[source]]\naddress = \"simulated://lathe?{day}\"\n")
}

/// Puts models and memory of the demonstration into the data directory, unless something is there already. A demonstration
/// that cannot be furnished runs without them, and says so.
pub fn install_data(config: &mut Config, speed: MachineSpeed) {
    if speed != MachineSpeed::Real {
        return;
    }
    let data_dir = config.gateway.data_dir.clone();
    match write_models(&data_dir, &config.history.path) {
        Ok(()) => {
            config.twin.model = Some(data_dir.join("demo-lathe.toml"));
            config.operations.path.get_or_insert(data_dir.join(RECIPE_FILE));
            config.thermal.model.get_or_insert(data_dir.join(THERMAL_FILE));
            let set = [
                ("[twin] model", config.twin.model.clone()),
                ("[operations] path", config.operations.path.clone()),
                ("[thermal] model", config.thermal.model.clone()),
            ];
            for (key, path) in set {
                path.into_iter().for_each(|path| config.note_built_in(key, &path));
            }
        }
        Err(error) => {
            let text = format!("the demonstration runs without its models: {error}");
            Notice::new(Severity::Warning, "demo", text).write_to_logs();
        }
    }
}

/// Why the demonstration has no models.
#[derive(Debug, Error)]
enum FurnishError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] std::io::Error),
    /// A memory that comes with the program is none.
    #[error(transparent)]
    Memory(#[from] serde_json::Error),
    /// The wear model that comes with the program is none.
    #[error("{0}")]
    WearModel(String),
    /// The history does not take the wear model.
    #[error(transparent)]
    History(#[from] HistoryError),
}

fn write_models(data_dir: &Path, history: &Path) -> Result<(), FurnishError> {
    std::fs::create_dir_all(data_dir)?;
    let model = data_dir.join("demo-lathe.toml");
    let now_ns = clock::now_ns();
    if !model.exists() {
        let ended_s = (now_ns / SECOND_NS - HOUR_S) as f64;
        replace_file(&data_dir.join("twin.json"), &shift_times(LEARNED, ended_s)?)?;
        replace_file(&data_dir.join("wear.json"), &shift_times(WORN, ended_s)?)?;
        // The state that the estimators remember would otherwise seem to have lasted since then.
        replace_file(&data_dir.join("estimators.json"), &shift_times(ESTIMATED, (now_ns / SECOND_NS) as f64)?)?;
        replace_file(&model, MODEL)?;
    }
    let recipe = data_dir.join(RECIPE_FILE);
    if !recipe.exists() {
        replace_file(&recipe, RECIPE)?;
    }
    let law = data_dir.join(THERMAL_FILE);
    if !law.exists() {
        replace_file(&law, THERMAL)?;
    }
    let known = history.exists() && Reader::open(history).and_then(|it| it.newest_wear_model()).is_ok_and(|id| id > 0);
    if !known {
        let record = WearRecord::parse(WEAR).map_err(FurnishError::WearModel)?;
        store_wear_model(history, now_ns, &record)?;
    }
    Ok(())
}

/// The same memory with all its times moved so that the newest of them is `newest_s`.
fn shift_times(text: &str, newest_s: f64) -> Result<String, serde_json::Error> {
    let mut memory: Value = serde_json::from_str(text)?;
    let mut newest: f64 = 0.0;
    each_time(&mut memory, &mut |at_s| {
        newest = newest.max(at_s);
        at_s
    });
    each_time(&mut memory, &mut |at_s| at_s + newest_s - newest);
    Ok(memory.to_string())
}

/// Every number that is a time of these decades, in seconds or in nanoseconds since 1970, handed over in seconds.
fn each_time(memory: &mut Value, take: &mut impl FnMut(f64) -> f64) {
    match memory {
        Value::Array(list) => list.iter_mut().for_each(|it| each_time(it, take)),
        Value::Object(map) => map.values_mut().for_each(|it| each_time(it, take)),
        Value::Number(number) => {
            let value = number.as_f64().unwrap_or(0.0);
            if DECADES_S.contains(&value) {
                *memory = json!(take(value));
            } else if DECADES_S.contains(&(value / 1e9)) {
                #[expect(clippy::cast_possible_truncation, reason = "within the decades above")]
                let at_ns = (take(value / 1e9) * 1e9) as i64;
                *memory = json!(at_ns);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;

    #[test]
    fn the_demonstration_is_a_configuration_and_its_models_are_sound() {
        for speed in [MachineSpeed::Real, MachineSpeed::Times(60.0), MachineSpeed::Max] {
            assert!(parse("demo", &config_text(speed), Path::new(""), []).is_ok(), "{speed:?}");
        }
        assert!(WearRecord::parse(WEAR).is_ok());
        let directory = tempfile::tempdir().expect("a directory");
        let history = directory.path().join("history.db");
        for _start in 0..2 {
            write_models(directory.path(), &history).expect("furnished");
        }
        let library = Reader::open(&history).and_then(|reader| reader.wear_models::<WearRecord>()).expect("readable");
        assert_eq!(library.len(), 1, "stored once");
        let recipe = rules::operations::parse("demo-operations.toml", RECIPE).expect("a recipe");
        let materials: Vec<_> = recipe.operations().iter().filter_map(|it| it.work_material.as_deref()).collect();
        assert_eq!(materials, [library[0].record.key.work_material.as_str()], "the model is for what is cut");
        let learned: Value = serde_json::from_str(LEARNED).expect("JSON");
        assert_eq!(learned["toml"], MODEL, "what was learned belongs to the model");
    }

    #[test]
    fn times_are_moved_and_nothing_else_is() {
        let text =
            r#"{"at_s":2000000000.5,"due":{"at_ns":2000000001000000000},"watts":850.25,"count":3,"word":"idle"}"#;
        let memory: Value = serde_json::from_str(&shift_times(text, 1_700_000_000.0).expect("moved")).expect("JSON");
        assert_eq!(memory["at_s"], 1_699_999_999.5);
        assert_eq!(memory["due"]["at_ns"], 1_700_000_000_000_000_000_i64);
        assert_eq!((&memory["watts"], &memory["count"], &memory["word"]), (&json!(850.25), &json!(3), &json!("idle")));
    }
}
