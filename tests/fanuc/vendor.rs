//! A library with the vendor's functions, compiled here and really loaded in the real child process.

use crate::support::{controller, number, poll, serve, text, value};
use adapters::address::{Endpoint, FanucOptions};
use adapters::clock::SystemClock;
use adapters::fanuc::focas::Focas;
use adapters::fanuc::item::{Area, Item, Stretch, Write};
use adapters::fanuc::line::Connect;
use adapters::fanuc::open::{OpenedFanuc, opened};
use adapters::fanuc::server::ServerSettings;
use adapters::fanuc::vendor::{Vendor, VendorSettings};
use adapters::{Absence, Reading};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The library in a directory of its own, and the file that tells it which fault to have.
pub(crate) struct Library {
    _directory: TempDir,
    pub(crate) file: PathBuf,
    fault: PathBuf,
}

impl Library {
    pub(crate) fn build(flags: &[&str]) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let (file, fault) = (directory.path().join("libfake.so"), directory.path().join("fault"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fanuc/fake_library.c");
        let built = Command::new("cc")
            .args(["-shared", "-fPIC", "-O1", "-w"])
            .args(flags)
            .arg("-o")
            .arg(&file)
            .arg(source)
            .status();
        assert!(built.expect("a C compiler").success());
        Self { _directory: directory, file, fault }
    }

    fn fault(&self, text: &str) {
        std::fs::write(&self.fault, text).expect("written");
    }

    fn well(&self) {
        let _was_well = std::fs::remove_file(&self.fault);
    }

    pub(crate) fn settings(&self) -> VendorSettings {
        VendorSettings {
            vendor_library: self.file.clone(),
            at: Endpoint { host: "192.0.2.1".to_owned(), port: 8193 },
            path: 1,
            timeout: Duration::from_secs(1),
            deadline: Some(Duration::from_millis(1500)),
            program: Some(PathBuf::from(env!("CARGO_BIN_EXE_cnc-gateway"))),
            environment: vec![("FAKE_LIBRARY_FAULT".to_owned(), self.fault.display().to_string())],
        }
    }

    fn opened(&self) -> OpenedFanuc {
        let settings = self.settings();
        let connect: Connect = Box::new(move || Ok(Box::new(Vendor::connect(settings.clone())?)));
        opened("fanuc://fake", connect, 1, &FanucOptions { duty_pct: 100, ..FanucOptions::default() })
    }
}

fn cut(readings: &[Reading]) {
    let numbers = [
        ("spindle_speed_rpm", 1200.0),
        ("spindle_programmed_rpm", 1200.0),
        ("feed_mm_min", 240.0),
        ("feed_programmed_mm_min", 250.0),
        ("feed_override_pct", 80.0),
        ("spindle_override_pct", 100.0),
        ("spindle_load_pct", 41.0),
        ("drive_on", 1.0),
    ];
    for (channel, expected) in numbers {
        assert_eq!(number(readings, channel), expected, "{channel}");
    }
    assert_eq!((text(readings, "mode"), text(readings, "execution")), ("AUTOMATIC".into(), "ACTIVE".into()));
    assert_eq!((text(readings, "program"), text(readings, "block")), ("O1001".into(), "N120".into()));
}

#[test]
fn the_library_gives_the_values_that_the_wire_gives() {
    let library = Library::build(&[]);
    let mut opened = library.opened();
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    cut(&readings);
    assert_eq!((number(&readings, "x_axis_position_mm"), number(&readings, "z_axis_position_mm")), (79.0, -12.345));
    assert_eq!(number(&readings, "z_axis_load_pct"), 17.0, "the library loses the sign");
    assert_eq!(value(&readings, "z_axis_current_a"), Err(Absence::NotSupported), "the function is not there");
    let slow = poll(opened.sources[1].as_mut()).expect("answers");
    assert_eq!((number(&slow, "part_count"), number(&slow, "gear_stage")), (17.0, 2.0));
    let facts = opened.sources[0].facts();
    assert!(facts.contains(&adapters::driver::Fact::text("series", "G421")), "{facts:?}");

    let server = serve(controller(4), ServerSettings::default());
    let native = poll(crate::support::opened(&server, "").sources[0].as_mut()).expect("answers");
    let differing =
        ["x_axis_load_pct", "z_axis_load_pct", "x_axis_current_a", "z_axis_current_a", "motor_temperature_c"];
    for (ours, theirs) in native.iter().zip(&readings).filter(|(ours, _)| !differing.contains(&ours.channel.name())) {
        assert_eq!((ours.channel, &ours.value), (theirs.channel, &theirs.value));
    }
}

#[test]
fn a_library_without_a_function_lacks_its_channels_only() {
    let library = Library::build(&["-DWITHOUT_SERVO_METER"]);
    let mut opened = library.opened();
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    cut(&readings);
    assert_eq!(value(&readings, "z_axis_load_pct"), Err(Absence::NotSupported));
    assert_eq!(value(&readings, "z_axis_position_mm"), Err(Absence::NotSupported), "no function names the axes");
}

#[test]
fn a_code_other_than_zero_never_shows_what_was_scribbled() {
    let library = Library::build(&[]);
    let mut opened = library.opened();
    let cases = [(-1, Absence::Refused), (6, Absence::NotSupported)];
    for (code, expected) in cases {
        library.fault(&format!("code cnc_acts {code}"));
        let readings = poll(opened.sources[0].as_mut()).expect("the others flow");
        assert_eq!(value(&readings, "spindle_speed_rpm"), Err(expected), "code {code}");
        assert_eq!(number(&readings, "feed_mm_min"), 240.0);
    }
    library.fault("code cnc_actf -16");
    assert!(poll(opened.sources[0].as_mut()).is_err(), "the connection is dead");
    library.well();
    cut(&poll(opened.sources[0].as_mut()).expect("a new connection"));
}

/// A fault in one function: the channel has a reason, the others flow, in the same poll; afterwards all is well.
fn survives(library: &Library, kind: &str, within: Duration) {
    let mut opened = library.opened();
    cut(&poll(opened.sources[0].as_mut()).expect("well before"));
    library.fault(&format!("{kind} cnc_rdspmeter"));
    let began = Instant::now();
    let readings = poll(opened.sources[0].as_mut()).expect("the others flow");
    let took = began.elapsed();
    println!("{kind}: one channel lost, 25 others in the same poll, which took {} ms", took.as_millis());
    assert_eq!(value(&readings, "spindle_load_pct"), Err(Absence::OutOfRange), "{kind}");
    assert_eq!((number(&readings, "spindle_speed_rpm"), text(&readings, "program")), (1200.0, "O1001".into()));
    assert!(took < within, "{kind}: the child was back after {took:?}");
    library.well();
    cut(&poll(opened.sources[0].as_mut()).expect("well afterwards"));
    library.fault(&format!("{kind} cnc_rdspmeter"));
    poll(opened.sources[0].as_mut()).expect("the second time");
    let began = Instant::now();
    let readings = poll(opened.sources[0].as_mut()).expect("left alone by now");
    assert_eq!(value(&readings, "spindle_load_pct"), Err(Absence::NotSupported));
    assert!(began.elapsed() < Duration::from_secs(1), "no child is risked for it any more");
    library.well();
}

#[test]
fn a_library_that_hangs_costs_one_channel() {
    survives(&Library::build(&[]), "hang", Duration::from_secs(5));
}

#[test]
fn a_library_that_aborts_costs_one_channel() {
    survives(&Library::build(&[]), "abort", Duration::from_secs(5));
}

#[test]
fn a_library_that_overruns_its_structure_costs_one_channel() {
    survives(&Library::build(&[]), "overrun", Duration::from_secs(5));
}

#[test]
fn what_cannot_be_loaded_or_connected_says_so() {
    let library = Library::build(&[]);
    let refused = |settings| Vendor::connect(settings).err().map(|error| error.to_string()).unwrap_or_default();
    let absent = VendorSettings { vendor_library: "/does/not/exist.so".into(), ..Library::settings(&library) };
    let text = refused(absent);
    assert!(text.contains("/does/not/exist.so"), "{text}");
    library.fault("code cnc_allclibhndl3 -16");
    assert!(refused(library.settings()).contains("does not answer"));
    library.fault("abort cnc_allclibhndl3");
    let text = refused(library.settings());
    assert!(text.contains("ended") && text.contains("signal"), "{text}");
    library.fault("hang cnc_allclibhndl3");
    assert!(refused(library.settings()).contains("killed"));
}

#[test]
fn what_is_written_is_read_back_through_the_library() {
    let library = Library::build(&[]);
    let mut vendor = Vendor::connect(library.settings()).expect("connects");
    let stretch = Stretch::bytes(Area::R, 900, 3);
    vendor.write(&Write::Pmc { stretch, values: vec![0xA5, 80, 7] }).expect("written");
    vendor.write(&Write::Macro { number: 500, mantissa: -25, places: 1 }).expect("written");
    let mut out = Vec::new();
    vendor.ask(&[Item::Pmc(stretch), Item::Macro(500)], &mut out).expect("answers");
    let expected = [
        adapters::fanuc::answer::Answer::Memory(vec![0xA5, 80, 7]),
        adapters::fanuc::answer::Answer::Number(Some(-2.5)),
    ];
    assert_eq!(out.into_iter().map(|result| result.expect("a value")).collect::<Vec<_>>(), expected);
}

/// Files and children of this process.
fn own() -> (usize, usize) {
    let files = std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count);
    let me = std::process::id().to_string();
    let processes = std::fs::read_dir("/proc").expect("readable").flatten();
    let parent = |path: PathBuf| {
        let text = std::fs::read_to_string(path.join("stat")).ok()?;
        text.rsplit_once(')')?.1.split_whitespace().nth(1).map(str::to_owned)
    };
    (files, processes.filter_map(|entry| parent(entry.path())).filter(|parent| *parent == me).count())
}

fn cycles(count: u32) {
    let library = Library::build(&[]);
    let clock = SystemClock::new();
    let (before, began) = (own(), Instant::now());
    for cycle in 0..count {
        let mut opened = library.opened();
        library.fault(["abort cnc_acts", "overrun cnc_statinfo", "code cnc_actf -16"][cycle as usize % 3]);
        let mut out = Vec::new();
        let _typed = opened.sources[0].read(&clock, &mut out);
        library.well();
        assert_eq!(number(&poll(opened.sources[0].as_mut()).expect("well again"), "spindle_load_pct"), 41.0);
    }
    let after = own();
    println!(
        "{count} cycles with a dying library in {:.1} s: files and children {before:?} before, {after:?} after",
        began.elapsed().as_secs_f64()
    );
    assert!(after.0 <= before.0 + 60 && after.1 <= before.1 + 12, "other tests run beside this one; a leak is more");
}

#[test]
fn nothing_is_left_of_dying_children() {
    cycles(150);
}

/// `cargo test --test fanuc thousand -- --ignored --nocapture`
#[test]
#[ignore = "a quarter of a minute alone"]
fn nothing_is_left_of_a_thousand_cycles() {
    cycles(1000);
}
