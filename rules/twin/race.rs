//! Which sequence of on and off is the likeliest, and how likely each is by now: Viterbi's race and the forward recursion
//! over state and age of a spell, in which every survivor carries its own innovation.

use super::latent::Switching;
use super::rhythm::Rhythm;

/// One row as it looks with the consumer off and on, and what it weighs.
pub(super) struct Seen {
    pub(super) x: [f64; 2],
    pub(super) weight: f64,
}

/// A sequence that is still in the race.
#[derive(Debug, Clone, Copy)]
struct Lane {
    cost: f64,
    e: f64,
}

impl Lane {
    const NONE: Self = Self { cost: f64::INFINITY, e: 0.0 };
}

/// The cheapest sequences up to a row, by state and age, and what going on costs.
pub(super) struct Race<'a> {
    found: &'a Switching,
    stay: [Vec<f64>; 2],
    turn: [Vec<f64>; 2],
    lanes: [Vec<Lane>; 2],
    last: [f64; 2],
}

impl<'a> Race<'a> {
    pub(super) fn begin(rhythm: &Rhythm, found: &'a Switching, value: f64, weight: f64) -> Self {
        let price = |chance: f64| -2.0 * chance.ln();
        let last = found.levels(value);
        let lanes = [0, 1].map(|on| {
            let first = found.surprise(last[on] * found.noise.first_weight(), weight);
            rhythm.begins[on].iter().map(|begins| Lane { cost: price(*begins) + first, e: 0.0 }).collect()
        });
        let stay = [0, 1].map(|on| rhythm.ends[on].iter().map(|end| price(1.0 - end)).collect());
        let turn = [0, 1].map(|on| rhythm.ends[on].iter().map(|end| price(*end)).collect());
        Self { found, stay, turn, lanes, last }
    }

    /// Goes on by a row; says where each came from.
    pub(super) fn step(&mut self, value: f64, weight: f64) -> [Came; 2] {
        let x = self.found.levels(value);
        let ages = self.lanes[0].len();
        let mut next = [vec![Lane::NONE; ages], vec![Lane::NONE; ages]];
        let mut came = [Came::default(); 2];
        for on in [0, 1] {
            for (age, lane) in self.lanes[on].iter().enumerate() {
                let to = |to: usize, price: f64| {
                    let e = self.found.noise.innovation(x[to], self.last[on], lane.e);
                    Lane { cost: lane.cost + price + self.found.surprise(e, weight), e }
                };
                let (stays, older) = (to(on, self.stay[on][age]), (age + 1).min(ages - 1));
                if stays.cost < next[on][older].cost {
                    next[on][older] = stays;
                    came[on].note(older, ages, (on, age));
                }
                let (turns, other) = (to(1 - on, self.turn[on][age]), 1 - on);
                if turns.cost < next[other][0].cost {
                    next[other][0] = turns;
                    came[other].note(0, ages, (on, age));
                }
            }
        }
        (self.lanes, self.last) = (next, x);
        came
    }

    /// State and age at the end of the cheapest.
    pub(super) fn winner(&self) -> (usize, usize) {
        let ends = self.lanes.iter().enumerate();
        let ends = ends.flat_map(|(on, lanes)| lanes.iter().enumerate().map(move |(age, lane)| (lane.cost, (on, age))));
        ends.min_by(|a, b| a.0.total_cmp(&b.0)).map_or((0, 0), |(_, at)| at)
    }
}

/// Where the youngest and the oldest spell of a state came from; any other is a row older than it was.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Came {
    first: (usize, usize),
    oldest: (usize, usize),
}

impl Came {
    fn note(&mut self, age: usize, ages: usize, from: (usize, usize)) {
        if age == 0 {
            self.first = from;
        } else if age + 1 == ages {
            self.oldest = from;
        }
    }

    pub(super) fn from(self, at: (usize, usize), ages: usize) -> (usize, usize) {
        match at.1 {
            0 => self.first,
            age if age + 1 == ages => self.oldest,
            age => (at.0, age - 1),
        }
    }
}

/// What is believed of state and age before a row is seen: chances that add up to one, each with its innovation, which is
/// the mean of those that meet there.
pub(super) struct Belief<'a> {
    rhythm: &'a Rhythm,
    found: &'a Switching,
    lanes: [Vec<(f64, f64)>; 2],
    last: Option<[f64; 2]>,
}

impl<'a> Belief<'a> {
    pub(super) fn begin(rhythm: &'a Rhythm, found: &'a Switching) -> Self {
        let lanes = [0, 1].map(|on| rhythm.begins[on].iter().map(|p| (*p, 0.0)).collect());
        Self { rhythm, found, lanes, last: None }
    }

    /// The chance that it is on in a row before that row is seen, and the logarithm of how likely the row was.
    pub(super) fn step(&mut self, row: &Seen) -> (f64, f64) {
        let ages = self.lanes[0].len();
        let mut next = [vec![(0.0, 0.0); ages], vec![(0.0, 0.0); ages]];
        let mut expected = [0.0; 2];
        for on in [0, 1] {
            for (age, (p, e)) in self.lanes[on].iter().enumerate() {
                for (to, age, p) in self.ways(on, age, *p).into_iter().filter(|(.., p)| *p > 0.0) {
                    let (now, carried) = self.innovation(row, on, to, *e);
                    let likely = p * (-0.5 * self.found.surprise(now, row.weight)).exp();
                    expected[to] += p;
                    next[to][age].0 += likely;
                    next[to][age].1 += likely * carried;
                }
            }
        }
        let all: f64 = next.iter().flatten().map(|(p, _)| p).sum();
        for (p, e) in next.iter_mut().flatten() {
            *e /= p.max(f64::MIN_POSITIVE);
            *p /= all.max(f64::MIN_POSITIVE);
        }
        (self.lanes, self.last) = (next, Some(row.x));
        let on = expected[1] / (expected[0] + expected[1]).max(f64::MIN_POSITIVE);
        (on, all.max(f64::MIN_POSITIVE).ln())
    }

    /// Where a spell goes from here, each with its chance: it lasts, or ends. Before the first row it goes nowhere.
    fn ways(&self, on: usize, age: usize, p: f64) -> [(usize, usize, f64); 2] {
        if self.last.is_none() {
            return [(on, age, p), (1 - on, 0, 0.0)];
        }
        let (end, oldest) = (self.rhythm.ends[on][age], self.lanes[on].len() - 1);
        [(on, (age + 1).min(oldest), p * (1.0 - end)), (1 - on, 0, p * end)]
    }

    /// The innovation of a row, and what is carried on of it.
    fn innovation(&self, row: &Seen, from: usize, to: usize, e: f64) -> (f64, f64) {
        let noise = self.found.noise;
        match self.last {
            None => (row.x[to] * noise.first_weight(), 0.0),
            Some(last) => {
                let e = noise.innovation(row.x[to], last[from], e);
                (e, e)
            }
        }
    }
}
