//! A box that has run in every way: no file of its data directory is unknown to the list of a backup, and an empty box decides as it
//! did after a restore.

use gateway::backup::BackupPaths;
use gateway::backup::list::find_fate;
use gateway::history::Reader;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use testkit::process::{Gateway, run, stderr, stdout, text};

const SETTINGS: &str = "[constant_load]\ntarget_w = 2400.0\n";

const RECIPE: &str =
    "schema = \"operations/1\"\n[[operation]]\nprogram = \"O1\"\nname = \"rough\"\ndepth_of_cut_mm = 1.5\n";

fn furnish(place: &Path) -> PathBuf {
    let config = "[gateway]\nname = \"Seven\"\ndata_dir = \"data\"\n[operations]\npath = \"data/recipe.toml\"\n[http]\ntls = true\n\
                  tokens = \"always\"\n[[source]]\nname = \"lathe\"\naddress = \"simulated://lathe\"\n";
    fs::create_dir_all(place.join("data")).expect("a folder");
    fs::write(place.join("box.toml"), config).expect("written");
    place.join("box.toml")
}

fn started(data: &Path, config: &Path, arguments: &[&str]) {
    let mut gateway = Gateway::start(data, &[&["--config", text(config), "--speed", "max"], arguments].concat());
    assert!(gateway.wait().success(), "{}", gateway.said());
}

fn fine(output: &Output) -> String {
    assert!(output.status.success(), "{}{}", stdout(output), stderr(output));
    stdout(output)
}

/// Every file below this folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    entries.flat_map(|entry| if entry.path().is_dir() { files(&entry.path()) } else { vec![entry.path()] }).collect()
}

fn places(place: &Path) -> BackupPaths {
    BackupPaths {
        machine: "Seven".to_owned(),
        data_dir: place.join("data"),
        scripts: place.join("data/scripts"),
        history: place.join("data/history.db"),
        operations: Some(place.join("data/recipe.toml")),
        model: None,
        thermal_model: None,
        configuration: Some(place.join("box.toml")),
    }
}

#[test]
fn an_empty_box_goes_on_from_a_backup_and_no_file_is_forgotten() {
    let directory = tempfile::tempdir().expect("a directory");
    let (old, new) = (directory.path().join("old"), directory.path().join("new"));
    let config = furnish(&old);
    fs::write(old.join("data/recipe.toml"), RECIPE).expect("written");
    fs::write(old.join("data/settings.toml"), SETTINGS).expect("written");
    started(&old.join("data"), &config, &["--for", "1800"]);
    fine(&run(&["annotate", "flank-wear", "0.12", "--unit", "mm", "--at", "now", "--config", text(&config)]));
    run(&["commission", "--write", "--config", text(&config)]);
    let unknown: Vec<PathBuf> =
        files(&old.join("data")).into_iter().filter(|path| find_fate(&places(&old), path).is_none()).collect();
    assert_eq!(unknown, Vec::<PathBuf>::new(), "name them in gateway/backup/list.rs: in a backup, or why not");
    assert_eq!(find_fate(&places(&old), &old.join("data/another.json")), None, "the list does not fit everything");

    let (archive, copy) = (directory.path().join("box.tar.gz"), directory.path().join("copy.db"));
    fine(&run(&["backup", "--config", text(&config), "--out", text(&archive), "--history", text(&copy)]));
    let rows = |path: &Path| Reader::open(path).and_then(|it| it.read_span()).expect("readable");
    assert_eq!(rows(&copy), rows(&old.join("data/history.db")));

    let again = furnish(&new);
    let refused = run(&["restore", text(&archive), "--config", text(&again), "--by", "Wu"]);
    let why = stderr(&refused);
    assert!(why.contains("--from-another-box") && why.contains("nothing was changed"), "{why}");
    assert!(!new.join("data/settings.toml").exists() && !new.join("data/restored").exists());
    let meant = ["restore", text(&archive), "--config", text(&again), "--by", "Wu", "--from-another-box"];
    let said = fine(&run(&meant));
    assert!(said.contains("the settings") && said.contains("waits for the next start"), "{said}");
    assert!(new.join("data/restored/wear.json").exists() && !new.join("data/wear.json").exists());
    let waiting = fs::read(new.join("data/restored/scripts.json")).expect("there");
    assert_eq!(waiting, fs::read(old.join("data/scripts.json")).expect("there"), "what the scripts remember");
    started(&new.join("data"), &again, &["--for", "5"]);
    assert!(!new.join("data/restored").exists() && new.join("data/wear.json").exists());
    let settings = fs::read_to_string(new.join("data/settings.toml")).expect("there");
    assert!(settings.contains("target_w = 2400"), "{settings}");
    let database = new.join("data/history.db");
    let events = fine(&run(&["history", "query", "--history", text(&database), "--json", "--records", "events"]));
    assert!(
        events.contains("what was learned is that of the backup") && !events.contains("scripts_refused"),
        "{events}"
    );
}
