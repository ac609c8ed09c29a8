//! Parquet as others write it: every way of packing its pages comes to the same numbers.

use crate::fleet::partitions::duckdb;
use adapters::recording::{Mapping, read_path_as};

/// What `DuckDB` may write.
const CODECS: [&str; 7] = ["uncompressed", "snappy", "gzip", "zstd", "brotli", "lz4", "lz4_raw"];
const VERSIONS: [&str; 2] = ["V1", "V2"];

#[test]
fn parquet_of_every_codec_comes_to_the_same_numbers() {
    let directory = tempfile::tempdir().expect("a directory");
    let rows = "SELECT range * 0.1 AS time_s, 'r' || (range // 1000) AS run, 800 + range % 7 AS spindle_speed_rpm, \
                1000 + 3.25 * (range % 1013) AS spindle_power_w FROM range(5000)";
    for codec in CODECS {
        for version in VERSIONS {
            let file = format!("{codec}_{version}.parquet");
            let copy =
                format!("COPY ({rows}) TO '{file}' (FORMAT parquet, COMPRESSION {codec}, PARQUET_VERSION {version})");
            if duckdb(directory.path(), &copy).is_none() {
                return;
            }
            let read = read_path_as(&directory.path().join(&file), &Mapping::default());
            let recording = read.unwrap_or_else(|error| panic!("{file}: {error}")).recording;
            assert_eq!(recording.count_rows(), 5000, "{file}");
            let power = recording.find_numbers("spindle_power_w").expect("a column of the file");
            for row in 0..5000 {
                let written = 1000.0 + 3.25 * (row % 1013) as f64;
                assert_eq!(power.get(row), Some(written), "{file}, row {row}");
            }
        }
    }
}
