//! `shdr://HOST:7878`: an adapter of MTConnect. The box listens, agents connect and read lines (SHDR).
//!
//! An agent that connects is told everything first, then what changes. Missing values are `UNAVAILABLE`; alarms are conditions by their
//! kind; each tool that comes into use is an asset. `* PING` is answered, so that both sides find a broken line.
//! `cnc-gateway devices` writes the `devices.xml` that belongs to these lines. What an agent is told has times from that of its
//! connection on, and they never go back.
//!
//! The protocol has no way to say that something is old: what happened while no agent was connected is not sent later
//! (it is in the history). An agent that reads too slowly is disconnected and begins anew.

mod conditions;
mod devices;
mod lines;
mod model;

pub use devices::{Described, DevicesError, devices_xml, is_prefix, prefix_of};

use super::listen::listen_on;
use super::{Batch, Pending, Sink, SinkError};
use crate::target_error::TargetError;
use adapter_core::address::{Endpoint, Keys, parse_endpoint};
use adapter_core::clock::TimeNs;
use gateway_base::clock;
use gateway_history::Outbox;
use lines::{Line, Machine, format_lines};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::broadcast::{self, error::RecvError};
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::timeout;

/// Port that agents expect.
const PORT: u16 = 7878;
/// Agents at the same time.
const AGENTS_MAX: usize = 16;
/// Lines that may wait for an agent, in batches.
const WAITING_MAX: usize = 256;
/// An agent that takes nothing for so long is gone.
const WRITE_WITHIN: Duration = Duration::from_secs(10);
/// Longest line that an agent may send.
const LINE_MAX: u64 = 1024;

/// Where the box listens.
#[derive(Debug, Clone, PartialEq)]
pub struct ShdrTarget {
    /// The address of the box on the agents' network, and the port.
    pub at: Endpoint,
    /// Time between two signs of life that agents are told to ask for.
    pub heartbeat: Duration,
}

impl ShdrTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys) -> Result<Self, TargetError> {
        let heartbeat = Duration::from_secs(keys.take_number("heartbeat_s", 10, 1, 600));
        let at = parse_endpoint(body, Some(PORT)).map_err(TargetError::Host)?;
        Ok(Self { at, heartbeat })
    }
}

/// What all agents share.
#[derive(Debug)]
struct AgentContext {
    machine: Mutex<Machine>,
    lines: broadcast::Sender<Arc<[Line]>>,
    heartbeat_ms: u128,
}

pub(super) struct ShdrSink {
    target: ShdrTarget,
    outbox: Outbox,
    context: Option<Arc<AgentContext>>,
    listening: Option<AbortHandle>,
}

impl ShdrSink {
    pub(super) fn new(target: ShdrTarget, outbox: &Outbox) -> Self {
        Self { target, outbox: outbox.clone(), context: None, listening: None }
    }

    fn stop(&mut self) {
        if let Some(listening) = self.listening.take() {
            listening.abort();
        }
        self.context = None;
    }

    async fn start_listening(&mut self) -> Result<(), SinkError> {
        self.stop();
        let listener = listen_on(&self.target.at).await?;
        let at_ns = self.outbox.watch_head().borrow().newest_ns.unwrap_or(0);
        let machine = Machine::new(&self.outbox.device_name(), &self.outbox.latest_readings(), at_ns);
        let shared = Arc::new(AgentContext {
            machine: Mutex::new(machine),
            lines: broadcast::Sender::new(WAITING_MAX),
            heartbeat_ms: self.target.heartbeat.as_millis(),
        });
        self.listening = Some(tokio::spawn(accept_agents(listener, shared.clone())).abort_handle());
        self.context = Some(shared);
        Ok(())
    }
}

/// Takes agents on; they end with it.
async fn accept_agents(listener: TcpListener, shared: Arc<AgentContext>) {
    let mut agents = JoinSet::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        while agents.try_join_next().is_some() {}
        if agents.len() < AGENTS_MAX {
            agents.spawn(serve_agent(stream, shared.clone()));
        }
    }
}

/// One agent, until it goes or is too slow. What is wrong with it concerns nobody else.
async fn serve_agent(stream: TcpStream, shared: Arc<AgentContext>) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    let (reading, mut writing) = stream.into_split();
    let (greeting, mut lines) = {
        let machine = shared.machine.lock().unwrap_or_else(PoisonError::into_inner);
        (machine.build_initial_lines(clock::now_ns()), shared.lines.subscribe())
    };
    let mut least_ns = TimeNs::MIN;
    write_text(&mut writing, &format_lines(&greeting, &mut least_ns)).await?;
    let mut asked = BufReader::new(tokio::io::AsyncReadExt::take(reading, LINE_MAX));
    let mut question = String::new();
    loop {
        tokio::select! {
            read = asked.read_line(&mut question) => {
                if read? == 0 {
                    return Ok(());
                }
                asked.get_mut().set_limit(LINE_MAX);
                if question.trim() == "* PING" {
                    write_text(&mut writing, &format!("* PONG {}\n", shared.heartbeat_ms)).await?;
                }
                question.clear();
            }
            line = lines.recv() => match line {
                Ok(lines) => write_text(&mut writing, &format_lines(&lines, &mut least_ns)).await?,
                Err(RecvError::Lagged(_) | RecvError::Closed) => return Ok(()),
            },
        }
    }
}

async fn write_text(writing: &mut (impl AsyncWriteExt + Unpin), text: &str) -> std::io::Result<()> {
    timeout(WRITE_WITHIN, writing.write_all(text.as_bytes())).await.map_err(std::io::Error::from)?
}

impl Sink for ShdrSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.start_listening())
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        let Some(shared) = &self.context else {
            return Box::pin(std::future::ready(Err(SinkError::failed_line("the box does not listen", ""))));
        };
        // An agent that connects meanwhile gets each line once: in its greeting or after it.
        let mut machine = shared.machine.lock().unwrap_or_else(PoisonError::into_inner);
        let lines: Arc<[Line]> = batch.items.iter().flat_map(|item| machine.build_item_lines(item)).collect();
        if !lines.is_empty() {
            // Without an agent nobody hears it.
            let _agents = shared.lines.send(lines);
        }
        Box::pin(std::future::ready(Ok(())))
    }

    fn probe_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move { listen_on(&self.target.at).await.map(drop) })
    }

    fn close(&mut self) -> Pending<'_, ()> {
        self.stop();
        Box::pin(std::future::ready(()))
    }

    fn takes_history(&self) -> bool {
        false
    }
}
