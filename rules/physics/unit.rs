//! Units of parameters in a scene: the catalogue's placeholders replaced by what the output and its drive are.

use super::{OutputKind, Scene, drive};
use adapter_core::channel::quantity;

/// The unit of a quantity by its name, else the name's own last word.
#[must_use]
pub fn find_quantity_unit(name: &str) -> &str {
    quantity::unit_of(name).unwrap_or_else(|| name.rsplit('_').next().unwrap_or(name))
}

/// The unit of a parameter in this scene. In [`super::ParameterDoc::unit`] `output` stands for the unit of the output,
/// `velocity` for m/s or, of a spindle, rad/s, and `friction` for the output itself, or the output over a velocity
/// where the output is a power.
#[must_use]
pub fn resolve_unit(unit: &str, scene: &Scene) -> String {
    let power = scene.output_kind() != OutputKind::Force;
    let velocity = if drive::is_rotary_drive(scene) { "rad/s" } else { "m/s" };
    let unit = unit.replace("friction/velocity", if power { "output/velocity2" } else { "output/velocity" });
    let unit =
        if unit == "velocity" { velocity.to_owned() } else { unit.replace("velocity", &format!("({velocity})")) };
    convert_to_newtons(&unit.replace("output", find_quantity_unit(scene.output_name())))
}

/// Watts over a velocity are newtons, over an angular velocity newton metres.
fn convert_to_newtons(unit: &str) -> String {
    let known = [
        ("W/(m/s)2", "N/(m/s)"),
        ("W/(m/s)", "N"),
        ("W/(rad/s)2", "N m/(rad/s)"),
        ("W/(rad/s)", "N m"),
        ("N/(m/s2)", "kg"),
    ];
    known.iter().find(|(long, _)| *long == unit).map_or_else(|| unit.to_owned(), |(_, short)| (*short).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::{Cells, Numbers, Recording};
    use std::collections::BTreeMap;

    fn scene(output: &str, input: &str) -> Scene {
        let mut recording = Recording::new("test", vec![0.0, 1.0], None);
        for name in [output, input] {
            recording.set_column(name, Cells::Numbers(Numbers::from_values(vec![1.0, -1.0])));
        }
        Scene::new(&recording, output, &BTreeMap::new()).expect("recorded")
    }

    #[test]
    fn units_follow_the_output_and_its_drive() {
        let spindle = scene("spindle_power_w", "spindle_speed_rpm");
        let axis = scene("force_n", "velocity_m_s");
        let current = scene("axis_current_a", "axis_velocity_mm_min");
        for (unit, in_spindle, in_axis, in_current) in [
            ("output", "W", "N", "A"),
            ("velocity", "rad/s", "m/s", "m/s"),
            ("friction/velocity", "N m/(rad/s)", "N/(m/s)", "A/(m/s)"),
            ("output/velocity", "N m", "N/(m/s)", "A/(m/s)"),
            ("1/output", "1/W", "1/N", "1/A"),
            ("N/mm2", "N/mm2", "N/mm2", "N/mm2"),
        ] {
            assert_eq!(resolve_unit(unit, &spindle), in_spindle);
            assert_eq!(resolve_unit(unit, &axis), in_axis);
            assert_eq!(resolve_unit(unit, &current), in_current);
        }
    }

    #[test]
    fn an_unknown_quantity_ends_in_its_unit() {
        assert_eq!(find_quantity_unit("thermal_error_um"), "um");
        assert_eq!(find_quantity_unit("x_force_n"), "N");
        assert_eq!(find_quantity_unit("table_force_counts"), "counts");
    }
}
