//! Scripts on disk: delivered, edited, broken, mended, with a real directory and the real thread.

use super::*;
use gateway::reload::{Fallback, Reloader, Watch, load_now, load_rest, read_directory, write_shipped_scripts};
use rules::script::list_shipped_scripts;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// Writes a file whose time differs from the one before, also where the file system counts in whole seconds.
fn write(directory: &Path, name: &str, text: &str) {
    let path = directory.join(name);
    fs::write(&path, text).expect("written");
    let file = fs::File::options().write(true).open(&path).expect("there");
    file.set_modified(std::time::SystemTime::now() + Duration::from_secs(text.len() as u64)).expect("set");
}

fn newest(reloader: &Reloader, host: &mut Host) -> Result<usize, Vec<ScriptProblem>> {
    let began = Instant::now();
    loop {
        if let Some(outcome) = reloader.apply_found_scripts(host) {
            return outcome.map(|reloaded| reloaded.count);
        }
        assert!(began.elapsed() < Duration::from_secs(20), "nothing was noticed");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn the_first_start_delivers_and_later_ones_respect_what_the_user_did() {
    let directory = tempfile::tempdir().expect("a directory");
    let scripts = directory.path().join("scripts");
    let names: Vec<String> = list_shipped_scripts().into_iter().map(|file| file.name).collect();
    assert_eq!(write_shipped_scripts(&scripts).expect("written").written, names);
    assert_eq!(read_directory(&scripts).expect("readable"), list_shipped_scripts());
    assert_eq!(
        write_shipped_scripts(&scripts).expect("written"),
        Default::default(),
        "nothing to do at the second start"
    );

    fs::write(scripts.join("energy.rhai"), "// mine").expect("written");
    fs::remove_file(scripts.join("alarms.rhai")).expect("removed");
    assert_eq!(
        write_shipped_scripts(&scripts).expect("written"),
        Default::default(),
        "edited and deleted scripts are the user's"
    );

    // As after an upgrade: another version had been delivered before.
    let list = fs::read_to_string(scripts.join(".shipped")).expect("there");
    let older: String = list.lines().map(|line| format!("{}1234567890abcdef\n", &line[..line.len() - 16])).collect();
    fs::write(scripts.join(".shipped"), older).expect("written");
    let furnished = write_shipped_scripts(&scripts).expect("written");
    assert_eq!(furnished.beside, ["energy.rhai.new"], "the edited one gets its new version beside it");
    assert!(furnished.written.is_empty() && !scripts.join("alarms.rhai").exists());
    assert_eq!(fs::read_to_string(scripts.join("energy.rhai")).expect("there"), "// mine");
}

#[test]
fn an_older_version_that_nobody_edited_is_replaced() {
    let directory = tempfile::tempdir().expect("a directory");
    write_shipped_scripts(directory.path()).expect("written");
    fs::write(directory.path().join("state.rhai"), "// older").expect("written");
    let digest = "// older"
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    let list = fs::read_to_string(directory.path().join(".shipped")).expect("there");
    let line = |line: &str| {
        if line.starts_with("state.rhai") { format!("state.rhai {digest:016x}\n") } else { format!("{line}\n") }
    };
    fs::write(directory.path().join(".shipped"), list.lines().map(line).collect::<String>()).expect("written");
    assert_eq!(write_shipped_scripts(directory.path()).expect("written").written, ["state.rhai"]);
    assert_eq!(read_directory(directory.path()).expect("readable"), list_shipped_scripts());
}

#[test]
fn a_change_is_taken_when_it_has_stood_still() {
    let directory = tempfile::tempdir().expect("a directory");
    write(directory.path(), "a.rhai", "let x = 1;");
    let mut watch = Watch::new(directory.path());
    assert!(watch.look_for_changes(false).is_some_and(Result::is_ok), "the first look takes everything");
    assert!(watch.look_for_changes(false).is_none());
    write(directory.path(), "a.rhai", "let x = 12;");
    assert!(watch.look_for_changes(false).is_none(), "perhaps the editor is still writing");
    write(directory.path(), "a.rhai", "let x = 123;");
    assert!(watch.look_for_changes(false).is_none());
    let files = watch.look_for_changes(false).expect("it stands still").clone().expect("readable");
    assert_eq!(files, [file("a.rhai", "let x = 123;")]);
    assert!(watch.look_for_changes(false).is_none());
    assert!(watch.look_for_changes(true).is_some(), "asked, it looks at once");
    write(directory.path(), "notes.txt", "not a script");
    assert!(watch.look_for_changes(false).is_none() && watch.look_for_changes(false).is_none());
    fs::write(directory.path().join("b.rhai"), [0xff, 0xfe]).expect("written");
    watch.look_for_changes(false);
    let problems = watch.look_for_changes(false).expect("changed").clone().expect_err("not UTF-8");
    assert!(told(&problems).contains("save the file as UTF-8"), "{}", told(&problems));
}

#[test]
fn a_running_host_follows_the_directory_and_keeps_the_last_good_scripts() {
    let directory = tempfile::tempdir().expect("a directory");
    write(directory.path(), "a.rhai", "request_feed_override(90, \"first\");");
    let mut host = Host::new();
    assert_eq!(load_now(directory.path(), None, &mut host), Ok(1));
    let reloader = Reloader::start(directory.path(), None, true).expect("a thread");
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));

    std::thread::sleep(Duration::from_millis(100));
    write(directory.path(), "a.rhai", "request_feed_override(80, \"second, longer\");");
    assert_eq!(newest(&reloader, &mut host), Ok(1));
    assert_eq!(request(&mut host, 0.1, &[]), Some(80.0));

    write(directory.path(), "b.rhai", "request_feed_override(70, ");
    let problems = newest(&reloader, &mut host).expect_err("it does not compile");
    assert_eq!(problems[0].file, "b.rhai");
    assert_eq!(request(&mut host, 0.2, &[]), Some(80.0), "the last good set stays in charge");
    assert_eq!(host.status().refused, problems, "and this is said");

    write(directory.path(), "b.rhai", "request_feed_override(70, \"mended\");");
    assert_eq!(newest(&reloader, &mut host), Ok(2));
    assert_eq!(request(&mut host, 0.3, &[]), Some(70.0));
    assert!(host.status().is_healthy());

    reloader.request_look();
    assert_eq!(newest(&reloader, &mut host), Ok(2), "asked, it compiles what has not changed too");
}

#[test]
fn a_directory_that_is_gone_is_told_and_changes_nothing() {
    let mut host = host("request_feed_override(90, \"good\");");
    let problems = load_now(Path::new("/nowhere/scripts"), None, &mut host).expect_err("it is not there");
    assert!(told(&problems).contains("name another one as `directory` under [scripts]"), "{}", told(&problems));
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));
}

#[test]
fn a_start_with_a_broken_file_puts_the_others_in_charge_and_with_none_left_the_shipped_ones() {
    let directory = tempfile::tempdir().expect("a directory");
    write(directory.path(), "a.rhai", "request_feed_override(90, \"good\");");
    write(directory.path(), "b.rhai", "request_feed_override(70, ");
    let mut host = Host::new();
    let problems = load_now(directory.path(), None, &mut host).expect_err("b does not compile");
    assert_eq!(load_rest((directory.path(), None), None, &problems, &mut host), Fallback::Others(1));
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));
    assert_eq!(host.status().refused, problems, "and this is said");

    fs::write(directory.path().join("c.rhai"), [0xff, 0xfe]).expect("written");
    let mut host = Host::new();
    let unreadable = load_now(directory.path(), None, &mut host).expect_err("c is no text");
    assert_eq!(
        load_rest((directory.path(), None), None, &unreadable, &mut host),
        Fallback::Others(1),
        "a, and neither b nor c"
    );
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));
    fs::remove_file(directory.path().join("c.rhai")).expect("removed");

    let last = compile_scripts(&[file("a.rhai", "request_feed_override(95, \"before\");")]).expect("it compiles");
    assert_eq!(load_rest((directory.path(), None), Some(last), &problems, &mut host), Fallback::Last(1));
    assert_eq!(request(&mut host, 0.1, &[]), Some(95.0), "what was in charge before goes first");

    fs::remove_file(directory.path().join("a.rhai")).expect("removed");
    let mut host = Host::new();
    let problems = load_now(directory.path(), None, &mut host).expect_err("b does not compile");
    assert_eq!(load_rest((directory.path(), None), None, &problems, &mut host), Fallback::Shipped);
    assert_eq!(host.status().scripts.len(), list_shipped_scripts().len());
    assert!(!host.status().is_healthy());
}
