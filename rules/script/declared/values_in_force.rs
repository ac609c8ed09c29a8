//! The values in force for one script: which stand in its text, and which are looked up by tool and operation.

use super::{DeclarationPlace, Declared, FoundDeclaration, SettingValue, SettingValues};
use adapter_core::{ChannelId, Sample};
use estimators::wear::tool_of;
use rhai::Dynamic;
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Debug, Clone, Default)]
pub(crate) struct Force {
    /// The value of each declaration as it stands in the text; `None` where it is looked up.
    pub(crate) texts: Vec<Option<SettingValue>>,
    /// What is looked up.
    pub(crate) live: LiveValues,
    /// Is anything else than the default in force?
    pub(crate) chosen: bool,
}

impl Force {
    /// The values of this file for these declarations. One that the declaration does not allow is left out: it is a problem of
    /// the file.
    pub(crate) fn from_values(found: &[FoundDeclaration], values: &SettingValues) -> Self {
        let mut force = Self::default();
        for (index, it) in found.iter().enumerate() {
            let declared = &it.declared;
            let allowed = |place: &DeclarationPlace| find_allowed(declared, values, place);
            let machine = allowed(&DeclarationPlace::Machine).unwrap_or_else(|| declared.default.clone());
            let places = values.list_places(declared.section()).into_iter();
            let special: Vec<(DeclarationPlace, SettingValue)> = places
                .filter(|place| place.per().is_some_and(|per| declared.per.contains(&per)))
                .filter_map(|place| Some((allowed(&place)?, place)))
                .map(|(value, place)| (place, value))
                .collect();
            force.chosen |= machine != declared.default || !special.is_empty();
            force.texts.push(special.is_empty().then(|| machine.clone()));
            force.live.add(index, it.constant.as_deref(), &machine, special);
        }
        force
    }

    /// The values of the machine, or of one place, all of them in the text.
    pub(crate) fn with_fixed_values(
        found: &[FoundDeclaration],
        values: &SettingValues,
        place: &DeclarationPlace,
    ) -> Self {
        let text = |it: &FoundDeclaration| {
            let declared = &it.declared;
            let own = find_allowed(declared, values, place)
                .or_else(|| find_allowed(declared, values, &DeclarationPlace::Machine));
            own.unwrap_or_else(|| declared.default.clone())
        };
        let texts: Vec<Option<SettingValue>> = found.iter().map(|it| Some(text(it))).collect();
        let chosen = found.iter().zip(&texts).any(|(it, value)| value.as_ref() != Some(&it.declared.default));
        Self { texts, live: LiveValues::default(), chosen }
    }
}

/// The value that the file has for this place, where the declaration allows it.
fn find_allowed(declared: &Declared, values: &SettingValues, place: &DeclarationPlace) -> Option<SettingValue> {
    let value = values.find_value(declared.section(), &declared.name, place)?;
    declared.explain_refusal(value).is_none().then(|| value.clone())
}

/// Values that depend on the tool or the operation.
#[derive(Debug, Clone, Default)]
pub(crate) struct LiveValues {
    /// Value of the machine for every declaration; unit where it stands in the text.
    machine: Vec<Dynamic>,
    special: BTreeMap<DeclarationPlace, Vec<(usize, Dynamic)>>,
    /// Constants whose value is looked up, with the number of their declaration.
    pub(crate) constants: Vec<(String, usize)>,
}

impl LiveValues {
    fn add(
        &mut self,
        index: usize,
        constant: Option<&str>,
        machine: &SettingValue,
        special: Vec<(DeclarationPlace, SettingValue)>,
    ) {
        self.machine.push(if special.is_empty() { Dynamic::UNIT } else { to_dynamic(machine) });
        if let Some(constant) = constant.filter(|_| !special.is_empty()) {
            self.constants.push((constant.to_owned(), index));
        }
        for (place, value) in special {
            self.special.entry(place).or_default().push((index, to_dynamic(&value)));
        }
    }

    /// Is nothing looked up?
    pub(crate) fn is_empty(&self) -> bool {
        self.special.is_empty()
    }

    /// Every tool and operation with values of its own.
    pub(crate) fn places(&self) -> impl Iterator<Item = &DeclarationPlace> {
        self.special.keys()
    }

    /// The values for one place.
    pub(crate) fn values_for_place(&self, place: &DeclarationPlace) -> Arc<[Dynamic]> {
        match place {
            DeclarationPlace::Machine => self.compose_values(None, None),
            DeclarationPlace::Tool(tool) => self.compose_values(Some(tool), None),
            DeclarationPlace::Operation(operation) => self.compose_values(None, Some(operation)),
        }
    }

    /// The values for this tool, or the tool of this edge, and this operation; the operation goes before the tool.
    fn compose_values(&self, tool: Option<&str>, operation: Option<&str>) -> Arc<[Dynamic]> {
        let mut values = self.machine.clone();
        let places = [
            tool.map(|edge| DeclarationPlace::Tool(tool_of(edge).to_owned())),
            tool.map(|edge| DeclarationPlace::Tool(edge.to_owned())),
            operation.map(|it| DeclarationPlace::Operation(it.to_owned())),
        ];
        for (index, value) in places.iter().flatten().filter_map(|place| self.special.get(place)).flatten() {
            values[*index] = value.clone();
        }
        values.into()
    }
}

fn to_dynamic(value: &SettingValue) -> Dynamic {
    match value {
        SettingValue::Number(number) => Dynamic::from_float(*number),
        SettingValue::Text(text) => text.as_str().into(),
    }
}

/// The values that hold now, looked up anew when the tool or the operation has changed.
#[derive(Debug, Default)]
pub(crate) struct Now {
    tool: Option<String>,
    operation: Option<String>,
    values: Option<Arc<[Dynamic]>>,
}

impl Now {
    /// The values for this sample.
    pub(crate) fn update_values(&mut self, live: &LiveValues, sample: &Sample) -> Arc<[Dynamic]> {
        let text = |name: &str| ChannelId::from_name(name).and_then(|id| sample.text(id));
        let (tool, operation) = (text("tool"), text("operation"));
        match &self.values {
            Some(values) if self.tool.as_deref() == tool && self.operation.as_deref() == operation => values.clone(),
            _ => {
                let values = live.compose_values(tool, operation);
                (self.tool, self.operation) = (tool.map(str::to_owned), operation.map(str::to_owned));
                self.values.insert(values).clone()
            }
        }
    }
}
