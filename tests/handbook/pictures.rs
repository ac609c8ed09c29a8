//! The figures in the pictures of README add up.

use crate::documents::{documents, root};
use serde_json::Value as Json;
use sha2::{Digest, Sha256};

#[test]
fn pictures_of_the_readme_show_figures_that_add_up() {
    let readme = documents().into_iter().find(|document| document.name == "README.md").expect("there is one");
    let pictures: Vec<String> = readme.links().into_iter().filter(|link| link.ends_with(".png")).collect();
    assert!(pictures.len() >= 2, "{pictures:?}");
    for picture in pictures {
        let path = root().join(&picture);
        let again = "make it anew: cargo test --test box pictures_of_the_readme -- --ignored";
        let text =
            std::fs::read_to_string(path.with_extension("json")).unwrap_or_else(|error| panic!("{error}: {again}"));
        let told: Json = serde_json::from_str(&text).expect("JSON");
        // A release may leave the pictures out, and shows their captions; the figures are there all the same.
        if let Ok(bytes) = std::fs::read(&path) {
            let sum: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
            assert_eq!(
                told["sha256"],
                sum.as_str(),
                "{picture} is not the one of which the figures were read; {again}"
            );
        }
        let parts = told["parts_w"].as_array().expect("figures");
        let added: f64 = parts.iter().map(|it| it.as_f64().expect("a number")).sum();
        let whole = told["sum_w"].as_f64().expect("a number");
        assert!((added - whole).abs() < 0.05, "{picture} shows {parts:?}, which make {added}, against {whole}");
    }
}
