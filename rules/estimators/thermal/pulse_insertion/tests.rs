//! What comes out is decoded as a controller would: the count, every transition and every spacing.

use super::*;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

const SPACING_NS: u64 = 250;

/// A controller that trusts nothing: decodes, and keeps the least time between two edges.
#[derive(Default)]
struct Controller {
    decoder: Decoder,
    last_ns: Option<u64>,
    closest_ns: Option<u64>,
    illegal: u64,
    still: u64,
    edges: u64,
}

impl Controller {
    fn see(&mut self, edge: SignalEdge) {
        match self.decoder.decode_lines(edge.lines, edge.at_ns) {
            Ok(0) => self.still += 1,
            Ok(_) => {}
            Err(_) => self.illegal += 1,
        }
        if let Some(last) = self.last_ns {
            let gap = edge.at_ns.checked_sub(last).expect("edges leave in the order of time");
            self.closest_ns = Some(self.closest_ns.map_or(gap, |closest| closest.min(gap)));
        }
        self.last_ns = Some(edge.at_ns);
        self.edges += 1;
    }
}

struct Bed {
    device: PulseInserter,
    controller: Controller,
    at_ns: u64,
    position: i64,
    asked: i64,
}

impl Bed {
    fn new() -> Self {
        let device = PulseInserter::new(Lines::LOW, 0, SPACING_NS);
        Self { device, controller: Controller::default(), at_ns: 0, position: 0, asked: 0 }
    }

    fn after(&mut self, pause_ns: u64, step: i64) {
        self.at_ns += pause_ns;
        self.position += step;
        let lines = Lines::from_position(self.position);
        let before = (self.device.encoder.lines(), self.device.inserted_pulses());
        self.device.advance_to(self.at_ns, lines, |edge| self.controller.see(edge)).expect("slow enough");
        if !before.0.is_low() && !lines.is_low() {
            assert_eq!(before.1, self.device.inserted_pulses(), "a pulse was begun while a line was high");
        }
    }

    fn request(&mut self, pulses: i64) {
        self.asked += pulses;
        self.device.request_pulses(pulses);
    }

    fn settle(&mut self) {
        self.device.set_bypass(false);
        while !self.device.encoder.lines().is_low() {
            self.after(10 * SPACING_NS, 1);
        }
        self.after(1_000_000_000, 0);
    }

    /// The decoded position is the true one and what was inserted; no transition was illegal, no two edges too close.
    fn check(&self) {
        let inserted = self.device.inserted_pulses();
        assert_eq!(self.controller.decoder.position_edges(), self.position + EDGES_PER_PULSE * inserted);
        assert_eq!((self.controller.illegal, self.controller.still), (0, 0));
        assert!(self.controller.closest_ns.is_none_or(|closest| closest >= SPACING_NS));
    }
}

/// `steps` random encoder edges with reversals, stalls and bursts, and random compensation.
fn campaign(steps: u64, seed: u64) -> Bed {
    let mut bed = Bed::new();
    let mut random = Pcg64::seed_from_u64(seed);
    let mut direction = 1;
    for _ in 0..steps {
        if random.random_bool(0.02) {
            direction = -direction;
        }
        if random.random_bool(0.01) {
            bed.request(random.random_range(-3..=3));
        }
        if random.random_bool(0.001) {
            let on = random.random_bool(0.5);
            bed.device.set_bypass(on);
        }
        // On average four times slower than the least spacing; one edge in eight comes closer than may leave.
        let pause_ns = match random.random_range(0..8) {
            0 => random.random_range(1..SPACING_NS),
            7 if random.random_bool(0.01) => random.random_range(1..100 * SPACING_NS),
            _ => random.random_range(SPACING_NS..8 * SPACING_NS),
        };
        bed.after(pause_ns, direction);
    }
    bed.settle();
    bed
}

fn tell(name: &str, bed: &Bed) {
    println!(
        "{name}: decoded {} = true {} + 4 x {} inserted; {} edges out, closest {} ns of {SPACING_NS}, illegal {}",
        bed.controller.decoder.position_edges(),
        bed.position,
        bed.device.inserted_pulses(),
        bed.controller.edges,
        bed.controller.closest_ns.unwrap_or(0),
        bed.controller.illegal
    );
}

#[test]
fn ten_million_random_steps_with_reversals_are_counted_right() {
    let bed = campaign(10_000_000, 2013);
    tell("10^7 steps", &bed);
    bed.check();
    assert_eq!(bed.device.inserted_pulses(), bed.asked, "everything that was asked for was inserted");
    assert_eq!((bed.device.waiting_edges(), bed.device.requested_pulses()), (0, 0));
    assert!(bed.asked != 0 && bed.controller.closest_ns == Some(SPACING_NS), "the spacing was put to use");
}

#[test]
fn an_axis_at_rest_with_low_lines_takes_a_pulse_as_four_edges() {
    let mut bed = Bed::new();
    bed.request(1);
    bed.after(10_000, 0);
    assert_eq!((bed.controller.edges, bed.controller.decoder.position_edges()), (4, 4));
    bed.request(-2);
    bed.after(10_000, 0);
    assert_eq!((bed.controller.edges, bed.controller.decoder.position_edges()), (12, -4));
    bed.check();
}

#[test]
fn nothing_is_inserted_while_a_line_is_high_or_in_bypass() {
    let mut bed = Bed::new();
    bed.after(1000, 1);
    bed.request(2);
    bed.after(1_000_000, 0);
    assert_eq!((bed.device.inserted_pulses(), bed.device.requested_pulses()), (0, 2));
    bed.device.set_bypass(true);
    bed.after(1000, -1);
    bed.after(1_000_000, 0);
    assert_eq!((bed.device.inserted_pulses(), bed.device.lines()), (0, Lines::LOW));
    bed.device.set_bypass(false);
    bed.after(1_000_000, 0);
    assert_eq!(bed.device.inserted_pulses(), 2);
    bed.check();
}

#[test]
fn faults_are_said_not_counted_on() {
    let mut bed = Bed::new();
    let fault = bed.device.advance_to(10, Lines::from_position(2), |_| {});
    assert!(matches!(fault, Err(InsertionFault::Encoder(_))), "{fault:?}");
    assert!(matches!(bed.device.advance_to(5, Lines::LOW, |_| {}), Err(InsertionFault::TimeWentBack { .. })));
    let mut fast = PulseInserter::new(Lines::LOW, 0, SPACING_NS);
    let fault = (1..1000).find_map(|step| fast.advance_to(step * 10, Lines::from_position(step as i64), |_| {}).err());
    let Some(fault @ InsertionFault::TooFast { .. }) = fault else { panic!("{fault:?}") };
    assert!(fault.to_string().contains("too fast for edges 250 ns apart"), "{fault}");
}

proptest! {
    #[test]
    fn any_course_of_steps_and_requests_adds_up(
        course in proptest::collection::vec((-1_i64..=1, 1_u64..4000, -2_i64..=2, any::<bool>()), 1..200)
    ) {
        let mut bed = Bed::new();
        for (step, pause_ns, pulses, bypass) in course {
            bed.request(pulses);
            bed.device.set_bypass(bypass);
            bed.after(pause_ns.max(if step == 0 { 1 } else { SPACING_NS / 2 }), step);
        }
        bed.settle();
        bed.check();
        prop_assert_eq!(bed.device.inserted_pulses(), bed.asked);
    }
}
