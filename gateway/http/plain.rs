//! For a browser without JavaScript: the state of the machine as a page of plain HTML, and the form to sign in by.

use super::ServerState;
use super::headers;
use super::peer::Peer;
use super::person::SignedIn;
use super::problem::ApiProblem;
use super::route::Route;
use super::vocabulary;
use adapters::ChannelId;
use adapters::channel::quantity::space_unit;
use axum::extract::{Extension, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use gateway_base::moment;
use gateway_status::{ChannelStatus, GateStatus, NumberOrWord, Status};
use rules::physics::explain::Language;
use serde::Deserialize;
use std::fmt::Write;
use std::time::Duration;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/plain", || get(serve_plain)),
    Route::for_file("/plain.css", || get(serve_style)),
    Route::for_file("/sign-in", || get(sign_in)),
];

const STYLE: &str = include_str!("../web/plain.css");
/// The page is fetched again after so many seconds.
const AGAIN_S: u32 = 5;
/// An older status is not shown as the present one.
const OLD: Duration = Duration::from_secs(2);

/// What is shown of the machine, as far as a source has it.
const SHOWN: [&str; 10] = [
    "program",
    "block",
    "tool",
    "part_count",
    "spindle_speed_rpm",
    "feed_mm_min",
    "feed_override_pct",
    "spindle_power_w",
    "total_power_w",
    "spindle_load_pct",
];

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct LanguageQuery {
    lang: String,
    next: String,
}

/// Is this a path of this box that a browser may be sent to?
pub(super) fn is_local_path(path: &str) -> bool {
    let (path, query) = path.split_once('?').unwrap_or((path, ""));
    let plain = |sign: char| sign.is_ascii_alphanumeric() || "/-_.".contains(sign);
    let of_query = |sign: char| plain(sign) || "=&%:+,~".contains(sign);
    path.starts_with('/')
        && !path.starts_with("//")
        && path.len() + query.len() <= 400
        && path.chars().all(plain)
        && query.chars().all(of_query)
}

/// Was the request made by a form, rather than by a script?
pub(super) fn wants_page(headers: &HeaderMap) -> bool {
    let accepts = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok());
    accepts.is_some_and(|kinds| kinds.contains("text/html"))
}

/// The language asked for, or that of the configuration, or that of the browser.
fn prefers_chinese(shared: &ServerState, asked: &str, headers: &HeaderMap) -> bool {
    let of_browser = || {
        let accepted = headers.get(header::ACCEPT_LANGUAGE).and_then(|value| value.to_str().ok());
        accepted.is_some_and(|languages| languages.trim_start().to_ascii_lowercase().starts_with("zh"))
    };
    match (asked, shared.language) {
        ("zh" | "zh-CN", _) => true,
        ("en", _) | (_, Some(Language::En)) => false,
        (_, Some(Language::Zh)) => true,
        (_, None) => of_browser(),
    }
}

async fn serve_style() -> Response {
    ([(header::CONTENT_TYPE, "text/css; charset=utf-8")], STYLE).into_response()
}

/// `GET /sign-in`: the form without scripts.
async fn sign_in(
    State(shared): State<ServerState>,
    Query(asked): Query<LanguageQuery>,
    headers: HeaderMap,
) -> Response {
    render_form(prefers_chinese(&shared, &asked.lang, &headers), &asked.next, "", "")
}

/// The form once more, with what was wrong.
pub(super) fn sign_in_again(shared: &ServerState, headers: &HeaderMap, next: &str, problem: &ApiProblem) -> Response {
    let status = StatusCode::from_u16(problem.status).unwrap_or(StatusCode::UNAUTHORIZED);
    let trouble = format!("{}. {}", problem.title, problem.hint);
    let zh = prefers_chinese(shared, "", headers);
    // Nobody is kept from giving the machine back.
    let back = if status == StatusCode::TOO_MANY_REQUESTS { give_back(zh) } else { String::new() };
    let mut answer = render_form(zh, next, &trouble, &back);
    *answer.status_mut() = status;
    answer
}

/// The form by which a person gives the machine back without signing in.
fn give_back(zh: bool) -> String {
    let say = |en: &'static str, cn: &'static str| if zh { cn } else { en };
    format!(
        "<h2>{back}</h2><p>{hint}</p><form method=\"post\" action=\"/api/v1/disarm\">\
         <label>{name}<input name=\"name\" autocomplete=\"username\" required></label>\
         <label>{token}<input name=\"token\" type=\"password\" autocomplete=\"current-password\" required></label>\
         <button class=\"stop\">{back}</button></form>",
        back = say("Back to the dial", "恢复面板倍率"),
        hint = say("This always works with the right token.", "令牌正确时始终有效。"),
        name = say("Name", "姓名"),
        token = say("Token", "令牌"),
    )
}

fn render_form(zh: bool, next: &str, trouble: &str, more: &str) -> Response {
    let say = |en: &'static str, cn: &'static str| if zh { cn } else { en };
    let next = escape_html(if is_local_path(next) { next } else { "/" });
    let trouble =
        if trouble.is_empty() { String::new() } else { format!("<p class=\"trouble\">{}</p>", escape_html(trouble)) };
    let body = format!(
        "<h1>{title}</h1>{trouble}<form method=\"post\" action=\"/api/v1/login\"><input type=\"hidden\" name=\"next\" value=\"{next}\">\
         <label>{name}<input name=\"name\" autocomplete=\"username\" required autofocus></label>\
         <label>{token}<input name=\"token\" type=\"password\" autocomplete=\"current-password\" required></label>\
         <button>{title}</button></form><p>{hint}</p>{more}",
        title = say("Sign in", "登录"),
        name = say("Name", "姓名"),
        token = say("Token", "令牌"),
        hint = say(
            "An administrator gives names and tokens: cnc-gateway person add NAME --role ROLE",
            "姓名和令牌由管理员发放：cnc-gateway person add NAME --role ROLE",
        ),
    );
    render_page(zh, say("Sign in", "登录"), "", &body)
}

/// `GET /plain`: the status as a page without scripts.
async fn serve_plain(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    Query(asked): Query<LanguageQuery>,
    person: Option<SignedIn>,
    headers: HeaderMap,
) -> Response {
    let zh = prefers_chinese(&shared, &asked.lang, &headers);
    let published = shared.live.borrow().clone();
    let again = format!("<meta http-equiv=\"refresh\" content=\"{AGAIN_S}\">");
    let Some(published) = published else {
        return render_page(
            zh,
            "cnc-gateway",
            &again,
            if zh { "<p>正在启动。</p>" } else { "<p>The box is starting.</p>" },
        );
    };
    let age = published.at.elapsed();
    let status = &*published.status;
    let mut body = String::new();
    if age > OLD {
        let _infallible = write!(
            body,
            "<p class=\"trouble\">{} {} s</p>",
            if zh {
                "数据已过期；距上次更新"
            } else {
                "OLD: what follows is not the present. Last news before"
            },
            age.as_secs()
        );
    }
    body += &render_machine(zh, status);
    body += &render_gate(zh, &status.gate, person.is_some());
    body += &render_troubles(zh, status);
    body += &render_footer(zh, status, person.as_ref(), &peer);
    render_page(zh, &status.machine, &again, &body)
}

fn render_machine(zh: bool, status: &Status) -> String {
    let state = vocabulary::state_text(status.state.word, zh);
    let mut html = format!(
        "<h1>{}</h1><p class=\"state\">{} <small>{} {}</small></p><table>",
        escape_html(&status.machine),
        escape_html(state),
        if zh { "自" } else { "since" },
        escape_html(&moment::format_utc(status.state.since_ms.saturating_mul(1_000_000))),
    );
    for name in SHOWN {
        let words = ChannelId::from_name(name).map(ChannelId::channel);
        if let (Some(words), Some(channel)) = (words, status.channels.iter().find(|channel| channel.name == name)) {
            let words = escape_html(if zh { words.zh } else { words.en });
            let _infallible = write!(html, "<tr><th>{words}</th><td>{}</td></tr>", render_value(zh, channel));
        }
    }
    html + "</table>"
}

fn render_value(zh: bool, channel: &ChannelStatus) -> String {
    match (&channel.value, channel.missing) {
        (Some(NumberOrWord::Number(number)), _) => {
            let digits = usize::from(number.abs() < 100.0 && number.fract() != 0.0);
            escape_html(&format!("{number:.digits$}{}", space_unit(channel.unit)))
        }
        (Some(NumberOrWord::Text(text)), _) => escape_html(text),
        (None, missing) => {
            format!("<em>{}</em>", escape_html(vocabulary::absence_text(missing.unwrap_or_default(), zh)))
        }
    }
}

fn render_gate(zh: bool, gate: &GateStatus, signed_in: bool) -> String {
    let say = |en: &'static str, cn: &'static str| if zh { cn } else { en };
    let armed = gate.armed_by.as_ref().map(|by| {
        let back = say("Back to the dial", "恢复面板倍率");
        let button =
            format!("<form method=\"post\" action=\"/api/v1/disarm\"><button class=\"stop\">{back}</button></form>");
        let words = say("The box may write to the machine. Armed by", "允许写入机床，授权人：");
        format!("<p class=\"armed\">{words} {}</p>{}", escape_html(by), if signed_in { button.as_str() } else { "" })
    });
    armed.unwrap_or_else(|| {
        format!("<p>{}</p>", say("The box writes nothing to the machine.", "本机不向机床写入任何数据。"))
    })
}

fn render_troubles(zh: bool, status: &Status) -> String {
    let mut html = String::new();
    let alarms: Vec<String> = status
        .alarms
        .iter()
        .map(|alarm| {
            format!("<li class=\"{}\">{}</li>", choose_severity_class(&alarm.severity), escape_html(&alarm.text))
        })
        .collect();
    let none = if zh { "<p>无报警。</p>" } else { "<p>No alarm.</p>" };
    html += &if alarms.is_empty() { none.to_owned() } else { format!("<ul>{}</ul>", alarms.join("")) };
    if !status.problems.is_empty() {
        let problems: Vec<String> = status
            .problems
            .iter()
            .map(|it| format!("<li>{} <em>{}</em></li>", escape_html(&it.what), escape_html(&it.next)))
            .collect();
        let title = if zh { "本机故障" } else { "What does not work" };
        html += &format!("<h2>{title}</h2><ul>{}</ul>", problems.join(""));
    }
    html
}

fn choose_severity_class(word: &str) -> &'static str {
    if word == "critical" { "critical" } else { "warning" }
}

fn render_footer(zh: bool, status: &Status, person: Option<&SignedIn>, peer: &Peer) -> String {
    let (en, cn) = ("<a href=\"?lang=en\">English</a>", "<a href=\"?lang=zh\">中文</a>");
    let person = match person {
        Some(SignedIn(person)) => format!(
            "{} ({}) <form method=\"post\" action=\"/api/v1/logout\"><button>{}</button></form>",
            escape_html(&person.name),
            if zh { person.role.as_chinese_word() } else { person.role.as_word() },
            if zh { "退出" } else { "Sign out" }
        ),
        None => format!("<a href=\"/sign-in?next=/plain\">{}</a>", if zh { "登录" } else { "Sign in" }),
    };
    let at = escape_html(&moment::format_utc(status.at_ms.saturating_mul(1_000_000)));
    format!("<footer>{at} &middot; {} &middot; {en} {cn} &middot; {person}</footer>", escape_html(&peer.to.to_string()))
}

fn render_page(zh: bool, title: &str, head: &str, body: &str) -> Response {
    let html = format!(
        "<!doctype html><html lang=\"{}\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">{head}\
         <title>{}</title><link rel=\"icon\" href=\"/web/icon.svg\"><link rel=\"stylesheet\" href=\"/plain.css\"></head>\
         <body><main>{body}</main></body></html>",
        if zh { "zh-CN" } else { "en" },
        escape_html(title),
    );
    headers::respond_with_page(&html)
}

/// Text between tags and in attributes.
fn escape_html(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for sign in text.chars() {
        match sign {
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '{' => escaped.push_str("&#123;"),
            sign => escaped.push(sign),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_a_controller_says_becomes_html() {
        assert_eq!(escape_html("<b a='1'>&{{nonce}}"), "&lt;b a=&#39;1&#39;&gt;&amp;&#123;&#123;nonce}}");
    }

    #[test]
    fn a_browser_is_sent_to_pages_of_this_box_only() {
        for path in ["/", "/plain", "/rules"] {
            assert!(is_local_path(path), "{path}");
        }
        for path in ["", "//evil.example", "https://evil.example", "/a\r\nb", "/?x=<", "/\\evil"] {
            assert!(!is_local_path(path), "{path}");
        }
    }
}
