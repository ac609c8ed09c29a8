//! Where the missing effects act: conditions in words, sizes, times, and the strip of runs.

use super::data::Data;
use super::strip::{REGIONS_MAX, render_strip};
use super::text::{format_fixed, format_number, format_signed, with_unit};
use rules::physics::explain::Language;
use rules::twin::region::{OnsetInterval, Region};

/// The section; empty where nothing is located.
pub(super) fn render_section(data: &Data<'_>) -> String {
    let regions = &data.diagnosis.mismatch;
    if regions.is_empty() {
        return String::new();
    }
    let items: String = regions.iter().enumerate().map(|(lane, region)| render_region(data, lane, region)).collect();
    format!(
        "<section><h2>{}</h2><ul class=\"regions\">{items}</ul>{}</section>\n",
        data.pick_text("Where", "在哪里"),
        render_strip(data)
    )
}

fn render_region(data: &Data<'_>, lane: usize, region: &Region) -> String {
    let tongue = data.tongue;
    let conditions: Vec<String> =
        region.conditions.iter().map(|condition| tongue.describe_condition(condition)).collect();
    let place = match conditions.is_empty() {
        true => data
            .pick_text("Throughout the recording; no condition narrows it down", "遍及整个记录，没有条件能缩小范围")
            .to_owned(),
        false => format!("{}{}", data.pick_text("Where ", ""), tongue.join_words(&conditions, (" and ", "且"))),
    };
    let colour = if lane < REGIONS_MAX { format!("e{lane}") } else { "none".to_owned() };
    format!(
        "<li><i class=\"{colour} s4\"></i><div><strong>{}</strong><p>{place}{}</p><p class=\"note\">{}</p></div></li>",
        super::text::capitalise_first(&tongue.name_effect(&region.effect)),
        data.pick_text(".", "。"),
        describe_region(data, region)
    )
}

fn describe_region(data: &Data<'_>, region: &Region) -> String {
    let share = super::text::format_percent(100.0 * region.share);
    let mut facts = match data.tongue.0 {
        Language::En => vec![format!("{share} of what is missing lies here")],
        Language::Zh => vec![format!("缺失部分的{share}位于此处")],
    };
    facts.push(describe_amount(data, region));
    facts.push(describe_stretches(data, region));
    if let Some(onset) = &region.onset {
        facts.push(describe_onset(data, onset));
    }
    facts.join(" · ")
}

/// How much it is there: a mean, or a typical size where both signs would cancel.
pub(super) fn describe_amount(data: &Data<'_>, region: &Region) -> String {
    let unit = data.output_unit();
    match region.both_signs {
        Some(size) => {
            let size = with_unit(&format!("±{}", format_number(size)), &unit);
            format!("{}{size}", data.pick_text("of both signs, typically ", "正负交替，典型大小"))
        }
        None => format!("{}{}", data.pick_text("on average ", "平均"), with_unit(&format_signed(region.mean), &unit)),
    }
}

fn describe_stretches(data: &Data<'_>, region: &Region) -> String {
    let mut runs: Vec<&str> = region.spans.iter().map(|span| span.run.as_str()).collect();
    runs.dedup();
    runs.sort_unstable();
    runs.dedup();
    let (spans, runs, all) = (region.spans.len(), runs.len(), data.runs.len());
    match (data.tongue.0, spans) {
        (Language::En, 1) => format!("one stretch, in {runs} of {all} runs"),
        (Language::En, _) => format!("{spans} stretches, in {runs} of {all} runs"),
        (Language::Zh, _) => format!("{all}次运行中的{runs}次，共{spans}段"),
    }
}

fn describe_onset(data: &Data<'_>, onset: &OnsetInterval) -> String {
    let at = data.format_moment(&onset.run, onset.time_s);
    let [low, high] = [onset.low_s, onset.high_s].map(|time_s| {
        data.format_clock_time(time_s).unwrap_or_else(|| with_unit(&format_fixed(time_s, data.time_decimals()), "s"))
    });
    match data.tongue.0 {
        Language::En => format!("since {at} (95\u{202f}% between {low} and {high})"),
        Language::Zh => format!("自{at}起（95\u{202f}%区间{low}至{high}）"),
    }
}
