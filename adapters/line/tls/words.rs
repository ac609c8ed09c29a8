//! What is wrong with a certificate or a handshake, and what to do.

use rustls::pki_types::pem;
use rustls::{AlertDescription, CertificateError, Error};
use std::io;
use std::path::Path;
use thiserror::Error as ThisError;

/// Why the line cannot be trusted, or we are not.
#[derive(Debug, Clone, PartialEq, Eq, ThisError)]
#[error("{what}; {next}")]
pub struct TlsError {
    /// What happened, and where.
    pub what: String,
    /// What to do next.
    pub next: String,
}

impl TlsError {
    pub(super) fn new(what: impl Into<String>, next: impl Into<String>) -> Self {
        Self { what: what.into(), next: next.into() }
    }

    /// What an input or output error of a TLS line hides, if it comes from TLS.
    #[must_use]
    pub fn from_io_error(error: &io::Error, host: &str) -> Option<Self> {
        let inner = error.get_ref()?;
        inner
            .downcast_ref::<Self>()
            .cloned()
            .or_else(|| inner.downcast_ref::<Error>().map(|error| build_tls_error(error, host)))
    }
}

pub(super) fn bad_file(file: &Path, kind: &str, error: &pem::Error) -> TlsError {
    let what = match error {
        pem::Error::Io(error) => format!("{} cannot be read: {error}", file.display()),
        pem::Error::NoItemsFound => format!("{} holds no {kind}", file.display()),
        other => format!("{} is no PEM file: {other:?}", file.display()),
    };
    TlsError::new(what, format!("give a PEM file that holds a {kind} and that the gateway's user may read"))
}

pub(super) fn bad_pair(certificate: &Path, key: &Path, error: &Error) -> TlsError {
    let what = format!("{} and {} cannot be used together: {error}", certificate.display(), key.display());
    TlsError::new(what, "give the private key that belongs to this certificate")
}

/// An error of rustls while talking to `host`.
pub(super) fn build_tls_error(error: &Error, host: &str) -> TlsError {
    match error {
        Error::InvalidCertificate(wrong) => build_certificate_error(wrong, host),
        Error::AlertReceived(alert) => build_alert_error(*alert, host),
        Error::InvalidMessage(_) => no_tls(host),
        Error::NoCertificatesPresented => {
            TlsError::new(format!("{host} shows no certificate"), "configure one on its TLS listener")
        }
        other => TlsError::new(format!("TLS with {host} failed: {other}"), "compare the TLS settings of both sides"),
    }
}

/// Whoever answers there does not know TLS.
pub(super) fn no_tls(host: &str) -> TlsError {
    let next = "use the port of the TLS listener, usually 8883, or an address without TLS";
    TlsError::new(format!("{host} does not speak TLS on this port"), next)
}

fn build_certificate_error(wrong: &CertificateError, host: &str) -> TlsError {
    let clock = "look at the date of this box first (`date`; set it with `timedatectl`)";
    let (what, next) = match wrong {
        CertificateError::Expired | CertificateError::ExpiredContext { .. } => (
            format!("the certificate of {host} has expired"),
            format!("{clock}; if it is right, renew the certificate"),
        ),
        CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. } => (
            format!("the certificate of {host} is not valid yet"),
            format!("{clock}; if it is right, the certificate begins in the future"),
        ),
        CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => (
            format!("the certificate belongs to another host than {host}"),
            "write the address with the name that stands in the certificate, or issue one for this name".to_owned(),
        ),
        CertificateError::UnknownIssuer => (
            format!("the certificate of {host} is signed by nobody that is trusted here"),
            "name the certificate of the authority that signed it with ca=/path/ca.pem".to_owned(),
        ),
        CertificateError::Revoked => {
            (format!("the certificate of {host} is revoked"), "issue a new one on the other side".to_owned())
        }
        other => (
            format!("the certificate of {host} cannot be used: {other:?}"),
            "issue one with a usual tool, of version 3, with the name as subjectAltName".to_owned(),
        ),
    };
    TlsError::new(what, next)
}

fn build_alert_error(alert: AlertDescription, host: &str) -> TlsError {
    let own = "name the client's own certificate and key with cert=/path/client.pem&key=/path/client.key";
    let (what, next) = match alert {
        AlertDescription::CertificateRequired => (format!("{host} asks for a client certificate"), own.to_owned()),
        AlertDescription::CertificateExpired => {
            (format!("{host} says that the client certificate has expired"), "renew it".to_owned())
        }
        AlertDescription::UnknownCA | AlertDescription::BadCertificate | AlertDescription::CertificateUnknown => (
            format!("{host} does not accept the client certificate"),
            "give one that is signed by the authority that the other side trusts".to_owned(),
        ),
        AlertDescription::HandshakeFailure => {
            (format!("{host} ends the handshake"), format!("it may want a client certificate: {own}"))
        }
        AlertDescription::ProtocolVersion => {
            (format!("{host} speaks only TLS older than 1.2"), "update the other side".to_owned())
        }
        other => (format!("{host} ends the TLS connection: {other:?}"), "look at its log".to_owned()),
    };
    TlsError::new(what, next)
}
