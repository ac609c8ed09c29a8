//! PostgreSQL: the tables, a partition for each day, and a batch in one transaction.

use super::SCHEMA;
use super::row::FleetRow;
use super::secured::{self, Securing};
use crate::log::{Notice, Severity};
use crate::nats::NatsError;
use adapters::tls::{TlsError, TlsFiles};
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;
use std::time::Duration;
use tokio_postgres::config::{Host, SslMode};
use tokio_postgres::tls::MakeTlsConnect;
use tokio_postgres::{Client, Config, NoTls, Socket, Transaction};

/// Of the advisory lock under which tables and partitions are created: any number that nothing else uses.
const LOCK: i64 = 0x636e_6367_7731;
/// A connection that is not made within this time is not made.
const DEADLINE: Duration = Duration::from_secs(10);

/// Which database, and how to sign in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DatabaseSettings {
    /// `postgres://USER@HOST:5432/DATABASE` or `host=... user=... dbname=...`; with `?sslmode=require` and `ca=FILE`, `cert=FILE`,
    /// `key=FILE` the line is encrypted.
    pub address: String,
    /// The file whose first line is the password.
    pub password_file: Option<PathBuf>,
}

/// What a batch did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct BatchResult {
    /// Rows that are new.
    pub new: u64,
    /// Rows that were there already.
    pub known: u64,
}

/// A connection whose tables are there.
#[derive(Debug)]
pub struct Database {
    client: Client,
    boxes: HashMap<String, i32>,
    series: HashMap<(String, String), i32>,
    days: BTreeSet<String>,
}

/// An error of the database in words.
fn words(doing: &str, error: &tokio_postgres::Error) -> NatsError {
    if let Some(tls) = tls_within(error) {
        return NatsError::new(format!("PostgreSQL, {doing}: {}", tls.what), tls.next);
    }
    let text = match error.as_db_error() {
        Some(said) => format!("{} ({})", said.message(), said.code().code()),
        None => {
            let cause = std::error::Error::source(error).map_or(String::new(), |cause| format!(": {cause}"));
            format!("{error}{cause}")
        }
    };
    let code = error.code().map(|code| code.code().to_owned()).unwrap_or_default();
    let next = match code.as_str() {
        "28P01" | "28000" => {
            "compare user, --password-file and client certificate (cert=, key=) with pg_hba.conf and the roles"
        }
        "3D000" => "create it with `createdb`, or write another name",
        "42501" => "give this user the right: GRANT CREATE, USAGE ON SCHEMA public",
        "28P02" => "sign the client certificate by the authority that ssl_ca_file of the server names",
        "53100" => "make room on the disk of the database; what waits stays in the stream",
        "" if text.contains("support TLS") => {
            "write `ssl = on` into its postgresql.conf, or leave sslmode=require, ca=, cert= and key= out"
        }
        "" => "look whether PostgreSQL runs there and listens on this address",
        _ => "look up the number in the documentation of PostgreSQL (error codes)",
    };
    NatsError::new(format!("PostgreSQL, {doing}: {text}"), next)
}

/// What TLS says, where it is the reason.
fn tls_within(error: &tokio_postgres::Error) -> Option<TlsError> {
    let cause = std::error::Error::source(error)?.downcast_ref::<std::io::Error>()?;
    TlsError::within(cause, "the database")
}

/// Is the database on this computer?
fn is_here(config: &Config) -> bool {
    config.get_hosts().iter().all(|host| match host {
        Host::Tcp(name) => ["localhost", "127.0.0.1", "::1"].contains(&name.as_str()),
        #[cfg(unix)]
        Host::Unix(_) => true,
    })
}

impl DatabaseSettings {
    fn config(&self) -> Result<(Config, Option<TlsFiles>), NatsError> {
        let (address, files) = secured::files_of(&self.address);
        let mut config: Config = address.parse().map_err(|error: tokio_postgres::Error| {
            let cause = std::error::Error::source(&error).map_or(String::new(), |cause| format!(": {cause}"));
            NatsError::new(
                format!("{:?} is no address of PostgreSQL: {error}{cause}", self.address),
                "write postgres://USER@HOST:5432/DATABASE, and ?sslmode=require for an encrypted line",
            )
        })?;
        // Without a word about it the line is plain, whatever the server offers.
        config.ssl_mode(if files.is_some() { SslMode::Require } else { SslMode::Disable });
        if let Some(file) = &self.password_file {
            let text = std::fs::read_to_string(file).map_err(|error| {
                NatsError::new(
                    format!("the password file {} cannot be read: {error}", file.display()),
                    "write another path",
                )
            })?;
            config.password(text.lines().next().unwrap_or_default());
        }
        config.connect_timeout(DEADLINE).application_name("cnc-gateway fleet ingest");
        Ok((config, files))
    }
}

const PLAIN: &str = "the line to PostgreSQL is not encrypted: write ?sslmode=require at the end of the address, or run this on the \
                     computer of the database";

async fn connect<T>(config: &Config, tls: T) -> Result<Client, NatsError>
where
    T: MakeTlsConnect<Socket> + Send,
    T::Stream: Send + 'static,
    T::TlsConnect: Send,
    <T::TlsConnect as tokio_postgres::tls::TlsConnect<Socket>>::Future: Send,
{
    let (client, connection) = config.connect(tls).await.map_err(|error| words("connecting", &error))?;
    tokio::spawn(async move {
        let _seen_by_the_next_statement = connection.await;
    });
    Ok(client)
}

impl Database {
    /// Connects, and creates what is missing.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub async fn open(settings: &DatabaseSettings) -> Result<Self, NatsError> {
        let (config, files) = settings.config()?;
        let mut client = match files {
            Some(files) => {
                let tls = files.config().map_err(|error| NatsError::new(error.what, error.next))?;
                connect(&config, Securing(tls)).await?
            }
            None => {
                if !is_here(&config) {
                    Notice::new(Severity::Warning, "database_plain", PLAIN).say();
                }
                connect(&config, NoTls).await?
            }
        };
        let creating = |error| words("creating the tables", &error);
        let transaction = client.transaction().await.map_err(creating)?;
        transaction.execute("SELECT pg_advisory_xact_lock($1)", &[&LOCK]).await.map_err(creating)?;
        let there = transaction
            .query_one("SELECT to_regclass('items') IS NOT NULL AND to_regclass('diagnoses') IS NOT NULL", &[]);
        if !there.await.map_err(creating)?.get::<_, bool>(0) {
            transaction.batch_execute(SCHEMA).await.map_err(creating)?;
        }
        transaction.commit().await.map_err(creating)?;
        let incoming = "SET client_encoding = 'UTF8'; CREATE TEMP TABLE incoming (LIKE items) ON COMMIT DELETE ROWS";
        client.batch_execute(incoming).await.map_err(creating)?;
        Ok(Self { client, boxes: HashMap::new(), series: HashMap::new(), days: BTreeSet::new() })
    }

    /// Writes the rows and notes what is no row, in one transaction.
    ///
    /// # Errors
    /// What is wrong, in words; nothing is written then.
    pub(super) async fn write(
        &mut self,
        rows: &[FleetRow],
        refused: &[(String, String, String)],
    ) -> Result<BatchResult, NatsError> {
        self.prepare_days(rows).await?;
        self.learn(rows).await?;
        let mut lines: Vec<(i32, u64, String)> = Vec::with_capacity(rows.len());
        for row in rows {
            let Some(box_id) = self.boxes.get(&row.box_name) else { continue };
            let id = |(name, unit, _): &(String, String, f64)| self.series.get(&(name.clone(), unit.clone())).copied();
            let series: Vec<i32> = row.numbers.iter().filter_map(id).collect();
            lines.push((*box_id, row.sequence, row.line(*box_id, &series)));
        }
        // Several write at a time: the same order everywhere leaves no two that wait for each other.
        lines.sort_unstable_by_key(|(box_id, sequence, _)| (*box_id, *sequence));
        let text: String = lines.iter().map(|(_, _, line)| line.as_str()).collect();
        let failed = |error| words("writing a batch", &error);
        let transaction = self.client.transaction().await.map_err(failed)?;
        let new = copy(&transaction, text).await.map_err(failed)?;
        for (subject, reason, payload) in refused {
            let insert = "INSERT INTO refused (subject, reason, payload) VALUES ($1, $2, $3)";
            transaction.execute(insert, &[subject, reason, payload]).await.map_err(failed)?;
        }
        transaction.commit().await.map_err(failed)?;
        Ok(BatchResult { new, known: lines.len() as u64 - new })
    }

    /// A partition for each day of the rows, outside the transaction of the batch: creating one stops every other writer for
    /// a moment.
    async fn prepare_days(&mut self, rows: &[FleetRow]) -> Result<(), NatsError> {
        let day = |row: &FleetRow| row.at.to_string().chars().take(10).collect::<String>();
        let wanted: BTreeSet<String> = rows.iter().map(day).collect();
        let creating = |error| words("creating the partition of a day", &error);
        for day in wanted.difference(&self.days.clone()) {
            let transaction = self.client.transaction().await.map_err(creating)?;
            transaction.execute("SELECT pg_advisory_xact_lock($1)", &[&LOCK]).await.map_err(creating)?;
            let name = format!("items_{}", day.replace('-', "_"));
            let create = format!(
                "SET LOCAL TimeZone = 'UTC'; CREATE TABLE IF NOT EXISTS {name} PARTITION OF items
                 FOR VALUES FROM ('{day} 00:00:00+00') TO (timestamptz '{day} 00:00:00+00' + interval '1 day')"
            );
            let there =
                transaction.query_one("SELECT to_regclass($1::text) IS NOT NULL", &[&name]).await.map_err(creating)?;
            if !there.get::<_, bool>(0) {
                transaction.batch_execute(&create).await.map_err(creating)?;
            }
            transaction.commit().await.map_err(creating)?;
            self.days.insert(day.clone());
        }
        Ok(())
    }

    /// The numbers of boxes and series that were not known.
    async fn learn(&mut self, rows: &[FleetRow]) -> Result<(), NatsError> {
        let failed = |error| words("naming boxes and series", &error);
        for row in rows {
            if !self.boxes.contains_key(&row.box_name) {
                let insert = "INSERT INTO boxes (box, machine) VALUES ($1, $2) ON CONFLICT (box) DO UPDATE SET machine = excluded.machine RETURNING box_id";
                let found = self.client.query_one(insert, &[&row.box_name, &row.machine]).await.map_err(failed)?;
                self.boxes.insert(row.box_name.clone(), found.get(0));
            }
            for (name, unit, _) in &row.numbers {
                let key = (name.clone(), unit.clone());
                if self.series.contains_key(&key) {
                    continue;
                }
                let insert = "INSERT INTO series (name, unit) VALUES ($1, $2) ON CONFLICT (name, unit) DO UPDATE SET unit = excluded.unit RETURNING series_id";
                let found = self.client.query_one(insert, &[name, unit]).await.map_err(failed)?;
                self.series.insert(key, found.get(0));
            }
        }
        Ok(())
    }
}

/// Rows that are new.
async fn copy(transaction: &Transaction<'_>, text: String) -> Result<u64, tokio_postgres::Error> {
    use futures_util::SinkExt;
    let mut sink = Box::pin(transaction.copy_in::<_, bytes::Bytes>("COPY incoming FROM STDIN").await?);
    sink.send(text.into()).await?;
    sink.close().await?;
    transaction.execute("INSERT INTO items SELECT * FROM incoming ON CONFLICT DO NOTHING", &[]).await
}
