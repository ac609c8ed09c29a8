//! Pulse insertion over a stream or recording of encoder lines, with the proof of a decoder, and vectors to test a device against.
//!
//! Input: CSV with `time_ns,a,b` and optionally `request` (pulses asked for from this row on, signed) and `bypass` (0 or 1);
//! one row per change of a line, or any row with a request. Output: CSV with `time_ns,a,b`, one row per edge that leaves.
//! The proof decodes both sides with a decoder that knows nothing of the inserter and counts.

mod vectors;

pub use vectors::{Vector, build_vectors};

use rules::estimators::thermal::{Decoder, EDGES_PER_PULSE, IllegalTransition, InsertionFault, Lines, PulseInserter};
use std::io::{BufRead, Write};
use thiserror::Error;

/// After the last row the device goes on so long, in spacings, to let out what waits.
const TAIL_SPACINGS: u64 = 4096;

/// Why a stream of encoder lines cannot be passed on.
#[derive(Debug, Error)]
pub enum PulseError {
    /// The head lacks a column.
    #[error("line 1: there is no column {name}; the head is time_ns,a,b[,request][,bypass]")]
    NoColumn {
        /// Name of the column in the head.
        name: &'static str,
    },
    /// A level that is none.
    #[error("line {line}: {name} is {found:?}; a level is 0 or 1")]
    Level {
        /// Number of the line in the input, from 1.
        line: usize,
        /// Which of the two encoder lines.
        name: &'static str,
        /// The cell as it stands there.
        found: String,
    },
    /// A time that is none.
    #[error("line {line}: {found:?} is no time in whole ns")]
    Time {
        /// Number of the line in the input, from 1.
        line: usize,
        /// The cell as it stands there.
        found: String,
    },
    /// A request that is none.
    #[error("line {line}: {found:?} is no whole number of pulses")]
    Request {
        /// Number of the line in the input, from 1.
        line: usize,
        /// The cell as it stands there.
        found: String,
    },
    /// A switch that is none.
    #[error("line {line}: bypass is {found:?}; write 0 or 1")]
    Bypass {
        /// Number of the line in the input, from 1.
        line: usize,
        /// The cell as it stands there.
        found: String,
    },
    /// The device or the decoder does not take a row.
    #[error("line {line}: {fault}")]
    Row {
        /// Number of the line in the input, from 1.
        line: usize,
        /// What the device or the decoder says.
        fault: RowFault,
    },
    /// The device does not let out what waits.
    #[error("{0}")]
    Tail(RowFault),
    /// There is a head at most.
    #[error("there is no row of encoder lines")]
    NoRows,
    /// The input cannot be read, or the output cannot be written.
    #[error("{0}")]
    Stream(#[from] std::io::Error),
    /// The output is no text.
    #[error("{0}")]
    NoText(#[from] std::string::FromUtf8Error),
}

/// Why a row is not taken.
#[derive(Debug, Error)]
pub enum RowFault {
    /// Both lines changed at once.
    #[error("{0}")]
    Encoder(#[from] IllegalTransition),
    /// The device has a fault.
    #[error("{0}")]
    Device(#[from] InsertionFault),
}

/// One row that goes in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PulseRow {
    /// When the levels begin to hold, ns.
    pub at_ns: u64,
    /// The levels from then on.
    pub lines: Lines,
    /// Pulses asked for from then on.
    pub request: i64,
    /// Switches the bypass of the device on or off; `None` leaves it as it is.
    pub bypass: Option<bool>,
}

/// What the decoder found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Proof {
    /// Number of rows that came in.
    pub rows: u64,
    /// Number of edges that went out.
    pub edges_out: u64,
    /// Edges of position on the way in.
    pub in_edges: i64,
    /// Edges of position on the way out.
    pub out_edges: i64,
    /// Pulses asked for, in sum.
    pub asked: i64,
    /// Pulses that the device has inserted, up less down.
    pub inserted: i64,
    /// Transitions of both lines at once on the way out; must be 0.
    pub illegal: u64,
    /// Least time between two edges on the way out, ns.
    pub least_ns: Option<u64>,
}

impl Proof {
    /// Is the position that leaves the one that came in and what was asked for, all of it, without an illegal transition and
    /// no closer than the spacing?
    #[must_use]
    pub fn is_proven(&self, spacing_ns: u64) -> bool {
        let counted = self.out_edges - self.in_edges == EDGES_PER_PULSE * self.inserted;
        let spaced = self.least_ns.is_none_or(|least| least >= spacing_ns);
        counted && spaced && self.illegal == 0 && self.count_waiting() == 0
    }

    /// Pulses that were asked for and have not left.
    #[must_use]
    pub fn count_waiting(&self) -> i64 {
        self.asked - self.inserted
    }

    /// The figures and whether the proof holds, in lines; edges have to be `spacing_ns` apart.
    #[must_use]
    pub fn to_text(&self, spacing_ns: u64) -> String {
        let least = self.least_ns.map_or_else(|| "-".to_owned(), |least| least.to_string());
        let proof = match (self.is_proven(spacing_ns), self.count_waiting()) {
            (true, _) => "holds".to_owned(),
            (false, 0) => "DOES NOT HOLD".to_owned(),
            (false, waiting) => format!(
                "DOES NOT HOLD: {waiting} pulses that were asked for have not left; the input is too short for them, or \
                 the device was bypassed"
            ),
        };
        format!(
            "rows in {}, edges out {}\nposition in {} edges, out {} edges, difference {}\npulses asked for {}, inserted {}, \
             {} edges each\nillegal transitions out {}, closest edges {least} ns (at least {spacing_ns})\nproof: {proof}\n",
            self.rows,
            self.edges_out,
            self.in_edges,
            self.out_edges,
            self.out_edges - self.in_edges,
            self.asked,
            self.inserted,
            EDGES_PER_PULSE,
            self.illegal,
        )
    }
}

/// The columns of an input.
struct Heads {
    time: usize,
    a: usize,
    b: usize,
    request: Option<usize>,
    bypass: Option<usize>,
}

impl Heads {
    fn parse_head(line: &str) -> Result<Self, PulseError> {
        let names: Vec<&str> = line.trim().split(',').map(str::trim).collect();
        let at = |name: &str| names.iter().position(|it| *it == name);
        let need = |name: &'static str| at(name).ok_or(PulseError::NoColumn { name });
        Ok(Self { time: need("time_ns")?, a: need("a")?, b: need("b")?, request: at("request"), bypass: at("bypass") })
    }

    fn parse_row(&self, line: &str, number: usize) -> Result<PulseRow, PulseError> {
        let cells: Vec<&str> = line.trim().split(',').map(str::trim).collect();
        let cell = |at: usize| cells.get(at).copied().unwrap_or("");
        let level = |at: usize, name: &'static str| match cell(at) {
            "0" => Ok(false),
            "1" => Ok(true),
            other => Err(PulseError::Level { line: number, name, found: other.to_owned() }),
        };
        let at_ns = cell(self.time)
            .parse()
            .map_err(|_| PulseError::Time { line: number, found: cell(self.time).to_owned() })?;
        let request = match self.request.map_or("", cell) {
            "" => 0,
            text => text.parse().map_err(|_| PulseError::Request { line: number, found: text.to_owned() })?,
        };
        let bypass = match self.bypass.map_or("", cell) {
            "" => None,
            "0" => Some(false),
            "1" => Some(true),
            other => return Err(PulseError::Bypass { line: number, found: other.to_owned() }),
        };
        Ok(PulseRow { at_ns, lines: Lines { a: level(self.a, "a")?, b: level(self.b, "b")? }, request, bypass })
    }
}

/// A device with the decoder behind it.
struct DecodedDevice {
    device: PulseInserter,
    decoder: Decoder,
    encoder: Decoder,
    begun: (i64, i64),
    last_ns: Option<u64>,
    proof: Proof,
}

impl DecodedDevice {
    fn new(first: &PulseRow, spacing_ns: u64) -> Self {
        let device = PulseInserter::new(first.lines, first.at_ns, spacing_ns);
        let decoder = Decoder::new(device.lines(), 0);
        Self {
            device,
            decoder,
            encoder: Decoder::new(first.lines, 0),
            begun: (0, 0),
            last_ns: None,
            proof: Proof::default(),
        }
    }

    fn feed_row(&mut self, row: &PulseRow, out: &mut Vec<(u64, Lines)>) -> Result<(), RowFault> {
        if let Some(bypass) = row.bypass {
            self.device.set_bypass(bypass);
        }
        self.device.request_pulses(row.request);
        self.proof.asked += row.request;
        self.proof.rows += 1;
        self.encoder.decode_lines(row.lines, row.at_ns)?;
        self.advance_device(row.at_ns, row.lines, out)
    }

    fn advance_device(&mut self, at_ns: u64, lines: Lines, out: &mut Vec<(u64, Lines)>) -> Result<(), RowFault> {
        let Self { device, decoder, last_ns, proof, .. } = self;
        let passed = device.advance_to(at_ns, lines, |edge| {
            proof.illegal += u64::from(decoder.decode_lines(edge.lines, edge.at_ns).is_err());
            let apart = last_ns.map(|last| edge.at_ns.saturating_sub(last));
            proof.least_ns = match (proof.least_ns, apart) {
                (Some(least), Some(apart)) => Some(least.min(apart)),
                (least, apart) => least.or(apart),
            };
            *last_ns = Some(edge.at_ns);
            proof.edges_out += 1;
            out.push((edge.at_ns, edge.lines));
        });
        passed.map_err(RowFault::Device)
    }

    fn finish_proof(&mut self) -> Proof {
        self.proof.in_edges = self.encoder.position_edges() - self.begun.0;
        self.proof.out_edges = self.decoder.position_edges() - self.begun.1;
        self.proof.inserted = self.device.inserted_pulses();
        self.proof
    }
}

/// Reads rows, writes edges as they leave; memory does not grow with the length of the stream.
///
/// # Errors
/// A row that is none with its line, a fault of the device, or what the system said.
pub fn stream_edges(
    input: impl BufRead,
    mut output: impl Write,
    spacing_ns: u64,
    first_request: i64,
) -> Result<Proof, PulseError> {
    let mut heads = None;
    let mut bench: Option<DecodedDevice> = None;
    let mut last: Option<PulseRow> = None;
    let mut out = Vec::new();
    writeln!(output, "time_ns,a,b")?;
    for (index, line) in input.lines().enumerate() {
        let line = line?;
        if line.trim().is_empty() {
            continue;
        }
        let Some(heads) = &heads else {
            heads = Some(Heads::parse_head(&line)?);
            continue;
        };
        let mut row = heads.parse_row(&line, index + 1)?;
        let bench = bench.get_or_insert_with(|| {
            row.request += first_request;
            DecodedDevice::new(&row, spacing_ns)
        });
        bench.feed_row(&row, &mut out).map_err(|fault| PulseError::Row { line: index + 1, fault })?;
        last = Some(row);
        flush(&mut out, &mut output)?;
    }
    let (Some(mut bench), Some(last)) = (bench, last) else {
        return Err(PulseError::NoRows);
    };
    let end_ns = last.at_ns.saturating_add(spacing_ns.saturating_mul(TAIL_SPACINGS));
    bench.advance_device(end_ns, last.lines, &mut out).map_err(PulseError::Tail)?;
    flush(&mut out, &mut output)?;
    Ok(bench.finish_proof())
}

fn flush(out: &mut Vec<(u64, Lines)>, output: &mut impl Write) -> std::io::Result<()> {
    if out.is_empty() {
        return Ok(());
    }
    for (at_ns, lines) in out.drain(..) {
        writeln!(output, "{at_ns},{},{}", u8::from(lines.a), u8::from(lines.b))?;
    }
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vector_is_proved_and_bad_rows_are_told_with_their_line() {
        let all = build_vectors().expect("every vector runs");
        assert!(all.len() >= 10);
        for vector in &all {
            assert!(vector.proof.is_proven(vector.spacing_ns), "{}: {:?}", vector.name, vector.proof);
            assert_eq!(vector.proof.inserted, vector.proof.asked, "{}", vector.name);
            assert!(vector.proof.edges_out > 0, "{}", vector.name);
        }
        let refused = |text: &str| stream_edges(text.as_bytes(), Vec::new(), 250, 0).expect_err("refused").to_string();
        assert!(refused("time_ns,a\n1,0\n").contains("no column b"));
        assert!(refused("time_ns,a,b\n1,0,2\n").contains("line 2: b is"));
        assert!(refused("time_ns,a,b\n1,0,0\n2,1,1\n").contains("both encoder lines"));
        assert!(refused("time_ns,a,b\n5,0,0\n1,1,0\n").contains("time went back"));
        assert!(refused("").contains("no row"));
    }

    #[test]
    fn a_proof_that_does_not_hold_says_so() {
        let proof = Proof { out_edges: 4, inserted: 2, ..Proof::default() };
        assert!(!proof.is_proven(250) && proof.to_text(250).contains("DOES NOT HOLD"));
        assert!(!Proof { illegal: 1, ..Proof::default() }.is_proven(250));
        assert!(!Proof { least_ns: Some(100), ..Proof::default() }.is_proven(250));
        // A line stays high: one pulse is inserted with the edge, and the proof says how many still wait.
        let proof = stream_edges("time_ns,a,b\n1,0,0\n900,1,0\n".as_bytes(), Vec::new(), 250, 0).expect("runs");
        assert!(proof.is_proven(250), "{proof:?}");
        let proof =
            stream_edges("time_ns,a,b,request\n1,0,0,0\n900,1,0,7\n".as_bytes(), Vec::new(), 250, 0).expect("runs");
        let text = proof.to_text(250);
        assert!(!proof.is_proven(250) && text.contains("6 pulses that were asked for have not left"), "{text}");
    }
}
