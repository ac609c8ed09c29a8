//! Model files (`model/1`): read with every problem at once, each with its line; written back in the same form.

use super::departure::{Departure, is_of_departure};
use super::expression::Expression;
use super::model::{Model, Parameter, Part, PartFunction};
use super::speed_table::SpeedTable;
use super::term::Term;
use super::text_report::space_unit;
use adapter_core::channel::find_nearest_name;
use physics::{CATALOGUE, Effect, Entry, Form, Role, find_effect};
use std::collections::BTreeMap;
use std::fmt;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// One thing wrong with a model file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Line of the file, from 1.
    pub line: usize,
    /// What is wrong and what was meant.
    pub text: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.text)
    }
}

type Table<'a> = DeTable<'a>;
type Entry1<'a> = (&'a Spanned<std::borrow::Cow<'a, str>>, &'a Spanned<DeValue<'a>>);

/// Reads a model.
///
/// # Errors
/// Every problem of the file.
pub fn parse_model(text: &str) -> Result<Model, Vec<Problem>> {
    let mut reader = Reader { text, problems: Vec::new() };
    let model = reader.read_model();
    match model {
        Some(model) if reader.problems.is_empty() => Ok(model),
        _ => Err(reader.problems),
    }
}

/// Reads a file of hypotheses: `[[effect]]` entries of any kind, candidates besides the catalogue.
///
/// # Errors
/// Every problem of the file.
pub fn parse_hypotheses(text: &str) -> Result<Vec<Part>, Vec<Problem>> {
    let mut reader = Reader { text, problems: Vec::new() };
    let parts = reader
        .parse_root_table()
        .map(|table| reader.read_parts(table.get_ref(), &["schema", "effect"]))
        .unwrap_or_default();
    if reader.problems.is_empty() { Ok(parts) } else { Err(reader.problems) }
}

struct Reader<'t> {
    text: &'t str,
    problems: Vec<Problem>,
}

impl<'t> Reader<'t> {
    fn find_line_number(&self, offset: usize) -> usize {
        self.text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count() + 1
    }

    fn report_problem(&mut self, offset: usize, text: String) {
        let line = self.find_line_number(offset);
        self.problems.push(Problem { line, text });
    }

    fn parse_root_table(&mut self) -> Option<Spanned<Table<'t>>> {
        match DeTable::parse(self.text) {
            Ok(table) => Some(table),
            Err(error) => {
                let offset = error.span().map_or(0, |span| span.start);
                self.report_problem(offset, format!("not valid TOML: {}", error.message()));
                None
            }
        }
    }

    fn read_model(&mut self) -> Option<Model> {
        let root = self.parse_root_table()?;
        let table = root.get_ref();
        let known = ["schema", "name", "output", "effect", "roles", "candidates"];
        let parts = self.read_parts(table, &known);
        match table.get("schema").map(|schema| (schema.get_ref().as_str(), schema.span().start)) {
            Some((Some("model/1"), _)) => {}
            Some((_, offset)) => self.report_problem(offset, "schema must be \"model/1\"".to_owned()),
            None => self.report_problem(0, "schema = \"model/1\" is missing".to_owned()),
        }
        let output = table.get("output").and_then(|output| output.get_ref().as_str());
        if output.is_none() {
            self.report_problem(
                0,
                "output = \"<channel>\" is missing: which quantity does the model simulate?".to_owned(),
            );
        }
        if parts.is_empty() && self.problems.is_empty() {
            self.report_problem(0, "the model has no [[effect]]".to_owned());
        }
        let name = table.get("name").and_then(|name| name.get_ref().as_str()).unwrap_or("model").to_owned();
        let roles = self.read_roles(table);
        let (exclude, only) = self.read_candidates(table);
        Some(Model { name, output: output?.to_owned(), parts, roles, exclude, only, hypotheses: Vec::new() })
    }

    fn report_unknown_keys(&mut self, table: &Table<'_>, known: &[&str], what: &str) {
        for (key, _) in table {
            let name = key.get_ref().as_ref();
            if !known.contains(&name) {
                let hint = format_suggestion(name, known.iter().copied());
                self.report_problem(key.span().start, format!("unknown key {name} in {what}{hint}"));
            }
        }
    }

    fn read_parts(&mut self, table: &Table<'_>, known: &[&str]) -> Vec<Part> {
        self.report_unknown_keys(table, known, "the model");
        let Some(effects) = table.get("effect") else { return Vec::new() };
        let Some(entries) = effects.get_ref().as_array() else {
            self.report_problem(effects.span().start, "write effects as [[effect]]".to_owned());
            return Vec::new();
        };
        let entries: Vec<_> =
            entries.iter().filter_map(|entry| Some((entry.span().start, entry.get_ref().as_table()?))).collect();
        entries.into_iter().filter_map(|(offset, entry)| self.read_part(entry, offset)).collect()
    }

    fn read_part(&mut self, table: &Table<'_>, offset: usize) -> Option<Part> {
        let known = [
            "kind",
            "name",
            "parameters",
            "fixed",
            "columns",
            "expression",
            "process",
            "form",
            "place",
            "gear_stage",
            "departure",
        ];
        self.report_unknown_keys(table, &known, "an [[effect]]");
        let Some(kind) = table.get("kind").and_then(|kind| kind.get_ref().as_str()) else {
            self.report_problem(offset, "an [[effect]] needs a kind".to_owned());
            return None;
        };
        let kind_offset = table.get("kind").map_or(offset, |kind| kind.span().start);
        let name = table.get("name").and_then(|name| name.get_ref().as_str()).map(str::to_owned);
        let mut part = match kind {
            "linear" => self.read_linear_part(table, offset)?,
            "expression" => self.read_expression_part(table, offset)?,
            "no_load_power" if has_speed_table(table) => self.read_speed_table(table, offset)?,
            _ => self.read_catalogue_part(kind, table, kind_offset)?,
        };
        part.name = name;
        part.line = self.find_line_number(kind_offset);
        self.read_departures(&mut part, table);
        self.fix_parameters(&mut part, table);
        Some(part)
    }

    fn read_numbers(&mut self, table: &Table<'_>, key: &str) -> Vec<(String, f64, usize)> {
        let Some(value) = table.get(key) else { return Vec::new() };
        let Some(entries) = value.get_ref().as_table() else {
            self.report_problem(
                value.span().start,
                format!("{key} must be a table of numbers, {key} = {{ name = 1.0 }}"),
            );
            return Vec::new();
        };
        let read =
            |(key, value): Entry1<'_>| (key.get_ref().to_string(), parse_number(value.get_ref()), value.span().start);
        let entries: Vec<_> = entries.iter().map(read).collect();
        let mut numbers = Vec::new();
        for (name, value, offset) in entries {
            match value {
                Some(value) => numbers.push((name, value, offset)),
                None => self.report_problem(offset, format!("{name} must be a finite number")),
            }
        }
        numbers
    }

    fn read_linear_part(&mut self, table: &Table<'_>, offset: usize) -> Option<Part> {
        let coefficients = self.read_numbers(table, "columns");
        if coefficients.is_empty() {
            self.report_problem(offset, "a linear effect needs columns = { column = coefficient }".to_owned());
            return None;
        }
        let mut terms = Vec::new();
        let mut parameters = Vec::new();
        for (name, value, offset) in coefficients {
            match Term::parse(&name) {
                Ok(term) => {
                    parameters.push(build_free_parameter(term.text(), value, Entry::Linear));
                    terms.push(term);
                }
                Err(reason) => self.report_problem(offset, reason.to_string()),
            }
        }
        Some(build_part("linear", PartFunction::Linear(terms), parameters))
    }

    fn read_expression_part(&mut self, table: &Table<'_>, offset: usize) -> Option<Part> {
        let parameters: Vec<Parameter> = self
            .read_numbers(table, "parameters")
            .into_iter()
            .map(|(name, value, _)| build_free_parameter(&name, value, Entry::Shape))
            .collect();
        let Some(text) = table.get("expression").and_then(|text| text.get_ref().as_str()) else {
            self.report_problem(offset, "an expression effect needs expression = \"...\"".to_owned());
            return None;
        };
        let names: Vec<String> = parameters.iter().map(|parameter| parameter.name.clone()).collect();
        match Expression::compile_text(text, &names) {
            Ok(expression) => Some(build_part("expression", PartFunction::Expression(expression), parameters)),
            Err(reason) => {
                let offset = table.get("expression").map_or(offset, |text| text.span().start);
                self.report_problem(offset, format!("the expression does not compile: {reason}"));
                None
            }
        }
    }

    fn read_speed_table(&mut self, table: &Table<'_>, offset: usize) -> Option<Part> {
        let inside = table.get("parameters")?.get_ref().as_table()?;
        self.report_unknown_keys(inside, &["speeds_rpm", "power_w"], "the no-load table");
        let list = |key: &str| -> Option<Vec<f64>> {
            inside.get(key)?.get_ref().as_array()?.iter().map(|value| parse_number(value.get_ref())).collect()
        };
        let (speeds, powers) = (list("speeds_rpm").unwrap_or_default(), list("power_w").unwrap_or_default());
        if speeds.is_empty() || speeds.len() != powers.len() || speeds.windows(2).any(|pair| pair[1] <= pair[0]) {
            let text = "a no-load table needs increasing speeds_rpm and as many power_w".to_owned();
            self.report_problem(offset, text);
            return None;
        }
        let parameters = powers
            .iter()
            .enumerate()
            .map(|(index, power)| Parameter {
                // A spindle that turns at a steady speed takes power; less than nothing only where the file says so, of a meter with a zero of its own.
                range: (power.min(0.0), f64::INFINITY),
                ..build_free_parameter(&format!("power_w[{index}]"), *power, Entry::Linear)
            })
            .collect();
        let gear_stage = table.get("gear_stage").and_then(|stage| parse_number(stage.get_ref()));
        Some(build_part(
            "no_load_power",
            PartFunction::Table(SpeedTable { speeds_rpm: speeds, gear_stage }),
            parameters,
        ))
    }

    fn read_catalogue_part(&mut self, kind: &str, table: &Table<'_>, offset: usize) -> Option<Part> {
        let Some(effect) = find_effect(kind) else {
            let kinds = CATALOGUE.iter().map(|effect| effect.doc().kind).chain(["linear", "expression"]);
            let hint = format_suggestion(kind, kinds);
            self.report_problem(
                offset,
                format!("unknown kind {kind}{hint}; `cnc-gateway effects list` shows every kind"),
            );
            return None;
        };
        let doc = effect.doc();
        let mut parameters = Vec::new();
        for (name, value, offset) in self.read_numbers(table, "parameters") {
            let Some(known) = doc.find_parameter(&name) else {
                let hint = format_suggestion(&name, doc.parameters.iter().map(|parameter| parameter.name));
                self.report_problem(offset, format!("{kind} has no parameter {name}{hint}"));
                continue;
            };
            if value < known.range.0 || value > known.range.1 {
                let (low, high) = known.range;
                let unit = space_unit(known.unit);
                self.report_problem(
                    offset,
                    format!("{kind}.{name} = {value} is outside its physical range {low} to {high}{unit}"),
                );
            }
            let mut parameter = build_free_parameter(&name, value, known.entry);
            parameter.range = known.range;
            known.unit.clone_into(&mut parameter.unit);
            parameters.push(parameter);
        }
        let form = self.read_form(effect, table);
        Some(build_part(kind, PartFunction::Effect(effect, form), parameters))
    }

    fn read_form(&mut self, effect: &'static dyn Effect, table: &Table<'_>) -> Form {
        let mut form = Form::without_shape();
        let chosen = table.get("form").or_else(|| table.get("process"));
        if let Some(name) = chosen.and_then(|name| name.get_ref().as_str()) {
            match effect.form_names().iter().find(|known| **known == name) {
                Some(name) => form.name = name,
                None => {
                    let offset = chosen.map_or(0, |name| name.span().start);
                    let known = effect.form_names();
                    let forms = if known.is_empty() { "only one".to_owned() } else { known.join(", ") };
                    self.report_problem(
                        offset,
                        format!("{} has no form {name}; its forms: {forms}", effect.doc().kind),
                    );
                }
            }
        }
        if let Some(place) = table.get("place").and_then(|place| place.get_ref().as_table()) {
            let word = |key: &str| place.get(key).and_then(|word| word.get_ref().as_str()).map(str::to_owned);
            form.place = word("column").zip(word("equals").or_else(|| word("since")));
        }
        form
    }

    /// `departure = [{ over = "spindle_speed_rpm", x = [..], y = [..] }]`: the law times one plus the sum of them.
    fn read_departures(&mut self, part: &mut Part, table: &Table<'_>) {
        let Some(given) = table.get("departure") else { return };
        let offset = given.span().start;
        let entries = given.get_ref().as_array().map(|all| all.iter().filter_map(|one| one.get_ref().as_table()));
        for (number, one) in entries.into_iter().flatten().enumerate() {
            self.report_unknown_keys(one, &["over", "x", "y"], "a departure");
            let list = |key: &str| -> Option<Vec<f64>> {
                one.get(key)?.get_ref().as_array()?.iter().map(|value| parse_number(value.get_ref())).collect()
            };
            let over = one.get("over").and_then(|over| over.get_ref().as_str()).map(str::to_owned);
            let (x, y) = (list("x").unwrap_or_default(), list("y").unwrap_or_default());
            let rises = x.windows(2).all(|pair| pair[0] < pair[1]);
            let (true, Some(over)) = (!x.is_empty() && x.len() == y.len() && rises, over) else {
                let text = "a departure needs over = \"column\", increasing x, and as many y".to_owned();
                self.report_problem(offset, text);
                continue;
            };
            let departure = Departure { over, x };
            let middle = y.iter().position(|y| *y == 0.0);
            part.parameters.extend(departure.build_parameters(number, &y, middle));
            part.departures.push(departure);
        }
        if part.departures.is_empty() {
            let text = "write departures as departure = [{ over = \"column\", x = [..], y = [..] }]".to_owned();
            self.report_problem(offset, text);
        }
    }

    fn fix_parameters(&mut self, part: &mut Part, table: &Table<'_>) {
        let Some(fixed) = table.get("fixed") else { return };
        let Some(names) = fixed.get_ref().as_array() else {
            self.report_problem(fixed.span().start, "fixed must be a list of parameter names".to_owned());
            return;
        };
        for name in names.iter() {
            let text = name.get_ref().as_str().unwrap_or_default();
            match part.parameters.iter_mut().find(|parameter| parameter.name == text) {
                Some(parameter) => parameter.fixed = true,
                None => {
                    let hint = format_suggestion(text, part.parameters.iter().map(|parameter| parameter.name.as_str()));
                    self.report_problem(
                        name.span().start,
                        format!("fixed names {text:?}, which is no parameter of this effect{hint}"),
                    );
                }
            }
        }
    }

    fn read_roles(&mut self, table: &Table<'_>) -> BTreeMap<Role, String> {
        let mut roles = BTreeMap::new();
        let Some(entries) = table.get("roles").and_then(|roles| roles.get_ref().as_table()) else { return roles };
        let read = |(key, value): Entry1<'_>| {
            (key.get_ref().to_string(), value.get_ref().as_str().map(str::to_owned), key.span().start)
        };
        let entries: Vec<_> = entries.iter().map(read).collect();
        for (name, column, offset) in entries {
            match (Role::from_name(&name), column) {
                (Some(role), Some(column)) => {
                    roles.insert(role, column);
                }
                (None, _) => {
                    let hint = format_suggestion(&name, Role::ALL.iter().map(|role| role.name()));
                    self.report_problem(offset, format!("unknown role {name}{hint}"));
                }
                (_, None) => self.report_problem(offset, format!("role {name} must name a column")),
            }
        }
        roles
    }

    fn read_candidates(&mut self, table: &Table<'_>) -> (Vec<String>, Vec<String>) {
        let Some(candidates) = table.get("candidates").and_then(|entry| entry.get_ref().as_table()) else {
            return (Vec::new(), Vec::new());
        };
        self.report_unknown_keys(candidates, &["exclude", "only"], "[candidates]");
        let mut list = |key: &str| -> Vec<String> {
            let Some(entries) = candidates.get(key).and_then(|entry| entry.get_ref().as_array()) else {
                return Vec::new();
            };
            let kinds: Vec<_> = entries
                .iter()
                .map(|kind| (kind.get_ref().as_str().unwrap_or_default().to_owned(), kind.span().start))
                .collect();
            for (kind, offset) in &kinds {
                if find_effect(kind).is_none() {
                    let hint = format_suggestion(kind, CATALOGUE.iter().map(|effect| effect.doc().kind));
                    self.report_problem(*offset, format!("unknown kind {kind}{hint}"));
                }
            }
            kinds.into_iter().map(|(kind, _)| kind).collect()
        };
        (list("exclude"), list("only"))
    }
}

fn has_speed_table(table: &Table<'_>) -> bool {
    let inside = table.get("parameters").and_then(|parameters| parameters.get_ref().as_table());
    inside.is_some_and(|inside| inside.contains_key("speeds_rpm") || inside.contains_key("power_w"))
}

fn build_part(kind: &str, body: PartFunction, parameters: Vec<Parameter>) -> Part {
    Part { kind: kind.to_owned(), name: None, body, parameters, departures: Vec::new(), line: 0 }
}

fn build_free_parameter(name: &str, value: f64, entry: Entry) -> Parameter {
    let range = (f64::NEG_INFINITY, f64::INFINITY);
    Parameter { name: name.to_owned(), value, fixed: false, entry, range, unit: "output".to_owned() }
}

fn parse_number(value: &DeValue<'_>) -> Option<f64> {
    let text = match value {
        DeValue::Integer(integer) => integer.as_str().to_owned(),
        DeValue::Float(float) => float.as_str().to_owned(),
        _ => return None,
    };
    text.replace('_', "").parse().ok().filter(|number: &f64| number.is_finite())
}

fn format_suggestion<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    find_nearest_name(name, known).map(|known| format!("; did you mean {known}?")).unwrap_or_default()
}

/// Writes a model in the form in which it is read.
#[must_use]
pub fn write_model(model: &Model) -> String {
    let mut text = format!(
        "schema = \"model/1\"\nname   = {}\noutput = {}\n",
        format_toml_text(&model.name),
        format_toml_text(&model.output)
    );
    for part in &model.parts {
        text.push_str(&write_part(part));
    }
    if !model.roles.is_empty() {
        text.push_str("\n[roles]\n");
        for (role, column) in &model.roles {
            text.push_str(&format!("{} = {}\n", role.name(), format_toml_text(column)));
        }
    }
    if !model.exclude.is_empty() {
        let kinds: Vec<String> = model.exclude.iter().map(|kind| format_toml_text(kind)).collect();
        text.push_str(&format!("\n[candidates]\nexclude = [{}]\n", kinds.join(", ")));
    }
    text
}

fn write_part(part: &Part) -> String {
    let mut text = format!("\n[[effect]]\nkind = {}\n", format_toml_text(&part.kind));
    if let Some(name) = &part.name {
        text.push_str(&format!("name = {}\n", format_toml_text(name)));
    }
    let numbers: Vec<String> = part
        .parameters
        .iter()
        .filter(|parameter| !is_of_departure(parameter))
        .map(|parameter| format!("{} = {}", format_key(&parameter.name), format_float(parameter.value)))
        .collect();
    let numbers = numbers.join(", ");
    match &part.body {
        PartFunction::Linear(_) => text.push_str(&format!("columns = {{ {numbers} }}\n")),
        PartFunction::Table(table) => text.push_str(&write_table(part, table)),
        PartFunction::Expression(expression) => {
            text.push_str(&format!(
                "expression = {}\nparameters = {{ {numbers} }}\n",
                format_toml_text(expression.text())
            ));
        }
        PartFunction::Effect(_, form) => {
            text.push_str(&format!("parameters = {{ {numbers} }}\n"));
            if !form.name.is_empty() {
                let key = if part.kind == "cutting_power" { "process" } else { "form" };
                text.push_str(&format!("{key} = {}\n", format_toml_text(form.name)));
            }
            if let Some((column, word)) = &form.place {
                text.push_str(&format!(
                    "place = {{ column = {}, equals = {} }}\n",
                    format_toml_text(column),
                    format_toml_text(word)
                ));
            }
        }
    }
    text.push_str(&write_departures(part));
    let fixed: Vec<String> = part
        .parameters
        .iter()
        .filter(|parameter| parameter.fixed && !is_of_departure(parameter))
        .map(|parameter| format_toml_text(&parameter.name))
        .collect();
    if !fixed.is_empty() {
        text.push_str(&format!("fixed = [{}]\n", fixed.join(", ")));
    }
    text
}

fn write_departures(part: &Part) -> String {
    if part.departures.is_empty() {
        return String::new();
    }
    let list = |values: &[f64]| values.iter().map(|x| format_float(*x)).collect::<Vec<_>>().join(", ");
    let of = |(number, departure): (usize, &Departure)| {
        let (over, x, y) =
            (format_toml_text(&departure.over), list(&departure.x), list(&part.list_knot_values(number)));
        format!("{{ over = {over}, x = [{x}], y = [{y}] }}")
    };
    let all: Vec<String> = part.departures.iter().enumerate().map(of).collect();
    format!("departure = [{}]\n", all.join(", "))
}

fn write_table(part: &Part, table: &SpeedTable) -> String {
    let list = |values: Vec<f64>| values.into_iter().map(format_float).collect::<Vec<_>>().join(", ");
    let powers = list(part.parameters.iter().map(|parameter| parameter.value).collect());
    let speeds = list(table.speeds_rpm.clone());
    let stage = table.gear_stage.map(|stage| format!("gear_stage = {}\n", format_float(stage))).unwrap_or_default();
    format!("parameters = {{ speeds_rpm = [{speeds}], power_w = [{powers}] }}\n{stage}")
}

fn format_float(value: f64) -> String {
    format!("{value:?}")
}

fn format_key(name: &str) -> String {
    let bare = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { name.to_owned() } else { format_toml_text(name) }
}

/// A text as TOML writes it, with quotation marks. What Rust prints for debugging has escapes that TOML does not know.
#[must_use]
pub fn format_toml_text(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_problem_comes_at_once_with_its_line() {
        let text = "schema = \"model/1\"\noutput = \"y_w\"\n[[effect]]\nkind = \"flank_waer\"\n[[effect]]\nkind = \"flank_wear\"\nparameters = { k = -1.0, q = 1.0 }\nfixed = [\"z\"]\n[rolls]\n";
        let problems = parse_model(text).expect_err("several problems");
        let all = problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
        for wanted in [
            "did you mean flank_wear?",
            "line 7: flank_wear.k = -1 is outside",
            "no parameter q",
            "line 8: fixed",
            "unknown key rolls in the model; did you mean roles?",
        ] {
            assert!(all.contains(wanted), "{wanted} in:\n{all}");
        }
    }

    #[test]
    fn a_model_survives_being_written_and_read() {
        let text = "schema = \"model/1\"\nname = \"a \\\"b\\\"\"\noutput = \"y_w\"\n[[effect]]\nkind = \"linear\"\ncolumns = { one = 1.0, \"a^2\" = -2.5e-5 }\nfixed = [\"one\"]\n[[effect]]\nkind = \"flank_wear\"\nparameters = { k = 2.0, p = 1.0 }\ndeparture = [{ over = \"n_rpm\", x = [100.0, 200.0, 300.0], y = [-0.1, 0.0, 0.2] }]\n[[effect]]\nkind = \"no_load_power\"\nparameters = { speeds_rpm = [100.0, 200.0], power_w = [10.0, 20.0] }\n[[effect]]\nkind = \"expression\"\nname = \"door\"\nexpression = \"k * a\"\nparameters = { k = 1.0 }\n[roles]\nspeed = \"n_rpm\"\n";
        let once = write_model(&parse_model(text).expect("reads"));
        let twice = write_model(&parse_model(&once).expect("reads again"));
        assert_eq!(once, twice);
    }

    #[test]
    fn no_refit_makes_a_no_load_power_negative_unless_the_file_says_so() {
        let text = "schema = \"model/1\"\noutput = \"y_w\"\n[[effect]]\nkind = \"no_load_power\"\nparameters = { speeds_rpm = [0.0, 200.0], power_w = [-3.0, 20.0] }\n";
        let model = parse_model(text).expect("reads");
        let ranges: Vec<(f64, f64)> = model.parts[0].parameters.iter().map(|parameter| parameter.range).collect();
        assert_eq!(ranges, [(-3.0, f64::INFINITY), (0.0, f64::INFINITY)]);
    }

    /// What a diagnosis may accept into a model must be a model again, whatever form was found.
    #[test]
    fn every_form_of_every_effect_survives_being_written_and_read() {
        for effect in CATALOGUE {
            let parameters = effect.doc().parameters.iter();
            let linear: Vec<&str> = parameters.filter(|p| p.entry == Entry::Linear).map(|p| p.name).collect();
            for name in effect.form_names() {
                let offset = "schema = \"model/1\"\noutput = \"y_w\"\n[[effect]]\nkind = \"offset\"\n";
                let mut model = parse_model(offset).expect("reads");
                model.parts = vec![Part::from_effect(*effect, &Form { name, ..Form::without_shape() }, &linear)];
                let read = parse_model(&write_model(&model));
                let read = read.unwrap_or_else(|problems| panic!("{}: {problems:?}", effect.doc().kind));
                assert_eq!(read.parts[0].parameters.len(), linear.len());
                assert!(matches!(&read.parts[0].body, PartFunction::Effect(_, form) if form.name == *name));
            }
        }
    }

    #[test]
    fn a_form_of_another_effect_is_refused_with_the_right_ones() {
        let text = "schema = \"model/1\"\noutput = \"y_w\"\n[[effect]]\nkind = \"meter_window\"\nform = \"ramp\"\n";
        let problems = parse_model(text).expect_err("no such form");
        assert!(
            problems[0].to_string().contains("meter_window has no form ramp; its forms: lag, mean, late"),
            "{}",
            problems[0]
        );
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(schema|\\[\\[effect\\]\\]|kind|=|\"|\n|\\{|\\}|[a-z0-9.]|\\PC){0,120}") {
            let _ = parse_model(&text);
        }
    }
}
