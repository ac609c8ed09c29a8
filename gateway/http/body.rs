//! The body of a request, which is here before the handler is asked: in memory, or in a file where it may be long. Its length and its
//! pace have limits.

use super::ServerState;
use super::blocking::run_blocking;
use super::problem::ApiProblem;
use axum::body::{Body, BodyDataStream, Bytes};
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use gateway_diagnosis::arriving::{ArrivalError, ArrivingFile};
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;
use tokio::time::{Instant, timeout_at};
use tokio_stream::StreamExt;

/// The first bytes come within this time, and the next ones within it after those before.
const WITHIN: Duration = Duration::from_secs(10);
/// Every second beyond it has to bring so many. The slowest radio link of a shop brings ten times as many.
const BYTES_PER_SECOND_MIN: u64 = 64 << 10;
/// So many bytes are written into a file at once.
const BLOCK: usize = 128 << 10;

/// Why there is no whole body.
#[derive(Debug, Error)]
enum BodyError {
    /// More came than may.
    #[error("the body is too long")]
    TooLong,
    /// Less came than has to, in so much time.
    #[error("the body comes too slowly")]
    TooSlow(Duration),
    /// The client stopped sending, or sent what is no body.
    #[error("the body broke off: {0}")]
    BrokeOff(axum::Error),
}

impl BodyError {
    fn to_problem(&self, most: usize) -> ApiProblem {
        match self {
            Self::TooLong => ApiProblem::too_large(most),
            Self::TooSlow(waited) => ApiProblem::request_timeout(*waited),
            Self::BrokeOff(_) => ApiProblem::bad_request(self.to_string(), "send it again"),
        }
    }
}

/// The pieces of a body, no more than it may have bytes, each in time.
struct PacedPieces {
    pieces: BodyDataStream,
    began: Instant,
    came: usize,
    most: usize,
}

impl PacedPieces {
    fn new(body: Body, most: usize) -> Self {
        Self { pieces: body.into_data_stream(), began: Instant::now(), came: 0, most }
    }

    /// The next piece; `None` at the end.
    async fn next(&mut self) -> Result<Option<Bytes>, BodyError> {
        let until = next_is_due(self.began, Instant::now(), self.came);
        let piece = match timeout_at(until, self.pieces.next()).await {
            Err(_) => return Err(BodyError::TooSlow(self.began.elapsed())),
            Ok(None) => return Ok(None),
            Ok(Some(piece)) => piece.map_err(BodyError::BrokeOff)?,
        };
        if piece.len() > self.most - self.came {
            return Err(BodyError::TooLong);
        }
        self.came += piece.len();
        Ok(Some(piece))
    }
}

/// When the next piece has to be here, of a body of which so much has come.
fn next_is_due(began: Instant, now: Instant, came: usize) -> Instant {
    let earned = Duration::from_secs(came as u64 / BYTES_PER_SECOND_MIN);
    (now + WITHIN).min(began + WITHIN + earned)
}

/// The length that the head tells; one that is too long is refused before any of it has come.
fn read_length(headers: &HeaderMap, most: usize) -> Result<Option<u64>, ApiProblem> {
    let told = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    if told.is_some_and(|length| length > most as u64) { Err(ApiProblem::too_large(most)) } else { Ok(told) }
}

/// The request with its whole body in memory.
pub(super) async fn with_body(request: Request, most: usize) -> Result<Request, ApiProblem> {
    let (parts, body) = request.into_parts();
    read_length(&parts.headers, most)?;
    let bytes = collect_body(body, most).await.map_err(|error| error.to_problem(most))?;
    Ok(Request::from_parts(parts, Body::from(bytes)))
}

/// The whole body, which takes no more memory than it may have bytes.
async fn collect_body(body: Body, most: usize) -> Result<Vec<u8>, BodyError> {
    let mut pieces = PacedPieces::new(body, most);
    let mut bytes = Vec::new();
    while let Some(piece) = pieces.next().await? {
        bytes.extend_from_slice(&piece);
    }
    debug_assert!(bytes.len() <= most, "each piece was measured before it was taken");
    Ok(bytes)
}

/// The request without its body, which is in a file: an `Arc<ArrivingFile>` among the extensions. Nothing is left of a body that broke off,
/// is too long, too slow, or has no room.
pub(super) async fn with_body_in_file(
    request: Request,
    most: usize,
    shared: &ServerState,
) -> Result<Request, ApiProblem> {
    let (mut parts, body) = request.into_parts();
    let told = read_length(&parts.headers, most)?;
    let files = shared.require_files()?.clone();
    let mut file = run_blocking(move || files.receive(told).map_err(describe_arrival_error)).await?;
    let mut pieces = PacedPieces::new(body, most);
    let mut block = Vec::with_capacity(BLOCK);
    while let Some(piece) = pieces.next().await.map_err(|error| error.to_problem(most))? {
        block.extend_from_slice(&piece);
        if block.len() >= BLOCK {
            (file, block) = write_block(file, block).await?;
        }
    }
    (file, _) = write_block(file, block).await?;
    parts.extensions.insert(Arc::new(file));
    Ok(Request::from_parts(parts, Body::empty()))
}

async fn write_block(mut file: ArrivingFile, mut block: Vec<u8>) -> Result<(ArrivingFile, Vec<u8>), ApiProblem> {
    run_blocking(move || {
        file.append(&block).map_err(describe_arrival_error)?;
        block.clear();
        Ok((file, block))
    })
    .await
}

pub(super) fn describe_arrival_error(error: ArrivalError) -> ApiProblem {
    let hint = match error {
        ArrivalError::NoRoom { .. } => "make room on the disk of the data directory, or bring a shorter file",
        ArrivalError::Io(_) => "look at the data directory",
    };
    ApiProblem::unavailable(error.to_string(), hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_body_is_taken_up_to_its_greatest_length() {
        let pieces = |lengths: &[usize]| {
            let pieces: Vec<_> = lengths.iter().map(|length| Ok::<_, std::io::Error>(vec![b'a'; *length])).collect();
            Body::from_stream(tokio_stream::iter(pieces))
        };
        for (lengths, fits) in [(&[][..], true), (&[4, 4], true), (&[4, 4, 1], false), (&[9], false)] {
            let taken = collect_body(pieces(lengths), 8).await;
            assert_eq!(taken.is_ok(), fits, "{lengths:?}");
            assert!(fits || matches!(taken, Err(BodyError::TooLong)), "{lengths:?}");
        }
        let broken = tokio_stream::iter([Ok(vec![b'a']), Err(std::io::Error::other("length limit"))]);
        let said = collect_body(Body::from_stream(broken), 8).await.expect_err("broken off");
        assert_eq!(said.to_string(), "the body broke off: length limit", "what is said decides nothing");
    }

    #[test]
    fn a_body_that_goes_on_is_waited_for_and_one_that_drips_is_not() {
        let began = Instant::now();
        let until_s = |at_s: u64, came: usize| {
            let until = next_is_due(began, began + Duration::from_secs(at_s), came);
            until.duration_since(began).as_secs()
        };
        assert_eq!(until_s(0, 0), 10, "the first bytes");
        assert_eq!(until_s(9, 100), 10, "a byte now and then does not help");
        assert_eq!(until_s(60, 60 << 20), 70, "what goes on may pause");
        assert_eq!(until_s(60, 55 * (64 << 10)), 65, "what is slow has little time left");
    }
}
