//! Turned parts: facing, roughing and finishing of two diameters, and a thread on some.

use super::{Action, Cut, ProgramWriter, Rate};
use adapter_core::words::operation;

/// A turned part. Diameters and lengths in mm, speeds in rpm.
#[derive(Debug, Clone, Copy)]
struct Shaft {
    program: u16,
    stock_mm: f64,
    large_mm: f64,
    small_mm: f64,
    large_length_mm: f64,
    small_length_mm: f64,
    rough_rpm: f64,
    rough_depth_mm: f64,
    rough_feed_mm: f64,
    finish_rpm: f64,
    finish_feed_mm: f64,
    thread_pitch_mm: Option<f64>,
}

static PARTS: [Shaft; 3] = [
    Shaft {
        program: 1001,
        stock_mm: 79.0,
        large_mm: 73.0,
        small_mm: 61.0,
        large_length_mm: 62.0,
        small_length_mm: 34.0,
        rough_rpm: 800.0,
        rough_depth_mm: 1.4,
        rough_feed_mm: 0.22,
        finish_rpm: 1250.0,
        finish_feed_mm: 0.11,
        thread_pitch_mm: None,
    },
    Shaft {
        program: 1002,
        stock_mm: 120.0,
        large_mm: 112.0,
        small_mm: 96.0,
        large_length_mm: 30.0,
        small_length_mm: 18.0,
        rough_rpm: 480.0,
        rough_depth_mm: 1.9,
        rough_feed_mm: 0.25,
        finish_rpm: 760.0,
        finish_feed_mm: 0.14,
        thread_pitch_mm: None,
    },
    Shaft {
        program: 1003,
        stock_mm: 60.0,
        large_mm: 54.0,
        small_mm: 42.0,
        large_length_mm: 55.0,
        small_length_mm: 30.0,
        rough_rpm: 960.0,
        rough_depth_mm: 1.4,
        rough_feed_mm: 0.18,
        finish_rpm: 1600.0,
        finish_feed_mm: 0.10,
        thread_pitch_mm: Some(1.5),
    },
];

/// A pin that is made in less than a minute.
static PIN: Shaft = Shaft {
    program: 1004,
    stock_mm: 52.0,
    large_mm: 48.4,
    small_mm: 45.6,
    large_length_mm: 10.0,
    small_length_mm: 10.0,
    rough_rpm: 960.0,
    rough_depth_mm: 1.4,
    rough_feed_mm: 0.25,
    finish_rpm: 980.0,
    finish_feed_mm: 0.12,
    thread_pitch_mm: None,
};

/// Tools of the turret.
const ROUGHER: u8 = 1;
const FINISHER: u8 = 2;
const THREADER: u8 = 3;

/// Writes the program of lot number `lot`. `vary` gives factors about 1 for the speed of each pass.
pub(super) fn write_part(out: &mut ProgramWriter<'_>, lot: usize, vary: &mut dyn FnMut() -> f64) {
    write_shaft(out, &PARTS[lot % PARTS.len()], vary);
}

/// The same for the short part.
pub(super) fn write_pin(out: &mut ProgramWriter<'_>) {
    write_shaft(out, &PIN, &mut || 1.0);
}

fn write_shaft(out: &mut ProgramWriter<'_>, part: &Shaft, vary: &mut dyn FnMut() -> f64) {
    out.program = part.program;
    out.operation = "facing";
    out.append_action(Action::ToolChange(ROUGHER));
    out.append_action(Action::Spindle(round_speed(part.rough_rpm * 0.75), stage_for(part.rough_rpm)));
    out.append_action(Action::Coolant(true));
    write_facing(out, part);
    out.operation = "roughing";
    write_roughing(out, part, part.stock_mm, part.large_mm + 0.8, part.large_length_mm + part.small_length_mm, vary);
    write_roughing(out, part, part.large_mm + 0.8, part.small_mm + 0.8, part.small_length_mm, vary);
    out.operation = "finishing";
    out.append_action(Action::Rapid([part.stock_mm + 120.0, 0.0, 160.0]));
    change_stage(out, part.rough_rpm, part.finish_rpm);
    out.append_action(Action::ToolChange(FINISHER));
    write_finishing(out, part, vary);
    if let Some(pitch_mm) = part.thread_pitch_mm {
        out.operation = operation::THREADING;
        write_threading(out, part, pitch_mm);
    }
    out.operation = "";
    out.append_action(Action::Coolant(false));
    out.append_action(Action::Rapid([part.stock_mm + 120.0, 0.0, 160.0]));
    out.append_action(Action::Stop);
}

fn round_speed(speed_rpm: f64) -> f64 {
    (speed_rpm / 10.0).round() * 10.0
}

/// The low stage up to 1000 rpm.
fn stage_for(speed_rpm: f64) -> u8 {
    if speed_rpm <= 1000.0 { 1 } else { 2 }
}

/// Another stage is engaged at rest only.
fn change_stage(out: &mut ProgramWriter<'_>, from_rpm: f64, to_rpm: f64) {
    if stage_for(from_rpm) != stage_for(to_rpm) {
        out.append_action(Action::Stop);
    }
}

fn build_turning_cut(depth_mm: f64, from_mm: f64, to_mm: f64, air_mm: f64) -> Option<Cut> {
    Some(Cut { depth_mm, diameter_from_mm: from_mm, diameter_to_mm: to_mm, air_mm, ..Cut::default() })
}

fn write_facing(out: &mut ProgramWriter<'_>, part: &Shaft) {
    out.append_action(Action::Rapid([part.stock_mm + 6.0, 0.0, -0.8]));
    let cut = build_turning_cut(0.8, part.stock_mm, part.small_mm * 0.4, 3.0);
    let to = [part.small_mm * 0.4 - 2.0, 0.0, -0.8];
    out.append_action(Action::Feed { to, rate: Rate::PerTurn(0.16), cut, locked: false });
    out.append_action(Action::Rapid([part.stock_mm + 6.0, 0.0, 2.0]));
}

fn write_roughing(
    out: &mut ProgramWriter<'_>,
    part: &Shaft,
    from_mm: f64,
    to_mm: f64,
    length_mm: f64,
    vary: &mut dyn FnMut() -> f64,
) {
    let mut diameter_mm = from_mm;
    while diameter_mm > to_mm + 0.01 {
        let depth_mm = part.rough_depth_mm.min((diameter_mm - to_mm) / 2.0);
        out.append_action(Action::Spindle(round_speed(part.rough_rpm * vary()), stage_for(part.rough_rpm)));
        diameter_mm -= 2.0 * depth_mm;
        out.append_action(Action::Rapid([diameter_mm, 0.0, 3.0]));
        let cut = build_turning_cut(depth_mm, diameter_mm + depth_mm, diameter_mm + depth_mm, 3.0);
        let rate = Rate::PerTurn(part.rough_feed_mm);
        out.append_action(Action::Feed { to: [diameter_mm, 0.0, -length_mm], rate, cut, locked: false });
        out.append_action(Action::Feed {
            to: [diameter_mm + 2.0, 0.0, -length_mm + 1.0],
            rate: Rate::PerMinute(900.0),
            cut: None,
            locked: false,
        });
    }
}

fn write_finishing(out: &mut ProgramWriter<'_>, part: &Shaft, vary: &mut dyn FnMut() -> f64) {
    let stage = stage_for(part.finish_rpm);
    let passes = [
        (part.small_mm, 3.0, part.small_length_mm, part.finish_rpm),
        (
            part.large_mm,
            3.0 - part.small_length_mm,
            part.large_length_mm + part.small_length_mm,
            part.finish_rpm * 0.88,
        ),
    ];
    for (diameter_mm, from_z_mm, to_z_mm, speed_rpm) in passes {
        out.append_action(Action::Spindle(round_speed(speed_rpm * vary()), stage));
        out.append_action(Action::Rapid([diameter_mm, 0.0, from_z_mm]));
        let cut = build_turning_cut(0.4, diameter_mm, diameter_mm, 2.0);
        let rate = Rate::PerTurn(part.finish_feed_mm);
        out.append_action(Action::Feed { to: [diameter_mm, 0.0, -to_z_mm], rate, cut, locked: false });
        out.append_action(Action::Rapid([diameter_mm + 6.0, 0.0, -to_z_mm]));
    }
}

fn write_threading(out: &mut ProgramWriter<'_>, part: &Shaft, pitch_mm: f64) {
    out.append_action(Action::Rapid([part.stock_mm + 120.0, 0.0, 160.0]));
    change_stage(out, part.finish_rpm, 500.0);
    out.append_action(Action::ToolChange(THREADER)).append_action(Action::Spindle(500.0, 1));
    for pass in 1..=5 {
        let diameter_mm = part.small_mm - 0.36 * f64::from(pass);
        out.append_action(Action::Rapid([diameter_mm, 0.0, 4.0]));
        let cut = build_turning_cut(0.18, part.small_mm, part.small_mm, 4.0);
        let (to, rate) = ([diameter_mm, 0.0, -part.small_length_mm], Rate::PerTurn(pitch_mm));
        out.append_action(Action::Feed { to, rate, cut, locked: true });
        out.append_action(Action::Rapid([part.small_mm + 4.0, 0.0, -part.small_length_mm]));
    }
}
