-- Machines by their paths, and which box stands at which of them, since when. A box that has never told a path has no row here, and is its
-- machine. Where a box takes the place of another one, the machine has rows of both.
CREATE TABLE machines (
  machine_id int GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  path text NOT NULL UNIQUE,           -- the levels that are written, with slashes: shanghai/line-2/lathe-7
  enterprise text, site text NOT NULL, area text, line text,
  machine text NOT NULL,               -- last word of the path; the name for people is that of the box
  first_seen timestamptz NOT NULL DEFAULT now()
);
CREATE TABLE box_machines (
  box_id int NOT NULL REFERENCES boxes ON DELETE CASCADE,
  since timestamptz NOT NULL,
  machine_id int REFERENCES machines,  -- empty: its path was taken away
  PRIMARY KEY (box_id, since)
);
CREATE INDEX box_machines_machine ON box_machines (machine_id, since);
