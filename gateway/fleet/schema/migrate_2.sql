-- From version 2, which had no epochs and no moved times.
DROP VIEW IF EXISTS machines_now, states, last_seen, latest, readings, minutes, hours, days, parts, operations, alarms, gaps, events,
  decisions, diagnoses;
DO $$
DECLARE
  of_key text;
  changed text[];
BEGIN
  FOREACH changed SLICE 1 IN ARRAY ARRAY[
    ['items', 'at, sequence'], ['state_list', 'since, sequence'], ['part_list', 'ended, sequence'],
    ['operation_list', 'ended, sequence, place'], ['event_list', 'at, sequence'], ['decision_list', 'at, sequence'],
    ['diagnosis_list', 'at, sequence']]
  LOOP
    EXECUTE format('ALTER TABLE %I ADD COLUMN epoch bigint NOT NULL DEFAULT 0', changed[1]);
    SELECT conname INTO of_key FROM pg_constraint WHERE conrelid = changed[1]::regclass AND contype = 'p';
    EXECUTE format('ALTER TABLE %I DROP CONSTRAINT %I', changed[1], of_key);
    EXECUTE format('ALTER TABLE %I ADD PRIMARY KEY (box_id, %s, epoch)', changed[1], changed[2]);
  END LOOP;
END $$;
ALTER TABLE items ADD COLUMN redated_ns bigint NOT NULL DEFAULT 0;
ALTER TABLE alarm_marks ADD COLUMN epoch bigint NOT NULL DEFAULT 0;
ALTER TABLE gap_list ADD COLUMN epoch bigint NOT NULL DEFAULT 0;
