//! A diagnosis beside the watch: what the machine takes more or less than the model in charge says, by kind of work, and how much of
//! that the diagnosis lays to parameters that it has moved, to effects that it has added, and to nothing.
//!
//! A diagnosis refits the model before it looks for what is missing. "It agrees" may therefore mean that it agrees only with another
//! parameter, and an effect may have the other sign than the difference that the watch sees. Here both stand on the same ground: the
//! model in charge as it is, seconds of settled work, and the kinds of work of the watch.

use super::simulation;
use adapter_core::ChannelId;
use adapter_core::clock::{SECOND_NS, TimeNs};
use recording::Recording;
use rules::twin::live::{Regime, regime, second_row::Row};
use rules::twin::text_report::{format_short_number, space_unit};
use rules::twin::{Diagnosis, Model};
use serde::{Deserialize, Serialize};

/// A difference below this share of the simulated output is none. At standstill, where less is simulated than the noise of a second,
/// it is one below that noise. Lower: every kind of work differs a little from every model; higher: what the watch finds, from 2 % on, is
/// not told here.
const TOLD_SHARE: f64 = 0.02;
/// Parameters that have moved by less than this share of themselves are not named.
const MOVED_SHARE: f64 = 0.01;
/// Rows of a kind of work below which nothing is said.
const ROWS_MIN: usize = 60;
/// Parameters named in a sentence.
const NAMED_MAX: usize = 3;

/// One kind of work, all figures in the unit of the output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BesideModel {
    /// The kind of work.
    pub regime: Regime,
    /// From when on, ns since 1970: since the watch has seen a difference, or the whole stretch.
    pub from_ns: TimeNs,
    /// Number of seconds of this kind of work that were compared.
    pub seconds: usize,
    /// Mean output that the model in charge says.
    pub expected: f64,
    /// Noise of a second.
    #[serde(default)]
    pub noise: f64,
    /// Mean recorded output less mean expected one.
    pub difference: f64,
    /// How much of it comes of parameters that the diagnosis has moved.
    pub by_parameters: f64,
    /// How much of it comes of each effect that it has added.
    pub by_effects: Vec<(String, f64)>,
    /// What nothing accounts for.
    pub left: f64,
    /// What the page says of this kind of work, in English.
    pub en: String,
    /// The same in Chinese.
    pub zh: String,
}

/// A parameter of the model in charge that the diagnosis has moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MovedParameter {
    /// Effect and parameter in the model, joined by a dot.
    pub name: String,
    /// In the model in charge.
    pub before: f64,
    /// Value that the diagnosis has fitted.
    pub after: f64,
    /// Unit symbol of both values.
    pub unit: String,
}

/// When the watch has seen a kind of work begin to differ.
pub type Onset = (Regime, TimeNs);

/// Every kind of work that the stretch holds enough of.
#[must_use]
pub fn beside_model(recording: &Recording, model: &Model, found: &Diagnosis, onsets: &[Onset]) -> Vec<BesideModel> {
    let Ok(simulated) = simulation::run(recording, model, false) else { return Vec::new() };
    let rows = compare_rows(recording, &found.output, simulated.total(), found);
    let moved = moved_parameters(model, found);
    let start_ns = recording.start_ns.unwrap_or(0);
    let of = |regime: Regime| {
        let onset_ns = onsets.iter().find(|(its, _)| *its == regime).map(|(_, onset_ns)| *onset_ns);
        let from_ns = onset_ns.unwrap_or(start_ns);
        let here: Vec<&ComparedRow> = rows.iter().filter(|row| row.regime == regime && row.at_ns >= from_ns).collect();
        (here.len() >= ROWS_MIN).then(|| sum_rows(regime, from_ns.max(start_ns), &here, found, &moved))
    };
    Regime::ALL.into_iter().filter_map(of).collect()
}

/// The parameters of the model in charge that stand at other values in the refitted one.
#[must_use]
pub fn moved_parameters(model: &Model, found: &Diagnosis) -> Vec<MovedParameter> {
    let mut moved: Vec<(f64, MovedParameter)> = Vec::new();
    for (part, fitted) in model.parts.iter().zip(&found.model.parts).filter(|(part, fitted)| part.kind == fitted.kind) {
        for (before, after) in part.parameters.iter().zip(&fitted.parameters) {
            let share = (after.value - before.value).abs() / before.value.abs().max(after.value.abs()).max(1e-12);
            if share > MOVED_SHARE {
                let unit = if before.unit == "output" { found.unit.clone() } else { before.unit.clone() };
                let name = format!("{}.{}", part.label(), before.name);
                moved.push((share, MovedParameter { name, before: before.value, after: after.value, unit }));
            }
        }
    }
    moved.sort_by(|a, b| b.0.total_cmp(&a.0));
    moved.into_iter().map(|(_, moved)| moved).collect()
}

/// A second that everything is known of.
struct ComparedRow {
    at_ns: TimeNs,
    regime: Regime,
    row: usize,
    recorded: f64,
    expected: f64,
    after: f64,
}

fn compare_rows(recording: &Recording, output: &str, expected: &[Option<f64>], found: &Diagnosis) -> Vec<ComparedRow> {
    let Some(recorded) = recording.find_numbers(output) else { return Vec::new() };
    let start_ns = recording.start_ns.unwrap_or(0);
    let one = |row: usize| {
        let (regime, _) = regime::classify_row(&second_of(recording, row))?;
        #[expect(clippy::cast_possible_truncation, reason = "seconds of a stretch of some hours")]
        let at_ns = start_ns + (recording.time_s[row] * SECOND_NS as f64) as i64;
        Some(ComparedRow {
            at_ns,
            regime,
            row,
            recorded: recorded.get(row)?,
            expected: (*expected.get(row)?)?,
            after: (*found.rows.simulated_after.get(row)?)?,
        })
    };
    (0..recording.count_rows()).filter_map(one).collect()
}

/// The row as the watch sees it.
fn second_of(recording: &Recording, row: usize) -> Row {
    let number = |id: ChannelId| recording.find_numbers(id.name()).and_then(|numbers| numbers.get(row));
    Row { numbers: ChannelId::list_all().map(number).collect(), ..Row::default() }
}

fn sum_rows(
    regime: Regime,
    from_ns: TimeNs,
    rows: &[&ComparedRow],
    found: &Diagnosis,
    moved: &[MovedParameter],
) -> BesideModel {
    #[expect(clippy::cast_precision_loss, reason = "rows of some hours")]
    let count = rows.len() as f64;
    let mean = |of: &dyn Fn(&ComparedRow) -> f64| rows.iter().map(|row| of(row)).sum::<f64>() / count;
    let expected = mean(&|row| row.expected);
    let effects = found.rows.effects.iter();
    let by_effects: Vec<(String, f64)> = effects
        .map(|(kind, values)| (kind.clone(), mean(&|row| values.get(row.row).copied().unwrap_or(0.0))))
        .filter(|(_, share)| share.abs() > TOLD_SHARE * expected.abs().max(1e-9) * 0.1)
        .collect();
    let mut one = BesideModel {
        regime,
        from_ns,
        seconds: rows.len(),
        expected,
        noise: found.fit.as_ref().map_or(0.0, |fit| fit.noise_floor),
        difference: mean(&|row| row.recorded - row.expected),
        // What is neither an effect nor left over is the refitted baseline.
        by_parameters: mean(&|row| row.after - row.expected) - by_effects.iter().map(|(_, share)| share).sum::<f64>(),
        by_effects,
        left: mean(&|row| row.recorded - row.after),
        en: String::new(),
        zh: String::new(),
    };
    (one.en, one.zh) = describe_model(&one, &found.unit, moved);
    one
}

impl BesideModel {
    /// A difference up to this is none.
    fn negligible_difference(&self) -> f64 {
        if self.expected.abs() > self.noise { TOLD_SHARE * self.expected.abs() } else { self.noise }
    }

    /// Is the difference worth telling?
    #[must_use]
    pub fn has_difference(&self) -> bool {
        self.difference.abs() > self.negligible_difference()
    }

    /// How far the machine is from the model in charge, English and Chinese.
    fn difference_words(&self, unit: &str) -> (String, String) {
        let (en_where, zh_where) = self.regime.as_phrases();
        let amount = format_short_number(self.difference.abs()) + space_unit(unit).as_str();
        // A share of nothing is no figure.
        let share = (self.expected.abs() > self.negligible_difference())
            .then(|| format_short_number(100.0 * self.difference.abs() / self.expected.abs()));
        let en_share = share.as_ref().map_or(String::new(), |share| format!(" ({share} %)"));
        let zh_share = share.map_or(String::new(), |share| format!("（{share} %）"));
        let (en_way, zh_way) = if self.difference > 0.0 { ("more", "高") } else { ("less", "低") };
        (
            format!("{en_where} the machine takes {amount}{en_share} {en_way} than the model in charge says"),
            format!("{zh_where}比当前模型{zh_way}{amount}{zh_share}"),
        )
    }

    /// Is it mostly a parameter of the model in charge that has become another one?
    #[must_use]
    pub fn is_of_parameters(&self) -> bool {
        self.has_difference()
            && self.by_parameters * self.difference > 0.0
            && self.by_parameters.abs() > 0.5 * self.difference.abs()
    }
}

/// Before what a diagnosis makes of it stands how far the machine is from the model in charge: a diagnosis refits the model, and what it
/// then adds may have the other sign.
#[must_use]
pub fn compose_headline(beside: &[BesideModel], unit: &str, (en, zh): (&str, &str)) -> (String, String) {
    let (first, second): (Vec<String>, Vec<String>) =
        beside.iter().filter(|one| one.has_difference()).map(|one| one.difference_words(unit)).unzip();
    if first.is_empty() {
        return (en.to_owned(), zh.to_owned());
    }
    let begin = first.join("; ");
    let begin = begin[..1].to_uppercase() + &begin[1..];
    (format!("{begin}. With its parameters fitted anew: {en}"), format!("{}。重新拟合参数后：{zh}", second.join("；")))
}

fn describe_model(one: &BesideModel, unit: &str, moved: &[MovedParameter]) -> (String, String) {
    let (en_where, zh_where) = one.regime.as_phrases();
    let amount_unit = space_unit(unit);
    if !one.has_difference() {
        return (
            format!(
                "{en_where} the machine takes what the model in charge says ({:+}{amount_unit})",
                round_for_display(one.difference)
            ),
            format!("{zh_where}与当前模型一致（{:+}{amount_unit}）", round_for_display(one.difference)),
        );
    }
    let mut en: Vec<String> = Vec::new();
    let mut zh: Vec<String> = Vec::new();
    let told = |value: f64| value.abs() > 0.05 * one.difference.abs();
    if told(one.by_parameters) {
        let of = |it: &MovedParameter| {
            let (before, after) = (format_short_number(it.before), format_short_number(it.after));
            format!("{} {before} → {after}{}", it.name, space_unit(&it.unit))
        };
        let names: Vec<String> = moved.iter().take(NAMED_MAX).map(of).collect();
        let names = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
        en.push(format!(
            "{:+}{amount_unit} because parameters of the model are other ones now{names}",
            round_for_display(one.by_parameters)
        ));
        zh.push(format!("模型参数变化{:+}{amount_unit}{names}", round_for_display(one.by_parameters)));
    }
    for (kind, share) in one.by_effects.iter().filter(|(_, share)| told(*share)) {
        en.push(format!("{:+}{amount_unit} by {kind}", round_for_display(*share)));
        zh.push(format!("{kind} {:+}{amount_unit}", round_for_display(*share)));
    }
    if told(one.left) || en.is_empty() {
        en.push(format!("{:+}{amount_unit} by nothing that was found", round_for_display(one.left)));
        zh.push(format!("未找到原因{:+}{amount_unit}", round_for_display(one.left)));
    }
    let (en_difference, zh_difference) = one.difference_words(unit);
    (format!("{en_difference}: {}", en.join(", ")), format!("{zh_difference}：{}", zh.join("，")))
}

/// For a sum that can be checked on the page.
fn round_for_display(value: f64) -> f64 {
    let digits = if value.abs() >= 10.0 { 0 } else { 1 };
    let scale = 10_f64.powi(digits);
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(regime: Regime, expected: f64, difference: f64) -> BesideModel {
        let mut one = BesideModel {
            regime,
            from_ns: 0,
            seconds: 100,
            expected,
            noise: 10.0,
            difference,
            by_parameters: 0.0,
            by_effects: vec![("gear_stage".to_owned(), -70.0)],
            left: difference + 70.0,
            en: String::new(),
            zh: String::new(),
        };
        (one.en, one.zh) = describe_model(&one, "W", &[]);
        one
    }

    #[test]
    fn below_the_noise_of_a_second_nothing_differs_and_of_nothing_there_is_no_share() {
        assert!(!one(Regime::Standby, 0.0, 0.3).has_difference());
        assert!(
            !one(Regime::Cutting, 2000.0, 39.0).has_difference() && one(Regime::Cutting, 2000.0, 41.0).has_difference()
        );
        let standby = one(Regime::Standby, 0.0, -120.0);
        assert!(standby.has_difference() && !standby.en.contains('%') && !standby.zh.contains('%'), "{}", standby.en);
    }

    #[test]
    fn no_sentence_carries_the_unit_of_what_has_none() {
        let parameter = |unit: &str| MovedParameter {
            name: "speed_table.p0".to_owned(),
            before: 1.0,
            after: 1.3,
            unit: unit.to_owned(),
        };
        for expected in [0.0, 1772.0] {
            for difference in [0.3, 251.0, -251.0] {
                let mut of = one(Regime::Cutting, expected, difference);
                of.by_parameters = difference;
                let (en, zh) = describe_model(&of, "1", &[parameter("1"), parameter("W")]);
                let (first, first_zh) = compose_headline(&[of], "1", ("It agrees.", "一致。"));
                for text in [en, zh, first, first_zh] {
                    let parts: Vec<&str> = text.split(' ').collect();
                    let is_one = |part: &str| part.trim_matches(|c: char| !c.is_ascii_digit() && c != '.') == "1";
                    let is_number = |part: &str| part.trim_start_matches(['(', '+']).parse::<f64>().is_ok();
                    let ones = parts.windows(2).filter(|pair| is_number(pair[0]) && is_one(pair[1]));
                    assert_eq!(ones.count(), 0, "{text}");
                    assert!(!text.contains("  ") && !text.contains(" )"), "{text}");
                }
            }
        }
        let told = describe_model(
            &BesideModel { by_parameters: 251.0, ..one(Regime::Cutting, 1772.0, 251.0) },
            "W",
            &[parameter("1")],
        );
        assert!(told.0.contains("speed_table.p0 1 → 1.3)") && told.0.contains("+251 W"), "{}", told.0);
    }

    #[test]
    fn the_answer_begins_with_what_the_watch_sees() {
        let beside = [one(Regime::Standby, 0.0, 0.3), one(Regime::Cutting, 1772.0, 251.0)];
        let (en, zh) = compose_headline(&beside, "W", ("The model lacks gear stage.", "模型缺少换挡。"));
        assert_eq!(
            en,
            "While cutting the machine takes 251 W (14.16 %) more than the model in charge says. With its parameters fitted anew: The \
             model lacks gear stage."
        );
        assert_eq!(zh, "切削时比当前模型高251 W（14.16 %）。重新拟合参数后：模型缺少换挡。");
        assert_eq!(
            compose_headline(&beside[..1], "W", ("It agrees.", "一致。")),
            ("It agrees.".to_owned(), "一致。".to_owned())
        );
    }
}
