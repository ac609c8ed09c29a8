//! A design of experiments: which cuts to make so that a wear model can be fitted, as a work list in random order.

use super::conditions::{ConditionFactor, FACTORS, WEAR};
use super::orthogonal_array::Array;
use super::term::{WearTerm, second_order};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

/// Correlation of two terms from which on they count as aliased.
const ALIASED: f64 = 0.05;
/// Choices of columns that are compared; beyond it the first columns are taken.
const CHOICES_MAX: usize = 20_000;

/// The levels of one factor.
#[derive(Debug, Clone, PartialEq)]
pub struct FactorLevels {
    /// The condition that takes these levels.
    pub factor: &'static ConditionFactor,
    /// The values, in the unit of the factor, increasing.
    pub values: Vec<f64>,
}

/// One cut of the work list.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedCut {
    /// Row of the array, from 1.
    pub row: usize,
    /// Level of each factor, from 1.
    pub levels: Vec<usize>,
    /// Value of each factor, in its unit.
    pub values: Vec<f64>,
}

/// Two terms of the second-order model that this design cannot tell apart well.
#[derive(Debug, Clone, PartialEq)]
pub struct Alias {
    /// One term, in the symbols of the factors.
    pub one: String,
    /// The other term, in the same symbols.
    pub other: String,
    /// Correlation of the two over the runs, -1 to 1.
    pub correlation: f64,
}

/// The cuts to make for a wear model, and what they can tell apart.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentDesign {
    /// The orthogonal array behind the cuts.
    pub array: Array,
    /// The factors with their levels.
    pub factors: Vec<FactorLevels>,
    /// Column of the array for each factor, from 1; chosen for the least aliasing.
    pub columns: Vec<usize>,
    /// The cuts in the order in which to make them.
    pub cuts: Vec<PlannedCut>,
    /// Terms that cannot be told apart well, the worst first.
    pub aliases: Vec<Alias>,
    /// What to know before cutting.
    pub warnings: Vec<String>,
}

/// Plans the cuts; the order is random and the same for the same seed.
///
/// # Errors
/// Everything that is wrong with the factors, and what to give instead.
pub fn plan_experiment(array: Array, factors: &[FactorLevels], seed: u64) -> Result<ExperimentDesign, Vec<String>> {
    let problems = list_problems(array, factors);
    if !problems.is_empty() {
        return Err(problems);
    }
    let runs = array.list_runs();
    let columns = choose_columns(array, factors, &runs);
    let cut = |(row, run): (usize, &Vec<u8>)| {
        let levels: Vec<usize> = columns.iter().map(|column| usize::from(run[*column])).collect();
        let values = levels.iter().zip(factors).map(|(level, factor)| factor.values[*level]).collect();
        PlannedCut { row: row + 1, levels: levels.iter().map(|level| level + 1).collect(), values }
    };
    let mut cuts: Vec<PlannedCut> = runs.iter().enumerate().map(cut).collect();
    cuts.shuffle(&mut Pcg64Mcg::seed_from_u64(seed));
    let aliases = find_aliases(factors, &columns, &runs);
    let warnings = list_warnings(array, factors, &aliases);
    Ok(ExperimentDesign {
        array,
        factors: factors.to_vec(),
        columns: columns.iter().map(|column| column + 1).collect(),
        cuts,
        aliases,
        warnings,
    })
}

fn list_problems(array: Array, factors: &[FactorLevels]) -> Vec<String> {
    let mut problems = Vec::new();
    if factors.len() < 2 {
        problems.push("a design needs at least two factors: give --levels NAME=LOW,MIDDLE,HIGH for each".to_owned());
    }
    let mut free = array.column_levels();
    for FactorLevels { factor, values } in factors {
        let name = factor.name;
        problems
            .extend(values.iter().filter_map(|value| factor.find_problem(*value)).map(|problem| problem.to_string()));
        if values.windows(2).any(|pair| pair[1] <= pair[0]) {
            problems.push(format!("{name}: give the levels in increasing order, each once"));
        }
        match free.iter().position(|levels| usize::from(*levels) == values.len()) {
            Some(at) => drop(free.remove(at)),
            None => problems.push(format!(
                "{name}: {array} has no free column of {} levels; its columns have {}",
                values.len(),
                column_text(array)
            )),
        }
    }
    let repeated = factors.iter().enumerate().find(|(i, it)| factors[..*i].iter().any(|o| o.factor == it.factor));
    problems.extend(repeated.map(|(_, it)| format!("{} is given twice", it.factor.name)));
    problems
}

fn column_text(array: Array) -> String {
    let levels = array.column_levels();
    let count = |wanted: u8| levels.iter().filter(|it| **it == wanted).count();
    let part = |wanted: u8| (count(wanted) > 0).then(|| format!("{} times {wanted} levels", count(wanted)));
    [part(2), part(3)].into_iter().flatten().collect::<Vec<_>>().join(" and ")
}

/// The columns with the least aliasing: first of the single factors with anything else, then of the rest.
fn choose_columns(array: Array, factors: &[FactorLevels], runs: &[Vec<u8>]) -> Vec<usize> {
    let levels = array.column_levels();
    let mut choices = vec![Vec::new()];
    for factor in factors {
        let fits = |column: &usize| usize::from(levels[*column]) == factor.values.len();
        choices = choices
            .iter()
            .flat_map(|chosen: &Vec<usize>| {
                let after = chosen.iter().copied().filter(fits).max().map_or(0, |last| last + 1);
                (after..levels.len()).filter(fits).map(move |column| [chosen.as_slice(), &[column]].concat())
            })
            .take(CHOICES_MAX)
            .collect();
    }
    let score = |columns: &Vec<usize>| {
        let found = find_aliases(factors, columns, runs);
        let square = |single: bool| {
            let counted = found.iter().filter(|it| (single_factor(&it.one) || single_factor(&it.other)) == single);
            counted.map(|it| it.correlation * it.correlation).sum::<f64>()
        };
        (square(true), square(false))
    };
    let scored = choices.iter().map(|columns| (score(columns), columns));
    let better = |a: &(f64, f64), b: &(f64, f64)| {
        (a.0 - b.0).abs() > 1e-9 && a.0 < b.0 || (a.0 - b.0).abs() <= 1e-9 && a.1 < b.1 - 1e-9
    };
    let best = scored.reduce(|best, next| if better(&next.0, &best.0) { next } else { best });
    best.map(|(_, columns)| columns.clone()).unwrap_or_default()
}

fn single_factor(name: &str) -> bool {
    !name.contains(['*', '^'])
}

/// Correlated pairs of second-order terms, on levels coded from -1 to 1.
fn find_aliases(factors: &[FactorLevels], columns: &[usize], runs: &[Vec<u8>]) -> Vec<Alias> {
    let coded = |run: &Vec<u8>| -> Vec<f64> {
        columns
            .iter()
            .zip(factors)
            .map(|(c, it)| 2.0 * f64::from(run[*c]) / (it.values.len() - 1) as f64 - 1.0)
            .collect()
    };
    let points: Vec<Vec<f64>> = runs.iter().map(coded).collect();
    let curved = |term: &WearTerm| {
        let too_few = |(power, it): (&u8, &FactorLevels)| *power == 2 && it.values.len() < 3;
        !term.powers().iter().zip(factors).any(too_few)
    };
    let terms: Vec<WearTerm> = second_order(factors.len()).into_iter().skip(1).filter(curved).collect();
    let centred: Vec<Vec<f64>> =
        terms.iter().map(|term| centre_values(points.iter().map(|it| term.evaluate_at(it)).collect())).collect();
    let symbols: Vec<&str> = factors.iter().map(|it| it.factor.symbol).collect();
    let mut found = Vec::new();
    for a in 0..terms.len() {
        for b in a + 1..terms.len() {
            let correlation = correlate_columns(&centred[a], &centred[b]);
            if correlation.abs() > ALIASED {
                found.push(Alias {
                    one: terms[a].format_name(&symbols),
                    other: terms[b].format_name(&symbols),
                    correlation,
                });
            }
        }
    }
    found.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    found
}

fn centre_values(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

fn correlate_columns(a: &[f64], b: &[f64]) -> f64 {
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let size = (dot(a, a) * dot(b, b)).sqrt();
    if size > 0.0 { dot(a, b) / size } else { 0.0 }
}

fn list_warnings(array: Array, factors: &[FactorLevels], aliases: &[Alias]) -> Vec<String> {
    let mut warnings = Vec::new();
    let flat: Vec<&str> = factors.iter().filter(|it| it.values.len() < 3).map(|it| it.factor.symbol).collect();
    if !flat.is_empty() {
        warnings.push(format!("two levels of {} show no curvature in it", flat.join(", ")));
    }
    let (runs, terms) = (array.list_runs().len(), second_order(factors.len()).len() - flat.len());
    if runs <= terms {
        warnings.push(format!(
            "{runs} cuts cannot carry the {terms} terms of a second-order surface; only the strongest can be estimated: \
             take a larger array or fewer factors"
        ));
    }
    let worst = |alias: &Alias| {
        format!("{} and {} cannot be told apart well (correlation {:.2})", alias.one, alias.other, alias.correlation)
    };
    warnings.extend(aliases.iter().filter(|alias| alias.correlation.abs() > 0.2).map(worst));
    if factors.iter().any(|it| it.factor == &FACTORS[WEAR]) {
        warnings.push(
            "flank wear cannot be set: sort used edges under the microscope near the levels, and enter what was measured \
             before the cut and after it"
                .to_owned(),
        );
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn four() -> Vec<FactorLevels> {
        let levels = [vec![0.065, 0.195, 0.325], vec![90.0, 120.0, 150.0], vec![0.1, 0.15, 0.2], vec![0.5, 1.0, 1.5]];
        FACTORS.iter().zip(levels).map(|(factor, values)| FactorLevels { factor, values }).collect()
    }

    #[test]
    fn l27_keeps_single_factors_clear_of_everything() {
        let design = plan_experiment(Array::L27, &four(), 1).expect("a design");
        assert_eq!((design.cuts.len(), design.columns.len()), (27, 4));
        assert_eq!(design.columns[..3], [1, 2, 5], "the basic columns");
        assert!([9, 10, 12, 13].contains(&design.columns[3]), "{:?}", design.columns);
        let clear = |alias: &Alias| !single_factor(&alias.one) && !single_factor(&alias.other);
        assert!(design.aliases.iter().all(clear), "{:?}", design.aliases);
        let pairs: Vec<(&str, &str)> = design.aliases.iter().map(|it| (it.one.as_str(), it.other.as_str())).collect();
        for pair in [("VB*vc", "f*ap"), ("VB*f", "vc*ap"), ("VB*ap", "vc*f")] {
            assert!(pairs.contains(&pair), "{pair:?} in {pairs:?}");
        }
        assert!(design.aliases.iter().all(|alias| (0.2..=0.51).contains(&alias.correlation.abs())));
    }

    #[test]
    fn the_order_is_random_and_repeatable() {
        let order = |seed| {
            plan_experiment(Array::L27, &four(), seed)
                .expect("a design")
                .cuts
                .iter()
                .map(|it| it.row)
                .collect::<Vec<_>>()
        };
        assert_eq!(order(1), order(1));
        assert_ne!(order(1), order(2));
        assert_ne!(order(1), (1..=27).collect::<Vec<_>>());
        let mut sorted = order(1);
        sorted.sort_unstable();
        assert_eq!(sorted, (1..=27).collect::<Vec<_>>());
    }

    #[test]
    fn what_does_not_fit_the_array_is_told_at_once() {
        let mut factors = four();
        factors[0].values = vec![65.0, 195.0, 325.0];
        factors[1].values = vec![90.0, 150.0];
        let told = plan_experiment(Array::L9, &factors, 1).expect_err("refused").join("\n");
        for part in ["is it in um?", "L9 has no free column of 2 levels; its columns have 4 times 3 levels"] {
            assert!(told.contains(part), "{part}: {told}");
        }
        assert!(plan_experiment(Array::L9, &four(), 1).expect("a design").warnings[0].contains("15 terms"));
        factors[0].values = vec![0.1, 0.3];
        factors.truncate(2);
        assert!(plan_experiment(Array::L4, &factors, 1).expect("a design").warnings[0].contains("no curvature"));
    }
}
