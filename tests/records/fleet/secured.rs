//! TLS to a real PostgreSQL: rows arrive over it, and a server that is not the right one gets nothing.

use crate::fleet::postgres::Postgres;
use crate::outputs::certificates::Certificates;
use testkit::box_under_test::Sending;
use testkit::nats_cluster::Cluster;
use testkit::process::{run, stderr, stdout};

/// A server that takes nobody over the network without TLS, and the user `cert` only with a client certificate.
const HBA: &str =
    "local all all trust\nhostssl all cert 127.0.0.1/32 cert map=any\nhostssl all all 127.0.0.1/32 trust\n";

fn server(certificates: &Certificates, certificate: &str) -> Option<Postgres> {
    let (pem, key, ca) = (
        certificates.path(&format!("{certificate}.pem")),
        certificates.path(&format!("{certificate}.key")),
        certificates.path("ca.pem"),
    );
    let files = [(pem.as_path(), "server.crt"), (key.as_path(), "server.key"), (ca.as_path(), "root.crt")];
    let rules = |data: &std::path::Path| {
        std::fs::write(data.join("pg_hba.conf"), HBA).expect("writable");
        std::fs::write(data.join("pg_ident.conf"), "any box cert\n").expect("writable");
    };
    Postgres::with(&files, rules, &["ssl=on", "ssl_ca_file=root.crt"])
}

/// What `fleet ingest --once` says, and whether it could.
fn ingest(cluster: &Cluster, database: &str) -> (bool, String) {
    let said = run(&[
        "fleet",
        "ingest",
        &format!("{}/cnc", cluster.address()),
        "--max-gb",
        "1",
        "--once",
        "--database",
        database,
    ]);
    let text = format!("{}{}", stdout(&said), stderr(&said));
    println!("{}", text.trim());
    (said.status.success(), text)
}

#[test]
fn rows_arrive_over_tls_and_a_server_that_is_not_the_right_one_gets_nothing() {
    let Some(certificates) = Certificates::make() else { return };
    let Some(cluster) = Cluster::start(1) else { return };
    let Some(postgres) = server(&certificates, "broker") else { return };
    let made = run(&["fleet", "stream", &format!("{}/cnc", cluster.address()), "--max-gb", "1"]);
    assert!(made.status.success(), "{}", stderr(&made));
    let mut sending = Sending::fast(&format!("{}/cnc", cluster.address()));
    sending.wait_sink("some are delivered", |sink| sink["delivered"].as_u64() > Some(200));
    sending.stop();
    let ca = certificates.text("ca.pem");
    let with = |user: &str, keys: &str| postgres.address_of(user, "localhost", keys);
    let refused = [
        (with("postgres", ""), "pg_hba.conf"),
        (
            with("postgres", &format!("?ca={}", certificates.text("stranger.pem"))),
            "signed by nobody that is trusted here",
        ),
        (with("postgres", "?ca=/does/not/exist"), "/does/not/exist cannot be read"),
        (with("cert", &format!("?ca={ca}")), "certificate"),
    ];
    for (address, part) in refused {
        let (done, text) = ingest(&cluster, &address);
        assert!(!done && text.contains(part), "{address}: {part:?} is missing in: {text}");
        assert_eq!(postgres.sql("SELECT to_regclass('items') IS NULL"), "t", "nothing was created");
    }
    let (done, text) = ingest(&cluster, &with("postgres", &format!("?ca={ca}")));
    assert!(done, "{text}");
    let rows = postgres.number("SELECT count(*) FROM items");
    assert_eq!(postgres.number("SELECT max(sequence) FROM items"), rows);
    assert!(rows > 200, "{rows}");
    postgres.sql("CREATE ROLE cert LOGIN SUPERUSER");
    let own = format!("?ca={ca}&cert={}&key={}", certificates.text("box.pem"), certificates.text("box.key"));
    let (done, text) = ingest(&cluster, &with("cert", &own));
    assert!(done, "the client certificate signs in: {text}");
    println!("{rows} rows over TLS");
}

#[test]
fn a_certificate_of_another_host_and_a_server_without_tls_are_refused() {
    let Some(certificates) = Certificates::make() else { return };
    let Some(cluster) = Cluster::start(1) else { return };
    let keys = format!("?ca={}", certificates.text("ca.pem"));
    let Some(other) = server(&certificates, "other") else { return };
    let (done, text) = ingest(&cluster, &other.address_of("postgres", "localhost", &keys));
    assert!(!done && text.contains("belongs to another host"), "{text}");
    let Some(plain) = Postgres::start() else { return };
    let (done, text) = ingest(&cluster, &plain.address_of("postgres", "localhost", &keys));
    assert!(!done && text.contains("does not support TLS"), "{text}");
}
