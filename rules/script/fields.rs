//! The records that a script reads by field: `sample.spindle_power_w`, `estimates.cutting_power_w`, `age_s.tool`,
//! `missing.spindle_power_w`.
//!
//! A record holds only the fields that the script names, which are known before it runs: so a misspelt one is told when
//! the file is loaded, and one that nobody reads costs nothing.

use super::vocabulary::{View, Word, WordSource, WordValue, find_word, list_words};
use adapter_core::Absence;
use adapter_core::channel::find_nearest_name;
use adapter_core::clock::SECOND_NS;
use estimators::NoEstimate;

/// What a record tells of its fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tells {
    Channel,
    Estimate,
    Age,
    Absence,
}

/// A record of fields that a script reads, as `sample`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    /// Its name in scripts.
    pub name: &'static str,
    /// One of its fields.
    pub example: &'static str,
    /// What it is, in English.
    pub en: &'static str,
    /// What it is, in Chinese.
    pub zh: &'static str,
    tells: Tells,
}

/// Every record that a script can read.
pub const RECORDS: [Record; 4] = [
    Record {
        name: "sample",
        example: "sample.spindle_power_w",
        en: "A channel; the same as its plain name",
        zh: "测量通道（与直接写通道名相同）",
        tells: Tells::Channel,
    },
    Record {
        name: "estimates",
        example: "estimates.cutting_power_w",
        en: "An estimate or its standard deviation; the same as its plain name",
        zh: "估计量（与直接写名称相同）",
        tells: Tells::Estimate,
    },
    Record {
        name: "age_s",
        example: "age_s.spindle_power_w",
        en: "How old the value of a channel is, s; 0 between two readings; no value when the channel has none",
        zh: "通道数据的时间（秒）",
        tells: Tells::Age,
    },
    Record {
        name: "missing",
        example: "missing.spindle_power_w",
        en: "Why a channel or an estimate has no value, as one word (timeout, stale, not_learned, ...); no value when it has one",
        zh: "通道或估计量无值的原因",
        tells: Tells::Absence,
    },
];

/// The record of this name.
pub(super) fn find_record(name: &str) -> Option<&'static Record> {
    RECORDS.iter().find(|record| record.name == name)
}

/// One field of a record.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field {
    pub(super) record: &'static Record,
    pub(super) word: &'static Word,
}

impl Field {
    /// The value in this run.
    pub(super) fn read_value<'a>(&self, view: &View<'a>) -> WordValue<'a> {
        match self.record.tells {
            Tells::Channel | Tells::Estimate => self.word.read_value(view),
            Tells::Age => read_age(self.word, view),
            Tells::Absence => read_absence(self.word, view),
        }
    }

    /// The words that it can be, where it is the reason of an absence.
    pub(super) fn list_reasons(&self) -> Option<Vec<&'static str>> {
        let of_channel = matches!(self.word.source, WordSource::Channel(_) | WordSource::Tool(_));
        let words =
            || if of_channel { Absence::ALL.map(Absence::as_word).to_vec() } else { NoEstimate::WORDS.to_vec() };
        (self.record.tells == Tells::Absence).then(words)
    }

    /// Is it the age of a value?
    pub(super) fn is_age(&self) -> bool {
        self.record.tells == Tells::Age
    }
}

fn read_age<'a>(word: &Word, view: &View<'a>) -> WordValue<'a> {
    let (WordSource::Channel(id) | WordSource::Tool(id)) = word.source else { return WordValue::Absent };
    let slot = view.sample.slot(id);
    if slot.value.is_ok() { WordValue::Number(slot.age_ns as f64 / SECOND_NS as f64) } else { WordValue::Absent }
}

fn read_absence<'a>(word: &Word, view: &View<'a>) -> WordValue<'a> {
    let reason = match word.source {
        WordSource::Channel(id) | WordSource::Tool(id) => {
            view.sample.slot(id).value.as_ref().err().map(|absence| absence.as_word())
        }
        WordSource::Quantity(read) | WordSource::Deviation(read) => {
            read(view.estimates).err().map(|reason| reason.as_word())
        }
        WordSource::Figure(read) => read(view.estimates).err().map(|reason| reason.as_word()),
        _ => None,
    };
    reason.map_or(WordValue::Absent, WordValue::Text)
}

impl Record {
    fn has_word(&self, word: &Word) -> bool {
        let channel = matches!(word.source, WordSource::Channel(_) | WordSource::Tool(_));
        let quantity =
            matches!(word.source, WordSource::Quantity(_) | WordSource::Deviation(_) | WordSource::Figure(_));
        match self.tells {
            Tells::Channel | Tells::Age => channel,
            Tells::Estimate => !channel && !["memory", "now_s", "dt_s"].contains(&word.name),
            Tells::Absence => channel || quantity,
        }
    }

    /// The field of this name, or what to write instead.
    pub(super) fn find_field(&'static self, name: &str) -> Result<Field, String> {
        let names = || list_words().iter().filter(|word| self.has_word(word)).map(|word| word.name);
        match find_word(name) {
            Some(word) if self.has_word(word) => Ok(Field { record: self, word }),
            Some(word) => {
                let other = RECORDS.iter().find(|other| other.has_word(word));
                let there = other.map_or_else(|| name.to_owned(), |other| format!("{}.{name}", other.name));
                Err(format!("write `{there}`"))
            }
            None => match find_nearest_name(name, names()) {
                Some(near) => Err(format!("did you mean `{}.{near}`?", self.name)),
                None => Err("`cnc-gateway rules api` lists every channel and estimate".to_owned()),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::{ChannelId, Sample, Slot, Value};
    use estimators::Estimates;

    fn field(record_name: &str, name: &str) -> Result<Field, String> {
        find_record(record_name).expect("a record").find_field(name)
    }

    #[test]
    fn every_channel_and_estimate_is_a_field() {
        for id in ChannelId::list_all() {
            for record in ["sample", "age_s", "missing"] {
                assert!(field(record, id.name()).is_ok(), "{record}.{id}");
            }
        }
        for (name, _) in Estimates::without_samples(0).list_quantities() {
            assert!(field("estimates", name).is_ok() && field("missing", name).is_ok(), "{name}");
        }
        assert!(field("estimates", "state").is_ok());
    }

    #[test]
    fn what_to_write_instead() {
        let told = |record, name| field(record, name).expect_err("no field");
        assert_eq!(told("sample", "spindel_power_w"), "did you mean `sample.spindle_power_w`?");
        assert_eq!(told("sample", "cutting_power_w"), "write `estimates.cutting_power_w`");
        assert_eq!(told("estimates", "spindle_power_w"), "write `sample.spindle_power_w`");
        assert!(told("age_s", "now_s").contains("now_s"));
    }

    #[test]
    fn age_and_reason() {
        let id = ChannelId::from_name("spindle_power_w").expect("a channel");
        let (mut sample, estimates) = (Sample::new_empty(0), Estimates::without_samples(0));
        let see = |sample: &Sample, record: &str| {
            let view = View { sample, estimates: &estimates, dt_s: 0.0 };
            let seen = field(record, "spindle_power_w").expect("a field").read_value(&view);
            format!("{seen:?}")
        };
        sample.set_slot(id, Slot { value: Ok(Value::Number(7.0)), age_ns: SECOND_NS / 2 });
        assert_eq!(
            [see(&sample, "sample"), see(&sample, "age_s"), see(&sample, "missing")],
            ["Number(7.0)", "Number(0.5)", "Absent"]
        );
        sample.set_slot(id, Slot::from_absence(Absence::Timeout));
        assert_eq!([see(&sample, "sample"), see(&sample, "age_s")], ["Absent", "Absent"]);
        assert!(see(&sample, "missing").contains("timeout"));
    }
}
