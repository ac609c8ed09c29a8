-- Hours of each machine in each state, the last seven days.
SELECT label AS machine, state,
       sum(extract(epoch FROM least(coalesce(until, now()), now()) - greatest(since, now() - interval '7 days'))) / 3600 AS hours
FROM states JOIN labels USING (box_id)
WHERE since < now() AND coalesce(until, now()) > now() - interval '7 days' AND since >= now() - interval '37 days'
GROUP BY label, state
ORDER BY label, hours DESC;
