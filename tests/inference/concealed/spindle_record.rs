//! How a day of spindle power is written down: which columns this box has, how it keeps time, and the nominal model.

use crate::concealed::baseline::Process;
use crate::concealed::case::{Table, short};
use crate::concealed::dice::Dice;
use crate::concealed::laws::KNOWN_INERTIA_KG_M2;
use crate::concealed::schedule::{Mode, OPERATIONS};
use crate::concealed::spindle_case::CaseSpec;
use crate::concealed::tick::Tick;
use crate::concealed::world::Stage;

/// How time is written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Clock {
    /// `time_s` over the whole day, pauses included.
    Running,
    /// `time_s` from zero in every run.
    Restarting,
    /// `time_utc`.
    Utc,
}

/// Which columns this box records.
pub(crate) struct Style {
    clock: Clock,
    columns: Vec<&'static str>,
    output: &'static str,
    vertical: bool,
    inertia: bool,
}

impl Style {
    pub(crate) fn draw(spec: &CaseSpec, dice: &mut Dice) -> Self {
        let clock = *dice.pick(&[Clock::Running, Clock::Running, Clock::Utc, Clock::Restarting]);
        let optional = [
            ("pass", 0.7),
            ("lot", 0.5),
            ("operation", 0.7),
            ("feed_per_rev_mm", 0.6),
            ("axis_position_mm", 0.7),
            ("axis_velocity_mm_min", 0.4),
            ("coolant_on", 0.4),
            ("door_open", 0.2),
            ("gear_stage", 0.2),
            ("supply_voltage_v", 0.25),
            ("ambient_temperature_c", 0.3),
            ("feed_override_pct", 0.3),
        ];
        let mut columns: Vec<&'static str> =
            optional.iter().filter(|(_, p)| dice.chance(*p)).map(|(n, _)| *n).collect();
        for column in spec.entries.iter().flat_map(|e| e.columns) {
            if !columns.contains(column) {
                columns.push(column);
            }
        }
        let has = |name: &str| spec.entries.iter().any(|e| e.name == name);
        let whole_machine = has("auxiliary_switch") || has("axis_friction") || has("gravity_axis");
        Self {
            clock,
            columns,
            output: if whole_machine { "total_power_w" } else { "spindle_power_w" },
            vertical: has("gravity_axis"),
            inertia: has("regeneration"),
        }
    }

    fn has(&self, name: &str) -> bool {
        self.columns.contains(&name)
    }
}

/// The recording.
pub(crate) fn table(spec: &CaseSpec, style: &Style, stage: &Stage, record: &[Tick], output: &[Option<f64>]) -> Table {
    let mut table = Table::default();
    write_time(&mut table, style.clock, record);
    write_grouping(&mut table, style, stage, record);
    write_motion(&mut table, spec, style, stage, record);
    write_surroundings(&mut table, style, record);
    table.sparse(style.output, 2, output.iter().copied());
    table
}

/// Spindle current from the power before the power meter, with its own small noise, A.
pub(crate) fn write_current(table: &mut Table, record: &[Tick], machine_w: &[f64], dice: &mut Dice) {
    let amps = record.iter().zip(machine_w).map(|(t, w)| {
        let active = w / (3f64.sqrt() * t.supply_v * 0.86);
        active.hypot(1.9) * (1.0 + 0.004 * dice.normal()) + 0.01 * dice.normal()
    });
    let amps: Vec<f64> = amps.collect();
    table.number("spindle_current_a", 3, amps.into_iter());
}

fn write_time(table: &mut Table, clock: Clock, record: &[Tick]) {
    if clock == Clock::Utc {
        return table.text("time_utc", record.iter().map(|t| utc(t.t_s)));
    }
    let mut start = 0.0;
    let mut run = usize::MAX;
    let times: Vec<f64> = record
        .iter()
        .map(|t| {
            if clock == Clock::Restarting && t.run != run {
                (start, run) = (t.t_s, t.run);
            }
            t.t_s - start
        })
        .collect();
    table.number("time_s", 3, times.into_iter());
}

/// Seconds after 06:00 on a working day, RFC 3339 with milliseconds.
fn utc(t_s: f64) -> String {
    let ms = (t_s * 1000.0).round() as u64 + 6 * 3_600_000;
    let (hours, minutes) = (ms / 3_600_000, ms / 60_000 % 60);
    let day = 2 + hours / 24;
    format!("2026-03-{day:02}T{:02}:{minutes:02}:{:02}.{:03}Z", hours % 24, ms / 1000 % 60, ms % 1000)
}

fn write_grouping(table: &mut Table, style: &Style, stage: &Stage, record: &[Tick]) {
    table.text("run", record.iter().map(|t| (t.run + 1).to_string()));
    if style.has("pass") {
        table.text("pass", record.iter().map(|t| (t.pass + 1).to_string()));
    }
    table.text("tool", record.iter().map(|t| stage.plan.tools[t.tool].clone()));
    if style.has("lot") {
        table.text("lot", record.iter().map(|t| format!("L{}", 311 + 4 * t.lot)));
    }
    if style.has("operation") {
        table.text("operation", record.iter().map(|t| OPERATIONS[t.operation].to_string()));
    }
}

fn write_motion(table: &mut Table, spec: &CaseSpec, style: &Style, stage: &Stage, record: &[Tick]) {
    table.number("spindle_speed_rpm", 1, record.iter().map(|t| t.speed_rpm));
    let feed = |t: &Tick| if t.engaged { t.feed_mm_rev * t.speed_rpm } else { 0.0 };
    table.number("feed_mm_min", 2, record.iter().map(feed));
    if style.has("feed_per_rev_mm") {
        table.number("feed_per_rev_mm", 5, record.iter().map(|t| t.feed_mm_rev));
    }
    if stage.plan.mode == Mode::ClosedLoop {
        let programmed = |t: &Tick| if t.engaged { t.programmed_mm_rev * t.speed_rpm } else { 0.0 };
        table.number("feed_programmed_mm_min", 2, record.iter().map(programmed));
    }
    if style.has("feed_override_pct") {
        let percent = |t: &Tick| 100.0 * t.feed_mm_rev / t.programmed_mm_rev.max(1e-6);
        table.number("feed_override_pct", 1, record.iter().map(percent));
    }
    if style.inertia {
        table.number("spindle_acceleration_rpm_per_s", 2, record.iter().map(|t| t.acceleration_rpm_s));
    }
    table.number("depth_of_cut_mm", 4, record.iter().map(|t| t.depth_mm));
    table.number("diameter_mm", 2, record.iter().map(|t| t.diameter_mm));
    if spec.process != Process::Turning {
        table.number("width_of_cut_mm", 2, record.iter().map(|t| t.width_mm));
        table.number("teeth", 0, record.iter().map(|t| t.teeth));
    }
    table.number("engaged", 0, record.iter().map(|t| f64::from(u8::from(t.engaged))));
    if style.has("axis_position_mm") && !style.vertical {
        table.number("axis_position_mm", 3, record.iter().map(|t| t.position_mm));
    }
    if style.vertical {
        table.number("z_axis_position_mm", 3, record.iter().map(|t| t.position_mm));
        table.number("z_axis_velocity_mm_min", 2, record.iter().map(|t| t.velocity_mm_min));
    } else if style.has("axis_velocity_mm_min") {
        table.number("axis_velocity_mm_min", 2, record.iter().map(|t| t.velocity_mm_min));
    }
}

fn write_surroundings(table: &mut Table, style: &Style, record: &[Tick]) {
    let mut flag = |name: &str, on: fn(&Tick) -> bool| {
        if style.has(name) {
            table.number(name, 0, record.iter().map(|t| f64::from(u8::from(on(t)))));
        }
    };
    flag("coolant_on", |t| t.coolant);
    flag("door_open", |t| t.door_open);
    if style.has("gear_stage") {
        table.number("gear_stage", 0, record.iter().map(|t| f64::from(t.gear_stage)));
    }
    if style.has("supply_voltage_v") {
        table.number("supply_voltage_v", 2, record.iter().map(|t| t.supply_v));
    }
    if style.has("ambient_temperature_c") {
        table.number("ambient_temperature_c", 2, record.iter().map(|t| t.ambient_c));
    }
}

/// The nominal model: the base physics with values that are off by 3 to 15 %.
pub(crate) fn model(spec: &CaseSpec, style: &Style, stage: &Stage, dice: &mut Dice) -> String {
    let mut off = |value: f64| short(value * (1.0 + dice.sign() * dice.uniform(0.03, 0.15)), 9);
    let base = &stage.baseline;
    let process = match base.process {
        Process::Turning => "",
        Process::Milling => "process = \"milling\"\n",
        Process::Drilling => "process = \"drilling\"\n",
    };
    let mut text = format!(
        "schema = \"model/1\"\nname   = \"{} machine, nominal\"\noutput = \"{}\"\n\n\
         [[effect]]\nkind = \"no_load_power\"\nparameters = {{ p0_w = {}, p1_w_per_rpm = {}, p2_w_per_rpm2 = {} }}\n\n\
         [[effect]]\nkind = \"cutting_power\"\n{process}parameters = {{ kc11_n_per_mm2 = {}, mc = {} }}\n",
        spec.mode.name(),
        style.output,
        off(base.no_load[0]),
        off(base.no_load[1]),
        off(base.no_load[2]),
        off(base.kc11),
        off(base.mc),
    );
    if base.load_loss > 0.0 {
        let linear = short(base.load_loss, 4);
        text += &format!(
            "\n[[effect]]\nkind = \"load_loss\"\nparameters = {{ linear = {linear}, quadratic_per_w = 0.0 }}\n\
             fixed = [\"linear\", \"quadratic_per_w\"]\n"
        );
    }
    if style.inertia {
        let per_rpm2 = KNOWN_INERTIA_KG_M2 * (std::f64::consts::TAU / 60.0).powi(2);
        text += &format!(
            "\n[[effect]]\nkind = \"expression\"\nname = \"rotor_inertia\"\n\
             expression = \"j * spindle_speed_rpm * spindle_acceleration_rpm_per_s\"\nparameters = {{ j = {} }}\n",
            off(per_rpm2)
        );
    }
    if style.vertical {
        text += "\n[roles]\nvertical = \"z\"\n";
    }
    text
}
