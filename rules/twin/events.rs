//! Events: what happens by itself, whatever the machine does - once, again and again, after each change of the tool, or at
//! one place of a slide or of every turn of its screw.
//!
//! They are described where nothing is named at all. Beside a name they would only bend along with whatever its law leaves,
//! for every program repeats.

use super::channel::{LAG_OF, LAG_OF_WHAT, TIME, TIME_SINCE_CHANGE_OF, changes_of, channel_values, positions};
use super::designs::Design;
use super::empirical::{Empirical, FADING_PERIODS, Multiplier, Shape, as_design};
use super::fit::Fit;
use super::frame::Frame;
use super::noise::Arma;
use super::offered::empirical_channels;
use super::periodic::{waves_in_time, waves_of_friction};
use super::recurring_pulses::recurring_pulses;
use crate::physics::{OutputKind, Scene};
use crate::statistics::count;

/// Places over the clock, or along a slide, at which a peak is tried.
const PLACES: usize = 16;
/// Half widths of it, as shares of the whole.
const WIDTHS: [f64; 2] = [0.02, 0.06];
/// Changes of a tool from which what follows them is a condition and not an event.
const CHANGES_MIN: usize = 3;
/// What follows a change fades over so long, s.
const FADING_S: [f64; 6] = [20.0, 50.0, 120.0, 300.0, 700.0, 1800.0];

/// Time constants behind a recorded input, s; those that lie between so many sampling periods and a share of the whole.
const LAGS_S: [f64; 5] = [10.0, 60.0, 300.0, 1500.0, 7200.0];
/// Sampling periods of the shortest.
const LAG_PERIODS: f64 = 3.0;
/// Share of the whole time of the longest.
const LAG_SHARE: f64 = 0.3;
/// What comes again and again is part of what the noise of a fit without it remembers: it is looked for beside less.
const LESS_MEMORY: Arma = Arma { phi: 0.5, theta: 0.0 };

/// Every event worth trying on top of a fit.
pub(super) fn event_designs(scene: &Scene, frame: &Frame, from: &Fit) -> Vec<Design> {
    let noises = [from.noise, LESS_MEMORY];
    let again = noises.into_iter().flat_map(|noise| waves_in_time(scene, frame, &from.residual, noise));
    let tight = noises.into_iter().flat_map(|noise| waves_of_friction(scene, frame, &from.residual, noise));
    let pulses = noises.into_iter().flat_map(|noise| recurring_pulses(scene, frame, &from.residual, noise));
    let forms = once(scene)
        .into_iter()
        .chain(at_a_place(scene))
        .chain(again)
        .chain(tight)
        .chain(pulses)
        .chain(after_changes(scene))
        .chain(lagging(scene));
    forms.filter_map(|form| as_design(form, scene, frame)).collect()
}

/// A peak somewhere over the clock.
fn once(scene: &Scene) -> Vec<Empirical> {
    peaks_along(TIME, (0.0, scene.clock_s().last().copied().unwrap_or(0.0)), &[Multiplier::Always])
}

/// A peak somewhere along a slide: a chip, a dent, a cover that drags.
fn at_a_place(scene: &Scene) -> Vec<Empirical> {
    let along = |position: &str| {
        let at = scene.column(position).unwrap_or_default();
        let ends = at.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
        peaks_along(position, ends, &[Multiplier::Always, Multiplier::AgainstMotion])
    };
    positions(scene).flat_map(along).collect()
}

/// Peaks of two widths at places from one end of a channel to the other; none where they are the same.
fn peaks_along(channel: &str, (low, high): (f64, f64), factors: &[Multiplier]) -> Vec<Empirical> {
    let length = high - low;
    let peak = |place: usize, width: f64, factor: Multiplier| Empirical {
        channel: channel.to_owned(),
        shape: Shape::Peak(low + length * (count(place) + 0.5) / count(PLACES), width * length),
        origin: 0.0,
        scale: length,
        factor,
    };
    let shapes = (0..PLACES).filter(|_| high > low).flat_map(|place| WIDTHS.map(|width| (place, width)));
    shapes.flat_map(|(place, width)| factors.iter().map(move |factor| peak(place, width, *factor))).collect()
}

/// What each change of the tool begins with and loses over time.
fn after_changes(scene: &Scene) -> Vec<Empirical> {
    let told = |over_s: &f64| *over_s >= FADING_PERIODS * scene.period_s();
    let factors: &[Multiplier] = match scene.output_kind() {
        OutputKind::Displacement => &[Multiplier::Always],
        _ => &[Multiplier::Always, Multiplier::InTheCut, Multiplier::WithTheCut],
    };
    let columns = tool_columns(scene);
    let forms = columns.iter().flat_map(|column| FADING_S.iter().filter(|s| told(s)).map(move |s| (column, *s)));
    let fading = |(column, over_s): (&String, f64), factor: Multiplier| Empirical {
        channel: format!("{TIME_SINCE_CHANGE_OF}{column}"),
        shape: Shape::Fading(over_s),
        origin: 0.0,
        scale: 1.0,
        factor,
    };
    forms.flat_map(|form| factors.iter().map(move |factor| fading(form, *factor))).collect()
}

/// What follows a recorded input slowly: oil that warms while a pump runs, a casting behind what heats it.
fn lagging(scene: &Scene) -> Vec<Empirical> {
    let whole_s = scene.clock_s().last().copied().unwrap_or(0.0);
    let told = |tau_s: &f64| *tau_s >= LAG_PERIODS * scene.period_s() && *tau_s <= LAG_SHARE * whole_s;
    let behind = |column: &String, tau_s: f64| {
        let channel = format!("{LAG_OF}{tau_s}{LAG_OF_WHAT}{column}");
        let values = channel_values(scene, &channel)?;
        let high = values.iter().fold(0.0_f64, |high, x| high.max(x.abs()));
        let form =
            Empirical { channel, shape: Shape::Bent(Vec::new()), origin: 0.0, scale: high, factor: Multiplier::Always };
        (high > 0.0).then_some(form)
    };
    let columns = empirical_channels(scene);
    columns
        .iter()
        .flat_map(|column| LAGS_S.iter().filter(|tau_s| told(tau_s)).filter_map(|s| behind(column, *s)))
        .collect()
}

/// Columns that tell which tool is in use and were seen to change.
fn tool_columns(scene: &Scene) -> Vec<String> {
    let names = ["tool", "tool_length_mm", "tool_diameter_mm"];
    let seen = |name: &&str| changes_of(scene, name).is_some_and(|changes| changes.len() >= CHANGES_MIN);
    names.into_iter().find(seen).into_iter().map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapters::recording::read_csv;
    use std::collections::BTreeMap;
    use std::fmt::Write;

    /// A spindle that runs, with a new tool every so many rows, one second apart.
    fn scene(rows_per_tool: usize) -> Scene {
        let mut text = String::from("time_s,spindle_power_w,spindle_speed_rpm,engaged,tool\n");
        for row in 0..600 {
            writeln!(text, "{row},500,{},1,T{}", 900 + row % 7, row / rows_per_tool).expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        Scene::new(&recording, "spindle_power_w", &BTreeMap::new()).expect("recorded")
    }

    #[test]
    fn what_happens_once_may_happen_anywhere() {
        let scene = scene(100);
        let places = once(&scene);
        assert_eq!(places.len(), PLACES * WIDTHS.len());
        let middle = |form: &Empirical| if let Shape::Peak(middle, _) = form.shape { middle } else { f64::NAN };
        assert!(places.iter().map(middle).all(|middle| (0.0..599.0).contains(&middle)));
    }

    #[test]
    fn a_place_lies_on_the_way_of_the_slide() {
        let mut text = String::from("time_s,axis_force_n,axis_position_mm\n");
        for row in 0..100 {
            writeln!(text, "{row},80,{}", -20.0 + f64::from(row)).expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let scene = Scene::new(&recording, "axis_force_n", &BTreeMap::new()).expect("recorded");
        let places = at_a_place(&scene);
        assert_eq!(places.len(), 2 * PLACES * WIDTHS.len());
        let inside = |form: &Empirical| matches!(form.shape, Shape::Peak(middle, _) if (-20.0..79.0).contains(&middle));
        assert!(places.iter().all(inside), "{places:?}");
    }

    #[test]
    fn changes_of_a_tool_are_events_once_there_are_some() {
        let changes = after_changes(&scene(100));
        assert!(changes.iter().all(|form| form.channel == "time_since_change_of_tool") && !changes.is_empty());
        assert_eq!(after_changes(&scene(250)), [], "two changes");
    }

    #[test]
    fn a_lag_lies_between_the_rows_and_the_whole() {
        let lags = lagging(&scene(100));
        let of_speed: Vec<&str> =
            lags.iter().map(|form| form.channel.as_str()).filter(|name| name.ends_with("spindle_speed_rpm")).collect();
        assert_eq!(of_speed, ["lag_of_10_s_behind_spindle_speed_rpm", "lag_of_60_s_behind_spindle_speed_rpm"]);
    }
}
