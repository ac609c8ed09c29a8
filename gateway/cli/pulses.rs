//! `cnc-gateway pulses`: insert pulses into encoder lines, with proof; vectors to test a device against.

use super::{CannotRun, CommandOutcome, CommandResult, print_text};
use crate::diagnosis::write_output;
use crate::pulses::{build_vectors, stream_edges};
use clap::Args;
use serde_json::json;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct PulsesArguments {
    /// Encoder lines: CSV with time_ns,a,b and optionally request and bypass; - is standard input, row by row.
    #[arg(long, value_name = "LINES.csv", required_unless_present = "vectors")]
    input: Option<PathBuf>,
    /// Where the compensated lines go; - is standard output.
    #[arg(long, value_name = "OUT.csv", default_value = "-")]
    out: PathBuf,
    /// Pulses to insert from the first row on, signed; the column request asks for more.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    insert: i64,
    /// Least time between two edges that leave: what the controller's counter can follow.
    #[arg(long, value_name = "NS", default_value_t = 250, value_parser = clap::value_parser!(u64).range(1..))]
    spacing_ns: u64,
    /// Write the reference vectors into this directory instead: NAME.in.csv, NAME.out.csv and vectors.json.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["input", "insert"])]
    vectors: Option<PathBuf>,
}

pub(super) fn run(arguments: &PulsesArguments) -> CommandResult {
    if let Some(directory) = &arguments.vectors {
        return write_vectors(directory);
    }
    let input = arguments.input.as_deref().unwrap_or(Path::new("-"));
    let say = |path: &Path| {
        let path = path.display().to_string();
        move |error: std::io::Error| CannotRun::new(format!("{path}: {error}"), "")
    };
    let standard = |path: &Path| path == Path::new("-");
    let reader: Box<dyn std::io::Read> =
        if standard(input) { Box::new(std::io::stdin()) } else { Box::new(File::open(input).map_err(say(input))?) };
    let writer: Box<dyn Write> = if standard(&arguments.out) {
        Box::new(std::io::stdout())
    } else {
        Box::new(File::create(&arguments.out).map_err(say(&arguments.out))?)
    };
    let proof = stream_edges(BufReader::new(reader), BufWriter::new(writer), arguments.spacing_ns, arguments.insert)
        .map_err(|what| CannotRun::new(format!("{}: {what}", input.display()), ""))?;
    eprint!("{}", proof.to_text(arguments.spacing_ns));
    Ok(if proof.is_proven(arguments.spacing_ns) { CommandOutcome::Fine } else { CommandOutcome::No })
}

fn write_vectors(directory: &Path) -> CommandResult {
    std::fs::create_dir_all(directory)
        .map_err(|error| CannotRun::new(format!("{}: {error}", directory.display()), ""))?;
    let all = build_vectors().map_err(CannotRun::from_error)?;
    let mut list = Vec::new();
    for vector in &all {
        write_output(&directory.join(format!("{}.in.csv", vector.name)), &vector.input)
            .map_err(CannotRun::from_error)?;
        write_output(&directory.join(format!("{}.out.csv", vector.name)), &vector.expected)
            .map_err(CannotRun::from_error)?;
        list.push(json!({ "name": vector.name, "shows": vector.shows, "spacing_ns": vector.spacing_ns,
            "rows_in": vector.proof.rows, "edges_out": vector.proof.edges_out, "position_in_edges": vector.proof.in_edges,
            "position_out_edges": vector.proof.out_edges, "inserted_pulses": vector.proof.inserted }));
    }
    let document = json!({ "schema": "pulses/1", "edges_per_pulse": 4, "vectors": list });
    write_output(&directory.join("vectors.json"), &format!("{document:#}\n")).map_err(CannotRun::from_error)?;
    print_text(&format!("{} vectors in {}\n", all.len(), directory.display()));
    Ok(CommandOutcome::Fine)
}
