//! What a user reads when something that they wrote is wrong: real files in, the complete text out.
//!
//! The expected texts stand beside the files in `tests/data/messages`; `UPDATE_MESSAGES=1 cargo test --test box messages::`
//! writes them anew, and the change is then read in review.

use adapters::Sample;
use gateway::config::{self, Problem};
use rules::estimators::Estimates;
use rules::script::{self, Host, ScriptFile, compile_scripts};
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/messages").join(name)
}

/// Compares `text` with the golden file `name`.
fn golden(name: &str, text: &str) {
    let path = data(name);
    if std::env::var_os("UPDATE_MESSAGES").is_some() {
        std::fs::write(&path, text).expect("the golden file can be written");
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(text == expected, "{name} differs\n--- is ---\n{text}\n--- should be ---\n{expected}");
}

fn told(problems: &[Problem]) -> String {
    problems.iter().map(|problem| format!("{problem}\n")).collect()
}

fn parse(text: &str, environment: &[(&str, &str)]) -> Result<config::Config, Vec<Problem>> {
    let pairs = environment.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
    config::parse("cnc-gateway.toml", text, Path::new(""), pairs)
}

#[test]
fn a_configuration_is_refused_with_everything_that_is_wrong() {
    let text = std::fs::read_to_string(data("config.toml")).expect("the file is there");
    golden("config.txt", &told(&parse(&text, &[]).expect_err("nothing in it is right")));
}

#[test]
fn an_operations_recipe_is_refused_with_everything_that_is_wrong() {
    let text = std::fs::read_to_string(data("operations.toml")).expect("the file is there");
    let problems = rules::operations::parse("operations.toml", &text).expect_err("little in it is right");
    golden("operations.txt", &problems.iter().map(|problem| format!("{problem}\n")).collect::<String>());
}

#[test]
fn variables_are_checked_like_the_file() {
    let problems = parse(
        config::BUILT_IN_TEXT,
        &[
            ("CNC_GATEWAY__GATEWAY__TICK_HZ", "fast"),
            ("CNC_GATEWAY__GATEWAY__TIK_HZ", "10"),
            ("CNC_GATEWAY__GATES__MODE", "off"),
            ("CNC_GATEWAY__TICK_HZ", "10"),
            ("CNC_GATEWAY__SOURCE__7__NAME", "meter"),
            ("CNC_GATEWAY__SOURCE__1__NAME", "meter"),
            ("CNC_GATEWAY__HTTP__ENABLED", "no"),
        ],
    )
    .expect_err("every variable is wrong");
    golden("environment.txt", &told(&problems));
}

#[test]
fn the_table_of_keys_and_the_example_are_the_stored_ones() {
    golden("keys.md", &config::keys::format_table());
    golden("example.toml", &config::keys::format_example());
}

#[test]
fn the_example_file_and_the_built_in_configuration_are_accepted() {
    let example = parse(&config::keys::format_example(), &[]).expect("every default is accepted");
    let built_in = parse(config::BUILT_IN_TEXT, &[]).expect("what is built in is accepted");
    assert_eq!(example.gate, built_in.gate);
    assert_eq!(built_in.gate.mode, config::GateMode::Shadow, "by default nothing is written to a machine");
    assert_eq!(built_in.http.listen, "127.0.0.1:8080", "by default reachable from this box only");
}

#[test]
fn a_missing_file_says_how_to_begin() {
    let problems = config::load(Some(Path::new("/nowhere/cnc-gateway.toml")), []).expect_err("there is none");
    assert_eq!(problems.len(), 1);
    assert!(problems[0].to_string().contains("check --example"), "{}", problems[0]);
}

#[test]
fn variables_go_before_the_file() {
    let text = "[gateway]\ntick_hz = 5\n[[source]]\naddress = \"simulated://lathe\"\n";
    let config = parse(
        text,
        &[
            ("CNC_GATEWAY__GATEWAY__TICK_HZ", "20"),
            ("CNC_GATEWAY__SOURCE__0__NAME", "lathe"),
            ("CNC_GATEWAY__SOURCE__1__ADDRESS", "simulated://mill"),
            ("PATH", "/bin"),
        ],
    )
    .expect("all of it is right");
    assert_eq!(config.gateway.tick_hz, 20.0);
    assert_eq!(config.sources.len(), 2);
    assert_eq!(config.sources[0].name, "lathe");
    assert_eq!(config.sources[1].name, "simulated://mill");
}

#[test]
fn armed_without_a_machine_to_write_to_is_refused() {
    let text = "[[source]]\naddress = \"simulated://lathe\"\n[gate]\nmode = \"armed\"\n";
    let problems = parse(text, &[]).expect_err("source is missing");
    assert_eq!(
        told(&problems),
        "cnc-gateway.toml:4:8: the gate may be armed, but `source` does not say what it writes to\n    \
         write source = ... under [gate]; there is \"simulated://lathe\"\n"
    );
}

#[test]
fn a_path_that_some_output_could_not_carry_is_refused() {
    let told_of = |lines: &str, sink: &str| {
        let text = format!("[gateway]\n{lines}\n[[source]]\naddress = \"simulated://lathe\"\n{sink}");
        told(&parse(&text, &[]).expect_err("refused"))
    };
    let word = "1 to 40 of the letters a-z, A-Z, 0-9, - and _, the first no - or _";
    assert_eq!(
        told_of("path = \"shanghai/line 2\"", ""),
        format!(
            "cnc-gateway.toml:2:8: `path = \"shanghai/line 2\"` cannot be used: \"line 2\" is no word of a path: {word}\n    for example path = \"shanghai/line-2\"\n"
        )
    );
    assert!(
        told_of("path = \"a/b/c/d/e\"", "")
            .starts_with("cnc-gateway.toml:2:8: `path = \"a/b/c/d/e\"` cannot be used: 5 words; write 1 to 4")
    );
    assert_eq!(
        told_of("name = \"车床七号\"\npath = \"shanghai\"", ""),
        format!(
            "cnc-gateway.toml:3:8: `name` is \"车床七号\", which cannot be the last word of a path\n    write machine = \"lathe-7\" under [gateway]: {word}\n"
        )
    );
    assert!(
        told_of("machine = \"lathe-7\"", "").starts_with("cnc-gateway.toml:2:11: `machine` is there without `path`")
    );
    assert!(
        told_of("pathe = \"shanghai\"", "").contains("did you mean `path`"),
        "{}",
        told_of("pathe = \"shanghai\"", "")
    );
    for sink in ["mqtt://b/works?layout=uns", "sparkplug://b"] {
        let said = told_of("", &format!("[[sink]]\naddress = \"{sink}\"\n"));
        assert!(
            said.starts_with("cnc-gateway.toml:6:11: ") && said.contains("path = \"shanghai/line-2\" under [gateway]"),
            "{said}"
        );
    }
    let near = told_of("path = \"shanghai\"", "[[sink]]\naddress = \"mqtt://b/works?layout=unz\"\n");
    assert!(near.contains("uns"), "{near}");
    let fine =
        "[gateway]\nname = \"Lathe 7\"\npath = \"shanghai/line-2\"\n[[source]]\naddress = \"simulated://lathe\"\n";
    let config = parse(fine, &[]).expect("all of it is right");
    assert_eq!(config.gateway.machine.path.map(|path| path.format_topic()), Some("shanghai/line-2/Lathe-7".to_owned()));
}

#[test]
fn two_machines_to_write_to_are_refused() {
    let sources = "[[source]]\nname = \"a\"\naddress = \"simulated://lathe\"\n[[source]]\nname = \"b\"\naddress = \"simulated://mill\"\n";
    let text = |offsets: &str| {
        format!(
            "{sources}[gate]\nmode = \"armed\"\nsource = \"a\"\n[gate.offset]\nmode = \"armed\"\naxes = \"z\"\nsource = \"{offsets}\"\n"
        )
    };
    assert!(parse(&text("a"), &[]).is_ok(), "one machine");
    let problems = parse(&text("b"), &[]).expect_err("two machines");
    assert!(
        told(&problems).starts_with("cnc-gateway.toml:13:10: offsets would be written to \"b\""),
        "{}",
        told(&problems)
    );
}

proptest::proptest! {
    #[test]
    fn no_text_makes_the_configuration_panic(
        text in "(\\[|\\]|=|\"|\n|gate|gateway|source|history|tick_hz|address|mode|[0-9.eE+-]{1,6}|true|#|\\PC){0,60}"
    ) {
        let _ = parse(&text, &[]);
    }
}

fn script(name: &str) -> ScriptFile {
    ScriptFile { name: name.to_owned(), text: std::fs::read_to_string(data(name)).expect("the file is there") }
}

#[test]
fn a_set_of_scripts_is_refused_with_everything_that_is_wrong() {
    let names = ["broken.rhai", "misspelt.rhai", "print.rhai", "settings.rhai", "settings2.rhai", "unclosed.rhai"];
    let files: Vec<ScriptFile> = names.into_iter().map(script).collect();
    let Err(problems) = compile_scripts(&files) else { panic!("it compiles") };
    golden("scripts.txt", &problems.iter().map(|problem| format!("{problem}\n")).collect::<String>());
}

#[test]
fn a_script_that_fails_while_it_runs_says_where_and_what_to_do() {
    let failing = [
        "loop {}",
        "fn f(x) { f(x) }\nf(1);",
        "let a = [1, 2];\na[5] = 1;",
        "let x = \"text\";\nlet y = x * 2.0;",
        "let x = 5 / 0;",
        "throw \"the recipe is missing\";",
        "fn f(x) { x.speed + 1.0 }\nf(3);",
        "request_feed_override(\"fast\", \"why\");",
        "alarm_above(\"a\", 5.0, 10.0, 20.0, 0.0, \"text\");",
        "let s = \"x\"; loop { s += s; }",
        "let i = 0;\nloop { alarm(`a${i}`, \"\"); i += 1; }",
        "let x = spindle_power_w / total_power_w;",
    ];
    let mut text = String::new();
    for source in failing {
        let mut host = Host::new();
        let file = ScriptFile { name: "rule.rhai".to_owned(), text: source.to_owned() };
        if let Err(problems) = host.load_scripts(&[file]) {
            let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
            text += &format!("{source}\n=> not taken: {}\n\n", problems.join("\n"));
            continue;
        }
        host.run_due_scripts(&Sample::new_empty(0), &Estimates::without_samples(0));
        let status = host.status();
        let problem = status.scripts[0].condition.problem().expect(source);
        text += &format!("{source}\n=> {}: {problem}\n\n", status.scripts[0].condition.as_word());
    }
    golden("running.txt", &text);
}

#[test]
fn the_vocabulary_lists_every_word_function_and_setting() {
    let (english, chinese) = (script::format_vocabulary(false), script::format_vocabulary(true));
    let settings = rules::estimators::SETTINGS.iter().map(|setting| setting.name);
    let functions = script::FUNCTIONS.iter().map(|function| function.signature);
    for name in script::list_words().iter().map(|word| word.name).chain(functions).chain(settings) {
        assert!(english.contains(&format!("| `{name}` |")), "{name}");
        assert!(chinese.contains(&format!("| `{name}` |")), "{name}");
    }
    assert!(chinese.contains("主轴实际转速"));
}
