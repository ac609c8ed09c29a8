//! Rows a second beside plain COPY, and the shop's questions with as much as a large plant has.
//!
//! `FLEET_ITEMS=300000 cargo test --release --test records fleet::sizes -- --ignored --nocapture --test-threads 1`

use crate::fleet::pipeline::Plant;
use crate::fleet::postgres::Postgres;
use gateway::fleet::parse_cluster;
use gateway::nats::{Connection, Outgoing};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt::Write;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, program, run, stdout};
use testkit::process_status::status_figure;

fn setting(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// The document of an item with ten numbers, as a box writes it.
fn document(number: u64, sequence: u64, at_ns: i64, rng: &mut Pcg64) -> String {
    let mut values = String::new();
    for index in 0..10 {
        let comma = if index > 0 { "," } else { "" };
        let value = (rng.random::<f64>() * 100_000.0).round() / 10.0;
        write!(values, "{comma}{{\"name\":\"channel_{index}_w\",\"value\":{value},\"unit\":\"W\"}}").expect("fits");
    }
    format!(
        "{{\"schema\":\"item/1\",\"sequence\":{sequence},\"time_utc\":\"2026-01-31T08:15:00.100Z\",\"at_ns\":{at_ns},\"kind\":\"sample\",\
         \"values\":[{values}],\"machine\":\"Machine {number}\",\"box\":\"Machine-{number}\",\"historical\":false}}"
    )
}

async fn publish(address: &str, items: u64) {
    let (target, _) = parse_cluster(address).expect("an address");
    let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
    let mut rng = Pcg64::seed_from_u64(7);
    let start_ns = 1_769_900_000_000_000_000_i64;
    for block in 0..items / 1000 {
        let message = |index: u64| {
            let item = block * 1000 + index;
            let (number, sequence) = (item % 20, item / 20 + 1);
            let at_ns = start_ns + i64::try_from(sequence).expect("small") * 100_000_000;
            let payload = document(number, sequence, at_ns, &mut rng).into_bytes();
            Outgoing { subject: format!("cnc.Machine-{number}.sample"), id: format!("{number}-{sequence}"), payload }
        };
        let messages: Vec<Outgoing> = (0..1000).map(message).collect();
        connection.publish_all(&messages).await.map_err(|(_, failure)| failure).expect("stored");
    }
}

/// The greatest memory of a process so far, MB.
fn peak_mb(pid: u32) -> f64 {
    status_figure(&pid.to_string(), "VmHWM:").unwrap_or(0.0) / 1024.0
}

/// Runs the reader over the whole stream, as a consumer that has read nothing, into empty tables: rows a second from the first commit to the
/// last, and the greatest memory, MB. What comes before the first commit is connecting and making tables.
fn ingest_everything(plant: &Plant, turn: usize, items: u64) -> (f64, f64) {
    let mut command = program();
    command.args(["fleet", "ingest", &plant.address, "--max-gb", "4", "--database", &plant.postgres.address()]);
    command.args(["--consumer", &format!("turn-{turn}")]);
    let reader = Gateway::spawn(command);
    // Looking costs the computer something, too.
    testkit::process::wait_for("all rows", Duration::from_secs(600), || {
        std::thread::sleep(Duration::from_secs(1));
        (plant.postgres.number("SELECT sum(last_sequence) FROM box_latest") >= items).then_some(())
    });
    let peak = peak_mb(reader.pid());
    drop(reader);
    assert_eq!(plant.postgres.number("SELECT count(*) FROM items"), items);
    let said = plant.postgres.sql(
        "WITH batch AS (SELECT pg_xact_commit_timestamp(xmin) AS at, count(*) AS rows FROM items GROUP BY xmin)
         SELECT (sum(rows) - (SELECT rows FROM batch ORDER BY at LIMIT 1)) / extract(epoch FROM max(at) - min(at)) FROM batch",
    );
    (said.parse().expect("a number"), peak)
}

fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

#[test]
#[ignore = "3 minutes: rows a second of `fleet ingest` beside plain COPY into the same table, in release"]
fn rows_a_second_beside_plain_copy() {
    let Some(plant) = Plant::with_database(&["track_commit_timestamp=on"]) else { return };
    let items = setting("FLEET_ITEMS", 300_000);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    runtime.block_on(publish(&plant.address, items));
    // The file lies where the server can write it.
    let file = plant.postgres.sql("SHOW data_directory") + "/rows.copy";
    let (mut read, mut copied, mut shares, mut peaks) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for turn in 0..5 {
        let (rate, peak) = ingest_everything(&plant, turn, items);
        if turn == 0 {
            make_plain_table(&plant.postgres, &file);
        }
        let began = Instant::now();
        plant.postgres.sql(&format!("COPY plain FROM '{file}'"));
        let plain = items as f64 / began.elapsed().as_secs_f64();
        println!("{turn}: {rate:.0} rows/s from the stream, COPY {plain:.0} rows/s, {:.2} of it", rate / plain);
        read.push(rate);
        copied.push(plain);
        shares.push(rate / plain);
        peaks.push(peak);
        plant.postgres.sql("TRUNCATE items, box_latest, plain");
    }
    println!(
        "{items} items of ten numbers, medians of {}: {:.0} rows/s from the stream, plain COPY of the same rows into the same table and indices {:.0} rows/s; \
         {:.2} of it ({:.2} to {:.2}); the reader took {:.0} MB at most",
        shares.len(),
        median(&mut read),
        median(&mut copied),
        median(&mut shares),
        shares[0],
        shares[shares.len() - 1],
        peaks.iter().copied().fold(0.0, f64::max),
    );
    assert!(peaks.iter().all(|peak| *peak < 400.0), "{peaks:?} MB");
}

/// A table like that of the items, with its partitions, and a file with all of the rows.
fn make_plain_table(postgres: &Postgres, file: &str) {
    postgres.sql("CREATE TABLE plain (LIKE items INCLUDING ALL) PARTITION BY RANGE (at)");
    let days = postgres.sql("SELECT DISTINCT date_trunc('day', at)::date FROM items ORDER BY 1");
    for day in days.lines() {
        let name = day.replace('-', "_");
        postgres.sql(&format!(
            "CREATE TABLE plain_{name} PARTITION OF plain FOR VALUES FROM ('{day} 00:00:00+00') TO (timestamptz '{day} 00:00:00+00' + interval '1 day')"
        ));
    }
    postgres.sql(&format!("COPY (SELECT * FROM items) TO '{file}'"));
}

/// Fills the tables with what so many machines leave behind. A machine works one of two shifts on five days.
fn fill(postgres: &Postgres, machines: u64, days: u64) {
    let sql = |what: &str, statement: &str| {
        let began = Instant::now();
        postgres.sql(statement);
        println!("{what}: {:.0} s", began.elapsed().as_secs_f64());
    };
    sql("boxes", &format!("
        INSERT INTO boxes (box, machine, named_at) SELECT 'box-' || n, 'Machine ' || n, now() FROM generate_series(1, {machines}) AS n;
        INSERT INTO series (name, unit) VALUES ('spindle_power_w', 'W'), ('total_power_w', 'W'), ('machine_state', '');
        INSERT INTO series (name, unit) SELECT 'channel_' || n, '1' FROM generate_series(1, 10) AS n;
        CREATE TABLE pool AS SELECT n, array_agg((random() * 5000)::real) AS sixty, (array_agg((random() * 5000)::real))[1:24] AS day
          FROM generate_series(0, 999) AS n, generate_series(1, 60) GROUP BY n;
        CREATE TABLE working AS SELECT hour FROM generate_series(date_trunc('hour', now()) - interval '{days} days', date_trunc('hour', now()) - interval '1 hour', interval '1 hour') AS hour
          WHERE extract(hour FROM hour) BETWEEN 6 AND 21 AND extract(isodow FROM hour) < 6"));
    for table in ["minute_means", "hour_means", "day_means", "state_list", "part_list", "operation_list"] {
        postgres.sql(&format!(
            "DO $$ DECLARE m date; BEGIN FOR m IN SELECT generate_series(date_trunc('month', now() - interval '{days} days')::date, now()::date, interval '1 month') LOOP
               EXECUTE format('CREATE TABLE {table}_%s PARTITION OF {table} FOR VALUES FROM (%L) TO (%L) {}', to_char(m, 'YYYY_MM'), m, m + interval '1 month'); END LOOP; END $$",
            if table.ends_with("means") { "WITH (fillfactor = 80, toast_tuple_target = 256)" } else { "" }
        ));
    }
    sql("a year of minutes", "
        INSERT INTO minute_means SELECT 1, box_id, hour, mean.sixty, least.sixty, mean.sixty, array_fill(60::real, ARRAY[60])
        FROM working, boxes, pool AS mean, pool AS least
        WHERE mean.n = (box_id * 31 + extract(epoch FROM hour)::bigint / 3600) % 1000 AND least.n = mean.n ORDER BY hour, box_id");
    sql("a year of hours", "
        INSERT INTO hour_means SELECT series_id, box_id, days.day, pool.day, pool.day, pool.day, array_fill(3600::real, ARRAY[24])
        FROM (SELECT DISTINCT date_trunc('day', hour) AS day FROM working) AS days, boxes, series, pool
        WHERE unit <> '' AND pool.n = (box_id * 31 + series_id * 7 + extract(epoch FROM days.day)::bigint / 86400) % 1000 ORDER BY days.day, box_id");
    sql("a year of parts", "
        INSERT INTO part_list (sequence, began, ended, box_id, part, program, count, cutting_s, energy_j, detail) SELECT row_number() OVER (), hour, hour + n * interval '20 minutes' + interval '19 minutes', box_id, '', 'O' || (box_id % 50), 1, 900, 100000 + random() * 1e6, NULL
        FROM working, boxes, generate_series(0, 1) AS n ORDER BY hour");
    sql("three months of states", "
        INSERT INTO state_list (sequence, since, until, box_id, state, program, tool, reason) SELECT row_number() OVER (), hour + n * interval '8 minutes', hour + (n + 1) * interval '8 minutes', box_id,
          (ARRAY['standby', 'idle', 'cutting', 'cutting'])[1 + n % 4], 'O1', 'T1', NULL
        FROM working, boxes, generate_series(0, 6) AS n WHERE hour > now() - interval '90 days' ORDER BY hour");
    sql("newest values", "
        INSERT INTO box_latest SELECT box_id, now(), now(), 1, (SELECT jsonb_object_agg(series_id, jsonb_build_array(extract(epoch FROM now())::bigint * 1000000, 5.5)) FROM series) FROM boxes");
    fill_raw(postgres);
    // A plan for each shift, scrap every three hours, an order every five.
    sql("facts", "
        INSERT INTO fact_list (box_id, since, until, fact, value, mark, at, sequence)
        SELECT box_id, day + shift * interval '8 hours', day + shift * interval '8 hours' + interval '7 hours', 'planned_time', '', concat('p', day, shift), day, 1
        FROM boxes, generate_series(date_trunc('day', now()) - interval '90 days', now(), interval '1 day') AS day, generate_series(0, 2) AS shift;
        INSERT INTO fact_list (box_id, since, fact, value, parts, mark, at, sequence)
        SELECT box_id, told, kind.fact, kind.fact, 1, concat(kind.fact, told), told, 1
        FROM boxes, (VALUES ('scrap', 3), ('order', 5)) AS kind (fact, hours), generate_series(now() - interval '90 days', now(), hours * interval '1 hour') AS told");
    sql("analysis", "ANALYZE");
}

/// A month of raw values of twenty machines, an item every eight seconds of the working hours.
fn fill_raw(postgres: &Postgres) {
    let began = Instant::now();
    for day in 0..31 {
        postgres.sql(&format!(
            "DO $$ DECLARE d timestamptz := date_trunc('day', now()) - interval '{day} days'; BEGIN
               EXECUTE format('CREATE TABLE items_%s PARTITION OF items FOR VALUES FROM (%L) TO (%L)', to_char(d, 'YYYY_MM_DD'), d, d + interval '1 day');
               INSERT INTO items (sequence, at, at_ns, arrived, box_id, historical, kind, series, numbers, texts, reasons) SELECT row_number() OVER (), hour + second * interval '1 second', 0, now(), box_id, false, 'sample', '{{1,2,4,5,6,7,8,9,10,11}}',
                 pool.sixty[1:10]::float8[], '{{}}', '{{}}'
               FROM working, boxes, generate_series(0, 3599, 8) AS second, pool
               WHERE hour >= d AND hour < d + interval '1 day' AND box_id <= 20 AND pool.n = (second * 13 + box_id) % 1000; END $$"
        ));
    }
    println!("a month of raw values of 20 machines: {:.0} s", began.elapsed().as_secs_f64());
}

/// Planning and execution of a statement, ms.
fn milliseconds(postgres: &Postgres, statement: &str) -> f64 {
    let said = postgres.sql(&format!("EXPLAIN (ANALYZE, TIMING OFF) {statement}"));
    let of = |name: &str| {
        let line = said.lines().rev().find_map(|line| line.strip_prefix(name)).expect("told");
        line.trim_end_matches(" ms").trim().parse::<f64>().expect("a number")
    };
    of("Planning Time:") + of("Execution Time:")
}

#[test]
#[ignore = "40 minutes: the questions of a shop with a year of 1,000 machines; needs 8 GB of disk"]
fn questions_with_a_year_of_a_thousand_machines() {
    let settings = ["fsync=off", "shared_buffers=1GB", "max_wal_size=8GB", "work_mem=64MB", "effective_cache_size=4GB"];
    let Some(postgres) = Postgres::with(&[], |_| {}, &settings) else { return };
    // The tables as `fleet ingest` makes them.
    postgres.sql(&stdout(&run(&["fleet", "sql", "tables"])));
    let (machines, days) = (setting("FLEET_MACHINES", 1000), setting("FLEET_DAYS", 365));
    fill(&postgres, machines, days);
    println!(
        "{machines} machines, {days} days: {}",
        postgres.sql("SELECT pg_size_pretty(pg_database_size(current_database()))")
    );
    let question = |name: &str| stdout(&run(&["fleet", "sql", name]));
    let minutes = "SELECT machine, date_trunc('hour', at), sum(mean * seconds) / sum(seconds) FROM minutes
        WHERE name = 'spindle_power_w' AND hour >= now() - interval '7 days' GROUP BY 1, 2";
    let raw = "SELECT machine, sum(number * seconds) / sum(seconds) FROM readings
        WHERE name = 'spindle_power_w' AND box = 'box-7' AND valid_from >= now() - interval '1 day' AND number IS NOT NULL GROUP BY machine";
    let rows = [
        ("states now", question("machines-now"), 50.0),
        ("energy per part and machine, last week", question("energy-per-part"), 1000.0),
        ("one series over all machines, last week, by hour", question("series-over-machines"), 3000.0),
        ("the same from the minutes", minutes.to_owned(), 3000.0),
        ("OEE per shift, last week", question("oee-per-shift"), 1000.0),
        ("mean power of each machine, six hours of raw values", question("mean-by-machine"), 5000.0),
        ("mean of one machine over a day from raw values", raw.to_owned(), 1000.0),
    ];
    for (what, statement, aim_ms) in rows {
        let statement = statement.trim_end().trim_end_matches(';');
        let mut times: Vec<f64> = (0..5).map(|_| milliseconds(&postgres, statement)).collect();
        let first = times[0];
        times.sort_by(f64::total_cmp);
        let met = if times[2] <= aim_ms { "met" } else { "MISSED" };
        println!("{what}: median {:.0} ms of 5, first {first:.0} ms; aim {aim_ms:.0} ms {met}", times[2]);
    }
}
