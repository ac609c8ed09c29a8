//! The page of real diagnoses of small synthetic recordings: complete, self-contained, escaped, bounded, repeatable.

use super::{PageInput, page};
use crate::context::DiagnosisContext;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use recording::Recording;
use recording::{Cells, Numbers, Words};
use rules::physics::explain::Language;
use rules::twin::diagnosis::{Diagnosis, Verdict};
use rules::twin::region::{OnsetInterval, Span};
use rules::twin::{diagnose_recording, parse_model};

const MODEL: &str = r#"
schema = "model/1"
name = "axis <b>&amp; drive"
output = "force_n"

[[effect]]
kind = "linear"
columns = { acceleration_m_s2 = 90.0, velocity_m_s = 150.0 }
"#;

/// A name that must not become markup.
const HOSTILE: &str = "<script>alert('1')</script>";

/// An axis that moves back and forth, with dry friction of this level that the model lacks.
fn recording(runs: usize, rows_per_run: usize, friction_n: f64) -> Recording {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let rows = runs * rows_per_run;
    let time_s: Vec<f64> = (0..rows).map(|row| 0.02 * row as f64).collect();
    let (mut velocity, mut acceleration, mut force) = (Vec::new(), Vec::new(), Vec::new());
    let mut names = Words::default();
    for (row, t) in time_s.iter().enumerate() {
        let run = row / rows_per_run;
        let reach = 0.05 + 0.02 * (run % 5) as f64;
        let (v, a) = (reach * (2.0 * t).sin(), 2.0 * reach * (2.0 * t).cos());
        let noise: f64 = random.random_range(-2.0..2.0);
        velocity.push(v);
        acceleration.push(a);
        force.push(90.0 * a + 150.0 * v + friction_n * (v / 0.002).tanh() + noise);
        names.push(&if run == 3 { HOSTILE.to_owned() } else { format!("r{run}") });
    }
    let mut recording = Recording::new(format!("somewhere/{HOSTILE}.csv"), time_s, None);
    recording.set_column("run", Cells::Words(names));
    for (name, values) in [("velocity_m_s", velocity), ("acceleration_m_s2", acceleration), ("force_n", force)] {
        recording.set_column(name, Cells::Numbers(Numbers::from_values(values)));
    }
    recording
}

fn diagnosed(recording: &Recording) -> Diagnosis {
    let model = parse_model(MODEL).expect("a model");
    diagnose_recording(recording, &model, 1).expect("a diagnosis")
}

fn in_language(diagnosis: &Diagnosis, recording: &Recording, language: Language) -> String {
    page(&PageInput { diagnosis, recording, context: &DiagnosisContext::default(), language })
}

/// Every tag that opens closes, in order.
fn check_nesting(html: &str) {
    let void = ["meta", "!doctype", "input", "wbr", "br", "rect", "path", "circle"];
    let mut open: Vec<&str> = Vec::new();
    let body = html.split("<script>").next().unwrap_or(html);
    for piece in body.split('<').skip(1) {
        let (tag, _) = piece.split_once('>').expect("a tag ends");
        let name = tag.trim_end_matches('/').split([' ', '\n']).next().unwrap_or("");
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "…<{piece}");
        } else if !void.contains(&name) {
            open.push(name);
        }
    }
    assert_eq!(open, ["html", "body"], "left open");
}

/// Nothing is loaded, nothing is executed but the read-out, no number is missing its value.
fn check(html: &str) {
    check_nesting(html);
    for outside in ["http:", "https:", "src=", "href=", "@import", "url(", "NaN", "inf\"", ">inf", "None", "Some("] {
        assert!(!html.contains(outside), "{outside} at {:?}", html.find(outside));
    }
    assert_eq!(html.matches("<script").count(), 1);
    assert!(!html.contains("alert('1')"));
}

#[test]
fn a_named_effect_is_told_in_both_languages_with_names_escaped() {
    let recording = recording(9, 250, 20.0);
    let diagnosis = diagnosed(&recording);
    assert!(diagnosis.missing.iter().any(|missing| missing.effect == "dry_friction"), "{}", diagnosis.summary);
    let en = in_language(&diagnosis, &recording, Language::En);
    check(&en);
    for heading in ["Where", "What is missing", "How much better", "When it acts", "Where in operating space"] {
        assert!(en.contains(&format!("<h2>{heading}")), "{heading}");
    }
    assert!(en.contains("&lt;script&gt;") && en.contains("axis &lt;b&gt;&amp;amp; drive"));
    assert!(!en.contains("somewhere/"), "where the file lies is not told");
    let zh = in_language(&diagnosis, &recording, Language::Zh);
    check(&zh);
    assert!(zh.contains("lang=\"zh\"") && zh.contains("缺少") && zh.contains("干摩擦"));
    assert!(!zh.contains("How much better") && !zh.contains("held-out"));
    assert_eq!(en, in_language(&diagnosed(&recording), &recording, Language::En), "same input, same bytes");
}

#[test]
fn agreement_shows_one_simulation_and_too_little_data_says_what_is_needed() {
    let agreeing = recording(8, 200, 0.0);
    let diagnosis = diagnosed(&agreeing);
    assert_eq!(diagnosis.verdict, Verdict::NoMismatch, "{}", diagnosis.summary);
    let html = in_language(&diagnosis, &agreeing, Language::En);
    check(&html);
    assert!(html.contains("Recording and simulation agree.") && html.contains("How well it fits"));
    assert!(!html.contains("What is missing") && !html.contains("class=\"curve before\""));

    let short = recording(1, 20, 20.0);
    let diagnosis = diagnosed(&short);
    assert_eq!(diagnosis.verdict, Verdict::CannotTell);
    let html = in_language(&diagnosis, &short, Language::En);
    check(&html);
    assert!(html.contains("cannot answer the question") && html.contains("What to record next"));
    assert!(html.contains("at least 40 rows with a value of"));
}

#[test]
fn absent_figures_have_a_reason_and_an_onset_is_marked() {
    let recording = recording(9, 250, 20.0);
    let mut diagnosis = diagnosed(&recording);
    let fit = diagnosis.fit.as_mut().expect("a fit");
    (fit.before.held_out_rmse, fit.after.held_out_rmse) = (None, None);
    fit.held_out_runs.clear();
    for missing in &mut diagnosis.missing {
        (missing.held_out_rmse_before, missing.held_out_rmse_after) = (None, None);
        missing.parameters.iter_mut().for_each(|e| (e.low, e.high) = (None, None));
    }
    let region = diagnosis.mismatch.first_mut().expect("a region");
    region.onset = Some(OnsetInterval { run: "r2".into(), time_s: 11.0, low_s: 10.5, high_s: 12.0 });
    region.spans = vec![Span { run: "r2".into(), from_s: 11.0, to_s: 13.0 }];
    let html = in_language(&diagnosis, &recording, Language::En);
    check(&html);
    assert!(html.contains("too few runs to hold one out"));
    assert!(html.contains("not determined by this recording"));
    assert!(html.contains("class=\"onset\" style=\"left:"));
    assert!(html.contains("since run r2, at 11"));
}

#[test]
fn every_verdict_has_its_own_sign_and_sentence() {
    let recording = recording(5, 120, 20.0);
    let mut diagnosis = diagnosed(&recording);
    let mut heads = Vec::new();
    let verdicts =
        [Verdict::Explained, Verdict::Ambiguous, Verdict::Unexplained, Verdict::NoMismatch, Verdict::CannotTell];
    for verdict in verdicts {
        diagnosis.verdict = verdict;
        let html = in_language(&diagnosis, &recording, Language::En);
        check(&html);
        let head = html.split("<div class=\"answer\">").nth(1).and_then(|rest| rest.split("</h1>").next());
        heads.push(head.expect("a headline").to_owned());
    }
    heads.dedup();
    assert_eq!(heads.len(), 5);
}

/// The longest curve in points, and the size in bytes.
fn size(html: &str) -> (usize, usize) {
    let curves = html.split("class=\"curve").skip(1).filter_map(|rest| rest.split(" d=\"").nth(1)?.split('"').next());
    let points = curves.map(|d| d.split(['l', ' ', '-', 'M']).filter(|x| !x.is_empty()).count() / 2);
    (points.max().unwrap_or(0), html.len())
}

#[test]
fn the_size_does_not_grow_with_the_rows() {
    let mut diagnosis = diagnosed(&recording(9, 250, 20.0));
    for (runs, rows_per_run) in [(40, 350), (1, 60_000), (900, 60)] {
        let recording = recording(runs, rows_per_run, 20.0);
        let fit = diagnosis.fit.as_mut().expect("a fit");
        fit.held_out_runs = (0..runs).filter(|run| run % 4 == 1).map(|run| format!("r{run}")).collect();
        if runs == 1 {
            fit.held_out_runs = (1..=6).map(|part| format!("r0[{}/24]", 4 * part)).collect();
        }
        // The worst case: many effects, all of them noise.
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let rows = recording.count_rows();
        let noise = |random: &mut Pcg64Mcg| (0..rows).map(|_| random.random_range(-9.0..9.0)).collect::<Vec<f64>>();
        let simulated: Vec<Option<f64>> = noise(&mut random).into_iter().map(Some).collect();
        diagnosis.rows.compared = vec![true; rows];
        diagnosis.rows.simulated_before = simulated;
        diagnosis.rows.simulated_after = noise(&mut random).into_iter().map(Some).collect();
        diagnosis.rows.effects = (0..6).map(|k| (format!("effect_{k}"), noise(&mut random))).collect();
        let html = in_language(&diagnosis, &recording, Language::En);
        let (points, bytes) = size(&html);
        assert!(points <= super::plot::POINTS_MAX + 1, "{points} points in one curve");
        assert!(bytes <= 400_000, "{runs} runs of {rows_per_run} rows make {bytes} bytes");
    }
}
