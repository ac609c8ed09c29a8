//! Shifts of axes: by registers that the ladder reads, over both roads, and by the external zero offset; between programs
//! only, read back, given back, refused in words.

use crate::huazhong::hnc::{library, line};
use crate::huazhong::stand::{Stand, address, until};
use adapters::SourceError;
use adapters::address::{Address, HncOffset, Target};
use adapters::clock::SystemClock;
use adapters::nclink::RequestedItem;
use adapters::nclink::connection::Connection;
use adapters::offset::{Axis, OffsetSink};
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::words::{execution, mode};
use serde_json::{Value, json};
use std::time::Duration;
use testkit::broker::Broker;
use testkit::process::{Gateway, get, program, run, stderr, text, wait_for};
use testkit::served::{armed, prepared, started};

const REGISTERS: &str = "/CONTROLLER/VARIABLE@REG_D";

/// When the simulated lathe stands in automatic between two programs for the next half a minute, s after it was switched
/// on.
fn between_programs_s() -> i64 {
    let machine = Simulated::new("simulated://lathe", SimulatedSettings::default(), 0);
    let mut stands_s = 0;
    for second in 1..3600 {
        let panel = machine.moment(second * 1_000_000_000).panel;
        let between = [execution::READY, execution::PROGRAM_COMPLETED].contains(&panel.execution);
        stands_s = if panel.booted && between && panel.mode == mode::AUTOMATIC { stands_s + 1 } else { 0 };
        if stands_s >= 30 {
            return second - stands_s + 1;
        }
    }
    panic!("the lathe works without a pause");
}

fn offsets(port: u16, keys: &str) -> Box<dyn OffsetSink> {
    let opened = adapters::open::open_address(&address(port, keys), 0).expect("opens");
    opened.offsets.expect("the address names registers")
}

/// The eight registers as any client sees them.
fn words(connection: &mut Connection) -> Vec<Value> {
    let indexes: Vec<u32> = (110..118).collect();
    let answers = connection.query_values(&[RequestedItem::with_elements(REGISTERS, &indexes)]).expect("answered");
    answers.into_iter().next().flatten().expect("an answer").expect("values")
}

#[test]
fn a_shift_goes_through_the_ladder_of_an_nclink_device_and_is_given_back() {
    let Some(mut stand) = Stand::on_for(between_programs_s()) else { return };
    let clock = stand.clock.clone();
    stand.machine.set_offset(Axis::Z, 40.0);
    let mut sink = offsets(stand.broker.port, "?offset=D110");
    assert_eq!(sink.at_rest(clock.as_ref(), Axis::Z), Ok(0.0), "what the operator has set is elsewhere");
    assert_eq!(sink.write(clock.as_ref(), Axis::Z, 0.0, -7.4), Ok(-7.0));
    assert_eq!(stand.machine.offset_um(Axis::Z), 33.0, "on what the operator had set");
    let expected = [0, 0, -7, 1, 0, 0, -7, 1].map(|word| json!(word));
    assert_eq!(words(&mut stand.connect()), expected);
    // A line that breaks is told, and afterwards it is seen what is in force.
    stand.broker.kill();
    let error = sink.write(clock.as_ref(), Axis::Z, -7.0, 0.0).expect_err("no broker");
    assert!(matches!(error, SourceError::Line { .. }), "{error}");
    stand.broker.run();
    stand.device.wait(2);
    assert_eq!(until("read again", || sink.at_rest(clock.as_ref(), Axis::Z).ok()), -7.0);
    assert_eq!(sink.write(clock.as_ref(), Axis::Z, -7.0, 0.0), Ok(0.0));
    assert_eq!(stand.machine.offset_um(Axis::Z), 40.0);
}

#[test]
fn while_a_program_runs_no_register_of_a_device_is_written() {
    let Some(stand) = Stand::start() else { return };
    let write = |keys: &str| {
        let outcome = offsets(stand.broker.port, keys).write(stand.clock.as_ref(), Axis::X, 0.0, 5.0);
        outcome.expect_err(keys).to_string()
    };
    let error = write("?offset=D110");
    assert!(error.contains("a program runs") && error.contains("between two programs"), "{error}");
    assert!(words(&mut stand.connect()).iter().all(|word| *word == 0));
    // Registers that no rungs read, on a control that lies about its state: the letter is withdrawn.
    let error = write("?offset=D120&f_channel=0");
    assert!(error.contains("D120 to D127") && error.contains("rungs"), "{error}");
    let error = write("?offset=D195&f_channel=0");
    assert!(error.contains("D195 to D202 cannot be read"), "{error}");
}

#[test]
fn the_library_shifts_by_registers_of_the_ladder() {
    let (library, clock) = (library(&[]), SystemClock::new());
    let first = "D110".parse().expect("a register");
    let mut sink = adapters::hnc::build_offset_sink(&line(&library), HncOffset::Registers(first));
    let error = sink.write(&clock, Axis::Y, 0.0, -12.0).expect_err("the mill cuts").to_string();
    assert!(error.contains("a program runs"), "{error}");
    library.fault("deaf HNC_RegSetValue");
    let error = sink.write(&clock, Axis::Y, 0.0, -12.0).expect_err("no rungs").to_string();
    assert!(error.contains("no ladder takes the letter in D110 to D117"), "{error}");
    library.fault("rest HNC_ChannelGetValue");
    assert_eq!(sink.at_rest(&clock, Axis::Y), Ok(0.0));
    assert_eq!(sink.write(&clock, Axis::Y, 0.0, -12.0), Ok(-12.0));
    assert_eq!(sink.at_rest(&clock, Axis::X), Ok(0.0));
    assert_eq!(sink.write(&clock, Axis::Y, -12.0, 0.0), Ok(0.0));
    library.fault("later HNC_RegGetValue");
    let error = sink.at_rest(&clock, Axis::Y).expect_err("not there yet").to_string();
    assert!(error.contains("D110 to D117 cannot be read"), "{error}");
}

#[test]
fn the_library_shifts_the_external_zero_offset_where_its_count_is_known() {
    let (known, clock) = (library(&[]), SystemClock::new());
    let at_rest =
        |unit_um| adapters::hnc::build_offset_sink(&line(&known), HncOffset::Zero { unit_um }).at_rest(&clock, Axis::Z);
    let error = at_rest(0.01).expect_err("the mill cuts").to_string();
    assert!(error.contains("a program runs"), "{error}");
    known.fault("rest HNC_ChannelGetValue");
    let error = at_rest(1.0).expect_err("another unit").to_string();
    assert!(error.contains("0.01 µm for the control and 1 µm in the address"), "{error}");
    let line = line(&known);
    let mut sink = adapters::hnc::build_offset_sink(&line, HncOffset::Zero { unit_um: 0.01 });
    assert_eq!(sink.at_rest(&clock, Axis::Z), Ok(40.0));
    assert_eq!(sink.write(&clock, Axis::Z, 40.0, 45.0), Ok(45.0));
    line.write_zero(2, 10_000).expect("the operator sets it anew");
    let error = sink.write(&clock, Axis::Z, 45.0, 46.0).expect_err("another one").to_string();
    assert!(error.contains("somebody has just changed it"), "{error}");
    known.fault("code HNC_CrdsSetValue -1");
    sink.write(&clock, Axis::Z, 100.0, 101.0).expect_err("a program runs, and it is refused");
    known.fault("rest HNC_ChannelGetValue");
    assert_eq!(sink.write(&clock, Axis::Z, 100.0, 94.0), Ok(94.0));
    line.write_zero(2, 10_030).expect("the operator sets it anew");
    let error = sink.at_rest(&clock, Axis::Z).expect_err("not whole").to_string();
    assert!(error.contains("100.3 µm, which is not whole"), "{error}");
    let without = library(&["-DWITHOUT_CRDS"]);
    without.fault("rest HNC_ChannelGetValue");
    let mut sink =
        adapters::hnc::build_offset_sink(&crate::huazhong::hnc::line(&without), HncOffset::Zero { unit_um: 0.01 });
    let error = sink.at_rest(&clock, Axis::Z).expect_err("an old library").to_string();
    assert!(error.contains("HNC_CrdsGetValue") && error.contains("offset=D110"), "{error}");
}

#[test]
fn without_offset_in_the_address_there_is_no_way_to_shift_anything() {
    for text in ["nclink://127.0.0.1:1/A?write=mailbox", "hncnet://192.0.2.1?library=x.so&write=mailbox"] {
        let opened = adapters::open::open_address(&text.parse::<Address>().expect("usable"), 0).expect("opens");
        assert!(opened.offsets.is_none() && opened.actuator.is_some(), "{text}");
    }
    let address: Address = "hncnet://192.0.2.1?library=x.so&offset=D110".parse().expect("usable");
    let Target::HncNet(target) = address.target() else { panic!("hncnet") };
    assert!(adapters::hnc::open_address(address.text(), target).offsets.is_some());
}

const SCRIPT: &str = "propose_offset_um(\"z\", 7.3, \"thermal error\");";

fn sections(address: &str, mode: &str) -> String {
    format!(
        "[[source]]\naddress = \"{address}\"\nname = \"lathe\"\n[gate]\nstale_s = 2.0\n[gate.offset]\n\
         mode = \"{mode}\"\nsource = \"lathe\"\naxes = \"z\"\nmin_interval_s = 1.0\n"
    )
}

fn offset(page: &str) -> Value {
    get(page, "/api/v1/status").json()["gate"]["offset"]["axes"][0].clone()
}

/// Two programs: a served NC-Link device and the box. Advice only, until the address and the gate say otherwise.
#[test]
fn a_box_advises_only_and_shifts_a_served_device_where_it_is_configured() {
    let Some(broker) = Broker::start() else { return };
    let at = format!("127.0.0.1:{}", broker.port);
    let mut device = program();
    let machine = format!("simulated://lathe?begun_s={}", between_programs_s());
    device.args(["serve", "nclink", "--machine", &machine, "--serial", "A9", "--broker", &at]);
    let mut device = Gateway::spawn(device);
    device.wait_said("for offsets: D110");
    let directory = tempfile::tempdir().expect("a directory");
    let address = format!("nclink://{at}/A9");
    let config = prepared(directory.path(), SCRIPT, &sections(&address, "armed"));
    let refused = run(&["run", "--config", text(&config), "--for", "1"]);
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("need offset="), "{}", stderr(&refused));
    let link = crate::huazhong::stand::link(broker.port);
    let mut client =
        Connection::open(&adapters::nclink::connection::Link { serial: "A9".into(), ..link }, false).expect("up");
    let config = prepared(directory.path(), SCRIPT, &sections(&address, "shadow"));
    let (gateway, page) = started(&config);
    wait_for("the advice", Duration::from_secs(60), || (offset(&page)["wanted_um"] == 7.3).then_some(()));
    gateway.stop();
    assert!(words(&mut client).iter().all(|word| *word == 0), "published, never written");

    let config = prepared(directory.path(), SCRIPT, &sections(&format!("{address}?offset=D110"), "armed"));
    let (gateway, page) = started(&config);
    wait_for("a value", Duration::from_secs(60), || (offset(&page)["wanted_um"] == 7.3).then_some(()));
    armed(&config);
    wait_for("a shift of 7 um", Duration::from_secs(400), || (offset(&page)["shift_um"] == 7.0).then_some(()));
    assert_eq!(words(&mut client)[4..7], [json!(0), json!(0), json!(7)]);
    gateway.stop();
    let shifts = words(&mut client);
    println!("registers after the end of the gateway: {shifts:?}");
    device.stop();
}
