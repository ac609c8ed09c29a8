//! `stand_in` of a source: the channels that it may deliver while an earlier source has no value.

use super::SourceConfig;
use super::build::as_text;
use super::read::{ConfigInput, SectionValues};
use adapters::ChannelId;
use adapters::channel::find_nearest_name;

const KEY: &str = "stand_in";

/// Adds the channels to the source at this position of the list, and reports names that are none. After the user's own channels.
pub(super) fn add(reading: &mut ConfigInput<'_>, source: &mut SourceConfig, values: &SectionValues, position: usize) {
    let Some(text) = values.found.get(KEY).and_then(as_text) else { return };
    let at = values.find_origin(KEY);
    if position == 0 {
        let next = "write it under the source that comes later; the first one has precedence by its place";
        return reading.add_problem(
            &at,
            format!("`{KEY}` stands under the first source, which has none before it"),
            next,
        );
    }
    for name in text.split([' ', ',']).filter(|name| !name.is_empty()) {
        if let Some(channel) = ChannelId::from_name(name) {
            source.stand_in.push(channel);
            continue;
        }
        let next = match find_nearest_name(name, ChannelId::list_all().map(ChannelId::name)) {
            Some(near) => format!("did you mean {near}?"),
            None => "the names stand in `cnc-gateway check --vocabulary`".to_owned(),
        };
        reading.add_problem(&at, format!("`{KEY}` names {name:?}, which is no channel"), next);
    }
}

#[cfg(test)]
mod tests {
    use crate::{Config, Problem, parse};
    use std::path::Path;

    fn read(first: &str, second: &str) -> Result<Config, Vec<Problem>> {
        let text = format!(
            "[[source]]\nname = \"a\"\naddress = \"simulated://lathe\"\n{first}\n\
             [[source]]\nname = \"b\"\naddress = \"simulated://mill\"\n{second}\n"
        );
        parse("c.toml", &text, Path::new("."), [])
    }

    #[test]
    fn the_channels_are_read_and_wrong_names_are_told_with_their_line() {
        let config = read("", "stand_in = \"total_power_w, supply_voltage_v\"").expect("usable");
        let names: Vec<&str> = config.sources[1].stand_in.iter().map(|channel| channel.name()).collect();
        assert_eq!((names, config.sources[0].stand_in.len()), (vec!["total_power_w", "supply_voltage_v"], 0));
        let told = |first: &str, second: &str| {
            let problems = read(first, second).expect_err("refused");
            problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        };
        let wrong = told("", "stand_in = \"total_powr_w\"");
        assert!(wrong.contains("c.toml:8") && wrong.contains("did you mean total_power_w?"), "{wrong}");
        let first = told("stand_in = \"total_power_w\"", "");
        assert!(first.contains("c.toml:4") && first.contains("none before it"), "{first}");
    }
}
