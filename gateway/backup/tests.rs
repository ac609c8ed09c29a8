//! A backup taken and put back, in place and into an empty box.

use super::*;
use gateway_base::files::replace_file;
use gateway_scripts::settings::{self, NewSetting};
use rules::script::{DeclarationPlace, SettingValue, list_shipped_scripts};

fn places(below: &Path) -> BackupPaths {
    BackupPaths {
        machine: "Seven".to_owned(),
        data_dir: below.to_owned(),
        scripts: below.join("scripts"),
        history: below.join("history.db"),
        operations: Some(below.join("recipe.toml")),
        model: None,
        thermal_model: None,
        configuration: None,
    }
}

fn ask(name: &str) -> RestoreRequest<'_> {
    RestoreRequest { by: "Wu", at_ns: 7, before: (b"before", name), from_another_box: true }
}

fn taken(places: &BackupPaths) -> Vec<ArchivedFile> {
    collect_files(places).expect("collected")
}

/// Scripts, a setting of the machine and one of a tool, an annotation, things learned.
fn furnish(places: &BackupPaths) {
    for file in list_shipped_scripts() {
        replace_file(&places.scripts.join(&file.name), &file.text).expect("written");
    }
    let wanted = |place| NewSetting {
        script: "constant_load".to_owned(),
        name: "target_w".to_owned(),
        place,
        value: Some(SettingValue::Number(1800.0)),
        began_from: None,
    };
    for place in [DeclarationPlace::Machine, DeclarationPlace::Tool("T3".to_owned())] {
        settings::change_setting(&places.data_dir, &list_shipped_scripts(), &wanted(place), "Li").expect("set");
    }
    for (name, text) in [("persons.json", "secret"), ("annotations.jsonl", "{}\n"), ("wear.json", "{\"edges\":1}")] {
        replace_file(&places.data_dir.join(name), text).expect("written");
    }
}

#[test]
fn a_backup_comes_back_as_it_was_and_a_broken_one_changes_nothing() {
    let directory = tempfile::tempdir().expect("a directory");
    let places = places(directory.path());
    furnish(&places);
    let first = taken(&places);
    assert!(first.iter().all(|(name, content)| !name.contains("persons") && content != b"secret"));
    replace_file(&places.scripts.join(&list_shipped_scripts()[0].name), "// gone").expect("written");
    replace_file(&places.scripts.join("another.rhai"), "// by somebody").expect("written");
    std::fs::remove_file(settings::values_path(directory.path())).expect("removed");
    let with = |name: &str, text: &str| {
        let mut files = first.clone();
        files.retain(|(it, _)| it != name);
        files.push((name.to_owned(), text.as_bytes().to_vec()));
        files
    };
    let broken = [
        with("scripts/bad.rhai", "fn {"),
        with("data/settings.toml", "[constant_load]\ntarget_w = 1e9\n"),
        with("data/wear.json", "{"),
        with("data/persons.json", "{}"),
        with("data/drafts/../x", "{}"),
        with("wear_models/0001.toml", "form = \"none\""),
        with("operations.toml", "depth = "),
        vec![("scripts/../../x.rhai".to_owned(), Vec::new())],
        Vec::new(),
    ];
    for wrong in broken {
        assert!(restore_backup(&places, &wrong, ask("x-before-restore-0.tar.gz")).is_err(), "{:?}", wrong.last());
    }
    assert!(places.scripts.join("another.rhai").exists() && !settings::values_path(directory.path()).exists());
    let done = restore_backup(&places, &first, ask("x-before-restore-1.tar.gz")).expect("restored");
    assert!(done.contains("scripts, the settings") && done.contains("wear.json) waits for the next start"), "{done}");
    assert!(!places.scripts.join("another.rhai").exists());
    assert_eq!(std::fs::read(directory.path().join("x-before-restore-1.tar.gz")).expect("kept"), b"before");
    let written = std::fs::read_to_string(settings::values_path(directory.path())).expect("there");
    assert_eq!(settings::find_author(&written), "Wu", "who restores has changed them");
}

#[test]
fn an_empty_box_gets_everything_that_decides() {
    let (from, to) = (tempfile::tempdir().expect("a directory"), tempfile::tempdir().expect("a directory"));
    let (old, new) = (places(from.path()), places(&to.path().join("data")));
    furnish(&old);
    let record = rules::estimators::wear::WearRecord::parse(include_str!("../demo/wear.toml")).expect("a model");
    gateway_history::store_wear_model(&old.history, 5, &record).expect("stored");
    let first = taken(&old);
    restore_backup(&new, &first, ask("x-before-restore-1.tar.gz")).expect("restored");
    assert!(take_restored(&new.data_dir).is_some());
    let without_author = |files: Vec<ArchivedFile>| {
        let body = |text: &[u8]| String::from_utf8_lossy(text).lines().skip(1).collect::<String>().into_bytes();
        let each = |(name, text): ArchivedFile| {
            if name.ends_with("settings.toml") { (name, body(&text)) } else { (name, text) }
        };
        // Which box it is of differs, too.
        files.into_iter().filter(|(name, _)| name != "box.json").map(each).collect::<Vec<_>>()
    };
    assert_eq!(without_author(taken(&new)), without_author(first.clone()));
    restore_backup(&new, &first, ask("x-before-restore-2.tar.gz")).expect("again");
    let models = Reader::open(&new.history)
        .and_then(|it| it.wear_models::<rules::estimators::wear::WearRecord>())
        .expect("there");
    assert_eq!(models.len(), 1, "a model that is in force is not stored twice");
}
