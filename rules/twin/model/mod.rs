//! A model: a list of effects with parameters, whose sum is the simulated output (`model/1`).

use super::channel::{SIMULATED_OUTPUT, is_simulated};
use super::departure::{DEPARTURE_USUAL, Departure, is_of_departure};
use super::expression::Expression;
use super::term::Term;
use physics::{Effect, Entry, Form, ParameterDoc, Role, Scene};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// One parameter of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name, as in the file.
    pub name: String,
    /// The value it has now, in `unit`.
    pub value: f64,
    /// Is it never refitted?
    pub fixed: bool,
    /// Is the contribution proportional to it, or does it bend the shape?
    pub entry: Entry,
    /// Least and greatest value that is physically possible.
    pub range: (f64, f64),
    /// Unit; `output` stands for the output's unit.
    pub unit: String,
}

impl Parameter {
    /// By how much it usually deviates from zero; `None` of a parameter that may have any size.
    #[must_use]
    pub(super) fn prior_deviation(&self) -> Option<f64> {
        is_of_departure(self).then_some(DEPARTURE_USUAL)
    }
}

/// What a part computes.
#[derive(Clone)]
pub enum PartFunction {
    /// An effect of the catalogue in a form; the shape values stand in the parameters.
    Effect(&'static dyn Effect, Form),
    /// A sum of coefficient times term; one parameter per term.
    Linear(Vec<Term>),
    /// No-load power as a table over speed; one parameter per speed, interpolated quadratically.
    Table(super::speed_table::SpeedTable),
    /// A user's expression over columns and its parameters.
    Expression(Expression),
}

impl fmt::Debug for PartFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Effect(effect, form) => write!(f, "Effect({}, {form:?})", effect.doc().kind),
            Self::Linear(terms) => write!(f, "Linear({terms:?})"),
            Self::Table(table) => write!(f, "{table:?}"),
            Self::Expression(expression) => write!(f, "Expression({})", expression.text()),
        }
    }
}

/// One effect in a model.
#[derive(Debug, Clone)]
pub struct Part {
    /// Kind, as in the file.
    pub kind: String,
    /// The user's name for it, where given.
    pub name: Option<String>,
    /// The law that the parameters enter.
    pub body: PartFunction,
    /// The numbers of the law, with values and ranges.
    pub parameters: Vec<Parameter>,
    /// How the machine departs from the law.
    pub departures: Vec<Departure>,
    /// Line of the file, 0 when it was not read from one.
    pub line: usize,
}

impl Part {
    /// A candidate as a part, its linear parameters at zero where they are not known.
    #[must_use]
    pub fn from_effect(effect: &'static dyn Effect, form: &Form, linear: &[&'static str]) -> Self {
        let shape = form.shape.iter().map(|(name, value)| build_parameter(effect, name, *value, Entry::Shape));
        let linear = linear.iter().map(|name| build_parameter(effect, name, 0.0, Entry::Linear));
        let mut parameters: Vec<Parameter> = linear.chain(shape).collect();
        for parameter in &mut parameters {
            if let Some((_, value)) = form.known.iter().find(|(name, _)| *name == parameter.name) {
                (parameter.value, parameter.fixed) = (*value, true);
            }
        }
        let body = PartFunction::Effect(effect, form.clone());
        Self { kind: effect.doc().kind.to_owned(), name: None, body, parameters, departures: Vec::new(), line: 0 }
    }

    /// The name reports use: the user's, or the kind.
    #[must_use]
    pub fn label(&self) -> &str {
        self.name.as_deref().unwrap_or(&self.kind)
    }

    /// The columns that a formula names; none of an effect or a table, whose inputs follow from what they are.
    #[must_use]
    pub fn inputs(&self) -> Vec<&str> {
        match &self.body {
            PartFunction::Linear(terms) => terms.iter().filter_map(Term::input).collect(),
            PartFunction::Expression(expression) => expression.inputs().iter().map(String::as_str).collect(),
            PartFunction::Effect(..) | PartFunction::Table(_) => Vec::new(),
        }
    }

    /// The effect of the catalogue with the form as it is now; `None` of any other part.
    #[must_use]
    pub(super) fn effect_and_form(&self) -> Option<(&'static dyn Effect, Form)> {
        match &self.body {
            PartFunction::Effect(effect, form) => Some((*effect, self.build_current_form(form))),
            _ => None,
        }
    }

    /// The form with the present shape values.
    fn build_current_form(&self, form: &Form) -> Form {
        let mut form = form.clone();
        for parameter in self.parameters.iter().filter(|parameter| parameter.entry == Entry::Shape) {
            match form.shape.iter_mut().find(|(name, _)| *name == parameter.name) {
                Some((_, value)) => *value = parameter.value,
                None => {
                    if let PartFunction::Effect(effect, _) = &self.body
                        && let Some(doc) = effect.doc().find_parameter(&parameter.name)
                    {
                        form.shape.push((doc.name, parameter.value));
                    }
                }
            }
        }
        form
    }

    /// Is it an effect of the catalogue in the form of this name?
    #[must_use]
    pub(crate) fn has_form(&self, name: &str) -> bool {
        matches!(&self.body, PartFunction::Effect(_, form) if form.name == name)
    }

    /// One column per linear parameter, by name; `None` when an input is missing. An expression has none.
    #[must_use]
    pub fn compute_columns(&self, scene: &Scene) -> Option<Vec<(String, Vec<f64>)>> {
        let mut columns = self.compute_law_columns(scene)?;
        if let Some(factor) = self.compute_departure_factor(scene)? {
            columns.iter_mut().for_each(|(_, c)| c.iter_mut().zip(&factor).for_each(|(x, factor)| *x *= factor));
        }
        Some(columns)
    }

    fn compute_law_columns(&self, scene: &Scene) -> Option<Vec<(String, Vec<f64>)>> {
        match &self.body {
            PartFunction::Effect(effect, form) => {
                let columns = effect.compute_columns(scene, &self.build_current_form(form))?;
                Some(columns.into_iter().map(|(name, column)| (name.to_owned(), column)).collect())
            }
            PartFunction::Linear(terms) => {
                terms.iter().map(|term| Some((term.text().to_owned(), term.compute_column(scene)?))).collect()
            }
            PartFunction::Table(table) => table.compute_columns(scene),
            PartFunction::Expression(_) => Some(Vec::new()),
        }
    }

    /// What the part adds to the output, in the output's unit.
    #[must_use]
    pub fn compute_contribution(&self, scene: &Scene) -> Option<Vec<f64>> {
        if let PartFunction::Expression(expression) = &self.body {
            return expression.evaluate_rows(scene, &self.parameters);
        }
        let mut sum = vec![0.0; scene.rows()];
        for (name, column) in self.compute_columns(scene)? {
            if let Some(parameter) = self.parameters.iter().find(|parameter| parameter.name == name) {
                let factor = parameter.value;
                sum.iter_mut().zip(&column).for_each(|(sum, x)| *sum += factor * x);
            }
        }
        Some(sum)
    }

    /// Does it act on the output that the physical parts simulate, and so come after all of them?
    #[must_use]
    pub fn acts_on_output(&self) -> bool {
        let acting = ["sensor_gain", "supply_voltage", "clock_lag", "meter_window", "saturation"];
        let over_output = self.reads_channel(|channel| channel == SIMULATED_OUTPUT);
        over_output || self.has_form("clipped") || acting.contains(&self.kind.as_str())
    }

    /// Is it a state that nobody records, followed from what all other parts leave of the earlier rows of a run?
    #[must_use]
    pub fn is_followed(&self) -> bool {
        matches!(&self.body, PartFunction::Effect(effect, form) if effect.is_followed(form))
    }

    /// Is it a formula over such a channel?
    fn reads_channel(&self, such: impl Fn(&str) -> bool) -> bool {
        matches!(&self.body, PartFunction::Expression(_)) && self.inputs().into_iter().any(such)
    }

    /// Does it read the load that the cut simulates?
    #[must_use]
    pub fn reads_load(&self) -> bool {
        match &self.body {
            PartFunction::Effect(effect, _) => effect.reads_load(),
            _ => self.reads_channel(is_simulated),
        }
    }

    /// Does it read what the load comes to at the output, losses included?
    #[must_use]
    pub fn reads_load_at_output(&self) -> bool {
        matches!(&self.body, PartFunction::Effect(effect, _) if effect.reads_load_at_output())
    }

    /// Does this part have to be simulated again after that one of the same model has changed?
    fn depends_on_part(&self, changed: &Self) -> bool {
        self.acts_on_output() && !changed.acts_on_output() || self.is_followed() || changed.is_read_by(self)
    }

    /// Does the other read what this one simulates, the output as a whole apart?
    #[must_use]
    pub fn is_read_by(&self, other: &Self) -> bool {
        self.is_cut() && other.reads_load() || self.is_load_loss() && other.reads_load_at_output()
    }

    /// Is it what the cut loses on its way to the output?
    fn is_load_loss(&self) -> bool {
        self.kind == "load_loss"
    }

    /// Is it the cut, whose contribution is the load for the others?
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.kind == "cutting_power"
    }

    /// The parameter of this name.
    #[must_use]
    pub fn find_parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }
}

fn build_parameter(effect: &'static dyn Effect, name: &str, value: f64, entry: Entry) -> Parameter {
    let doc: Option<&ParameterDoc> = effect.doc().find_parameter(name);
    Parameter {
        name: name.to_owned(),
        value,
        fixed: false,
        entry,
        range: doc.map_or((f64::NEG_INFINITY, f64::INFINITY), |doc| doc.range),
        unit: doc.map_or("output", |doc| doc.unit).to_owned(),
    }
}

/// What a simulation believes.
#[derive(Debug, Clone)]
pub struct Model {
    /// Name of the machine or model.
    pub name: String,
    /// Column of the quantity that is simulated.
    pub output: String,
    /// The effects whose sum is the output.
    pub parts: Vec<Part>,
    /// Columns that the file assigns to roles.
    pub roles: BTreeMap<Role, String>,
    /// Kinds that the search must not consider.
    pub exclude: Vec<String>,
    /// When not empty, the only kinds the search considers.
    pub only: Vec<String>,
    /// The user's own hypotheses, candidates besides the catalogue.
    pub hypotheses: Vec<Part>,
}

/// What a model says about a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// The output, row by row.
    pub total: Vec<f64>,
    /// What each part adds.
    pub contributions: Vec<Vec<f64>>,
}

/// Runs parts over a scene: the cut first, whose contribution becomes the load; its losses; the other physical parts; last
/// those that act on the output as a whole. The scene keeps load and simulated output for candidates. `None` when a
/// part lacks an input.
pub fn simulate_parts(parts: &[Part], scene: &mut Scene) -> Option<Simulated> {
    let (total, contributions) = simulate_stages(parts, scene, None)?;
    Some(Simulated { total, contributions: contributions.into_iter().map(Cow::into_owned).collect() })
}

/// The total where one part has changed since all were simulated: what does not follow from it is taken from there.
pub(super) fn simulate_changed_part(
    parts: &[Part],
    scene: &mut Scene,
    before: &Simulated,
    changed: usize,
) -> Option<Vec<f64>> {
    simulate_stages(parts, scene, Some((before, changed))).map(|(total, _)| total)
}

/// The total and what each part adds to it.
type PartSums<'a> = (Vec<f64>, Vec<Cow<'a, [f64]>>);

fn simulate_stages<'a>(
    parts: &[Part],
    scene: &mut Scene,
    before: Option<(&'a Simulated, usize)>,
) -> Option<PartSums<'a>> {
    let mut contributions: Vec<Cow<'a, [f64]>> = vec![Cow::Borrowed(&[]); parts.len()];
    let mut total = vec![0.0; scene.rows()];
    scene.set_load(None);
    scene.set_load_at_output(None);
    scene.set_simulated(None);
    let cut = parts.iter().any(Part::is_cut);
    if !cut {
        scene.set_load(compute_linear_load(parts, scene));
    }
    let losses = cut && parts.iter().any(Part::is_load_loss);
    if cut {
        run_stage(parts, scene, before, &mut contributions, &mut total, Part::is_cut)?;
        scene.set_load(Some(total.clone()));
    }
    if losses {
        run_stage(parts, scene, before, &mut contributions, &mut total, Part::is_load_loss)?;
        scene.set_load_at_output(Some(total.clone()));
    }
    let late = |part: &Part| part.acts_on_output() || part.is_followed();
    let in_between = |part: &Part| !(part.is_cut() || losses && part.is_load_loss() || late(part));
    run_stage(parts, scene, before, &mut contributions, &mut total, in_between)?;
    scene.set_simulated(Some(total.clone()));
    for followed in [false, true] {
        let last = |part: &Part| late(part) && part.is_followed() == followed;
        if parts.iter().any(last) {
            run_stage(parts, scene, before, &mut contributions, &mut total, last)?;
            scene.set_simulated(Some(total.clone()));
        }
    }
    Some((total, contributions))
}

/// The load in the unit of the output, where the cut is a linear term of the column that plays its part.
fn compute_linear_load(parts: &[Part], scene: &Scene) -> Option<Vec<f64>> {
    let name = scene.role_name(Role::Load)?;
    let factor = parts.iter().find_map(|part| match &part.body {
        PartFunction::Linear(terms) => {
            let of = terms.iter().zip(&part.parameters).find(|(term, _)| term.text() == name);
            of.map(|(_, parameter)| parameter.value).filter(|factor| *factor > 0.0)
        }
        _ => None,
    })?;
    Some(scene.column(name)?.iter().map(|x| factor * x).collect())
}

fn run_stage<'a>(
    parts: &[Part],
    scene: &Scene,
    before: Option<(&'a Simulated, usize)>,
    contributions: &mut [Cow<'a, [f64]>],
    total: &mut [f64],
    belongs: impl Fn(&Part) -> bool,
) -> Option<()> {
    for (index, part) in parts.iter().enumerate().filter(|(_, part)| belongs(part)) {
        let known = before.filter(|(_, changed)| index != *changed && !part.depends_on_part(&parts[*changed]));
        let slot = &mut contributions[index];
        *slot = match known {
            Some((before, _)) => Cow::Borrowed(&before.contributions[index]),
            None => Cow::Owned(part.compute_contribution(scene)?),
        };
        total.iter_mut().zip(slot.iter()).for_each(|(total, x)| *total += x);
    }
    Some(())
}

#[cfg(test)]
mod tests;
