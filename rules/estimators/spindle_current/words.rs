//! Feed curves as text and as a script.

use super::family::CurveFamily;
use super::feed_curve::{CurveLearned, FeedCurves, Scatter};
use super::plateaus::SAME;
use crate::format_script_number;
use std::fmt::{self, Write as _};

/// The script that holds the curves: one law for all of them, and for none.
const LAW: &str = include_str!("../../scripts/constant_load.rhai");
/// How the curves begin in it.
const CURVES: &str = "const CURVES = ";

impl FeedCurves {
    /// The shipped script of constant load with these curves in it, and with the quantity, unit, speed, tool and material that
    /// they hold for; it asks only, the gate decides. One speed: that with the most curves. `target`: what it holds, in the
    /// unit of the feature; without one the mean of the recording.
    ///
    /// `None` where no speed has a usable family.
    #[must_use]
    pub fn format_script(&self, target: Option<f64>) -> Option<String> {
        let usable = self.speeds_rpm().into_iter().filter_map(|speed| Some((speed, self.build_family(speed).ok()?)));
        let (speed_rpm, family) = usable.max_by_key(|(_, family)| family.curves().len())?;
        let begin = LAW.find(CURVES)?;
        let end = begin + LAW[begin..].find(";\n")?;
        let text = format!("{}{CURVES}{}{}", &LAW[..begin], self.map(speed_rpm, &family), &LAW[end..]);
        Some(self.with_target(&text, target))
    }

    /// The curves of a speed as the map that the script holds.
    #[must_use]
    pub fn map(&self, speed_rpm: f64, family: &CurveFamily) -> String {
        let mut rows = String::new();
        for it in family.curves() {
            let [c0, c1, c2, c3] = it.curve.coefficients;
            let numbers =
                [it.depth_mm, it.curve.feed_min, it.curve.feed_max, c0, c1, c2, c3, it.sd].map(format_script_number);
            let _infallible = writeln!(rows, "    [{}],", numbers.join(", "));
        }
        let near = |plateau: &&super::plateaus::Plateau| (plateau.speed_rpm / speed_rpm - 1.0).abs() <= SAME;
        let mut tools: Vec<&str> = self.plateaus.iter().filter(near).filter_map(|it| it.tool.as_deref()).collect();
        tools.sort_unstable();
        tools.dedup();
        let tool = if let [tool] = tools[..] { tool } else { "" };
        let material = self.material.as_deref().unwrap_or("");
        format!(
            "#{{ quantity: {:?}, unit: {:?}, feed: {:?}, speed_rpm: {}, tool: {tool:?}, material: {material:?}, rows: [\n{rows}] }}",
            self.feature,
            unit_of_column(&self.feature),
            self.feed,
            format_script_number(speed_rpm),
        )
    }

    /// What the script holds where nobody says: the mean of the recorded cuts, in the unit of the feature.
    #[must_use]
    pub fn mean_level(&self) -> f64 {
        let levels = self.plateaus.iter().map(|plateau| plateau.level.mean);
        levels.clone().sum::<f64>() / numerics::statistics::count_to_f64(levels.count().max(1))
    }

    /// What the script holds, and who chose it.
    #[must_use]
    pub fn target_text(&self, target: Option<f64>) -> String {
        let unit = unit_of_column(&self.feature);
        match target {
            Some(target) => format!("target of the script: {target} {unit}, as given\n"),
            None => format!(
                "target of the script: {:.1} {unit}, the mean of these cuts; what this machine and this tool should hold is \
                 for a person to say: --target {:.1}\n",
                self.mean_level(),
                self.mean_level()
            ),
        }
    }

    /// A target as the default of the setting in the unit of the curves.
    fn with_target(&self, text: &str, target: Option<f64>) -> String {
        let wanted = self.mean_level();
        let setting = match unit_of_column(&self.feature) {
            "W" => "target_w",
            "A" => "target_a",
            _ => "target_load_pct",
        };
        // One that was given stands as it was given; the mean of the recording is rounded, as it is told.
        let written = target.unwrap_or_else(|| (10.0 * wanted.max(0.1)).round() / 10.0);
        let call = format!("setting(\"{setting}\", ");
        let Some((before, rest)) = text.split_once(&call) else { return text.to_owned() };
        let Some((_default, after)) = rest.split_once(',') else { return text.to_owned() };
        format!("{before}{call}{},{after}", format_script_number(written))
    }
}

/// The unit at the end of a column's name.
fn unit_of_column(column: &str) -> &'static str {
    match column.rsplit('_').next() {
        Some("w") => "W",
        Some("a") => "A",
        Some("pct") => "%",
        _ => "1",
    }
}

impl fmt::Display for FeedCurves {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} over {}, {} cuts", self.feature, self.feed, self.plateaus.len())?;
        self.curves.iter().try_for_each(|curve| write_curve(f, curve))?;
        self.refused.iter().try_for_each(|refusal| writeln!(f, "cannot tell: {refusal}"))?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

fn write_curve(f: &mut fmt::Formatter<'_>, curve: &CurveLearned) -> fmt::Result {
    writeln!(
        f,
        "{:.0} rpm, depth {:.3} mm: degree {}, {} cuts at {} feeds from {:.4} to {:.4}, residual {:.4}{}, R2 {:.4}, predicted {}",
        curve.speed_rpm,
        curve.depth_mm,
        curve.degree,
        curve.plateaus,
        curve.feeds,
        curve.curve.feed_min,
        curve.curve.feed_max,
        curve.residual_sd,
        if curve.scatter == Scatter::Proportional { " of the feature" } else { "" },
        curve.r2,
        curve.predicted_r2.map_or_else(|| "-".to_owned(), |r2| format!("{r2:.4}")),
    )?;
    for c in &curve.coefficients {
        writeln!(f, "  {} = {:.6e}   95 % {:.6e} to {:.6e}", c.name, c.value, c.interval.0, c.interval.1)?;
    }
    let rises = if curve.rises { "rises throughout" } else { "does not rise throughout: no feed can be told from it" };
    write!(f, "  {rises}")?;
    match curve.lack_of_fit_p {
        Some(p) if p < 0.05 => writeln!(f, "; misses the repeated feeds by more than their scatter (p = {p:.3})"),
        _ => writeln!(f),
    }
}
