-- The history of one machine. Times are nanoseconds since 1970-01-01 UTC on the gateway's clock; every view adds them
-- as text. Raw samples older than the running minute lie compressed in `blocks`: ask `cnc-gateway history query`.

CREATE TABLE meta (
  key TEXT PRIMARY KEY,
  value
) WITHOUT ROWID;

CREATE TABLE series (
  id INTEGER PRIMARY KEY,
  name TEXT NOT NULL UNIQUE,
  unit TEXT NOT NULL,
  kind TEXT NOT NULL CHECK (kind IN ('number', 'text')),
  decimals INTEGER,               -- places kept of long fractions, NULL: every bit
  en TEXT NOT NULL,
  zh TEXT NOT NULL,
  estimated INTEGER NOT NULL      -- 1: inferred by the gateway, 0: read from a source
);

-- A stretch in which time only increases: one per start of the gateway, one more when the clock went back.
CREATE TABLE segments (
  id INTEGER PRIMARY KEY,
  first_row INTEGER NOT NULL,
  start_ns INTEGER NOT NULL,
  origin TEXT NOT NULL,
  reason TEXT NOT NULL CHECK (reason IN ('start', 'clock_went_back')),
  version TEXT NOT NULL
);

CREATE TABLE blocks (
  first_row INTEGER PRIMARY KEY,  -- rows are numbered over the life of the file
  segment INTEGER NOT NULL,
  rows INTEGER NOT NULL,
  start_ns INTEGER NOT NULL,
  end_ns INTEGER NOT NULL,
  directory BLOB NOT NULL,
  columns BLOB NOT NULL
);
CREATE INDEX blocks_start ON blocks (start_ns);

-- The crash tail: what was committed since the last block, and a little more. Slots are used again.
CREATE TABLE tail (
  slot INTEGER PRIMARY KEY,
  segment INTEGER NOT NULL,
  first_row INTEGER NOT NULL,
  rows INTEGER NOT NULL,
  start_ns INTEGER NOT NULL,
  end_ns INTEGER NOT NULL,
  body TEXT NOT NULL
);

CREATE TABLE minutes (
  minute INTEGER NOT NULL, series INTEGER NOT NULL,
  count INTEGER NOT NULL, min REAL NOT NULL, max REAL NOT NULL, mean REAL NOT NULL,
  PRIMARY KEY (minute, series)
) WITHOUT ROWID;
CREATE TABLE hours (
  hour INTEGER NOT NULL, series INTEGER NOT NULL,
  count INTEGER NOT NULL, min REAL NOT NULL, max REAL NOT NULL, mean REAL NOT NULL,
  PRIMARY KEY (hour, series)
) WITHOUT ROWID;
CREATE TABLE days (
  day INTEGER NOT NULL, series INTEGER NOT NULL,
  count INTEGER NOT NULL, min REAL NOT NULL, max REAL NOT NULL, mean REAL NOT NULL,
  PRIMARY KEY (day, series)
) WITHOUT ROWID;

CREATE TABLE states (
  id INTEGER PRIMARY KEY,
  state TEXT NOT NULL,
  since_ns INTEGER NOT NULL,
  until_ns INTEGER,               -- NULL: still in it
  program TEXT, tool TEXT,
  ended_by TEXT                   -- 'change', or 'stop' when the gateway stopped in it
);
CREATE INDEX states_since ON states (since_ns);
CREATE UNIQUE INDEX states_open ON states ((1)) WHERE until_ns IS NULL;
CREATE TABLE state_hours (
  hour INTEGER NOT NULL, state TEXT NOT NULL, seconds REAL NOT NULL,
  PRIMARY KEY (hour, state)
) WITHOUT ROWID;

CREATE TABLE parts (
  id INTEGER PRIMARY KEY,
  began_ns INTEGER NOT NULL, ended_ns INTEGER NOT NULL,
  part TEXT, program TEXT, count INTEGER NOT NULL,
  cutting_s REAL, energy_j REAL, detail TEXT
);
CREATE INDEX parts_ended ON parts (ended_ns);

CREATE TABLE events (
  id INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  kind TEXT NOT NULL, source TEXT NOT NULL, text TEXT NOT NULL, detail TEXT
);
CREATE INDEX events_at ON events (at_ns);

CREATE TABLE alarms (
  id INTEGER PRIMARY KEY,
  code TEXT NOT NULL, source TEXT NOT NULL, severity TEXT NOT NULL,
  raised_ns INTEGER NOT NULL,
  cleared_ns INTEGER,             -- NULL: still there
  count INTEGER NOT NULL,         -- how often it was raised meanwhile
  en TEXT NOT NULL, zh TEXT NOT NULL
);
CREATE INDEX alarms_raised ON alarms (raised_ns);
CREATE UNIQUE INDEX alarms_open ON alarms (source, code) WHERE cleared_ns IS NULL;

CREATE TABLE decisions (
  id INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  script TEXT NOT NULL, script_version TEXT NOT NULL,
  wanted TEXT NOT NULL, value REAL, unit TEXT NOT NULL, reason TEXT NOT NULL,
  outcome TEXT NOT NULL, outcome_reason TEXT NOT NULL
);
CREATE INDEX decisions_at ON decisions (at_ns);

CREATE TABLE commands (
  id INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  command TEXT NOT NULL, target TEXT NOT NULL,
  before REAL, asked REAL, after REAL, unit TEXT NOT NULL,
  outcome TEXT NOT NULL, reason TEXT NOT NULL,
  script TEXT, script_version TEXT
);
CREATE INDEX commands_at ON commands (at_ns);

CREATE TABLE models (
  id INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  name TEXT NOT NULL, origin TEXT NOT NULL, toml TEXT NOT NULL
);

CREATE TABLE diagnoses (
  id INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  from_ns INTEGER NOT NULL, to_ns INTEGER NOT NULL,
  verdict TEXT NOT NULL, summary TEXT NOT NULL, json TEXT NOT NULL
);

-- What retention or a full disk has taken, in rows of each kind.
CREATE TABLE dropped (
  kind TEXT PRIMARY KEY, rows INTEGER NOT NULL, through_ns INTEGER NOT NULL, because TEXT NOT NULL
) WITHOUT ROWID;

CREATE VIEW minute_summaries AS
  SELECT strftime('%Y-%m-%dT%H:%M:%SZ', minute * 60, 'unixepoch') AS time_utc, name, unit, count, min, max, mean,
         minute * 60000000000 AS at_ns
  FROM minutes JOIN series ON series.id = minutes.series;
CREATE VIEW hour_summaries AS
  SELECT strftime('%Y-%m-%dT%H:%M:%SZ', hour * 3600, 'unixepoch') AS time_utc, name, unit, count, min, max, mean,
         hour * 3600000000000 AS at_ns
  FROM hours JOIN series ON series.id = hours.series;
CREATE VIEW day_summaries AS
  SELECT strftime('%Y-%m-%d', day * 86400, 'unixepoch') AS time_utc, name, unit, count, min, max, mean,
         day * 86400000000000 AS at_ns
  FROM days JOIN series ON series.id = days.series;

-- The last one to two minutes, one line per value.
CREATE VIEW recent_samples AS
  SELECT strftime('%Y-%m-%dT%H:%M:%fZ', at_ns / 1e9, 'unixepoch') AS time_utc, name, unit,
         CASE WHEN form IN ('integer', 'real') THEN CAST(cell AS REAL) END AS value,
         CASE WHEN form = 'text' THEN cell END AS text,
         CASE WHEN form = 'object' THEN json_extract(cell, '$.m') END AS missing,
         at_ns
  FROM (
    SELECT t.value AS at_ns, series.name AS name, series.unit AS unit,
           CASE c.type WHEN 'array' THEN json_type(c.value, '$[' || t.key || ']') ELSE c.type END AS form,
           CASE c.type WHEN 'array' THEN json_extract(c.value, '$[' || t.key || ']') ELSE c.value END AS cell
    FROM tail, json_each(tail.body, '$.t') AS t, json_each(tail.body, '$.s') AS c
    JOIN series ON series.id = CAST(c.key AS INTEGER)
  );

CREATE VIEW state_intervals AS
  SELECT strftime('%Y-%m-%dT%H:%M:%fZ', since_ns / 1e9, 'unixepoch') AS since_utc,
         strftime('%Y-%m-%dT%H:%M:%fZ', until_ns / 1e9, 'unixepoch') AS until_utc,
         state, (until_ns - since_ns) / 1e9 AS duration_s, program, tool, ended_by, since_ns, until_ns
  FROM states;
CREATE VIEW alarm_list AS
  SELECT strftime('%Y-%m-%dT%H:%M:%fZ', raised_ns / 1e9, 'unixepoch') AS raised_utc,
         strftime('%Y-%m-%dT%H:%M:%fZ', cleared_ns / 1e9, 'unixepoch') AS cleared_utc,
         code, source, severity, en, zh, count, raised_ns, cleared_ns
  FROM alarms;
CREATE VIEW event_list AS
  SELECT strftime('%Y-%m-%dT%H:%M:%fZ', at_ns / 1e9, 'unixepoch') AS time_utc, kind, source, text, detail, at_ns
  FROM events;
