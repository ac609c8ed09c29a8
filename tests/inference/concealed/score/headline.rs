//! The few figures that decide, with their counts.

use crate::concealed::least_squares::quantile;
use crate::concealed::score::outcome::Outcome;
use crate::concealed::score::tally::{Tally, by_group};

/// One set of outcomes under a name.
fn select(outcomes: &[Outcome], wanted: impl Fn(&str) -> bool) -> Vec<&Outcome> {
    outcomes.iter().filter(|o| wanted(&o.group)).collect()
}

/// Share with its count and the bounds between which it lies with 95 % (Wilson).
fn share(part: usize, of: usize) -> String {
    if of == 0 {
        return "none tried".into();
    }
    let (n, p, z) = (of as f64, part as f64 / of as f64, 1.96_f64);
    let middle = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 100.0 / (1.0 + z * z / n);
    format!("{:.1} % ({part}/{of}; {:.0} to {:.0})", 100.0 * p, scale * (middle - half), scale * (middle + half))
}

fn counted(outcomes: &[&Outcome], test: impl Fn(&Outcome) -> bool) -> String {
    share(Tally(outcomes).count(test), outcomes.len())
}

/// The table of aims and what was reached.
pub(crate) fn table(outcomes: &[Outcome]) -> String {
    let mut lines = vec!["| figure | aim | reached |".to_string(), "|---|---|---|".to_string()];
    let mut line = |figure: &str, aim: &str, reached: String| lines.push(format!("| {figure} | {aim} | {reached} |"));
    let single = |g: &str| (g.starts_with("single") || g.starts_with("faulty")) && !g.ends_with("rho0.25");
    let linear = |g: &str| g.starts_with("drive-rho") || g.starts_with("thermal-rho");
    let named = |o: &Outcome| o.named && o.gave_names;
    let singles = select(outcomes, single);
    line("named, single effect, rho >= 0.5, spindle power", ">= 97 %", counted(&singles, named));
    line("named, single effect, drives and thermal error", ">= 97 %", counted(&select(outcomes, linear), named));
    line(
        "named, single effect, rho 0.25",
        "",
        counted(&select(outcomes, |g| g.starts_with("single") && g.ends_with("rho0.25")), named),
    );
    let pairs = select(outcomes, |g| g.starts_with("pair") || g.starts_with("opposite") || g == "drive-pair");
    line("two at once, both named", ">= 95 %", counted(&pairs, named));
    line(
        "three at once, all named",
        "",
        counted(&select(outcomes, |g| g.contains("triple") && !g.starts_with("alike")), named),
    );
    for (group, of_noise) in by_group(outcomes).iter().filter(|(g, _)| g.starts_with("nothing")) {
        line(&format!("false reports, {group}"), "<= 2 %", counted(of_noise, |o| o.reported));
    }
    let unlisted = select(outcomes, |g| g.starts_with("unlisted"));
    line("unlisted physics: one sure name", "<= 5 %", counted(&unlisted, |o| o.certain));
    line("unlisted physics: unknown", "", counted(&unlisted, |o| o.right));
    line("unlisted physics: silent", "", counted(&unlisted, |o| !o.reported));
    let removed = Tally(&singles).values(|o| o.removed);
    line("removable held-out error removed, single, rho >= 0.5", "median >= 0.97", spread(&removed));
    let naming =
        select(outcomes, |g| !g.starts_with("nothing") && !g.contains("unlisted") && !g.starts_with("injected"));
    let naming: Vec<&Outcome> = naming.into_iter().filter(|o| o.gave_names).collect();
    line("class contains the truth when names are given", ">= 99 %", counted(&naming, |o| o.in_class));
    line("one sure name and wrong, listed effects", "", counted(&naming, |o| o.certain && !o.named));
    let alike = select(outcomes, |g| g.starts_with("alike") || g == "absorbed");
    line("not to be told apart: class with the truth, or silent", "", counted(&alike, |o| o.right));
    let held = outcomes.iter().fold((0, 0), |sum, o| (sum.0 + o.covered.0, sum.1 + o.covered.1));
    line("95 % intervals that hold the true value", "90 to 98 %", share(held.0, held.1));
    line(
        "area under the curve, 20 % most affected rows, single",
        ">= 0.95",
        spread(&Tally(&singles).values(|o| o.auc_orthogonal)),
    );
    let ordinary = select(outcomes, |g| !g.starts_with("injected"));
    let seconds = Tally(&ordinary).values(|o| Some(o.seconds));
    line(
        "seconds per recording of about 2,000 rows",
        "<= 0.1",
        format!("median {:.2}, greatest {:.2}", quantile(&seconds, 0.5), quantile(&seconds, 1.0)),
    );
    line("failed or against the contract", "0", counted(&select(outcomes, |_| true), |o| o.broken));
    lines.join("\n") + "\n"
}

fn spread(values: &[f64]) -> String {
    if values.is_empty() {
        return "none".into();
    }
    format!("median {:.3}, lower quarter {:.3} (n {})", quantile(values, 0.5), quantile(values, 0.25), values.len())
}
