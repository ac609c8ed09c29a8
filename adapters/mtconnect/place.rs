//! Where in a machine a component stands: which one is the spindle, which are the axes, which path of the control.

use crate::model::{Component, Device};
use adapter_core::channel::find_nearest_name;
use adapter_core::driver::SourceProblem;

/// Where a component stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ComponentPlace {
    /// The device as a whole.
    Device,
    Controller,
    /// A path of the control, from 1.
    Path(u8),
    Spindle,
    SpindleMotor,
    /// The X, Y or Z axis.
    Linear(char),
    Electric,
    Coolant,
    Environment,
    Elsewhere,
}

/// Types that only a spindle has.
const SPEEDS: [&str; 2] = ["ROTARY_VELOCITY", "SPINDLE_SPEED"];

/// The place of every component of a device. `spindle` is what the address says.
pub(crate) fn find_places(device: &Device, spindle: Option<&str>) -> (Vec<ComponentPlace>, Vec<SourceProblem>) {
    let (spindle, problem) = find_spindle(device, spindle);
    let mut places: Vec<ComponentPlace> = Vec::with_capacity(device.components.len());
    let mut paths = 0_u8;
    for (index, part) in device.components.iter().enumerate() {
        let place = match part.kind.as_str() {
            _ if Some(index) == spindle => ComponentPlace::Spindle,
            _ if index == 0 => ComponentPlace::Device,
            "Controller" => ComponentPlace::Controller,
            "Path" => {
                paths = paths.saturating_add(1);
                ComponentPlace::Path(paths)
            }
            "Linear" => find_axis_letter(part).map_or(ComponentPlace::Elsewhere, ComponentPlace::Linear),
            "Motor" if part.parent.is_some() && part.parent == spindle => ComponentPlace::SpindleMotor,
            "Electric" => ComponentPlace::Electric,
            "Coolant" => ComponentPlace::Coolant,
            "Environmental" => ComponentPlace::Environment,
            _ => ComponentPlace::Elsewhere,
        };
        // A second axis of the same letter belongs to another turret.
        let is_second = matches!(place, ComponentPlace::Linear(_)) && places.contains(&place);
        places.push(if is_second { ComponentPlace::Elsewhere } else { place });
    }
    (places, problem.into_iter().collect())
}

/// `X`, also as `X1`.
fn find_axis_letter(part: &Component) -> Option<char> {
    let words = [part.name.as_deref(), part.native_name.as_deref()];
    words.into_iter().flatten().find_map(|word| {
        let word = word.trim().to_ascii_uppercase();
        let letter = word.strip_suffix('1').unwrap_or(&word);
        ["X", "Y", "Z"].contains(&letter).then(|| letter.chars().next())?
    })
}

/// The component that turns the spindle. Where several can be it, nobody knows which is meant.
fn find_spindle(device: &Device, wanted: Option<&str>) -> (Option<usize>, Option<SourceProblem>) {
    if let Some(wanted) = wanted {
        let has_name = |part: &Component| {
            part.id == wanted || part.name.as_deref() == Some(wanted) || part.native_name.as_deref() == Some(wanted)
        };
        let found = device.components.iter().position(has_name);
        return (found, if found.is_none() { Some(build_unknown_spindle_problem(device, wanted)) } else { None });
    }
    let has_speed =
        |index: usize| device.items.iter().any(|item| item.component == index && SPEEDS.contains(&item.kind.as_str()));
    let turning: Vec<usize> = (0..device.components.len()).filter(|index| has_speed(*index)).collect();
    let rank = |index: &usize| rank_spindle(&device.components[*index]);
    let Some(best) = turning.iter().map(rank).min() else { return (None, None) };
    let likely: Vec<usize> = turning.into_iter().filter(|index| rank(index) == best).collect();
    match likely.as_slice() {
        [only] => (Some(*only), None),
        several => {
            let names: Vec<&str> = several.iter().map(|index| name_component(&device.components[*index])).collect();
            let problem = SourceProblem {
                what: format!(
                    "the spindle's channels have no value: {} turn, and nothing tells which is meant",
                    names.join(", ")
                ),
                next: format!("Name it in the address: spindle={}", names[0]),
            };
            (None, Some(problem))
        }
    }
}

/// The likelier a spindle, the less: by its mode, then by its name.
fn rank_spindle(part: &Component) -> u8 {
    let words = [part.native_name.as_deref(), part.name.as_deref()];
    let is_named = words.into_iter().flatten().any(|word| word.to_ascii_uppercase().starts_with('S'));
    match (part.is_spindle, is_named) {
        (true, true) => 0,
        (true, false) => 1,
        (false, true) => 2,
        (false, false) => 3,
    }
}

/// The name by which a person knows a component.
pub(crate) fn name_component(part: &Component) -> &str {
    part.name.as_deref().unwrap_or(&part.id)
}

fn build_unknown_spindle_problem(device: &Device, wanted: &str) -> SourceProblem {
    let names: Vec<&str> = device.components.iter().map(name_component).collect();
    let near = find_nearest_name(wanted, names.iter().copied());
    let next = match near {
        Some(near) => format!("Did you mean spindle={near}?"),
        None => {
            format!("Name one of its components: {}", names.iter().take(20).copied().collect::<Vec<_>>().join(", "))
        }
    };
    SourceProblem { what: format!("the spindle's channels have no value: the device has no component {wanted}"), next }
}

/// The path that a component belongs to; `None` for what belongs to the whole control.
pub(crate) fn find_path(device: &Device, places: &[ComponentPlace], component: usize) -> Option<u8> {
    let mut at = Some(component);
    // A component stands behind the one that it is a part of, so that this ends.
    while let Some(index) = at {
        if let Some(ComponentPlace::Path(path)) = places.get(index) {
            return Some(*path);
        }
        at = device.components.get(index).and_then(|part| part.parent).filter(|parent| *parent < index);
    }
    None
}
