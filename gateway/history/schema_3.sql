-- Schema 3: the audit of the gate and the reaction times of its steps. Audit rows are only ever appended, numbered from 1
-- without holes; `hash` is the SHA-256 of the row and of the hash before it. `cnc-gateway history audit --verify` checks it.
CREATE TABLE audit (
  number INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  kind TEXT NOT NULL,             -- started, request, write, reaction, feed_hold, stop, armed, disarmed, acknowledged
  outcome TEXT NOT NULL,          -- permitted, limited, held, refused, shadow, written, failed, seen, ...
  before REAL, asked REAL, after REAL, unit TEXT NOT NULL,
  reason TEXT NOT NULL, script TEXT NOT NULL, script_version TEXT NOT NULL, person TEXT NOT NULL,
  previous TEXT NOT NULL, hash TEXT NOT NULL
);
CREATE INDEX audit_at ON audit (at_ns);
CREATE TRIGGER audit_is_never_changed BEFORE UPDATE ON audit
  BEGIN SELECT RAISE(ABORT, 'the audit is only ever appended to'); END;
-- Retention says first through which number it removes; nothing else may.
CREATE TRIGGER audit_is_never_removed BEFORE DELETE ON audit
  WHEN old.number > (SELECT coalesce(max(value), 0) FROM meta WHERE key = 'audit_released')
  BEGIN SELECT RAISE(ABORT, 'the audit is only ever appended to'); END;
CREATE TABLE reactions (
  id INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  asked_pct REAL NOT NULL, found_pct REAL NOT NULL,
  sample_to_write_ms REAL NOT NULL,   -- from the time of the sample to the write
  write_to_seen_ms REAL NOT NULL,     -- from the write to the machine showing it
  program TEXT NOT NULL, block TEXT NOT NULL, tool TEXT NOT NULL
);
CREATE INDEX reactions_at ON reactions (at_ns);
CREATE VIEW audit_list AS
  SELECT number, strftime('%Y-%m-%dT%H:%M:%fZ', at_ns / 1e9, 'unixepoch') AS time_utc, kind, outcome, before, asked, after,
         unit, reason, script, script_version, person, hash, at_ns
  FROM audit;
CREATE VIEW reaction_list AS
  SELECT strftime('%Y-%m-%dT%H:%M:%fZ', at_ns / 1e9, 'unixepoch') AS time_utc, asked_pct, found_pct, sample_to_write_ms,
         write_to_seen_ms, program, block, tool, at_ns
  FROM reactions;
