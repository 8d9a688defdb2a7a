//! docs/tutorial-space.md: its code is that of the examples, and its output what they print.

use std::fs;
use std::path::{Path, PathBuf};

#[path = "../examples/tutorial_1_light.rs"]
#[allow(dead_code, reason = "the test calls what `main` prints")]
mod part_1;
#[path = "../examples/tutorial_2_error.rs"]
#[allow(dead_code, reason = "the test calls what `main` prints")]
mod part_2;
#[path = "../examples/tutorial_3_by_hand.rs"]
#[allow(dead_code, reason = "the test calls what `main` prints")]
mod part_3;
#[path = "../examples/tutorial_4_clip.rs"]
#[allow(dead_code, reason = "the test calls what `main` prints")]
mod part_4;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// Blocks of a page that begin with a fence.
fn blocks(page: &str, fence: &str) -> Vec<String> {
    let fence = format!("```{fence}\n");
    page.split(&fence).skip(1).map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn the_tutorial_of_space_is_right() {
    let page = fs::read_to_string(root().join("../../docs/tutorial-space.md")).unwrap();
    let examples = ["1_light", "2_error", "3_by_hand", "4_clip"].map(|name| {
        fs::read_to_string(root().join(format!("examples/tutorial_{name}.rs"))).unwrap()
    });
    let lines: Vec<&str> = examples.iter().flat_map(|text| text.lines()).map(str::trim).collect();
    for block in blocks(&page, "rust") {
        for line in block.lines().map(str::trim).filter(|line| !line.is_empty()) {
            assert!(lines.contains(&line), "`{line}` is in no example");
        }
    }
    let said = [part_1::text(), part_2::text(), part_3::text(), part_4::text()];
    let said: Vec<String> = said.into_iter().map(Result::unwrap).collect();
    let printed = blocks(&page, "text");
    for (k, said) in said.iter().enumerate() {
        assert_eq!(printed.get(k), Some(said), "part {} prints\n{said}", k + 1);
    }
}
