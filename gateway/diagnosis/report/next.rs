//! What else it could be, what to record next, bent parameters, data quality, and how to read the page.

use super::data::Data;
use super::table::{ColumnHead, render_table_section};
use super::text::{escape_html, format_fixed, format_signed, unit_text, with_unit};
use rules::twin::diagnosis::{Alternative, Shift};
use rules::twin::quality::Fault;
use std::fmt::Write as _;

/// Other explanations, each with what separates it.
pub(super) fn render_alternatives(data: &Data<'_>) -> String {
    let others = &data.diagnosis.alternatives;
    if others.is_empty() {
        return String::new();
    }
    let rows: String = others.iter().map(|other| render_alternative(data, other)).collect();
    let note = data.pick_text(
        "This recording supports these nearly as well. The smaller the lead, the harder they are to tell apart; under 6 units it is no proof.",
        "此记录对下列解释的支持几乎相同。领先越小越难区分；不足6个单位不能作为证据。",
    );
    let heads = [
        ColumnHead::Words(data.pick_text("could also be", "也可能是")),
        ColumnHead::Words(data.pick_text("instead of", "而不是")),
        ColumnHead::Number(data.pick_text("lead of the best (units of information)", "最佳解释的领先（信息单位）")),
        ColumnHead::Words(data.pick_text("what tells them apart", "区分方法")),
    ];
    render_table_section(data.pick_text("What else it could be", "还可能是什么"), note, &heads, &rows)
}

fn render_alternative(data: &Data<'_>, other: &Alternative) -> String {
    let experiment = match other.separating_experiment.is_empty() {
        true => data.pick_text("no experiment is known", "尚无已知试验").to_owned(),
        false => data.tongue.translate_catalogue(&other.separating_experiment),
    };
    format!(
        "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td>{experiment}</td></tr>",
        data.tongue.name_effect(&other.effect),
        data.tongue.name_effect(&other.instead_of),
        format_fixed(other.delta_ic, 1)
    )
}

/// The experiment to do next.
pub(super) fn render_experiment(data: &Data<'_>) -> String {
    let Some(next) = &data.diagnosis.next_experiment else { return String::new() };
    let minutes = with_unit(&format_fixed(next.minutes, i32::from(next.minutes.fract() != 0.0)), "min");
    format!(
        "<section class=\"next\"><h2>{}</h2><p class=\"lead\">{}{}</p><p class=\"note\">{} {minutes}</p></section>\n",
        data.pick_text("What to record next", "下一步记录什么"),
        super::text::capitalise_first(data.tongue.translate_experiment(next).trim_end_matches(['.', '。'])),
        data.pick_text(".", "。"),
        data.pick_text("about", "约"),
    )
}

/// Parameters of the simulation that had been bent to imitate what was missing.
pub(super) fn render_shifts(data: &Data<'_>) -> String {
    let shifts = &data.diagnosis.baseline_shift;
    if shifts.is_empty() {
        return String::new();
    }
    let rows: String = shifts.iter().map(|shift| render_shift(data, shift)).collect();
    let note = data.pick_text(
        "While the effect was missing, fitting had bent these parameters of the simulation to imitate it.",
        "在缺少该效应时，拟合曾扭曲仿真的这些参数来模仿它。",
    );
    let heads = [
        ColumnHead::Words(data.pick_text("parameter", "参数")),
        ColumnHead::Number(data.pick_text("before", "之前")),
        ColumnHead::Number(data.pick_text("after", "之后")),
        ColumnHead::Number(data.pick_text("change", "变化")),
        ColumnHead::Words(data.pick_text("unit", "单位")),
    ];
    render_table_section(data.pick_text("Parameters that had been bent", "曾被扭曲的参数"), note, &heads, &rows)
}

fn render_shift(data: &Data<'_>, shift: &Shift) -> String {
    let relative = 100.0 * (shift.after / shift.before - 1.0);
    let change = match shift.before > 0.0 && shift.after > 0.0 && relative < 1000.0 {
        true => with_unit(&signed_whole(relative), "%"),
        false => format_signed(shift.after - shift.before),
    };
    let [before, after] = [shift.before, shift.after].map(|x| super::text::format_significant(x, 4));
    format!(
        "<tr><td><code>{}</code></td><td class=\"n\">{before}</td><td class=\"n\">{after}</td><td class=\"n\">{change}</td><td>{}</td></tr>",
        escape_html(&shift.parameter).replace('.', ".<wbr>"),
        unit_of(data, &shift.parameter)
    )
}

fn signed_whole(x: f64) -> String {
    let text = format_fixed(x, if x.abs() < 10.0 { 1 } else { 0 });
    if x > 0.0 { format!("+{text}") } else { text }
}

/// The unit of `part.parameter` in the model, escaped.
fn unit_of(data: &Data<'_>, name: &str) -> String {
    let unit = unit_text(&data.diagnosis.find_parameter_unit(name).unwrap_or_default());
    if unit.is_empty() { "\u{2013}".to_owned() } else { unit }
}

/// Faults of the recording.
pub(super) fn render_data_quality(data: &Data<'_>) -> String {
    let faults = &data.diagnosis.data_quality;
    let title = data.pick_text("The recording itself", "记录本身");
    if faults.is_empty() {
        let none = data.pick_text(
            "No dropouts, spikes, coarse steps or repeated times were found.",
            "未发现缺失、尖峰、粗量化或重复时间。",
        );
        return format!("<section><h2>{title}</h2><p class=\"note\">{none}</p></section>\n");
    }
    let rows: String = faults.iter().map(|fault| render_fault(data, fault)).collect();
    let note = data.pick_text(
        "These do not bias the comparison. Rows without a trustworthy value took no part in it.",
        "这些不会使比较产生偏差。没有可信数值的行未参与比较。",
    );
    let heads = [
        ColumnHead::Words(data.pick_text("what", "问题")),
        ColumnHead::Words(data.pick_text("column", "列")),
        ColumnHead::Number(data.pick_text("rows", "行数")),
    ];
    render_table_section(title, note, &heads, &rows)
}

fn render_fault(data: &Data<'_>, fault: &Fault) -> String {
    format!(
        "<tr><td>{}</td><td><code>{}</code></td><td class=\"n\">{}</td></tr>",
        escape_html(fault.kind.describe(data.tongue.0)),
        escape_html(&fault.column),
        format_fixed(fault.rows as f64, 0)
    )
}

/// Words an engineer may want explained.
pub(super) fn render_glossary(data: &Data<'_>) -> String {
    let words = [
        (
            ("Before and after", "之前与之后"),
            (
                "Before is the simulation with its own parameters fitted to this recording as well as they can be. After is the same simulation with the missing effect added and everything fitted together.",
                "“之前”是仅拟合自身参数的仿真；“之后”是加入缺失效应并共同拟合的仿真。",
            ),
        ),
        (
            ("Held out", "留出"),
            (
                "Runs that took no part in fitting, in choosing the effect, or in deciding when to stop. Their errors are what a fresh recording would show.",
                "未参与拟合、选择效应及停止判断的运行，其误差相当于新记录上的误差。",
            ),
        ),
        (
            ("Ordinary noise", "普通噪声"),
            (
                "Robust standard deviation of what remains after everything is fitted, edges and spikes left aside.",
                "全部拟合后剩余部分的稳健标准差，不计边沿和尖峰。",
            ),
        ),
        (
            ("Units of information", "信息单位"),
            (
                "Twice the gain in log-likelihood less a price for every parameter. Six units make one explanation twenty times as likely as another.",
                "对数似然增益的两倍减去每个参数的代价。6个单位表示一种解释的可能性是另一种的20倍。",
            ),
        ),
        (
            ("95\u{202f}% interval", "95\u{202f}%区间"),
            ("From the joint fit, with the noise's memory taken into account.", "来自共同拟合，已考虑噪声的相关性。"),
        ),
    ];
    let mut html = String::new();
    for (word, meaning) in words {
        let _ = write!(
            html,
            "<dt>{}</dt><dd>{}</dd>",
            data.pick_text(word.0, word.1),
            data.pick_text(meaning.0, meaning.1)
        );
    }
    format!(
        "<details><summary>{}</summary><dl>{html}</dl></details>\n",
        data.pick_text("How to read this page", "如何阅读本页")
    )
}
