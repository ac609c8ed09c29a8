//! Which model of a library is for this cut: the exact edge before its tool, then the operation, the work material, any.

use super::record::WearRecord;
use adapter_core::model_library::WearKey;
use adapter_core::tool_name::tool_of;
use std::sync::Arc;

/// A model, and what speaks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChosenModel<'a, R> {
    /// The model that was chosen.
    pub record: &'a R,
    /// Of what it names most: `edge`, `tool`, `operation`, `work material`, `machine`, `any`.
    pub by: &'static str,
}

/// How well a model with this key fits a cut; `None` when it names something else than the cut. An empty text of the model
/// fits everything; a model of a tool fits all edges of it.
fn rank_fit(key: &WearKey, cut: &WearKey) -> Option<u8> {
    let agrees = |mine: &str, theirs: &str| mine.is_empty() || mine == theirs;
    let edge = !key.tool.is_empty() && key.tool == cut.tool;
    let tool = edge || key.tool == tool_of(&cut.tool);
    let others =
        [(&key.machine, &cut.machine), (&key.work_material, &cut.work_material), (&key.operation, &cut.operation)];
    if !(key.tool.is_empty() || tool) || !others.iter().all(|(mine, theirs)| agrees(mine, theirs)) {
        return None;
    }
    let named = [edge, tool && !key.tool.is_empty(), !key.operation.is_empty(), !key.work_material.is_empty()];
    let named = named.into_iter().chain([!key.machine.is_empty()]);
    Some(named.fold(0, |sum, named| 2 * sum + u8::from(named)))
}

/// The best model for a cut; of equals the last, which is the newest. `key` reads what a model is for.
pub fn choose_model<'a, R>(
    models: &'a [R],
    cut: &WearKey,
    key: impl Fn(&R) -> &WearRecord,
) -> Option<ChosenModel<'a, R>> {
    let fitting = models.iter().filter_map(|model| Some((rank_fit(&key(model).key, cut)?, model)));
    let (rank, record) = fitting.max_by_key(|(rank, _)| *rank)?;
    // From the lowest bit of the rank upwards.
    let words = ["machine", "work material", "operation", "tool", "edge"];
    let highest = words.iter().enumerate().rfind(|(bit, _)| rank >> bit & 1 == 1);
    Some(ChosenModel { record, by: highest.map_or("any", |(_, word)| *word) })
}

/// Why none of these models is for a cut, in a sentence: what the nearest of them is for, and what the cut is.
pub(super) fn explain_no_model(models: &[Arc<WearRecord>], cut: &WearKey) -> String {
    let disagreements = |key: &WearKey| {
        let tool = key.tool.is_empty() || key.tool == cut.tool || key.tool == tool_of(&cut.tool);
        let pairs = [
            ("machine", key.machine.clone(), cut.machine.clone()),
            ("tool", if tool { String::new() } else { key.tool.clone() }, cut.tool.clone()),
            ("work material", key.work_material.clone(), cut.work_material.clone()),
            ("operation", key.operation.clone(), cut.operation.clone()),
        ];
        pairs.into_iter().filter(|(_, model, cut)| !model.is_empty() && model != cut).collect::<Vec<_>>()
    };
    let Some(nearest) = models.iter().rev().map(|model| disagreements(&model.key)).min_by_key(Vec::len) else {
        return "the library has no wear model".to_owned();
    };
    let parts: Vec<String> = nearest
        .into_iter()
        .map(|(what, model, cut)| match cut.is_empty() {
            true => format!("{what} {model}, and that of this cut is not known"),
            false => format!("{what} {model}, and this cut is of {cut}"),
        })
        .collect();
    format!("the wear model is for {}", parts.join("; "))
}

#[cfg(test)]
mod tests {
    use super::super::model::WearModel;
    use super::super::surface::build_published_surface;
    use super::*;

    fn key(texts: [&str; 4]) -> WearKey {
        let [machine, tool, work_material, operation] = texts.map(str::to_owned);
        WearKey { machine, tool, work_material, operation }
    }

    fn record(texts: [&str; 4]) -> WearRecord {
        WearRecord::new(key(texts), 0.3, ("test".to_owned(), 27, 0.99), WearModel::Surface(build_published_surface()))
    }

    #[test]
    fn the_library_falls_back_from_edge_to_tool_operation_material_and_any() {
        let models = [
            ["m", "T1-2", "", ""],
            ["m", "T1", "", ""],
            ["m", "", "", "rough"],
            ["m", "", "steel", ""],
            ["m", "", "", ""],
            ["", "", "", ""],
        ]
        .map(record);
        let by = |models: &[WearRecord], tool: &str, material: &str, operation: &str| {
            let found = choose_model(models, &key(["m", tool, material, operation]), |it| it).expect("a model");
            (found.record.key.clone(), found.by)
        };
        let words: Vec<&str> = (0..6).map(|from| by(&models[from..], "T1-2", "steel", "rough").1).collect();
        assert_eq!(words, ["edge", "tool", "operation", "work material", "machine", "any"]);
        assert_eq!(by(&models, "T1-3", "steel", "rough").0.tool, "T1", "a new edge of a known tool");
        assert_eq!(by(&models, "T2", "brass", "bore"), (key(["m", "", "", ""]), "machine"));
        let why = |texts: [&str; 4], cut: [&str; 4]| explain_no_model(&[Arc::new(record(texts))], &key(cut));
        let told = why(["m", "", "C45", ""], ["m", "T1", "", ""]);
        assert_eq!(told, "the wear model is for work material C45, and that of this cut is not known");
        let told = why(["n", "T2", "", ""], ["m", "T1-2", "C45", ""]);
        assert_eq!(told, "the wear model is for machine n, and this cut is of m; tool T2, and this cut is of T1-2");
        assert_eq!(explain_no_model(&[], &key(["m", "T1", "", ""])), "the library has no wear model");
        assert_eq!(
            choose_model(&models[..1], &key(["m", "T1", "", ""]), |it| it),
            None,
            "another edge is not this one"
        );
        assert_eq!(choose_model(&models[..5], &key(["n", "T1", "", ""]), |it| it), None, "another machine");
    }

    #[test]
    fn of_equals_the_newest_counts() {
        let models = [record(["", "T1", "", ""]), record(["", "T1", "", ""])];
        let found = choose_model(&models, &key(["m", "T1", "", ""]), |it| it).expect("a model");
        assert!(std::ptr::eq(found.record, &raw const models[1]));
    }
}
