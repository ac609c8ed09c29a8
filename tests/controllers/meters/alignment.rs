//! One time base through the real box: the lag of the simulated meter found, shown, stored and taken off; and what the box
//! says when it cannot know it.

use super::served::program;
use adapters::clock::{Clock, ManualClock};
use adapters::{ChannelId, Sample};
use gateway::alignment::AlignmentStatus;
use gateway::sources::open::{MachineSpeed, open_sources};
use rules::estimators::{Inference, Settings};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const TRUE_LAG_S: f64 = 0.237;
/// The spindle changes its speed when it moves by more than this within a tick, rpm.
const CHANGE_RPM: f64 = 15.0;

struct Outcome {
    status: Vec<AlignmentStatus>,
    /// Errors of the merged power against the truth in the second half while the speed changes, W.
    errors_w: Vec<f64>,
    /// Bits of every merged power, and every time: the same twice or not the same.
    fingerprint: u64,
    notices: Vec<String>,
}

impl Outcome {
    fn root_mean_square_w(&self) -> f64 {
        let count = f64::from(u32::try_from(self.errors_w.len()).expect("few")).max(1.0);
        (self.errors_w.iter().map(|error| error * error).sum::<f64>() / count).sqrt()
    }
}

/// Runs the box's own assembly and estimators as fast as possible for so many seconds of machine time.
fn outcome(text: &str, machine_s: i64) -> Outcome {
    let config = gateway::config::parse("alignment.toml", text, Path::new("/nowhere"), []).expect("a configuration");
    let clock: Arc<dyn Clock> = Arc::new(ManualClock::with_time(0));
    let mut opened = open_sources(&config, MachineSpeed::Max, &clock, 1_000_000_000_000).expect("opens");
    let mut estimators = Inference::new(Settings::default());
    let (mut sample, stop) = (Sample::new_empty(0), AtomicBool::new(false));
    let power = ChannelId::from_name("spindle_power_w").expect("a channel");
    let mut outcome = Outcome { status: Vec::new(), errors_w: Vec::new(), fingerprint: 0, notices: Vec::new() };
    let (mut before_rpm, mut first_ns) = (0.0, None);
    while let Some(now_ns) = opened.schedule.next_tick(&stop) {
        opened.feed.sample_into(&mut sample, now_ns);
        let state = estimators.update_with_sample(&sample).state;
        opened.feed.alignment_mut().record_state(sample.at_ns, state);
        outcome.notices.extend(opened.feed.alignment_mut().take_notices().into_iter().map(|notice| notice.operator));
        let passed_s = (now_ns - *first_ns.get_or_insert(now_ns)) / 1_000_000_000;
        let truth = opened.machines[0].truth(sample.at_ns);
        let changing = (truth.spindle_speed_rpm - before_rpm).abs() > CHANGE_RPM;
        before_rpm = truth.spindle_speed_rpm;
        if let Ok(number) = sample.number(power) {
            outcome.fingerprint = outcome.fingerprint.rotate_left(7) ^ number.to_bits() ^ sample.at_ns.unsigned_abs();
            if changing && passed_s > machine_s / 2 {
                outcome.errors_w.push(number - truth.spindle_power_w);
            }
        }
        if passed_s >= machine_s {
            break;
        }
    }
    outcome.status = opened.feed.alignment().build_status();
    outcome
}

fn lathe(purpose: &str) -> String {
    format!(
        "[alignment]\nspindle_power = \"{purpose}\"\n\
         [[source]]\naddress = \"simulated://lathe?meter_lag_ms=237&dropouts_per_h=0\"\n"
    )
}

#[test]
fn the_lag_is_found_within_its_width_and_taken_off() {
    let (shown, merged) = (outcome(&lathe("show"), 3600), outcome(&lathe("merge"), 3600));
    for (name, outcome) in [("show", &shown), ("merge", &merged)] {
        println!("{name}: {:?}", outcome.status[0]);
        println!("{name}: {:?}", outcome.notices);
    }
    let (before_w, behind_w) = (shown.root_mean_square_w(), merged.root_mean_square_w());
    println!(
        "merged spindle power against the truth while the speed changes: {before_w:.0} W before, {behind_w:.0} W with the \
         lag taken off (root mean square, {} samples)",
        merged.errors_w.len()
    );
    let status = &merged.status[0];
    let (lag_s, width_s) = (status.lag_s.expect("known"), status.uncertainty_s.expect("known"));
    assert!((lag_s - TRUE_LAG_S).abs() <= width_s.max(0.02), "{lag_s} +- {width_s}");
    assert!((status.applied_s - TRUE_LAG_S).abs() < 0.05, "{}", status.applied_s);
    assert_eq!(shown.status[0].applied_s, 0.0);
    assert!(behind_w < 0.6 * before_w, "{behind_w} of {before_w}");
    assert!(merged.notices.iter().any(|text| text.contains("will be put back")), "{:?}", merged.notices);
}

#[test]
fn the_same_readings_give_the_same_samples() {
    let prints = [(), ()].map(|()| outcome(&lathe("merge"), 900).fingerprint);
    assert_eq!(prints[0], prints[1]);
}

#[test]
fn the_meter_of_another_machine_is_never_believed() {
    let text = "[alignment]\nspindle_power = \"merge\"\n\
                [[source]]\naddress = \"simulated://lathe?device=controller\"\n\
                [[source]]\naddress = \"simulated://mill?seed=9&device=meter\"\n";
    let outcome = outcome(text, 3600);
    let status = &outcome.status[0];
    println!("{status:?}");
    assert_eq!((status.lag_s, status.applied_s), (None, 0.0));
    let why = status.why.as_deref().expect("a reason");
    assert!(status.missing.is_some() && !why.is_empty(), "{why}");
}

#[test]
fn the_box_shows_and_stores_the_lag() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = directory.path().join("box.toml");
    std::fs::write(&config, lathe("merge") + "[http]\nenabled = false\n").expect("written");
    let data = directory.path().join("data");
    let mut run = program();
    run.args(["run", "--speed", "max", "--for", "2400", "--config"]).arg(&config).arg("--data-dir").arg(&data);
    assert!(run.output().expect("runs").status.success());
    let query = |more: &[&str]| -> Value {
        let mut query = program();
        query.args(["history", "query", "--json", "--history"]).arg(data.join("history.db")).args(more);
        serde_json::from_slice(&query.output().expect("runs").stdout).expect("JSON")
    };
    let events = query(&["--records", "events"]).to_string();
    assert!(events.contains("lag_known") && events.contains("will be put back by"), "{events}");
    let last = |name: &str| {
        let series = query(&["--channels", name, "--from", "-10m"]);
        let points = series["series"][0]["points"].as_array().cloned().unwrap_or_default();
        points.iter().rev().find_map(|point| point[1].as_f64()).unwrap_or(f64::NAN)
    };
    for name in ["spindle_power_lag_s", "spindle_power_lag_applied_s"] {
        assert!((last(name) - TRUE_LAG_S).abs() < 0.05, "{name}: {}", last(name));
    }
}
