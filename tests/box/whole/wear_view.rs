//! The view "Tool wear": one limit and one state with its reason; the edges one by one; no line from one edge to another, nor across a
//! time that was not recorded; no threshold that is not the script's.

use super::browser::{self, Browser};
use super::views::picture;
use serde_json::{Value, json};
use testkit::process::{Gateway, get};

/// Answers of the box that are given in its place, by the beginning of their address.
pub(super) fn answer_instead(browser: &mut Browser, answers: &Value) {
    browser.before_every_document(&format!(
        "(() => {{ const answers = {answers}; const real = globalThis.fetch;
            globalThis.fetch = async (path, options) => {{
                const known = Object.keys(answers).find((it) => String(path).startsWith(it));
                return known ? new Response(JSON.stringify(answers[known]), {{ headers: {{ 'content-type': 'application/json' }} }}) : real(path, options);
            }}; }})()"
    ));
}

/// When the first part began, ms since 1970.
const BEGAN_MS: i64 = 1_795_000_000_000;

/// A part of one minute that a tool has cut. Where there is a limit, the cuts that have it took 200 W.
fn part(from_ms: i64, edge: &str, limit_w: Option<f64>) -> Value {
    let (tool, named) = if edge == "T1" { (edge, "") } else { ("T1", edge) };
    json!({
        "from_ms": from_ms, "to_ms": from_ms + 60_000, "count": 1,
        "tools": [{ "tool": tool, "edge": named, "cutting_s": 20.0, "cutting_power_w": 900.0, "limit_w": limit_w,
            "power_at_limit_w": limit_w.map(|_| 200.0), "wear_mm": 0.1, "wear_uncertainty_mm": 0.02 }],
    })
}

/// Three parts of T1, a night in which the box was off, two of T1, two of T1-1 and two of T1-2; the last two without a limit.
fn parts() -> Value {
    let night_ms = 8 * 3_600_000;
    let edges = ["T1", "T1", "T1", "T1", "T1", "T1-1", "T1-1", "T1-2", "T1-2"];
    let rows = (0_i64..).zip(edges).map(|(at, edge)| {
        let off_ms = if at > 2 { night_ms } else { 0 };
        part(BEGAN_MS + at * 60_000 + off_ms, edge, (at < 7).then_some(252.0))
    });
    json!({ "schema": "parts/1", "rows": rows.collect::<Vec<Value>>() })
}

fn settings() -> Value {
    let row = |name: &str, value: f64| json!({ "script": "tool_wear", "name": name, "value": value });
    json!({ "settings": [row("alarm_probability", 0.83), row("limit_parts", 7.0), row("life_share", 1.4)] })
}

/// How many points of a line, which has a colour, lie between two parts of the figure.
const BETWEEN: &str = "((from, to) => {
    const canvas = document.querySelector('.wear-figure canvas');
    const ratio = canvas.width / canvas.clientWidth;
    const [area, whole] = [document.querySelector('.wear-figure .u-over').getBoundingClientRect(), canvas.getBoundingClientRect()];
    const x = (part) => Math.round((area.left - whole.left + ((part - 0.5) / 9) * area.width) * ratio);
    const { data } = canvas.getContext('2d').getImageData(x(from), Math.round((area.top - whole.top) * ratio), x(to) - x(from), Math.round(area.height * ratio));
    let count = 0;
    for (let i = 0; i < data.length; i += 4)
        if (data[i + 3] > 150 && Math.max(data[i], data[i + 1], data[i + 2]) - Math.min(data[i], data[i + 1], data[i + 2]) > 60) count += 1;
    return count;
})";

#[test]
fn the_edges_stand_one_by_one_and_no_line_joins_what_is_apart() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    let mut browser = Browser::start(directory.path());
    browser.size(1440, 1080);
    answer_instead(&mut browser, &json!({ "/api/v1/parts": parts(), "/api/v1/settings": settings() }));
    browser.open(&format!("http://{address}/wear?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes' && document.querySelector('.wear-figure canvas')");
    picture(&mut browser, "wear-edges");
    for (from, to, joined) in [
        (1.2, 1.8, true),
        // A night in which nothing was recorded.
        (3.2, 3.8, false),
        (4.2, 4.8, true),
        (5.2, 5.8, false),
        (6.2, 6.8, true),
        (7.2, 7.8, false),
    ] {
        let points = browser.value(&format!("{BETWEEN}({from}, {to})")).as_i64().expect("a number");
        assert_eq!(points > 0, joined, "between {from} and {to}: {points} points of a line");
    }
    let rows = browser.value(
        "[...document.querySelectorAll('main .card table')].find((it) => it.textContent.includes('Edge'))
            && [...[...document.querySelectorAll('main .card table')].find((it) => it.tHead.textContent.startsWith('Edge')).tBodies[0].rows]
                .map((row) => [row.cells[0].textContent, row.cells[1].textContent, row.cells[4].textContent, row.cells[5].textContent])",
    );
    let expected =
        json!([["T1-2", "2", "900 W", "none"], ["T1-1", "2", "200 W", "252 W"], ["T1", "5", "200 W", "252 W"]]);
    assert_eq!(rows, expected, "each edge once, the newest first, with how it stood at its last part");
    let key = browser.value("[...document.querySelectorAll('.legend')].map((it) => it.innerText).join(' ')");
    let key = key.as_str().expect("text");
    // Every line that is drawn is named, and the dashed one is drawn so.
    for line in ["Power limit", "cuts that have a limit", "cuts without a limit", "Flank wear"] {
        assert!(key.contains(line), "{line}: {key}");
    }
    assert_eq!(browser.value("document.querySelectorAll('.legend i.dashed').length"), 1);
    assert_eq!(browser.faults(&address), Vec::<String>::new());
    gateway.stop();
}

#[test]
fn the_page_judges_by_the_settings_of_the_script() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    // What the script declares is what the page is told.
    let declared = get(&address, "/api/v1/settings").json();
    let names: Vec<&str> = declared["settings"]
        .as_array()
        .expect("a list")
        .iter()
        .filter(|it| it["script"] == "tool_wear")
        .filter_map(|it| it["name"].as_str())
        .collect();
    assert_eq!(names, ["alarm_probability", "limit_parts", "life_share"]);
    let mut browser = Browser::start(directory.path());
    answer_instead(&mut browser, &json!({ "/api/v1/settings": settings() }));
    browser.open(&format!("http://{address}/wear?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    let read = browser.value("import('/web/wear-edge.js').then((it) => it.readThresholds())");
    assert_eq!(read, json!({ "probability": 0.83, "parts": 7, "life": 1.4 }));
    // Every alarm, probability and threshold: one state, which is that of the rule, with a reason.
    let wrong = browser.value(
        "import('/web/wear-edge.js').then(({ judgeEdge }) => {
            const wrong = [];
            const alarm = (code) => ({ code, text: `said by ${code}`, zh: '' });
            const stands = { none: [], own: [alarm('tool_worn_T1-2')], other: [alarm('tool_worn_T1')], longer: [alarm('tool_worn_T1-22')], unseen: [alarm('tool_unseen_T1')] };
            for (const [which, alarms] of Object.entries(stands))
                for (const probability of [null, 0, 0.2, 0.5, 0.83, 0.9, 1])
                    for (const threshold of [null, 0.05, 0.5, 0.83]) {
                        const quantity = (key) => (key !== 'tool_worn_probability' ? undefined
                            : probability === null ? { missing: 'no_part_yet' } : { value: probability });
                        const context = { quantity, reason: (word) => `because ${word}` };
                        const { state, tone, why } = judgeEdge('T1-2', { alarms }, context, { probability: threshold, parts: 3, life: 1 });
                        const should = which === 'own' ? 'worn' : which === 'unseen' || probability === null || threshold === null ? 'unknown'
                            : probability >= threshold ? 'worn' : 'good';
                        const colour = { worn: 'bad', good: 'good', unknown: '' }[should];
                        if (state !== should || tone !== colour || !(why.length > 8)) wrong.push([which, probability, threshold, state, tone, why]);
                        if (which === 'own' && why !== 'said by tool_worn_T1-2') wrong.push([which, why]);
                    }
            return wrong.slice(0, 5);
        })",
    );
    assert_eq!(wrong, json!([]), "{wrong}");
    gateway.stop();
}
