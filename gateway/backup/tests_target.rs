//! One directory for many boxes and many days, and a restore that cannot end.

use super::target::{BackupKind, list_own};
use super::*;
use gateway_base::files::replace_file;
use gateway_config::BackupConfig;
use std::collections::BTreeMap;
use std::fs;

const DAY_S: u64 = 86_400;
const BEGIN_S: u64 = 1_790_000_000;
const YEAR_2036_S: u64 = 2_082_800_000;

/// A box with one script and one learned state, which the day changes.
struct TriedBox {
    paths: BackupPaths,
    _place: tempfile::TempDir,
}

impl TriedBox {
    fn new(machine: &str) -> Self {
        let place = tempfile::tempdir().expect("a directory");
        let data_dir = place.path().join("data");
        let paths = BackupPaths {
            machine: machine.to_owned(),
            scripts: data_dir.join("scripts"),
            history: data_dir.join("history.db"),
            operations: Some(data_dir.join("recipe.toml")),
            data_dir,
            model: None,
            thermal_model: None,
            configuration: None,
        };
        Self { paths, _place: place }
    }

    fn change(&self, text: &str) {
        replace_file(&self.paths.scripts.join("one.rhai"), &format!("// {text}")).expect("written");
        replace_file(&self.paths.data_dir.join("wear.json"), "{\"edges\":1}").expect("written");
    }

    fn origin(&self) -> BoxOrigin {
        BoxOrigin::of_box(&self.paths.machine, &self.paths.data_dir).expect("a number")
    }

    fn archives(&self, directory: &Path) -> Vec<PathBuf> {
        list_own(directory, BackupKind::Archive, &self.origin()).expect("read")
    }

    /// Restores an archive into an empty box of this machine and gives its script.
    fn restore_elsewhere(&self, archive: &Path) -> String {
        let empty = Self::new(&self.paths.machine);
        let files = archive::unpack(&fs::read(archive).expect("read")).expect("an archive");
        let ask =
            RestoreRequest { by: "Wu", at_ns: 7, before: (b"", "x-before-restore-1.tar.gz"), from_another_box: false };
        let asks = restore_backup(&empty.paths, &files, ask);
        assert!(matches!(asks, Err(RestoreError::OtherBox { .. })), "an archive of another box asks: {asks:?}");
        restore_backup(&empty.paths, &files, RestoreRequest { from_another_box: true, ..ask }).expect("restored");
        fs::read_to_string(empty.paths.scripts.join("one.rhai")).expect("a script")
    }
}

fn config(directory: &Path, keep: usize) -> BackupConfig {
    let every = std::time::Duration::from_secs(DAY_S);
    BackupConfig { directory: directory.to_owned(), every, keep, history: false }
}

/// Two boxes, one share, thirty days; the share is damaged on some of them, and the clock of one box is wrong on one.
#[test]
fn two_boxes_on_one_share_come_back_after_each_of_thirty_days() {
    let share = tempfile::tempdir().expect("a directory");
    // The same name for both: that of a configuration that nobody has changed.
    let boxes = [TriedBox::new("Simulated lathe"), TriedBox::new("Simulated lathe")];
    let (mut restored, keep) = (0, 5);
    for day in 0..30 {
        for (number, tried) in boxes.iter().enumerate() {
            let text = format!("box {number}, day {day}");
            tried.change(&text);
            let at_s = if (number, day) == (0, 7) { YEAR_2036_S } else { BEGIN_S + day * DAY_S };
            let taken = take_backup(&tried.paths, &config(share.path(), keep), at_s).expect("taken");
            assert_eq!(tried.restore_elsewhere(&taken), format!("// {text}"), "what was told as taken comes back");
            restored += 1;
            let own = tried.archives(share.path());
            assert!(own.contains(&taken) && own.len() >= keep.min(day as usize + 1), "{text}: {own:?}");
        }
        damage_share(share.path(), &boxes[1], day);
    }
    for (number, tried) in boxes.iter().enumerate() {
        let own = tried.archives(share.path());
        let is_whole = |path: &&PathBuf| fs::read(path).and_then(|bytes| archive::unpack(&bytes)).is_ok();
        let whole: Vec<&PathBuf> = own.iter().filter(is_whole).collect();
        assert_eq!(whole.len(), keep, "{own:?}");
        let days: Vec<String> = whole.iter().map(|path| tried.restore_elsewhere(path)).collect();
        let newest: Vec<String> = (25..30).map(|day| format!("// box {number}, day {day}")).collect();
        assert_eq!(days, newest, "the newest days of each box are there");
    }
    println!("{restored} backups of two boxes on one share: each came back");
}

/// What a share suffers: half a file of a box that lost its power, a copy without a byte, files of somebody else.
fn damage_share(share: &Path, of: &TriedBox, day: u64) {
    let name = |at_s| BackupKind::Archive.file_name(&of.origin(), at_s);
    match day {
        5 => fs::write(share.join(format!("{}.writing", name(BEGIN_S + 1))), "half").expect("written"),
        9 => fs::write(share.join(name(BEGIN_S + 90 * DAY_S)), "").expect("written"),
        12 => fs::write(share.join(name(BEGIN_S + 91 * DAY_S)), "no archive").expect("written"),
        14 => fs::write(share.join("holidays.tar.gz"), "of somebody else").expect("written"),
        _ => {}
    }
    assert!(day < 15 || share.join("holidays.tar.gz").exists(), "a file of somebody else was removed");
    assert!(day != 6 || list_named_writing(share) == 0, "half a file was left");
}

fn list_named_writing(share: &Path) -> usize {
    list_names(share).iter().filter(|name| name.ends_with(".writing")).count()
}

#[test]
fn the_one_that_was_just_taken_stays_whatever_the_others_are_dated() {
    let (share, tried) = (tempfile::tempdir().expect("a directory"), TriedBox::new("Seven"));
    for (at_s, text) in [(YEAR_2036_S, "of a wrong clock"), (BEGIN_S, "right"), (5, "of a clock without a battery")] {
        tried.change(text);
        let taken = take_backup(&tried.paths, &config(share.path(), 1), at_s).expect("taken");
        assert_eq!(tried.archives(share.path()), std::slice::from_ref(&taken), "{text}");
        assert_eq!(tried.restore_elsewhere(&taken), format!("// {text}"));
    }
}

#[test]
fn a_copy_of_the_history_has_its_name_only_when_it_is_whole() {
    let (share, tried) = (tempfile::tempdir().expect("a directory"), TriedBox::new("Seven"));
    tried.change("x");
    let record = rules::estimators::wear::WearRecord::parse(include_str!("../demo/wear.toml")).expect("a model");
    gateway_history::store_wear_model(&tried.paths.history, 5, &record).expect("stored");
    let with_history = BackupConfig { history: true, ..config(share.path(), 2) };
    let of_history = || list_own(share.path(), BackupKind::History, &tried.origin()).expect("read");
    fs::write(share.path().join(BackupKind::History.file_name(&tried.origin(), BEGIN_S + 1)), "").expect("written");
    for day in 1..5 {
        tried.change("x");
        take_backup(&tried.paths, &with_history, BEGIN_S + day * DAY_S).expect("taken");
    }
    let whole = of_history().into_iter().filter(|path| {
        Reader::open(path).is_ok_and(|it| it.wear_models::<rules::estimators::wear::WearRecord>().is_ok())
    });
    assert_eq!((whole.count(), of_history().len()), (2, 3), "a copy without a byte pushes no whole one out");
    // A history that cannot be copied: no archive either, and nothing half.
    fs::write(&tried.paths.history, "no database").expect("written");
    let before = list_names(share.path());
    assert!(take_backup(&tried.paths, &with_history, BEGIN_S + 9 * DAY_S).is_err());
    assert_eq!(list_names(share.path()), before);
}

/// Every file of the box with its content.
fn all_files(paths: &BackupPaths) -> BTreeMap<String, Vec<u8>> {
    let names = list_names_below(&paths.data_dir).into_iter().filter(|name| !name.contains("-before-restore-"));
    names.filter_map(|name| Some((name.clone(), fs::read(paths.data_dir.join(&name)).ok()?))).collect()
}

/// A restore that fails at each of its files, and at the last step, leaves the box as it was and says so.
#[test]
fn a_restore_puts_everything_in_place_or_nothing() {
    let from = TriedBox::new("Seven");
    from.change("new");
    let recipe =
        "schema = \"operations/1\"\n[[operation]]\nprogram = \"O1\"\nname = \"rough\"\ndepth_of_cut_mm = 1.5\n";
    for (name, text) in [("recipe.toml", recipe), ("annotations.jsonl", "{}\n"), ("settings.toml", "")] {
        replace_file(&from.paths.data_dir.join(name), text).expect("written");
    }
    let record = rules::estimators::wear::WearRecord::parse(include_str!("../demo/wear.toml")).expect("a model");
    gateway_history::store_wear_model(&from.paths.history, 5, &record).expect("stored");
    let files = collect_files(&from.paths).expect("collected");
    let ask = RestoreRequest { by: "Wu", at_ns: 7, before: (b"", "x-before-restore-1.tar.gz"), from_another_box: true };
    let places = ["scripts/one.rhai", "recipe.toml", "annotations.jsonl", "settings.toml", "restored/wear.json"];
    for place in places {
        let to = TriedBox::new("Seven");
        to.change("old");
        replace_file(&to.paths.scripts.join("another.rhai"), "// old").expect("written");
        let blocked = to.paths.data_dir.join(place);
        let _none_there = fs::remove_file(&blocked);
        fs::create_dir_all(blocked.join("a folder in its place")).expect("made");
        let before = all_files(&to.paths);
        let error = restore_backup(&to.paths, &files, ask).expect_err(place);
        assert_eq!(error.describe_state(), "nothing was changed", "{place}: {error}");
        let mut after = all_files(&to.paths);
        after.remove("box-id");
        assert_eq!(after, before, "{place}");
    }
    // The history cannot be written, which is found when all files are in their places.
    let to = TriedBox::new("Seven");
    to.change("old");
    replace_file(&to.paths.scripts.join("another.rhai"), "// old").expect("written");
    let paths = BackupPaths { history: to.paths.data_dir.join("wear.json").join("history.db"), ..to.paths.clone() };
    let before = all_files(&paths);
    let error = restore_backup(&paths, &files, ask).expect_err("no history");
    assert!(error.to_string().contains("were put back: all is as it was"), "{error}");
    assert_eq!(all_files(&paths), before);
}
