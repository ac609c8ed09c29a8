-- What every machine is doing now; one that nobody hears has no_data.
SELECT label AS machine, state, now() - since AS since, program, tool, connected, last_arrival
FROM machines_now JOIN labels USING (box_id)
ORDER BY label;
