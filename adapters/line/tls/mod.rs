//! TLS of a client: whom it trusts, how it identifies itself, and what is wrong in words that say what to do next.
//!
//! rustls with ring. Trusted are the certificates of the file `ca`, or without one those of the operating system. A
//! client certificate is shown where the other side asks for it. There is no way to switch the checks off: a box that
//! trusts whoever answers needs no TLS at all.

mod line;
mod words;

pub use line::{Lines, TcpConnection};
pub use words::TlsError;

use adapter_core::address::Keys;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ClientConfig, RootCertStore};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Where operating systems keep the certificates they trust.
const SYSTEM_FILES: [&str; 3] =
    ["/etc/ssl/certs/ca-certificates.crt", "/etc/pki/tls/certs/ca-bundle.crt", "/etc/ssl/cert.pem"];

/// The files of a client, all PEM.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TlsFiles {
    /// Certificates that are trusted; `None`: those of the operating system.
    pub ca: Option<PathBuf>,
    /// The client's own certificate, followed by those that vouch for it.
    pub certificate: Option<PathBuf>,
    /// The private key of the certificate.
    pub key: Option<PathBuf>,
}

impl TlsFiles {
    /// The keys `ca`, `cert` and `key`, where the address is one of TLS; otherwise they are refused as unknown.
    pub fn from_keys(keys: &mut Keys, secured: bool) -> Option<Self> {
        if !secured {
            return None;
        }
        let mut path = |key| keys.take_text(key).map(PathBuf::from);
        let files = Self { ca: path("ca"), certificate: path("cert"), key: path("key") };
        match (&files.certificate, &files.key) {
            (Some(certificate), None) => keys.add_problem(describe_missing_file("cert", certificate, "key")),
            (None, Some(key)) => keys.add_problem(describe_missing_file("key", key, "cert")),
            _ => {}
        }
        Some(files)
    }

    /// Reads the files.
    ///
    /// # Errors
    /// A file that cannot be read or holds something else, in words.
    pub fn build_config(&self) -> Result<Arc<ClientConfig>, TlsError> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let builder = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .map_err(|error| TlsError::new(format!("TLS cannot begin: {error}"), ""))?
            .with_root_certificates(self.load_roots()?);
        let config = match (&self.certificate, &self.key) {
            (Some(certificate), Some(key)) => builder
                .with_client_auth_cert(load_certificates(certificate)?, private_key(key)?)
                .map_err(|error| words::bad_pair(certificate, key, &error))?,
            _ => builder.with_no_client_auth(),
        };
        Ok(Arc::new(config))
    }

    /// The certificates that are trusted, for a library that wants them one by one.
    ///
    /// # Errors
    /// As of [`TlsFiles::build_config`].
    pub fn load_trusted(&self) -> Result<Vec<CertificateDer<'static>>, TlsError> {
        let usable = |certificate: &CertificateDer<'static>| RootCertStore::empty().add(certificate.clone()).is_ok();
        Ok(load_certificates(&self.find_roots_file()?)?.into_iter().filter(usable).collect())
    }

    fn find_roots_file(&self) -> Result<PathBuf, TlsError> {
        let system = || SYSTEM_FILES.iter().map(PathBuf::from).find(|file| file.is_file());
        self.ca.clone().or_else(system).ok_or_else(|| {
            let next = "install the package ca-certificates, or name the file with ca=/path/ca.pem";
            TlsError::new("this system has no file of trusted certificates", next)
        })
    }

    fn load_roots(&self) -> Result<RootCertStore, TlsError> {
        let file = self.find_roots_file()?;
        let mut roots = RootCertStore::empty();
        let (taken, _unusable) = roots.add_parsable_certificates(load_certificates(&file)?);
        if taken == 0 {
            let what = format!("{} holds no certificate that could be trusted", file.display());
            return Err(TlsError::new(what, "give the certificate of the authority that signed the broker's, as PEM"));
        }
        Ok(roots)
    }
}

fn load_certificates(file: &Path) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let read = CertificateDer::pem_file_iter(file).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let found = read.map_err(|error| words::bad_file(file, "certificate", &error))?;
    match found.is_empty() {
        true => Err(words::bad_file(file, "certificate", &rustls::pki_types::pem::Error::NoItemsFound)),
        false => Ok(found),
    }
}

fn private_key(file: &Path) -> Result<PrivateKeyDer<'static>, TlsError> {
    PrivateKeyDer::from_pem_file(file).map_err(|error| words::bad_file(file, "private key", &error))
}

fn describe_missing_file(given: &str, file: &Path, missing: &str) -> String {
    format!("{given}={} needs {missing}=FILE beside it", file.display())
}
