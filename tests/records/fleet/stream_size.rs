//! The size of a stream that nobody says, on a server with less room.

use testkit::nats_cluster::Cluster;
use testkit::process::{run, stderr, stdout, text};

#[test]
fn a_stream_of_no_stated_size_takes_what_the_server_has() {
    let directory = tempfile::tempdir().expect("a directory");
    let lines = format!("jetstream {{ store_dir: \"{}\", max_file_store: 3GB }}", text(directory.path()));
    let Some(cluster) = Cluster::with(1, &lines) else { return };
    let address = format!("{}/cnc", cluster.address());
    let stated = run(&["fleet", "stream", &address, "--max-gb", "10"]);
    assert!(!stated.status.success() && stderr(&stated).contains("10047"), "{}", stderr(&stated));
    let made = run(&["fleet", "stream", &address]);
    assert!(stdout(&made).contains("at most 2.5 GB on each"), "{}{}", stdout(&made), stderr(&made));
}
