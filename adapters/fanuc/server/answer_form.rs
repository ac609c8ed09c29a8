//! What an answer is made of, whatever it is about: data or a return code, and the stretch of memory of a question.

use fanuc::item::{Area, PmcWidth, Stretch};
use fanuc::wire::Request;

/// What a question yields: data, or a return code.
pub(super) type Data8 = Result<Vec<u8>, i16>;

/// No such function, wrong length, wrong number, wrong type.
pub(super) const FUNC: i16 = 1;
pub(super) const LENGTH: i16 = 2;
pub(super) const NUMBER: i16 = 3;
pub(super) const ATTRIB: i16 = 4;

/// The stretch of PMC memory that a question is about.
pub(super) fn parse_stretch(request: &Request) -> Result<Stretch, i16> {
    let [from, to, area, width, _] = request.arguments;
    let at = |at: i32| u16::try_from(at).map_err(|_| NUMBER);
    let (area, width) = (Area::of_number(area).ok_or(ATTRIB)?, PmcWidth::of_number(width).ok_or(ATTRIB)?);
    Ok(Stretch { area, from: at(from)?, to: at(to)?, width })
}
