//! A map that is proposed reads its file as it is read without one.

use super::map_file::{MapProposal, verify_proposal};
use adapter_core::bilingual::Bilingual;
use recording::Mapping;
use recording::read::{Preview, find_difference, preview_recording};
use std::path::{Path, PathBuf};

fn build_berlin_map() -> Mapping {
    let text = "schema = \"map/1\"\n[time]\nzone = \"Europe/Berlin\"\n";
    Mapping::parse(text, "map").expect("a map")
}

/// The map of a file as `recording map --yes` writes it, and whether it reads the file as it is read without one.
fn propose_map(path: &Path, base: &Mapping) -> Option<(String, Option<String>)> {
    let found = preview_recording(path, base).ok()?;
    let text = MapProposal::from_preview(&found, base).to_toml(&Bilingual::default(), "f");
    let wrong = match verify_proposal(path, &text, found, &[]) {
        Ok(after) => is_read_otherwise(path, &text, after),
        Err(error) => Some(error.to_string()),
    };
    Some((text, wrong))
}

/// Rows that were kept from the first reading are those of a second one, with the same notes.
fn is_read_otherwise(path: &Path, map: &str, after: Preview) -> Option<String> {
    let mapping = Mapping::parse(map, "map").expect("a map");
    let again = preview_recording(path, &mapping).expect("readable");
    match (after.read, again.read) {
        (Ok(kept), Ok(again)) => find_difference(&kept, &again, &[])
            .map(|difference| difference.en)
            .or_else(|| (kept.notes != again.notes).then(|| format!("{:?} is not {:?}", kept.notes, again.notes))),
        (Err(_), Err(_)) => None,
        (kept, again) => Some(format!("{:?} is not {:?}", kept.err(), again.err())),
    }
}

#[test]
fn every_file_of_strangers_reads_the_same_under_its_proposed_map() {
    let directory = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/foreign");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(directory).expect("the folder").map(|entry| entry.expect("a file").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension != "json"));
    let (mut same, mut refused, mut wrong) = (0, 0, Vec::new());
    for path in &files {
        match propose_map(path, &build_berlin_map()) {
            None => refused += 1,
            Some((_, None)) => same += 1,
            Some((text, Some(error))) => wrong.push(format!("{}: {error}\n{text}", path.display())),
        }
    }
    println!(
        "{same} files read the same under their proposed map, {refused} are refused by name, {} otherwise",
        wrong.len()
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(same >= 45, "{same} files");
}

#[test]
fn date_and_time_in_two_columns_are_proposed_as_two() {
    let path = std::env::temp_dir().join(format!("two-columns-{}.csv", std::process::id()));
    let rows: String = (0..60).map(|second| format!("17.03.2026;08:15:{second:02};{}\n", 100 + second)).collect();
    std::fs::write(&path, format!("Datum;Uhrzeit;Leistung [W];Leistung [W]\n{}", rows.replace('\n', ";1\n")))
        .expect("written");
    let (text, wrong) = propose_map(&path, &build_berlin_map()).expect("a proposal");
    assert_eq!(wrong, None, "{text}");
    for line in
        ["date = \"Datum\"", "clock = \"Uhrzeit\"", "from = \"#3\"", "from = \"#4\"", "zone = \"Europe/Berlin\""]
    {
        assert!(text.contains(line), "{line} in:\n{text}");
    }
    // A map under which it reads otherwise is refused.
    let found = preview_recording(&path, &build_berlin_map()).expect("readable");
    let midnight = "schema = \"map/1\"\n[time]\ncolumn = \"Datum\"\nzone = \"Europe/Berlin\"\n";
    let error = verify_proposal(&path, midnight, found, &[]).expect_err("midnight").to_string();
    assert!(error.contains("no map is written") && error.contains("data row"), "{error}");
    std::fs::remove_file(&path).expect("removed");
}

#[test]
fn what_a_map_said_stays_in_the_one_that_is_proposed_under_it() {
    let path = std::env::temp_dir().join(format!("said-{}.csv", std::process::id()));
    std::fs::write(&path, "title\nT;P;Q\n01/02/2026 10:00:00;1,5;2\n01/02/2026 10:00:01;2,5;3\n").expect("written");
    let text = "schema = \"map/1\"\nencoding = \"windows-1252\"\nseparator = \";\"\ndecimal = \",\"\nheader_line = 2\n[time]\ncolumn = \"T\"\norder = \"mdy\"\n\
                zone = \"UTC\"\nclocks = \"rows\"\n[[column]]\nfrom = \"P\"\nto = \"spindle_power_w\"\nunit = \"kW\"\nscale = 3.0\noffset = 0.5\n";
    let base = Mapping::parse(text, "map").expect("a map");
    let (proposed, wrong) = propose_map(&path, &base).expect("a proposal");
    assert_eq!(wrong, None, "{proposed}");
    let mut again = Mapping::parse(&proposed, "map").expect("a map");
    again.column.retain(|column| column.from == "P");
    assert_eq!(again, base, "{proposed}");
    std::fs::remove_file(&path).expect("removed");
}
