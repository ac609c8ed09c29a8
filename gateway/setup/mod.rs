//! The first configuration of a box: what has to be known, as a file that `check` passes. The terminal asks for it
//! (`cnc-gateway setup`), and the page has the same questions.

mod scan;

pub use scan::{AddressRange, FoundControl, RangeError, scan_for_controls};

use rules::physics::explain::Language;
use rules::twin::format_toml_text;
use std::path::PathBuf;

/// What the box has to know to begin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SetupAnswers {
    /// Name of the machine.
    pub machine: String,
    /// Language of the page; `None`: that of the browser.
    pub language: Option<Language>,
    /// Directory of the data of the box, absolute, where it is another one than the service uses by itself.
    pub data_dir: Option<PathBuf>,
    /// Address of the control, where there is one.
    pub control: Option<String>,
    /// Addresses of the meters.
    pub meters: Vec<String>,
    /// May other computers open the page? Then it is served over TLS, and everybody needs a token.
    pub page_from_network: bool,
}

impl SetupAnswers {
    /// The configuration file. Only what differs from the defaults stands in it, so that it can be read at one look.
    #[must_use]
    pub fn render_configuration(&self) -> String {
        let mut text = String::from(
            "# Written by `cnc-gateway setup`. `cnc-gateway check --keys` explains every key; what is not written has its default.\n\n[gateway]\n",
        );
        text += &format!("name = {}\n", format_toml_text(&self.machine));
        if let Some(directory) = &self.data_dir {
            text += &format!("data_dir = {}\n", format_toml_text(&directory.display().to_string()));
        }
        if let Some(language) = self.language {
            text += &format!("language = {}\n", format_toml_text(language_word(language)));
        }
        if let Some(control) = &self.control {
            text += &render_source(control, "control");
        }
        for (index, meter) in self.meters.iter().enumerate() {
            let name = if index == 0 { "meter".to_owned() } else { format!("meter {}", index + 1) };
            text += &render_source(meter, &name);
        }
        text += match self.page_from_network {
            true => "\n[http]\nlisten = \"0.0.0.0:8080\"\ntls = true\ntokens = \"always\"\n",
            false => "\n[http]\nlisten = \"127.0.0.1:8080\"\n",
        };
        text += "\n# The gate decides and records, and writes nothing. Chapter `gate` says what has to be there before it may.\n[gate]\nmode = \"shadow\"\n";
        text
    }
}

fn render_source(address: &str, name: &str) -> String {
    format!("\n[[source]]\naddress = {}\nname = {}\n", format_toml_text(address), format_toml_text(name))
}

fn language_word(language: Language) -> &'static str {
    match language {
        Language::En => "en",
        Language::Zh => "zh",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn what_is_written_is_read_again() {
        let answers = SetupAnswers {
            machine: "Drehmaschine \"7\" \\ 车床".to_owned(),
            language: Some(Language::Zh),
            data_dir: None,
            control: Some("fanuc://192.168.1.10:8193".to_owned()),
            meters: vec!["modbus-tcp://192.168.1.20:502?profile=sdm630".to_owned()],
            page_from_network: true,
        };
        let text = answers.render_configuration();
        let config = crate::config::parse("setup", &text, Path::new(""), []).expect("accepted");
        assert_eq!(config.gateway.machine.name, answers.machine);
        assert_eq!(config.sources.len(), 2);
        assert!(config.http.tls && config.http.tokens_always);
    }
}
