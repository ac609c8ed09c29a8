//! What a controller samples by itself reaches the tick: blocks, features, raw samples around what is remarkable, through a
//! real broker and through the library really loaded.

use crate::huazhong::hnc::library;
use crate::huazhong::stand::{Stand, address};
use adapters::{Fact, FactValue, Reading};
use std::time::{Duration, Instant};
use testkit::broker::Broker;
use testkit::port::free_port;
use testkit::process::{Gateway, get, program, wait_for};

fn fact(facts: &[Fact], name: &str) -> f64 {
    match facts.iter().find(|fact| fact.name == name).map(|fact| &fact.value) {
        Some(FactValue::Number(number)) => *number,
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn a_sample_channel_becomes_the_spindle_current_and_its_raw_samples_stay() {
    let Some(stand) = Stand::start() else { return };
    let directory = tempfile::tempdir().expect("a directory");
    let keep = format!("?sample=yes&keep={}&keep_above_a=0.05", directory.path().display());
    let opened = gateway::waveform::open_source(&address(stand.broker.port, &keep)).expect("sampled").expect("opens");
    let [mut samples, mut controller] = <[_; 2]>::try_from(opened.sources).ok().expect("samples before the controller");
    assert_eq!(samples.channels().len(), 1);
    let (mut readings, mut errors_a) = (Vec::<Reading>::new(), Vec::new());
    let end = Instant::now() + Duration::from_secs(25);
    let kept = || std::fs::read_dir(directory.path()).map_or(0, Iterator::count);
    while Instant::now() < end && (kept() == 0 || errors_a.len() < 25) {
        stand.read(controller.as_mut()).expect("read");
        readings.clear();
        samples.read(stand.clock.as_ref(), &mut readings).expect("samples come");
        for reading in &readings {
            let number = reading.value.as_ref().ok().and_then(|value| value.as_number()).expect("a number");
            let truth = stand.machine.moment(reading.stamp.mid_ns).electric.spindle_current_a;
            errors_a.push((number - truth).abs());
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    errors_a.sort_by(f64::total_cmp);
    let (facts, middle_a) = (samples.collect_facts(), errors_a[errors_a.len() / 2]);
    println!(
        "sampled current through the broker: {} readings, error in the middle {middle_a:.3} A, {} samples, {} missing, {} files",
        errors_a.len(),
        fact(&facts, "waveform_samples"),
        fact(&facts, "waveform_missing_samples"),
        kept()
    );
    assert!(middle_a < 0.3, "{errors_a:?}");
    assert!((fact(&facts, "waveform_rate_hz") - 1000.0).abs() < 1e-9);
    assert!(fact(&facts, "waveform_samples") > 3000.0);
    assert_eq!((fact(&facts, "waveform_missing_samples"), fact(&facts, "waveform_clipped_samples")), (0.0, 0.0));
    assert_eq!(kept(), 1, "raw samples around the current that stood out");
}

#[test]
fn samples_that_do_not_come_are_a_failure_and_not_an_old_value() {
    let Some(stand) = Stand::start() else { return };
    let opened =
        gateway::waveform::open_source(&address(stand.broker.port, "?sample=yes&spindle_axis=9")).expect("sampled");
    let mut sources = opened.expect("opens").sources;
    let (end, mut out) = (Instant::now() + Duration::from_secs(10), Vec::new());
    let error = loop {
        // The controller is not read at all: nobody hands blocks over.
        if let Err(error) = sources[0].read(stand.clock.as_ref(), &mut out) {
            break error;
        }
        assert!(Instant::now() < end && out.is_empty(), "{out:?}");
        std::thread::sleep(Duration::from_millis(100));
    };
    assert!(error.to_string().contains("sample channel"), "{error}");
}

/// Samples of the source `#samples` that the page knows of, and the spindle current at the tick.
fn sampled(page: &str) -> Option<(f64, f64)> {
    let status = get(page, "/api/v1/status").json();
    let named = |source: &&serde_json::Value| source["name"].as_str().is_some_and(|name| name.ends_with("#samples"));
    let facts = status["sources"].as_array()?.iter().find(named)?["facts"].as_array()?;
    let count = facts.iter().find(|fact| fact["name"] == "waveform_samples")?["value"].as_f64()?;
    let channels = status["channels"].as_array()?;
    let current = channels.iter().find(|channel| channel["name"] == "spindle_current_a")?;
    Some((count, current["value"].as_f64()?))
}

/// A box that reads this address, and its page.
fn box_of(address: &str) -> (tempfile::TempDir, Gateway, String) {
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("gateway.toml");
    std::fs::write(&file, format!("[[source]]\naddress = \"{address}\"\n")).expect("writable");
    let config = file.to_str().expect("a path");
    let mut gateway = Gateway::start(&directory.path().join("data"), &["--config", config]);
    let page = gateway.address();
    (directory, gateway, page)
}

#[test]
fn the_box_reads_what_a_served_machine_samples() {
    let Some(broker) = Broker::start() else { return };
    let at = format!("127.0.0.1:{}", broker.port);
    let mut device = program();
    device.args(["serve", "nclink", "--machine", "lathe", "--serial", "A8", "--broker", &at]);
    let mut device = Gateway::spawn(device);
    device.wait_said("serving nclink://");
    let (_directory, gateway, page) = box_of(&format!("nclink://{at}/A8?sample=yes"));
    let enough = || sampled(&page).filter(|(count, _)| *count > 1500.0);
    let (count, current_a) = wait_for("sampled current", Duration::from_secs(60), enough);
    println!("sampled current of a served machine: {count} samples, {current_a} A at the tick");
    gateway.stop();
    device.stop();
}

#[test]
fn the_box_reads_what_the_library_samples() {
    let library = library(&[]);
    let keys = format!("local_host=127.0.0.1&local_port={}&sample=yes&sample_scale_a=0.001", free_port());
    let address = format!("hncnet://192.0.2.1:10001?library={}&{keys}", library.file.display());
    let (_directory, gateway, page) = box_of(&address);
    // Type 6 of axis 5, as the library was told: 6005 of a thousandth of an ampere.
    let enough = || sampled(&page).filter(|(count, current_a)| *count > 1500.0 && (current_a - 6.005).abs() < 0.1);
    let (count, current_a) = wait_for("the sampled current", Duration::from_secs(60), enough);
    println!("sampled current through the library: {count} samples, {current_a} A at the tick");
    gateway.stop();
}
