//! The answer at the top: what a machinist reads first.

use super::data::Data;
use super::text::{escape_html, format_number, with_unit};
use rules::physics::explain::Language;
use rules::twin::diagnosis::{Fits, Verdict};
use std::fmt::Write as _;

/// Every answer with its colour class and its short name.
const ANSWERS: [(Verdict, &str, &str, &str); 5] = [
    (Verdict::Explained, "named", "Named", "已确定"),
    (Verdict::Ambiguous, "alike", "Cannot be told apart", "尚不能区分"),
    (Verdict::Unexplained, "strange", "Real, but unknown", "真实但未知"),
    (Verdict::NoMismatch, "fine", "Nothing missing", "没有缺失"),
    (Verdict::CannotTell, "open", "Cannot tell", "无法判断"),
];

/// Class of the verdict, for colours.
pub(super) fn css_class(verdict: Verdict) -> &'static str {
    ANSWERS.iter().find(|(answer, ..)| *answer == verdict).map_or("open", |(_, class, ..)| class)
}

/// The whole top of the page.
pub(super) fn render_section(data: &Data<'_>) -> String {
    let verdict = data.diagnosis.verdict;
    let mut html = format!("<section class=\"verdict {}\">", css_class(verdict));
    html.push_str(&render_scale(data));
    let _ = write!(html, "<div class=\"answer\">{}<div><h1>{}</h1>", render_icon(verdict), format_headline(data));
    let _ = write!(html, "<p class=\"lead\">{}</p></div></div>", format_lead(data));
    if let Some(fit) = &data.diagnosis.fit {
        html.push_str(&render_tiles(data, fit));
    }
    html + next(data).as_str() + "</section>\n"
}

fn render_scale(data: &Data<'_>) -> String {
    let verdict = data.diagnosis.verdict;
    let pill = |(answer, _, en, zh): &(Verdict, &str, &str, &str)| {
        let here = if *answer == verdict { " aria-current=\"true\"" } else { "" };
        format!("<li{here}>{}</li>", data.pick_text(en, zh))
    };
    format!("<ol class=\"scale\">{}</ol>", ANSWERS.iter().map(pill).collect::<String>())
}

/// A sign that is told by its form, not by its colour alone.
fn render_icon(verdict: Verdict) -> String {
    let drawing = match verdict {
        Verdict::Explained => "<circle cx=\"32\" cy=\"32\" r=\"26\"/><path d=\"M20 33l9 9 16-19\"/>",
        Verdict::Ambiguous => "<circle cx=\"24\" cy=\"32\" r=\"17\"/><circle cx=\"40\" cy=\"32\" r=\"17\"/>",
        Verdict::Unexplained => {
            "<circle cx=\"32\" cy=\"32\" r=\"26\"/><path d=\"M25 26a7 7 0 1 1 10 6.4c-2 1-3 2.2-3 4.6M32 44v1\"/>"
        }
        Verdict::NoMismatch => "<circle cx=\"32\" cy=\"32\" r=\"26\"/><path d=\"M21 27h22M21 37h22\"/>",
        Verdict::CannotTell => {
            "<circle cx=\"32\" cy=\"32\" r=\"26\" stroke-dasharray=\"5 5.2\"/><path d=\"M22 32h.5M32 32h.5M42 32h.5\"/>"
        }
    };
    format!("<svg class=\"icon\" viewBox=\"0 0 64 64\" aria-hidden=\"true\">{drawing}</svg>")
}

fn format_headline(data: &Data<'_>) -> String {
    let tongue = data.tongue;
    let names: Vec<String> = data.diagnosis.missing.iter().map(|missing| tongue.name_effect(&missing.effect)).collect();
    let names = tongue.join_words(&names, (" and ", "和"));
    match (data.diagnosis.verdict, tongue.0) {
        (Verdict::Explained, Language::En) => format!("The simulation lacks {names}."),
        (Verdict::Explained, Language::Zh) => format!("仿真缺少：{names}。"),
        (Verdict::Ambiguous, Language::En) => {
            format!("The simulation most likely lacks {names}; this recording cannot rule out other causes.")
        }
        (Verdict::Ambiguous, Language::Zh) => format!("仿真很可能缺少：{names}，但此记录不足以排除其他原因。"),
        (Verdict::Unexplained, _) => tongue
            .pick_text(
                "Something real is missing, and no known effect explains it.",
                "确实缺少某种影响，但目录中没有任何效应能解释它。",
            )
            .to_owned(),
        (Verdict::NoMismatch, _) if !data.diagnosis.remainder.is_empty() => tongue
            .pick_text(
                "No known effect is missing, but what is left is not noise alone.",
                "没有缺少已知效应，但剩余部分不全是噪声。",
            )
            .to_owned(),
        (Verdict::NoMismatch, _) => tongue.pick_text("Recording and simulation agree.", "记录与仿真一致。").to_owned(),
        (Verdict::CannotTell, _) => {
            tongue.pick_text("This recording cannot answer the question.", "此记录无法回答该问题。").to_owned()
        }
    }
}

fn format_lead(data: &Data<'_>) -> String {
    let diagnosis = data.diagnosis;
    match diagnosis.verdict {
        Verdict::CannotTell => {
            let needed = data.pick_text(&diagnosis.summary.en, &diagnosis.summary.zh);
            super::text::capitalise_first(&escape_html(needed.strip_prefix("Cannot tell: ").unwrap_or(needed)))
        }
        Verdict::NoMismatch if !diagnosis.remainder.is_empty() => {
            escape_html(data.pick_text(&diagnosis.summary.en, &diagnosis.summary.zh))
        }
        Verdict::NoMismatch => data
            .pick_text(
                "Beyond the noise nothing is left that any effect could explain. What the fitted parameters of the model can imitate would not show either.",
                "除噪声外没有可由任何效应解释的残差。能被模型自身参数完全吸收的影响也不会显现。",
            )
            .to_owned(),
        _ => format!("{} {}", describe_place(data), describe_alternatives(data)).trim().to_owned(),
    }
}

/// What to do next, in one line; the whole stands below.
fn next(data: &Data<'_>) -> String {
    let Some(next) = &data.diagnosis.next_experiment else { return String::new() };
    let statement = data.tongue.translate_experiment(next);
    let minutes = with_unit(&format_number(next.minutes), "min");
    format!(
        "<p class=\"do-next\"><b>{}</b> {} ({} {minutes})</p>",
        data.pick_text("Do next:", "下一步："),
        statement.trim_end_matches(['.', '。']),
        data.pick_text("about", "约")
    )
}

/// Where the largest region lies, and since when.
fn describe_place(data: &Data<'_>) -> String {
    let Some(region) = data.diagnosis.mismatch.first() else { return String::new() };
    let tongue = data.tongue;
    let conditions: Vec<String> =
        region.conditions.iter().map(|condition| tongue.describe_condition(condition)).collect();
    let several = data.diagnosis.mismatch.len() > 1;
    let mainly = if several { "The largest part acts where " } else { "It acts where " };
    let place = match conditions.is_empty() {
        true => data.pick_text("It acts throughout the recording", "在整个记录中起作用").to_owned(),
        false => {
            let conditions = tongue.join_words(&conditions, (" and ", "且"));
            format!("{}{conditions}", data.pick_text(mainly, "主要作用于："))
        }
    };
    let since = region.onset.as_ref().map(|onset| match tongue.0 {
        Language::En => format!(", since {}", data.format_moment(&onset.run, onset.time_s)),
        Language::Zh => format!("，自{}起", data.format_moment(&onset.run, onset.time_s)),
    });
    let size = super::place::describe_amount(data, region);
    format!("{place}{}: {size}{}", since.unwrap_or_default(), data.pick_text(".", "。"))
}

fn describe_alternatives(data: &Data<'_>) -> String {
    let diagnosis = data.diagnosis;
    if diagnosis.alternatives.is_empty() || diagnosis.verdict != Verdict::Ambiguous {
        return String::new();
    }
    let mut names: Vec<String> = diagnosis
        .alternatives
        .iter()
        .filter(|it| !it.is_remote())
        .map(|it| data.tongue.name_effect(&it.effect))
        .collect();
    names.dedup();
    if names.is_empty() {
        names.push(data.tongue.name_effect("unknown"));
    }
    let names = data.tongue.join_words(&names, (" and ", "和"));
    match data.tongue.0 {
        Language::En => format!("Not ruled out: {names}. One short experiment tells them apart; it stands below."),
        Language::Zh => format!("尚未排除：{names}。下文给出可区分它们的简短试验。"),
    }
}

fn render_tiles(data: &Data<'_>, fit: &Fits) -> String {
    let unit = data.output_unit();
    let (before, after, held) = match (fit.before.held_out_rmse, fit.after.held_out_rmse) {
        (Some(before), Some(after)) => (before, after, true),
        _ => (fit.before.rmse, fit.after.rmse, false),
    };
    let error = match data.has_added_effects() {
        true => format!("{}<i>→</i>{} <small>{unit}</small>", format_number(before), format_number(after)),
        false => format!("{} <small>{unit}</small>", format_number(before)),
    };
    let named = match held {
        true => data.pick_text("error on runs that took no part in fitting", "未参与拟合的运行上的误差"),
        false => data.pick_text(
            "error on the fitted rows (too few runs to hold one out)",
            "拟合数据上的误差（运行太少，无法留出）",
        ),
    };
    let mut html = format!("<dl class=\"tiles\">{}", render_tile(&error, named));
    if let Some(ceiling) = fit.ceiling.filter(|_| data.has_added_effects()) {
        let error = if held { ceiling.held_out_rmse.unwrap_or(ceiling.rmse) } else { ceiling.rmse };
        html.push_str(&render_tile(
            &format!("{} <small>{unit}</small>", format_number(error)),
            data.pick_text("error of the free curve in its place", "自由曲线的误差"),
        ));
    }
    html.push_str(&render_tile(
        &format!("{} <small>{unit}</small>", format_number(fit.noise_floor)),
        data.pick_text("ordinary noise of this recording", "此记录的普通噪声"),
    ));
    if let Some(series) = &data.input.context.series {
        let value = format!(
            "{}<i>→</i>{} <small>{unit}</small>",
            format_number(series.as_given),
            format_number(series.refitted)
        );
        let gain = format_number(series.gain);
        let label = match data.tongue.0 {
            Language::En => format!(
                "error of your simulation: as given, and with gain {gain} and offset {}",
                with_unit(&format_number(series.offset), &unit)
            ),
            Language::Zh => {
                format!("您的仿真误差：给定值，以及乘以{gain}加{}之后", with_unit(&format_number(series.offset), &unit))
            }
        };
        html.push_str(&render_tile(&value, &label));
    }
    if data.has_added_effects() {
        html.push_str(&render_improvement(data, before, after, fit.noise_floor));
    }
    let rows = super::text::format_fixed(fit.rows as f64, 0);
    let basis = match data.tongue.0 {
        Language::En => format!("rows compared, in {} runs or stretches", fit.runs),
        Language::Zh => format!("行参与比较，共{}个运行或区段", fit.runs),
    };
    html + render_tile(&rows, &basis).as_str() + "</dl>"
}

fn render_improvement(data: &Data<'_>, before: f64, after: f64, floor: f64) -> String {
    let above = before - floor;
    let value = if above > 0.01 * floor {
        with_unit(&format!("{:.0}", (100.0 * (before - after) / above).clamp(0.0, 100.0)), "%")
    } else {
        data.pick_text("none to remove", "无可消除").to_owned()
    };
    render_tile(&value, data.pick_text("of the error above the noise removed", "高于噪声的误差被消除"))
}

fn render_tile(value: &str, label: &str) -> String {
    format!("<div><dt>{label}</dt><dd>{value}</dd></div>")
}
