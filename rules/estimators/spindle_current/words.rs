//! Feed curves as text and as a script.

use super::feed_curve::{CurveLearned, FeedCurves, Scatter};
use std::fmt::{self, Write as _};

impl FeedCurves {
    /// A script that holds the curves, infers the equivalent depth of cut and asks for the feed that gives the wanted
    /// feature; it asks only, the gate decides. One speed: that with the most curves.
    ///
    /// `None` where no speed has a usable family.
    #[must_use]
    pub fn script(&self) -> Option<String> {
        let usable = self.speeds_rpm().into_iter().filter_map(|speed| Some((speed, self.family(speed).ok()?)));
        let (speed_rpm, family) = usable.max_by_key(|(_, family)| family.curves().len())?;
        let mut rows = String::new();
        for it in family.curves() {
            let [c0, c1, c2, c3] = it.curve.coefficients;
            let (low, high) = (it.curve.feed_min, it.curve.feed_max);
            let _ = writeln!(
                rows,
                "    [{:.4}, {}, {}, {}, {}, {}, {}, {}],",
                it.depth_mm,
                float(low),
                float(high),
                float(c0),
                float(c1),
                float(c2),
                float(c3),
                float(it.sd)
            );
        }
        let levels = self.plateaus.iter().map(|plateau| plateau.level.mean);
        let wanted = levels.clone().sum::<f64>() / crate::statistics::count(levels.count().max(1));
        let (feed, feature) = (&self.feed, &self.feature);
        Some(format!(
            "// Constant load by {feature}: curves over {feed}, identified from recordings. 由主轴电流的恒负荷进给\n\
             // This only asks. The gate decides. 仅请求，由闸门决定\n\n\
             const EVERY_S = 0.5;\n\
             // The curves hold for this speed alone. 曲线适用的转速\n\
             const SPEED_RPM = {speed};\n\
             // What to aim at: here the mean of the recording; find the best by trial. 目标值\n\
             const WANTED = {wanted};\n\
             // Depth of cut in mm, least and greatest feed, c0 to c3, standard deviation of one cut. 曲线族\n\
             const CURVES = [\n{rows}];\n\
             // What to ask for at least and at most. 请求范围\n\
             const MIN_PCT = 60.0;\nconst MAX_PCT = 110.0;\n\n\
             let here = has(spindle_speed_rpm) && spindle_speed_rpm > 0.98 * SPEED_RPM && spindle_speed_rpm < 1.02 * SPEED_RPM;\n\
             if here && state == \"cutting\" && state_s >= 1.0 && has({feed}) && has({feature}) && has(feed_override_pct) {{\n    \
                 let depth_mm = {depth};\n    \
                 let feed = feed_curve_feed(CURVES, depth_mm, WANTED);\n    \
                 if has(feed) && {feed} > 0.0 {{\n        \
                     let pct = clamp(feed_override_pct * feed / {feed}, MIN_PCT, MAX_PCT);\n        \
                     request_feed_override(pct, \"constant load by current\");\n    \
                 }}\n}}\n",
            speed = float(speed_rpm),
            wanted = float(wanted),
            depth = if family.curves().len() > 1 {
                format!("feed_curve_depth_mm(CURVES, {feed}, {feature})")
            } else {
                float(family.curves()[0].depth_mm)
            },
        ))
    }
}

/// A number that a script reads as one, with a point in it and without an exponent.
fn float(value: f64) -> String {
    let text = format!("{value:.12}");
    let text = text.trim_end_matches('0');
    if text.ends_with('.') { format!("{text}0") } else { text.to_owned() }
}

impl fmt::Display for FeedCurves {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} over {}, {} cuts", self.feature, self.feed, self.plateaus.len())?;
        self.curves.iter().try_for_each(|curve| one(f, curve))?;
        self.refused.iter().try_for_each(|refusal| writeln!(f, "cannot tell: {refusal}"))?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

fn one(f: &mut fmt::Formatter<'_>, curve: &CurveLearned) -> fmt::Result {
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
