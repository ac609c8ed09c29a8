//! `[http]`: what is served, and what a page that other computers reach must have.

use super::{find_flag, find_seconds, find_text};
use crate::HttpConfig;
use crate::read::{ConfigInput, Origin};
use std::net::SocketAddr;
use std::path::Path;

const SECTION: &str = "http";

pub(super) fn build_http(reading: &ConfigInput<'_>, base: &Path) -> Option<HttpConfig> {
    let file = |key| find_text(reading, SECTION, key).map(|path| base.join(path));
    Some(HttpConfig {
        listen: find_text(reading, SECTION, "listen")?,
        enabled: find_flag(reading, SECTION, "enabled")?,
        tls: find_flag(reading, SECTION, "tls")?,
        certificate: file("certificate").zip(file("key")),
        tokens_always: find_text(reading, SECTION, "tokens")? == "always",
        session: find_seconds(reading, SECTION, "session_s")?,
        allow_hosts: parse_hosts(&find_text(reading, SECTION, "allow_hosts").unwrap_or_default()),
        allow_arming: find_flag(reading, SECTION, "allow_arming")?,
        shifts: parse_shifts(&find_text(reading, SECTION, "shifts")?).unwrap_or_default(),
    })
}

/// Names with blanks or commas between them, in lower case.
fn parse_hosts(text: &str) -> Vec<String> {
    text.split([' ', ',']).filter(|word| !word.is_empty()).map(str::to_lowercase).collect()
}

/// Shifts of one day.
const SHIFTS_MAX: usize = 12;

/// Times of day with blanks or commas between them, as minutes after midnight in increasing order. `None`: one of them is none, there
/// are none, or more than twelve.
fn parse_shifts(text: &str) -> Option<Vec<i64>> {
    let words = text.split([' ', ',']).filter(|word| !word.is_empty());
    let mut starts: Vec<i64> = words.map(gateway_base::moment::time_of_day).collect::<Option<_>>()?;
    starts.sort_unstable();
    starts.dedup();
    (1..=SHIFTS_MAX).contains(&starts.len()).then_some(starts)
}

fn check_shifts(reading: &mut ConfigInput<'_>) {
    let Some(written) = find_text(reading, SECTION, "shifts").filter(|written| parse_shifts(written).is_none()) else {
        return;
    };
    let at = find_origin(reading, "shifts");
    reading.add_problem(
        &at,
        format!("`shifts` is {written:?}, which are no times of day"),
        "write 1 to 12 of them: \"6:00 14:00 22:00\"",
    );
}

/// Can only this box reach the address?
#[must_use]
pub(super) fn is_loopback_only(listen: &str) -> bool {
    match listen.parse::<SocketAddr>() {
        Ok(address) => address.ip().is_loopback(),
        Err(_) => listen.rsplit_once(':').is_some_and(|(host, _)| host.eq_ignore_ascii_case("localhost")),
    }
}

pub(super) fn check_http(reading: &mut ConfigInput<'_>) {
    check_files(reading);
    check_hosts(reading);
    check_shifts(reading);
    check_reach(reading);
}

fn find_origin(reading: &ConfigInput<'_>, key: &str) -> Origin {
    reading.get(SECTION, key).map_or(Origin::Default, |found| found.origin.clone())
}

/// Certificate and key belong together.
fn check_files(reading: &mut ConfigInput<'_>) {
    let tls = find_flag(reading, SECTION, "tls").unwrap_or(false);
    for (one, other) in [("certificate", "key"), ("key", "certificate")] {
        if find_text(reading, SECTION, one).is_none() {
            continue;
        }
        let at = find_origin(reading, one);
        if find_text(reading, SECTION, other).is_none() {
            let next = format!("write {other} = \"...\" too, or leave both out: a certificate is made then");
            reading.add_problem(&at, format!("`{one}` is there without `{other}`"), next);
        } else if !tls && one == "certificate" {
            reading.add_problem(&at, "`certificate` is there, but `tls` is false", "write tls = true, or leave it out");
        }
    }
}

fn check_hosts(reading: &mut ConfigInput<'_>) {
    let named = |host: &String| {
        !host.is_empty()
            && host.len() <= 253
            && host.chars().all(|sign| sign.is_ascii_alphanumeric() || "-.".contains(sign))
    };
    let wrong = parse_hosts(&find_text(reading, SECTION, "allow_hosts").unwrap_or_default())
        .into_iter()
        .find(|host| !named(host));
    if let Some(wrong) = wrong {
        let at = find_origin(reading, "allow_hosts");
        let next = "write names alone, without https:// and without a port: \"gateway.local cnc7\"";
        reading.add_problem(&at, format!("`allow_hosts` holds {wrong:?}, which is no name of a computer"), next);
    }
}

/// What other computers reach is encrypted and asks who is there.
fn check_reach(reading: &mut ConfigInput<'_>) {
    let Some(listen) = find_text(reading, SECTION, "listen") else { return };
    let enabled = find_flag(reading, SECTION, "enabled").unwrap_or(true);
    let safe = find_flag(reading, SECTION, "tls") == Some(true)
        && find_text(reading, SECTION, "tokens").as_deref() == Some("always");
    if enabled && !is_loopback_only(&listen) && !safe {
        let at = find_origin(reading, "listen");
        let what = format!("`listen` is {listen:?}, which other computers can reach: that needs TLS and tokens");
        let next = "write tls = true and tokens = \"always\" under [http], or listen on 127.0.0.1";
        reading.add_problem(&at, what, next);
    }
}

#[cfg(test)]
mod tests {
    use super::{is_loopback_only, parse_shifts};

    #[test]
    fn shifts_are_times_of_day() {
        assert_eq!(parse_shifts("14:00, 6:30"), Some(vec![390, 840]));
        for wrong in ["", "25:00", "6:61", "six", "0 1 2 3 4 5 6 7 8 9 10 11 12"] {
            assert_eq!(parse_shifts(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn only_loopback_is_this_box_alone() {
        for listen in ["127.0.0.1:8080", "127.3.2.1:1", "[::1]:80", "localhost:8080"] {
            assert!(is_loopback_only(listen), "{listen}");
        }
        for listen in ["0.0.0.0:8080", "[::]:80", "192.168.1.5:80", "cnc7:80", "127.0.0.1.evil.com:80"] {
            assert!(!is_loopback_only(listen), "{listen}");
        }
    }
}
