-- Hours of each machine in each state, the last seven days.
SELECT label AS machine, state,
       sum(extract(epoch FROM least(coalesce(states.until, now()), now()) - greatest(states.since, now() - interval '7 days'))) / 3600 AS hours
FROM states JOIN placements AS place ON place.box_id = states.box_id AND states.since >= place.since AND states.since < place.until
WHERE states.since < now() AND coalesce(states.until, now()) > now() - interval '7 days' AND states.since >= now() - interval '37 days'
GROUP BY label, state
ORDER BY label, hours DESC;
