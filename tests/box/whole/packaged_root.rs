//! The package under the real systemd, in a root of Debian 12: `tests/data/update/trial.sh` is done in it, and what the program said is
//! compared with what the unit, the process and the page were at that moment.

use super::service::UPDATES;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use testkit::process::text;

const BUILD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/gateway/package/build.sh");

fn run(command: &mut Command) {
    let status = command.stdin(Stdio::null()).status().expect("it is installed");
    assert!(status.success(), "{command:?}: {status}");
}

/// One line of the script.
struct Step {
    name: String,
    code: String,
    said: String,
    word: String,
    runs: String,
    page: String,
}

impl Step {
    fn parse(line: &str) -> Self {
        let parts: Vec<String> = line.split('|').map(str::to_owned).collect();
        let [name, code, said, word, runs, page] = <[String; 6]>::try_from(parts).expect("six parts");
        Self { name, code, said, word, runs, page }
    }

    /// The service runs, its page answers, and every sentence about that is so.
    fn check(&self) -> usize {
        let name = &self.name;
        let seen = (self.word.as_str(), self.page.as_str());
        assert_eq!(seen, ("active", "200"), "{name}: {}", self.said);
        let marker = "een now: the service is ";
        let sentences: Vec<&str> = self.said.split(marker).skip(1).collect();
        for rest in &sentences {
            let truth = format!("active, {} runs, its page answers", self.runs);
            assert!(rest.starts_with(&truth), "{name}: untrue, in truth {truth:?}: {}", self.said);
        }
        sentences.len()
    }
}

/// A root with systemd, the package, the updates and the program for their good versions.
fn lay_out_root(place: &Path) -> std::path::PathBuf {
    let root = place.join("root");
    let include = "--include=systemd,systemd-sysv,dbus,adduser,udev,curl,procps,libgcc-s1";
    match std::env::var_os("PACKAGE_ROOT") {
        Some(made) => run(Command::new("cp").arg("-a").arg(made).arg(&root)),
        None => run(Command::new("mmdebstrap").args(["--quiet", "--variant=minbase", include, "bookworm"]).arg(&root)),
    }
    let program = place.join("cnc-gateway");
    run(Command::new("strip").args(["-o", text(&program), env!("CARGO_BIN_EXE_cnc-gateway")]));
    run(Command::new(BUILD).arg(place.join("packages")).env("PROGRAM", &program).env("DEB_LEVEL", "0"));
    let trial = root.join("trial");
    run(Command::new("cp").args(["-r", UPDATES]).arg(&trial));
    let packages = fs::read_dir(place.join("packages")).expect("built").flatten().map(|entry| entry.path());
    let package =
        packages.into_iter().find(|path| path.extension().is_some_and(|end| end == "deb")).expect("a package");
    fs::copy(package, trial.join("package.deb")).expect("copied");
    let good = root.join("opt/versions/0.2.0");
    fs::create_dir_all(&good).expect("a folder");
    fs::copy(&program, good.join("cnc-gateway")).expect("copied");
    fs::copy(trial.join("trial.service"), root.join("etc/systemd/system/trial.service")).expect("copied");
    run(Command::new("systemctl").args(["--root", text(&root), "enable", "trial.service"]));
    root
}

#[test]
#[ignore = "10 minutes: the package under systemd; needs root, systemd-nspawn, mmdebstrap and dpkg-deb"]
fn under_systemd_no_update_leaves_the_service_failed_and_every_sentence_is_so() {
    let place = tempfile::tempdir().expect("a directory");
    let root = lay_out_root(place.path());
    // A container without a system bus around it: what systemd-nspawn keeps of itself lies in a folder of its own.
    let boot = format!(
        "mount -t tmpfs tmpfs /run && exec timeout 1200 systemd-nspawn -q -D {} --machine=trial --register=no --keep-unit --boot --private-network",
        text(&root)
    );
    let mut container = Command::new("unshare");
    container.args(["-m", "sh", "-c", &boot]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let _ends_by_poweroff = container.status().expect("unshare runs");
    let read = |name: &str| fs::read_to_string(root.join("trial").join(name)).unwrap_or_default();
    println!("{}", read("steps"));
    assert!(root.join("trial/done").exists(), "the trial did not end:\n{}", read("log"));
    let journal = read("journal-install");
    assert!(journal.contains("make a token at the box") && !journal.contains("with the token"), "{journal}");
    let steps: Vec<Step> = read("steps").lines().map(Step::parse).collect();
    let sentences: usize = steps.iter().map(Step::check).sum();
    for (name, code, runs, part) in [
        ("install", "0", "package", ""),
        ("person-list", "0", "package", "admin"),
        ("person-token", "0", "package", "shown only now"),
        ("owner-of-persons", "0", "package", "cnc-gateway"),
        ("killed-eight-times", "0", "package", ""),
        ("bad-first", "1", "package", "0.2.0 was taken back"),
        ("bad-again", "1", "package", "0.2.0 was taken back"),
        ("bad-third", "1", "package", "0.2.0 was taken back"),
        ("bad-on-killed", "1", "package", "has not been confirmed; package is put back first"),
        ("full-disk", "0", "package", ""),
        ("good", "0", "0.2.0", "has reported good health and stays"),
        ("other-key", "2", "0.2.0", "--change-key"),
        ("older", "2", "0.2.0", "is not newer than 0.2.0"),
        ("report", "0", "0.2.0", "the next start runs: 0.2.0"),
    ] {
        let step = steps.iter().find(|step| step.name == name).unwrap_or_else(|| panic!("no step {name}"));
        assert_eq!((step.code.as_str(), step.runs.as_str()), (code, runs), "{name}: {}", step.said);
        assert!(step.said.contains(part), "{name}: {}", step.said);
    }
    println!("{} steps under systemd: never failed, {sentences} sentences compared, 0 untrue", steps.len());
}
