//! Compiled scripts, and sets of them that belong together.

use super::compile::ScriptFile;
use super::declared::{Declared, LiveValues, SettingValues};
use super::events::Event;
use super::fields::Field;
use super::handlers::Handling;
use super::settings::ChosenSetting;
use super::trials::Trial;
use super::variables::ScriptBody;
use super::vocabulary::Word;
use estimators::Settings;
use rhai::{AST, Dynamic, ImmutableString};
use std::sync::Arc;

pub(super) struct Script {
    pub(super) file: Arc<str>,
    pub(super) version: u64,
    /// The functions of the script.
    pub(super) ast: AST,
    /// What runs from top to bottom.
    pub(super) body: ScriptBody,
    pub(super) reads: Vec<&'static Word>,
    pub(super) fields: Vec<Field>,
    /// Channels of its own: name and unit.
    pub(super) channels: Vec<(ImmutableString, ImmutableString)>,
    /// Channels of other scripts that it looks at.
    pub(super) foreign: Vec<ImmutableString>,
    pub(super) handlers: Vec<Handling>,
    pub(super) trials: Vec<Trial>,
    /// Constants that are written as plain values: what handlers see of the body.
    pub(super) constants: Vec<(String, Dynamic)>,
    /// The settings that it declares.
    pub(super) declared: Vec<Declared>,
    /// The values that depend on tool and operation.
    pub(super) live: LiveValues,
    /// 0: at every tick.
    pub(super) every_ns: i64,
    /// Nothing to run: the file only has settings.
    pub(super) passive: bool,
    pub(super) choices: Vec<ChosenSetting>,
    pub(super) thresholds: Vec<(String, String)>,
}

impl Script {
    /// Has it a handler for this?
    pub(super) fn has_handler_for(&self, event: &Event) -> bool {
        self.handlers.iter().any(|handler| handler.kind == event.kind())
    }
}

/// Scripts that belong together; all of them compile and their settings agree. They stand in the order in which they run.
#[derive(Clone, Default)]
pub struct ScriptSet {
    pub(super) scripts: Vec<Arc<Script>>,
    pub(super) settings: Settings,
    pub(super) files: Arc<[ScriptFile]>,
    pub(super) values: Arc<SettingValues>,
}

impl ScriptSet {
    /// The settings of the estimators that these scripts ask for.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The texts that it was made from.
    #[must_use]
    pub fn files(&self) -> &[ScriptFile] {
        &self.files
    }

    /// The settings that the scripts declare.
    pub fn declared_settings(&self) -> impl Iterator<Item = &Declared> {
        self.scripts.iter().flat_map(|script| &script.declared)
    }

    /// The values that were chosen for them.
    #[must_use]
    pub fn values(&self) -> &Arc<SettingValues> {
        &self.values
    }

    /// Every script with its version, which is another one for another text and for other values of its settings.
    pub fn versions(&self) -> impl Iterator<Item = (&str, u64)> {
        self.scripts.iter().map(|script| (&*script.file, script.version))
    }

    /// How many scripts there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.scripts.len()
    }

    /// No script at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.scripts.is_empty()
    }

    /// What this set and another have in common, what only this one has, and what only the other has. The parts together decide
    /// what the whole does, so where a script reads a channel of another nothing is in common. Each part keeps the settings of its
    /// set; the common one those of this set.
    #[must_use]
    pub fn partition_with(self, other: Self) -> (Self, Self, Self) {
        let alone = |set: &Self| set.scripts.iter().all(|script| script.foreign.is_empty());
        let apart = alone(&self) && alone(&other);
        let has = |set: &Self, script: &Script| {
            apart && set.scripts.iter().any(|its| its.file == script.file && its.version == script.version)
        };
        let part = |set: &Self, which: &dyn Fn(&Script) -> bool| Self {
            scripts: set.scripts.iter().filter(|script| which(script)).cloned().collect(),
            settings: set.settings.clone(),
            files: set.files.clone(),
            values: set.values.clone(),
        };
        let common = part(&self, &|script| has(&other, script));
        (common, part(&self, &|script| !has(&other, script)), part(&other, &|script| !has(&self, script)))
    }
}
