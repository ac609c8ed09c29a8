//! `[[source.channel]]`: the user's own channels, checked and handed to the address of their source.

use super::SourceConfig;
use super::check_value::Scalar;
use super::read::{ConfigInput, Origin, SectionValues};
use adapters::channel::{Kind, NewChannel};
use adapters::fanuc::own::{OwnChannel, OwnItem, ReadWith};
use rules::estimators::Estimates;

/// Adds the channels below a source to it, and reports what cannot be added.
pub(super) fn add(reading: &mut ConfigInput<'_>, source: &mut SourceConfig, values: &SectionValues) {
    let mut own = Vec::new();
    for channel in &values.inner {
        match own_channel(channel) {
            Some(Ok(channel)) => own.push(channel),
            Some(Err((origin, what, next))) => reading.problem(&origin, what, next),
            // A key is missing, which has been reported.
            None => {}
        }
    }
    let at = values.inner.first().map_or(Origin::Default, |channel| channel.origin("name"));
    match source.address.clone().with_channels(own) {
        Ok(address) => source.address = address,
        Err(what) => reading.problem(&at, what, "give it another name, or start the gateway again after a change"),
    }
}

type ChannelRefusal = (Origin, String, String);

fn own_channel(values: &SectionValues) -> Option<Result<OwnChannel, ChannelRefusal>> {
    let text = |key: &str| match &values.found.get(key)?.value {
        Scalar::Text(text) => Some(text.clone()),
        _ => None,
    };
    let number = |key: &str| match &values.found.get(key)?.value {
        Scalar::Number(number) => Some(*number),
        _ => None,
    };
    let (name, read, unit, pace) = (text("name")?, text("read")?, text("unit")?, text("pace")?);
    let (scale, offset, range) = (number("scale")?, number("offset")?, (number("least")?, number("greatest")?));
    let refused = |key: &str, what: String, next: &str| Some(Err((values.origin(key), what, next.to_owned())));
    let found = match OwnItem::read(&read) {
        Ok(found) => found,
        Err(what) => return refused("read", what, ""),
    };
    if range.0 >= range.1 {
        return refused("least", format!("least {} is not below greatest {}", range.0, range.1), "correct one of them");
    }
    if scale == 0.0 {
        return refused("scale", "a scale of 0 makes every value 0".to_owned(), "leave it out, or give the factor");
    }
    if Estimates::none(0).quantities().iter().any(|(known, _)| *known == name) || name == "state" {
        return refused("name", format!("`{name}` is the name of an estimate"), "choose another name");
    }
    let (en, zh) = (format!("{read}, as configured"), format!("用户通道 {read}"));
    let new = NewChannel { name, unit, range, kind: Kind::Held, en, zh };
    let pace = if pace == "fast" { ReadWith::Fast } else { ReadWith::Slow };
    let path = number("path").map(|path| path as u8);
    Some(Ok(OwnChannel { new, item: found.item, bit: found.bit, scale, offset, pace, path }))
}

#[cfg(test)]
mod tests {
    use crate::config::{Config, Problem, parse};
    use std::path::Path;

    fn read(channel: &str) -> Result<Config, Vec<Problem>> {
        let text = format!("[[source]]\naddress = \"fanuc://cnc\"\n[[source.channel]]\n{channel}");
        parse("test.toml", &text, Path::new("."), [])
    }

    fn refused(channel: &str) -> String {
        read(channel).expect_err("refused").iter().map(|problem| format!("{problem}\n")).collect()
    }

    #[test]
    fn a_channel_of_ones_own_is_in_the_table() {
        let config =
            read("name = \"config_test_pressure_bar\"\nread = \"pmc D20 word\"\nunit = \"bar\"\nscale = 0.1\n");
        let config = config.expect("accepted");
        assert_eq!(config.sources.len(), 1);
        let id = adapters::ChannelId::of("config_test_pressure_bar").expect("declared");
        assert_eq!(id.channel().unit, "bar");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let told = refused("name = \"x_bar\"\nread = \"pmc Q20\"\n");
        assert!(told.contains("test.toml:5") && told.contains("pmc D20 word"), "{told}");
        assert!(refused("read = \"macro 500\"\n").contains("needs the key `name`"));
        assert!(refused("name = \"spindle_speed_rpm\"\nread = \"macro 500\"\n").contains("already"));
        assert!(refused("name = \"y_bar\"\nread = \"macro 500\"\nscale = 0\n").contains("scale of 0"));
        assert!(refused("name = \"z_bar\"\nread = \"macro 500\"\nleast = 5\ngreatest = 1\n").contains("not below"));
        assert!(refused("name = \"no_load_power_w\"\nread = \"macro 500\"\n").contains("estimate"));
        assert!(refused("name = \"w_bar\"\nread = \"macro 500\"\ncolour = 1\n").contains("no key `colour`"));
        let text =
            "[[source]]\naddress = \"simulated://lathe\"\n[[source.channel]]\nname = \"v_bar\"\nread = \"macro 1\"\n";
        let told = parse("test.toml", text, Path::new("."), []).expect_err("refused");
        assert!(format!("{}", told[0]).contains("only fanuc://"), "{}", told[0]);
    }
}
