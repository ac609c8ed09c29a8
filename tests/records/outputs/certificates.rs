//! Certificates as an integrator makes them, with openssl: an authority, a broker, a client, and wrong ones.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use testkit::broker::program;

/// A directory of PEM files.
pub(crate) struct Certificates {
    directory: tempfile::TempDir,
}

impl Certificates {
    /// An authority `ca`, and signed by it `broker` (for localhost and 127.0.0.1), `other` (for another host) and `box`;
    /// `stranger` is an authority of its own. `None` where openssl is not installed.
    pub(crate) fn make() -> Option<Self> {
        program("openssl")?;
        let made = Self { directory: tempfile::tempdir().expect("a directory") };
        for authority in ["ca", "stranger"] {
            made.authority(authority);
        }
        made.signed("broker", "DNS:localhost,IP:127.0.0.1", None);
        made.signed("other", "DNS:elsewhere.example", None);
        made.signed("box", "DNS:box", None);
        Some(made)
    }

    /// A broker's certificate that was valid years ago. `None` where faketime is not installed.
    pub(crate) fn make_expired(&self) -> Option<()> {
        program("faketime")?;
        self.signed("expired", "DNS:localhost,IP:127.0.0.1", Some("2020-01-01 00:00:00"));
        Some(())
    }

    /// One that begins years from now.
    pub(crate) fn make_early(&self) -> Option<()> {
        program("faketime")?;
        self.signed("early", "DNS:localhost,IP:127.0.0.1", Some("2038-01-01 00:00:00"));
        Some(())
    }

    pub(crate) fn path(&self, file: &str) -> PathBuf {
        self.directory.path().join(file)
    }

    /// The file's path as text.
    pub(crate) fn text(&self, file: &str) -> String {
        self.path(file).display().to_string()
    }

    fn authority(&self, name: &str) {
        let (key, pem) = (self.text(&format!("{name}.key")), self.text(&format!("{name}.pem")));
        let subject = format!("/CN={name}");
        // Valid over all the years that the tests pretend.
        let make =
            ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "9000"];
        openssl(
            self.directory.path(),
            Some("2015-01-01 00:00:00"),
            &make,
            &["-subj", &subject, "-keyout", &key, "-out", &pem],
        );
    }

    fn signed(&self, name: &str, names: &str, at: Option<&str>) {
        let directory = self.directory.path();
        let (key, request, pem) = (format!("{name}.key"), format!("{name}.csr"), format!("{name}.pem"));
        let subject = format!("/CN={name}");
        let new = ["req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"];
        openssl(directory, None, &new, &["-subj", &subject, "-keyout", &key, "-out", &request]);
        std::fs::write(self.path("extensions"), format!("subjectAltName={names}\n")).expect("writable");
        let sign = ["x509", "-req", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-days", "300"];
        openssl(directory, at, &sign, &["-extfile", "extensions", "-in", &request, "-out", &pem]);
    }
}

fn openssl(directory: &Path, at: Option<&str>, first: &[&str], rest: &[&str]) {
    let mut command = match at.and_then(|at| program("faketime").map(|_| at)) {
        Some(at) => {
            let mut command = Command::new("faketime");
            command.args([at, "openssl"]);
            command
        }
        None => Command::new("openssl"),
    };
    command.current_dir(directory).args(first).args(rest).stdout(Stdio::null()).stderr(Stdio::null());
    assert!(command.status().expect("openssl runs").success(), "openssl {first:?} {rest:?}");
}
