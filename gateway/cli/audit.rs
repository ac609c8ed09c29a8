//! `cnc-gateway history audit`: what the gate was asked for, let through and wrote, and whether the rows are as they were
//! written.

use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::history::{AuditCheck, AuditEntry, Reader, audit_document};
use crate::moment;
use clap::Args;
use serde_json::json;

/// Arguments of `history audit`.
#[derive(Debug, Args)]
pub(super) struct AuditArguments {
    /// Check the whole chain; exit code 1 when a row is not as it was written, with the number of the first.
    #[arg(long)]
    verify: bool,
    /// Beginning: 2026-01-31T08:15:00Z, 2026-01-31, or a time before the newest sample such as -10m, -8h, -7d.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    from: Option<String>,
    /// End (excluded), in the same notation.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    to: Option<String>,
    /// At most so many rows, the newest ones.
    #[arg(long, default_value_t = 1000)]
    limit: u32,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn answer_audit(arguments: &AuditArguments, reader: &Reader) -> CommandResult {
    if arguments.verify {
        let check = reader.verify_audit().map_err(CannotRun::from_error)?;
        show_check(&check, arguments.json);
        return Ok(if check.broken.is_none() { CommandOutcome::Fine } else { CommandOutcome::No });
    }
    let newest_ns = reader.read_present_span().map_err(CannotRun::from_error)?.map_or(0, |(_, newest_ns)| newest_ns);
    let moment = |text: &Option<String>, otherwise: i64| {
        let parsed = text.as_ref().map(|text| moment::parse(text, newest_ns)).transpose();
        parsed.map(|ns| ns.unwrap_or(otherwise)).map_err(CannotRun::from_error)
    };
    let (from_ns, to_ns) = (moment(&arguments.from, i64::MIN)?, moment(&arguments.to, i64::MAX)?);
    let rows = reader.read_audit(from_ns, to_ns, arguments.limit).map_err(CannotRun::from_error)?;
    match arguments.json {
        true => print_json(&audit_document(&rows)),
        false => rows.iter().for_each(|row| print_text(&format_row(row))),
    }
    Ok(CommandOutcome::Fine)
}

fn show_check(check: &AuditCheck, json: bool) {
    let AuditCheck { rows, first, last, head, removed, broken } = check;
    if json {
        return print_json(&json!({
            "schema": "audit-check/1", "intact": broken.is_none(), "rows": rows, "first": first, "last": last, "head": head,
            "removed": removed, "broken": broken,
        }));
    }
    if let Some(removed) = removed {
        let (at, because) = (moment::format_utc(removed.at_ns), &removed.because);
        print_text(&format!("rows 1 to {} are gone: removed, the last of them at {at} ({because})\n", removed.through));
    }
    match broken {
        None => print_text(&format!("intact: {rows} rows, numbers {first} to {last}, head {head}\n")),
        Some(broken) => print_text(&format!(
            "BROKEN at row {}: {}. The {rows} rows before it are as they were written.\n  \
             Keep a copy of the file, and find out who can write to it.\n",
            broken.number, broken.what
        )),
    }
}

/// A row for a reader.
fn format_row(row: &AuditEntry) -> String {
    let audit = &row.audit;
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.0}"));
    let values = match audit.unit.as_str() {
        "" => String::new(),
        unit => {
            format!(
                " from {} asked {} in force {} {unit}",
                number(audit.before),
                number(audit.asked),
                number(audit.after)
            )
        }
    };
    let who = [audit.person.as_str(), audit.script.as_str()].join(" ");
    let at = moment::format_utc(audit.at_ns);
    format!("{:>6} {at} {:<12} {:<10}{values} {} {}\n", row.number, audit.kind, audit.outcome, audit.reason, who.trim())
}
