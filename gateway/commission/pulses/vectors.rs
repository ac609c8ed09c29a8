//! Reference vectors: what goes into a pulse inserter, and what must come out.

use super::{Proof, PulseError, stream_edges};
use rules::estimators::thermal::Lines;
use std::fmt::Write as _;

/// A vector: what goes in, what must come out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vector {
    /// Its name, also of its files.
    pub name: &'static str,
    /// What the vector shows, in words.
    pub shows: &'static str,
    /// Least time between two edges, ns.
    pub spacing_ns: u64,
    /// CSV that goes into the device.
    pub input: String,
    /// CSV that must come out.
    pub expected: String,
    /// Proof of the output.
    pub proof: Proof,
}

/// Every vector.
///
/// # Errors
/// A vector that the device refuses: never, a test holds it.
pub fn build_vectors() -> Result<Vec<Vector>, PulseError> {
    VECTORS.iter().map(VectorSource::build_vector).collect()
}

/// How a vector is made: encoder edges at a pace, and requests.
struct VectorSource {
    name: &'static str,
    shows: &'static str,
    spacing_ns: u64,
    /// Pieces of motion: edges, signed, and ns from edge to edge; 0 edges is a rest of 1000 such times.
    motion: &'static [(i64, u64)],
    /// Before which piece how many pulses are asked for, and whether the bypass is switched.
    requests: &'static [(usize, i64, Option<bool>)],
}

const VECTORS: &[VectorSource] = &[
    VectorSource {
        name: "rest_up",
        shows: "three pulses up at rest, both lines low",
        spacing_ns: 250,
        motion: &[(0, 1000)],
        requests: &[(0, 3, None)],
    },
    VectorSource {
        name: "rest_down",
        shows: "three pulses down at rest",
        spacing_ns: 250,
        motion: &[(0, 1000)],
        requests: &[(0, -3, None)],
    },
    VectorSource {
        name: "forward",
        shows: "pulses up while the axis moves up: each waits for both lines low",
        spacing_ns: 250,
        motion: &[(40, 5000)],
        requests: &[(0, 4, None)],
    },
    VectorSource {
        name: "forward_down",
        shows: "pulses down while the axis moves up",
        spacing_ns: 250,
        motion: &[(40, 5000)],
        requests: &[(0, -4, None)],
    },
    VectorSource {
        name: "backward",
        shows: "pulses up while the axis moves down",
        spacing_ns: 250,
        motion: &[(-40, 5000)],
        requests: &[(0, 4, None)],
    },
    VectorSource {
        name: "reversal",
        shows: "the axis reverses within a period while pulses wait",
        spacing_ns: 250,
        motion: &[(13, 4000), (-17, 4000), (9, 4000)],
        requests: &[(0, 2, None), (1, -3, None), (2, 2, None)],
    },
    VectorSource {
        name: "not_low",
        shows: "the axis stands with a line high: nothing is inserted until it moves on",
        spacing_ns: 250,
        motion: &[(2, 4000), (0, 1000), (6, 4000)],
        requests: &[(1, 1, None)],
    },
    VectorSource {
        name: "bypass",
        shows: "bypass holds pulses back, and lets them go",
        spacing_ns: 250,
        motion: &[(16, 4000), (16, 4000)],
        requests: &[(0, 2, Some(true)), (1, 0, Some(false))],
    },
    VectorSource {
        name: "burst",
        shows: "a slow device: encoder edges wait their turn in order, none is lost",
        spacing_ns: 3000,
        motion: &[(8, 4000), (12, 1500), (8, 20000)],
        requests: &[(0, 1, None)],
    },
    VectorSource {
        name: "there_and_back",
        shows: "what is inserted up and taken back adds up to nothing",
        spacing_ns: 250,
        motion: &[(24, 4000), (-24, 4000)],
        requests: &[(0, 5, None), (1, -5, None)],
    },
];

impl VectorSource {
    fn build_vector(&self) -> Result<Vector, PulseError> {
        let input = self.format_input();
        let mut expected = Vec::new();
        let proof = stream_edges(input.as_bytes(), &mut expected, self.spacing_ns, 0)?;
        let expected = String::from_utf8(expected)?;
        let (name, shows, spacing_ns) = (self.name, self.shows, self.spacing_ns);
        Ok(Vector { name, shows, spacing_ns, input, expected, proof })
    }

    fn format_input(&self) -> String {
        let mut text = String::from("time_ns,a,b,request,bypass\n");
        let (mut at_ns, mut position) = (1000_u64, 0_i64);
        let mut row = |at_ns: u64, position: i64, request: i64, bypass: Option<bool>| {
            let lines = Lines::from_position(position);
            let bypass = bypass.map_or("", |on| if on { "1" } else { "0" });
            let _ = writeln!(text, "{at_ns},{},{},{request},{bypass}", u8::from(lines.a), u8::from(lines.b));
        };
        row(at_ns, position, 0, None);
        for (index, (edges, pace_ns)) in self.motion.iter().enumerate() {
            for (_, pulses, bypass) in self.requests.iter().filter(|(piece, ..)| *piece == index) {
                at_ns += pace_ns / 2;
                row(at_ns, position, *pulses, *bypass);
            }
            for _ in 0..edges.abs() {
                at_ns += pace_ns;
                position += edges.signum();
                row(at_ns, position, 0, None);
            }
            if *edges == 0 {
                at_ns += 1000 * pace_ns;
            }
        }
        text
    }
}
