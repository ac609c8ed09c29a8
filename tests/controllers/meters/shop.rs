//! Meters as they stand in shops, played by pymodbus: one client only, short answers, holes, other byte orders, no values, and
//! the wrong profile.

use super::partner::{near, number, poll, pymodbus_is_there, shop, source};
use adapters::clock::{Clock, SystemClock};
use adapters::merge::{Delay, Merge, SourceId, SourcePlan};
use adapters::{Absence, ChannelId, Reading, Sample, Source};
use serde_json::{Value, json};
use std::path::Path;
use testkit::port::free_port;

/// The registers of an SDM630 by its maker's list, of a meter that takes 1200 W.
fn sdm630() -> Value {
    json!([
        [0x00, "f", 229.0],
        [0x02, "f", 230.0],
        [0x04, "f", 231.0],
        [0x06, "f", 3.0],
        [0x08, "f", 4.0],
        [0x0A, "f", 5.0],
        [0x0C, "f", 400.0],
        [0x0E, "f", 400.0],
        [0x10, "f", 400.0],
        [0x34, "f", 1200.0],
    ])
}

fn address(port: u16, keys: &str) -> String {
    format!("modbus-tcp://127.0.0.1:{port}?timeout_ms=3000&{keys}")
}

fn readings(meter: &mut dyn Source) -> Vec<Reading> {
    poll(meter).unwrap_or_else(|error| panic!("{error}"))
}

fn absence(readings: &[Reading], channel: &str) -> Absence {
    let found = readings.iter().find(|reading| reading.channel.name() == channel);
    found.unwrap_or_else(|| panic!("no {channel}")).value.clone().expect_err("absent")
}

/// A profile in a directory of its own.
fn profile(directory: &Path, name: &str, text: &str) -> String {
    std::fs::write(directory.join(format!("{name}.toml")), text).expect("written");
    format!("profile={name}&profiles={}", directory.display())
}

/// The text of a profile with this line in its head.
fn with_head(head: &str, values: &[(&str, u16, &str, &str)]) -> String {
    let mut text = format!("format = \"meter/1\"\nmeter = \"own\"\nregisters = \"input\"\n{head}\n");
    for (quantity, address, format, unit) in values {
        let place = format!("address = {address}\ntype = \"{format}\"\nunit = \"{unit}\"\n");
        text.push_str(&format!("[[value]]\nquantity = \"{quantity}\"\n{place}"));
    }
    text
}

#[test]
fn three_units_behind_a_converter_for_one_client() {
    if !pymodbus_is_there() {
        return;
    }
    let (port, behind) = (free_port(), free_port());
    let unit = |watts: f64| {
        json!([
            [0, "f", 230.0],
            [2, "f", 230.0],
            [4, "f", 230.0],
            [6, "f", 3.0],
            [8, "f", 3.0],
            [10, "f", 3.0],
            [12, "f", watts / 3.0],
            [14, "f", watts / 3.0],
            [16, "f", watts / 3.0],
            [52, "f", watts]
        ])
    };
    let meters =
        json!({"units": {"1": unit(300.0), "2": unit(600.0), "3": unit(900.0)}, "one_client": true, "behind": behind});
    let _shop = shop("tcp", port, &meters);
    let mut sources: Vec<_> =
        (1..=3).map(|unit| source(&address(port, &format!("unit={unit}&profile=sdm630")))).collect();
    let mut polls = 0;
    for _ in 0..50 {
        for (at, meter) in (1..).zip(&mut sources) {
            near(&readings(meter.as_mut()), "total_power_w", 300.0 * f64::from(at));
            polls += 1;
        }
    }
    println!("{polls} polls of three units over one connection, none failed");
}

#[test]
fn a_meter_that_gives_fifty_registers_at_once_and_one_with_holes() {
    if !pymodbus_is_there() {
        return;
    }
    for (what, more) in
        [("most", json!({"most": 50})), ("most 2", json!({"most": 50, "code": 2})), ("holes", json!({"holes": true}))]
    {
        let port = free_port();
        let mut meters = json!({"units": {"1": sdm630()}});
        meters.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
        let _shop = shop("tcp", port, &meters);
        let mut meter = source(&address(port, "profile=sdm630&circuit=spindle"));
        for _ in 0..3 {
            let readings = readings(meter.as_mut());
            near(&readings, "spindle_power_w", 1200.0);
            near(&readings, "spindle_current_a", 4.0);
            near(&readings, "supply_voltage_v", 398.371_686_5);
        }
        let facts = meter.collect_facts();
        let requests = facts.iter().find(|fact| fact.name == "requests_per_poll").map(|fact| fact.value.clone());
        println!("{what}: read right, {requests:?} requests per poll");
        assert!(requests.is_some() && meter.list_problems().is_empty(), "{what}: {:?}", meter.list_problems());
    }
}

#[test]
fn every_order_of_bytes_and_rtu_frames_over_tcp() {
    if !pymodbus_is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    for (order, carrier) in
        [("badc", "tcp"), ("cdab", "tcp"), ("dcba", "tcp"), ("abcd", "rtu-over-tcp"), ("badc", "rtu-over-tcp")]
    {
        let port = free_port();
        let _shop = shop(carrier, port, &json!({"units": {"1": sdm630()}, "order": order}));
        let text = with_head(
            &format!("word_order = \"{order}\""),
            &[("power", 52, "f32", "W"), ("voltage_l1", 0, "f32", "V"), ("current_l1", 6, "f32", "A")],
        );
        let name = profile(directory.path(), &format!("own_{order}"), &text);
        let framing = if carrier == "tcp" { "tcp" } else { "rtu" };
        let mut meter = source(&address(port, &format!("{name}&framing={framing}")));
        for _ in 0..20 {
            near(&readings(meter.as_mut()), "total_power_w", 1200.0);
        }
    }
}

#[test]
fn numbers_that_stand_for_no_value_are_none() {
    if !pymodbus_is_there() {
        return;
    }
    let port = free_port();
    let cells = json!([
        [100, "I", 0x7FFF_FFFFu32],
        [102, "I", 0x8000_0000u32],
        [104, "H", 0xFFFF],
        [105, "h", -32768],
        [106, "i", -296],
        [108, "I", 0xFFFF_FED8u32],
        [112, "H", 0x7FFF]
    ]);
    let _shop = shop("tcp", port, &json!({"units": {"1": cells}}));
    let directory = tempfile::tempdir().expect("a directory");
    let read = |name: &str, values: &[(&str, u16, &str, &str)]| {
        let keys = profile(directory.path(), name, &with_head("", values));
        readings(source(&address(port, &keys)).as_mut())
    };
    for (name, address, format) in [("a", 100, "i32"), ("b", 102, "i32")] {
        let readings = read(name, &[("power", address, format, "W")]);
        assert_eq!(absence(&readings, "total_power_w"), Absence::NotSupported, "{name}");
    }
    near(&read("c", &[("power", 106, "i32", "W")]), "total_power_w", -296.0);
    // A negative number read without its sign is 429 MW: never a value.
    let unsigned = read("d", &[("power", 108, "u32", "kW")]);
    assert_eq!(absence(&unsigned, "total_power_w"), Absence::OutOfRange);
    assert!(unsigned[0].implausible.is_some_and(|number| number > 4e9));
    let text =
        with_head("", &[("power", 112, "u16", "W")]).replace("unit = \"W\"\n", "unit = \"W\"\nno_value = [0x7FFF]\n");
    let keys = profile(directory.path(), "e", &text);
    assert_eq!(absence(&readings(source(&address(port, &keys)).as_mut()), "total_power_w"), Absence::NotSupported);
}

#[test]
fn the_inputs_that_integrators_wrote_are_read_right_or_refused_with_the_reason() {
    let head = "format = \"meter/1\"\nmeter = \"x\"\nregisters = \"holding\"\n";
    let value = |quantity: &str, address: u16, format: &str, unit: &str| {
        format!("[[value]]\nquantity = \"{quantity}\"\naddress = {address}\ntype = \"{format}\"\nunit = \"{unit}\"\n")
    };
    let parsed = |text: &str| adapters::modbus::profile::parse("x", "x.toml", text);
    let refused = |text: &str| parsed(text).expect_err("refused").to_string();
    // An address as in the manual is not guessed.
    let manual = value("power", 40_053, "f32", "W");
    let told = refused(&format!("{head}{manual}"));
    assert!(told.contains("addresses = \"manual\"") && told.contains("52"), "{told}");
    let register = &parsed(&format!("{head}addresses = \"manual\"\n{manual}")).expect("usable").registers[0];
    assert_eq!((register.address, register.table), (52, adapters::modbus::pdu::RegisterTable::Holding));
    let register = &parsed(&format!("{head}addresses = \"protocol\"\n{manual}")).expect("usable").registers[0];
    assert_eq!(register.address, 40_053);
    // Energy is a quantity; the name with its unit gets a suggestion.
    assert!(parsed(&format!("{head}{}", value("energy", 342, "u32", "kWh"))).is_ok());
    assert!(refused(&format!("{head}{}", value("energy_kwh", 342, "u32", "kWh"))).contains("did you mean energy?"));
    // One register with two meanings.
    let twice = format!("{head}{}{}", value("power", 52, "f32", "W"), value("current_l1", 53, "u16", "A"));
    assert!(refused(&twice).contains("value 2 reads register 53 a second time"), "{}", refused(&twice));
    assert!(parsed(&format!("{head}word_order = \"badc\"\n{}", value("power", 52, "f32", "W"))).is_ok());
    assert!(refused(&format!("{head}word_order = \"bdac\"\n{}", value("power", 52, "f32", "W"))).contains("badc"));
}

/// Samples of a meter at 50 Hz while it is polled every 100 ms, as the gateway makes them.
fn merged(meter: &mut dyn Source, polls: u32, channel: &str) -> (Vec<f64>, u32, u32) {
    let clock = SystemClock::new();
    let id = ChannelId::from_name(channel).expect("in the table");
    let mut merge = Merge::new(&[SourcePlan::from_source(meter)], Delay::SlowestPeriod);
    let (mut sample, mut seen, mut absent, mut doubted) = (Sample::new_empty(0), Vec::new(), 0, 0);
    let begun_ns = clock.now_ns();
    for at in 0..polls * 5 {
        clock.sleep_until(begun_ns + i64::from(at) * 20_000_000);
        if at.is_multiple_of(5) {
            let mut readings = Vec::new();
            meter.read(&clock, &mut readings).unwrap_or_else(|error| panic!("{error}"));
            doubted += readings.iter().map(|reading| u32::from(reading.implausible.is_some())).sum::<u32>();
            merge.push_all(SourceId(0), &mut readings);
        }
        merge.sample_into(&mut sample, clock.now_ns() - merge.delay_ns());
        match sample.number(id) {
            Ok(number) => seen.push(number),
            Err(Absence::NotYetRead) => {}
            Err(_) => absent += 1,
        }
    }
    (seen, absent, doubted)
}

#[test]
fn zeros_for_one_poll_make_no_value_that_was_never_measured() {
    if !pymodbus_is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    for (what, keys) in [
        ("with voltage", "profile=sdm630".to_owned()),
        ("power alone", profile(directory.path(), "alone", &with_head("", &[("power", 52, "f32", "W")]))),
    ] {
        let port = free_port();
        let _shop = shop("tcp", port, &json!({"units": {"1": sdm630()}, "zero_reads": [10, 20]}));
        let mut meter = source(&address(port, &keys));
        let (seen, absent, doubted) = merged(meter.as_mut(), 30, "total_power_w");
        let invented: Vec<&f64> = seen.iter().filter(|watts| **watts != 1200.0 && **watts != 0.0).collect();
        println!(
            "{what}: {} merged values, {} invented, {absent} absent, {doubted} readings not believed",
            seen.len(),
            invented.len()
        );
        assert!(invented.is_empty(), "{what}: {invented:?}");
        if what == "with voltage" {
            assert!(seen.iter().all(|watts| *watts == 1200.0) && doubted == 4, "{what}: zero was no value");
        }
    }
}

#[test]
fn the_wrong_profile_is_told_and_gives_no_value() {
    if !pymodbus_is_there() {
        return;
    }
    let port = free_port();
    let _shop = shop("tcp", port, &json!({"units": {"1": sdm630(), "2": []}}));
    // Made for a meter whose registers are elsewhere: everything there is zero, or halves of other numbers.
    for profile in ["pac", "iem3000", "adl400", "pm5xxx"] {
        let mut meter = source(&address(port, &format!("profile={profile}")));
        let readings = readings(meter.as_mut());
        let values: Vec<&Reading> = readings.iter().filter(|reading| reading.value.is_ok()).collect();
        let problems = meter.list_problems();
        println!("{profile}: {} values, {problems:?}", values.len());
        assert!(values.is_empty() && !problems.is_empty(), "{profile}: {values:?}");
    }
    let mut zeros = source(&address(port, "profile=sdm630&unit=2"));
    let readings = readings(zeros.as_mut());
    assert!(readings.iter().all(|reading| reading.value.is_err()), "{readings:?}");
    assert!(zeros.list_problems()[0].what.contains("no supply voltage"), "{:?}", zeros.list_problems());
    // The right one among the shipped ones is found.
    let mut meter = source(&address(port, "profile=pac"));
    let offers = meter.list_offers(&SystemClock::new()).expect("tries them");
    let fitting: Vec<&str> =
        offers.iter().filter(|offer| offer.says.is_ok()).map(|offer| offer.name.as_str()).collect();
    println!("profiles that fit: {fitting:?}");
    assert!(fitting.contains(&"profile=sdm630") && !fitting.contains(&"profile=pac"), "{offers:?}");
}

#[test]
fn own_channels_are_read_beside_a_profile() {
    if !pymodbus_is_there() {
        return;
    }
    let port = free_port();
    let mut cells = sdm630();
    cells.as_array_mut().expect("a list").extend([json!([70, "f", 50.02]), json!([300, "h", -125])]);
    let _shop = shop("tcp", port, &json!({"units": {"1": cells}}));
    let text = format!(
        "[[source]]\naddress = \"{}\"\n\
         [[source.channel]]\nname = \"supply_frequency_hz\"\nread = \"input 70 f32\"\n\
         [[source.channel]]\nname = \"shop_own_c\"\nread = \"holding 300 i16\"\nquantity = \"temperature\"\nscale = 0.1\n",
        address(port, "profile=sdm630")
    );
    let config = gateway::config::parse("t.toml", &text, Path::new("."), [])
        .unwrap_or_else(|problems| panic!("{}", problems[0]));
    let opened = adapters::open::open_address(&config.sources[0].address, 0).unwrap_or_else(|error| panic!("{error}"));
    let mut meter = opened.sources.into_iter().next().expect("one");
    let readings = readings(meter.as_mut());
    near(&readings, "total_power_w", 1200.0);
    assert!((number(&readings, "supply_frequency_hz") - 50.02).abs() < 1e-4);
    assert_eq!(number(&readings, "shop_own_c"), -12.5);
}
