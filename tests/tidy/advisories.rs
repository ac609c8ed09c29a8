//! The lock file against the advisories that are published for crates, without a network: the list is a file of the tests, kept by
//!
//! ```sh
//! git clone https://github.com/rustsec/advisory-db /tmp/advisory-db
//! ADVISORY_DB=/tmp/advisory-db cargo test --test tidy write_advisories -- --ignored
//! ```
//!
//! A list says nothing about what was published after it was made. Its date is printed, and stands in its first line.

use super::{none, root};
use semver::{Version, VersionReq};
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Advisories that hold for a crate of the lock file, each with the reason why nothing is to be done.
const HELD: [(&str, &str); 1] = [(
    "RUSTSEC-2023-0071",
    "rsa comes with the library of OPC UA, only in the feature `opcua`; no version is mended (timing of decryption by RSA)",
)];

fn list() -> PathBuf {
    root().join("tests/data/advisories.tsv")
}

/// One advisory.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Advisory {
    package: String,
    id: String,
    /// Versions that are mended, and those that never had it, each as a list of requirements.
    patched: Vec<String>,
    unaffected: Vec<String>,
    /// `unmaintained`, `unsound`, `notice`; empty: a vulnerability.
    kind: String,
}

impl Advisory {
    fn line(&self) -> String {
        let Self { package, id, patched, unaffected, kind } = self;
        format!("{package}\t{id}\t{}\t{}\t{kind}\n", patched.join(" | "), unaffected.join(" | "))
    }

    fn of_line(line: &str) -> Self {
        let [package, id, patched, unaffected, kind] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("five columns: {line:?}")
        };
        let all = |cell: &str| cell.split(" | ").filter(|text| !text.is_empty()).map(str::to_owned).collect();
        let (patched, unaffected) = (all(patched), all(unaffected));
        Self { package: package.to_owned(), id: id.to_owned(), patched, unaffected, kind: kind.to_owned() }
    }

    /// Does it hold for this version?
    fn holds(&self, version: &Version) -> bool {
        let fits = |text: &String| VersionReq::parse(text).is_ok_and(|wanted| wanted.matches(version));
        !self.patched.iter().chain(&self.unaffected).any(fits)
    }
}

#[derive(Deserialize)]
struct LockFile {
    package: Vec<LockedPackage>,
}

#[derive(Deserialize)]
struct LockedPackage {
    name: String,
    version: Version,
    source: Option<String>,
}

#[test]
fn no_advisory_holds_for_a_crate_of_the_lock_file() {
    let text = fs::read_to_string(list()).expect("the list is there");
    let (head, rows) = text.split_once('\n').expect("a head");
    let advisories: Vec<Advisory> = rows.lines().map(Advisory::of_line).collect();
    let locked = fs::read_to_string(root().join("Cargo.lock")).expect("there");
    let locked: LockFile = toml::from_str(&locked).expect("a lock file");
    let foreign: Vec<&LockedPackage> = locked.package.iter().filter(|package| package.source.is_some()).collect();
    println!("{} advisories ({head}), {} crates of others", advisories.len(), foreign.len());
    assert!(advisories.len() > 500 && foreign.len() > 100, "nothing was compared");
    let mut found = Vec::new();
    for package in foreign {
        let own = advisories.iter().filter(|advisory| advisory.package == package.name);
        for advisory in own.filter(|advisory| advisory.holds(&package.version)) {
            if !HELD.iter().any(|(id, _)| *id == advisory.id) {
                found.push(format!("{} {}: {} {}", package.name, package.version, advisory.id, advisory.kind));
            }
        }
    }
    none(found, "no advisory holds for a crate of the lock file; take a newer version, or say in HELD why not");
}

#[test]
fn an_advisory_holds_between_what_never_had_it_and_what_is_mended() {
    let advisory = Advisory::of_line("a\tRUSTSEC-1\t>=1.4.2 | ~1.3.7\t<1.2.0\t");
    let holds = |version: &str| advisory.holds(&Version::parse(version).expect("a version"));
    assert!(holds("1.2.0") && holds("1.3.6") && holds("1.4.1"));
    assert!(!holds("1.1.9") && !holds("1.3.8") && !holds("2.0.0"));
    assert_eq!(Advisory::of_line(advisory.line().trim_end_matches('\n')), advisory);
}

#[derive(Deserialize)]
struct AdvisoryFile {
    advisory: AdvisoryHead,
    #[serde(default)]
    versions: AdvisoryVersions,
}

#[derive(Deserialize)]
struct AdvisoryHead {
    id: String,
    package: String,
    withdrawn: Option<String>,
    informational: Option<String>,
}

#[derive(Deserialize, Default)]
struct AdvisoryVersions {
    #[serde(default)]
    patched: Vec<String>,
    #[serde(default)]
    unaffected: Vec<String>,
}

fn advisory(path: &Path) -> Option<Advisory> {
    let text = fs::read_to_string(path).ok()?;
    let head = text.strip_prefix("```toml")?.split_once("\n```")?.0;
    let AdvisoryFile { advisory, versions } = toml::from_str(head).expect("an advisory");
    let AdvisoryHead { id, package, withdrawn, informational } = advisory;
    let AdvisoryVersions { patched, unaffected } = versions;
    let kind = informational.unwrap_or_default();
    withdrawn.is_none().then_some(Advisory { package, id, patched, unaffected, kind })
}

#[test]
#[ignore = "1 second: writes the list of advisories from a clone of the database of RustSec; needs ADVISORY_DB"]
fn write_advisories() {
    let database = PathBuf::from(std::env::var_os("ADVISORY_DB").expect("ADVISORY_DB names a clone"));
    let mut files = Vec::new();
    super::collect(&database.join("crates"), &mut files);
    let mut all: Vec<Advisory> = files.iter().filter_map(|path| advisory(path)).collect();
    all.sort();
    let dated = Command::new("git").arg("-C").arg(&database).args(["log", "-1", "--format=%cs"]).output();
    let dated = dated.ok().filter(|said| said.status.success()).expect("a clone knows its date");
    let date = String::from_utf8_lossy(&dated.stdout).trim().to_owned();
    let rows: String = all.iter().map(Advisory::line).collect();
    fs::write(list(), format!("# RustSec advisory-db (CC0-1.0) of {date}\n{rows}")).expect("written");
    println!("{} advisories of {date}", all.len());
}
