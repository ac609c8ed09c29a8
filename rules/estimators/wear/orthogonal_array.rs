//! Orthogonal arrays, constructed and not copied: L4, L8, L12, L16, L9, L18, L27.
//!
//! In an orthogonal array of strength two every pair of columns holds every pair of levels equally often, so that the
//! main effects of the factors in its columns are estimated independently of each other.
//!
//! Constructions: L4, L8, L16 and L9, L27 are the linear codes over GF(2) and GF(3) whose columns are the points of the
//! projective space (Rao 1947; Bose, Bush 1952), in the order in which Taguchi's tables list them; L12 is the cyclic
//! array of Plackett and Burman (1946); L18 develops the 6 by 6 difference matrix over Z3 and adds its two columns.

use std::fmt;

/// The arrays that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Array {
    /// 4 runs, 3 columns of 2 levels.
    L4,
    /// 8 runs, 7 columns of 2 levels.
    L8,
    /// 9 runs, 4 columns of 3 levels.
    L9,
    /// 12 runs, 11 columns of 2 levels; interactions are spread over the columns.
    L12,
    /// 16 runs, 15 columns of 2 levels.
    L16,
    /// 18 runs, 1 column of 2 levels and 7 of 3.
    L18,
    /// 27 runs, 13 columns of 3 levels: L27(3^13).
    L27,
}

/// Six rows of Z3 whose pairwise differences hold every element twice.
const DIFFERENCES: [[u8; 6]; 6] = [
    [0, 0, 0, 0, 0, 0],
    [0, 0, 1, 1, 2, 2],
    [0, 1, 0, 2, 1, 2],
    [0, 2, 2, 1, 1, 0],
    [0, 1, 2, 0, 2, 1],
    [0, 2, 1, 2, 0, 1],
];

/// First row of the Plackett-Burman array of twelve runs; quadratic residues modulo 11.
const PLACKETT_BURMAN: [u8; 11] = [1, 1, 0, 1, 1, 1, 0, 0, 0, 1, 0];

impl Array {
    /// Every array, from the smallest.
    pub const ALL: [Self; 7] = [Self::L4, Self::L8, Self::L9, Self::L12, Self::L16, Self::L18, Self::L27];

    /// The usual name, as `L27` for 27 runs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::L4 => "L4",
            Self::L8 => "L8",
            Self::L9 => "L9",
            Self::L12 => "L12",
            Self::L16 => "L16",
            Self::L18 => "L18",
            Self::L27 => "L27",
        }
    }

    /// The array of this name, also written as `l27` or `L27(3^13)`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let name = name.split('(').next().unwrap_or(name).trim();
        Self::ALL.into_iter().find(|array| array.name().eq_ignore_ascii_case(name))
    }

    /// The levels, 0-based: one inner list per run, one entry per column.
    #[must_use]
    pub fn list_runs(self) -> Vec<Vec<u8>> {
        match self {
            Self::L4 => build_linear_array(2, 2),
            Self::L8 => build_linear_array(2, 3),
            Self::L16 => build_linear_array(2, 4),
            Self::L9 => build_linear_array(3, 2),
            Self::L27 => build_linear_array(3, 3),
            Self::L12 => plackett_burman(),
            Self::L18 => develop_differences(),
        }
    }

    /// How many levels each column has.
    #[must_use]
    pub fn column_levels(self) -> Vec<u8> {
        match self {
            Self::L4 => vec![2; 3],
            Self::L8 => vec![2; 7],
            Self::L16 => vec![2; 15],
            Self::L12 => vec![2; 11],
            Self::L9 => vec![3; 4],
            Self::L27 => vec![3; 13],
            Self::L18 => [vec![2], vec![3; 7]].concat(),
        }
    }
}

impl fmt::Display for Array {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The linear array over GF(`prime`) with `prime^digits` runs: a run is a point, a column a direction, an entry their
/// scalar product.
fn build_linear_array(prime: u8, digits: usize) -> Vec<Vec<u8>> {
    let directions = list_directions(prime, digits);
    let entry = |point: &[u8], direction: &[u8]| point.iter().zip(direction).map(|(a, b)| a * b).sum::<u8>() % prime;
    list_points(prime, digits).iter().map(|point| directions.iter().map(|it| entry(point, it)).collect()).collect()
}

/// Every point, the first digit slowest.
fn list_points(prime: u8, digits: usize) -> Vec<Vec<u8>> {
    let mut points = vec![Vec::new()];
    for _ in 0..digits {
        points = points
            .iter()
            .flat_map(|point: &Vec<u8>| (0..prime).map(move |digit| [point.as_slice(), &[digit]].concat()))
            .collect();
    }
    points
}

/// Columns of L27 in the order of Taguchi's table: a, b, ab, ab2, c, ac, ac2, bc, abc, ab2c2, bc2, ab2c, abc2.
const DIRECTIONS_27: [[u8; 3]; 13] = [
    [1, 0, 0],
    [0, 1, 0],
    [1, 1, 0],
    [1, 2, 0],
    [0, 0, 1],
    [1, 0, 1],
    [1, 0, 2],
    [0, 1, 1],
    [1, 1, 1],
    [1, 2, 2],
    [0, 1, 2],
    [1, 2, 1],
    [1, 1, 2],
];

/// One direction of each line through the origin, in the order of Taguchi's tables: a new basic column, then its sums
/// with every column before it.
fn list_directions(prime: u8, digits: usize) -> Vec<Vec<u8>> {
    if (prime, digits) == (3, 3) {
        return DIRECTIONS_27.map(|direction| direction.to_vec()).to_vec();
    }
    let mut directions: Vec<Vec<u8>> = Vec::new();
    for digit in 0..digits {
        let mut basic = vec![0; digits];
        basic[digit] = 1;
        let before = directions.clone();
        directions.push(basic.clone());
        for old in &before {
            for factor in 1..prime {
                directions.push(old.iter().zip(&basic).map(|(a, b)| (a + factor * b) % prime).collect());
            }
        }
    }
    directions
}

fn plackett_burman() -> Vec<Vec<u8>> {
    let shifted = |by: usize| (0..11).map(|column| PLACKETT_BURMAN[(column + 11 - by) % 11]).collect();
    (0..11).map(shifted).chain([vec![0; 11]]).collect()
}

fn develop_differences() -> Vec<Vec<u8>> {
    let run = |row: usize, shift: u8| {
        let two = u8::from(row >= 3);
        #[expect(clippy::cast_possible_truncation, reason = "a remainder of three")]
        let three = (row % 3) as u8;
        let rest = DIFFERENCES[row].map(|entry| (entry + shift) % 3);
        [&[two, three][..], &rest].concat()
    };
    (0..6).flat_map(|row| (0..3).map(move |shift| run(row, shift))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn every_pair_of_columns_holds_every_pair_of_levels_equally_often() {
        for array in Array::ALL {
            let (runs, levels) = (array.list_runs(), array.column_levels());
            assert!(runs.iter().all(|run| run.len() == levels.len()), "{array}");
            assert_eq!(format!("L{}", runs.len()), array.name());
            for a in 0..levels.len() {
                for b in a + 1..levels.len() {
                    let mut counts: BTreeMap<(u8, u8), usize> = BTreeMap::new();
                    runs.iter().for_each(|run| *counts.entry((run[a], run[b])).or_default() += 1);
                    let pairs = usize::from(levels[a]) * usize::from(levels[b]);
                    assert_eq!(counts.len(), pairs, "{array}: columns {a} and {b}");
                    assert!(counts.values().all(|count| count * pairs == runs.len()), "{array}: columns {a} and {b}");
                    assert!(counts.keys().all(|(x, y)| *x < levels[a] && *y < levels[b]));
                }
            }
        }
    }

    #[test]
    fn no_run_is_there_twice() {
        for array in Array::ALL {
            let mut runs = array.list_runs();
            let count = runs.len();
            runs.sort();
            runs.dedup();
            assert_eq!(runs.len(), count, "{array}");
        }
    }

    #[test]
    fn the_basic_columns_of_l27_are_the_first_second_and_fifth() {
        let runs = Array::L27.list_runs();
        for (index, run) in runs.iter().enumerate() {
            assert_eq!([run[0], run[1], run[4]].map(usize::from), [index / 9, index / 3 % 3, index % 3]);
        }
    }

    #[test]
    fn names_are_understood() {
        assert_eq!(Array::from_name("l27(3^13)"), Some(Array::L27));
        assert_eq!(Array::from_name("L10"), None);
    }
}
