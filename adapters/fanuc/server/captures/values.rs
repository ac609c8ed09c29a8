//! The captured calls about modal values, alarms, variables, parameters, PMC memory, offsets and what is written.

use super::rows::{
    ALL, CapturedCall, NEWER, OLDER, build_data, build_modal, build_number, define_refusal, read, write,
};
use fanuc::answer::{Alarm, FocasAnswer};
use fanuc::item::{Area, BlockWord, FocasItem, PmcWidth, Stretch, Timer, Write};

pub(super) fn list_calls() -> Vec<CapturedCall> {
    [list_value_calls(), list_variable_calls(), list_parameter_calls(), list_write_calls(), list_remaining_calls()]
        .into_iter()
        .flatten()
        .collect()
}

fn list_value_calls() -> Vec<CapturedCall> {
    let alarms = vec![
        Alarm { number: 100, kind: 3, axis: 0, text: "PARAMETER ENABLE SWITCH ON".into() },
        Alarm { number: 417, kind: 6, axis: 2, text: "SERVO ALARM".into() },
    ];
    // 1704562278 / 2^26, which is how an older control holds 25.4.
    let nearly = f64::from(0x6599_9999u32) / f64::from(1u32 << 26);
    vec![
        read(
            "cnc_modal of F",
            ALL,
            "1/22 5",
            "000004b0 00000000",
            vec![(FocasItem::ModalWord(BlockWord::F), build_modal(1200))],
        ),
        read(
            "cnc_modal of M",
            ALL,
            "1/22 b",
            "00000003 00000000",
            vec![(FocasItem::ModalWord(BlockWord::M), build_modal(3))],
        ),
        read(
            "cnc_modal of T",
            ALL,
            "1/22 16",
            "0000000c 00000000",
            vec![(FocasItem::ModalWord(BlockWord::T), build_modal(12))],
        ),
        read(
            "cnc_rdalmmsg2",
            ALL,
            "1/23 -1 8 2 40",
            "00000064 00000003 00000000 0000001a 504152414d4554455220454e41424c4520535749544348204f4e ..38x1 \
             000001a1 00000006 00000002 0000000b 534552564f20414c41524d ..53x1",
            vec![(FocasItem::Alarms(8), FocasAnswer::Alarms(alarms))],
        ),
        read("cnc_alarm2", ALL, "1/1a", "00000048", vec![(FocasItem::AlarmBits, FocasAnswer::Whole(72))]),
        read(
            "cnc_rdmacro",
            NEWER,
            "1/15 1f4 1f4",
            "000000fe000a0001",
            vec![(FocasItem::Macro(500), build_number(25.4))],
        ),
        read(
            "cnc_rdmacro",
            OLDER,
            "1/15 1f4 1f4",
            "659999990002001a",
            vec![(FocasItem::Macro(500), build_number(nearly))],
        ),
        read(
            "cnc_rdmacro vacant",
            ALL,
            "1/15 1f5 1f5",
            "00000000ffffffff",
            vec![(FocasItem::Macro(501), FocasAnswer::Number(None))],
        ),
        define_refusal("cnc_rdmacro of none", "1/15 1389 1389", "!3.0", FocasItem::Macro(5001), 3, 0),
    ]
}

fn list_variable_calls() -> Vec<CapturedCall> {
    vec![
        write(
            "cnc_wrmacro",
            NEWER,
            "1/16 1fe 1fe = 075bcd15000a0006",
            Write::Macro { number: 510, mantissa: 123_456_789, places: 6 },
        ),
        write(
            "cnc_wrmacro",
            OLDER,
            "1/16 1fe 1fe = 7b74f01f00020018",
            Write::Macro { number: 510, mantissa: 123_456_789, places: 6 },
        ),
        write(
            "cnc_wrmacro negative",
            NEWER,
            "1/16 1ff 1ff = ffffffe7000a0001",
            Write::Macro { number: 511, mantissa: -25, places: 1 },
        ),
        write(
            "cnc_wrmacro negative",
            OLDER,
            "1/16 1ff 1ff = b00000000002001d",
            Write::Macro { number: 511, mantissa: -25, places: 1 },
        ),
        read(
            "cnc_rdmacro of what was written",
            NEWER,
            "1/15 1ff 1ff",
            "ffffffe7000a0001",
            vec![(FocasItem::Macro(511), build_number(-2.5))],
        ),
        read(
            "cnc_rdmacro of what was written",
            OLDER,
            "1/15 1ff 1ff",
            "b00000000002001d",
            vec![(FocasItem::Macro(511), build_number(-2.5))],
        ),
    ]
}

fn list_parameter_calls() -> Vec<CapturedCall> {
    let pmc = |area, from, to, width| Stretch { area, from, to, width };
    vec![
        read(
            "cnc_rdparam",
            NEWER,
            "1/8d 1a37 1a37",
            "00001a37 0000 0003 000001c8000a0000 ..8x31",
            vec![(FocasItem::Parameter(6711, 0), build_data(3, 456.0))],
        ),
        read(
            "cnc_rdparam",
            OLDER,
            "1/e 1a37 1a37",
            "00001a37 0000 0003 000001c8 ..4x7",
            vec![(FocasItem::Parameter(6711, 0), build_data(3, 456.0))],
        ),
        read(
            "cnc_diagnoss",
            NEWER,
            "1/93 134 134 1",
            "00000134 0001 0002 00000029000a0000 ..8x31",
            vec![(FocasItem::Diagnosis(308, 1), build_data(2, 41.0))],
        ),
        read(
            "cnc_diagnoss",
            OLDER,
            "1/30 134 134 1",
            "00000134 0001 0002 00000029 ..4x7",
            vec![(FocasItem::Diagnosis(308, 1), build_data(2, 41.0))],
        ),
        read(
            "pmc_rdpmcrng of G12",
            ALL,
            "2/8001 c c",
            "9b",
            vec![(FocasItem::Pmc(pmc(Area::G, 12, 12, PmcWidth::Byte)), FocasAnswer::Memory(vec![155]))],
        ),
        read(
            "pmc_rdpmcrng of R100",
            ALL,
            "2/8001 64 67 5 2",
            "fffe1dc0",
            vec![(FocasItem::Pmc(pmc(Area::R, 100, 103, PmcWidth::Long)), FocasAnswer::Memory(vec![-123_456]))],
        ),
    ]
}

fn list_write_calls() -> Vec<CapturedCall> {
    let d900 = Stretch { area: Area::D, from: 900, to: 903, width: PmcWidth::Word };
    let mut signals = [0; 16];
    signals[5] = 8;
    vec![
        write(
            "pmc_wrpmcrng of G12",
            ALL,
            "2/8002 c c = af",
            Write::Pmc { stretch: Stretch::from_byte_range(Area::G, 12, 1), values: vec![175] },
        ),
        write(
            "pmc_wrpmcrng of D900",
            ALL,
            "2/8002 384 387 9 1 = 1234fffe",
            Write::Pmc { stretch: d900, values: vec![4660, -2] },
        ),
        read(
            "pmc_rdpmcrng of D900",
            ALL,
            "2/8001 384 387 9 1",
            "1234fffe",
            vec![(FocasItem::Pmc(d900), FocasAnswer::Memory(vec![4660, -2]))],
        ),
        write(
            "cnc_wrtofs",
            ALL,
            "1/9 1 1 3e8 = fffffb2e0000ffff",
            Write::ToolOffset { number: 1, kind: 0, value: -1234 },
        ),
        read(
            "cnc_rdtofs",
            ALL,
            "1/8 1 1 3e8",
            "fffffb2e000a0003",
            vec![(FocasItem::ToolOffset(1, 0), build_number(-1.234))],
        ),
        write("cnc_wrzofs", ALL, "1/c 0 0 1 = ffffff060000ffff", Write::WorkOffset { number: 0, axis: 1, value: -250 }),
        read(
            "cnc_rdzofs",
            ALL,
            "1/b 0 0 1",
            "ffffff06000a0003",
            vec![(FocasItem::WorkOffset(0, 1), build_number(-0.25))],
        ),
        write(
            "cnc_wropnlsgnl",
            ALL,
            "1/5e 20 = 00000000000000000000 0008 0000000000000000000000000000000000000000",
            Write::PanelSignals { mask: 0x20, signals },
        ),
    ]
}

fn list_remaining_calls() -> Vec<CapturedCall> {
    let text = "N120 G01 X10.5 F1200\nN130 Z-2.\nM30\n%";
    let mut signals = vec![0; 16];
    (signals[0], signals[5], signals[6]) = (1, 8, 5);
    vec![
        read(
            "cnc_rdexecprog",
            ALL,
            "1/20 80",
            "00000000 4e31323020473031205831302e352046313230300a4e313330205a2d322e0a4d33300a25",
            vec![(FocasItem::ExecutedText(128), FocasAnswer::Named { number: 0, name: text.into() })],
        ),
        read(
            "cnc_rdtimer",
            ALL,
            "1/120",
            "00003039 00001770",
            vec![(FocasItem::Timer(Timer::PowerOn), FocasAnswer::Time { minutes: 12345, milliseconds: 6000 })],
        ),
        read("cnc_rdopmode", ALL, "1/57", "0000", vec![(FocasItem::TuningMode, FocasAnswer::Whole(0))]),
        // The captured reading came before the write and shows 10; this one shows what was written.
        read(
            "cnc_rdopnlsgnl",
            ALL,
            "1/5d 20",
            "0001 0000 0000 0000 0000 0008 0005 ..18x1",
            vec![(FocasItem::PanelSignals(0x20), FocasAnswer::Signals(signals))],
        ),
        define_refusal("option missing", "1/24", "!6.2", FocasItem::Feed, 6, 2),
    ]
}
