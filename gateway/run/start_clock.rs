//! Before a run: which time it is, and which rows were dated wrongly.

use super::RunPlan;
use adapters::clock::Clock;
use gateway_base::clock::{self, Certain, ClockMark, ClockRules, Trust, format_span, of_box};
use gateway_base::log::{Notice, Severity};
use gateway_base::moment;
use gateway_history::{self as history, Reader, Redated};
use gateway_sources::open::MachineSpeed;
use std::path::Path;

/// By which clock a run begins, and what there is to tell about it.
pub(super) struct ClockStart {
    /// What the rows of the run are dated by.
    pub(super) mark: ClockMark,
    /// For the history, once it is open.
    pub(super) notices: Vec<Notice>,
}

impl ClockStart {
    /// Judges the clock for a run. `follows`: the wall clock has stood long enough to be followed.
    pub(super) fn judge_clock(plan: &RunPlan, follows: bool) -> Self {
        if plan.speed != MachineSpeed::Real {
            return Self { mark: ClockMark::from_stepped_time(), notices: Vec::new() };
        }
        let path = &plan.config.history.path;
        let row_ns = Reader::open(path).and_then(|reader| reader.certain_ns()).ok().flatten();
        let certain = Certain { at_least_ns: row_ns.unwrap_or(clock::MADE_NS).max(clock::MADE_NS) };
        let own = of_box();
        own.begin_run(ClockRules::new(plan.config.gateway.clock_confirm), certain, follows);
        let mark = own.current_mark();
        let mut news = Vec::new();
        if own.trust() == Trust::Unset {
            let text = format!(
                "the clock of the computer says what cannot be; the box goes on from the last certain time, {}, and corrects its \
                 rows when the clock is set",
                moment::format_utc(certain.at_least_ns)
            );
            news.push(Notice::new(Severity::Warning, "clock_unset", text));
        }
        match history::set_clock(path, &mark, follows.then(|| own.now_ns())) {
            Ok(redated) => news.extend(redated.map(|redated| describe_redating(&redated))),
            // Opening it comes next, and tells what is wrong with it.
            Err(error) => tracing::warn!("{}: rows were not dated anew: {error}", path.display()),
        }
        news.extend(find_future_rows(path));
        Self { mark, notices: news }
    }
}

fn describe_redating(redated: &Redated) -> Notice {
    let Redated { segments, samples, by_ns: (least, greatest), sent, moves } = redated;
    let by = if least == greatest {
        format!("{} {}", format_span(*least), if *least >= 0 { "later" } else { "earlier" })
    } else {
        format!("between {least} and {greatest} ns later")
    };
    let also = if sent.is_empty() {
        String::new()
    } else {
        format!("; items {} to {} may have been sent under their old dates", sent.start, sent.end - 1)
    };
    let text = format!("{samples} samples in {segments} segments, and what belongs to them, are dated {by} now{also}");
    let detail = serde_json::json!({
        "by_ns": [least, greatest], "from_sequence": sent.start, "to_sequence": sent.end, "moves": moves
    });
    Notice::new(Severity::Warning, "clock_redated", text).with_detail(detail.to_string())
}

/// Rows that say they come from the future.
fn find_future_rows(path: &Path) -> Option<Notice> {
    let future = Reader::open(path).and_then(|reader| reader.find_future_rows(clock::now_ns())).ok().flatten()?;
    let text =
        format!("the history holds {future}; `cnc-gateway history set-apart FILE` moves them into a file of their own");
    Some(Notice::new(Severity::Warning, "history_ahead", text))
}
