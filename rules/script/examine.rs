//! Reads a compiled script before it ever runs: what it looks at, and every name in it that does not exist.
//!
//! A misspelt function in a branch that is taken once a month is found here, not in that night.

use super::callable::{FUNCTIONS, Function};
use super::fields::{self, Field, Record};
use super::kinds::calls::AlarmNames;
use super::kinds::{self, KindMistake, LikeWords};
use super::order::PublishedChannels;
use super::problem::ScriptProblem;
use super::trials::TRIAL_FUNCTIONS;
use super::vocabulary::{Word, find_word, list_words};
use adapter_core::channel::find_nearest_name;
use rhai::{AST, ASTNode, BinaryExpr, Expr, FnCallExpr, ImmutableString, Position, Stmt};

/// Longest name of a channel of a script's own.
const CHANNEL_NAME_MAX: usize = 48;
/// What lasts for one run of the body and would end at once in a handler.
const OF_THE_BODY: [&str; 7] = [
    "request_feed_override",
    "follow_feed_override",
    "propose_offset_um",
    "alarm",
    "alarm_when",
    "alarm_above",
    "alarm_below",
];

/// What is known of a script before it runs.
#[derive(Debug, Default)]
pub(super) struct Findings {
    /// The words it looks at.
    pub(super) reads: Vec<&'static Word>,
    /// The fields of records it looks at.
    pub(super) fields: Vec<Field>,
    /// The channels of its own: name and unit.
    pub(super) channels: Vec<(ImmutableString, ImmutableString)>,
    /// Channels of other scripts that it looks at.
    pub(super) foreign: Vec<ImmutableString>,
    /// Everything that is wrong.
    pub(super) problems: Vec<ScriptProblem>,
}

/// Where a piece of a script stands, which decides what it sees.
#[derive(Debug, Clone, Copy)]
pub(super) enum ScriptPlace<'a> {
    /// The body: variables of the vocabulary, and its own.
    Body,
    /// A handler: variables of the vocabulary, its parameters, the constants of the script. Its parameters are like words of the vocabulary.
    Handler(&'a [ImmutableString], LikeWords<'a>),
    /// A trial: the constants of the script, and the functions of trials.
    Trial(&'a [ImmutableString]),
    /// `fn settings()`: the constants of the script.
    Settings(&'a [ImmutableString]),
    /// Another function: nothing but what is handed over.
    Function,
}

/// Reads the pieces of one file. `callable` is sorted; ASTs are compiled without optimization.
pub(super) struct Walk<'a> {
    file: &'a str,
    text: &'a str,
    alarms: AlarmNames,
    callable: &'a [(String, usize)],
    own: Vec<(String, usize)>,
    channels: &'a PublishedChannels,
    pub(super) findings: Findings,
}

impl<'a> Walk<'a> {
    /// `whole` is the whole file.
    pub(super) fn new(
        (file, text): (&'a str, &'a str),
        whole: &AST,
        callable: &'a [(String, usize)],
        channels: &'a PublishedChannels,
    ) -> Self {
        let own = whole.iter_functions().map(|it| (it.name.to_owned(), it.params.len())).collect();
        Self { file, text, alarms: AlarmNames::default(), callable, own, channels, findings: Findings::default() }
    }

    /// Looks through everything that stands in this place.
    pub(super) fn read(&mut self, ast: &AST, place: ScriptPlace<'_>) {
        ast.walk(&mut |path| self.examine_node(path, place));
    }

    /// Everything that was found, in the order of the text.
    pub(super) fn into_findings(mut self) -> Findings {
        let mistakes = self.alarms.list_mistakes();
        self.report_mistakes(mistakes);
        self.findings.problems.sort_by_key(|problem| (problem.line, problem.column));
        self.findings.problems.dedup();
        self.findings
    }

    fn examine_node(&mut self, path: &[ASTNode<'_>], place: ScriptPlace<'_>) -> bool {
        match path.last() {
            Some(ASTNode::Expr(Expr::FnCall(call, at)) | ASTNode::Stmt(Stmt::FnCall(call, at))) => {
                self.examine_call(call, call.args.len(), *at, place);
            }
            Some(ASTNode::Expr(Expr::MethodCall(call, at))) => self.examine_call(call, call.args.len() + 1, *at, place),
            Some(ASTNode::Expr(Expr::Variable(name, short, at))) if name.0.is_none() && short.is_none() => {
                match fields::find_record(&name.1).filter(|_| !self.is_own(&name.1)) {
                    Some(record) => self.examine_record(record, path, *at, place),
                    None => self.examine_global(&name.1, *at, place),
                }
            }
            Some(ASTNode::Stmt(Stmt::Assignment(assignment))) => self.examine_assignment(&assignment.1.lhs),
            _ => {}
        }
        if let Some(node) = path.last() {
            self.examine_values(node, place);
        }
        true
    }

    /// Values that can never be what they are compared with, or handed over as.
    fn examine_values(&mut self, node: &ASTNode<'_>, place: ScriptPlace<'_>) {
        let like = if let ScriptPlace::Handler(_, like) = place { like } else { &[] };
        let conditions =
            |all: &[Expr]| all.iter().filter_map(|expr| kinds::compare::find_condition_mistake(expr, like)).collect();
        let found: Vec<KindMistake> = match node {
            ASTNode::Expr(Expr::FnCall(call, at)) | ASTNode::Stmt(Stmt::FnCall(call, at)) => {
                self.alarms.add(call);
                let compared = kinds::compare::find_operator_mistakes(call, *at, like);
                compared.into_iter().chain(kinds::calls::find_call_mistakes(call, like)).collect()
            }
            ASTNode::Expr(Expr::And(all, _) | Expr::Or(all, _)) => conditions(all),
            ASTNode::Stmt(Stmt::If(flow, _) | Stmt::While(flow, _) | Stmt::Do(flow, ..)) => {
                kinds::compare::find_condition_mistake(&flow.expr, like).into_iter().collect()
            }
            ASTNode::Stmt(Stmt::Switch(switch, _)) => kinds::switch::find_case_mistakes(self.text, &switch.0, like),
            _ => Vec::new(),
        };
        self.report_mistakes(found);
    }

    fn report_mistakes(&mut self, found: Vec<KindMistake>) {
        for (at, what, next) in found {
            self.report_problem(at, what, next);
        }
    }

    fn is_own(&self, name: &str) -> bool {
        self.own.iter().any(|(own, _)| own == name)
    }

    fn report_problem(&mut self, at: Position, what: String, next: impl Into<String>) {
        self.findings.problems.push(ScriptProblem::new(self.file, at, what, next));
    }

    fn examine_call(&mut self, call: &FnCallExpr, arguments: usize, at: Position, place: ScriptPlace<'_>) {
        let name = call.name.as_str();
        if name == "publish" && call.args.len() == 3 {
            self.examine_publication(&call.args[0], &call.args[2], at);
        }
        if matches!(place, ScriptPlace::Handler(..)) && OF_THE_BODY.contains(&name) {
            let next = "raise_alarm and clear_alarm work here; or set memory.x here and ask for it in the body";
            self.report_problem(
                at,
                format!("`{name}` lasts for one run of the body and does nothing in a handler"),
                next,
            );
        }
        let known = |(known, count): &(String, usize)| known == name && *count == arguments;
        if let Some(function) = of_trials(name) {
            return self.trial_call(function, arguments, at, place);
        }
        if call.op_token.is_some() || self.callable.iter().chain(&self.own).any(known) {
            return;
        }
        let counts: Vec<String> =
            self.callable.iter().chain(&self.own).filter(|it| it.0 == name).map(|it| it.1.to_string()).collect();
        if !counts.is_empty() {
            let what = format!("`{name}` takes {} arguments, not {arguments}", counts.join(" or "));
            return self.report_problem(at, what, describe_usage(name));
        }
        if name == "sleep" {
            let next = "it runs at every tick; held_s(name, condition) tells how long something has lasted";
            return self.report_problem(at, "a script may not sleep".to_owned(), next);
        }
        let trials = TRIAL_FUNCTIONS.iter().filter_map(Function::name);
        let trials = trials.filter(|_| matches!(place, ScriptPlace::Trial(_)));
        let names = self.callable.iter().chain(&self.own).map(|it| it.0.as_str()).chain(trials);
        let names = names.filter(|name| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
        let next = format_suggestion(find_nearest_name(name, names));
        self.report_problem(at, format!("there is no function `{name}`"), next);
    }

    fn trial_call(&mut self, function: &Function, arguments: usize, at: Position, place: ScriptPlace<'_>) {
        let wanted = count_parameters(function.signature);
        let name = function.name().unwrap_or_default();
        if !matches!(place, ScriptPlace::Trial(_)) {
            let next = "write it into a function whose name begins with trial_";
            self.report_problem(at, format!("only a trial can call `{name}`"), next);
        } else if arguments != wanted {
            let what = format!("`{name}` takes {wanted} arguments, not {arguments}");
            self.report_problem(at, what, format!("write {}", function.signature));
        }
    }

    fn examine_global(&mut self, name: &str, at: Position, place: ScriptPlace<'_>) {
        let names = match place {
            ScriptPlace::Handler(names, _) | ScriptPlace::Trial(names) | ScriptPlace::Settings(names) => names,
            ScriptPlace::Body | ScriptPlace::Function => &[],
        };
        let known = names.iter().any(|known| *known == *name);
        if known || self.is_own(name) {
            return;
        }
        match (find_word(name), place) {
            (Some(_), ScriptPlace::Function) => self.report_problem(
                at,
                format!("`{name}` is not visible inside a function"),
                format!("hand it over: fn f({name}) {{ ... }} and call f({name})"),
            ),
            (Some(_), ScriptPlace::Trial(_)) => self.report_problem(
                at,
                format!("a trial does not see `{name}`"),
                format!("it sets what the script sees: given(#{{ {name}: ... }})"),
            ),
            (Some(_), ScriptPlace::Settings(_)) => self.report_problem(
                at,
                format!("`settings` does not see `{name}`"),
                "it is called once, when the file is loaded, and sees the constants of the script only",
            ),
            (Some(word), _) => self.record_read(word),
            (None, ScriptPlace::Function) => {
                let next = "a function sees its own arguments and variables only; hand over what it needs";
                self.report_problem(at, format!("there is no variable `{name}`"), next);
            }
            (None, ScriptPlace::Trial(_) | ScriptPlace::Settings(_)) => self.no_variable(name, at),
            (None, _) => match self.channels.find_publisher(name) {
                Some(publisher) if publisher != self.file => self.reads_of_others(name),
                Some(_) => {
                    let next = format!("keep it: let my_{name} = ...; publish(\"{name}\", my_{name}, ...)");
                    self.report_problem(at, format!("`{name}` is published by this script itself"), next);
                }
                None => self.no_variable(name, at),
            },
        }
    }

    fn no_variable(&mut self, name: &str, at: Position) {
        let names = list_words().iter().map(|word| word.name).chain(self.channels.names());
        let shipped =
            || PublishedChannels::from_files(&super::list_shipped_scripts()).find_publisher(name).map(str::to_owned);
        let next = match (find_nearest_name(name, names), shipped()) {
            (_, Some(file)) => format!("{file}, which comes with the gateway, publishes it: put it among the scripts"),
            (near, None) => format_suggestion(near),
        };
        self.report_problem(at, format!("there is no variable `{name}`"), next);
    }

    fn reads_of_others(&mut self, name: &str) {
        if !self.findings.foreign.iter().any(|known| *known == *name) {
            self.findings.foreign.push(name.into());
        }
    }

    /// `sample.x`: the record is the left side of a dot, and the right side is a field of it.
    fn examine_record(&mut self, record: &'static Record, path: &[ASTNode<'_>], at: Position, place: ScriptPlace<'_>) {
        let name = record.name;
        let dot = path.len().checked_sub(2).and_then(|parent| path.get(parent));
        let property = match dot {
            Some(ASTNode::Expr(Expr::Dot(pair, ..))) if pair.lhs.position() == at => find_property(pair),
            _ => None,
        };
        let Some((field, at_field)) = property else {
            let next = format!("write {}, with the channel that is meant", record.example);
            return self.report_problem(at, format!("`{name}` is used as a whole"), next);
        };
        if matches!(place, ScriptPlace::Function | ScriptPlace::Trial(_) | ScriptPlace::Settings(_)) {
            let what = format!("`{name}` is not visible inside a function");
            return self.report_problem(at, what, format!("hand the value over: f({name}.{field})"));
        }
        match record.find_field(field) {
            Ok(found) => {
                let same = |it: &Field| it.record.name == name && it.word.name == found.word.name;
                if !self.findings.fields.iter().any(same) {
                    self.findings.fields.push(found);
                }
            }
            Err(next) => self.report_problem(at_field, format!("there is no `{name}.{field}`"), next),
        }
    }

    /// A channel of the script's own is known before it runs.
    fn examine_publication(&mut self, name: &Expr, unit: &Expr, at: Position) {
        let (Expr::StringConstant(name, at_name), Expr::StringConstant(unit, _)) = (name, unit) else {
            let next = "write publish(\"my_channel_w\", x, \"W\")";
            return self.report_problem(at, "name and unit of a channel are written as texts".to_owned(), next);
        };
        let letters = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
        let begins = name.starts_with(|c: char| c.is_ascii_lowercase());
        if !letters || !begins || name.len() > CHANNEL_NAME_MAX {
            let what = format!("\"{name}\" cannot be the name of a channel");
            let next = format!("use a to z, 0 to 9 and _, beginning with a letter, at most {CHANNEL_NAME_MAX} of them");
            return self.report_problem(*at_name, what, next);
        }
        if find_word(name).is_some() {
            let next = format!("choose another name, such as my_{name}");
            return self.report_problem(*at_name, format!("`{name}` is a channel or an estimate already"), next);
        }
        match self.findings.channels.iter().find(|(known, _)| known == name) {
            None => self.findings.channels.push((name.clone(), unit.clone())),
            Some((_, other)) if other != unit => {
                let what = format!("`{name}` is published in {other} and in {unit}");
                self.report_problem(*at_name, what, "a channel has one unit");
            }
            Some(_) => {}
        }
    }

    fn record_read(&mut self, word: &'static Word) {
        if !self.findings.reads.iter().any(|known| known.name == word.name) {
            self.findings.reads.push(word);
        }
    }

    fn examine_assignment(&mut self, left: &Expr) {
        let Expr::Variable(name, short, at) = left else { return };
        let global = name.0.is_none() && short.is_none();
        if let Some(word) = find_word(&name.1).filter(|word| global && !word.is_writable()) {
            let next = format!("use a name of your own: let my_{0} = {0};", word.name);
            self.report_problem(*at, format!("`{}` is measured and cannot be set", word.name), next);
        }
    }
}

fn of_trials(name: &str) -> Option<&'static Function> {
    TRIAL_FUNCTIONS.iter().find(|function| function.name() == Some(name))
}

/// How many parameters a signature has.
fn count_parameters(signature: &str) -> usize {
    let inside = signature.split_once('(').map_or("", |(_, rest)| rest.trim_end_matches(')'));
    if inside.is_empty() { 0 } else { inside.matches(',').count() + 1 }
}

/// The name right of the dot, also where more follows it.
fn find_property(dot: &BinaryExpr) -> Option<(&str, Position)> {
    match &dot.rhs {
        Expr::Property(property, at) => Some((property.2.as_str(), *at)),
        Expr::Dot(pair, ..) | Expr::Index(pair, ..) => match &pair.lhs {
            Expr::Property(property, at) => Some((property.2.as_str(), *at)),
            _ => None,
        },
        _ => None,
    }
}

fn format_suggestion(near: Option<&str>) -> String {
    match near {
        Some(near) => format!("did you mean `{near}`?"),
        None => "`cnc-gateway check --vocabulary` lists what there is; `let x = ...` makes a variable".to_owned(),
    }
}

fn describe_usage(name: &str) -> String {
    let own = FUNCTIONS.iter().find(|it| it.name() == Some(name));
    let method = || super::functions::list_methods().find(|it| it.name == name).map(|it| it.signature());
    let signature = own.map(|it| it.signature.to_owned()).or_else(method);
    signature.map(|signature| format!("write {signature}")).unwrap_or_default()
}
