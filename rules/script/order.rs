//! Which script may read which channel of another, and in which order they therefore run.
//!
//! A channel that one script publishes is a variable of the others. Whoever reads it runs after whoever publishes it, so that the
//! value is that of the same tick; otherwise the order is that of the file names. Two scripts that read each other have no such
//! order and are refused.

use super::compile::ScriptFile;
use super::declared::scan::{find_calls, read_quoted};
use super::problem::ScriptProblem;
use super::script_set::Script;
use rhai::Position;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The channels that files publish, known before any of them is compiled.
#[derive(Debug, Default)]
pub(super) struct PublishedChannels(BTreeMap<String, String>);

impl PublishedChannels {
    /// Those of these files.
    pub(super) fn from_files(files: &[ScriptFile]) -> Self {
        let mut channels = BTreeMap::new();
        for file in files.iter().filter(|file| file.text.len() <= super::TEXT_MAX) {
            for call in find_calls(&file.text, "publish") {
                if let Some(name) = read_quoted(&file.text[call.inside]) {
                    channels.insert(name.to_owned(), file.name.clone());
                }
            }
        }
        Self(channels)
    }

    /// The file that publishes a channel of this name.
    pub(super) fn find_publisher(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }
}

/// A channel has one publisher.
pub(super) fn one_publisher(scripts: &[Arc<Script>], problems: &mut Vec<ScriptProblem>) {
    let mut taken: BTreeMap<&str, &str> = BTreeMap::new();
    for script in scripts {
        for (name, _) in &script.channels {
            if let Some(other) = taken.insert(name, &script.file) {
                let what = format!("the channel {name} is also published in {other}");
                problems.push(ScriptProblem::new(&script.file, Position::NONE, what, "keep one of the two"));
            }
        }
    }
}

/// Whoever publishes stands before whoever reads it; otherwise the scripts stay in the order of their names, in which they come.
pub(super) fn order_by_dependency(scripts: Vec<Arc<Script>>, problems: &mut Vec<ScriptProblem>) -> Vec<Arc<Script>> {
    let publisher =
        |channel: &str| scripts.iter().position(|script| script.channels.iter().any(|(name, _)| **name == *channel));
    let needs: Vec<BTreeSet<usize>> =
        scripts.iter().map(|script| script.foreign.iter().filter_map(|name| publisher(name)).collect()).collect();
    let mut order: Vec<usize> = Vec::with_capacity(scripts.len());
    while order.len() < scripts.len() {
        let ready = |at: &usize| !order.contains(at) && needs[*at].iter().all(|need| order.contains(need));
        let Some(next) = (0..scripts.len()).find(ready) else {
            problems.push(describe_circle(&scripts, &needs, &order));
            return scripts;
        };
        order.push(next);
    }
    order.into_iter().map(|at| scripts[at].clone()).collect()
}

/// One circle among the scripts that have no place yet, in words.
fn describe_circle(scripts: &[Arc<Script>], needs: &[BTreeSet<usize>], order: &[usize]) -> ScriptProblem {
    let open = |at: &usize| !order.contains(at);
    let mut path: Vec<usize> = (0..scripts.len()).filter(open).take(1).collect();
    while let Some(next) = path.last().and_then(|at| needs[*at].iter().copied().find(open)) {
        if let Some(begin) = path.iter().position(|at| *at == next) {
            path.drain(..begin);
            break;
        }
        path.push(next);
    }
    let name = |at: usize| &scripts[at].file;
    let channel = |reader: usize, from: usize| {
        let of = |name: &&rhai::ImmutableString| scripts[from].channels.iter().any(|(its, _)| its == *name);
        scripts[reader].foreign.iter().find(of).map_or("", |name| name.as_str())
    };
    let step = |(place, reader): (usize, &usize)| {
        let from = path[(place + 1) % path.len()];
        format!("{} reads {} of {}", name(*reader), channel(*reader, from), name(from))
    };
    let told: Vec<String> = path.iter().enumerate().map(step).collect();
    let first = path.first().map_or("scripts", |at| name(*at));
    let what = format!("the scripts read each other in a circle: {}", told.join(", "));
    ScriptProblem::new(
        first,
        Position::NONE,
        what,
        "compute both channels in one of them, or keep the older value in memory there",
    )
}
