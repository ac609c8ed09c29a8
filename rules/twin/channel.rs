//! Channels by name: those of the recording, and those that nobody records but that formulas may be drawn over - the time in the run and in the cut, the direction of a slide, and what the model itself simulates.

use adapter_core::channel::quantity::Quantity;
use physics::drive::{compute_directions, has_both_directions, read_slide_velocity};
use physics::state::{apply_continuous_lag, apply_first_order_lag};
use physics::{Role, Scene, mark_contact_rows};
use std::borrow::Cow;

/// Seconds of the recording's clock.
pub(super) const TIME: &str = "time_s";
/// Seconds since the first row of the run.
pub(super) const TIME_IN_RUN: &str = "time_in_run_s";
/// Seconds since the tool went into the cut; zero outside it.
pub(super) const TIME_IN_CUT: &str = "time_in_cut_s";
/// The cut as the model simulates it, in the unit of the output.
pub(super) const SIMULATED_CUT: &str = "simulated_cut";
/// The same over the speed in thousands of turns a minute.
pub(super) const SIMULATED_CUT_PER_KRPM: &str = "simulated_cut_per_krpm";

/// The whole output as the model simulates it, in its unit.
pub(super) const SIMULATED_OUTPUT: &str = "simulated_output";
/// Seconds since the column named behind it last changed, such as that of the tool; since the first row before that.
pub(super) const TIME_SINCE_CHANGE_OF: &str = "time_since_change_of_";
/// A first-order lag behind a column: its time constant in seconds stands between this and the next.
pub(super) const LAG_OF: &str = "lag_of_";
/// What stands between the time constant and the column.
pub(super) const LAG_OF_WHAT: &str = "_s_behind_";

/// Acceleration of the slide, as recorded or as its velocity tells, in its own unit.
pub(super) const ACCELERATION: &str = "acceleration_of_motion";

/// Direction in which the slide of a feed drive moves, -1 to 1.
pub(super) const DIRECTION: &str = "direction_of_motion";

/// The values of a channel, one per row; `None` where this scene has no such channel.
pub(super) fn read_channel_values<'s>(scene: &'s Scene, name: &str) -> Option<Cow<'s, [f64]>> {
    match name {
        TIME => Some(Cow::Borrowed(scene.clock_s())),
        TIME_IN_RUN => Some(Cow::Owned(compute_time_in_run_s(scene))),
        TIME_IN_CUT => compute_time_in_cut_s(scene).map(Cow::Owned),
        DIRECTION => read_motion_direction(scene).map(Cow::Owned),
        ACCELERATION => scene.role_values(Role::Acceleration).map(Cow::Borrowed),
        SIMULATED_CUT => scene.load().map(Cow::Borrowed),
        SIMULATED_CUT_PER_KRPM => compute_cut_per_krpm(scene).map(Cow::Owned),
        SIMULATED_OUTPUT => scene.simulated_output().map(Cow::Borrowed),
        _ => scene
            .column(name)
            .or_else(|| read_role_channel(scene, name))
            .map(Cow::Borrowed)
            .or_else(|| derive_channel(scene, name)),
    }
}

/// A channel that is made of a column named in its own name.
fn derive_channel<'s>(scene: &'s Scene, name: &str) -> Option<Cow<'s, [f64]>> {
    if let Some(column) = name.strip_prefix(TIME_SINCE_CHANGE_OF) {
        return compute_time_since_change_s(scene, column).map(Cow::Owned);
    }
    let (tau_s, column) = name.strip_prefix(LAG_OF)?.split_once(LAG_OF_WHAT)?;
    let tau_s = tau_s.parse().ok().filter(|tau_s: &f64| *tau_s > 0.0)?;
    let input = scene.column(column)?;
    let is_there_always = Quantity::from_column_name(column) == Quantity::Temperature;
    let lag = if is_there_always { apply_continuous_lag } else { apply_first_order_lag };
    Some(Cow::Owned(lag(scene, input, tau_s)))
}

/// Does this channel follow what the model makes of the cut?
pub(super) fn is_simulated(name: &str) -> bool {
    [SIMULATED_CUT, SIMULATED_CUT_PER_KRPM].contains(&name)
}

/// The rows at which a column, of words or of numbers, has another value than in the row before; `None` without it.
pub(super) fn find_change_rows(scene: &Scene, column: &str) -> Option<Vec<usize>> {
    let rows = 1..scene.rows();
    if let Some(words) = scene.text_column(column) {
        return Some(rows.filter(|row| words.get(*row) != words.get(row - 1)).collect());
    }
    let values = scene.column(column)?;
    Some(rows.filter(|row| values[*row] != values[row - 1]).collect())
}

/// What a recording may call otherwise.
fn read_role_channel<'s>(scene: &'s Scene, name: &str) -> Option<&'s [f64]> {
    match name {
        "engaged" => scene.role_values(Role::Engaged),
        "spindle_speed_rpm" => scene.role_values(Role::Speed),
        _ => None,
    }
}

fn compute_time_in_run_s(scene: &Scene) -> Vec<f64> {
    let mut values = scene.time_s().to_vec();
    for run in scene.runs() {
        let start = scene.time_s()[run.start];
        values[run.clone()].iter_mut().for_each(|x| *x -= start);
    }
    values
}

fn compute_time_in_cut_s(scene: &Scene) -> Option<Vec<f64>> {
    let in_contact = mark_contact_rows(scene.role_values(Role::Engaged)?);
    let mut values = vec![0.0; scene.rows()];
    for run in scene.runs() {
        let mut since = None;
        for row in run.clone() {
            since = if in_contact[row] { since.or(Some(scene.time_s()[row])) } else { None };
            values[row] = since.map_or(0.0, |since| scene.time_s()[row] - since);
        }
    }
    Some(values)
}

fn compute_time_since_change_s(scene: &Scene, column: &str) -> Option<Vec<f64>> {
    let clock_s = scene.clock_s();
    let mut changes = find_change_rows(scene, column)?.into_iter().peekable();
    let mut since = 0;
    let at = |row: usize| {
        since = changes.next_if_eq(&row).unwrap_or(since);
        clock_s[row] - clock_s[since]
    };
    Some((0..scene.rows()).map(at).collect())
}

fn read_motion_direction(scene: &Scene) -> Option<Vec<f64>> {
    let velocity = read_slide_velocity(scene).filter(|velocity| has_both_directions(velocity))?;
    Some(compute_directions(&velocity).collect())
}

fn compute_cut_per_krpm(scene: &Scene) -> Option<Vec<f64>> {
    let (load, speed) = (scene.load()?, scene.role_values(Role::Speed)?);
    let per_krpm = |(load, rpm): (&f64, &f64)| if rpm.abs() > 1.0 { 1000.0 * load / rpm.abs() } else { 0.0 };
    Some(load.iter().zip(speed).map(per_krpm).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate_parts;
    use crate::parse_model;
    use recording::read_csv;
    use std::collections::BTreeMap;
    use std::fmt::Write;

    const MODEL: &str = "schema = \"model/1\"\noutput = \"spindle_power_w\"\n[[effect]]\nkind = \"cutting_power\"\n\
                         parameters = { kc11_n_per_mm2 = 1800.0, mc = 0.25 }\n";

    /// Passes of twelve seconds at a depth that changes, simulated.
    fn cut() -> Scene {
        let mut text = String::from(
            "time_s,run,spindle_power_w,spindle_speed_rpm,engaged,depth_of_cut_mm,feed_per_rev_mm,cutting_speed_m_min\n",
        );
        for row in 0..80_u32 {
            let (engaged, depth) = (u8::from(row % 20 >= 8), 1.0 + 0.1 * f64::from(row / 20));
            writeln!(text, "{row},a{},500,900,{engaged},{depth:.1},0.2,150", row / 40).expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let mut scene = Scene::new(&recording, "spindle_power_w", &BTreeMap::new()).expect("recorded");
        simulate_parts(&parse_model(MODEL).expect("fine").parts, &mut scene).expect("simulated");
        scene
    }

    #[test]
    fn a_column_of_words_or_of_numbers_tells_how_long_ago_it_changed() {
        let text = "time_s,run,spindle_power_w,tool,depth_of_cut_mm\n0,a,1,T1,1\n2,a,1,T1,2\n4,a,1,T2,2\n7,a,1,T2,2\n";
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let scene = Scene::new(&recording, "spindle_power_w", &BTreeMap::new()).expect("recorded");
        let since = |column: &str| read_channel_values(&scene, &format!("{TIME_SINCE_CHANGE_OF}{column}"));
        assert_eq!(since("tool").as_deref(), Some(&[0.0, 2.0, 0.0, 3.0][..]));
        assert_eq!(since("depth_of_cut_mm").as_deref(), Some(&[0.0, 0.0, 2.0, 5.0][..]));
        assert_eq!(since("coolant"), None, "what is not recorded");
    }

    #[test]
    fn a_lag_needs_a_time_constant_and_a_column_that_are_there() {
        let scene = cut();
        for name in ["lag_of_0_s_behind_engaged", "lag_of_x_s_behind_engaged", "lag_of_5_s_behind_nothing", "lag_of_5"]
        {
            assert_eq!(read_channel_values(&scene, name), None, "{name}");
        }
        let lag = read_channel_values(&scene, "lag_of_5_s_behind_spindle_speed_rpm").expect("there");
        assert!(lag.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] < 900.0 + 1e-6), "from zero to the speed");
    }
}
