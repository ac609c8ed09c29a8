//! Settings that have values of their own for one tool or one operation.

use super::settings::{Setting, SettingError, Settings, find_setting, report_unknown_setting};
use super::wear::tool_of;

/// Values of one tool or operation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlaceValues {
    operation: bool,
    name: String,
    values: Vec<(&'static Setting, f64)>,
}

impl Settings {
    /// A value for one operation, or else for one tool, in the place of the one for the machine. An operation goes before a tool.
    ///
    /// # Errors
    /// As [`Settings::set_value`]; a setting of one gear stage has no value for a tool.
    pub fn set_for(&mut self, (operation, place): (bool, &str), name: &str, value: f64) -> Result<(), SettingError> {
        let setting = find_setting(name).ok_or_else(|| report_unknown_setting(name))?;
        setting.check_value(name, value)?;
        let known = self.places.iter().position(|known| known.operation == operation && known.name == place);
        let at = known.unwrap_or_else(|| {
            self.places.push(PlaceValues { operation, name: place.to_owned(), values: Vec::new() });
            self.places.len() - 1
        });
        self.places[at].values.retain(|(known, _)| known.name != setting.name);
        self.places[at].values.push((setting, value));
        Ok(())
    }

    /// Has any tool or operation values of its own?
    pub(super) fn has_places(&self) -> bool {
        !self.places.is_empty()
    }

    /// The settings for this tool (with or without its edge) and operation.
    pub(super) fn resolve_for_place(&self, tool: &str, operation: &str) -> Self {
        let mut settings = self.clone();
        for of_operation in [false, true] {
            let here = |place: &&PlaceValues| {
                let names: [&str; 2] = if of_operation { [operation, operation] } else { [tool, tool_of(tool)] };
                place.operation == of_operation && names.contains(&place.name.as_str())
            };
            for (setting, value) in self.places.iter().filter(here).flat_map(|place| &place.values) {
                (setting.set)(&mut settings, *value);
            }
        }
        settings
    }
}

impl PartialEq for Setting {
    /// A row is known by its name.
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}
