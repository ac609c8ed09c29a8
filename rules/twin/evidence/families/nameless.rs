//! Nameless families: whatever changes smoothly over one channel, by levels of a group, or in waves over a way.
//!
//! They stand for every law that nobody has written down. What they find may still get a name, when its curve is that of
//! a named family (`naming.rs`).

use super::drive::is_drive;
use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Drawn, VariantBank};
use crate::model::Model;
use adapter_core::channel::quantity::Quantity;
use physics::OutputKind;

/// Bumps over a channel, and over one that a machine may resonate or jam along.
const BUMPS: usize = 7;
const FINE_BUMPS: usize = 15;
/// Levels of a group, at most.
const LEVELS_MAX: usize = 30;
/// Groups that may have a level each.
const GROUPS: [&str; 7] = ["run", "tool", "operation", "program", "part", "lot", "pass"];
/// Waves along the way of a slide.
const WAVES: [f64; 5] = [2.0, 4.0, 8.0, 16.0, 32.0];
/// Words in the names of channels that are measured beside the output: no inputs, unless the model reads them. A power or a
/// current is none even then, for its own noise would bend a curve over it.
const ELECTRIC: [&str; 3] = ["_power", "_current", "_load_"];
const MEASURED: [&str; 4] = ["torque", "force_n", "_counts", "thermal_error"];
/// Channels that mean something in the cut only.
const OF_THE_CUT: [&str; 9] = [
    "depth_of_cut_mm",
    "feed_per_rev_mm",
    "cutting_speed_m_min",
    "diameter_mm",
    "pass_progress",
    "load",
    "torque",
    "width_of_cut_mm",
    "removal_rate_cm3_min",
];

/// What multiplies a curve.
struct Carrier {
    name: &'static str,
    values: Vec<f64>,
}

/// A channel that a curve is drawn over.
struct Channel {
    name: String,
    values: Vec<f64>,
    fine: bool,
}

/// Adds every nameless curve.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, model: &Model, bank: &mut VariantBank) {
    let carriers = build_carriers(inputs);
    for channel in list_channels(inputs, model) {
        let cut_only = OF_THE_CUT.contains(&channel.name.as_str());
        let in_cut = cut_only && inputs.engaged.is_some();
        let coarse = build_bump_basis(inputs, &channel.values, in_cut, BUMPS);
        let fine =
            if channel.fine { build_bump_basis(inputs, &channel.values, in_cut, FINE_BUMPS) } else { Vec::new() };
        for carrier in &carriers {
            let drawn = |shape: &'static str| Drawn { over: channel.name.clone(), times: carrier.name, shape };
            let cuts = carrier.name == "cut" || carrier.name == "engaged";
            let alone =
                inputs.engaged.is_some() && (cut_only || channel.name == "tool_age" || channel.name == "feed_mm_min");
            if fine.len() > BUMPS + 1
                && (carrier.name == "1" || cuts)
                && !(carrier.name == "engaged" && inputs.knows_cut)
            {
                add_curve(inputs, bank, drawn("fine bumps"), &fine, carrier);
            }
            let slow = channel.name == "time" || Quantity::from_column_name(&channel.name) == Quantity::Temperature;
            let skipped = carrier.name == "1" && alone
                || carrier.name == "speed" && !slow
                || carrier.name == "engaged" && inputs.knows_cut && !allows_cut_offset(&channel.name);
            if !skipped && !coarse.is_empty() {
                add_curve(inputs, bank, drawn("bumps"), &coarse, carrier);
            }
        }
    }
    add_levels(inputs, &carriers, bank);
    add_waves(inputs, bank);
}

/// Channels over which something may stand in the cut that does not grow with it.
fn allows_cut_offset(name: &str) -> bool {
    let speeds = ["spindle_speed_rpm", "cutting_speed_m_min", "feed_per_rev_mm", "depth_of_cut_mm"];
    speeds.contains(&name) || ["tool_age", "torque"].contains(&name)
}

fn add_curve(
    inputs: &RecordingInputs<'_>,
    bank: &mut VariantBank,
    drawn: Drawn,
    curve: &[Vec<f64>],
    carrier: &Carrier,
) {
    let columns = curve.iter().map(|bump| (inputs.build_column(|row| bump[row] * carrier.values[row]), 1.0));
    bank.begin_nameless_curve(drawn).with_given_size().add_columns(inputs, columns);
}

/// Every carrier at unit size where it acts.
fn build_carriers(inputs: &RecordingInputs<'_>) -> Vec<Carrier> {
    let mut all = vec![Carrier { name: "1", values: vec![1.0; inputs.rows] }];
    if inputs.engaged.is_some() {
        all.push(Carrier { name: "engaged", values: inputs.build_column(|row| inputs.cut_indicator(row)) });
    }
    if let Some(cut) = inputs.cut.as_ref().filter(|_| inputs.knows_cut) {
        all.push(Carrier { name: "cut", values: cut.clone() });
    }
    if let Some(velocity) = inputs.velocity.as_ref().filter(|_| is_drive(inputs)) {
        all.push(Carrier {
            name: "direction",
            values: velocity.iter().map(|v| if *v == 0.0 { 0.0 } else { v.signum() }).collect(),
        });
    }
    if let Some(speed) = inputs.speed.as_ref().filter(|_| inputs.kind != OutputKind::Displacement) {
        all.push(Carrier { name: "speed", values: speed.clone() });
    }
    for carrier in &mut all {
        let acting: Vec<f64> =
            inputs.fitted_rows(false).map(|row| carrier.values[row]).filter(|x| x.abs() > 1e-9).collect();
        let size = numerics::statistics::rms(&acting).max(f64::MIN_POSITIVE);
        carrier.values.iter_mut().for_each(|x| *x /= size);
    }
    all
}

fn list_channels(inputs: &RecordingInputs<'_>, model: &Model) -> Vec<Channel> {
    let scene = inputs.scene;
    let read: Vec<&str> = model.parts.iter().flat_map(|part| part.inputs()).collect();
    let is_input = |name: &str| {
        let any = |words: &[&str]| words.iter().any(|word| name.contains(word));
        let declared = physics::Role::ALL.iter().any(|role| scene.role_name(*role) == Some(name));
        name != scene.output_name() && !any(&ELECTRIC) && (!any(&MEASURED) || declared || read.contains(&name))
    };
    let mut all: Vec<Channel> = Vec::new();
    let mut add = |name: &str, values: Vec<f64>, fine: bool| {
        let spread = inputs.compute_deviation(&values, false);
        let size = inputs.compute_mean(&values, false).abs() + 1.0;
        if spread > 1e-9 * size && !all.iter().any(|known| known.name == name) {
            all.push(Channel { name: name.to_owned(), values, fine });
        }
    };
    for name in scene.column_names().filter(|name| is_input(name) && !["cutting_time_min", "engaged"].contains(name)) {
        let fine = name.contains("speed") || name.contains("position") || name.contains("velocity");
        add(name, scene.column(name).unwrap_or_default().to_vec(), fine && !name.contains("feed"));
    }
    if inputs.engaged.is_some() {
        add("tool_age", inputs.edge_age_min.clone(), false);
        add("pass_progress", inputs.progress.clone(), true);
    }
    add("time", inputs.clock_s.clone(), false);
    if let Some(cut) = inputs.cut.as_ref().filter(|_| inputs.knows_cut) {
        add("load", cut.clone(), false);
        if let Some(speed) = &inputs.speed {
            add("torque", inputs.build_column(|row| cut[row] / speed[row].max(30.0)), false);
        }
    }
    all
}

/// Gaussian bumps on knots between the quantiles and an even spacing; levels where a channel has three values or fewer.
fn build_bump_basis(inputs: &RecordingInputs<'_>, values: &[f64], in_cut: bool, wanted: usize) -> Vec<Vec<f64>> {
    let sorted = inputs.sort_fitted_values(values, in_cut);
    let mut distinct = sorted.clone();
    distinct.dedup();
    if distinct.len() < 2 {
        return Vec::new();
    }
    if distinct.len() <= 3 {
        return distinct[1..]
            .iter()
            .map(|x| inputs.build_column(|row| f64::from(u8::from(values[row] == *x))))
            .collect();
    }
    let last = sorted.len() - 1;
    let at = |share: f64| {
        let place = share * numerics::statistics::count_to_f64(last);
        let low = place.floor();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count lies within it"
        )]
        let index = low as usize;
        sorted[index] + (place - low) * (sorted[(index + 1).min(last)] - sorted[index])
    };
    let step = |k: usize| numerics::statistics::count_to_f64(k) / numerics::statistics::count_to_f64(wanted - 1);
    let mut quantiles: Vec<f64> = (0..wanted).map(|k| at(0.02 + 0.96 * step(k))).collect();
    let spread = quantiles[wanted - 1] - quantiles[0];
    quantiles.dedup_by(|b, a| *b - *a <= 1e-12 * spread.max(1e-9));
    if quantiles.len() < 2 {
        return Vec::new();
    }
    let (size, low) = (quantiles.len(), quantiles[0]);
    let range = quantiles[size - 1] - low;
    let even =
        |k: usize| low + range * numerics::statistics::count_to_f64(k) / numerics::statistics::count_to_f64(size - 1);
    let knots: Vec<f64> = (0..size).map(|k| f64::midpoint(quantiles[k], even(k))).collect();
    let least = range / numerics::statistics::count_to_f64(2 * wanted);
    let width = |k: usize| {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(size - 1));
        ((knots[after] - knots[before]) / numerics::statistics::count_to_f64(after - before)).max(least)
    };
    (0..size)
        .map(|k| {
            let (centre, width) = (knots[k], width(k));
            inputs.build_column(|row| (-0.5 * ((values[row] - centre) / width).powi(2)).exp())
        })
        .collect()
}

fn add_levels(inputs: &RecordingInputs<'_>, carriers: &[Carrier], bank: &mut VariantBank) {
    for group in GROUPS {
        let Some(codes) = read_group_codes(inputs, group) else { continue };
        for carrier in carriers.iter().filter(|carrier| ["1", "cut"].contains(&carrier.name)) {
            let (known, columns) = inputs.build_member_columns(&codes, &carrier.values);
            if !(2..=LEVELS_MAX).contains(&known) {
                continue;
            }
            let drawn = Drawn { over: group.to_owned(), times: carrier.name, shape: "levels" };
            bank.begin_nameless_curve(drawn).add_columns(inputs, columns.into_iter().map(|column| (column, 1.0)));
        }
    }
}

/// The member of a group that each row belongs to.
fn read_group_codes(inputs: &RecordingInputs<'_>, group: &str) -> Option<Vec<usize>> {
    if group == "run" {
        return Some(inputs.run.clone());
    }
    let words = inputs.scene.text_column(group)?;
    Some((0..inputs.rows).map(|row| words.find_code(row).map_or(usize::MAX, |code| code as usize)).collect())
}

fn add_waves(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(position) = &inputs.position else { return };
    let sorted = inputs.sort_fitted_values(position, false);
    let (Some(low), Some(high)) = (sorted.first(), sorted.last()) else { return };
    for turns in WAVES.into_iter().filter(|_| high > low) {
        let angle = |row: usize| std::f64::consts::TAU * turns * position[row] / (high - low);
        let columns =
            [(inputs.build_column(|row| angle(row).cos()), 1.0), (inputs.build_column(|row| angle(row).sin()), 1.0)];
        let drawn = Drawn { over: "position".to_owned(), times: "1", shape: "wave" };
        bank.begin_nameless_curve(drawn).add_columns(inputs, columns);
    }
}
