//! What was learned, for the reader.

use super::anova::{Anova, AnovaRow};
use super::fit_surface::SurfaceFit;
use super::identify::{DesignPoint, LearnedWear};
use super::physical::PhysicalFit;
use crate::regression::Refusal;
use std::fmt::{self, Write as _};

impl fmt::Display for LearnedWear {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} cuts\n\nresponse surface", self.cuts.len())?;
        f.write_str(&format_fit(&self.surface, format_surface))?;
        writeln!(f, "\nphysical form   P = P0 (vc/vc0)^x (f/f0)^y (ap/ap0)^z + W VB vc ap")?;
        f.write_str(&format_fit(&self.physical, format_physical))?;
        writeln!(
            f,
            "\non cuts that were left out, rms: {:>12} {:>12} {:>14}",
            "inside", "at the edge", "evidence BIC"
        )?;
        for form in &self.comparison.forms {
            let watts = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.1} W"));
            let (inside, outside) = (watts(form.inside_rms_w), watts(form.outside_rms_w));
            let bic = form.bic.map_or("-".to_owned(), |bic| format!("{bic:.1}"));
            writeln!(f, "  {:<30} {inside:>12} {outside:>12} {bic:>14}", form.form)?;
        }
        writeln!(f, "taken: {}\n\nlimit [Pc] at VB = {} mm", self.model.form(), self.criterion_mm)?;
        writeln!(
            f,
            "  {:>10} {:>9} {:>8} {:>16} {:>10} {:>14}",
            "vc m/min", "f mm/rev", "ap mm", "[Pc] W", "W/mm", "single VB mm"
        )?;
        self.places.iter().try_for_each(|place| writeln!(f, "{}", format_point(place)))
    }
}

fn format_fit<T>(fit: &Result<T, Refusal>, text: fn(&T) -> String) -> String {
    fit.as_ref().map_or_else(|refusal| format!("  cannot be fitted: {refusal}\n"), text)
}

fn format_point(place: &DesignPoint) -> String {
    let limit = &place.threshold;
    let half = limit.wear_half_interval_mm.map_or("-".to_owned(), |half| format!("± {half:.3}"));
    let power = format!("{:.0} ± {:.0}", limit.power_w, limit.interval_w.1 - limit.power_w);
    let outside = if limit.extrapolated.is_empty() {
        String::new()
    } else {
        format!("  outside: {}", limit.extrapolated.join(", "))
    };
    format!(
        "  {:>10.1} {:>9.4} {:>8.3} {power:>16} {:>10.0} {half:>14}  {}{outside}",
        place.cutting_speed_m_min,
        place.feed_per_rev_mm,
        place.depth_of_cut_mm,
        limit.slope_w_per_mm,
        describe_observability(limit)
    )
}

/// Where, or over how many parts, the wear can be seen.
fn describe_observability(limit: &super::PowerLimit) -> String {
    match limit.parts_to_observe {
        Some(parts) if parts > 1 => format!("observable over {parts} parts"),
        _ => limit.observability.as_word().to_owned(),
    }
}

fn format_surface(fit: &SurfaceFit) -> String {
    let coding = &fit.surface.coding;
    let mut text = format!("  {}\n  coded:", fit.surface.format_formula());
    for (factor, (centre, half)) in super::FACTORS.iter().zip(coding.centre.iter().zip(&coding.half)) {
        let _written = match *half > 0.0 {
            true => write!(text, " {} = ({} - {centre:.4})/{half:.4}", factor.letter, factor.symbol),
            false => write!(text, " {} held at {centre:.4}", factor.symbol),
        };
    }
    let _written = writeln!(
        text,
        "\n  residual sd {:.1} W, {} degrees of freedom",
        fit.regression.residual_sd, fit.regression.degrees_of_freedom
    );
    text.push_str(&format_anova(&fit.anova));
    let dropped: Vec<String> = fit.dropped.iter().map(|it| format!("{} (p {:.2})", it.term, it.p)).collect();
    if !dropped.is_empty() {
        let _written = writeln!(text, "  dropped: {}", dropped.join(", "));
    }
    text
}

fn format_anova(anova: &Anova) -> String {
    let mut text = format!(
        "  {:<12} {:>14} {:>5} {:>14} {:>9} {:>9}\n",
        "source", "sum of squares", "df", "mean square", "F", "p"
    );
    for AnovaRow { source, sum_of_squares, degrees_of_freedom, mean_square, f, p } in &anova.sources {
        let f = f.map_or(String::new(), |f| format!("{f:.2}"));
        let p = p.map_or(String::new(), |p| if p < 1e-4 { "<0.0001".to_owned() } else { format!("{p:.4}") });
        let _written = writeln!(
            text,
            "  {source:<12} {sum_of_squares:>14.0} {degrees_of_freedom:>5} {mean_square:>14.0} {f:>9} {p:>9}"
        );
    }
    text.push_str(&format_r_squared(anova.r2, anova.adjusted_r2, anova.predicted_r2));
    text
}

fn format_r_squared(r2: f64, adjusted: f64, predicted: Option<f64>) -> String {
    let predicted = predicted.map_or("not known".to_owned(), |share| format!("{:.2} %", 100.0 * share));
    format!("  R2 {:.2} %, adjusted {:.2} %, predicted {predicted}\n", 100.0 * r2, 100.0 * adjusted)
}

fn format_physical(fit: &PhysicalFit) -> String {
    let [speed, feed, depth] = fit.physical.reference;
    let mut text = format!("  vc0 = {speed:.2} m/min, f0 = {feed:.4} mm/rev, ap0 = {depth:.4} mm\n");
    for one in &fit.coefficients {
        let _written =
            writeln!(text, "  {:<20} {:>12.4} ± {:.4}", one.name, one.value, 0.5 * (one.interval.1 - one.interval.0));
    }
    let short: Vec<String> = fit.physical.to_short_form().iter().map(|number| format!("{number:.6}")).collect();
    let _written = writeln!(text, "  for scripts: const WEAR = [{}];", short.join(", "));
    let sd = fit.physical.residual_sd_w;
    let _written = writeln!(text, "  residual sd {sd:.1} W, {} degrees of freedom", fit.physical.degrees_of_freedom);
    text.push_str(&format_r_squared(fit.r2, fit.adjusted_r2, fit.predicted_r2));
    text
}
