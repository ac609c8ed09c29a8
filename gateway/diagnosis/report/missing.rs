//! What is missing: each effect with its law, its parameters and how sure they are.

use super::data::Data;
use super::table::{ColumnHead, render_table};
use super::text::{capitalise_first, format_percent};
use super::text::{decimal_exponent, escape_html, format_fixed, format_law, format_number, unit_text, with_unit};
use rules::physics::explain::Language;
use rules::twin::diagnosis::{Missing, ParameterEstimate};
use std::fmt::Write as _;

/// Share swallowed by the baseline above which the effect's whole size is uncertain.
const HIDDEN_SHARE: f64 = 0.95;

/// Error with the effect, as a share of the error without it, above which there is no gain to speak of.
const NO_GAIN: f64 = 0.995;

/// The section; empty where nothing is missing.
pub(super) fn render_section(data: &Data<'_>) -> String {
    let missing = &data.diagnosis.missing;
    if missing.is_empty() {
        return String::new();
    }
    let title = if missing.len() == 1 {
        data.pick_text("What is missing", "缺少什么")
    } else {
        data.pick_text("What is missing, most important first", "缺少什么（按重要性排列）")
    };
    let cards: String = missing.iter().map(|missing| render_card(data, missing)).collect();
    format!("<section><h2>{title}</h2>{cards}</section>\n")
}

fn render_card(data: &Data<'_>, missing: &Missing) -> String {
    let lane = data.diagnosis.mismatch.iter().position(|region| region.effect == missing.effect);
    let colour =
        lane.filter(|lane| *lane < super::strip::REGIONS_MAX).map_or("none".to_owned(), |lane| format!("e{lane}"));
    let mut html = format!(
        "<article class=\"effect {colour}\"><h3>{} <code>{}</code></h3><p>{}{}</p><div class=\"law\">{}</div>",
        capitalise_first(&data.tongue.name_effect(&missing.effect)),
        escape_html(&missing.effect),
        data.tongue.translate_catalogue(&missing.statement).trim_end_matches(['.', '。']),
        data.pick_text(".", "。"),
        format_law(&missing.equation)
    );
    html.push_str(&render_parameters(data, missing));
    html.push_str(&super::response::render_chart(data, &missing.effect));
    let _ = write!(
        html,
        "<dl class=\"facts\">{}{}{}</dl></article>",
        render_certainty(data, missing),
        render_gain(data, missing),
        render_absorption(data, missing)
    );
    html
}

fn render_parameters(data: &Data<'_>, missing: &Missing) -> String {
    if missing.parameters.is_empty() {
        let none = data.pick_text("The effect has no free parameter.", "该效应没有自由参数。");
        return format!("<p class=\"note\">{none}</p>");
    }
    let rows: String = missing.parameters.iter().map(|e| render_parameter(data, &missing.effect, e)).collect();
    let heads = [
        ColumnHead::Words(data.pick_text("parameter", "参数")),
        ColumnHead::Number(data.pick_text("value", "值")),
        ColumnHead::Number(data.pick_text("95\u{202f}% interval", "95\u{202f}%区间")),
        ColumnHead::Words(data.pick_text("unit", "单位")),
    ];
    render_table(&heads, &rows)
}

fn render_parameter(data: &Data<'_>, effect: &str, e: &ParameterEstimate) -> String {
    let [value, low, high] = format_estimate(e);
    let meaning = data.tongue.describe_parameter(effect, &e.name);
    let unit = unit_text(&e.unit);
    let unit = if unit.is_empty() { "\u{2013}".to_owned() } else { unit };
    let interval = match e.low.is_some() && e.high.is_some() {
        true => format!("{low} … {high}"),
        false => data.pick_text("not determined by this recording", "此记录无法确定").to_owned(),
    };
    let (class, about) = match meaning.is_empty() {
        true => ("", String::new()),
        false => (" class=\"told\"", format!("<tr class=\"about\"><td colspan=\"4\">{meaning}</td></tr>")),
    };
    format!(
        "<tr{class}><td><code>{}</code></td><td class=\"n\">{value}</td><td class=\"n\">{interval}</td><td>{unit}</td></tr>{about}",
        escape_html(&e.name)
    )
}

/// Value and interval with the same decimals: two significant digits of the interval's width.
fn format_estimate(e: &ParameterEstimate) -> [String; 3] {
    let (low, high) = (e.low.unwrap_or(f64::NEG_INFINITY), e.high.unwrap_or(f64::INFINITY));
    let numbers = [e.value, low, high];
    let width = 0.5 * (high - low);
    let greatest = numbers.iter().fold(0.0_f64, |top, x| top.max(x.abs()));
    if !width.is_finite() || width <= 0.0 || !(-3..6).contains(&decimal_exponent(greatest)) {
        return numbers.map(format_number);
    }
    let decimals = (1 - decimal_exponent(width)).clamp(0, 6);
    numbers.map(|x| format_fixed(x, decimals))
}

fn render_fact(name: &str, value: &str) -> String {
    format!("<div><dt>{name}</dt><dd>{value}</dd></div>")
}

fn render_certainty(data: &Data<'_>, missing: &Missing) -> String {
    let mut words: Vec<String> = Vec::new();
    if let Some(probability) = missing.probability {
        let shown = format_fixed(probability, 2);
        words.push(match data.tongue.0 {
            Language::En => {
                format!("The probability of this name is {shown}, averaged over resamples of the recording.")
            }
            Language::Zh => format!("该名称的概率为{shown}（对记录多次重采样取平均）。"),
        });
    }
    if let Some(information) = missing.delta_ic.map(format_number) {
        words.push(match data.tongue.0 {
            Language::En => format!("Without it the model loses {information} units of information."),
            Language::Zh => format!("去掉它，模型损失{information}个信息单位。"),
        });
    }
    if let Some(reason) = &missing.not_predictable {
        words.push(data.pick_text(&reason.en, &reason.zh).to_owned());
    }
    if words.is_empty() {
        return String::new();
    }
    render_fact(data.pick_text("How sure", "有多确定"), &words.join(data.pick_text(" ", "")))
}

fn render_gain(data: &Data<'_>, missing: &Missing) -> String {
    let unit = data.output_unit();
    let text = match (missing.held_out_rmse_before, missing.held_out_rmse_after, data.tongue.0) {
        (Some(before), Some(after), _) if after > NO_GAIN * before => format!(
            "{} ({}).",
            data.pick_text("On held-out runs it makes no difference to the error", "在留出的运行上，它不改变误差"),
            with_unit(&format_number(after), &unit)
        ),
        (Some(before), Some(after), Language::En) => format!(
            "On held-out runs the error is {} without this effect and {} with it.",
            with_unit(&format_number(before), &unit),
            with_unit(&format_number(after), &unit)
        ),
        (Some(before), Some(after), Language::Zh) => format!(
            "在留出的运行上，不含该效应时误差为{}，包含后为{}。",
            with_unit(&format_number(before), &unit),
            with_unit(&format_number(after), &unit)
        ),
        _ => data
            .pick_text(
                "Too few runs to hold one out, so there is no figure on fresh data.",
                "运行次数太少，无法留出，因此没有新数据上的数值。",
            )
            .to_owned(),
    };
    render_fact(data.pick_text("What it brings", "带来的改进"), &text)
}

fn render_absorption(data: &Data<'_>, missing: &Missing) -> String {
    let share = missing.absorbed_share.clamp(0.0, 1.0);
    let [swallowed, left] = [100.0 * share, 100.0 * (1.0 - share)].map(format_percent);
    let caution = data.pick_text(
        " How large the effect is as a whole therefore rests on very little; the gain in fit does not.",
        "因此其总体大小的依据很弱，但拟合的改进不受影响。",
    );
    let caution = if share > HIDDEN_SHARE { caution } else { "" };
    let text = match data.tongue.0 {
        Language::En => format!(
            "The fitted simulation had already imitated {swallowed} of this effect by bending its own parameters. Only the remaining {left} was visible as a difference.{caution}"
        ),
        Language::Zh => {
            format!("拟合后的仿真已通过扭曲自身参数模仿了该效应的{swallowed}，只有剩下的{left}表现为差异。{caution}")
        }
    };
    let bar = format!("<span class=\"share\"><i style=\"width:{:.1}%\"></i></span>", 100.0 * share);
    render_fact(data.pick_text("How hidden it was", "隐藏程度"), &(bar + text.as_str()))
}
