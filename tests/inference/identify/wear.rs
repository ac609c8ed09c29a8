//! Tool wear: the L27 carried out on the simulated lathe, whose cutting law is Kienzle's with an edge force and a worn flank and
//! not the form that is fitted.

use crate::identify::machine::{idle, lathe, record};
use crate::identify::{Coverage, LONG, SHORT};
use adapters::Recording;
use adapters::recording::{Cells, Numbers, Words};
use adapters::simulated::{ExperimentCut, ExperimentStep};
use gateway::diagnosis::execute;
use rules::estimators::wear::{
    Array, Cut, CutColumns, CutConditions, FACTORS, FactorLevels, FittedNumber, WearModel, WearOptions,
    compute_power_limit, estimate_wear, fit_physical, gather_cuts, identify_tool_wear, plan_experiment,
};
use testkit::command::gateway;

const DIAMETER_MM: f64 = 60.0;
const WEARS_MM: [f64; 3] = [0.065, 0.195, 0.325];
/// Turning in the air before each cut, and the cut, s.
const AIR_S: f64 = 14.0;
const CUT_S: f64 = 14.0;

/// The cutting law of the simulated lathe at nominal hardness, W; W per mm of wear comes with it.
fn law(conditions: &CutConditions) -> f64 {
    let [wear, speed, feed, depth] = conditions.to_vector();
    let force_n = (980.0 * feed.powf(0.75) * (speed / 150.0).powf(-0.08) + 22.0 + 190.0 * wear) * depth;
    force_n * speed / 60.0
}

fn planned() -> Vec<CutConditions> {
    let levels = [WEARS_MM.to_vec(), vec![90.0, 120.0, 150.0], vec![0.1, 0.15, 0.2], vec![0.75, 1.25, 1.75]];
    let factors: Vec<FactorLevels> =
        FACTORS.iter().zip(levels).map(|(factor, values)| FactorLevels { factor, values }).collect();
    let design = plan_experiment(Array::L27, &factors, 1).expect("a design");
    design
        .cuts
        .iter()
        .map(|cut| CutConditions::from_vector([cut.values[0], cut.values[1], cut.values[2], cut.values[3]]))
        .collect()
}

fn step(cut: &CutConditions) -> ExperimentStep {
    let rpm = 1000.0 * cut.cutting_speed_m_min / (std::f64::consts::PI * DIAMETER_MM);
    let planned = ExperimentCut {
        feed_mm_min: cut.feed_per_rev_mm * rpm,
        depth_mm: cut.depth_of_cut_mm,
        diameter_mm: DIAMETER_MM,
        onward: false,
    };
    ExperimentStep { cut: Some(planned), ..idle(CUT_S, rpm, 1) }
}

/// The columns of the table under construction.
#[derive(Default)]
struct Table {
    runs: Vec<String>,
    numbers: [Vec<f64>; 6],
}

const NAMES: [&str; 6] =
    ["flank_wear_mm", "spindle_speed_rpm", "feed_mm_min", "depth_of_cut_mm", "diameter_mm", "cutting_power_w"];

/// The cuts of one wear on one machine: the meter's power in the cut less that in the air before, less the load loss (which
/// `identify load-loss` is about and which counts as known here).
fn cuts_of(seed: u64, wear_mm: f64, cuts: &[CutConditions], table: &mut Table) {
    let settings = adapters::simulated::SimulatedSettings { wear_mm, ..lathe(seed) };
    let steps: Vec<ExperimentStep> =
        cuts.iter().flat_map(|cut| [idle(AIR_S, step(cut).spindle_rpm, 1), step(cut)]).collect();
    let recorded = record(settings, &steps, 5.0);
    let recording = &recorded.recording;
    let number = |name: &str, row: usize| recording.find_numbers(name).and_then(|numbers| numbers.get(row));
    let block = |row: usize| recording.find_words("block").and_then(|words| words.get(row)).unwrap_or_default();
    for (index, cut) in cuts.iter().enumerate() {
        let rows = |step: usize| (0..recording.count_rows()).filter(move |row| block(*row) == format!("N{step}"));
        let air: Vec<usize> = rows(2 * index + 1).collect();
        // The first seconds still accelerate.
        let air: Vec<f64> = air[air.len() / 2..].iter().filter_map(|row| number("spindle_power_w", *row)).collect();
        let air_w = air.iter().sum::<f64>() / air.len() as f64;
        let inside: Vec<usize> = rows(2 * index + 2).filter(|row| recorded.truth[*row].engaged > 0.99).collect();
        let inside = &inside[5..inside.len() - 5];
        let wear: f64 = inside.iter().map(|row| recorded.truth[*row].flank_wear_mm).sum::<f64>() / inside.len() as f64;
        for row in inside {
            let Some(power_w) = number("spindle_power_w", *row) else { continue };
            let values = [
                wear,
                number("spindle_speed_rpm", *row).expect("the controller answers"),
                number("feed_mm_min", *row).expect("the controller answers"),
                cut.depth_of_cut_mm,
                DIAMETER_MM,
                power_w - air_w - recorded.truth[*row].load_loss_w,
            ];
            table.runs.push(format!("{wear_mm}-{index}"));
            table.numbers.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        }
    }
}

/// The whole design of experiments on three machines with edges of different wear.
fn table(seed: u64) -> Recording {
    let mut table = Table::default();
    for wear_mm in WEARS_MM {
        let cuts: Vec<CutConditions> = planned().into_iter().filter(|cut| cut.flank_wear_mm == wear_mm).collect();
        cuts_of(seed, wear_mm, &cuts, &mut table);
    }
    let rows = table.runs.len();
    let mut recording =
        Recording::new("L27 on the simulated lathe", (0..rows).map(|row| row as f64 * 0.2).collect(), None);
    recording.set_column("run", Cells::Words(table.runs.iter().map(String::as_str).collect::<Words>()));
    for (name, values) in NAMES.iter().zip(table.numbers) {
        recording.set_column(name, Cells::Numbers(Numbers::from_values(values)));
    }
    recording
}

/// The numbers of the fitted form that come nearest to the machine's own law at the planned cuts.
fn nearest() -> Vec<FittedNumber> {
    let cuts: Vec<Cut> =
        planned().into_iter().map(|conditions| Cut { conditions, cutting_power_w: law(&conditions) }).collect();
    fit_physical(&cuts, &[]).expect("a fit").coefficients
}

fn coverage(repetitions: u64) {
    let truths = nearest();
    let mut numbers: Vec<Coverage> = truths.iter().map(|it| Coverage::new(format!("tool wear: {}", it.name))).collect();
    let mut limits = Coverage::new("tool wear: [Pc] of a single cut, W");
    let mut wears = Coverage::new("tool wear: wear from the power of a single cut, mm");
    let free = CutConditions::from_vector([0.24, 105.0, 0.125, 1.5]);
    for seed in 1..=repetitions {
        let gathered = gather_cuts(&table(seed), &CutColumns::default()).expect("cuts");
        assert_eq!(gathered.cuts.len(), 27);
        let found = fit_physical(&gathered.cuts, &[]).expect("a fit");
        for ((one, truth), count) in found.coefficients.iter().zip(&truths).zip(&mut numbers) {
            // The reference of the fit is the middle of the measured cuts, so near the planned one that it makes no difference
            // but to the power there.
            let scale = if one.name == "cutting_power_w" { reference_scale(&found.physical.reference) } else { 1.0 };
            count.add(one.interval, truth.value * scale);
        }
        let model = WearModel::Physical(found.physical);
        limits.add(compute_power_limit(&model, &free, 0.3).expect("a limit").interval_w, law(&free.with_wear(0.3)));
        let wear = estimate_wear(&model, &free, (law(&free), 0.0), 0.3).expect("a wear");
        wears.add(wear.interval_mm, free.flank_wear_mm);
    }
    numbers.iter().for_each(Coverage::assert);
    limits.assert();
    wears.assert();
}

/// Power of a sharp edge at this reference over that at the planned one.
fn reference_scale(reference: &[f64; 3]) -> f64 {
    let middle = |at: usize| {
        let cuts = planned();
        (cuts.iter().map(|cut| cut.to_vector()[at].ln()).sum::<f64>() / cuts.len() as f64).exp()
    };
    let sharp = |at: [f64; 3]| law(&CutConditions::from_vector([0.0, at[0], at[1], at[2]]));
    sharp(*reference) / sharp([middle(1), middle(2), middle(3)])
}

#[test]
fn the_numbers_of_the_physical_form_are_inside_their_intervals() {
    coverage(SHORT);
}

#[test]
#[ignore = "1 minute: coverage of the wear model, 200 repetitions"]
fn the_numbers_of_the_physical_form_are_inside_their_intervals_200_times() {
    coverage(LONG);
}

#[test]
fn the_command_fits_both_forms_and_keeps_the_model_in_the_library() {
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("l27.csv"), execute::format_csv(&table(1))).expect("written");
    let arguments = [
        "identify",
        "tool-wear",
        "--recording",
        "l27.csv",
        "--json",
        "--out",
        "wear.toml",
        "--store",
        "h.db",
        "--machine",
        "lathe",
        "--tool",
        "T1",
        "--work-material",
        "45# steel",
    ];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stderr));
    let json: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    let learned = &json["learned"];
    assert_eq!((&learned["cuts"], &learned["taken"]), (&serde_json::json!(27), &serde_json::json!("physical")));
    assert!(learned["surface"]["anova"]["adjusted_r2"].as_f64().is_some_and(|share| share > 0.95), "{learned:#}");
    let text = std::fs::read_to_string(directory.path().join("wear.toml")).expect("written");
    let record = rules::estimators::wear::WearRecord::parse(&text).expect("a model");
    assert_eq!((record.cuts, record.key.tool.as_str()), (27, "T1"));
    let listed = gateway(directory.path(), &["identify", "tool-wear", "--list", "--history", "h.db", "--json"]);
    let listed: serde_json::Value = serde_json::from_slice(&listed.stdout).expect("JSON");
    assert_eq!(listed["models"][0]["record"]["work_material"], "45# steel");
    assert_eq!(listed["models"][0]["in_force"], true);
}

#[test]
fn tables_that_cannot_tell_are_refused_with_what_is_needed() {
    let directory = tempfile::tempdir().expect("a directory");
    let good = "time_s,flank_wear_mm,cutting_speed_m_min,feed_per_rev_mm,depth_of_cut_mm,cutting_power_w\n";
    let rows = |change: &dyn Fn(&CutConditions) -> [f64; 5]| {
        let line = |(index, cut): (usize, &CutConditions)| {
            let values = change(cut).map(|value| value.to_string());
            format!("{index},{}\n", values.join(","))
        };
        format!("{good}{}", planned().iter().enumerate().map(line).collect::<String>())
    };
    let all = |cut: &CutConditions| {
        let [wear, speed, feed, depth] = cut.to_vector();
        [wear, speed, feed, depth, law(cut)]
    };
    let cases: [(String, &str); 5] = [
        (
            rows(&|cut| {
                let mut it = all(cut);
                it[4] /= 1000.0;
                it
            }),
            "is the power in kW?",
        ),
        (
            rows(&|cut| {
                let mut it = all(cut);
                it[0] *= 1000.0;
                it
            }),
            "is it in um?",
        ),
        (
            rows(&|cut| {
                let mut it = all(cut);
                it[1] = 120.0;
                it
            }),
            "cutting_speed_m_min is the same in every cut",
        ),
        (rows(&all).lines().take(5).map(|line| format!("{line}\n")).collect(), "make at least eight cuts"),
        (rows(&all).replace("depth_of_cut_mm", "depth"), "there is no column depth_of_cut_mm (no controller knows it"),
    ];
    for (text, part) in cases {
        std::fs::write(directory.path().join("table.csv"), text).expect("written");
        let told = gateway(directory.path(), &["identify", "tool-wear", "--recording", "table.csv", "--json"]);
        let answer = String::from_utf8_lossy(&told.stdout);
        assert_eq!(told.status.code(), Some(1), "{part}: {answer}{}", String::from_utf8_lossy(&told.stderr));
        assert!(answer.contains(part), "{part}: {answer}");
    }
}

#[test]
fn a_work_list_is_printed_and_comes_back_as_a_table() {
    let directory = tempfile::tempdir().expect("a directory");
    let arguments = [
        "identify",
        "tool-wear",
        "--design",
        "L27",
        "--levels",
        "VB=0.065,0.195,0.325",
        "--levels",
        "vc=90,120,150",
        "--levels",
        "f=0.1,0.15,0.2",
        "--levels",
        "ap=0.75,1.25,1.75",
        "--diameter-mm",
        "60",
        "--out",
        "list.csv",
    ];
    let told = gateway(directory.path(), &arguments);
    let text = String::from_utf8_lossy(&told.stdout);
    assert_eq!(told.status.code(), Some(0), "{text}{}", String::from_utf8_lossy(&told.stderr));
    assert!(
        text.contains("cannot be told apart well (correlation") && text.contains("flank wear cannot be set"),
        "{text}"
    );
    let csv = std::fs::read_to_string(directory.path().join("list.csv")).expect("written");
    assert_eq!(csv.lines().count(), 28);
    // The powers are filled in by hand.
    let filled: String = csv
        .lines()
        .enumerate()
        .map(|(at, line)| {
            let cells: Vec<f64> = line.split(',').skip(2).take(4).filter_map(|cell| cell.parse().ok()).collect();
            match cells[..] {
                [a, b, c, d] if at > 0 => format!("{line}{}\n", law(&CutConditions::from_vector([a, b, c, d]))),
                _ => format!("{line}\n"),
            }
        })
        .collect();
    std::fs::write(directory.path().join("filled.csv"), filled).expect("written");
    let told = gateway(directory.path(), &["identify", "tool-wear", "--recording", "filled.csv"]);
    assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stdout));
}

#[test]
fn both_forms_are_compared_on_cuts_that_they_have_not_seen() {
    let gathered = gather_cuts(&table(2), &CutColumns::default()).expect("cuts");
    let learned = identify_tool_wear(gathered.cuts, &WearOptions::default()).expect("both");
    println!("{learned}");
    let [surface, physical] = &learned.comparison.forms;
    assert!(physical.outside_rms_w < surface.outside_rms_w, "{:?}", learned.comparison);
}
