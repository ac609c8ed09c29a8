//! A real CNC mill in wax: the spindle idles at 168 to 192 W and cutting adds 0 to 14 W.
//! `cargo test --release --test inference -- --nocapture estimators::milling`.

use adapters::Sample;
use adapters::merge::{Delay, Lockstep};
use adapters::recording::{Recording, read_path};
use adapters::replay::Replay;
use rules::estimators::{Estimates, Inference, Settings, State, VisibilityTally, VisibilityVerdict};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The shared recordings, if they are there.
fn recording() -> Option<Recording> {
    let named = std::env::var_os("CNC_GATEWAY_SHARED").map(PathBuf::from);
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let folders = named.into_iter().chain([beside]).flat_map(|folder| [folder.join("data"), folder]);
    let file = folders.map(|folder| folder.join("milling/recording.csv.gz")).find(|file| file.exists())?;
    Some(read_path(&file).expect("readable").recording)
}

fn replay(recording: &Recording) -> Vec<Estimates> {
    let mut merge =
        Lockstep::new(vec![Box::new(Replay::new("milling", recording, 0))], Delay::Fixed(Default::default()));
    let mut pipeline = Inference::new(Settings::default());
    let mut sample = Sample::new_empty(0);
    let mut estimates = Vec::new();
    while let Some(now_ns) = merge.next_ns() {
        merge.sample_into(&mut sample, now_ns);
        estimates.push(*pipeline.update_with_sample(&sample));
    }
    estimates
}

#[test]
fn milling_every_edge_of_the_spindle_and_cutting_below_visibility() {
    let Some(recording) = recording() else {
        println!("SKIPPED: no milling recording; set CNC_GATEWAY_SHARED to the folder of the shared data");
        return;
    };
    let estimates = replay(&recording);
    assert_eq!(estimates.len(), recording.count_rows());
    let speeds = recording.find_numbers("spindle_speed_rpm").expect("recorded");
    let turns: Vec<bool> = speeds.iter().map(|speed| speed.expect("complete").abs() >= 10.0).collect();
    let said: Vec<Option<bool>> = estimates.iter().map(|it| it.state.spindle_on().or(it.spindle_turns)).collect();
    let (mut edges, mut right) = (0, 0);
    for run in recording.list_runs() {
        for row in run.rows.start + 1..run.rows.end {
            if turns[row] != turns[row - 1] {
                edges += 1;
                right += u32::from(said[row] == Some(turns[row]) && said[row - 1] == Some(turns[row - 1]));
            }
        }
    }
    println!("spindle edges: {edges}, right at the very row: {right}");
    print_states(&recording, &estimates);
    let mut tally = VisibilityTally::default();
    estimates.iter().for_each(|it| tally.add(it));
    println!("{tally:?}\n{}", tally.judge_visibility());
    let cutting = estimates.iter().filter(|it| it.state == State::Cutting).count();
    println!("rows called cutting: {cutting} of {}", estimates.len());
    assert_eq!((right, edges > 300), (edges, true));
    assert!(matches!(tally.judge_visibility(), VisibilityVerdict::BelowVisibility { .. }));
    assert!(cutting as f64 <= 0.002 * estimates.len() as f64);
}

/// Rows by the machine's own label and our state.
fn print_states(recording: &Recording, estimates: &[Estimates]) {
    let labels = recording.find_words("motion").expect("recorded");
    let mut counts: BTreeMap<&str, [usize; 8]> = BTreeMap::new();
    for (row, it) in estimates.iter().enumerate() {
        counts.entry(labels.get(row).unwrap_or("")).or_default()[usize::from(it.state.to_code())] += 1;
    }
    print!("{:<14}", "motion");
    State::ALL.iter().for_each(|state| print!(" {:>13}", state.as_word()));
    println!();
    for (label, row) in counts {
        print!("{label:<14}");
        row.iter().for_each(|count| print!(" {count:>13}"));
        println!();
    }
}
