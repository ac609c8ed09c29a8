//! Fills in what the sources do not deliver: one sample at a time, or a whole recording.

use super::quantity::QUANTITIES;
use super::recipe::{Lookup, Operation, Recipe};
use adapter_core::{Absence, ChannelId, Sample, Slot, Value};
use recording::Recording;
use recording::{Cells, Numbers, Words};
use std::sync::Arc;

/// Channels that can be filled in.
const FILLED_MAX: usize = QUANTITIES.len() + 4;

/// Fills in samples that come one after the other, also into the same place.
#[derive(Debug, Clone)]
pub struct Completion {
    program: ChannelId,
    block: ChannelId,
    numbers: [ChannelId; QUANTITIES.len()],
    tool: ChannelId,
    work_material: ChannelId,
    operation: ChannelId,
    recipe: ChannelId,
    filled: Vec<Filled>,
}

/// A value that was filled in, and what stood there before.
#[derive(Debug, Clone)]
struct Filled {
    channel: ChannelId,
    before: Absence,
    value: Value,
}

impl Default for Completion {
    fn default() -> Self {
        Self::new()
    }
}

impl Completion {
    /// Looks every name up.
    ///
    /// # Panics
    /// Never: a test holds the names against the table of channels.
    #[must_use]
    pub fn new() -> Self {
        let of = |name| ChannelId::from_name(name).expect("the name stands in the table, which a test checks");
        Self {
            program: of("program"),
            block: of("block"),
            numbers: QUANTITIES.map(|quantity| of(quantity.key)),
            tool: of("tool"),
            work_material: of("work_material"),
            operation: of("operation"),
            recipe: of("recipe"),
            filled: Vec::with_capacity(FILLED_MAX),
        }
    }

    /// Fills in what no source of this sample delivers, and marks the sample with the operation and the version of the
    /// table. A value that a source delivers stays, also where it fails at this moment: a broken line is no reason to
    /// go on with a planned number. Allocates nothing.
    pub fn apply_recipe<'a>(&mut self, recipe: &'a Recipe, sample: &mut Sample) -> Lookup<'a> {
        self.take_back(sample);
        let lookup = recipe.find_operation(sample.text(self.program), sample.text(self.block));
        if let Lookup::Found(operation) = lookup {
            self.fill_sample(operation, sample);
        }
        lookup
    }

    /// A sample that is used again still holds what was filled in last time.
    fn take_back(&mut self, sample: &mut Sample) {
        for Filled { channel, before, value } in self.filled.drain(..) {
            if sample.slot(channel).value.as_ref() == Ok(&value) {
                sample.set_slot(channel, Slot::from_absence(before));
            }
        }
    }

    fn fill_sample(&mut self, operation: &Operation, sample: &mut Sample) {
        for (quantity, channel) in QUANTITIES.iter().zip(self.numbers) {
            self.set_if_missing(sample, channel, operation.find_quantity(quantity.key).map(Value::Number));
        }
        let text = |text: &Arc<str>| Value::Text(text.clone());
        self.set_if_missing(sample, self.tool, operation.tool.as_ref().map(text));
        self.set_if_missing(sample, self.work_material, operation.work_material.as_ref().map(text));
        self.set_if_missing(sample, self.operation, Some(text(&operation.name)));
        self.set_if_missing(sample, self.recipe, Some(text(&operation.mark)));
    }

    fn set_if_missing(&mut self, sample: &mut Sample, channel: ChannelId, value: Option<Value>) {
        let before = match sample.slot(channel).value {
            Err(before @ (Absence::NotProvided | Absence::NotSupported | Absence::NotRecorded)) => before,
            _ => return,
        };
        if let Some(value) = value {
            sample.set_slot(channel, Slot { value: Ok(value.clone()), age_ns: 0 });
            self.filled.push(Filled { channel, before, value });
        }
    }
}

/// A text column of the table: its name, and its cell of one operation.
type TextColumn = (&'static str, fn(&Operation) -> Option<&str>);

/// The recording with the empty cells of the table's columns filled in; how many rows an operation was found for.
#[must_use]
pub fn complete_recording(mut recording: Recording, recipe: &Recipe) -> (Recording, usize) {
    let found: Vec<Option<&Operation>> = (0..recording.count_rows())
        .map(|row| {
            let text = |name: &str| recording.find_words(name).and_then(|words| words.get(row));
            match recipe.find_operation(text("program"), text("block")) {
                Lookup::Found(operation) => Some(operation),
                _ => None,
            }
        })
        .collect();
    for quantity in QUANTITIES {
        let known = recording.find_numbers(quantity.key);
        let cell =
            |row: usize| known.and_then(|numbers| numbers.get(row)).or_else(|| found[row]?.find_quantity(quantity.key));
        let column: Numbers = (0..found.len()).map(cell).collect();
        if column.count_present() > 0 {
            recording.set_column(quantity.key, Cells::Numbers(column));
        }
    }
    let texts: [TextColumn; 4] = [
        ("tool", |operation| operation.tool.as_deref()),
        ("work_material", |operation| operation.work_material.as_deref()),
        ("operation", |operation| Some(&operation.name)),
        ("recipe", |operation| Some(&operation.mark)),
    ];
    for (name, read) in texts {
        let known = recording.find_words(name);
        let cell = |row: usize| known.and_then(|words| words.get(row)).or_else(|| found[row].and_then(read));
        let column: Words = (0..found.len()).map(|row| cell(row).unwrap_or_default()).collect();
        if !column.words().is_empty() {
            recording.set_column(name, Cells::Words(column));
        }
    }
    let rows = found.iter().flatten().count();
    (recording, rows)
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    const TABLE: &str = "schema = \"operations/1\"\n[[operation]]\nprogram = \"O1\"\nblocks = [10, 20]\nname = \"rough\"\n\
                         depth_of_cut_mm = 2.0\ndiameter_mm = 79.0\ntool = \"T01\"\nwork_material = \"45# steel\"\n";

    fn sample(program: &str, block: &str) -> Sample {
        let mut sample = Sample::new_empty(0);
        let mut text = |name: &str, text: &str| {
            let slot = Slot { value: Ok(Value::Text(text.into())), age_ns: 0 };
            sample.set_slot(ChannelId::from_name(name).expect(name), slot);
        };
        text("program", program);
        text("block", block);
        sample
    }

    #[test]
    fn what_is_missing_is_filled_in_and_marked_and_what_is_delivered_stays() {
        let recipe = parse("operations.toml", TABLE).expect("a table");
        let (mut completion, mut sample) = (Completion::new(), sample("o1", "N15"));
        let channel = |name: &str| ChannelId::from_name(name).expect("in the table");
        sample.set_slot(channel("diameter_mm"), Slot { value: Ok(Value::Number(61.5)), age_ns: 0 });
        sample.set_slot(channel("tool"), Slot::from_absence(Absence::Timeout));
        assert!(matches!(completion.apply_recipe(&recipe, &mut sample), Lookup::Found(_)));
        assert_eq!(sample.number(channel("depth_of_cut_mm")), Ok(2.0));
        assert_eq!(sample.number(channel("diameter_mm")), Ok(61.5), "the controller knows better");
        assert_eq!(sample.slot(channel("tool")).value, Err(Absence::Timeout), "a broken line is not papered over");
        assert_eq!(sample.text(channel("operation")), Some("rough"));
        assert_eq!(sample.text(channel("recipe")), Some(format!("rough ({})", recipe.version()).as_str()));
        assert_eq!(sample.number(channel("width_of_cut_mm")), Err(Absence::NotProvided));
    }

    #[test]
    fn a_block_outside_the_table_changes_nothing() {
        let recipe = parse("operations.toml", TABLE).expect("a table");
        for (program, block, why) in
            [("O2", "N15", Lookup::NoProgram), ("O1", "N21", Lookup::NoBlock), ("O1", "X", Lookup::BlockUnknown)]
        {
            let mut sample = sample(program, block);
            let before = sample.clone();
            assert_eq!(Completion::new().apply_recipe(&recipe, &mut sample), why);
            assert_eq!(sample, before);
        }
    }

    #[test]
    fn a_sample_that_is_used_again_forgets_the_operation_before() {
        let recipe = parse("operations.toml", TABLE).expect("a table");
        let (mut completion, mut used) = (Completion::new(), sample("O1", "N15"));
        let fresh = sample("O2", "N15");
        completion.apply_recipe(&recipe, &mut used);
        for name in ["program", "block"] {
            let channel = ChannelId::from_name(name).expect(name);
            used.set_slot(channel, fresh.slot(channel).clone());
        }
        completion.apply_recipe(&recipe, &mut used);
        assert_eq!(used, fresh);
    }

    #[test]
    fn a_recording_gets_its_columns() {
        let recipe = parse("operations.toml", TABLE).expect("a table");
        let mut recording = Recording::new("test", vec![0.0, 1.0, 2.0], None);
        recording.set_column("program", Cells::Words(Words::from_iter(["O1", "O1", "O9"])));
        recording.set_column("block", Cells::Words(Words::from_iter(["N10", "N30", "N10"])));
        let (recording, rows) = complete_recording(recording, &recipe);
        assert_eq!(rows, 1);
        let depths = recording.find_numbers("depth_of_cut_mm").expect("filled in");
        assert_eq!(depths.iter().collect::<Vec<_>>(), [Some(2.0), None, None]);
        assert_eq!(recording.find_words("work_material").and_then(|words| words.get(0)), Some("45# steel"));
    }
}
