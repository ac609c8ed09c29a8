//! The line to PostgreSQL with TLS: the same checks of certificates as everywhere else, and no way to switch them off.
//!
//! `sslmode=require` in the address, or one of the files `ca=`, `cert=` and `key=`, asks for it. Unlike the words of libpq, `require`
//! here means what `verify-full` means there: who signed the certificate is checked, and that it belongs to this host.

use device_line::tls::TlsFiles;
use std::future::Future;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_postgres::tls::{ChannelBinding, MakeTlsConnect, TlsConnect, TlsStream};
use tokio_rustls::TlsConnector;
use tokio_rustls::client;
use tokio_rustls::rustls::ClientConfig;
use tokio_rustls::rustls::pki_types::ServerName;

/// The address without the names of files, which the client of PostgreSQL does not know, and these files; `None` where no TLS
/// is asked for.
pub(super) fn files_of(address: &str) -> (String, Option<TlsFiles>) {
    let Some((place, query)) = address.split_once('?') else { return (address.to_owned(), None) };
    let (mut files, mut left, mut named) = (TlsFiles::default(), Vec::new(), false);
    for part in query.split('&') {
        let slot = match part.split_once('=') {
            Some(("ca", file)) => Some((&mut files.ca, file)),
            Some(("cert", file)) => Some((&mut files.certificate, file)),
            Some(("key", file)) => Some((&mut files.key, file)),
            _ => None,
        };
        match slot {
            Some((slot, file)) => *slot = Some(file.into()),
            None => left.push(part),
        }
        named |= part == "sslmode=require";
    }
    let secured = named || files != TlsFiles::default();
    if secured && !named {
        left.push("sslmode=require");
    }
    let query = left.join("&");
    let text = if query.is_empty() { place.to_owned() } else { format!("{place}?{query}") };
    (text, secured.then_some(files))
}

/// Secures lines with this configuration.
#[derive(Clone)]
pub(super) struct Securing(pub(super) Arc<ClientConfig>);

/// A handshake that has not begun.
pub(super) struct Handshake {
    config: Arc<ClientConfig>,
    host: ServerName<'static>,
}

/// A line with TLS.
pub(super) struct Secured<S>(Box<client::TlsStream<S>>);

impl<S> MakeTlsConnect<S> for Securing
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    type Stream = Secured<S>;
    type TlsConnect = Handshake;
    type Error = io::Error;

    fn make_tls_connect(&mut self, host: &str) -> io::Result<Handshake> {
        let host = ServerName::try_from(host.to_owned()).map_err(io::Error::other)?;
        Ok(Handshake { config: self.0.clone(), host })
    }
}

impl<S> TlsConnect<S> for Handshake
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    type Stream = Secured<S>;
    type Error = io::Error;
    type Future = Pin<Box<dyn Future<Output = io::Result<Secured<S>>> + Send>>;

    fn connect(self, stream: S) -> Self::Future {
        let connecting = TlsConnector::from(self.config).connect(self.host, stream);
        Box::pin(async move { connecting.await.map(|stream| Secured(Box::new(stream))) })
    }
}

impl<S> TlsStream for Secured<S>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    /// The password is bound to its challenge by SCRAM; the certificate is checked by TLS.
    fn channel_binding(&self) -> ChannelBinding {
        ChannelBinding::none()
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncRead for Secured<S> {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, into: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut *self.0).poll_read(cx, into)
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncWrite for Secured<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, from: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut *self.0).poll_write(cx, from)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut *self.0).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut *self.0).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_taken_out_of_the_address_and_ask_for_tls() {
        let of = |query: &str| files_of(&format!("postgres://cnc@db:5432/cnc{query}"));
        assert_eq!(of("").1, None);
        assert_eq!(of("?application_name=x").1, None, "as before");
        let (text, files) = of("?ca=/etc/ca.pem&application_name=x");
        assert_eq!(text, "postgres://cnc@db:5432/cnc?application_name=x&sslmode=require");
        assert_eq!(files.and_then(|files| files.ca), Some("/etc/ca.pem".into()));
        assert_eq!(
            of("?sslmode=require"),
            ("postgres://cnc@db:5432/cnc?sslmode=require".to_owned(), Some(TlsFiles::default()))
        );
    }
}
