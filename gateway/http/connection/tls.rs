//! Certificate and key: the user's own, or made at the first start for the names and addresses of this box.
//!
//! A certificate that the box makes is signed by nobody else, so a browser asks once whether it shall be trusted; the
//! fingerprint that is told at every start is what to compare then. It lasts for 825 days, the longest that every browser
//! takes, and is made anew at a start in its last 60 days.

use adapters::clock::{Clock, TimeNs};
use gateway_base::clock::{self, Trust};
use gateway_base::files;
use rcgen::{CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, KeyPair, date_time_ymd};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::UNIX_EPOCH;
use tokio_rustls::{TlsAcceptor, rustls};

const DAY_NS: i64 = 86_400 * adapters::clock::SECOND_NS;
/// When the certificate was made, nanoseconds since 1970; the date of a file is that of a clock nobody has judged.
const MADE: &str = "made";
/// Apple's limit for certificates of servers, 2019; the others allow as much or more for those that a user trusts himself.
const LASTS_DAYS: u32 = 825;
/// Made anew so long before the end.
const RENEWED_DAYS: u32 = 60;

/// Why there is no TLS.
#[derive(Debug, thiserror::Error)]
pub enum CertificateError {
    /// A file cannot be read or holds something else.
    #[error("{0}: {1}; `certificate` and `key` under [http] name PEM files")]
    File(PathBuf, String),
    /// Certificate and key do not fit.
    #[error("certificate and key do not fit together: {0}")]
    Pair(String),
    /// None could be made.
    #[error("no certificate could be made: {0}")]
    Make(String),
}

/// What the box shows to whoever connects.
pub struct Certificate {
    acceptor: TlsAcceptor,
    /// SHA-256 of the certificate, as browsers show it.
    pub fingerprint: String,
    /// The file of the certificate.
    pub file: PathBuf,
}

impl std::fmt::Debug for Certificate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Certificate").field("fingerprint", &self.fingerprint).finish_non_exhaustive()
    }
}

impl Certificate {
    /// The user's own.
    ///
    /// # Errors
    /// A file that cannot be used, or two that do not fit together.
    pub fn read(certificate: &Path, key: &Path) -> Result<Self, CertificateError> {
        let bad = |path: &Path, what: String| CertificateError::File(path.to_owned(), what);
        let chain = CertificateDer::pem_file_iter(certificate).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let chain = chain.map_err(|error| bad(certificate, error.to_string()))?;
        let first = chain.first().ok_or_else(|| bad(certificate, "there is no certificate in it".to_owned()))?;
        let fingerprint = compute_fingerprint(first);
        let key = PrivateKeyDer::from_pem_file(key).map_err(|error| bad(key, error.to_string()))?;
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let server = rustls::ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .map_err(|error| CertificateError::Pair(error.to_string()))?
            .with_no_client_auth()
            .with_single_cert(chain, key);
        let mut server = server.map_err(|error| CertificateError::Pair(error.to_string()))?;
        server.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Self { acceptor: TlsAcceptor::from(Arc::new(server)), fingerprint, file: certificate.to_owned() })
    }

    /// The box's own, in this directory; made for these names where there is none, or where it ends soon.
    ///
    /// # Errors
    /// It cannot be made, written or read.
    pub fn load_or_create(directory: &Path, listen: SocketAddr, names: &[String]) -> Result<Self, CertificateError> {
        let (certificate, key) = (directory.join("certificate.pem"), directory.join("key.pem"));
        let made = directory.join(MADE);
        let now = CertificateTimes::of_box();
        if !certificate.is_file() || !key.is_file() || now.asks_for_another(made_ns(&made, &certificate)) {
            let (chain, secret) = create_certificate(listen, names, now.now_ns)?;
            let trouble = |error: std::io::Error| CertificateError::Make(format!("{}: {error}", directory.display()));
            files::replace_privately(&key, &secret).map_err(trouble)?;
            files::replace_durably(&certificate, &chain).map_err(trouble)?;
            files::replace_durably(&made, now.now_ns.to_string()).map_err(trouble)?;
        }
        Self::read(&certificate, &key)
    }

    pub(crate) fn acceptor(&self) -> TlsAcceptor {
        self.acceptor.clone()
    }
}

/// What is known of time where a certificate is judged: whoever has trusted it must not be asked again because of a clock that
/// was wrong for a moment.
#[derive(Debug, Clone, Copy)]
struct CertificateTimes {
    now_ns: TimeNs,
    /// It is certainly later than this.
    at_least_ns: TimeNs,
    unset: bool,
}

impl CertificateTimes {
    fn of_box() -> Self {
        let clock = clock::of_box();
        Self { now_ns: clock.now_ns(), at_least_ns: clock.at_least_ns(), unset: clock.trust() == Trust::Unset }
    }

    /// Does one that was made then certainly end soon, or has it not begun?
    fn asks_for_another(&self, made_ns: TimeNs) -> bool {
        let lasts_ns = i64::from(LASTS_DAYS - RENEWED_DAYS).saturating_mul(DAY_NS);
        let ends_soon = self.at_least_ns.saturating_sub(made_ns) >= lasts_ns;
        ends_soon || (!self.unset && made_ns.saturating_sub(self.now_ns) > DAY_NS)
    }
}

/// When the certificate was made: as noted, or by the date of its file, for one of an older version.
fn made_ns(noted: &Path, certificate: &Path) -> TimeNs {
    let noted = std::fs::read_to_string(noted).ok().and_then(|text| text.trim().parse().ok());
    let of_file = || {
        let written = std::fs::metadata(certificate).and_then(|metadata| metadata.modified()).ok()?;
        i64::try_from(written.duration_since(UNIX_EPOCH).ok()?.as_nanos()).ok()
    };
    noted.or_else(of_file).unwrap_or(0)
}

fn create_certificate(
    listen: SocketAddr,
    names: &[String],
    now_ns: TimeNs,
) -> Result<(String, String), CertificateError> {
    let bad = |error: rcgen::Error| CertificateError::Make(error.to_string());
    let mut all = vec!["localhost".to_owned(), "127.0.0.1".to_owned()];
    all.extend(find_addresses(listen).iter().map(IpAddr::to_string));
    all.extend(std::fs::read_to_string("/etc/hostname").ok().map(|name| name.trim().to_lowercase()));
    all.extend(names.iter().cloned());
    all.retain(|name| !name.is_empty());
    all.sort();
    all.dedup();
    let mut params = CertificateParams::new(all).map_err(bad)?;
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, "cnc-gateway");
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    let at = |(year, month, day)| date_time_ymd(year, month, day);
    (params.not_before, params.not_after) =
        (at(compute_date(now_ns, -1)), at(compute_date(now_ns, i64::from(LASTS_DAYS) - 1)));
    let key = KeyPair::generate().map_err(bad)?;
    let certificate = params.self_signed(&key).map_err(bad)?;
    Ok((certificate.pem(), key.serialize_pem()))
}

/// Year, month and day of the day that lies so many days after this time.
fn compute_date(now_ns: TimeNs, days: i64) -> (i32, u8, u8) {
    let at = jiff::Timestamp::from_nanosecond(i128::from(now_ns.saturating_add(days.saturating_mul(DAY_NS))));
    let date = at.map(|at| at.to_zoned(jiff::tz::TimeZone::UTC).date());
    date.map_or((2000, 1, 1), |date| (date.year().into(), date.month().unsigned_abs(), date.day().unsigned_abs()))
}

/// The addresses by which others reach the box: the one it listens on, or the one by which it would reach others.
fn find_addresses(listen: SocketAddr) -> Vec<IpAddr> {
    if !listen.ip().is_unspecified() {
        return vec![listen.ip()];
    }
    // Nothing is sent: a datagram socket that is connected knows the way it would take.
    let way = |from: &str, to: &str| {
        let socket = UdpSocket::bind(from).ok()?;
        socket.connect(to).ok()?;
        socket.local_addr().ok().map(|address| address.ip())
    };
    [way("0.0.0.0:0", "192.0.2.1:9"), way("[::]:0", "[2001:db8::1]:9")].into_iter().flatten().collect()
}

fn compute_fingerprint(certificate: &CertificateDer<'_>) -> String {
    let digest = Sha256::digest(certificate.as_ref());
    digest.iter().enumerate().fold(String::with_capacity(95), |mut text, (index, byte)| {
        let _infallible = write!(text, "{}{byte:02X}", if index == 0 { "" } else { ":" });
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn the_box_makes_a_certificate_once_and_keeps_its_key_to_itself() {
        let directory = tempfile::tempdir().expect("a directory");
        let listen = "0.0.0.0:0".parse().expect("one");
        let names = ["gateway.local".to_owned()];
        let made = Certificate::load_or_create(directory.path(), listen, &names).expect("made");
        assert_eq!(made.fingerprint.len(), 95);
        let again = Certificate::load_or_create(directory.path(), listen, &names).expect("read");
        assert_eq!(made.fingerprint, again.fingerprint);
        let mode = std::fs::metadata(directory.path().join("key.pem")).expect("there").permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        let file = directory.path().join("certificate.pem");
        let made_ns = made_ns(&directory.path().join(MADE), &file);
        let asks = |now_days: i64, at_least_days: i64, unset: bool| {
            let at = |days: i64| made_ns + days * DAY_NS;
            CertificateTimes { now_ns: at(now_days), at_least_ns: at(at_least_days), unset }.asks_for_another(made_ns)
        };
        assert!(!asks(0, 0, false) && !asks(4000, 0, false), "a clock in the wrong year renews nothing");
        assert!(asks(800, 800, false), "it certainly ends soon");
        assert!(asks(-400, -500, false) && !asks(-400, -500, true), "it was made by a clock that was ahead");
        let other = tempfile::tempdir().expect("a directory");
        Certificate::load_or_create(other.path(), listen, &names).expect("made");
        let mixed = Certificate::read(&file, &other.path().join("key.pem"));
        assert!(matches!(mixed, Err(CertificateError::Pair(_))), "{mixed:?}");
        assert!(matches!(Certificate::read(&file, &file), Err(CertificateError::File(..))));
    }
}
