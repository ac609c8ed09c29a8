//! Orders from the command line of the same box.

use super::{ANSWER_WITHIN, LINE_MAX, Order, Reply, socket_path};
use gateway_base::cannot_run::CannotRun;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// Orders, and waits for the answer.
///
/// # Errors
/// Nobody runs there, or it belongs to another user.
pub fn send_order(data_dir: &Path, order: &Order) -> Result<Reply, CannotRun> {
    let path = socket_path(data_dir);
    let stream = UnixStream::connect(&path).map_err(|error| unreachable_gateway(&path, &error))?;
    exchange_order(stream, order).map_err(|error| {
        CannotRun::new(format!("{}: no answer: {error}", path.display()), "look at the log of the gateway")
    })
}

fn exchange_order(mut stream: UnixStream, order: &Order) -> io::Result<Reply> {
    stream.set_read_timeout(Some(ANSWER_WITHIN + Duration::from_secs(2)))?;
    writeln!(stream, "{}", serde_json::to_string(order)?)?;
    let mut line = String::new();
    BufReader::new(stream.take(LINE_MAX)).read_line(&mut line)?;
    Ok(serde_json::from_str(&line)?)
}

fn unreachable_gateway(path: &Path, error: &io::Error) -> CannotRun {
    let what = format!("{}: no gateway can be reached there: {error}", path.display());
    let next = match error.kind() {
        io::ErrorKind::PermissionDenied => "give the order as the user that the gateway runs as",
        _ => "start the gateway, or name its data directory with --data-dir or its configuration with --config",
    };
    CannotRun::new(what, next)
}
