//! The text of a mail. Pure.

use super::MailTarget;
use crate::alarms::AlarmMessage;
use crate::nats::format_message_id;
use adapter_core::clock::TimeNs;
use gateway_base::moment;
use gateway_history::Outbox;
use lettre::Message;
use lettre::message::header::{ContentType, HeaderName, HeaderValue};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Characters of a subject; what is longer stands in the text only.
const SUBJECT_CHARACTERS_MAX: usize = 120;

/// The mail of an alarm as it goes over the line. `now_ns` is the date of the mail.
///
/// # Errors
/// What cannot be written as a mail.
pub(super) fn build_mail(
    target: &MailTarget,
    outbox: &Outbox,
    message: AlarmMessage<'_>,
    now_ns: TimeNs,
) -> Result<Vec<u8>, lettre::error::Error> {
    let id = format_message_id(&outbox.box_id(), message.item);
    let date = UNIX_EPOCH + Duration::from_nanos(u64::try_from(now_ns).unwrap_or_default());
    let builder = target.to.iter().fold(Message::builder().from(target.from.clone()), |built, to| built.to(to.clone()));
    let mail = builder
        .date(date.max(SystemTime::UNIX_EPOCH))
        .subject(format_subject(outbox.machine(), message))
        .message_id(Some(format!("<{id}@cnc-gateway>")))
        .raw_header(header("Auto-Submitted", "auto-generated"))
        .header(ContentType::TEXT_PLAIN)
        .body(format_body(outbox, message, &id))?;
    Ok(mail.formatted())
}

fn header(name: &'static str, value: &str) -> HeaderValue {
    HeaderValue::new(HeaderName::new_from_ascii_str(name), value.to_owned())
}

/// `[critical] lathe 1: the tool is worn`
fn format_subject(machine: &str, AlarmMessage { alarm, .. }: AlarmMessage<'_>) -> String {
    let text = [&alarm.en, &alarm.zh, &alarm.code].into_iter().find(|text| !text.trim().is_empty());
    let whole = on_one_line(&format!("[{}] {machine}: {}", alarm.severity, text.map_or("", String::as_str)));
    match whole.char_indices().nth(SUBJECT_CHARACTERS_MAX) {
        Some((end, _)) => format!("{}...", &whole[..end]),
        None => whole,
    }
}

fn format_body(outbox: &Outbox, AlarmMessage { item, alarm, historical }: AlarmMessage<'_>, id: &str) -> String {
    let mut lines = vec![on_one_line(&alarm.en)];
    if alarm.zh != alarm.en {
        lines.push(on_one_line(&alarm.zh));
    }
    lines.push(String::new());
    let began = moment::format_utc(item.at_ns);
    let path = outbox.path().map(|path| ("path", path.format_topic()));
    let fields = [
        ("severity", alarm.severity.clone()),
        ("code", alarm.code.clone()),
        ("source", alarm.source.clone()),
        ("began", began),
        ("box", outbox.box_id()),
        ("item", id.to_owned()),
    ];
    let fields = [("machine", outbox.machine().to_owned())].into_iter().chain(path).chain(fields);
    lines.extend(fields.map(|(name, value)| format!("{name}: {}", on_one_line(&value))));
    if historical {
        lines.extend([
            String::new(),
            "This alarm has waited: when it began there was no line to the mail server, or the hours were quiet."
                .to_owned(),
            "此报警为延迟发送：报警发生时无法连接邮件服务器，或处于免打扰时段。".to_owned(),
        ]);
    }
    lines.push(String::new());
    lines.join("\r\n")
}

/// A line break of a device is no line of the mail.
fn on_one_line(text: &str) -> String {
    text.split(|character: char| character.is_control()).map(str::trim).collect::<Vec<_>>().join(" ").trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gateway_history::{Alarm, Content, Item, OutboxSettings, Record};

    fn lines_of(en: &str, zh: &str, historical: bool) -> String {
        let outbox = Outbox::new("lathe 1", OutboxSettings::default(), []);
        let alarm = Alarm {
            at_ns: 1_700_000_000_000_000_000,
            code: "SV0401".to_owned(),
            source: "controller".to_owned(),
            severity: "critical".to_owned(),
            en: en.to_owned(),
            zh: zh.to_owned(),
        };
        let content = Content::Record(Box::new(Record::Alarm(alarm.clone())));
        let item = Item { sequence: 12, epoch: 0x1f, at_ns: alarm.at_ns, redated_ns: 0, content };
        let address = "smtp://relay?from=Box%20<box@works.example>&to=a@works.example,b@works.example";
        let address: crate::SinkAddress = address.parse().expect("an address");
        let crate::SinkTarget::Mail(target) = address.target() else { panic!("a mail") };
        let message = AlarmMessage { item: &item, alarm: &alarm, historical };
        String::from_utf8(build_mail(target, &outbox, message, 1_700_000_100_000_000_000).expect("built"))
            .expect("ASCII")
    }

    #[test]
    fn a_mail_says_which_machine_what_and_when() {
        let mail = lines_of("the drive is too hot", "the drive is too hot", false);
        let (headers, body) = mail.split_once("\r\n\r\n").expect("a mail");
        for line in [
            "From: Box <box@works.example>",
            "To: a@works.example, b@works.example",
            "Subject: [critical] lathe 1: the drive is too hot",
            "Date: Tue, 14 Nov 2023 22:15:00 +0000",
            "Auto-Submitted: auto-generated",
        ] {
            assert!(headers.lines().any(|header| header == line), "{line}: {headers}");
        }
        assert!(headers.contains("-1f-12@cnc-gateway>"), "{headers}");
        for line in ["machine: lathe 1", "severity: critical", "code: SV0401", "began: 2023-11-14T22:13:20.000Z"] {
            assert!(body.lines().any(|written| written == line), "{line}: {body}");
        }
        assert!(!body.contains("has waited"), "{body}");
    }

    #[test]
    fn a_text_of_a_device_writes_no_header_and_no_line() {
        let mail = lines_of("hot\r\nBcc: thief@elsewhere.example\r\n\r\nbody\r\n.\r\nQUIT", "过热", true);
        assert!(mail.is_ascii(), "every server takes it");
        assert!(!mail.lines().any(|line| line.starts_with("Bcc:") || line == "."), "{mail}");
        let long = lines_of(&"x".repeat(700), "", false);
        assert!(long.lines().all(|line| line.len() <= 998), "no line is longer than a server takes (RFC 5322, 2.1.1)");
    }
}
