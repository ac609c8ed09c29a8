//! Results as text and as a script's settings.

use super::no_load::NoLoadLearned;
use crate::estimators::{SPEEDS_PER_STAGE, STAGES};
use std::fmt::{self, Write as _};

impl NoLoadLearned {
    /// The powers as settings that a script returns; the file can stand beside the other scripts as it is.
    #[must_use]
    pub fn script(&self) -> String {
        let mut text = String::from(
            "// No-load power by gear stage, identified from recordings: pairs of speed in rpm and power in W. 空载功率\n\nfn settings() {\n    #{\n",
        );
        for stage in 0..STAGES {
            let own: Vec<_> = self.speeds.iter().filter(|speed| speed.stage == stage).take(SPEEDS_PER_STAGE).collect();
            if own.is_empty() {
                continue;
            }
            let pairs: Vec<String> =
                own.iter().map(|speed| format!("[{:.1}, {:.1}]", speed.speed_rpm, speed.power_w)).collect();
            let _ = writeln!(text, "        no_load_stage_{stage}: [{}],", pairs.join(", "));
        }
        text + "    }\n}\n"
    }
}

impl fmt::Display for NoLoadLearned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "stage      rpm   no-load W      95 % interval W  visits  between W  settled s  drift W")?;
        for speed in &self.speeds {
            let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1}"));
            writeln!(
                f,
                "{:>5} {:>8.1} {:>11.1} {:>20} {:>7} {:>10} {:>10.0} {:>8}",
                speed.stage,
                speed.speed_rpm,
                speed.power_w,
                format!("{:.1} to {:.1}", speed.interval_w.0, speed.interval_w.1),
                speed.visits,
                number(speed.between_visits_w),
                speed.settled_s,
                number(speed.drift_w),
            )?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}
