//! The parsers, each with inputs that are right.

use adapters::address::Address;
use adapters::fanuc::decode;
use adapters::fanuc::generation::{Generation, Opening};
use adapters::fanuc::item::FocasItem;
use adapters::fanuc::request;
use adapters::fanuc::wire::{FocasFrame, FrameKind, encode_frame, parse_replies, parse_requests, request_body};
use adapters::fanuc_server::{Controller, answer_body};
use adapters::modbus::pdu::{self, RegisterTable};
use adapters::modbus::profile;
use adapters::nclink::model::Model;
use adapters::nclink::sample::SampleBlock;
use adapters::recording::{Mapping, read_csv, read_path};
use adapters::waveform::WaveformHeader;
use gateway::sinks::SinkAddress;
use gateway::{archive, config, state_file};
use rules::script::{ScriptFile, list_shipped_scripts, prepare_scripts};
use rules::twin::{parse_hypotheses, parse_model};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};

/// What is tried. Whatever comes out is right, as long as it comes.
pub(crate) struct Parser {
    pub(crate) name: &'static str,
    pub(crate) seeds: fn() -> Vec<Vec<u8>>,
    pub(crate) parse: fn(&[u8]),
}

/// Every one.
pub(crate) fn all() -> Vec<Parser> {
    let parser = |name, seeds, parse| Parser { name, seeds, parse };
    vec![
        parser("focas-answer", focas_answers, focas_answer),
        parser("focas-question", focas_questions, focas_question),
        parser("modbus", modbus_frames, modbus),
        parser(
            "modbus-profile",
            || files("adapters/modbus/profiles", "toml"),
            |bytes| {
                drop(profile::parse("own", "own.toml", &text(bytes)));
            },
        ),
        parser("nclink", nclink_messages, nclink),
        parser("waveform", waveform_headers, |bytes| drop(WaveformHeader::parse(&text(bytes)))),
        parser("csv", csv_files, |bytes| drop(read_csv(bytes, "own.csv"))),
        parser("workbook", || foreign(&["xlsx", "ods", "xls"]), |bytes| recording(bytes, "xlsx")),
        parser("matlab", || foreign(&["mat"]), |bytes| recording(bytes, "mat")),
        parser("labview", || foreign(&["tdms", "lvm"]), |bytes| recording(bytes, "tdms")),
        parser("mtconnect", || foreign(&["xml"]), |bytes| recording(bytes, "xml")),
        parser("mtconnect-agent", mtconnect_documents, mtconnect_document),
        parser("parquet", || foreign(&["parquet"]), |bytes| recording(bytes, "parquet")),
        parser("map", maps, |bytes| drop(Mapping::parse(&text(bytes), "own.map.toml"))),
        parser(
            "model",
            || files("gateway/http/gallery", "toml"),
            |bytes| {
                let text = text(bytes);
                drop((parse_model(&text), parse_hypotheses(&text)));
            },
        ),
        parser("script", scripts, |bytes| {
            drop(prepare_scripts(&[ScriptFile { name: "own.rhai".to_owned(), text: text(bytes) }]))
        }),
        parser("config", configs, |bytes| drop(config::parse("own.toml", &text(bytes), Path::new("."), []))),
        parser("address", addresses, |bytes| {
            let text = text(bytes);
            drop((text.parse::<Address>(), text.parse::<SinkAddress>()));
        }),
        parser("archive", archives, |bytes| drop(archive::unpack(bytes))),
        parser("learned", learned_states, |bytes| {
            let _state = state_file::state_of(&text(bytes));
        }),
    ]
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The files of a folder with this ending, in the order of their names.
fn files(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    let entries = fs::read_dir(root().join(folder)).expect("there").map(|entry| entry.expect("readable").path());
    let mut paths: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == ending)).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("readable")).collect()
}

/// Recordings of other programs of these kinds, compressed ones unpacked, and not the longest: changes to those do less a second.
fn foreign(endings: &[&str]) -> Vec<Vec<u8>> {
    let packed = |bytes: &Vec<u8>| bytes.len() < 60_000;
    let mut found: Vec<Vec<u8>> =
        endings.iter().flat_map(|end| files("tests/data/foreign", end)).filter(packed).collect();
    for entry in fs::read_dir(root().join("tests/data/foreign")).expect("there") {
        let path = entry.expect("readable").path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if endings.iter().any(|end| name.ends_with(&format!(".{end}.gz"))) {
            let mut bytes = Vec::new();
            let file = fs::File::open(&path).expect("readable");
            std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(file), &mut bytes).expect("whole");
            bytes.truncate(60_000);
            found.push(bytes);
        }
    }
    found.sort();
    found
}

fn recording(bytes: &[u8], ending: &str) {
    let directory = std::env::temp_dir().join(format!("cnc-gateway-fuzz-{}", std::process::id()));
    fs::create_dir_all(&directory).expect("a directory");
    let path = directory.join(format!("own.{ending}"));
    fs::write(&path, bytes).expect("written");
    drop(read_path(&path));
    let _gone = fs::remove_dir_all(&directory);
}

/// Questions of every form of answer.
fn items() -> Vec<FocasItem> {
    use adapters::fanuc::item::Position;
    vec![
        FocasItem::System,
        FocasItem::Status,
        FocasItem::StatusLong,
        FocasItem::Feed,
        FocasItem::SpindleSpeed,
        FocasItem::Alarms(8),
        FocasItem::AxisNames,
        FocasItem::Parameter(6711, -1),
        FocasItem::Position(Position::Machine, -1),
        FocasItem::ExecutedText(64),
        FocasItem::ProgramName,
        FocasItem::ProgramPath,
    ]
}

const VERSIONS: [u16; 3] = [2, 3, 4];

fn questions(version: u16) -> Vec<u8> {
    let all: Vec<_> =
        items().into_iter().map(|item| request::build_read_request(item, Generation::from_version(version))).collect();
    request_body(&all)
}

fn focas_questions() -> Vec<Vec<u8>> {
    VERSIONS.into_iter().map(|version| encode_frame(version, FrameKind::Request, &questions(version))).collect()
}

/// The served control, asked by a client that is not in order.
fn focas_question(bytes: &[u8]) {
    let Ok(frame) = FocasFrame::from_bytes(bytes) else { return };
    let Ok(requests) = parse_requests(&frame.body) else { return };
    for version in VERSIONS {
        drop(answer_body(&mut Controller::new(version, &["X", "Z"]), &requests));
    }
}

fn focas_answers() -> Vec<Vec<u8>> {
    let answers = |version: u16| {
        let asked = parse_requests(&questions(version)).expect("our own");
        encode_frame(version, FrameKind::Answer, &answer_body(&mut Controller::new(version, &["X", "Z"]), &asked))
    };
    VERSIONS.into_iter().map(answers).collect()
}

/// Our client, answered by a control that is not in order.
fn focas_answer(bytes: &[u8]) {
    let Ok(frame) = FocasFrame::from_bytes(bytes) else { return };
    let Ok(replies) = parse_replies(&frame.body) else { return };
    let generation = Generation::from_version(frame.version);
    for (item, reply) in items().into_iter().zip(&replies) {
        drop(decode::read_answer(item, generation, reply.data));
    }
    drop(Opening::read(generation, &frame.body, 1));
}

fn modbus_frames() -> Vec<Vec<u8>> {
    let block = pdu::RegisterBlock { table: RegisterTable::Holding, start: 0, count: 20 };
    let registers: Vec<u16> = (0..20).collect();
    vec![
        block.encode_request().to_vec(),
        pdu::encode_answer(RegisterTable::Input, &registers),
        pdu::encode_refusal(3, 2),
    ]
}

fn modbus(bytes: &[u8]) {
    let _block = pdu::parse_request(bytes);
    for (table, count) in [(RegisterTable::Holding, 20), (RegisterTable::Input, 20), (RegisterTable::Input, 125)] {
        drop(pdu::RegisterBlock { table, start: 0, count }.parse_answer(bytes));
    }
}

fn nclink_messages() -> Vec<Vec<u8>> {
    let item = |id: &str, name: &str| json!({ "id": id, "name": name, "type": name, "datatype": "double" });
    let model = json!({ "probe": { "name": "lathe", "devices": [{ "id": "01", "type": "MACHINE", "components": [
        { "id": "0101", "type": "CONTROLLER", "dataItems": [item("010101", "FEED_SPEED"), item("010102", "SPDL_SPEED")] }],
        "configs": [{ "id": "0102", "type": "SAMPLE_CHANNEL", "sampleInterval": 1, "uploadInterval": 100,
            "ids": [{ "id": "010101" }, { "id": "010102" }] }] }] } });
    let sample = json!({ "id": "0102", "beginTime": "1769847300100", "sampleInterval": 1,
        "data": [{ "data": [[1.5], [2.5], [3]] }, { "data": [["1200"], [1200], [null]] }] });
    [model, sample].iter().map(|message| message.to_string().into_bytes()).collect()
}

fn nclink(bytes: &[u8]) {
    let Ok(message) = serde_json::from_slice::<serde_json::Value>(bytes) else { return };
    let model = Model::parse(&message).unwrap_or_default();
    drop(SampleBlock::parse(&message, "0102", &model));
}

fn mtconnect_documents() -> Vec<Vec<u8>> {
    let mut all = files("tests/controllers/mtconnect", "xml");
    all.extend(foreign(&["xml"]));
    all
}

fn mtconnect_document(bytes: &[u8]) {
    drop(adapters::mtconnect::model::parse_devices(bytes));
    let mut reader = adapters::mtconnect::streams::StreamsReader::new(bytes);
    while let Ok(Some(_)) = reader.read_event() {}
}

fn waveform_headers() -> Vec<Vec<u8>> {
    let currents = WaveformHeader::with_currents(12_800.0, &["r", "s", "t"], 40.0, 32_000);
    [currents.encode_line(), WaveformHeader::with_amplitude(200.0, 40.0, 32_000).encode_line()]
        .map(String::into_bytes)
        .to_vec()
}

fn csv_files() -> Vec<Vec<u8>> {
    let mut all = foreign(&["csv", "txt"]);
    all.push(b"time_s,spindle_power_w,state\n0,100.5,ON\n0.1,101,ON\n0.2,,OFF\n".to_vec());
    all
}

fn maps() -> Vec<Vec<u8>> {
    let text = "schema = \"map/1\"\n[time]\ncolumn = \"Zeit\"\nunit = \"ms\"\norder = \"dmy\"\n\
                [columns.\"P (kW)\"]\nname = \"spindle_power_w\"\nunit = \"kW\"\n";
    vec![text.as_bytes().to_vec()]
}

fn scripts() -> Vec<Vec<u8>> {
    list_shipped_scripts().into_iter().map(|script| script.text.into_bytes()).collect()
}

fn configs() -> Vec<Vec<u8>> {
    let mut all = files("gateway/demo", "toml");
    all.extend([config::keys::format_example().into_bytes()]);
    all.extend(files("tests/data/messages", "toml"));
    all
}

fn addresses() -> Vec<Vec<u8>> {
    let all = [
        "fanuc://10.0.0.5:8193?write=mailbox&dial=R907&allow=EXT",
        "simulated://lathe?seed=7",
        "modbus-tcp://10.0.0.6:502?unit=1&profile=sdm630",
        "nclink://10.0.0.7:1883/00FFA?user=a&offset=5",
        "mtconnect://10.0.0.8:5000/Lathe?period_ms=500&spindle=S1",
        "eda9033a:///dev/ttyUSB0?unit=3",
        "mqtts://broker:8883/works/lathe?ca=ca.pem&protocol=5",
        "sparkplug://[fe80::1]:1883/plant/line/lathe?host=scada",
        "natss://a:4222,b:4222/cnc?tls_ca=ca.pem",
        "history:cnc-gateway-data/history.db?from=-8h",
    ];
    all.map(|text| text.as_bytes().to_vec()).to_vec()
}

fn archives() -> Vec<Vec<u8>> {
    let files =
        [("config.toml".to_owned(), b"[gateway]\n".to_vec()), ("scripts/own.rhai".to_owned(), vec![b'a'; 3000])];
    vec![archive::pack(&files, 1_769_847_300).expect("packed")]
}

fn learned_states() -> Vec<Vec<u8>> {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("wear.json");
    state_file::save_state(&path, "{\"edges\":[1,2,3]}").expect("saved");
    vec![fs::read(&path).expect("readable"), b"{\"edges\":[1]}".to_vec()]
}
