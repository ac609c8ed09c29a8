//! Milled parts: face milling, roughing and finishing of a pocket, drilled and tapped holes.

use super::{Action, Cut, ProgramWriter, Rate};
use adapter_core::words::operation;

/// A milling tool and its data.
#[derive(Debug, Clone, Copy)]
struct Cutter {
    tool: u8,
    diameter_mm: f64,
    teeth: f64,
    speed_rpm: f64,
    feed_mm_min: f64,
    depth_mm: f64,
    width_mm: f64,
}

const FACE: Cutter = Cutter {
    tool: 1,
    diameter_mm: 63.0,
    teeth: 5.0,
    speed_rpm: 1200.0,
    feed_mm_min: 720.0,
    depth_mm: 1.5,
    width_mm: 48.0,
};
const ROUGH: Cutter = Cutter {
    tool: 2,
    diameter_mm: 16.0,
    teeth: 4.0,
    speed_rpm: 3600.0,
    feed_mm_min: 1150.0,
    depth_mm: 6.0,
    width_mm: 8.0,
};
const FINISH: Cutter = Cutter {
    tool: 3,
    diameter_mm: 12.0,
    teeth: 4.0,
    speed_rpm: 5500.0,
    feed_mm_min: 900.0,
    depth_mm: 12.0,
    width_mm: 0.3,
};
const DRILL: Cutter = Cutter {
    tool: 4,
    diameter_mm: 8.5,
    teeth: 2.0,
    speed_rpm: 2800.0,
    feed_mm_min: 420.0,
    depth_mm: 6.7,
    width_mm: 8.5,
};
const TAP_SPEED_RPM: f64 = 480.0;
const TAP: u8 = 5;

/// Writes the program of lot number `lot`: lots differ in the number of pocket layers and holes.
pub(super) fn write_part(out: &mut ProgramWriter<'_>, lot: usize, vary: &mut dyn FnMut() -> f64) {
    let (program, layers, holes) = [(2001, 3, 4), (2002, 2, 8), (2003, 4, 2)][lot % 3];
    out.program = program;
    out.operation = "face milling";
    write_tool_change(out, &FACE, vary);
    out.append_action(Action::Coolant(true));
    for row in 0..2 {
        write_line(out, &FACE, [-40.0, 48.0 * f64::from(row), 0.0], 220.0);
    }
    out.operation = "roughing";
    write_tool_change(out, &ROUGH, vary);
    for layer in 1..=layers {
        out.append_action(Action::Spindle(round_speed(ROUGH.speed_rpm * vary()), 1));
        for row in 0..4 {
            write_line(out, &ROUGH, [20.0, 20.0 + 8.0 * f64::from(row), -6.0 * f64::from(layer)], 110.0);
        }
    }
    out.operation = "finishing";
    write_tool_change(out, &FINISH, vary);
    for side in 0..4 {
        write_line(out, &FINISH, [20.0, 20.0 + 8.0 * f64::from(side), -6.0 * f64::from(layers)], 90.0);
    }
    out.operation = "drilling";
    write_tool_change(out, &DRILL, vary);
    (0..holes).for_each(|hole| write_drilling(out, hole));
    out.operation = operation::TAPPING;
    (0..holes).for_each(|hole| write_tapping(out, hole));
    out.operation = "";
    out.append_action(Action::Coolant(false)).append_action(Action::Stop);
    out.append_action(Action::Rapid([0.0, 0.0, 250.0]));
}

fn round_speed(speed_rpm: f64) -> f64 {
    (speed_rpm / 10.0).round() * 10.0
}

/// Changes to the tool at rest and runs up.
fn write_tool_change(out: &mut ProgramWriter<'_>, cutter: &Cutter, vary: &mut dyn FnMut() -> f64) {
    out.append_action(Action::Rapid([0.0, 0.0, 250.0])).append_action(Action::Stop);
    out.append_action(Action::ToolChange(cutter.tool));
    out.append_action(Action::Spindle(round_speed(cutter.speed_rpm * vary()), 1));
}

fn cut_of(cutter: &Cutter, air_mm: f64) -> Option<Cut> {
    Some(Cut {
        depth_mm: cutter.depth_mm,
        width_mm: cutter.width_mm,
        diameter_from_mm: cutter.diameter_mm,
        diameter_to_mm: cutter.diameter_mm,
        teeth: cutter.teeth,
        air_mm,
    })
}

/// One straight pass in X.
fn write_line(out: &mut ProgramWriter<'_>, cutter: &Cutter, from: [f64; 3], length_mm: f64) {
    out.append_action(Action::Rapid([from[0] - 5.0, from[1], from[2] + 5.0])).append_action(Action::Rapid([
        from[0] - 5.0,
        from[1],
        from[2],
    ]));
    let to = [from[0] + length_mm, from[1], from[2]];
    let rate = Rate::PerMinute(cutter.feed_mm_min);
    out.append_action(Action::Feed { to, rate, cut: cut_of(cutter, 5.0), locked: false });
    out.append_action(Action::Rapid([to[0], to[1], 10.0]));
}

fn find_hole_position(hole: i32) -> [f64; 2] {
    [25.0 * f64::from(hole % 4), 90.0 + 20.0 * f64::from(hole / 4)]
}

fn write_drilling(out: &mut ProgramWriter<'_>, hole: i32) {
    let [x, y] = find_hole_position(hole);
    out.append_action(Action::Rapid([x, y, 3.0]));
    let (to, rate) = ([x, y, -22.0], Rate::PerMinute(DRILL.feed_mm_min));
    out.append_action(Action::Feed { to, rate, cut: cut_of(&DRILL, 3.0), locked: false });
    out.append_action(Action::Rapid([x, y, 10.0]));
}

fn write_tapping(out: &mut ProgramWriter<'_>, hole: i32) {
    let [x, y] = find_hole_position(hole);
    if hole == 0 {
        out.append_action(Action::Rapid([0.0, 0.0, 250.0]))
            .append_action(Action::Stop)
            .append_action(Action::ToolChange(TAP));
    }
    out.append_action(Action::Rapid([x, y, 3.0])).append_action(Action::Spindle(TAP_SPEED_RPM, 1));
    let cut = Some(Cut {
        depth_mm: 0.9,
        width_mm: 2.0,
        diameter_from_mm: 10.0,
        diameter_to_mm: 10.0,
        teeth: 4.0,
        air_mm: 3.0,
    });
    let rate = Rate::PerTurn(1.5);
    out.append_action(Action::Feed { to: [x, y, -18.0], rate, cut, locked: true });
    out.append_action(Action::Spindle(-TAP_SPEED_RPM, 1));
    out.append_action(Action::Feed { to: [x, y, 5.0], rate, cut: None, locked: true });
}
