//! The line with a controller that is a list of answers, on a clock that stands still.

use super::allow_list::AllowList;
use super::answer::{FocasAnswer, FocasItemError, FocasItemResult, Refusal, System};
use super::code::FocasReturnCode;
use super::facts::INCH_MACHINE;
use super::focas::{Focas, FocasError};
use super::generation::{Generation, Opening};
use super::item::{FocasItem, Question, Stretch, Write};
use super::line::{Connect, FanucLine};
use adapter_core::clock::{Clock, SECOND_NS, TimeNs};
use adapter_core::driver::SourceError;
use adapter_core::reading::Absence;
use std::collections::HashMap;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What the mock has been told to do, and what it was asked.
#[derive(Default)]
struct Told {
    now_ns: AtomicI64,
    takes_ns: AtomicI64,
    asked: AtomicU64,
    connect: Mutex<Option<FocasError>>,
    fail: Mutex<Option<FocasError>>,
    results: Mutex<HashMap<FocasItem, FocasItemResult>>,
}

/// What the mock answers unless it is told otherwise.
fn build_usual_answer(item: FocasItem) -> FocasItemResult {
    Ok(match item {
        FocasItem::System => FocasAnswer::System(System {
            additional: 0,
            axes_max: 32,
            kind: "31".into(),
            machine: "M".into(),
            series: "G421".into(),
            version: "27.0".into(),
            axes: "02".into(),
        }),
        FocasItem::AxisNames => FocasAnswer::Names(vec!["X".into(), "Z".into()]),
        FocasItem::Parameter(..) => FocasAnswer::Data { kind: 0, values: vec![Some(0.0); 2] },
        _ => FocasAnswer::Whole(1),
    })
}

struct Mock(Arc<Told>, Opening);

impl Focas for Mock {
    fn opening(&self) -> &Opening {
        &self.1
    }

    fn ask_questions(&mut self, questions: &[Question], out: &mut Vec<FocasItemResult>) -> Result<(), FocasError> {
        self.0.now_ns.fetch_add(self.0.takes_ns.load(Ordering::SeqCst), Ordering::SeqCst);
        self.0.asked.fetch_add(questions.len() as u64, Ordering::SeqCst);
        if let Some(error) = self.0.fail.lock().expect("sound").take() {
            return Err(error);
        }
        let results = self.0.results.lock().expect("sound");
        out.extend(
            questions
                .iter()
                .map(|question| results.get(&question.item).cloned().unwrap_or(build_usual_answer(question.item))),
        );
        Ok(())
    }

    fn write(&mut self, _: &Write) -> Result<(), FocasError> {
        Ok(())
    }
}

struct Standing(Arc<Told>);

impl Clock for Standing {
    fn now_ns(&self) -> TimeNs {
        self.0.now_ns.load(Ordering::SeqCst)
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        self.0.now_ns.fetch_max(until_ns, Ordering::SeqCst);
    }
}

fn build_line(duty_pct: u8) -> (FanucLine, Arc<Told>, Standing) {
    let told = Arc::new(Told::default());
    let own = told.clone();
    let opening = Opening {
        generation: Generation::from_version(4),
        family: 5,
        axes_max: 32,
        spindles_max: 8,
        paths: 1,
        axes: 2,
        spindles: 1,
    };
    let connect: Connect = Box::new(move || match own.connect.lock().expect("sound").clone() {
        Some(error) => Err(error),
        None => Ok(Box::new(Mock(own.clone(), opening))),
    });
    (
        FanucLine::new("fanuc://mock", connect, (1, Vec::new()), AllowList::default(), duty_pct),
        told.clone(),
        Standing(told),
    )
}

fn build_refusal(code: i16) -> FocasItemResult {
    Err(FocasItemError::Refused(Refusal { code: FocasReturnCode(code), detail: 0 }))
}

#[test]
fn the_controller_has_its_share_of_the_time_for_itself() {
    let (line, told, clock) = build_line(25);
    told.takes_ns.store(20_000_000, Ordering::SeqCst);
    let asked: Vec<_> = (0..200).map(|_| line.ask_items(&clock, &[FocasItem::Feed]).expect("well")).collect();
    let (first, last) = (&asked[0], &asked[199]);
    // 200 answers of 20 ms want 16 s at 25 %; three seconds of rest may be owed.
    assert!(last.ended_ns - first.began_ns > 12_900_000_000, "{}", last.ended_ns - first.began_ns);
}

#[test]
fn one_answer_that_takes_long_delays_no_poll_and_many_do() {
    let (line, told, clock) = build_line(50);
    told.takes_ns.store(5_000_000, Ordering::SeqCst);
    line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
    told.now_ns.fetch_add(100_000_000, Ordering::SeqCst);
    told.takes_ns.store(1_500_000_000, Ordering::SeqCst);
    let hiccup = line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
    let next = line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
    assert_eq!(next.began_ns - hiccup.ended_ns, 0, "its rest stays owed, and is paid by the pauses after it");
    let third = line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
    let fourth = line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
    assert_eq!((fourth.began_ns - third.ended_ns) / 1_000_000, 1_500, "a slow control has its share");
}

#[test]
fn what_is_missing_is_asked_once_per_connection() {
    let (line, told, clock) = build_line(100);
    told.results.lock().expect("sound").insert(FocasItem::Feed, build_refusal(6));
    let items = [FocasItem::Sequence, FocasItem::Feed, FocasItem::BlockCount];
    let asked = line.ask_items(&clock, &items).expect("well");
    assert_eq!(asked.find_item_result(FocasItem::Feed), Some(&build_refusal(6)));
    assert_eq!(line.list_unsupported(), [FocasItem::Feed.to_question(1)]);
    let before = told.asked.load(Ordering::SeqCst);
    let asked = line.ask_items(&clock, &items).expect("well");
    assert_eq!(told.asked.load(Ordering::SeqCst) - before, 2);
    assert_eq!(asked.find_item_result(FocasItem::Feed), Some(&Err(FocasItemError::NotOffered)));
    assert_eq!(
        asked.find_item_result(FocasItem::BlockCount),
        Some(&Ok(FocasAnswer::Whole(1))),
        "the answers stay with their questions"
    );
    *told.fail.lock().expect("sound") = Some(FocasError::Broken("reset".into()));
    assert!(line.ask_items(&clock, &items).is_err());
    told.results.lock().expect("sound").clear();
    let asked = line.ask_items(&clock, &items).expect("a new connection");
    assert_eq!(
        asked.find_item_result(FocasItem::Feed),
        Some(&Ok(FocasAnswer::Whole(1))),
        "the control may have got the option"
    );
}

#[test]
fn a_code_that_says_the_connection_is_dead_ends_it() {
    let (line, told, clock) = build_line(100);
    line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
    told.results.lock().expect("sound").insert(FocasItem::Feed, build_refusal(-16));
    assert!(matches!(line.ask_items(&clock, &[FocasItem::Feed]), Err(SourceError::Line { .. })));
    told.results.lock().expect("sound").clear();
    line.ask_items(&clock, &[FocasItem::Feed]).expect("well again");
    assert_eq!((line.counts().connections, line.counts().broken), (2, 1));
}

#[test]
fn off_is_what_was_on_before() {
    let (line, told, clock) = build_line(100);
    let nobody = || Some(FocasError::NobodyThere("refused".into()));
    *told.connect.lock().expect("sound") = nobody();
    assert!(
        matches!(line.ask_items(&clock, &[FocasItem::Feed]), Err(SourceError::Line { .. })),
        "it may be the wrong address"
    );
    *told.connect.lock().expect("sound") = None;
    line.ask_items(&clock, &[FocasItem::Feed]).expect("on");
    *told.fail.lock().expect("sound") = Some(FocasError::Broken("reset".into()));
    assert!(matches!(line.ask_items(&clock, &[FocasItem::Feed]), Err(SourceError::Line { .. })));
    *told.connect.lock().expect("sound") = nobody();
    assert!(matches!(line.ask_items(&clock, &[FocasItem::Feed]), Err(SourceError::Off { .. })), "starting, or off");
    told.now_ns.fetch_add(200 * SECOND_NS, Ordering::SeqCst);
    let error = line.ask_items(&clock, &[FocasItem::Feed]).expect_err("too long for a start");
    assert!(matches!(error, SourceError::Line { .. }), "the host lives and nobody listens: {error}");
    *told.connect.lock().expect("sound") = Some(FocasError::Unreachable("no route".into()));
    let error = line.ask_items(&clock, &[FocasItem::Feed]).expect_err("cable, switch or power");
    assert_eq!(error.to_absence(), Absence::Disconnected, "nobody knows which: {error}");
}

#[test]
fn silence_and_a_closed_door_are_no_machine_that_is_off() {
    let (line, told, clock) = build_line(100);
    line.ask_items(&clock, &[FocasItem::Feed]).expect("on");
    *told.fail.lock().expect("sound") = Some(FocasError::Timeout(Duration::from_secs(2)));
    assert!(matches!(line.ask_items(&clock, &[FocasItem::Feed]), Err(SourceError::Timeout { .. })));
    *told.connect.lock().expect("sound") = Some(FocasError::Timeout(Duration::from_secs(2)));
    let error = line.ask_items(&clock, &[FocasItem::Feed]).expect_err("it accepts and is silent");
    assert_eq!(error.to_absence(), Absence::Timeout, "{error}");
    *told.connect.lock().expect("sound") = Some(FocasError::Broken("closed".into()));
    let error = line.ask_items(&clock, &[FocasItem::Feed]).expect_err("it accepts and closes");
    assert_eq!(error.to_absence(), Absence::Disconnected, "{error}");
}

#[test]
fn facts_that_are_refused_for_now_are_asked_for_again_with_every_round() {
    for code in [-1, 7, 11] {
        let (line, told, clock) = build_line(100);
        let questions = [FocasItem::AxisNames, INCH_MACHINE];
        questions.iter().for_each(|item| drop(told.results.lock().expect("sound").insert(*item, build_refusal(code))));
        let asked = line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
        assert_eq!(asked.facts.inch, Err(Absence::Refused), "no guess while the control says {code}");
        assert_eq!(asked.facts.axes_of(1), Err(Absence::Refused));
        told.results.lock().expect("sound").clear();
        let asked = line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
        assert_eq!((asked.facts.inch, asked.facts.axes_of(1).map(<[String]>::len)), (Ok(false), Ok(2)));
        assert_eq!(line.counts().connections, 1, "on the same connection");
        let before = told.asked.load(Ordering::SeqCst);
        line.ask_items(&clock, &[FocasItem::Feed]).expect("well");
        assert_eq!(told.asked.load(Ordering::SeqCst) - before, 1, "nothing is asked twice once it is known");
    }
}

#[test]
fn an_answer_that_was_cut_off_is_no_machine_that_is_off() {
    let (line, told, clock) = build_line(100);
    line.ask_items(&clock, &[FocasItem::Feed]).expect("on");
    *told.fail.lock().expect("sound") = Some(FocasError::Cut { got: 20, waited: None });
    assert!(matches!(line.ask_items(&clock, &[FocasItem::Feed]), Err(SourceError::Line { .. })));
    for waited in [None, Some(Duration::from_secs(2))] {
        *told.connect.lock().expect("sound") = Some(FocasError::Cut { got: 20, waited });
        let error = line.ask_items(&clock, &[FocasItem::Feed]).expect_err("an opening that was cut off");
        assert!(!matches!(error, SourceError::Off { .. }), "{error}");
        assert!(error.to_string().contains("20 bytes"), "{error}");
    }
}

#[test]
fn nothing_is_written_that_is_not_allowed() {
    let (line, _, clock) = build_line(100);
    let write = Write::Pmc { stretch: Stretch::from_byte_range(super::item::Area::G, 12, 1), values: vec![0] };
    assert!(matches!(line.write(&clock, &write), Err(SourceError::Refused { .. })));
    assert_eq!(line.counts().connections, 0, "not even a connection was opened for it");
}
