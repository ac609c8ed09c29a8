//! A connection of one's own for whoever writes: the source may be waiting for an answer while the gate has something to
//! write. Made when it is needed, and anew after the line broke.

use super::connection::{Connection, Link};
use super::mailbox::ControllerRegister;
use super::message::{NcLinkAnswer, RequestedItem};
use super::model::Model;
use adapter_core::driver::SourceError;

/// Items of a device by their paths, written and read.
pub(super) struct RegisterLine {
    link: Link,
    session: Option<(Connection, Model)>,
}

impl RegisterLine {
    /// Nothing is connected before the first request.
    pub(super) fn new(link: Link) -> Self {
        Self { link, session: None }
    }

    pub(super) fn name(&self) -> &str {
        &self.link.name
    }

    /// Writes registers in one request, in this order.
    ///
    /// # Errors
    /// The first that is refused, or the line.
    pub(super) fn write(&mut self, words: &[(ControllerRegister, i64)]) -> Result<(), SourceError> {
        let asks =
            words.iter().map(|(at, value)| RequestedItem::write(&build_register_path(*at), at.index, *value)).collect();
        let answers = self.exchange_items(asks, Connection::set_values)?;
        for ((at, _), answer) in words.iter().zip(answers) {
            let no = match answer {
                Some(Ok(_)) => continue,
                Some(Err(reason)) => reason,
                None => "it said nothing of it".to_owned(),
            };
            return Err(build_refusal(&self.link, &format!("writing {at}"), no));
        }
        Ok(())
    }

    /// Asks for items that are named by their paths; one answer for each.
    ///
    /// # Errors
    /// The device has not one of them, or the line failed.
    pub(super) fn read(&mut self, asks: Vec<RequestedItem>) -> Result<Vec<Option<NcLinkAnswer>>, SourceError> {
        self.exchange_items(asks, Connection::query_values)
    }

    /// Does the device have this?
    ///
    /// # Errors
    /// Refused where not; or the line.
    pub(super) fn check_item(&mut self, path: &str) -> Result<(), SourceError> {
        self.with(|_, model, link| resolve_name(link, model, path, false).map(|_| ()))
    }

    fn exchange_items(
        &mut self,
        mut asks: Vec<RequestedItem>,
        act: impl FnOnce(&mut Connection, &[RequestedItem]) -> Result<Vec<Option<NcLinkAnswer>>, SourceError>,
    ) -> Result<Vec<Option<NcLinkAnswer>>, SourceError> {
        self.with(|connection, model, link| {
            for ask in &mut asks {
                ask.id = resolve_name(link, model, &ask.id, ask.params.value.is_some())?;
            }
            act(connection, &asks)
        })
    }

    fn with<T>(
        &mut self,
        work: impl FnOnce(&mut Connection, &Model, &Link) -> Result<T, SourceError>,
    ) -> Result<T, SourceError> {
        let (mut connection, model) = match self.session.take() {
            Some(session) => session,
            None => self.connect_device()?,
        };
        let outcome = work(&mut connection, &model, &self.link);
        self.session = (!matches!(outcome, Err(SourceError::Line { .. }))).then_some((connection, model));
        outcome
    }

    fn connect_device(&self) -> Result<(Connection, Model), SourceError> {
        let mut connection = Connection::open(&self.link, false)?;
        let model = connection.probe_model()?;
        Ok((connection, model))
    }
}

/// The list that holds this register.
pub(super) fn build_register_path(at: ControllerRegister) -> String {
    format!("CONTROLLER/VARIABLE@REG_{}", at.kind)
}

/// The name by which the device knows an item.
fn resolve_name(link: &Link, model: &Model, path: &str, written: bool) -> Result<String, SourceError> {
    let item =
        model.find_item(path).ok_or_else(|| build_refusal(link, path, "the device does not have it".to_owned()))?;
    if written && !item.settable {
        return Err(build_refusal(link, path, "its model says that it may not be written".to_owned()));
    }
    Ok(if model.names_by_path() { format!("/{}", item.path) } else { item.id.clone() })
}

fn build_refusal(link: &Link, request: &str, what: String) -> SourceError {
    SourceError::Refused {
        source_name: link.name.clone(),
        request: request.to_owned(),
        what,
        next: "Name another register in the address (mailbox=, offset=), or let the adapter of the device allow it."
            .to_owned(),
    }
}
