//! `diagnose`, `simulate` and `effects` as a user calls them: the real binary, real files, exact answers.

use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{Options, Query, Reader, WhenFull, Writer};
use serde_json::Value as Json;
use std::path::Path;
use tempfile::TempDir;
use testkit::axis::{MODEL, Noise, recording, recording_with};
use testkit::command::gateway;

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("the program prints UTF-8")
}

/// A directory with `m.toml` and `r.csv`, the latter with a dry friction that the model lacks.
fn bench() -> TempDir {
    let directory = tempfile::tempdir().expect("a directory");
    write(&directory, "m.toml", MODEL);
    write(&directory, "r.csv", &recording(6, 20.0, &mut Noise::new(7)));
    directory
}

fn write(directory: &TempDir, name: &str, text: &str) {
    std::fs::write(directory.path().join(name), text).expect("writable");
}

fn read(directory: &TempDir, name: &str) -> String {
    std::fs::read_to_string(directory.path().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn json(text: &str) -> Json {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error} in {text}"))
}

#[test]
fn the_missing_friction_is_named_and_everything_is_written() {
    let bench = bench();
    let arguments = ["diagnose", "--model", "m.toml", "--recording", "r.csv", "--json", "d.json", "--rows", "d.csv"];
    let output = gateway(bench.path(), &[&arguments[..], &["--accept", "new.toml"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stdout.is_empty(), "with --json nothing goes to standard output");
    let diagnosis = json(&read(&bench, "d.json"));
    assert_eq!(diagnosis["schema"], "diagnosis/1");
    assert_eq!(diagnosis["unit"], "N");
    assert_eq!(diagnosis["missing"][0]["effect"], "dry_friction", "{diagnosis:#}");
    let level = diagnosis["missing"][0]["parameters"][0]["value"].as_f64().expect("a number");
    assert!((level - 20.0).abs() < 1.0, "{level}");
    let accepted = read(&bench, "new.toml");
    assert!(accepted.contains("dry_friction"), "{accepted}");
}

#[test]
fn the_page_is_written_beside_the_words() {
    let bench = bench();
    let output = gateway(bench.path(), &["diagnose", "--model", "m.toml", "--recording", "r.csv", "--html", "d.html"]);
    assert!(text(&output.stdout).contains("dry_friction"));
    let page = read(&bench, "d.html");
    assert!(page.starts_with("<!doctype html>") && page.contains("dry friction"), "{}", &page[..200]);
}

#[test]
fn gzip_says_the_same_as_csv() {
    let bench = bench();
    let csv = gateway(bench.path(), &["diagnose", "--model", "m.toml", "--recording", "r.csv", "--json"]);
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut packed, read(&bench, "r.csv").as_bytes()).expect("memory");
    std::fs::write(bench.path().join("r.csv.gz"), packed.finish().expect("memory")).expect("writable");
    let gzip = gateway(bench.path(), &["diagnose", "--model", "m.toml", "--recording", "r.csv.gz", "--json"]);
    assert_eq!(text(&csv.stdout), text(&gzip.stdout));
}

/// A history of a spindle that takes 30 W more than the model says whenever the coolant runs.
fn spindle_history(path: &Path) {
    let writer = Writer::open(path, Options { when_full: WhenFull::Wait, ..Options::default() }).expect("a history");
    let mut noise = Noise::new(3);
    for row in 0..900_i64 {
        let mut sample = Sample::new_empty(1_800_000_000_000_000_000 + row * 1_000_000_000);
        let coolant = f64::from(u8::from(row / 37 % 3 == 1));
        let speed = 400.0 + 200.0 * ((row / 60 % 5) as f64);
        let power = 80.0 + 0.3 * speed + 30.0 * coolant + noise.normal();
        let mut set = |name, value| {
            let channel = ChannelId::from_name(name).expect("a channel");
            sample.set_slot(channel, Slot { value: Ok(value), age_ns: 0 });
        };
        set("spindle_speed_rpm", Value::Number(speed));
        set("spindle_power_w", Value::Number((power * 100.0).round() / 100.0));
        set("coolant_on", Value::Number(coolant));
        set("run", Value::Text(format!("{}", row / 150).into()));
        writer.queue_sample(&sample, &[]);
    }
    writer.flush().expect("durable");
    drop(writer);
}

#[test]
fn a_history_and_its_exports_say_the_same() {
    let bench = bench();
    spindle_history(&bench.path().join("h.db"));
    let reader = Reader::open(&bench.path().join("h.db")).expect("readable");
    for name in ["h.csv", "h.parquet"] {
        reader.export_to_file(&Query::default(), &bench.path().join(name)).expect("exported");
    }
    let model = "schema = \"model/1\"\noutput = \"spindle_power_w\"\n[[effect]]\nkind = \"no_load_power\"\n\
                 parameters = { p0_w = 80.0, p1_w_per_rpm = 0.3, p2_w_per_rpm2 = 0.0 }\n";
    write(&bench, "spindle.toml", model);
    let said = |source: &str| {
        let output = gateway(bench.path(), &["diagnose", "--model", "spindle.toml", "--recording", source, "--json"]);
        assert_eq!(output.status.code(), Some(0), "{source}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    let all = ["h.csv", "h.parquet", "history:h.db?from=2027-01-15"].map(said);
    assert_eq!(json(&all[0])["missing"][0]["effect"], "auxiliary_switch", "{}", all[0]);
    assert_eq!(all[0], all[1]);
    assert_eq!(all[0], all[2]);
    let part = said("history:h.db?from=2027-01-15T08:00:00Z&to=2027-01-15T08:10:00Z");
    let rows = json(&part)["fit"]["rows"].as_u64().expect("a number");
    assert!((550..=600).contains(&rows), "{rows} of 600 in ten minutes");
}

#[test]
fn the_words_go_to_standard_output_in_both_languages() {
    let bench = bench();
    let arguments = ["diagnose", "--model", "m.toml", "--recording", "r.csv"];
    let english = text(&gateway(bench.path(), &arguments).stdout);
    for wanted in
        ["Where\n", "What is missing\n", "dry friction (dry_friction)", "How sure\n", "took no part in fitting"]
    {
        assert!(english.contains(wanted), "{wanted} in:\n{english}");
    }
    let chinese = text(&gateway(bench.path(), &[&arguments[..], &["--lang", "zh"]].concat()).stdout);
    assert!(chinese.contains("缺少的物理效应") && chinese.contains("(dry_friction)"), "{chinese}");
    let to_stdout = gateway(bench.path(), &[&arguments[..], &["--json"]].concat());
    assert_eq!(json(&text(&to_stdout.stdout))["schema"], "diagnosis/1");
}

#[test]
fn the_same_input_and_seed_give_the_same_bytes() {
    let bench = bench();
    let run = |name: &str| {
        let (d, rows, new) = (format!("{name}.json"), format!("{name}.csv"), format!("{name}.toml"));
        let files = ["--json", &d, "--rows", &rows, "--accept", &new, "--seed", "5"];
        let arguments = ["diagnose", "--model", "m.toml", "--recording", "r.csv"];
        assert!(gateway(bench.path(), &[&arguments[..], &files].concat()).status.success());
        [d, rows, new].map(|file| read(&bench, &file))
    };
    assert_eq!(run("a"), run("b"));
}

#[test]
fn rows_stand_in_input_order_and_agree_with_the_figures() {
    let bench = bench();
    let arguments = ["diagnose", "--model", "m.toml", "--recording", "r.csv", "--json", "d.json", "--rows", "d.csv"];
    assert!(gateway(bench.path(), &arguments).status.success());
    let (given, rows) = (read(&bench, "r.csv"), read(&bench, "d.csv"));
    let header = rows.lines().next().expect("a header");
    assert_eq!(header, "time_s,run,recorded,simulated_before,simulated_after,effect_dry_friction");
    assert_eq!(given.lines().count(), rows.lines().count());
    let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let (mut square, mut count) = (0.0, 0.0);
    let held: Vec<String> =
        serde_json::from_value(json(&read(&bench, "d.json"))["fit"]["held_out_runs"].clone()).expect("names");
    for (given, row) in given.lines().zip(rows.lines()).skip(1) {
        let (given, row) = (cells(given), cells(row));
        let number = |text: &str| text.parse::<f64>().expect("a number");
        assert_eq!(number(&given[0]), number(&row[0]));
        assert_eq!(given[1], row[1]);
        assert!((number(&given[4]) - number(&row[2])).abs() < 1e-3);
        if held.contains(&row[1]) {
            square += (number(&row[2]) - number(&row[4])).powi(2);
            count += 1.0;
        }
    }
    let said = json(&read(&bench, "d.json"))["fit"]["after"]["held_out_rmse"].as_f64().expect("a number");
    assert!(((square / count).sqrt() - said).abs() < 0.02 * said, "{} against {said}", (square / count).sqrt());
}

#[test]
fn the_accepted_model_simulates_as_well_as_the_diagnosis_says() {
    let bench = bench();
    let arguments =
        ["diagnose", "--model", "m.toml", "--recording", "r.csv", "--json", "d.json", "--accept", "new.toml"];
    assert!(gateway(bench.path(), &arguments).status.success());
    let fit = json(&read(&bench, "d.json"))["fit"].clone();
    let arguments = ["simulate", "--model", "new.toml", "--recording", "r.csv", "--json", "--rows", "s.csv"];
    let output = gateway(bench.path(), &arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let simulated = json(&text(&output.stdout));
    let rmse = simulated["rmse"].as_f64().expect("recorded");
    let (fitted, held) = (fit["after"]["rmse"].as_f64(), fit["after"]["held_out_rmse"].as_f64());
    let (low, high) = (fitted.expect("a number"), held.expect("held out"));
    assert!(rmse > 0.98 * low.min(high) && rmse < 1.02 * low.max(high), "{rmse} between {low} and {high}");
    assert!(read(&bench, "s.csv").starts_with("time_s,run,recorded,simulated,effect_linear,effect_dry_friction\n"));
    let second = gateway(bench.path(), &["diagnose", "--model", "new.toml", "--recording", "r.csv", "--json"]);
    assert_eq!(json(&text(&second.stdout))["verdict"], "no_mismatch");
}

#[test]
fn several_files_are_one_recording_with_distinct_runs() {
    let bench = bench();
    write(&bench, "r2.csv", &recording(4, 20.0, &mut Noise::new(8)));
    let arguments = ["diagnose", "--model", "m.toml", "--recording", "r.csv", "r2.csv", "--json", "--rows", "d.csv"];
    let output = gateway(bench.path(), &arguments);
    let diagnosis = json(&text(&output.stdout));
    assert_eq!(diagnosis["fit"]["runs"], 10, "{}", text(&output.stderr));
    assert!(read(&bench, "d.csv").contains("\n0,1 (2),"), "the first run of the second file is a run of its own");
}

#[test]
fn a_hypothesis_of_the_user_is_a_candidate() {
    let bench = bench();
    let noise = &mut Noise::new(9);
    let text_of = |time_s: f64| if (time_s % 7.0) < 2.0 { 15.0 } else { 0.0 };
    write(&bench, "r.csv", &recording_with(6, 0.0, noise, text_of));
    std::fs::create_dir(bench.path().join("mine")).expect("writable");
    let hypothesis = "[[effect]]\nkind = \"expression\"\nname = \"door_fan\"\nexpression = \"k * fan_on\"\nparameters = { k = 1.0 }\n";
    write(&bench, "mine/fan.toml", hypothesis);
    let arguments = ["diagnose", "--model", "m.toml", "--recording", "r.csv", "--json", "--effects-dir", "mine"];
    let output = gateway(bench.path(), &arguments);
    let diagnosis = json(&text(&output.stdout));
    assert_eq!(diagnosis["missing"][0]["effect"], "door_fan", "{diagnosis:#} {}", text(&output.stderr));
}

#[test]
fn everything_unusable_is_named_at_once() {
    let bench = bench();
    write(&bench, "m.toml", &MODEL.replace("velocity_m_s", "speed_m_s").replace("linear", "liner"));
    write(&bench, "bad.csv", "time_s,force_n\n0,1\n1,x\n2,2\n0.5,3\n");
    let output =
        gateway(bench.path(), &["diagnose", "--model", "m.toml", "--recording", "bad.csv", "gone.csv", "--json"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    let said = text(&output.stderr);
    for wanted in ["did you mean linear?", "bad.csv: 1 of 4 rows refused", "line 5, column time_s", "gone.csv"] {
        assert!(said.contains(wanted), "{wanted} in:\n{said}");
    }
}

#[test]
fn missing_columns_are_named_with_what_to_record() {
    let bench = bench();
    write(&bench, "m.toml", &MODEL.replace("velocity_m_s", "jerk_m_s3"));
    let output = gateway(bench.path(), &["diagnose", "--model", "m.toml", "--recording", "r.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("jerk_m_s3: record them"), "{}", text(&output.stderr));
}

#[test]
fn a_few_refused_rows_are_left_out_and_noted() {
    let bench = bench();
    let broken = read(&bench, "r.csv").replacen("\n0.2,1,", "\nx0.2,1,", 1);
    write(&bench, "r.csv", &broken);
    let output = gateway(bench.path(), &["diagnose", "--model", "m.toml", "--recording", "r.csv", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    assert!(said.contains("rows refused; these rows are left out") && said.contains("line 4, column"), "{said}");
    let quality = json(&text(&output.stdout))["data_quality"].to_string();
    assert!(quality.contains("refused_rows"), "{quality}");
}

#[test]
fn too_little_to_tell_is_a_verdict() {
    let bench = bench();
    let short: String = read(&bench, "r.csv").lines().take(30).map(|line| format!("{line}\n")).collect();
    write(&bench, "r.csv", &short);
    let output = gateway(
        bench.path(),
        &["diagnose", "--model", "m.toml", "--recording", "r.csv", "--json", "--accept", "n.toml"],
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(json(&text(&output.stdout))["verdict"], "cannot_tell");
    assert!(!bench.path().join("n.toml").exists());
}

#[test]
fn the_catalogue_is_listed_and_explained() {
    let here = Path::new(".");
    let list = text(&gateway(here, &["effects", "list"]).stdout);
    assert!(list.contains("flank_wear") && list.contains("zero_drift"));
    let shown = text(&gateway(here, &["effects", "show", "flank_wear", "--lang", "zh"]).stdout);
    assert!(shown.contains("后刀面磨损"), "{shown}");
    assert_eq!(json(&text(&gateway(here, &["effects", "show", "flank_wear", "--json"]).stdout))["kind"], "flank_wear");
    let unknown = gateway(here, &["effects", "show", "flank_ware"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(text(&unknown.stderr).contains("flank_wear"));
}
