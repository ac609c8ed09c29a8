//! Effects planted in real recordings: the noise, the gaps and the other missing physics are the machine's own.

use std::path::Path;
use std::sync::OnceLock;

use crate::concealed::case::{Case, Column, Expect, Hiding, Table};
use crate::concealed::dice::Dice;
use crate::concealed::least_squares::{Basis, rms};
use crate::concealed::real::sheet::{Sheet, folder};

/// What is planted, on which recording, and the model that knows what is known there.
struct Host {
    sheet: Sheet,
    output: &'static str,
    model: String,
    span: Vec<Vec<f64>>,
}

/// A law: name, form, and its shape over the host's rows.
type Law = (&'static str, &'static str, fn(&Host, &mut Dice) -> Vec<f64>);

const AXIS: [Law; 5] = [
    ("stribeck", "hyperbolic tangent", stribeck),
    ("zero_drift", "cabinet", drift),
    ("sensor_gain", "step", gain_step),
    ("clock_lag", "late", lag),
    ("unlisted", "cogging", cogging),
];

const SPINDLE: [Law; 2] = [("auxiliary_switch", "pump", pump), ("zero_drift", "cabinet", drift)];

/// An effect to be planted in a real recording.
pub(crate) struct Order {
    host: usize,
    law: Law,
    rho: f64,
    seed: u64,
}

const HOSTS: [(&str, &[Law]); 3] =
    [("feed-axis", &AXIS), ("milling-x", &[AXIS[0], AXIS[1], AXIS[2], AXIS[3]]), ("milling-spindle", &SPINDLE)];

impl Order {
    pub(crate) fn group(&self) -> String {
        format!("injected-{}", HOSTS[self.host].0)
    }

    pub(crate) fn name(&self) -> String {
        format!("{}-{}-rho{}-s{}", self.law.0, self.law.1.replace(' ', "_"), self.rho, self.seed)
    }

    /// The case; none when the recordings are not there.
    pub(crate) fn build(&self) -> Option<Case> {
        static READ: OnceLock<Vec<Host>> = OnceLock::new();
        let hosts = READ.get_or_init(|| folder().map(|data| hosts(&data)).unwrap_or_default());
        hosts.get(self.host).map(|host| plant(host, self))
    }
}

/// Every effect in every host for one seed; nothing when the recordings are not beside this checkout.
pub(crate) fn orders(seed: u64) -> Vec<Order> {
    if folder().is_none() {
        return Vec::new();
    }
    let mut orders = Vec::new();
    for (host, (_, laws)) in HOSTS.iter().enumerate() {
        for rho in [0.5, 1.0, 2.0] {
            orders.extend(laws.iter().map(|law| Order { host, law: *law, rho, seed }));
        }
    }
    orders
}

fn hosts(data: &Path) -> Vec<Host> {
    let read =
        |host: fn(&Path) -> Result<Host, String>| host(data).expect("a real recording that is there can be read");
    vec![read(feed_axis), read(mill_axis), read(mill_spindle)]
}

fn feed_axis(data: &Path) -> Result<Host, String> {
    let sheet = Sheet::read(&data.join("feed-axis/recording.csv.gz"))?;
    let (a, v) = (sheet.numbers("acceleration_m_s2"), sheet.numbers("velocity_m_s"));
    let span = vec![
        a,
        v.clone(),
        v.iter().map(|v| v.signum()).collect(),
        vec![1.0; v.len()],
        v.iter().map(|v| v.abs()).collect(),
    ];
    let model = "schema = \"model/1\"\nname = \"axis, known physics\"\noutput = \"force_n\"\n\n[[effect]]\nkind = \"linear\"\n\
                 columns = { acceleration_m_s2 = 90.0, velocity_m_s = 190.0, \"sign(velocity_m_s)\" = 18.0, one = 1.0, \"abs(velocity_m_s)\" = 0.0 }\n\n\
                 [roles]\nvelocity = \"velocity_m_s\"\nacceleration = \"acceleration_m_s2\"\nposition = \"position_m\"\n";
    Ok(Host { sheet, output: "force_n", model: model.into(), span })
}

fn mill_axis(data: &Path) -> Result<Host, String> {
    let sheet = Sheet::read(&data.join("milling/recording.csv.gz"))?;
    let (a, v) = (sheet.numbers("x_axis_acceleration_mm_s2"), sheet.numbers("x_axis_velocity_mm_min"));
    let sign = |v: &f64| if *v == 0.0 { 0.0 } else { v.signum() };
    let span = vec![a, v.clone(), v.iter().map(sign).collect(), vec![1.0; v.len()]];
    let model = "schema = \"model/1\"\nname = \"x axis, known physics\"\noutput = \"x_axis_current_counts\"\n\n[[effect]]\nkind = \"linear\"\n\
                 columns = { x_axis_velocity_mm_min = 0.0, x_axis_acceleration_mm_s2 = 0.0, \"sign(x_axis_velocity_mm_min)\" = 3.0, one = 0.0 }\n\n\
                 [roles]\nvelocity = \"x_axis_velocity_mm_min\"\nacceleration = \"x_axis_acceleration_mm_s2\"\nposition = \"x_axis_position_mm\"\n";
    Ok(Host { sheet, output: "x_axis_current_counts", model: model.into(), span })
}

fn mill_spindle(data: &Path) -> Result<Host, String> {
    let sheet = Sheet::read(&data.join("milling/recording.csv.gz"))?;
    let speed = sheet.numbers("spindle_speed_rpm");
    let sheet = sheet.filter(|row| speed[row] > 3000.0);
    let model = "schema = \"model/1\"\nname = \"mill spindle\"\noutput = \"spindle_power_w\"\n\n[[effect]]\nkind = \"linear\"\n\
                 columns = { one = 170.0 }\n";
    let span = vec![vec![1.0; sheet.rows()]];
    Ok(Host { sheet, output: "spindle_power_w", model: model.into(), span })
}

fn plant(host: &Host, order: &Order) -> Case {
    let Order { law: (name, form, shape), rho, seed, .. } = *order;
    let group = order.group();
    let mut dice = Dice::seeded(&format!("{group}/{name}"), seed);
    let basis = Basis::of(&host.span);
    let recorded = host.sheet.numbers(host.output);
    let own = rms(&basis.remainder(&recorded));
    let unit = shape(host, &mut dice);
    let factor = rho * own / rms(&basis.remainder(&unit)).max(1e-12);
    let contribution: Vec<f64> = unit.iter().map(|u| factor * u).collect();
    let mut table = Table::default();
    for (column, cells) in host.sheet.names.iter().zip(&host.sheet.columns).filter(|(n, _)| *n != host.output) {
        table.text(column, cells.iter().cloned());
    }
    table.number(host.output, 5, recorded.iter().zip(&contribution).map(|(r, c)| r + c));
    Case {
        group,
        name: order.name(),
        seed,
        expect: if name == "unlisted" { Expect::Unknown } else { Expect::Named },
        noise: "real".into(),
        noise_sd: own,
        table,
        model: host.model.clone(),
        hidden: vec![Hiding {
            name: name.into(),
            also: Vec::new(),
            form: form.into(),
            rho,
            absorbed: 1.0 - (rms(&basis.remainder(&contribution)) / rms(&contribution).max(1e-12)).powi(2),
            onset_row: None,
            parameters: Vec::new(),
            remainder: basis.remainder(&contribution),
            contribution,
        }],
        clean: Vec::new(),
        faults: Vec::new(),
        tangent: host.span.clone(),
        rivals: Vec::new(),
    }
}

/// The host's signed velocity over its greatest.
fn velocity(host: &Host) -> Vec<f64> {
    let top = host.span[1].iter().map(|v| v.abs()).fold(1e-12, f64::max);
    host.span[1].iter().map(|v| v / top).collect()
}

fn stribeck(host: &Host, dice: &mut Dice) -> Vec<f64> {
    let width = dice.uniform(0.05, 0.12);
    velocity(host).iter().map(|v| (v / 0.004).tanh() * (1.0 - (v.abs() / width).tanh())).collect()
}

fn drift(host: &Host, dice: &mut Dice) -> Vec<f64> {
    let rows = host.sheet.rows();
    let tau = rows as f64 / dice.uniform(6.0, 12.0);
    let (mut push, mut level) = (dice.normal(), dice.normal());
    let step = |_| {
        push += (2.0 / tau).sqrt() * dice.normal() - push / tau;
        level += (push - level) / (0.4 * tau);
        level
    };
    (0..rows).map(step).collect()
}

fn gain_step(host: &Host, dice: &mut Dice) -> Vec<f64> {
    let values = host.sheet.numbers(host.output);
    let from = values.len() * dice.whole(40, 65) / 100;
    let runs = host.sheet.text("run");
    let begin = (from..values.len()).find(|row| runs[*row] != runs[row - 1]).unwrap_or(from);
    values.iter().enumerate().map(|(row, v)| if row >= begin { *v } else { 0.0 }).collect()
}

fn lag(host: &Host, dice: &mut Dice) -> Vec<f64> {
    let values = host.sheet.numbers(host.output);
    let (whole, share) = (dice.whole(1, 2), dice.uniform(0.0, 0.9));
    let runs = host.sheet.text("run");
    let back = |row: usize, by: usize| {
        let there = row.saturating_sub(by);
        if runs[there] == runs[row] { values[there] } else { values[row] }
    };
    let late = |row: usize| (1.0 - share) * back(row, whole) + share * back(row, whole + 1);
    (0..values.len()).map(|row| late(row) - values[row]).collect()
}

fn cogging(host: &Host, dice: &mut Dice) -> Vec<f64> {
    let (pitch, phase) = (dice.uniform(0.011, 0.03), dice.uniform(0.0, 6.0));
    host.sheet.numbers("position_m").iter().map(|x| (std::f64::consts::TAU * x / pitch + phase).sin()).collect()
}

fn pump(host: &Host, dice: &mut Dice) -> Vec<f64> {
    let (mut on, mut left) = (false, 0.0);
    let step = |_| {
        left -= 1.0;
        if left <= 0.0 {
            on = !on;
            left = dice.uniform(60.0, 400.0);
        }
        f64::from(u8::from(on))
    };
    (0..host.sheet.rows()).map(step).collect()
}

/// A planted recording keeps every cell of its host but the output's.
#[test]
fn planting_changes_the_output_alone() {
    let Some(data) = folder() else {
        return println!("SKIPPED: real recordings are not beside this checkout (CNC_GATEWAY_SHARED)");
    };
    let host = feed_axis(&data).expect("the host can be read");
    let case = plant(&host, &Order { host: 0, law: AXIS[0], rho: 1.0, seed: 1 });
    let Some((_, Column::Number(output, _))) = case.table.columns.last() else {
        panic!("the output is the last column")
    };
    let recorded = host.sheet.numbers(host.output);
    let error =
        |row: usize| output[row].map_or(f64::MAX, |o| (o - recorded[row] - case.hidden[0].contribution[row]).abs());
    assert!((0..recorded.len()).all(|row| error(row) < 1e-9));
    assert_eq!(case.table.columns.len(), host.sheet.names.len());
}
