//! `[[source.channel]]`: the user's own channels, checked and handed to the address of their source.

use super::SourceConfig;
use super::check_value::Scalar;
use super::read::{ConfigInput, Origin, SectionValues};
use adapters::channel::quantity::LIMITS;
use adapters::channel::{CHANNELS, Kind, NewChannel};
use adapters::own::{OwnChannel, ReadWith};
use adapters::text::TextEncoding;
use rules::estimators::Estimates;

/// The unit of a channel that holds a text.
const TEXT: &str = "text";
/// What is possible where nothing says it.
const LIMIT: f64 = 1e6;

/// Adds the channels below a source to it, and reports what cannot be added.
pub(super) fn add(reading: &mut ConfigInput<'_>, source: &mut SourceConfig, values: &SectionValues) {
    let mut own = Vec::new();
    for channel in &values.inner {
        match own_channel(channel) {
            Some(Ok(channel)) => own.push(channel),
            Some(Err((origin, what, next))) => reading.add_problem(&origin, what, next),
            // A key is missing, which has been reported.
            None => {}
        }
    }
    match source.address.clone().with_channels(own) {
        Ok(address) => source.address = address,
        Err(error) => {
            let of = |channel: &&SectionValues| find_text(channel, "name").is_some_and(|name| name == error.channel);
            let at = values.inner.iter().find(of).map_or(Origin::Default, |channel| channel.find_origin(error.key));
            let next = match error.key {
                "name" => "give it another name, or start the gateway again after a change",
                _ => "",
            };
            reading.add_problem(&at, error.to_string(), next);
        }
    }
}

type ChannelRefusal = (Origin, String, String);

fn find_text(values: &SectionValues, key: &str) -> Option<String> {
    match &values.found.get(key)?.value {
        Scalar::Text(text) => Some(text.clone()),
        _ => None,
    }
}

fn find_number(values: &SectionValues, key: &str) -> Option<f64> {
    match &values.found.get(key)?.value {
        Scalar::Number(number) => Some(*number),
        _ => None,
    }
}

fn own_channel(values: &SectionValues) -> Option<Result<OwnChannel, ChannelRefusal>> {
    let (name, read, pace) = (find_text(values, "name")?, find_text(values, "read")?, find_text(values, "pace")?);
    let (scale, offset) = (find_number(values, "scale")?, find_number(values, "offset")?);
    let refused = |key: &str, what: String, next: &str| Some(Err((values.find_origin(key), what, next.to_owned())));
    let new = new_channel(values, name, &read);
    if new.range.0 >= new.range.1 && new.kind != Kind::Text {
        let what = format!("least {} is not below greatest {}", new.range.0, new.range.1);
        return refused("least", what, "correct one of them");
    }
    if scale == 0.0 {
        return refused("scale", "a scale of 0 makes every value 0".to_owned(), "leave it out, or give the factor");
    }
    if Estimates::without_samples(0).list_quantities().iter().any(|(known, _)| *known == new.name)
        || new.name == "state"
    {
        return refused("name", format!("`{}` is the name of an estimate", new.name), "choose another name");
    }
    let label = find_text(values, "encoding");
    let encoding = label.as_deref().map(|label| TextEncoding::of_label(label).ok_or(label));
    let encoding = match encoding.transpose() {
        Ok(encoding) => encoding,
        Err(label) => {
            let what = format!("no character set is called `{label}`");
            return refused("encoding", what, "give auto, gbk, gb18030, shift_jis, utf-8 or windows-1252");
        }
    };
    let pace = if pace == "fast" { ReadWith::Fast } else { ReadWith::Slow };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 10, checked by its key")]
    let path = find_number(values, "path").map(|path| path as u8);
    Some(Ok(OwnChannel { new, read, scale, offset, pace, path, encoding }))
}

/// Unit and limits: as they are written, else of the quantity, else of the channel of the table with this name.
fn new_channel(values: &SectionValues, name: String, read: &str) -> NewChannel {
    let quantity = find_text(values, "quantity").and_then(|word| LIMITS.iter().find(|(known, ..)| *known == word));
    let known = CHANNELS.iter().find(|channel| channel.name == name);
    let of_quantity = quantity.map(|(_, unit, range)| (*unit, *range));
    let (unit, range) = of_quantity.or(known.map(|row| (row.unit, row.range))).unwrap_or(("1", (-LIMIT, LIMIT)));
    let is_text =
        find_text(values, "unit").is_some_and(|unit| unit == TEXT) || known.is_some_and(|row| row.kind == Kind::Text);
    let range = (find_number(values, "least").unwrap_or(range.0), find_number(values, "greatest").unwrap_or(range.1));
    let (en, zh) = (format!("{read}, as configured"), format!("用户通道 {read}"));
    if is_text {
        return NewChannel { name, unit: String::new(), range: (0.0, 0.0), kind: Kind::Text, en, zh };
    }
    let unit = find_text(values, "unit").unwrap_or_else(|| unit.to_owned());
    NewChannel { name, unit, range, kind: Kind::Held, en, zh }
}

#[cfg(test)]
mod tests {
    use crate::{Config, Problem, parse};
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
        let id = adapters::ChannelId::from_name("config_test_pressure_bar").expect("declared");
        assert_eq!(id.channel().unit, "bar");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let told = refused("name = \"x_bar\"\nread = \"pmc Q20\"\n");
        assert!(told.contains("test.toml:5") && told.contains("pmc D20 word"), "{told}");
        // Another problem that says "name" does not hide that the name is missing; a misspelt one is told once.
        let both = refused("read = \"macro 500\"\nunit = 1\n[[sink]]\nname = 1\naddress = \"parquet:/x\"\n");
        assert!(both.contains("needs the key `name`"), "{both}");
        let misspelt = refused("names = \"a_bar\"\nread = \"macro 500\"\n");
        assert!(misspelt.contains("has no key `names`") && !misspelt.contains("needs the key"), "{misspelt}");
        assert!(refused("read = \"macro 500\"\n").contains("needs the key `name`"));
        assert!(refused("name = \"spindle_speed_rpm\"\nread = \"macro 500\"\n").contains("already"));
        assert!(refused("name = \"y_bar\"\nread = \"macro 500\"\nscale = 0\n").contains("scale of 0"));
        assert!(refused("name = \"z_bar\"\nread = \"macro 500\"\nleast = 5\ngreatest = 1\n").contains("not below"));
        assert!(refused("name = \"no_load_power_w\"\nread = \"macro 500\"\n").contains("estimate"));
        assert!(refused("name = \"w_bar\"\nread = \"macro 500\"\ncolour = 1\n").contains("no key `colour`"));
        let text =
            "[[source]]\naddress = \"simulated://lathe\"\n[[source.channel]]\nname = \"v_bar\"\nread = \"macro 1\"\n";
        let told = parse("test.toml", text, Path::new("."), []).expect_err("refused");
        assert!(format!("{}", told[0]).contains("nothing to be asked for"), "{}", told[0]);
        assert!(refused("name = \"u_c\"\nread = \"macro 1\"\nquantity = \"temperatur\"\n").contains("temperature"));
        let told = refused("name = \"t_text\"\nread = \"pmc D1 text 8\"\nunit = \"text\"\nencoding = \"klingon\"\n");
        assert!(told.contains("test.toml:7") && told.contains("klingon"), "{told}");
        assert!(refused("name = \"s_text\"\nread = \"pmc D1 text 8\"\n").contains("write unit = \"text\""));
    }

    #[test]
    fn every_kind_of_source_reads_channels_in_its_own_words() {
        let cases = [
            ("nclink://b/S", "AXIS@5/MOTOR/TEMPERATURE", "AXIS@5 MOTOR TEMPERATURE", "doctor --all"),
            ("hncnet://cnc?library=x.so", "register D120", "macro 500", "register D120"),
            ("mtconnect://agent/M", "Xload", "X load", "doctor --all"),
            ("modbus-tcp://m?profile=sdm630", "input 70 f32", "macro 500", "input 52 f32"),
            ("fanuc://cnc", "macro 500", "input 70 f32", "macro 500"),
        ];
        for (at, (address, good, bad, hint)) in cases.into_iter().enumerate() {
            let with = |name: &str, read: &str| {
                let text = format!(
                    "[[source]]\naddress = \"{address}\"\n[[source.channel]]\nname = \"{name}\"\nread = \"{read}\"\nquantity = \"temperature\"\n"
                );
                parse("test.toml", &text, Path::new("."), [])
            };
            let name = format!("kind_test_{at}_c");
            with(&name, good).unwrap_or_else(|problems| panic!("{address}: {}", problems[0]));
            let id = adapters::ChannelId::from_name(&name).expect("declared");
            assert_eq!((id.channel().unit, id.channel().range), ("°C", (-60.0, 300.0)));
            let told = format!("{}", with(&format!("kind_test_bad_{at}_c"), bad).expect_err("refused")[0]);
            assert!(told.contains("test.toml:5") && told.contains(hint), "{told}");
        }
    }

    #[test]
    fn a_channel_of_the_table_can_be_fed_by_what_the_source_does_not_deliver() {
        let told = read("name = \"spindle_drive_energy_kwh\"\nread = \"diagnosis 4930 axis 1\"\nscale = 0.001\n");
        assert!(told.is_ok(), "{:?}", told.err());
        let wrong = refused("name = \"spindle_drive_energy_kwh\"\nread = \"diagnosis 4930 axis 1\"\nunit = \"W\"\n");
        assert!(wrong.contains("kWh"), "{wrong}");
    }
}
