//! The chapter of the handbook about FANUC shows what the program has.

use adapters::fanuc::table::format_markdown;

#[test]
fn the_handbook_shows_the_table_of_the_wire() {
    let chapter = include_str!("../../../gateway/handbook/fanuc.md");
    assert!(chapter.contains(&format_markdown()), "put this into gateway/handbook/fanuc.md:\n{}", format_markdown());
}
