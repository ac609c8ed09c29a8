//! The feed override through the mailbox: taken by the ladder, read back, dropped when the gateway dies.

use crate::huazhong::stand::{Stand, address, until};
use adapters::driver::{Actuator, LadderRequest};
use adapters::nclink::RequestedItem;
use adapters::override_pct::OverridePct;
use adapters::{Address, SourceError};
use serde_json::json;
use std::time::Duration;

fn pct(percent: u8) -> OverridePct {
    OverridePct::new(percent).expect("exists")
}

fn actuator(stand: &Stand, keys: &str) -> Box<dyn Actuator> {
    let opened = adapters::open::open_address(&address(stand.broker.port, keys), 0).expect("opens");
    opened.actuator.expect("the address names a mailbox")
}

/// Waits until the machine's override in force is this.
fn in_force(stand: &Stand, percent: u8) {
    until(&format!("{percent} % in force"), || {
        let found = stand.machine.moment(stand.clock.now_ns()).panel.feed_override_pct;
        (found == percent).then_some(())
    });
}

#[test]
fn an_override_goes_through_the_mailbox_and_is_read_back() {
    let Some(stand) = Stand::start() else { return };
    let clock = stand.clock.clone();
    let mut actuator = actuator(&stand, "?write=mailbox");
    assert_eq!(actuator.read_feed_override(clock.as_ref()), Ok(pct(100)));
    actuator.write_feed_override(clock.as_ref(), pct(70)).expect("taken");
    in_force(&stand, 70);
    assert_eq!(
        actuator.read_feed_override(clock.as_ref()),
        Ok(pct(70)),
        "what the ladder made of it, not what was written"
    );
    // Above the dial the ladder keeps to the dial: the reading shows it, the write alone would not.
    actuator.write_feed_override(clock.as_ref(), pct(120)).expect("taken");
    in_force(&stand, 100);
    assert_eq!(actuator.read_feed_override(clock.as_ref()), Ok(pct(100)));
    // The registers as any client sees them; the heartbeat has moved with every letter.
    let words = stand
        .connect()
        .query_values(&[RequestedItem::with_elements("/CONTROLLER/VARIABLE@REG_D", &[100, 101, 102, 103])]);
    assert_eq!(words.expect("answered"), [Some(Ok(vec![json!(120), json!(1), json!(0), json!(2)]))]);
    actuator.write_feed_override(clock.as_ref(), pct(60)).expect("taken");
    in_force(&stand, 60);
    actuator.release_override(clock.as_ref()).expect("taken");
    in_force(&stand, 100);
}

#[test]
fn without_a_heartbeat_the_ladder_falls_back_to_the_dial() {
    let Some(stand) = Stand::start() else { return };
    let clock = stand.clock.clone();
    let mut actuator = actuator(&stand, "?write=mailbox&mailbox=D100");
    for _ in 0..4 {
        actuator.write_feed_override(clock.as_ref(), pct(55)).expect("taken");
        std::thread::sleep(Duration::from_millis(300));
        in_force(&stand, 55);
    }
    drop(actuator);
    in_force(&stand, 100);
    assert_eq!(stand.machine.written().heartbeats_lost, 1);
}

#[test]
fn a_feed_hold_is_asked_for_once() {
    let Some(stand) = Stand::start() else { return };
    let mut actuator = actuator(&stand, "?write=mailbox");
    actuator.ask_ladder(stand.clock.as_ref(), LadderRequest::FeedHold).expect("taken");
    actuator.write_feed_override(stand.clock.as_ref(), pct(90)).expect("taken");
    let counts = until("the hold", || {
        let _now = stand.machine.moment(stand.clock.now_ns());
        Some(stand.machine.written()).filter(|counts| counts.feed_holds > 0)
    });
    assert_eq!(counts.feed_holds, 1, "the next letter does not ask again");
}

#[test]
fn a_broken_line_is_told_and_writing_goes_on_after_it() {
    let Some(mut stand) = Stand::start() else { return };
    let clock = stand.clock.clone();
    let mut actuator = actuator(&stand, "?write=mailbox");
    actuator.write_feed_override(clock.as_ref(), pct(80)).expect("taken");
    stand.broker.kill();
    let error = actuator.write_feed_override(clock.as_ref(), pct(80)).expect_err("no broker");
    assert!(matches!(error, SourceError::Line { .. }), "{error}");
    stand.broker.run();
    stand.device.wait(2);
    until("writing again", || actuator.write_feed_override(clock.as_ref(), pct(75)).ok());
    in_force(&stand, 75);
}

#[test]
fn registers_that_may_not_be_written_are_refused() {
    let Some(stand) = Stand::start() else { return };
    let clock = stand.clock.clone();
    // W is there, but this mailbox would end beyond it.
    let mut beyond = actuator(&stand, "?write=mailbox&mailbox=W198");
    let error = beyond.write_feed_override(clock.as_ref(), pct(80)).expect_err("no such register");
    assert!(matches!(&error, SourceError::Refused { what, .. } if what == "INDEX_OUT_OF_RANGE"), "{error}");
    for keys in ["?write=mailbox&mailbox=G2564", "?write=mailbox&mailbox=B10", "?mailbox=D100", "?write=yes"] {
        let text = format!("nclink://127.0.0.1:1883/SIM7{keys}");
        assert!(text.parse::<Address>().is_err(), "{keys}");
    }
}
