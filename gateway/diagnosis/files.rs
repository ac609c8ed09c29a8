//! Files that persons bring to the page, and the diagnoses of them: kept in a folder of the data directory, so that they can be looked at and compared
//! later. The work is done by the same child process as a diagnosis of the history, one at a time.

use super::arriving::{ArrivalError, ArrivingFile, find_room};
use super::child::{DiagnosisJob, JobInput};
use super::clicked_map::ClickedMap;
use super::handle::{DiagnosisHandle, DiagnosisRefusal};
use super::preview;
use super::request::DiagnosisRequest;
use super::store::{DiagnosisStore, diagnosis_key};
use super::worker::in_child;
use adapter_core::clock::TimeNs;
use adapter_core::threads::receive_work;
use gateway_base::files::{read_text, replace_file};
use recording::Mapping;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};
use std::time::{Duration, Instant};

/// Files that are kept, and bytes of all of them; of more the oldest goes.
const FILES_MAX: usize = 20;
const KEPT_BYTES_MAX: usize = 640 << 20;
/// Diagnoses that are listed.
const RESULTS_MAX: usize = 40;
/// A longer index is not read, bytes.
const INDEX_MAX: usize = 8 << 20;

/// So long is waited for the files that others have asked for.
const READ_WAIT: Duration = Duration::from_secs(8);
/// Time between two looks whether it is over.
const READ_LOOK: Duration = Duration::from_millis(20);

/// Other files are being read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("other files are being read")]
pub struct FilesBusy;

/// A file that was brought.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BroughtFile {
    /// Digest of the content, 16 hexadecimal digits; names the file in the interface and on disk.
    pub key: String,
    /// As it was called.
    pub name: String,
    /// When, milliseconds since 1970.
    pub at_ms: i64,
    /// How long it is.
    pub bytes: usize,
}

/// A finished diagnosis of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileDiagnosis {
    /// Key of what is kept of it.
    pub key: String,
    /// Name of the file.
    pub file: String,
    /// The person who asked for it, where one is known.
    pub by: Option<String>,
    /// When, milliseconds since 1970.
    pub at_ms: i64,
    /// The word of the verdict, as in `diagnosis/1`.
    pub verdict: String,
    /// What was found, in English, as the history keeps it.
    pub summary: String,
    /// Kinds of the missing effects, most important first.
    pub missing: Vec<String>,
    /// The whole diagnosis, `diagnosis/1`.
    pub diagnosis: serde_json::Value,
}

/// Why a map that was clicked is not kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MapRefusal {
    /// Other files are being read.
    Busy,
    /// The file would be read otherwise, or it is no map; in words.
    Refused(String),
}

/// See the [module](self). Clones are handles of the same.
#[derive(Debug, Clone)]
pub struct FileDiagnoses {
    directory: PathBuf,
    handle: DiagnosisHandle,
    /// Held while the list of files is changed.
    list: Arc<Mutex<()>>,
    /// Held while a file is read: one at a time, whoever asks.
    reading: Arc<Mutex<()>>,
}

impl FileDiagnoses {
    /// Below this data directory; a thread waits for what is asked.
    ///
    /// # Errors
    /// No thread could be started.
    pub fn from_data_dir(data_dir: &Path) -> std::io::Result<Self> {
        let directory = data_dir.join("recordings");
        let (requests, asked) = sync_channel(1);
        let kept = DiagnosisStore::from_directory(directory.join("diagnoses"));
        // No machine runs beside a file: neither its model nor its history are there.
        let (model, history) = (directory.join("model.toml"), directory.join("history.db"));
        let handle = DiagnosisHandle::new(requests, model, history, kept);
        let own = Self { directory, handle, list: Arc::default(), reading: Arc::default() };
        // What was arriving when the process before this one ended never came to its end.
        let _there_was_none = std::fs::remove_dir_all(own.arriving());
        let (index, kept) = (own.index(), own.handle.diagnosis_store().clone());
        // The thread holds no handle that could ask: it ends when the last one outside is gone.
        let state = own.handle.without_requests();
        std::thread::Builder::new()
            .name("files".to_owned())
            .spawn(move || run_requests(&asked, &state, &kept, &index))?;
        Ok(own)
    }

    /// What is being done.
    #[must_use]
    pub fn handle(&self) -> &DiagnosisHandle {
        &self.handle
    }

    fn index(&self) -> PathBuf {
        self.directory.join("diagnoses.json")
    }

    /// The files, newest first.
    #[must_use]
    pub fn list_files(&self) -> Vec<BroughtFile> {
        let text = read_text(&self.directory.join("files.json"), INDEX_MAX).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// A file of so many bytes begins to arrive; of how many is not known where its sender does not say.
    ///
    /// # Errors
    /// The disk has no room for it, or the folder cannot be written.
    pub fn receive(&self, bytes: Option<u64>) -> Result<ArrivingFile, ArrivalError> {
        ArrivingFile::create(&self.arriving(), bytes.unwrap_or(0))
    }

    /// Bytes that files may still take; `None` where the system does not tell.
    #[must_use]
    pub fn find_free_bytes(&self) -> Option<u64> {
        find_room(&self.directory).map(|room| room.free_bytes)
    }

    fn arriving(&self) -> PathBuf {
        self.directory.join("arriving")
    }

    /// Keeps a file that has arrived.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn keep(&self, arrived: &ArrivingFile, name: &str, at_ms: i64) -> std::io::Result<BroughtFile> {
        let key = format!("{:016x}", arrived.digest());
        let file = BroughtFile { key: key.clone(), name: sanitize_name(name), at_ms, bytes: arrived.bytes() };
        let folder = self.directory.join(&key);
        let _guard = self.list.lock().unwrap_or_else(PoisonError::into_inner);
        std::fs::create_dir_all(&folder)?;
        arrived.take_place(&folder.join("data"))?;
        // Whoever brings it again wants it read again.
        preview::forget_answers(&folder.join("data"));
        let mut files = self.list_files();
        files.retain(|known| known.key != key);
        files.insert(0, file.clone());
        for gone in files.split_off(count_kept(&files)) {
            let _already_gone = std::fs::remove_dir_all(self.directory.join(gone.key));
        }
        replace_file(&self.directory.join("files.json"), &serde_json::to_string(&files)?)?;
        Ok(file)
    }

    /// Keeps a file that is in memory.
    ///
    /// # Errors
    /// The disk has no room for it, or the folder cannot be written.
    pub fn add(&self, name: &str, bytes: &[u8], at_ms: i64) -> Result<BroughtFile, ArrivalError> {
        let mut arriving = self.receive(Some(bytes.len() as u64))?;
        arriving.append(bytes)?;
        Ok(self.keep(&arriving, name, at_ms)?)
    }

    /// The path of a file; `None` where there is none of this key.
    #[must_use]
    pub fn find_path(&self, key: &str) -> Option<PathBuf> {
        let known = self.list_files().into_iter().any(|file| file.key == key);
        known.then(|| self.directory.join(key).join("data"))
    }

    /// How a file is understood, as a document: read by a child process, once, and kept. A file that the child did not survive is set
    /// aside and not read again until somebody brings it again or changes its map.
    ///
    /// # Errors
    /// Other files are being read.
    pub fn describe_file(&self, file: &BroughtFile) -> Result<serde_json::Value, FilesBusy> {
        let path = self.directory.join(&file.key).join("data");
        self.with_reading(|| preview::read_answer(&path), || preview::describe_in_child(&path, &file.name))
    }

    /// The map that a person clicked, as text, after the file was read back under it by a child process.
    ///
    /// # Errors
    /// See [`MapRefusal`].
    pub fn propose_map(&self, file: &BroughtFile, clicked: &ClickedMap) -> Result<String, MapRefusal> {
        let path = self.directory.join(&file.key).join("data");
        let read = || preview::propose_in_child(&path, &file.name, clicked);
        self.with_reading(|| None, read)
            .map_err(|FilesBusy| MapRefusal::Busy)?
            .map_err(|refusal| MapRefusal::Refused(refusal.to_string()))
    }

    /// What is known already, or what a child says when it is this one's turn.
    fn with_reading<T>(&self, known: impl Fn() -> Option<T>, read: impl FnOnce() -> T) -> Result<T, FilesBusy> {
        let until = Instant::now() + READ_WAIT;
        loop {
            if let Some(known) = known() {
                return Ok(known);
            }
            match self.reading.try_lock() {
                Ok(_guard) => return Ok(read()),
                Err(TryLockError::Poisoned(held)) => {
                    let _guard = held.into_inner();
                    return Ok(read());
                }
                Err(TryLockError::WouldBlock) if Instant::now() >= until => return Err(FilesBusy),
                Err(TryLockError::WouldBlock) => {}
            }
            std::thread::sleep(READ_LOOK);
        }
    }

    /// Puts a map beside a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn set_map(&self, path: &Path, toml: &str) -> std::io::Result<()> {
        preview::forget_answers(path);
        replace_file(&Mapping::build_path_beside(path), toml)
    }

    /// The finished diagnoses, newest first.
    #[must_use]
    pub fn list_results(&self) -> Vec<FileDiagnosis> {
        read_results(&self.index())
    }

    /// Asks for a diagnosis of a file.
    ///
    /// # Errors
    /// One is under way.
    pub fn request_diagnosis(
        &self,
        by: String,
        toml: String,
        path: PathBuf,
        simulated: Option<String>,
        at_ns: TimeNs,
    ) -> Result<(), DiagnosisRefusal> {
        self.handle.submit_request(DiagnosisRequest {
            toml,
            by: Some(by),
            from_ns: at_ns,
            to_ns: at_ns,
            onsets: Vec::new(),
            file: Some((path, simulated)),
        })
    }
}

/// How many of the files, newest first, are kept. The newest is, however long it is.
fn count_kept(files: &[BroughtFile]) -> usize {
    let mut bytes = 0;
    let fits = |file: &&BroughtFile| {
        bytes += file.bytes;
        bytes <= KEPT_BYTES_MAX
    };
    files.iter().take(FILES_MAX).take_while(fits).count().max(1)
}

/// A name without a path, and not longer than a line.
fn sanitize_name(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
    last.chars().filter(|c| !c.is_control()).take(120).collect()
}

fn read_results(index: &Path) -> Vec<FileDiagnosis> {
    let text = read_text(index, INDEX_MAX).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

fn run_requests(asked: &Receiver<DiagnosisRequest>, handle: &DiagnosisHandle, kept: &DiagnosisStore, index: &Path) {
    while let Some(request) = receive_work("files", asked) {
        let DiagnosisRequest { toml, by, to_ns, file, .. } = request;
        let Some((path, simulated)) = file else { continue };
        let name = index.parent().map(|directory| name_of(directory, &path)).unwrap_or_default();
        let job = DiagnosisJob {
            toml,
            input: JobInput::File { path, simulated, at_ns: to_ns },
            kept: kept.directory().to_owned(),
        };
        let found = in_child(&job, handle);
        if let Ok((row, missing)) = &found {
            let mut all = read_results(index);
            let result = FileDiagnosis {
                key: diagnosis_key(row),
                file: name,
                by,
                at_ms: row.to_ns.div_euclid(1_000_000),
                verdict: row.verdict.clone(),
                summary: row.summary.clone(),
                missing: missing.clone(),
                diagnosis: serde_json::from_str(&row.json).unwrap_or_default(),
            };
            all.retain(|known| known.key != result.key);
            all.insert(0, result);
            all.truncate(RESULTS_MAX);
            let _told_by_the_handle = serde_json::to_string(&all).map(|text| replace_file(index, &text));
        }
        handle.record_outcome(found.as_ref().map(|(row, _)| diagnosis_key(row)).map_err(Clone::clone));
    }
}

fn name_of(directory: &Path, path: &Path) -> String {
    let key = path.parent().and_then(Path::file_name).map(|key| key.to_string_lossy().into_owned()).unwrap_or_default();
    let text = read_text(&directory.join("files.json"), INDEX_MAX).unwrap_or_default();
    let files: Vec<BroughtFile> = serde_json::from_str(&text).unwrap_or_default();
    files.into_iter().find(|file| file.key == key).map_or(key, |file| file.name)
}
