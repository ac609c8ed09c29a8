//! The servers of an address: `//HOST:4222,HOST:4222/REST?keys`.

use super::NatsError;
use adapter_core::address::{AddressProblem, Endpoint, Keys, Login, parse_endpoint};
use device_line::tls::TlsFiles;
use std::path::PathBuf;

/// The port that NATS servers listen on.
const PORT: u16 = 4222;
/// More servers in one address are a mistake: a cluster has three or five.
const SERVERS_MAX: usize = 16;

/// One cluster, and how to sign in.
#[derive(Debug, Clone, PartialEq)]
pub struct NatsTarget {
    /// The servers in the order in which they are tried; never empty.
    pub servers: Vec<Endpoint>,
    /// The files of TLS, where the line is secured.
    pub tls: Option<TlsFiles>,
    /// User and password file; both empty where the server wants none.
    pub login: Login,
    /// The file whose first line is a token, where the server wants one.
    pub token_file: Option<PathBuf>,
}

/// What is sent to sign in, read at every connection.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Secrets {
    pub(super) login: Option<(String, String)>,
    pub(super) token: Option<String>,
}

/// Why an address names no cluster.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ClusterAddressError {
    /// A host is none.
    #[error(transparent)]
    Host(AddressProblem),
    /// More servers than a cluster needs.
    #[error("{servers} servers; name at most {SERVERS_MAX} of the cluster")]
    TooMany {
        /// How many were named.
        servers: usize,
    },
}

impl NatsTarget {
    /// Takes the keys of a cluster from an address `//HOST:PORT,HOST:PORT/REST`, and gives the rest.
    ///
    /// # Errors
    /// A host is none, in words.
    pub fn parse<'a>(body: &'a str, keys: &mut Keys, secured: bool) -> Result<(Self, &'a str), ClusterAddressError> {
        let tls = TlsFiles::from_keys(keys, secured);
        let login = Login::from_keys(keys);
        let token_file = keys.take_text("token_file").map(PathBuf::from);
        if token_file.is_some() && login.user.is_some() {
            keys.add_problem("give either user= or token_file=".to_owned());
        }
        let body = body.strip_prefix("//").unwrap_or(body);
        let (hosts, rest) = body.split_once('/').unwrap_or((body, ""));
        let servers: Vec<Endpoint> = hosts
            .split(',')
            .map(|host| parse_endpoint(host, Some(PORT)))
            .collect::<Result<_, _>>()
            .map_err(ClusterAddressError::Host)?;
        if servers.len() > SERVERS_MAX {
            return Err(ClusterAddressError::TooMany { servers: servers.len() });
        }
        Ok((Self { servers, tls, login, token_file }, rest.trim_end_matches('/')))
    }

    /// What is wrong with the files that the address names, each with what to do.
    #[must_use]
    pub fn check_files(&self) -> Vec<(String, String)> {
        let mut problems = Vec::new();
        if let Some(Err(error)) = self.tls.as_ref().map(TlsFiles::build_config) {
            problems.push((error.what, error.next));
        }
        if let Err(error) = self.read_secrets() {
            problems.push((error.what, error.next));
        }
        problems
    }

    pub(super) fn read_secrets(&self) -> Result<Secrets, NatsError> {
        let unreadable = |kind: &str, file: &std::path::Path, error: &std::io::Error| {
            let what = format!("the {kind} file {} cannot be read: {error}", file.display());
            NatsError::new(what, "make it readable for the gateway's user, or write another path")
        };
        let login = self.login.read().map_err(|(file, error)| unreadable("password", &file, &error))?;
        let token = match &self.token_file {
            None => None,
            Some(file) => {
                let text = std::fs::read_to_string(file).map_err(|error| unreadable("token", file, &error))?;
                Some(text.lines().next().unwrap_or_default().to_owned())
            }
        };
        Ok(Secrets { login, token })
    }
}
