-- Schema 5: by which clock a segment was dated (confirmed, plausible, unset, or stepped: the machine brings its own time; NULL:
-- written before this schema), so that it can be dated anew when the clock turns out to have been wrong.
ALTER TABLE segments ADD COLUMN clock TEXT;
ALTER TABLE segments ADD COLUMN boot TEXT;          -- which start of the computer
ALTER TABLE segments ADD COLUMN anchor_ns INTEGER;  -- time of the rows minus time since that start
ALTER TABLE segments ADD COLUMN marks TEXT;         -- JSON: the last number of each kind of record before it
