//! The captured calls about state, speeds, program and positions; the others stand in `values`.

use fanuc::answer::{FocasAnswer, FocasItemError, FocasItemResult, Refusal, SpeedUnit, Status, System};
use fanuc::code::FocasReturnCode;
use fanuc::item::{Area, FocasItem, Position, Servo, Spindle, Stretch, Write};

/// What the row is about.
pub(super) enum CapturedMeaning {
    /// Items and their values.
    Read(Vec<FocasItem>, Vec<FocasItemResult>),
    Written(Write),
}

/// One call of the vendor's client.
pub(super) struct CapturedCall {
    pub(super) call: &'static str,
    pub(super) versions: &'static [u16],
    pub(super) asked: &'static str,
    pub(super) answered: &'static str,
    pub(super) says: CapturedMeaning,
}

pub(super) const ALL: &[u16] = &[2, 3, 4];
pub(super) const NEWER: &[u16] = &[3, 4];
pub(super) const OLDER: &[u16] = &[2];

pub(super) fn read(
    call: &'static str,
    versions: &'static [u16],
    asked: &'static str,
    answered: &'static str,
    says: Vec<(FocasItem, FocasAnswer)>,
) -> CapturedCall {
    let (items, answers) = says.into_iter().map(|(item, answer)| (item, Ok(answer))).unzip();
    CapturedCall { call, versions, asked, answered, says: CapturedMeaning::Read(items, answers) }
}

pub(super) fn write(call: &'static str, versions: &'static [u16], asked: &'static str, write: Write) -> CapturedCall {
    CapturedCall { call, versions, asked, answered: "", says: CapturedMeaning::Written(write) }
}

pub(super) fn define_refusal(
    call: &'static str,
    asked: &'static str,
    answered: &'static str,
    item: FocasItem,
    code: i16,
    detail: i16,
) -> CapturedCall {
    let refusal = Err(FocasItemError::Refused(Refusal { code: FocasReturnCode(code), detail }));
    CapturedCall { call, versions: ALL, asked, answered, says: CapturedMeaning::Read(vec![item], vec![refusal]) }
}

pub(super) fn build_number(value: f64) -> FocasAnswer {
    FocasAnswer::Number(Some(value))
}

fn build_numbers(values: &[f64], places: usize) -> FocasAnswer {
    let mut values: Vec<Option<f64>> = values.iter().map(|value| Some(*value)).collect();
    values.resize(places.max(values.len()), Some(0.0));
    FocasAnswer::Numbers(values)
}

pub(super) fn build_data(kind: i16, value: f64) -> FocasAnswer {
    FocasAnswer::Data { kind, values: vec![Some(value)] }
}

/// One quantity of the only spindle.
fn build_spindle(what: Spindle, value: f64) -> (FocasItem, FocasAnswer) {
    (FocasItem::Spindles(what), build_numbers(&[value], 1))
}

fn build_count(which: i16, count: i32) -> (FocasItem, FocasAnswer) {
    (FocasItem::Count(which), FocasAnswer::Whole(count))
}

fn build_names(names: &[&str]) -> FocasAnswer {
    FocasAnswer::Names(names.iter().map(ToString::to_string).collect())
}

pub(super) fn build_modal(value: i32) -> FocasAnswer {
    FocasAnswer::Modal { value, flag: 0, places: 0 }
}

/// The captured calls that stand here, in the order of the captures.
pub(super) fn list_calls() -> Vec<CapturedCall> {
    let mut rows = list_state_calls();
    rows.extend(list_speed_calls());
    rows.extend(list_meter_calls());
    rows.extend(list_program_calls());
    rows.extend(list_dynamic_calls());
    rows
}

fn list_state_calls() -> Vec<CapturedCall> {
    use FocasAnswer::Whole;
    let status = Status { automatic: 1, run: 3, motion: 1, ..Status::default() };
    let system = |axes_max| {
        FocasAnswer::System(System {
            additional: 0x0402,
            axes_max,
            kind: "0".into(),
            machine: "M".into(),
            series: "D4F1".into(),
            version: "27.0".into(),
            axes: "03".into(),
        })
    };
    let (short, long) = (FocasAnswer::Status(status), FocasAnswer::Status(status));
    let flags = [(FocasItem::HandleRetrace, Whole(0)), (FocasItem::ToolMode, Whole(0))];
    vec![
        read(
            "cnc_sysinfo",
            NEWER,
            "1/18",
            "0402 0020 2030 204d 44344631 32372e30 3033",
            vec![(FocasItem::System, system(32))],
        ),
        read(
            "cnc_sysinfo",
            OLDER,
            "1/18",
            "0402 0008 2030 204d 44344631 32372e30 3033",
            vec![(FocasItem::System, system(8))],
        ),
        read(
            "cnc_statinfo",
            ALL,
            "1/19 | 1/e1 | 1/98",
            "0001000300010000000000000000 | 0000 | 0000",
            [(FocasItem::Status, short)].into_iter().chain(flags.clone()).collect(),
        ),
        read(
            "cnc_statinfo2",
            ALL,
            "1/e2 | 1/e1 | 1/98",
            "0001000300010000000000000000 0000000000000000 | 0000 | 0000",
            [(FocasItem::StatusLong, long)].into_iter().chain(flags).collect(),
        ),
    ]
}

fn list_speed_calls() -> Vec<CapturedCall> {
    let none = |parameter| (FocasItem::Parameter(parameter, 0), build_data(3, 0.0));
    vec![
        read("cnc_actf", ALL, "1/24", "000004b0000a0000", vec![(FocasItem::Feed, build_number(1200.0))]),
        read("cnc_acts", ALL, "1/25", "00001f40000a0000", vec![(FocasItem::SpindleSpeed, build_number(8000.0))]),
        read(
            "cnc_acts2",
            NEWER,
            "1/a4 1 | 1/40 3 -1 | 1/a4 1",
            "0001 | 00001f40000a0000 | 0001",
            vec![build_count(1, 1), build_spindle(Spindle::Speed, 8000.0), build_count(1, 1)],
        ),
        read("cnc_acts2", OLDER, "1/40 3 -1", "00001f40000a0000", vec![build_spindle(Spindle::Speed, 8000.0)]),
        read(
            "cnc_rdspeed",
            NEWER,
            "1/a4 3 | 1/8a 1 | 1/88 3 | 1/88 4 | 1/24 | 1/25 | 1/a4 3",
            "0001 | 53310000 | 0003 | 0003 | 000004b0000a0000 | 00001f40000a0000 | 0001",
            vec![
                build_count(3, 1),
                (FocasItem::SpindleNames(1), build_names(&["S1"])),
                (FocasItem::FeedUnit, FocasAnswer::Unit(SpeedUnit::MmMin)),
                (FocasItem::SpindleUnit, FocasAnswer::Unit(SpeedUnit::Rpm)),
                (FocasItem::Feed, build_number(1200.0)),
                (FocasItem::SpindleSpeed, build_number(8000.0)),
                build_count(3, 1),
            ],
        ),
        read(
            "cnc_rdspeed",
            OLDER,
            "1/24 | 1/25 | 1/88 | 1/e c22 c22 | 1/e c23 c23 | 1/e 26d0 26d0 | 1/21 4 | 2/8001 1c 1c",
            "000004b0000a0000 | 00001f40000a0000 | 0000 | 00000c2200000003 ..4x8 | 00000c2300000003 ..4x8 \
             | 000026d000000003 ..4x8 | 0000 | 00",
            vec![
                (FocasItem::Feed, build_number(1200.0)),
                (FocasItem::SpindleSpeed, build_number(8000.0)),
                (FocasItem::FeedUnit, FocasAnswer::Unit(SpeedUnit::MmMin)),
                none(3106),
                none(3107),
                none(9936),
                (FocasItem::ModalGroup(4), FocasAnswer::Groups(vec![0])),
                (FocasItem::Pmc(Stretch::from_byte_range(Area::G, 28, 1)), FocasAnswer::Memory(vec![0])),
            ],
        ),
    ]
}

fn list_meter_calls() -> Vec<CapturedCall> {
    let servo = (FocasItem::Servos(Servo::Load), build_numbers(&[-31.0, 52.0, 118.0], 32));
    let axis_names = (FocasItem::AxisNames, build_names(&["X", "Y", "Z"]));
    vec![
        read(
            "cnc_rdspmeter",
            NEWER,
            "1/a4 1 | 1/8a -1 | 1/40 4 -1 | 1/40 5 -1 | 1/a4 1",
            "0001 | 53310000 | 00000113000a0001 | 00001f4c000a0000 | 0001",
            vec![
                build_count(1, 1),
                (FocasItem::SpindleNames(-1), build_names(&["S1"])),
                build_spindle(Spindle::Load, 27.5),
                build_spindle(Spindle::MotorSpeed, 8012.0),
                build_count(1, 1),
            ],
        ),
        read(
            "cnc_rdspmeter",
            OLDER,
            "1/40 4 -1 | 1/40 5 -1 | 1/8a",
            "00000113000a0001 | 00001f4c000a0000 | 53310000",
            vec![
                build_spindle(Spindle::Load, 27.5),
                build_spindle(Spindle::MotorSpeed, 8012.0),
                (FocasItem::SpindleNames(0), build_names(&["S1"])),
            ],
        ),
        read(
            "cnc_rdspload",
            NEWER,
            "1/a4 1 | 1/40 0 -1 | 1/a4 1",
            "0001 | 0000001b000a0000 | 0001",
            vec![build_count(1, 1), build_spindle(Spindle::PlainLoad, 27.0), build_count(1, 1)],
        ),
        read("cnc_rdspload", OLDER, "1/40 0 -1", "0000001b000a0000", vec![build_spindle(Spindle::PlainLoad, 27.0)]),
        read(
            "cnc_rdsvmeter",
            NEWER,
            "1/a4 2 | 1/89 | 1/56 1 | 1/a4 2",
            "0003 | 58000000590000005a000000 | ffffffe1000a0000 00000034000a0000 00000076000a0000 ..8x29 | 0003",
            vec![build_count(2, 3), axis_names.clone(), servo, build_count(2, 3)],
        ),
        read(
            "cnc_rdsvmeter",
            OLDER,
            "1/56 1 | 1/89",
            "ffffffe1000a0000 00000034000a0000 00000076000a0000 ..8x5 | 58000000590000005a000000",
            vec![(FocasItem::Servos(Servo::Load), build_numbers(&[-31.0, 52.0, 118.0], 8)), axis_names],
        ),
    ]
}

fn list_program_calls() -> Vec<CapturedCall> {
    let path = "//CNC_MEM/USER/PATH1/O1234";
    vec![
        read(
            "cnc_rdprgnum",
            ALL,
            "1/1c",
            "000004d2000003e8",
            vec![(FocasItem::Program, FocasAnswer::Program { running: 1234, main: 1000 })],
        ),
        read(
            "cnc_exeprgname",
            ALL,
            "1/cf",
            "000004d2 4f31323334 ..31x1",
            vec![(FocasItem::ProgramName, FocasAnswer::Named { number: 1234, name: "O1234".into() })],
        ),
        read(
            "cnc_exeprgname2",
            ALL,
            "1/fc",
            "2f2f434e435f4d454d2f555345522f50415448312f4f31323334 ..230x1",
            vec![(FocasItem::ProgramPath, FocasAnswer::Text(path.into()))],
        ),
        read("cnc_rdseqnum", ALL, "1/1d", "00000078", vec![(FocasItem::Sequence, FocasAnswer::Whole(120))]),
    ]
}

fn list_dynamic_calls() -> Vec<CapturedCall> {
    let head = || {
        vec![
            (FocasItem::AlarmBits, FocasAnswer::Whole(0)),
            (FocasItem::Program, FocasAnswer::Program { running: 1234, main: 1000 }),
            (FocasItem::Sequence, FocasAnswer::Whole(120)),
            (FocasItem::Feed, build_number(1200.0)),
            (FocasItem::SpindleSpeed, build_number(8000.0)),
        ]
    };
    let kinds = [Position::Absolute, Position::Machine, Position::Relative, Position::ToGo];
    let one = kinds
        .iter()
        .zip([123.456, 223.456, 1.0, 0.5])
        .map(|(kind, at)| (FocasItem::Position(*kind, 1), build_number(at)));
    let every = [[123.456, -98.765, 10.5], [223.456, -198.765, -10.5], [1.0, 2.0, -3.0], [0.5, 0.0, -0.25]];
    let all = |places| {
        let position =
            move |(kind, at): (&Position, [f64; 3])| (FocasItem::Position(*kind, -1), build_numbers(&at, places));
        head().into_iter().chain(kinds.iter().zip(every).map(position)).collect::<Vec<_>>()
    };
    vec![
        read(
            "cnc_rddynamic2 of one axis",
            ALL,
            "1/1a | 1/1c | 1/1d | 1/24 | 1/25 | 1/26 4 1 | 1/26 1 1 | 1/26 6 1 | 1/26 7 1",
            "00000000 | 000004d2000003e8 | 00000078 | 000004b0000a0000 | 00001f40000a0000 | 0001e240000a0003 \
             | 000368e0000a0003 | 000003e8000a0003 | 000001f4000a0003",
            head().into_iter().chain(one).collect(),
        ),
        read(
            "cnc_rddynamic2 of all axes",
            NEWER,
            "1/1a | 1/1c | 1/1d | 1/24 | 1/25 | 1/26 4 -1 | 1/26 1 -1 | 1/26 6 -1 | 1/26 7 -1",
            "00000000 | 000004d2000003e8 | 00000078 | 000004b0000a0000 | 00001f40000a0000 \
             | 0001e240000a0003 fffe7e33000a0003 00002904000a0003 ..8x29 \
             | 000368e0000a0003 fffcf793000a0003 ffffd6fc000a0003 ..8x29 \
             | 000003e8000a0003 000007d0000a0003 fffff448000a0003 ..8x29 \
             | 000001f4000a0003 00000000000a0003 ffffff06000a0003 ..8x29",
            all(32),
        ),
        read(
            "cnc_rddynamic2 of all axes",
            OLDER,
            "1/1a | 1/1c | 1/1d | 1/24 | 1/25 | 1/26 4 -1 | 1/26 1 -1 | 1/26 6 -1 | 1/26 7 -1",
            "00000000 | 000004d2000003e8 | 00000078 | 000004b0000a0000 | 00001f40000a0000 \
             | 0001e240000a0003 fffe7e33000a0003 00002904000a0003 ..8x5 \
             | 000368e0000a0003 fffcf793000a0003 ffffd6fc000a0003 ..8x5 \
             | 000003e8000a0003 000007d0000a0003 fffff448000a0003 ..8x5 \
             | 000001f4000a0003 00000000000a0003 ffffff06000a0003 ..8x5",
            all(8),
        ),
    ]
}
