//! The script host: what scripts can do, what they cannot, and what happens when they fail.

mod backtest;
mod deciding;
mod declared;
mod failing;
mod kinds;
mod mad;
mod methods;
mod recipes;
mod reload;
mod shipped;
mod trials;
mod vocabulary;
mod wear;

use adapters::clock::SECOND_NS;
use adapters::{ChannelId, Sample, Slot, Value};
use rules::estimators::loads::LoadEstimator;
use rules::estimators::{Estimate, Estimates, State};
use rules::script::{Host, ScriptCondition, ScriptFile, ScriptProblem, compile_scripts};

fn file(name: &str, text: &str) -> ScriptFile {
    ScriptFile { name: name.to_owned(), text: text.to_owned() }
}

/// A host in which one script is in charge.
fn host(text: &str) -> Host {
    let mut host = Host::new();
    host.load_scripts(&[file("test.rhai", text)]).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    host
}

fn told(problems: &[ScriptProblem]) -> String {
    problems.iter().map(|problem| format!("{problem}\n")).collect()
}

fn sample(at_s: f64, values: &[(&str, f64)]) -> Sample {
    let mut sample = Sample::new_empty((at_s * SECOND_NS as f64) as i64);
    for (name, value) in values {
        let id = ChannelId::from_name(name).expect("a channel");
        sample.set_slot(id, Slot { value: Value::from_number(*value), age_ns: 0 });
    }
    sample
}

fn set_text(sample: &mut Sample, name: &str, text: &str) {
    let id = ChannelId::from_name(name).expect("a channel");
    sample.set_slot(id, Slot { value: Ok(Value::Text(text.into())), age_ns: 0 });
}

fn cutting(at_s: f64, power_w: f64) -> Estimates {
    let at_ns = (at_s * SECOND_NS as f64) as i64;
    let mut estimates = Estimates::without_samples(at_ns);
    estimates.state = State::Cutting;
    estimates.since_ns = 0;
    estimates.cutting_power_w = Ok(Estimate { value: power_w, sd: 5.0 });
    estimates
}

/// Runs ticks at 10 Hz and returns the names of raised (+) and cleared (-) alarms with their time.
fn alarms(host: &mut Host, channel: &str, values: &[f64]) -> Vec<String> {
    let mut changes = Vec::new();
    for (tick, value) in values.iter().enumerate() {
        let at_s = tick as f64 / 10.0;
        let decision = host.run_due_scripts(&sample(at_s, &[(channel, *value)]), &cutting(at_s, 100.0));
        assert!(decision.problems.is_empty(), "{}", told(&decision.problems));
        for change in &decision.alarms {
            changes.push(format!("{}{} at {at_s}", if change.raised { '+' } else { '-' }, change.name));
        }
    }
    changes
}

fn request(host: &mut Host, at_s: f64, values: &[(&str, f64)]) -> Option<f64> {
    host.run_due_scripts(&sample(at_s, values), &cutting(at_s, 100.0)).request.as_ref().map(|request| request.pct)
}

/// The same where the estimators see the load too.
fn request_with_loads(
    (host, loads): (&mut Host, &mut LoadEstimator),
    at_s: f64,
    values: &[(&str, f64)],
) -> Option<f64> {
    let (sample, mut estimates) = (sample(at_s, values), cutting(at_s, 100.0));
    loads.step(&sample, &mut estimates, host.settings());
    host.run_due_scripts(&sample, &estimates).request.as_ref().map(|request| request.pct)
}
