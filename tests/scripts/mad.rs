//! Scripts that want everything, and what is out of their reach.

use super::*;
use rules::script::TEXT_MAX;
use std::time::{Duration, Instant};

/// Scripts that want everything: time, memory, depth.
const MAD: [(&str, &str); 19] = [
    ("endless loop", "loop {}"),
    ("endless while", "while true { let x = 1; }"),
    ("recursion", "fn f(x) { f(x + 1) } f(0);"),
    ("string growth", "let s = \"x\"; loop { s += s; }"),
    ("array growth", "let a = []; loop { a.push(a.len()); }"),
    ("array in array", "let a = [1]; loop { a = [a, a]; }"),
    ("map growth", "let i = 0; loop { memory[`k${i}`] = i; i += 1; }"),
    ("nested map growth", "memory.a = #{}; let i = 0; while i < 2000 { memory.a[`k${i}`] = i; i += 1; }"),
    ("long keys", "let s = \"\"; s.pad(1000, 'x'); let m = #{}; let i = 0; loop { m[s + i] = i; i += 1; }"),
    ("a long range", "for i in 0..1000000000 { let x = i; }"),
    ("a long range by steps", "for i in range(0, 9000000000000, 1) { let x = i; }"),
    ("padding", "let s = \"\"; s.pad(1000000000, 'x');"),
    ("array padding", "let a = []; a.pad(1000000000, 1);"),
    ("sorting for ever", "let a = []; for i in 0..120 { a.push(120 - i); } loop { let b = a; b.sort(); }"),
    ("searching for ever", "let s = \"\"; s.pad(1000, 'x'); loop { s.index_of(\"y\"); }"),
    ("copying for ever", "let a = []; a.pad(120, 1.5); loop { let b = a; }"),
    ("copying maps for ever", "let m = #{}; for i in 0..250 { m[`k${i}`] = i; } loop { let b = m; }"),
    ("alarms without end", "let i = 0; loop { alarm(`a${i}`, \"\"); i += 1; }"),
    ("timers without end", "let i = 0; loop { held_s(`a${i}`, true); i += 1; }"),
];

#[test]
fn a_mad_script_is_stopped_and_told_and_the_next_tick_runs() {
    for (what, text) in MAD {
        let mut host = Host::new();
        let good = file("good.rhai", "request_feed_override(90, \"good\");");
        host.load(&[file("mad.rhai", &format!("request_feed_override(10, \"mad\");\n{text}")), good]).expect(what);
        let began = Instant::now();
        let decision = host.tick(&sample(0.0, &[]), &Estimates::none(0)).clone();
        let took = began.elapsed();
        println!(
            "{what:24} {:8.3} ms  {}",
            took.as_secs_f64() * 1e3,
            told(&decision.problems).lines().next().unwrap_or_default()
        );
        assert_eq!(decision.problems.len(), 1, "{what} was not stopped");
        assert_eq!(decision.request.map(|request| request.pct), Some(90.0), "{what}: its request ends");
        assert!(took < Duration::from_secs(2), "{what} took {took:?}");
        assert_eq!(request(&mut host, 0.1, &[]), Some(90.0));
    }
}

#[test]
fn nothing_outside_is_in_reach() {
    for text in [
        "eval(\"1\")",
        "import \"x\" as y;",
        "print(1)",
        "debug(1)",
        "sleep(10)",
        "timestamp()",
        "rand()",
        "let f = Fn(\"sleep\"); f.call(1)",
        "open(\"/etc/passwd\")",
    ] {
        assert!(compile(&[file("x.rhai", text)]).is_err(), "{text} compiles");
    }
    let mut by_name = host("[10].map(\"sleep\");");
    assert_eq!(by_name.tick(&sample(0.0, &[]), &Estimates::none(0)).problems.len(), 1);
    let deep = format!("let x = {}1{};", "(".repeat(5000), ")".repeat(5000));
    assert!(compile(&[file("x.rhai", &deep)]).is_err());
    assert!(compile(&[file("x.rhai", &"x".repeat(TEXT_MAX + 1))]).is_err());
}

proptest::proptest! {
    #[test]
    fn no_text_makes_the_compiler_panic(
        text in "(let |if |fn |settings|alarm|memory|state|\\(|\\)|\\{|\\}|#\\{|\\[|\\]|;|=|\"|`|\\$\\{|//|[a-z]{1,3}|[0-9.]{1,4}|\\+|\\||\n|\\PC){0,40}"
    ) {
        if let Ok(set) = compile(&[file("x.rhai", &text)]) {
            let mut host = Host::new();
            host.install(set);
            host.tick(&sample(0.0, &[]), &Estimates::none(0));
        }
    }
}
