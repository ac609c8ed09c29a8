//! A page that other computers can reach: over TLS, and for persons only; checked with curl as a client that is not ours.

use super::client::testbed;
use std::process::{Command, Output};
use std::time::Duration;
use testkit::process::{program, stderr, text, wait_for};

fn curl(arguments: &[&str]) -> Output {
    Command::new("curl")
        .args(["--silent", "--show-error", "--max-time", "10"])
        .args(arguments)
        .output()
        .expect("curl runs")
}

#[test]
fn another_address_than_loopback_needs_tls_and_tokens() {
    let directory = tempfile::tempdir().expect("a directory");
    for more in [&[][..], &[("HTTP__TLS", "true")], &[("HTTP__TOKENS", "always")]] {
        let mut command = program();
        command.args(["run", "--data-dir", text(directory.path()), "--listen", "0.0.0.0:0", "--for", "1"]);
        command.envs(more.iter().map(|(key, value)| (format!("CNC_GATEWAY__{key}"), *value)));
        let told = command.output().expect("it runs");
        assert_eq!(told.status.code(), Some(2), "{more:?}");
        assert!(
            stderr(&told).contains("needs TLS and tokens") && stderr(&told).contains("tls = true"),
            "{}",
            stderr(&told)
        );
    }
}

#[test]
fn over_tls_everybody_signs_in_and_the_certificate_is_made_once() {
    if Command::new("curl").arg("--version").output().is_err() {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "no curl: install the package of this name");
        return eprintln!("SKIPPED: no curl here");
    }
    let mut testbed = testbed("tls = true\ntokens = \"always\"\nallow_hosts = \"gateway.local\"\n");
    let certificate = testbed.directory.path().join("data/tls/certificate.pem");
    let fingerprint = testbed.gateway.wait_said("SHA-256 fingerprint");
    let port = testbed.address.rsplit(':').next().expect("a port").to_owned();
    let base = format!("https://127.0.0.1:{port}");
    let resolve = format!("gateway.local:{port}:127.0.0.1");
    let trusted = ["--cacert", text(&certificate), "--resolve", &resolve];
    let ask = |arguments: &[&str]| {
        let told = curl(&[&trusted[..], &["--write-out", "\n%{http_code} %{redirect_url}"], arguments].concat());
        assert!(told.status.success(), "{}", stderr(&told));
        String::from_utf8_lossy(&told.stdout).into_owned()
    };
    wait_for("an answer", Duration::from_secs(20), || {
        ask(&[&format!("{base}/healthz")]).ends_with("200 ").then_some(())
    });
    assert!(ask(&[&format!("{base}/api/v1/status")]).ends_with("401 "), "reading needs a person");
    let sent_on = ask(&["--header", "Accept: text/html", &format!("{base}/")]);
    assert!(sent_on.ends_with(&format!("303 {base}/sign-in?next=/")), "{sent_on}");
    assert!(ask(&[&format!("https://gateway.local:{port}/healthz")]).ends_with("200 "), "a name that is allowed");
    let bearer = format!("Authorization: Bearer admin:{}", testbed.token);
    assert!(ask(&["--header", &bearer, &format!("{base}/metrics")]).contains("cncgw_ticks_total"));
    let jar = testbed.directory.path().join("cookies");
    let body = format!("{{\"name\":\"admin\",\"token\":\"{}\"}}", testbed.token);
    let json = ["--header", "Content-Type: application/json", "--cookie-jar", text(&jar), "--data", &body];
    let signed = ask(&[&json[..], &[&format!("{base}/api/v1/login")]].concat());
    assert!(signed.ends_with("200 "), "{signed}");
    let cookies = std::fs::read_to_string(&jar).expect("cookies");
    assert!(cookies.contains("__Host-cnc_gateway") && cookies.contains("TRUE"), "{cookies}");
    assert!(ask(&["--cookie", text(&jar), &format!("{base}/api/v1/status")]).ends_with("200 "));
    let plain = curl(&[&format!("http://127.0.0.1:{port}/healthz")]);
    assert!(!plain.status.success(), "nothing is answered in clear");
    let unknown = curl(&[&format!("{base}/healthz")]);
    assert!(!unknown.status.success(), "nobody trusts the certificate unasked");
    testbed.gateway.signal("TERM");
    assert!(testbed.gateway.wait().success());
    let (mut again, _) = super::client::started(&testbed.config);
    let told = again.wait_said("SHA-256 fingerprint");
    let digits = |line: &str| line.rsplit(' ').next().map(str::to_owned);
    assert_eq!(digits(&fingerprint), digits(&told));
    again.stop();
}
