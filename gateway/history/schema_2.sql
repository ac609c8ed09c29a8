-- Schema 2: the library of wear models. The newest of a key is in force.
CREATE TABLE wear_models (
  id INTEGER PRIMARY KEY, at_ns INTEGER NOT NULL,
  machine TEXT NOT NULL, tool TEXT NOT NULL, work_material TEXT NOT NULL, operation TEXT NOT NULL,
  form TEXT NOT NULL CHECK (form IN ('surface', 'physical')),
  criterion_mm REAL NOT NULL, cuts INTEGER NOT NULL, residual_sd_w REAL NOT NULL, r2 REAL NOT NULL,
  origin TEXT NOT NULL,
  toml TEXT NOT NULL              -- the model itself, wear/1
);
CREATE INDEX wear_models_key ON wear_models (machine, tool, work_material, operation);
CREATE VIEW wear_model_list AS
  SELECT strftime('%Y-%m-%dT%H:%M:%SZ', at_ns / 1e9, 'unixepoch') AS stored_utc,
         machine, tool, work_material, operation, form, criterion_mm, cuts, residual_sd_w, r2, origin,
         id = max(id) OVER (PARTITION BY machine, tool, work_material, operation) AS in_force, id, at_ns
  FROM wear_models;
