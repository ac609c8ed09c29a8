-- Items that a box had sent with the time of a clock that was wrong: those of an epoch with these numbers are so much later.
CREATE TABLE clock_moves (
  box_id int NOT NULL REFERENCES boxes ON DELETE CASCADE,
  told_epoch bigint NOT NULL, told_sequence bigint NOT NULL, place int NOT NULL, -- of the event that tells it
  epoch bigint NOT NULL, from_sequence bigint NOT NULL, to_sequence bigint NOT NULL,
  by_ns bigint NOT NULL,
  from_at timestamptz, to_at timestamptz,  -- times of the samples before
  PRIMARY KEY (box_id, told_epoch, told_sequence, place)
);
