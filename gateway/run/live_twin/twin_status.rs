//! The twin in the status document: differences that stand, what is compared, what was found.

use super::{Twin, alarm_code};
use gateway_diagnosis::status::{DiagnosisStatus, RegimeStatus, TwinStatus};
use gateway_diagnosis::words;
use gateway_diagnosis::worker::Finished;
use gateway_status::AlarmStatus;
use rules::twin::live::{self, ComparedSecond, Live, Mismatch, Regime, RegimeStage};

impl Twin {
    /// One alarm for each kind of work that differs from the model now.
    #[must_use]
    pub fn list_alarms(&self) -> Vec<AlarmStatus> {
        let alarm = |mismatch: &Mismatch| {
            let (text, zh) = words::describe_mismatch(mismatch, self.output_names(), self.output_unit());
            AlarmStatus {
                code: alarm_code(mismatch.regime),
                severity: "warning".to_owned(),
                text,
                zh,
                since_ms: mismatch.onset.map_or(0, |onset| to_milliseconds(onset.at_s)),
            }
        };
        self.list_mismatches().iter().map(alarm).collect()
    }

    fn build_mismatch_status(&self, mismatch: &Mismatch, none: RegimeStatus) -> RegimeStatus {
        let (text, zh) = words::describe_mismatch(mismatch, self.output_names(), self.output_unit());
        RegimeStatus {
            stage: "differing",
            difference: Some(mismatch.mean),
            difference_pct: mismatch.difference_percent(),
            since_ms: mismatch.onset.map(|onset| [onset.at_s, onset.low_s, onset.high_s].map(to_milliseconds)),
            text: Some(text),
            zh: Some(zh),
            ..none
        }
    }

    /// For the status document.
    #[must_use]
    pub fn build_status(&self) -> TwinStatus {
        let active = self.active.as_ref();
        let compared =
            active.map_or(ComparedSecond::from_reason(live::NoTwin::NotYet), |active| active.live.compared_second());
        let why = active.and_then(|active| active.live.failure_reason().map(str::to_owned));
        let reason = compared.residual.err();
        TwinStatus {
            model: active.map(|active| active.loaded.model.name.clone()).unwrap_or_default(),
            file: self.paths.model.display().to_string(),
            output: active.map(|active| active.loaded.model.output.clone()).unwrap_or_default(),
            unit: self.output_unit(),
            second_ms: active.and_then(|active| active.live.compared_at_ns()).map(|ns| ns.div_euclid(1_000_000)),
            // Of the same second, so that recorded less expected is the residual.
            twin_recorded: compared.expected.ok().zip(compared.residual.ok()).map(|(expected, rest)| expected + rest),
            twin_expected: compared.expected.ok(),
            twin_residual: compared.residual.ok(),
            missing: reason.map(live::NoTwin::as_word),
            why: reason.map(|reason| why.unwrap_or_else(|| reason.to_string())),
            regimes: active.map_or_else(Vec::new, |active| self.list_regimes(&active.live)),
            diagnosing_since_ms: self.begun_ns.filter(|_| self.diagnosing).map(|ns| ns.div_euclid(1_000_000)),
            diagnosis: self.finished.as_ref().map(|finished| self.build_diagnosis_status(finished)),
            problem: self.problem.clone(),
        }
    }

    fn list_regimes(&self, live: &Live) -> Vec<RegimeStatus> {
        let status = |(regime, stage): (Regime, RegimeStage)| {
            let none = RegimeStatus {
                regime: regime.as_word(),
                stage: "learning",
                learned: None,
                usual: None,
                difference: None,
                difference_pct: None,
                since_ms: None,
                text: None,
                zh: None,
            };
            match stage {
                RegimeStage::Learning(blocks, needed) => RegimeStatus { learned: Some((blocks, needed)), ..none },
                RegimeStage::Watching(usual) => RegimeStatus { stage: "watching", usual: Some(usual), ..none },
                RegimeStage::Differing(mismatch) => self.build_mismatch_status(&mismatch, none),
            }
        };
        live.list_stages().map(status).collect()
    }

    fn build_diagnosis_status(&self, finished: &Finished) -> DiagnosisStatus {
        let record = &finished.record;
        let accept = finished
            .improved
            .as_ref()
            .map_or(String::new(), |improved| format!("cp {} {}", improved.display(), self.paths.model.display()));
        DiagnosisStatus {
            at_ms: record.at_ns.div_euclid(1_000_000),
            from_ms: record.from_ns.div_euclid(1_000_000),
            to_ms: record.to_ns.div_euclid(1_000_000),
            verdict: record.verdict.clone(),
            summary: record.summary.clone(),
            missing: finished.missing.clone(),
            accept,
        }
    }
}

fn to_milliseconds(at_s: f64) -> i64 {
    words::to_nanoseconds(at_s).div_euclid(1_000_000)
}
