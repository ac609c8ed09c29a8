//! What is wrong with a NATS server or a database is told in one sentence with the next step.

use crate::fleet::postgres::Postgres;
use std::net::TcpListener;
use testkit::nats_cluster::Cluster;
use testkit::port::free_port;
use testkit::process::{run, stderr, stdout};

fn tells(address: &str, parts: &[&str]) {
    let examined = run(&["doctor", address]);
    let text = format!("{}{}", stdout(&examined), stderr(&examined));
    println!("{}", text.trim());
    assert_eq!(examined.status.code(), Some(1), "{text}");
    assert!(text.contains("next:"), "{text}");
    for part in parts {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
}

#[test]
fn a_server_that_is_not_there_or_is_something_else_is_told_apart() {
    tells("nats://no-such-host.invalid", &["no-such-host.invalid", "name of the server"]);
    tells(&format!("nats://127.0.0.1:{}", free_port()), &["refuses the connection", "4222"]);
    let silent = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = silent.local_addr().expect("bound").port();
    tells(&format!("nats://127.0.0.1:{port}"), &["does not answer", "firewall"]);
    let other = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = other.local_addr().expect("bound").port();
    std::thread::spawn(move || {
        use std::io::Write;
        for stream in other.incoming().map_while(Result::ok) {
            let _gone = (&stream).write_all(b"SSH-2.0-OpenSSH_9.2\r\n");
        }
    });
    tells(&format!("nats://127.0.0.1:{port}"), &["does not speak NATS", "SSH-2.0"]);
}

#[test]
fn rights_and_streams_that_are_missing_are_told() {
    let Some(cluster) = Cluster::start(1) else { return };
    let address = format!("nats://127.0.0.1:{}/cnc", cluster.port());
    tells(&address, &["no stream takes the subject cnc.doctor.sample", "fleet stream"]);
    tells(&format!("natss://127.0.0.1:{}/cnc", cluster.port()), &["does not speak TLS"]);
    let made = run(&["fleet", "stream", &address, "--max-gb", "1"]);
    assert!(made.status.success() && stdout(&made).contains("created"), "{}", stderr(&made));
    let well = run(&["doctor", &address]);
    assert!(well.status.success(), "{}", stdout(&well));
    let three = run(&[
        "fleet",
        "stream",
        &format!("nats://127.0.0.1:{}/other", cluster.port()),
        "--stream",
        "X",
        "--replicas",
        "3",
        "--max-gb",
        "1",
    ]);
    assert!(three.status.code() == Some(2) && stderr(&three).contains("replicas"), "{}", stderr(&three));
    let Some(plain) = Cluster::with(1, "") else { return };
    tells(&format!("nats://127.0.0.1:{}", plain.port()), &["has no JetStream", "store_dir"]);
    let Some(closed) = Cluster::with(1, "{store}\nauthorization { user: box, password: right }") else { return };
    tells(&format!("nats://127.0.0.1:{}", closed.port()), &["Authorization Violation", "password_file="]);
    tells(&format!("nats://127.0.0.1:{}?user=box", closed.port()), &["Authorization Violation", "password_file="]);
    tells("nats://127.0.0.1?user=box&password_file=/does/not/exist", &["/does/not/exist", "cannot be read"]);
}

#[test]
fn a_database_that_cannot_be_used_is_told() {
    let database = |database: &str, part: &str| {
        let said = run(&["fleet", "ingest", "nats://127.0.0.1:4222", "--once", "--database", database]);
        let text = stderr(&said);
        println!("{}", text.trim());
        assert!(said.status.code() == Some(2) && text.contains(part), "{part}: {text}");
    };
    database(&format!("postgres://a@127.0.0.1:{}/b", free_port()), "look whether PostgreSQL runs there");
    database("no address", "write postgres://");
    let Some(postgres) = Postgres::start() else { return };
    database(&postgres.address().replace("/postgres", "/absent").replace("://absent", "://postgres"), "createdb");
}
