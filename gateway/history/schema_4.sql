-- Schema 4: events of one kind are found without reading all others. `IF NOT EXISTS`: nothing is lost where it is there already.
CREATE INDEX IF NOT EXISTS events_kind ON events (kind, at_ns);
