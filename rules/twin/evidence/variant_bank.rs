//! The bank: every variant of every family as columns, named and nameless alike.
//!
//! A variant is a textbook law with what its form may lack beside it: the first column is the law, the others are
//! departures from it with a smaller prior deviation. What a kind needs (its sign, the channels it works through, whether
//! its form may be widened) is asked of its [`Family`], never of a list of names.

use super::inputs::RecordingInputs;
use std::borrow::Cow;
use std::ops::Range;

/// Share of its largest value that a column must reach in rows which are to tell its size.
const SEEN: f64 = 1e-3;
/// Share of a column's greatest value from which a row counts as acted upon.
const ACTING: f64 = 0.03;

/// What is known of a kind beside its columns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Family {
    /// The kind of the catalogue, or the name of the user's hypothesis.
    pub(super) kind: Cow<'static, str>,
    /// Sign of the law's contribution; zero for any.
    pub(super) sign: f64,
    /// Channels it works through: a nameless curve over one of them is the same thing said twice.
    pub(super) channels: &'static [&'static str],
    /// May its form be widened by factors of the law over speed, load, depth, feed, time and temperature?
    pub(super) widens: bool,
    /// Natural logarithm of how much rarer than usual it is.
    pub(super) ln_rarity: f64,
    /// Does it act where the inputs jump, so that such rows are no outliers?
    pub(super) at_edges: bool,
    /// Is it a part of many laws, so that it claims no curve by itself?
    pub(super) is_contained: bool,
    /// Do its variants contain the forms of the catalogue, so that these need not stand beside them?
    pub(super) covers: bool,
}

impl Family {
    /// A family of this kind of either sign.
    pub(super) const fn from_kind(kind: &'static str) -> Self {
        Self {
            kind: Cow::Borrowed(kind),
            sign: 0.0,
            channels: &[],
            widens: true,
            ln_rarity: 0.0,
            at_edges: false,
            is_contained: false,
            covers: true,
        }
    }

    /// Its contribution has this sign.
    pub(super) const fn with_sign(mut self, sign: f64) -> Self {
        self.sign = sign;
        self
    }

    /// It works through these channels.
    pub(super) const fn with_channels(mut self, channels: &'static [&'static str]) -> Self {
        self.channels = channels;
        self
    }

    /// Its form is as wide as it can be.
    pub(super) const fn without_widening(mut self) -> Self {
        self.widens = false;
        self
    }

    /// The forms of the catalogue stand beside its own.
    pub(super) const fn with_catalogue_forms(mut self) -> Self {
        self.covers = false;
        self
    }

    /// It is a part of many laws.
    pub(super) const fn with_containment(mut self) -> Self {
        self.is_contained = true;
        self
    }

    /// It acts where the inputs jump.
    pub(super) const fn with_edge_action(mut self) -> Self {
        self.at_edges = true;
        self
    }

    /// It is rarer than others.
    pub(super) const fn with_rarity(mut self, ln_rarity: f64) -> Self {
        self.ln_rarity = ln_rarity;
        self
    }
}

/// What a nameless variant is drawn over.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Drawn {
    pub(super) over: String,
    /// What multiplies the curve.
    pub(super) times: &'static str,
    /// Bumps, fine bumps, levels or waves.
    pub(super) shape: &'static str,
}

/// Whose variant it is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Owner {
    /// A kind of the catalogue or a user's hypothesis.
    Named(Family),
    /// A curve without a name.
    Nameless(Drawn),
}

/// One variant: columns with relative prior deviations.
#[derive(Debug, Clone)]
pub(super) struct Variant {
    pub(super) owner: Owner,
    /// What tells it from the others of its kind.
    pub(super) label: String,
    /// Its columns in the bank.
    pub(super) columns: Range<usize>,
    /// Prior deviation of each, relative to the size of the variant.
    pub(super) relative: Vec<f64>,
    /// Natural logarithm of its prior, its share within the family apart.
    pub(super) ln_prior: f64,
    /// Largest size, in deviations of the output.
    pub(super) largest: f64,
    /// A step that begins at this run, or at this row.
    pub(super) since: Option<Since>,
    /// How many of its first columns are the law itself; the others are states of an edge or a lot.
    pub(super) law: usize,
    /// Columns that act in rows held out only, each with its relative deviation: hidden states of those rows, which may
    /// be followed from earlier ones (`recursive_least_squares.rs`).
    pub(super) followed: Vec<(Vec<f64>, f64)>,
}

/// Where a step begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Since {
    Run(usize),
    Row(usize),
}

impl Variant {
    /// The kind; `None` of a nameless curve.
    pub(super) fn kind(&self) -> Option<&str> {
        match &self.owner {
            Owner::Named(family) => Some(&family.kind),
            Owner::Nameless(_) => None,
        }
    }

    /// Its family; `None` of a nameless curve.
    pub(super) fn family(&self) -> Option<&Family> {
        match &self.owner {
            Owner::Named(family) => Some(family),
            Owner::Nameless(_) => None,
        }
    }

    /// Sign of its contribution; zero for any.
    pub(super) fn sign(&self) -> f64 {
        match &self.owner {
            Owner::Named(family) => family.sign,
            Owner::Nameless(_) => 0.0,
        }
    }

    /// Is it nothing but a level in each direction, which many laws contain?
    pub(super) fn is_contained_law(&self) -> bool {
        matches!(&self.owner, Owner::Named(family) if family.is_contained)
    }

    /// Does it act where the inputs jump?
    pub(super) fn acts_at_edges(&self) -> bool {
        matches!(&self.owner, Owner::Named(family) if family.at_edges)
    }

    /// What a nameless curve is drawn over.
    pub(super) fn nameless_curve(&self) -> Option<&Drawn> {
        match &self.owner {
            Owner::Named(_) => None,
            Owner::Nameless(drawn) => Some(drawn),
        }
    }

    /// Columns of the law itself.
    pub(super) fn law_columns(&self) -> Range<usize> {
        self.columns.start..self.columns.end.min(self.columns.start.saturating_add(self.law))
    }

    /// Would both together say the same twice: one kind, or a named and a nameless one over the same channel?
    pub(super) fn is_redundant_with(&self, other: &Self) -> bool {
        match (&self.owner, &other.owner) {
            (Owner::Named(a), Owner::Named(b)) => a.kind == b.kind,
            (Owner::Named(a), Owner::Nameless(b)) | (Owner::Nameless(b), Owner::Named(a)) => {
                a.channels.contains(&b.over.as_str())
            }
            (Owner::Nameless(a), Owner::Nameless(b)) => a.over == b.over,
        }
    }
}

/// Every variant, and the columns of all of them.
#[derive(Default)]
pub(super) struct VariantBank {
    pub(super) variants: Vec<Variant>,
    pub(super) columns: Vec<Vec<f64>>,
}

/// A variant that is being made.
pub(super) struct Making<'b> {
    bank: &'b mut VariantBank,
    variant: Variant,
    /// Do columns keep the size they are given?
    sized: bool,
}

impl VariantBank {
    /// Begins a variant of a family.
    pub(super) fn begin_variant(&mut self, family: Family, label: impl ToString) -> Making<'_> {
        let ln_rarity = family.ln_rarity;
        self.begin_owned_variant(Owner::Named(family), label.to_string(), ln_rarity)
    }

    /// Begins a nameless curve.
    pub(super) fn begin_nameless_curve(&mut self, drawn: Drawn) -> Making<'_> {
        let label = format!("{} {} over {}", drawn.shape, drawn.times, drawn.over);
        self.begin_owned_variant(Owner::Nameless(drawn), label, 0.0)
    }

    fn begin_owned_variant(&mut self, owner: Owner, label: String, ln_prior: f64) -> Making<'_> {
        let columns = 0..0;
        let variant = Variant {
            owner,
            label,
            columns,
            relative: Vec::new(),
            ln_prior,
            largest: 9.0,
            since: None,
            law: usize::MAX,
            followed: Vec::new(),
        };
        Making { bank: self, variant, sized: false }
    }

    /// How many variants the kind of each has.
    pub(super) fn count_kind_variants(&self) -> Vec<f64> {
        let of_kind = |kind: &str| self.variants.iter().filter(|v| v.kind() == Some(kind)).count();
        let share = |v: &Variant| v.kind().map_or(1.0, |kind| numerics::statistics::count_to_f64(of_kind(kind)));
        self.variants.iter().map(share).collect()
    }

    /// The columns of a variant times these coefficients, row by row.
    pub(super) fn compute_contribution(&self, variant: &Variant, coefficients: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.columns.first().map_or(0, Vec::len)];
        for (column, factor) in self.columns[variant.columns.clone()].iter().zip(coefficients) {
            sum.iter_mut().zip(column).for_each(|(sum, x)| *sum += factor * x);
        }
        sum
    }
}

impl Making<'_> {
    /// Less or more likely than its family says.
    pub(super) fn with_ln_prior(mut self, ln: f64) -> Self {
        self.variant.ln_prior += ln;
        self
    }

    /// No larger than so many deviations of the output.
    pub(super) fn with_largest_size(mut self, largest: f64) -> Self {
        self.variant.largest = largest;
        self
    }

    /// It is a step that begins here.
    pub(super) fn with_onset(mut self, since: Since) -> Self {
        self.variant.since = Some(since);
        self
    }

    /// So many of its first columns are the law itself; the others are states of an edge or a lot.
    pub(super) fn with_law_columns(mut self, columns: usize) -> Self {
        self.variant.law = columns;
        self
    }

    /// Its columns keep the size they are given.
    pub(super) fn with_given_size(mut self) -> Self {
        self.sized = true;
        self
    }

    /// Adds the variant with these columns and relative deviations; columns that never act are left out, and with the
    /// first of them the whole variant.
    pub(super) fn add_columns(self, inputs: &RecordingInputs<'_>, columns: impl IntoIterator<Item = (Vec<f64>, f64)>) {
        let Self { bank, mut variant, sized } = self;
        let start = bank.columns.len();
        for (index, (mut column, relative)) in columns.into_iter().enumerate() {
            let size = |held_out: bool| match (sized, held_out) {
                (true, false) => find_largest_value(&column, inputs.fitted_rows(false)).map(|_| 1.0),
                (true, true) => find_largest_value(&column, inputs.held_out_rows()).map(|_| 1.0),
                (false, false) => compute_acting_rms(&column, || inputs.fitted_rows(false)),
                (false, true) => compute_acting_rms(&column, || inputs.held_out_rows()),
            };
            match size(false) {
                Some(scale) => {
                    column.iter_mut().for_each(|x| *x /= scale);
                    bank.columns.push(column);
                    variant.relative.push(relative);
                }
                None if index == 0 => return,
                None => {
                    if let Some(scale) = size(true) {
                        column.iter_mut().for_each(|x| *x /= scale);
                        variant.followed.push((column, relative));
                    }
                }
            }
        }
        variant.columns = start..bank.columns.len();
        if !variant.columns.is_empty() {
            bank.variants.push(variant);
        }
    }

    /// The same of one column.
    pub(super) fn add_column(self, inputs: &RecordingInputs<'_>, column: Vec<f64>) {
        self.add_columns(inputs, [(column, 1.0)]);
    }
}

/// The largest value of a column in some rows; `None` where it never acts there, or next to nothing beside what it does in
/// others: a law that was seen at a thousandth of its size says nothing of its whole size.
fn find_largest_value(column: &[f64], rows: impl Iterator<Item = usize>) -> Option<f64> {
    let finite = column.iter().all(|x| x.is_finite());
    let whole = column.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let largest = rows.map(|row| column[row].abs()).fold(0.0, f64::max);
    (finite && largest > SEEN * whole).then_some(largest)
}

/// Root mean square over the rows where a column acts: so that the prior deviation means the size there.
fn compute_acting_rms<R: Iterator<Item = usize>>(column: &[f64], rows: impl Fn() -> R) -> Option<f64> {
    let largest = find_largest_value(column, rows())?;
    let acting: Vec<f64> = rows().map(|row| column[row]).filter(|x| x.abs() > ACTING * largest).collect();
    Some(numerics::statistics::rms(&acting).max(f64::MIN_POSITIVE))
}
