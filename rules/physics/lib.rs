//! What is known: one physical effect per file.
//!
//! An [`Effect`] is a law that is linear in some parameters and has a shape governed by the others. The same effect
//! serves as a part of a model and as a candidate for what a model has left out. Its [`EffectDoc`] is written once:
//! rustdoc, `effects show`, the diagnosis report and the check of model files all read it.

pub mod catalogue;
mod cut;
pub mod drive;
mod excitation;
pub mod explain;
mod scene;
pub mod state;
mod tool_load;
pub mod two_levels;
mod unit;

use adapter_core::channel::quantity::Quantity;
pub use catalogue::{CATALOGUE, find_effect};
pub use cut::mark_contact_rows;
pub use excitation::{BEGUN, FOLLOWED, format_run_stretch, keep_met_units};
pub use scene::{LinearLaw, OutputKind, PAUSE_PERIODS, Role, Scene, SceneError};
pub use unit::{find_quantity_unit, resolve_unit};

/// How a parameter enters the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entry {
    /// The contribution is proportional to it.
    Linear,
    /// It bends the shape of the contribution (an exponent, a time constant, a threshold).
    Shape,
}

/// What a parameter is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterDoc {
    /// Name in model files and reports.
    pub name: &'static str,
    /// Unit; `output` stands for the unit of the simulated output, `velocity` for m/s or, of a spindle, rad/s.
    /// [`resolve_unit`] replaces them.
    pub unit: &'static str,
    /// Is the contribution proportional to it, or does it bend the shape?
    pub entry: Entry,
    /// Least and greatest value that is physically possible. A range on one side of zero is the sign of the effect.
    pub range: (f64, f64),
    /// What it is, in English.
    pub en: &'static str,
    /// What it is, in Chinese.
    pub zh: &'static str,
}

impl ParameterDoc {
    /// A parameter that the contribution is proportional to: name, unit, range, and what it is in both languages.
    #[must_use]
    pub const fn new_linear(
        name: &'static str,
        unit: &'static str,
        range: (f64, f64),
        en: &'static str,
        zh: &'static str,
    ) -> Self {
        Self { name, unit, entry: Entry::Linear, range, en, zh }
    }

    /// A parameter that bends the shape of the contribution: name, unit, range, and what it is in both languages.
    #[must_use]
    pub const fn new_shape(
        name: &'static str,
        unit: &'static str,
        range: (f64, f64),
        en: &'static str,
        zh: &'static str,
    ) -> Self {
        Self { name, unit, entry: Entry::Shape, range, en, zh }
    }
}

/// The texts of an effect in one language.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texts {
    /// A short name, as in a sentence.
    pub name: &'static str,
    /// One sentence a machinist understands.
    pub statement: &'static str,
    /// How a recording looks when the simulation lacks it.
    pub absence: &'static str,
    /// What it is confused with, and why.
    pub confused_with: &'static str,
    /// The experiment that separates it from those.
    pub experiment: &'static str,
}

/// Everything a user is told about an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectDoc {
    /// Public name, as in model files and diagnoses.
    pub kind: &'static str,
    /// `model`, `drive`, `spindle`, `cutting`, `axis`, `auxiliary`, `thermal`, `measurement` or `control`.
    pub family: &'static str,
    /// The law, in plain ASCII.
    pub law: &'static str,
    /// The numbers of the law that are fitted.
    pub parameters: &'static [ParameterDoc],
    /// What it needs: roles or columns; alternatives separated by `|`.
    pub needs: &'static [&'static str],
    /// Where the law is from.
    pub source: &'static str,
    /// Minutes the separating experiment takes.
    pub experiment_minutes: f64,
    /// Kinds it is confused with.
    pub rivals: &'static [&'static str],
    /// The texts of the effect in English.
    pub en: Texts,
    /// The texts of the effect in Chinese.
    pub zh: Texts,
}

impl EffectDoc {
    /// The parameter of this name.
    #[must_use]
    pub fn find_parameter(&self, name: &str) -> Option<&'static ParameterDoc> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }
}

/// One concrete shape of an effect: a form of the law with values for its shape parameters.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Form {
    /// Which of the effect's forms; empty for the only one.
    pub name: &'static str,
    /// Shape parameters with their values.
    pub shape: Vec<(&'static str, f64)>,
    /// Parameters, proportional or shaping, that a candidate of this form takes for known, with their values.
    pub known: Vec<(&'static str, f64)>,
    /// A text condition, such as an operation or the run since when: column and word.
    pub place: Option<(String, String)>,
    /// Natural logarithm of how many alternatives of the same freedom are tried (steps at any run, any operation,
    /// any threshold): the price of having chosen this one.
    pub ln_choices: f64,
}

impl Form {
    /// A form with these shape parameters.
    #[must_use]
    pub fn from_shape(shape: &[(&'static str, f64)]) -> Self {
        Self { shape: shape.to_vec(), ..Self::default() }
    }

    /// The only form of an effect without shape parameters.
    #[must_use]
    pub fn without_shape() -> Self {
        Self::default()
    }

    /// The same form acting as a whole: its share is known to be one.
    #[must_use]
    pub fn with_full_share(self) -> Self {
        Self { known: vec![("share", 1.0)], ..self }
    }

    /// The value of a shape parameter.
    #[must_use]
    pub fn shape_value(&self, name: &str) -> Option<f64> {
        self.shape.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }
}

/// Contribution per unit of each linear parameter: name of the parameter and one number per row, in the output's
/// unit over the parameter's unit.
pub type ParameterColumns = Vec<(&'static str, Vec<f64>)>;

/// How large a contribution can be beside what the machine takes anyway, in the same rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// Nothing bounds the contribution.
    Any,
    /// So many times what the machine takes without a cut.
    NoLoad(f64),
    /// So many times the cut.
    Cut(f64),
}

/// One physical law: what it needs of a recording, and its columns of one number per row.
pub trait Effect: Sync + Send {
    /// Everything a user is told.
    fn doc(&self) -> &'static EffectDoc;

    /// The forms worth trying as a candidate in this scene, coarse in the shape parameters; empty when the scene lacks
    /// what the effect needs or never excites it.
    fn propose_forms(&self, scene: &Scene) -> Vec<Form>;

    /// Least and greatest value of a parameter that is physically possible for this output.
    fn parameter_range(&self, _scene: &Scene, parameter: &ParameterDoc) -> (f64, f64) {
        parameter.range
    }

    /// How large its contribution can be.
    fn bound(&self) -> Bound {
        Bound::Any
    }

    /// Can it be what a curve over a channel of this quantity is? Few laws know a temperature or a voltage.
    fn follows_quantity(&self, quantity: Quantity) -> bool {
        quantity != Quantity::Temperature
    }

    /// Names of its forms, as a model file gives them; none for an effect of one form.
    fn form_names(&self) -> &'static [&'static str] {
        &[]
    }

    /// The columns of this form, `None` when the scene lacks an input.
    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns>;

    /// The form a model file means when it gives no form: its shape parameters are replaced by the file's.
    fn default_form(&self, scene: &Scene) -> Form {
        self.propose_forms(scene).into_iter().next().unwrap_or_default()
    }

    /// Do its columns change with the load that the cut simulates?
    fn reads_load(&self) -> bool {
        self.doc().needs.iter().flat_map(|need| need.split('|')).any(|need| need.trim() == "load")
    }

    /// Do they change with the losses that the cut causes as well?
    fn reads_load_at_output(&self) -> bool {
        false
    }

    /// Does it act in the cut, so that it is multiplied by how far the tool is engaged?
    fn acts_in_cut(&self) -> bool {
        self.doc().family == "cutting"
    }

    /// May a machine depart from it by a factor over another quantity? Not from what is the same whatever the machine does.
    fn may_depart(&self) -> bool {
        true
    }

    /// Does each of its terms belong to an edge or a lot of its own? Without its term a law would say that this one does nothing.
    fn has_term_per_unit(&self, _form: &Form) -> bool {
        false
    }

    /// The column whose words name those units, where a form names them: its place lists them.
    fn unit_column(&self, _form: &Form) -> Option<&'static str> {
        None
    }

    /// Does a hidden state (how worn this tool is, a pump on or off, which lot) belong to a tool, lot or stretch, so
    /// that it must be followed through a held-out run?
    fn has_hidden_state(&self) -> bool {
        false
    }

    /// Is this form a state that nobody records, which is followed from what everything else leaves of the recorded output in
    /// earlier rows of a run?
    fn is_followed(&self, _form: &Form) -> bool {
        false
    }

    /// The form by which a step of this one is written where runs that took no part in the fit lie before the first one that shows it: the step
    /// may have begun in any of them. `None`: the form has no step.
    fn find_followed_form(&self, _form: &Form) -> Option<&'static str> {
        None
    }
}
