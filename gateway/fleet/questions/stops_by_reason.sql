-- For how long each machine stood for which reason, as the plant has told it, the last seven days.
SELECT label AS machine, value AS reason, count(*) AS times,
       sum(extract(epoch FROM least(until, now()) - greatest(since, now() - interval '7 days'))) / 3600 AS hours
FROM facts
WHERE fact = 'stop_reason' AND since < now() AND until > now() - interval '7 days'
GROUP BY label, value
ORDER BY label, hours DESC;
