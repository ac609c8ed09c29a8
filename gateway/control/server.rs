//! Listens for orders and hands each to the tick, on a thread of its own: however busy the page is, an order is heard.

use super::{LINE_MAX, Order, OrderSender, Reply, socket_path};
use adapter_core::threads::reach_fault_point;
use gateway_base::log::{Notice, Severity};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::{Semaphore, oneshot};

/// Whoever connects has so long to say what he wants.
const ASK_WITHIN: Duration = Duration::from_secs(5);
/// So many are talked to at the same time.
const TALKING_MAX: usize = 16;
/// After a connection that could not be taken.
const PAUSE: Duration = Duration::from_millis(100);

/// The socket; it goes with this.
#[derive(Debug)]
pub struct Listening {
    path: PathBuf,
    /// The thread ends when this goes.
    _going_on: oneshot::Sender<()>,
}

impl Drop for Listening {
    fn drop(&mut self) {
        let _already_gone = std::fs::remove_file(&self.path);
    }
}

/// Listens in this directory. Without a socket the box goes on; it cannot be armed then, and says so.
#[must_use]
pub fn listen_for_orders(data_dir: &Path, orders: OrderSender) -> Option<Listening> {
    let path = socket_path(data_dir);
    match bind_socket(&path).and_then(|listener| start_thread(listener, orders)) {
        Ok(going_on) => Some(Listening { path, _going_on: going_on }),
        Err(error) => {
            let text =
                format!("{}: no orders can be taken there ({error}), so the gate cannot be armed", path.display());
            Notice::new(Severity::Warning, "no_control_socket", text).write_to_logs();
            None
        }
    }
}

/// The thread that listens; it ends when what is given is dropped.
fn start_thread(listener: std::os::unix::net::UnixListener, post: OrderSender) -> io::Result<oneshot::Sender<()>> {
    let (going_on, over) = oneshot::channel::<()>();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let listen = move || {
        runtime.block_on(async {
            let Ok(listener) = UnixListener::from_std(listener) else { return };
            tokio::select! {
                () = accept_orders(listener, post) => {}
                _ = over => {}
            }
        });
    };
    std::thread::Builder::new().name("control".to_owned()).spawn(listen)?;
    Ok(going_on)
}

/// Takes one order after another; whoever comes while too many are being talked to waits for his turn.
async fn accept_orders(listener: UnixListener, post: OrderSender) {
    let room = Arc::new(Semaphore::new(TALKING_MAX));
    loop {
        let Ok(place) = room.clone().acquire_owned().await else { return };
        match listener.accept().await {
            Ok((stream, _)) => {
                reach_fault_point("control");
                let post = post.clone();
                tokio::spawn(async move {
                    answer_order(stream, &post).await;
                    drop(place);
                });
            }
            // The process is short of files for a moment; a disarming must not fail for that.
            Err(_) => tokio::time::sleep(PAUSE).await,
        }
    }
}

/// Nobody else may ever open it: the file gets its place only when its mode is right. One that a killed gateway has left is
/// replaced; the history's lock has kept a second gateway away by then.
fn bind_socket(path: &Path) -> io::Result<std::os::unix::net::UnixListener> {
    let fresh = path.with_extension(format!("{}.sock", std::process::id()));
    let _left_behind = std::fs::remove_file(&fresh);
    let listener = std::os::unix::net::UnixListener::bind(&fresh)?;
    listener.set_nonblocking(true)?;
    let placed = std::fs::set_permissions(&fresh, std::fs::Permissions::from_mode(0o600))
        .and_then(|()| std::fs::rename(&fresh, path));
    placed.inspect_err(|_| {
        let _unplaced = std::fs::remove_file(&fresh);
    })?;
    Ok(listener)
}

async fn answer_order(mut stream: UnixStream, post: &OrderSender) {
    let user = stream.peer_cred().ok().map(|peer| peer.uid());
    let reply = match tokio::time::timeout(ASK_WITHIN, read(&mut stream)).await {
        Ok(Ok(line)) => forward_order(&line, user, post).await,
        Ok(Err(error)) => Reply::from_refusal(format!("the order could not be read: {error}")),
        Err(_) => Reply::from_refusal("nothing was ordered"),
    };
    let line = serde_json::to_string(&reply).unwrap_or_default() + "\n";
    let _gone = stream.write_all(line.as_bytes()).await;
}

async fn read(stream: &mut UnixStream) -> io::Result<String> {
    let mut line = String::new();
    BufReader::new(stream.take(LINE_MAX)).read_line(&mut line).await?;
    Ok(line)
}

async fn forward_order(line: &str, user: Option<u32>, post: &OrderSender) -> Reply {
    match serde_json::from_str::<Order>(line) {
        Ok(order) => post.send_order(order.of_user(user)).await,
        Err(error) => Reply::from_refusal(format!("this is no order: {error}")),
    }
}
