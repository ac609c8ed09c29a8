//! What runs when no configuration is given: a simulated lathe that shows in five minutes what the box can do.
//!
//! At real time its whole day takes five minutes: off, power-up, warm-up, parts, an alarm, a pause. It begins in a cut. A tool is
//! nearly worn: the wear model that comes with the demonstration says so within minutes. The simulation beside it has learned
//! on earlier days what is usual (`demo/twin.json`, made with the command in its test); two minutes after the start the cuts
//! become heavier than it expects, and the twin tells. Faster than real time it works in shifts with short nights.

use crate::config::Config;
use crate::files::replace;
use crate::history::{Reader, store_wear_model};
use crate::log::{Notice, Severity};
use crate::run::open::MachineSpeed;
use adapters::clock::{Clock, SystemClock};
use rules::estimators::wear::WearRecord;
use std::path::Path;

/// The model of the lathe.
const MODEL: &str = include_str!("demo/lathe.toml");
/// What the twin has learned under it.
const LEARNED: &str = include_str!("demo/twin.json");
/// Cutting power over the wear, in the cuts of the short part.
const WEAR: &str = include_str!("demo/wear.toml");

/// The configuration at this speed.
#[must_use]
pub fn text(speed: MachineSpeed) -> String {
    let day = match speed {
        MachineSpeed::Real => "day=short&begun_s=54&wear_mm=0.235&change_h=0.045&change_cut_pct=125&dropouts_per_h=0",
        MachineSpeed::Times(_) | MachineSpeed::Max => "day=shifts",
    };
    format!("[gateway]\nname = \"Simulated lathe\"\n\n[[source]]\naddress = \"simulated://lathe?{day}\"\n")
}

/// Puts models and memory of the demonstration into the data directory, unless something is there already. A demonstration
/// that cannot be furnished runs without them, and says so.
pub fn furnish(config: &mut Config, speed: MachineSpeed) {
    if speed != MachineSpeed::Real {
        return;
    }
    let data_dir = config.gateway.data_dir.clone();
    match models(&data_dir, &config.history.path) {
        Ok(()) => config.twin.model = Some(data_dir.join("demo-lathe.toml")),
        Err(error) => {
            let text = format!("the demonstration runs without its models: {error}");
            Notice::new(Severity::Warning, "demo", text).say();
        }
    }
}

fn models(data_dir: &Path, history: &Path) -> Result<(), String> {
    let words = |error: std::io::Error| error.to_string();
    std::fs::create_dir_all(data_dir).map_err(words)?;
    let model = data_dir.join("demo-lathe.toml");
    if !model.exists() {
        replace(&model, MODEL).map_err(words)?;
        replace(&data_dir.join("twin.json"), LEARNED).map_err(words)?;
    }
    let known = history.exists() && Reader::open(history).and_then(|it| it.newest_wear_model()).is_ok_and(|id| id > 0);
    if !known {
        let record = WearRecord::parse(WEAR)?;
        store_wear_model(history, SystemClock::new().now_ns(), &record).map_err(|error| error.to_string())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;

    #[test]
    fn the_demonstration_is_a_configuration_and_its_models_are_sound() {
        for speed in [MachineSpeed::Real, MachineSpeed::Times(60.0), MachineSpeed::Max] {
            assert!(parse("demo", &text(speed), Path::new(""), []).is_ok(), "{speed:?}");
        }
        assert!(WearRecord::parse(WEAR).is_ok());
        let directory = tempfile::tempdir().expect("a directory");
        let history = directory.path().join("history.db");
        for _start in 0..2 {
            models(directory.path(), &history).expect("furnished");
        }
        let library = Reader::open(&history).and_then(|reader| reader.wear_models()).expect("readable");
        assert_eq!(library.len(), 1, "stored once");
        let learned: serde_json::Value = serde_json::from_str(LEARNED).expect("JSON");
        assert_eq!(learned["toml"], MODEL, "what was learned belongs to the model");
    }
}
