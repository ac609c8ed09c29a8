//! Thermal error: what the program learns from recordings of a machine that warms by other laws, coverage of intervals
//! where the law itself is the truth, and refusals.

use crate::identify::{Coverage, LONG, SHORT};
use adapters::Absence;
use rules::estimators::thermal::{Predictor, ThermalLaw};
use rules::script::{ScriptFile, compile_scripts};
use serde_json::Value;
use testkit::command::gateway;
use testkit::thermal_machine::{Recorded, SENSORS, ThermalMachine};

fn text(output: &std::process::Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
}

/// Exit code and document of `identify thermal --json` on these rows.
fn identify(csv: &str, options: &[&str]) -> (Option<i32>, Value) {
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("warm.csv"), csv).expect("written");
    let arguments = [&["identify", "thermal", "--recording", "warm.csv", "--json"], options].concat();
    let told = gateway(directory.path(), &arguments);
    let document = serde_json::from_slice(&told.stdout).unwrap_or_else(|_| panic!("no JSON: {}", text(&told)));
    (told.status.code(), document)
}

fn learned(csv: &str, options: &[&str]) -> Value {
    let (code, document) = identify(csv, options);
    assert_eq!(code, Some(0), "{document:#}");
    document["learned"].clone()
}

fn refused(csv: &str, options: &[&str]) -> String {
    let (code, document) = identify(csv, options);
    assert_eq!((code, &document["learned"]), (Some(1), &Value::Null), "{document:#}");
    let refusal = &document["refused"];
    ["place", "what", "next"].map(|key| refusal[key].as_str().expect("words")).join("; ")
}

fn interval(coefficient: &Value, key: &str) -> (f64, f64) {
    (coefficient[key][0].as_f64().expect("a number"), coefficient[key][1].as_f64().expect("a number"))
}

/// How often each coefficient lies in its 95 % interval, and all of them in their joint ones.
fn coverage(name: &str, repetitions: u64, truth: &[f64], recorded: impl Fn(u64) -> Recorded, options: &[&str]) {
    let mut each: Vec<Coverage> = (0..truth.len()).map(|_| Coverage::new("")).collect();
    let mut names: Vec<String> = Vec::new();
    let mut together = Coverage::new(format!("{name}: all together, joint intervals"));
    let mut lagged = 0;
    for seed in 0..repetitions {
        let learned = learned(&recorded(seed).csv(), options);
        let coefficients = learned["coefficients"].as_array().expect("a list");
        lagged += u64::from(learned["lag_chosen"] == true);
        if coefficients.len() != truth.len() {
            together.add((1.0, 1.0), 0.0);
            continue;
        }
        names = coefficients.iter().map(|it| it["name"].as_str().expect("a name").to_owned()).collect();
        let inside = |key: &str, at: usize| {
            let (least, greatest) = interval(&coefficients[at], key);
            least <= truth[at] && truth[at] <= greatest
        };
        each.iter_mut().enumerate().for_each(|(at, it)| it.add(interval(&coefficients[at], "interval"), truth[at]));
        let all = (0..truth.len()).all(|at| inside("joint_interval", at));
        together.add((0.0, 0.0), if all { 0.0 } else { 1.0 });
    }
    println!("{name}: with lag chosen in {lagged} of {repetitions}");
    for (coverage, coefficient) in each.into_iter().zip(names) {
        coverage.named(format!("{name}: {coefficient}")).assert();
    }
    together.assert();
}

const STATIC: (f64, &[(usize, f64)]) = (-70.0, &[(12, 1.3), (4, 2.1)]);

fn without_lag(repetitions: u64) {
    let recorded = |seed| ThermalMachine::new(seed).tests(4, 150).with_law(STATIC.0, STATIC.1, 0.0, seed + 1000, 1.2);
    let truth = [STATIC.0, STATIC.1[0].1, STATIC.1[1].1];
    coverage("static", repetitions, &truth, recorded, &["--sensors", "temperature_12_c,temperature_4_c"]);
}

const LATE: (f64, &[(usize, f64)], f64) = (-60.0, &[(12, 1.9), (1, 0.9)], 1800.0);

fn with_lag(repetitions: u64) {
    let recorded = |seed| ThermalMachine::new(seed).tests(4, 150).with_law(LATE.0, LATE.1, LATE.2, seed + 1000, 1.0);
    let truth = [LATE.0, LATE.1[0].1, LATE.1[1].1, LATE.2];
    coverage("late", repetitions, &truth, recorded, &["--sensors", "temperature_12_c,temperature_1_c"]);
}

#[test]
fn coefficients_are_inside_their_intervals() {
    without_lag(SHORT);
}

#[test]
fn coefficients_of_a_late_law_are_inside_their_intervals() {
    with_lag(SHORT);
}

#[test]
#[ignore = "1 minute: coverage of thermal coefficients with and without a lag, 200 repetitions"]
fn coefficients_are_inside_their_intervals_200_times() {
    without_lag(LONG);
    with_lag(LONG);
}

/// What the law of a learning machine leaves on later tests of the same machine: root mean squares without compensation
/// and with it, um, and the share of rows inside two deviations.
fn later(learned: &Value, law: &Value, tests: &Recorded) -> (f64, f64, f64) {
    let law: ThermalLaw = serde_json::from_value(law.clone()).unwrap_or_else(|error| panic!("{error}: {learned:#}"));
    let names: Vec<String> = (1..=SENSORS).map(|n| format!("temperature_{n}_c")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut predictor = Predictor::new(law, &names).expect("sensors of the recording");
    let (mut raw, mut left, mut inside, mut rows) = (0.0, 0.0, 0, 0);
    for row in 0..tests.rows() {
        let temperatures: Vec<Result<f64, Absence>> =
            tests.temperature_c.iter().map(|sensor| Ok(sensor[row])).collect();
        let at_ns = (tests.time_s[row] * 1e9) as i64;
        let prediction = predictor.predict_error(at_ns, &temperatures).expect("every sensor answers");
        if !prediction.is_inside_range() {
            continue;
        }
        let beside = prediction.compare_with_measured(Ok(tests.error_um[row]));
        let residual = beside.residual_um.expect("measured");
        raw += tests.error_um[row].powi(2);
        left += residual.value.powi(2);
        inside += usize::from(residual.value.abs() <= 1.96 * residual.sd);
        rows += 1;
    }
    assert!(rows * 2 > tests.rows(), "most rows lie inside the range of identification");
    let count = rows as f64;
    ((raw / count).sqrt(), (left / count).sqrt(), inside as f64 / count)
}

#[test]
fn a_machine_of_other_physics_is_compensated_on_later_days() {
    let (mut plain, mut late, mut grades) = (0.0, 0.0, 0.0);
    let mut covered = Vec::new();
    for seed in [11, 12, 13] {
        let mut machine = ThermalMachine::new(seed);
        let (first, second) = (machine.tests(6, 240), machine.tests(3, 240));
        let learned = learned(&first.csv(), &[]);
        let (raw, left, share) = later(&learned, &learned["law"], &second);
        covered.push(share);
        println!(
            "machine {seed}: sensors {}; later tests {raw:.1} um, compensated {left:.2} um ({:.0} % removed), {:.0} % inside \
             95 %; blocks left out {:.2} static, {:.2} late, grades {:.2} um; {}",
            chosen(&learned),
            100.0 * (1.0 - left / raw),
            100.0 * share,
            number(&learned["without_lag"]["held_out"]["rms_um"]),
            number(&learned["with_lag"]["held_out"]["rms_um"]),
            number(&learned["selection"]["by_grades"]["held_out_rms_um"]),
            learned["reason"].as_str().unwrap_or_default()
        );
        plain += number(&learned["without_lag"]["held_out"]["rms_um"]);
        late += number(&learned["with_lag"]["held_out"]["rms_um"]);
        grades += number(&learned["selection"]["by_grades"]["held_out_rms_um"]);
        assert!(left < 0.2 * raw, "machine {seed}: {raw} {left}");
    }
    println!("sums: static {plain:.2}, late {late:.2}, by grades {grades:.2} um");
    assert!(plain.min(late) < grades, "held-out error beats grades");
    assert!(covered.iter().sum::<f64>() / 3.0 > 0.85, "{covered:?}");
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn chosen(learned: &Value) -> String {
    let terms = learned["law"]["terms"].as_array().expect("terms");
    let name =
        |term: &Value| format!("{} ({})", term["sensor"].as_str().unwrap_or(""), term["path"].as_str().unwrap_or(""));
    terms.iter().map(name).collect::<Vec<String>>().join(", ")
}

#[test]
fn the_script_that_is_written_compiles_and_the_words_are_for_people() {
    let recorded = ThermalMachine::new(5).tests(4, 150).with_law(LATE.0, LATE.1, LATE.2, 6, 0.8);
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("warm.csv"), recorded.csv()).expect("written");
    let arguments = ["identify", "thermal", "--recording", "warm.csv", "--out", "thermal.rhai"];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(0), "{}", text(&told));
    println!("{}", text(&told));
    assert!(text(&told).contains("Chosen: with lag"), "the law is late: {}", text(&told));
    let script = std::fs::read_to_string(directory.path().join("thermal.rhai")).expect("written");
    println!("{script}");
    assert!(script.contains("first_order_c(memory.late_temperature_12_c"), "{script}");
    let compiled = compile_scripts(&[ScriptFile { name: "thermal.rhai".to_owned(), text: script.clone() }]);
    compiled.unwrap_or_else(|problems| panic!("{problems:?}\n{script}"));
}

/// How many alarms a replay of these rows raises under the scripts of `rules`.
fn alarms(directory: &std::path::Path, recorded: &Recorded) -> u64 {
    std::fs::write(directory.join("later.csv"), recorded.every_second().csv()).expect("written");
    let told = gateway(directory, &["replay", "later.csv", "--scripts", "rules", "--json"]);
    assert_eq!(told.status.code(), Some(0), "{}", text(&told));
    let summary: Value = serde_json::from_slice(&told.stdout).expect("JSON");
    summary["alarms"].as_u64().expect("a count")
}

#[test]
fn the_script_that_is_written_watches_a_machine() {
    let mut machine = ThermalMachine::new(5);
    let law = |recorded: Recorded| recorded.with_law(LATE.0, LATE.1, LATE.2, 6, 0.8);
    let all = law(machine.tests(6, 200));
    // The last test is among those learned from, so that its temperatures lie inside the range of identification.
    let later = all.rows_of(1000..1200);
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::create_dir(directory.path().join("rules")).expect("a directory");
    std::fs::write(directory.path().join("warm.csv"), all.csv()).expect("written");
    let arguments = ["identify", "thermal", "--recording", "warm.csv", "--out", "rules/thermal.rhai"];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(0), "{}", text(&told));
    assert_eq!(alarms(directory.path(), &later), 0, "the law holds");
    let mut bent = later.rows_of(0..200);
    bent.error_um.iter_mut().for_each(|um| *um += 25.0);
    assert!(alarms(directory.path(), &bent) > 0, "measured and predicted disagree");
    let mut hot = later.rows_of(0..200);
    hot.temperature_c.iter_mut().flatten().for_each(|c| *c += 30.0);
    assert!(alarms(directory.path(), &hot) > 0, "outside the range of identification");
}

#[test]
fn what_cannot_be_learned_is_refused_with_words() {
    let recorded = || ThermalMachine::new(3).tests(3, 100);
    let column = |change: &dyn Fn(&mut Recorded)| {
        let mut changed = recorded();
        change(&mut changed);
        changed.csv()
    };
    let few = recorded().csv().lines().take(6).collect::<Vec<&str>>().join("\n");
    assert!(refused(&few, &[]).contains("5 rows; record at least 8"), "{}", refused(&few, &[]));
    let short = "time_s,thermal_error_um,temperature_1_c\n0,1,20\n60,5,20\n120,9,20\n";
    assert!(refused(short, &[]).contains("3 rows; record at least 8"), "{}", refused(short, &[]));
    let still = column(&|it| it.temperature_c.iter_mut().for_each(|sensor| sensor.fill(21.0)));
    assert!(refused(&still, &[]).contains("changes by 0.000 K only"));
    let kelvin = column(&|it| it.temperature_c[2].iter_mut().for_each(|t| *t += 273.15));
    assert!(refused(&kelvin, &[]).contains("temperature_3_c; the middle temperature is"), "{}", refused(&kelvin, &[]));
    let millimetres = column(&|it| it.error_um.iter_mut().for_each(|um| *um /= 1000.0));
    assert!(refused(&millimetres, &[]).contains("looks like mm"));
    let twins = column(&|it| it.temperature_c[4] = it.temperature_c[3].clone());
    let told = refused(&twins, &["--sensors", "temperature_4_c,temperature_5_c"]);
    assert!(told.contains("say the same"), "{told}");
    let none = recorded().csv().replace("thermal_error_um", "thermal_error_mm");
    assert!(refused(&none, &[]).contains("give it in micrometres"));
    assert!(refused(&recorded().csv(), &["--rho", "2"]).contains("above 0 and at most 1"));
}

#[test]
fn a_pause_that_is_not_known_leaves_the_static_law_and_says_why() {
    let mut recorded = ThermalMachine::new(3).tests(3, 150).with_law(LATE.0, LATE.1, LATE.2, 6, 0.8);
    let first = recorded.time_s.clone();
    for run in 0..3 {
        (150 * run..150 * (run + 1)).for_each(|row| recorded.time_s[row] = first[row] - first[150 * run]);
    }
    let learned = learned(&recorded.csv(), &["--sensors", "temperature_12_c"]);
    assert_eq!(learned["lag_chosen"], false);
    assert!(learned["with_lag"]["refused"]["next"].as_str().expect("words").contains("time_utc"));
    assert!(learned["reason"].as_str().expect("words").contains("pauses"));
}
