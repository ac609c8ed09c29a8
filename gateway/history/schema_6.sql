-- Schema 6: facts of production that only the plant knows. A mark is there once. `IF NOT EXISTS`: nothing
-- is lost where it is there already.
CREATE TABLE IF NOT EXISTS facts (
  id INTEGER PRIMARY KEY,
  at_ns INTEGER NOT NULL,         -- when the box was told it
  from_ns INTEGER NOT NULL,       -- when it happened, or from when on it holds
  until_ns INTEGER,               -- of stop_reason and planned_time
  fact TEXT NOT NULL CHECK (fact IN ('order', 'scrap', 'stop_reason', 'operator', 'shift', 'planned_time')),
  value TEXT NOT NULL,            -- number of the order, name, reason
  parts INTEGER,                  -- scrap, or planned of an order
  mark TEXT NOT NULL UNIQUE, way TEXT NOT NULL, author TEXT NOT NULL
);
CREATE INDEX IF NOT EXISTS facts_from ON facts (from_ns);
CREATE INDEX IF NOT EXISTS facts_at ON facts (at_ns);
CREATE VIEW IF NOT EXISTS fact_list AS
  SELECT strftime('%Y-%m-%dT%H:%M:%fZ', from_ns / 1e9, 'unixepoch') AS from_utc,
         strftime('%Y-%m-%dT%H:%M:%fZ', until_ns / 1e9, 'unixepoch') AS until_utc,
         fact, value, parts, mark, way, author, from_ns, until_ns, at_ns
  FROM facts;
