//! PostgreSQL: the address, the connection, and what it says in words.

use super::schema;
use super::tls_connection::{self, Securing};
use device_line::tls::{TlsError, TlsFiles};
use gateway_base::log::{Notice, Severity};
use gateway_nats::NatsError;
use std::path::PathBuf;
use std::time::Duration;
use tokio_postgres::config::{Host, SslMode};
use tokio_postgres::tls::MakeTlsConnect;
use tokio_postgres::{Client, Config, NoTls, Socket};

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

/// What went wrong with a statement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct DatabaseError {
    pub(super) said: NatsError,
    /// The database does not take these data; without them it would go on.
    pub(super) of_the_data: bool,
}

impl From<DatabaseError> for NatsError {
    fn from(error: DatabaseError) -> Self {
        error.said
    }
}

/// Classes of SQLSTATE that say something of the data: wrong values, constraints, cardinality, a limit of the program such as the
/// greatest row of an index.
const OF_THE_DATA: [&str; 5] = ["21", "22", "23", "54", "0A"];

impl DatabaseError {
    pub(super) fn new(doing: &str, error: &tokio_postgres::Error) -> Self {
        let of_the_data =
            error.code().is_some_and(|code| OF_THE_DATA.iter().any(|class| code.code().starts_with(class)));
        Self { said: describe_error(doing, error), of_the_data }
    }
}

/// An error of the database in words.
fn describe_error(doing: &str, error: &tokio_postgres::Error) -> NatsError {
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
        "" => ConnectFailure::from_words(&text).next_step(),
        _ => "look up the number in the documentation of PostgreSQL (error codes)",
    };
    NatsError::new(format!("PostgreSQL, {doing}: {text}"), next)
}

/// Why there is no connection, where the server gives no SQLSTATE. The library tells these apart by the words of its error alone;
/// a test holds them against a server, so that another version of it cannot change them unnoticed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ConnectFailure {
    PasswordMissing,
    WithoutTls,
    Other,
}

impl ConnectFailure {
    fn from_words(text: &str) -> Self {
        const WORDS: [(&str, ConnectFailure); 2] =
            [("password missing", ConnectFailure::PasswordMissing), ("support TLS", ConnectFailure::WithoutTls)];
        WORDS.iter().find(|(words, _)| text.contains(words)).map_or(Self::Other, |(_, failure)| *failure)
    }

    fn next_step(self) -> &'static str {
        match self {
            Self::PasswordMissing => {
                "the server asks for a password: write it into a file that only this user may read, and give --password-file FILE"
            }
            Self::WithoutTls => {
                "write `ssl = on` into its postgresql.conf, or leave sslmode=require, ca=, cert= and key= out"
            }
            Self::Other => "look whether PostgreSQL runs there and listens on this address",
        }
    }
}

/// What TLS says, where it is the reason.
fn tls_within(error: &tokio_postgres::Error) -> Option<TlsError> {
    let cause = std::error::Error::source(error)?.downcast_ref::<std::io::Error>()?;
    TlsError::from_io_error(cause, "the database")
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
    fn parse_config(&self) -> Result<(Config, Option<TlsFiles>), NatsError> {
        let (address, files) = tls_connection::files_of(&self.address);
        let mut config: Config = address.parse().map_err(|error: tokio_postgres::Error| {
            let cause = std::error::Error::source(&error).map_or(String::new(), |cause| format!(": {cause}"));
            NatsError::new(
                format!(
                    "{:?} is no address of PostgreSQL: {error}{cause}",
                    adapters::address::mask_secrets(&self.address)
                ),
                "write postgres://USER@HOST:5432/DATABASE, and ?sslmode=require for an encrypted line",
            )
        })?;
        if config.get_password().is_some() {
            return Err(NatsError::new(
                "a password does not stand in the address of the database, because whoever lists the processes reads it",
                "write it into a file that only this user may read, and give --password-file FILE",
            ));
        }
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
        config.connect_timeout(DEADLINE).application_name("cnc-gateway fleet");
        Ok((config, files))
    }
}

const PLAIN: &str = "the line to PostgreSQL is not encrypted: write ?sslmode=require at the end of the address, or run this on the \
                     computer of the database";

async fn connect_with<T>(config: &Config, tls: T) -> Result<Client, NatsError>
where
    T: MakeTlsConnect<Socket> + Send,
    T::Stream: Send + 'static,
    T::TlsConnect: Send,
    <T::TlsConnect as tokio_postgres::tls::TlsConnect<Socket>>::Future: Send,
{
    let (client, connection) = config.connect(tls).await.map_err(|error| describe_error("connecting", &error))?;
    tokio::spawn(async move {
        let _seen_by_the_next_statement = connection.await;
    });
    Ok(client)
}

/// Connects, and brings the tables to the newest version.
///
/// # Errors
/// What is wrong, in words.
pub(super) async fn connect(settings: &DatabaseSettings) -> Result<(Client, schema::Partitioning), NatsError> {
    let (config, files) = settings.parse_config()?;
    let mut client = match files {
        Some(files) => {
            let tls = files.build_config().map_err(|error| NatsError::new(error.what, error.next))?;
            connect_with(&config, Securing(tls)).await?
        }
        None => {
            if !is_here(&config) {
                Notice::new(Severity::Warning, "database_plain", PLAIN).write_to_logs();
            }
            connect_with(&config, NoTls).await?
        }
    };
    let settings = "SET client_encoding = 'UTF8'; SET TimeZone = 'UTC'; SET client_min_messages = warning";
    client.batch_execute(settings).await.map_err(|error| describe_error("connecting", &error))?;
    let partitioning = schema::bring_up(&mut client).await?;
    Ok((client, partitioning))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    /// What is told of a server that answers the first message of a connection with this.
    async fn connect_to(answer: &'static [u8], parameters: &str) -> NatsError {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let port = listener.local_addr().expect("bound").port();
        tokio::spawn(async move {
            let (mut stream, _) = listener.accept().await.expect("a client");
            let _first_message = stream.read(&mut [0; 1024]).await;
            let _client_has_gone = stream.write_all(answer).await;
            let _until_it_leaves = stream.read(&mut [0; 1024]).await;
        });
        let address = format!("postgres://plant@127.0.0.1:{port}/plant{parameters}");
        connect(&DatabaseSettings { address, password_file: None }).await.expect_err("refused")
    }

    #[tokio::test]
    async fn what_the_library_says_of_passwords_and_tls_is_known() {
        // AuthenticationCleartextPassword; and what a server says that has no TLS.
        let asked = connect_to(b"R\0\0\0\x08\0\0\0\x03", "").await;
        assert_eq!(asked.next, ConnectFailure::PasswordMissing.next_step(), "{}", asked.what);
        let plain = connect_to(b"N", "?sslmode=require").await;
        assert_eq!(plain.next, ConnectFailure::WithoutTls.next_step(), "{}", plain.what);
    }
}
