-- What the plant has told of its production: facts that no machine knows. A mark is there once for each box.
CREATE TABLE fact_list (
  box_id int NOT NULL,
  since timestamptz NOT NULL,          -- when it happened, or from when on it holds
  until timestamptz,                   -- of stop_reason and planned_time
  fact text NOT NULL,                  -- order, scrap, stop_reason, operator, shift, planned_time
  value text NOT NULL,                 -- number of the order, name, or reason; empty: none
  parts bigint,                        -- scrap, negative where some are taken back; planned of an order
  mark text NOT NULL, way text, author text,
  at timestamptz NOT NULL,             -- when the box was told it
  sequence bigint NOT NULL, epoch bigint NOT NULL DEFAULT 0,
  PRIMARY KEY (box_id, mark)
);
CREATE INDEX fact_list_since ON fact_list (fact, since);
CREATE INDEX fact_list_at ON fact_list (at);
