//! Which sequence of on and off is the likeliest, and how likely each is by now: Viterbi's race and the forward recursion
//! over state and age of a spell, in which every survivor carries its own innovation.

use super::latent::Switching;
use super::path_state::{Cheapest, Mixture};
use super::rhythm::Rhythm;

/// One row as it looks with the consumer off and on, and what it weighs.
pub(super) struct Seen {
    pub(super) x: [f64; 2],
    pub(super) weight: f64,
}

/// What belongs to every state (off, on) and age of a spell, and what each way on from there weighs.
struct Lanes<T> {
    now: [Vec<T>; 2],
    next: [Vec<T>; 2],
    stay: [Vec<f64>; 2],
    turn: [Vec<f64>; 2],
}

/// From a state and an age to those of the next row.
struct StateTransition {
    from: (usize, usize),
    to: (usize, usize),
    weight: f64,
}

impl<T: Copy> Lanes<T> {
    /// With what a state carries that begins with a chance, and with the weight of a chance to go on.
    fn begin(rhythm: &Rhythm, value: impl Fn(usize, f64) -> T, weight: impl Fn(f64) -> f64) -> Self {
        let now = [0, 1].map(|on| rhythm.begins[on].iter().map(|begins| value(on, *begins)).collect::<Vec<T>>());
        let stay = [0, 1].map(|on| rhythm.ends[on].iter().map(|end| weight(1.0 - end)).collect());
        let turn = [0, 1].map(|on| rhythm.ends[on].iter().map(|end| weight(*end)).collect());
        Self { next: now.clone(), now, stay, turn }
    }

    /// Goes on by a row: a spell lasts, and is a row older, or the other one begins. `meet` puts what comes along a way to
    /// what is there already, at first `none`.
    fn step(&mut self, none: T, mut meet: impl FnMut(&mut T, T, &StateTransition)) {
        let ages = self.now[0].len();
        self.next.iter_mut().for_each(|lanes| lanes.fill(none));
        for on in [0, 1] {
            for (age, lane) in self.now[on].iter().enumerate() {
                let older = (age + 1).min(ages - 1);
                for (to, weight) in [((on, older), self.stay[on][age]), ((1 - on, 0), self.turn[on][age])] {
                    meet(&mut self.next[to.0][to.1], *lane, &StateTransition { from: (on, age), to, weight });
                }
            }
        }
        std::mem::swap(&mut self.now, &mut self.next);
    }
}

/// The cheapest sequences up to a row, by state and age.
pub(super) struct Race<'a> {
    found: &'a Switching,
    lanes: Lanes<Cheapest>,
    last: [f64; 2],
}

impl<'a> Race<'a> {
    pub(super) fn begin(rhythm: &Rhythm, found: &'a Switching, value: f64, weight: f64) -> Self {
        let price = |chance: f64| -2.0 * chance.ln();
        let last = found.levels(value);
        let first = last.map(|x| found.surprise(x * found.noise.first_weight(), weight));
        let lanes = Lanes::begin(rhythm, |on, begins| Cheapest { cost: price(begins) + first[on], e: 0.0 }, price);
        Self { found, lanes, last }
    }

    /// Goes on by a row; says where each came from.
    pub(super) fn step(&mut self, value: f64, weight: f64) -> [Came; 2] {
        let (found, x, last) = (self.found, self.found.levels(value), self.last);
        let ages = self.lanes.now[0].len();
        let mut came = [Came::default(); 2];
        self.lanes.step(Cheapest::NONE, |there, lane, way| {
            let e = found.noise.innovation(x[way.to.0], last[way.from.0], lane.e);
            let cost = lane.cost + way.weight + found.surprise(e, weight);
            if there.take(cost, e) {
                came[way.to.0].note(way.to.1, ages, way.from);
            }
        });
        self.last = x;
        came
    }

    /// State and age at the end of the cheapest.
    pub(super) fn winner(&self) -> (usize, usize) {
        let ends = self.lanes.now.iter().enumerate();
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
    found: &'a Switching,
    lanes: Lanes<Mixture>,
    last: Option<[f64; 2]>,
}

impl<'a> Belief<'a> {
    pub(super) fn begin(rhythm: &Rhythm, found: &'a Switching) -> Self {
        let lanes = Lanes::begin(rhythm, |_, chance| Mixture { chance, e: 0.0 }, |chance| chance);
        Self { found, lanes, last: None }
    }

    /// The chance that it is on in a row before that row is seen, and the logarithm of how likely the row was.
    pub(super) fn step(&mut self, row: &Seen) -> (f64, f64) {
        let expected = match self.last {
            None => self.see_first(row),
            Some(last) => self.see(row, last),
        };
        self.last = Some(row.x);
        let all: f64 = self.lanes.now.iter().flatten().map(|lane| lane.chance).sum();
        self.lanes.now.iter_mut().flatten().for_each(|lane| lane.settle(all));
        let on = expected[1] / (expected[0] + expected[1]).max(f64::MIN_POSITIVE);
        (on, all.max(f64::MIN_POSITIVE).ln())
    }

    /// Chances of off and on before the first row of a stretch.
    fn see_first(&mut self, row: &Seen) -> [f64; 2] {
        let expected = [0, 1].map(|on| self.lanes.now[on].iter().map(|lane| lane.chance).sum());
        let first = row.x.map(|x| self.found.surprise(x * self.found.noise.first_weight(), row.weight));
        for on in [0, 1] {
            self.lanes.now[on].iter_mut().for_each(|lane| lane.chance *= (-0.5 * first[on]).exp());
        }
        expected
    }

    /// Chances of off and on before a row with another before it.
    fn see(&mut self, row: &Seen, last: [f64; 2]) -> [f64; 2] {
        let found = self.found;
        let mut expected = [0.0; 2];
        self.lanes.step(Mixture::default(), |there, lane, way| {
            let chance = lane.chance * way.weight;
            let e = found.noise.innovation(row.x[way.to.0], last[way.from.0], lane.e);
            expected[way.to.0] += chance;
            there.take(chance * (-0.5 * found.surprise(e, row.weight)).exp(), e);
        });
        expected
    }
}
