//! A user's hypothesis as a rhai expression over columns and its own parameters.

use super::channel::{SIMULATED_OUTPUT, is_simulated, read_channel_values};
use super::model::Parameter;
use physics::{LinearLaw, Scene};
use rhai::{AST, Engine, EvalAltResult, ParseError, Scope};
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// Operations one row may cost.
const OPERATIONS_PER_ROW_MAX: u64 = 10_000;

/// A user's expression, ready to be evaluated on every row.
#[derive(Clone)]
pub struct Expression {
    text: String,
    engine: Arc<Engine>,
    ast: Arc<AST>,
    inputs: Vec<String>,
}

impl fmt::Debug for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Expression({})", self.text)
    }
}

impl Expression {
    /// Compiles an expression; `parameters` are the names that are not columns.
    ///
    /// # Errors
    /// What the compiler says, with the column of the text.
    pub fn compile_text(text: &str, parameters: &[String]) -> Result<Self, ParseError> {
        let mut engine = Engine::new();
        engine.set_max_operations(OPERATIONS_PER_ROW_MAX);
        engine.set_max_expr_depths(64, 64);
        engine.set_max_string_size(1024);
        engine.set_max_array_size(64);
        engine.set_max_map_size(64);
        let ast = engine.compile_expression(replace_ternaries(text))?;
        let inputs = list_identifiers(text).into_iter().filter(|name| !parameters.contains(name)).collect();
        Ok(Self { text: text.to_owned(), engine: Arc::new(engine), ast: Arc::new(ast), inputs })
    }

    /// The expression as the user wrote it.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The columns it reads: names that end in a unit or are words of the recording.
    #[must_use]
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// Its value in every row; `None` when a column is missing or a row fails. A formula that is linear in its
    /// parameters is run through the script engine once only.
    #[must_use]
    pub fn evaluate_rows(&self, scene: &Scene, parameters: &[Parameter]) -> Option<Vec<f64>> {
        let kept = !self.inputs.iter().any(|input| is_simulated(input) || input == SIMULATED_OUTPUT);
        let law =
            kept.then(|| scene.cache_linear_law(&self.text, || self.find_linear_law(scene, parameters))).flatten();
        match law {
            Some(law) => {
                let mut sum = law.first()?.clone();
                for (parameter, column) in parameters.iter().zip(&law[1..]) {
                    sum.iter_mut().zip(column).for_each(|(sum, x)| *sum += parameter.value * x);
                }
                Some(sum)
            }
            None => self.run_script(scene, parameters),
        }
    }

    /// The formula as columns, if it is linear in its parameters: told by its values at zero, at each unit, and at two
    /// mixtures of them.
    fn find_linear_law(&self, scene: &Scene, parameters: &[Parameter]) -> LinearLaw {
        let at = |values: &dyn Fn(usize) -> f64| {
            let mut moved = parameters.to_vec();
            moved.iter_mut().enumerate().for_each(|(index, parameter)| parameter.value = values(index));
            self.run_script(scene, &moved)
        };
        let zero = at(&|_| 0.0)?;
        let mut columns = vec![zero.clone()];
        for index in 0..parameters.len() {
            let unit = at(&|other| f64::from(u8::from(other == index)))?;
            columns.push(unit.iter().zip(&zero).map(|(unit, zero)| unit - zero).collect());
        }
        let mixtures: [&dyn Fn(usize) -> f64; 2] =
            [&|index| 0.7 + 0.6 * numerics::statistics::count_to_f64(index), &|index| parameters[index].value * -1.3];
        let linear = mixtures.iter().all(|values| {
            at(values).is_some_and(|got| {
                got.iter().enumerate().all(|(row, got)| {
                    let parts = (0..parameters.len()).map(|index| values(index) * columns[index + 1][row]);
                    let (mut sum, mut size) = (zero[row], zero[row].abs());
                    parts.for_each(|part| (sum, size) = (sum + part, size + part.abs()));
                    (got - sum).abs() <= 1e-9 * size.max(f64::MIN_POSITIVE)
                })
            })
        });
        linear.then(|| Arc::new(columns))
    }

    /// Runs the script engine over every row.
    fn run_script(&self, scene: &Scene, parameters: &[Parameter]) -> Option<Vec<f64>> {
        let known = |name: &String| read_channel_values(scene, name);
        let values = self.inputs.iter().map(known).collect::<Option<Vec<_>>>()?;
        let inputs: Vec<(&str, Cow<'_, [f64]>)> = self.inputs.iter().map(String::as_str).zip(values).collect();
        let mut scope = Scope::new();
        for parameter in parameters {
            scope.push(parameter.name.clone(), parameter.value);
        }
        let base = scope.len();
        (0..scene.rows())
            .map(|row| {
                scope.rewind(base);
                for (name, values) in &inputs {
                    scope.push((*name).to_owned(), values[row]);
                }
                to_finite_number(self.engine.eval_ast_with_scope(&mut scope, &self.ast))
            })
            .collect()
    }
}

fn to_finite_number(value: Result<rhai::Dynamic, Box<EvalAltResult>>) -> Option<f64> {
    let value = value.ok()?;
    #[expect(clippy::cast_precision_loss, reason = "an integer result of a formula is small")]
    let number = value.as_float().ok().or_else(|| value.as_int().ok().map(|int| int as f64))?;
    number.is_finite().then_some(number)
}

/// The expression with every `condition ? a : b` written as rhai's `if condition { a } else { b }`.
fn replace_ternaries(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    // Inside out: every bracketed group is translated by itself, what remains has no brackets that matter.
    while let Some(open) = rest.find(['(', '[']) {
        let Some(close) = find_closing_bracket(rest, open) else { break };
        out.push_str(&rest[..=open]);
        let inside: Vec<String> =
            split_top_level(&rest[open + 1..close], ',').into_iter().map(replace_ternaries).collect();
        out.push_str(&inside.join(","));
        out.push_str(&rest[close..=close]);
        rest = &rest[close + 1..];
    }
    out.push_str(rest);
    translate_ternary(&out)
}

/// Translates the choice at the top level, if there is one.
fn translate_ternary(text: &str) -> String {
    let Some(question) =
        iterate_top_level(text).find(|(at, c)| *c == '?' && is_ternary_mark(text, *at)).map(|(at, _)| at)
    else {
        return text.to_owned();
    };
    let after = &text[question + 1..];
    let mut open = 0;
    for (at, c) in iterate_top_level(after) {
        match c {
            '?' if is_ternary_mark(after, at) => open += 1,
            ':' if open == 0 => {
                let (condition, yes, no) =
                    (&text[..question], translate_ternary(&after[..at]), translate_ternary(&after[at + 1..]));
                return format!("if {condition} {{ {yes} }} else {{ {no} }}");
            }
            ':' => open -= 1,
            _ => {}
        }
    }
    text.to_owned()
}

/// `??`, `?.` and `?[` are other operators.
fn is_ternary_mark(text: &str, at: usize) -> bool {
    let next = text[at + 1..].chars().next();
    let before = text[..at].chars().next_back();
    !matches!(next, Some('?' | '.' | '[')) && before != Some('?')
}

/// Characters outside every bracket.
fn iterate_top_level(text: &str) -> impl Iterator<Item = (usize, char)> + '_ {
    let mut depth = 0_i32;
    text.char_indices().filter(move |(_, c)| {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            _ => {}
        }
        depth == 0
    })
}

fn find_closing_bracket(text: &str, open: usize) -> Option<usize> {
    iterate_top_level(&text[open..])
        .map(|(at, _)| open + at)
        .find(|at| *at >= open && text[*at..].starts_with([')', ']']))
}

fn split_top_level(text: &str, separator: char) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut start = 0;
    let cuts: Vec<usize> = iterate_top_level(text).filter(|(_, c)| *c == separator).map(|(at, _)| at).collect();
    for cut in cuts {
        parts.push(&text[start..cut]);
        start = cut + separator.len_utf8();
    }
    parts.push(&text[start..]);
    parts
}

/// Names in the text that are not called as functions and are not literals.
fn list_identifiers(text: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        while at < bytes.len() && (bytes[at].is_ascii_alphanumeric() || bytes[at] == b'_') {
            at += 1;
        }
        if at == start {
            at += 1;
            continue;
        }
        let word = &text[start..at];
        let called = text[at..].trim_start().starts_with('(');
        let method = start > 0 && bytes[start - 1] == b'.';
        let literal = word.starts_with(|c: char| c.is_ascii_digit()) || ["true", "false", "if", "else"].contains(&word);
        if !called && !method && !literal && !names.iter().any(|name| name == word) {
            names.push(word.to_owned());
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_told_from_parameters_functions_and_numbers() {
        let text = "k * abs(axis_velocity_mm_min) * (ambient_temperature_c < 15.0 ? 1.0 : 0.0)";
        let got = Expression::compile_text(text, &["k".to_owned()]).expect("compiles");
        assert_eq!(got.inputs(), ["axis_velocity_mm_min", "ambient_temperature_c"]);
    }

    #[test]
    fn choices_are_written_as_rhai_writes_them() {
        let got = replace_ternaries("k * (a < 1.0 ? 1.0 : b > 2.0 ? max(a, b ? c : d) : 0.0)");
        assert_eq!(
            got,
            "k * (if a < 1.0  {  1.0  } else { if  b > 2.0  {  max(a,if  b  {  c  } else {  d })  } else {  0.0 } })"
        );
        assert_eq!(replace_ternaries("a ?? b"), "a ?? b");
    }

    #[test]
    fn a_broken_expression_says_where() {
        let error = Expression::compile_text("k * (", &["k".to_owned()]).expect_err("broken");
        assert!(error.to_string().contains("position"), "{error}");
    }
}
