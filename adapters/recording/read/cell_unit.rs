//! Units that stand in the cells themselves: `0.471 kW` and `295.2 W` in one column, as meters with ranges write them.

use super::survey::ColumnSurvey;
use adapter_core::channel::unit::Unit;

/// One unit that stands behind numbers of a column: `factor * x + offset` is in the unit of the column.
#[derive(Debug, Clone, PartialEq)]
struct CellUnit {
    suffix: String,
    factor: f64,
    offset: f64,
}

/// What turns the cells of a column into its unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellUnits {
    known: Vec<CellUnit>,
    /// A cell without a unit is in that of the column. Where the others differ among themselves, nobody knows what it is in.
    takes_plain: bool,
}

/// The unit of the cells, where the name says none: of all that stand there the commonest.
pub(super) fn find_unit_of_cells(survey: &ColumnSurvey) -> Option<String> {
    let known = survey.suffixes.iter().filter(|(suffix, _)| Unit::from_symbol(suffix).is_some());
    known.max_by_key(|(suffix, count)| (**count, std::cmp::Reverse(*suffix))).map(|(suffix, _)| suffix.clone())
}

/// For a column in this unit; `None` where no cell has anything behind its number.
pub(super) fn plan_cell_units(survey: &ColumnSurvey, unit: Option<&str>) -> Option<CellUnits> {
    if survey.suffixed == 0 {
        return None;
    }
    let base = unit.and_then(Unit::from_symbol);
    let convert = |suffix: &str| match (base, Unit::from_symbol(suffix)) {
        (Some(base), Some(own)) => own.compute_conversion(base),
        // Behind every number the same word that is no unit: it says what is counted.
        (_, None) => (survey.suffixed == survey.count_numbers() && survey.suffixes.len() == 1).then_some((1.0, 0.0)),
        (None, Some(_)) => (survey.suffixes.len() == 1).then_some((1.0, 0.0)),
    };
    let known: Vec<CellUnit> = survey
        .suffixes
        .keys()
        .filter_map(|suffix| {
            convert(suffix).map(|(factor, offset)| CellUnit { suffix: suffix.clone(), factor, offset })
        })
        .collect();
    let key = |unit: &CellUnit| (unit.factor.to_bits(), unit.offset.to_bits());
    let alike = known.windows(2).all(|pair| key(&pair[0]) == key(&pair[1]));
    Some(CellUnits { takes_plain: alike, known })
}

impl CellUnits {
    /// A number with what stands behind it, in the unit of the column; `None` where that is not known.
    pub(super) fn convert_number(&self, number: f64, suffix: &str) -> Option<f64> {
        if suffix.is_empty() {
            return self.takes_plain.then_some(number);
        }
        let unit = self.known.iter().find(|unit| unit.suffix == suffix)?;
        Some(number * unit.factor + unit.offset)
    }

    /// More than one unit stands in the column.
    pub(super) fn has_several(&self) -> bool {
        self.known.len() > 1
    }

    /// The units, as written.
    pub(super) fn list_units(&self) -> String {
        self.known.iter().map(|unit| unit.suffix.as_str()).collect::<Vec<_>>().join(", ")
    }
}
