//! Circles between the files of a room: files of which each uses the other, at once or by way of more. There are none.
//!
//! Read from the text of every file: paths from `super`, `self` and `crate`, followed through what `mod.rs` re-exports. A
//! file counts together with the files in the folder of its name (`forest.rs` and `forest/plant.rs`).

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::layers::{crates_dir, sources, without_comments};

/// The crates, in none of which there is a circle.
const CRATES: [&str; 6] =
    ["relume-core", "relume-io", "relume", "relume-picture", "relume-judge", "relume-cli"];

/// A module, as its path from the crate's root.
type Module = Vec<String>;

/// The modules of a crate.
#[derive(Default)]
struct Source {
    /// Their text, without comments and unit tests.
    text: BTreeMap<Module, String>,
    /// Heads of folders (`mod.rs`), which are no files of their own.
    heads: BTreeSet<Module>,
}

impl Source {
    /// The file that a module counts to: the topmost one above it that is no head of a folder.
    fn file(&self, module: &Module) -> Module {
        let above = (1..=module.len()).map(|len| module[..len].to_vec());
        let is_file =
            |module: &Module| self.text.contains_key(module) && !self.heads.contains(module);
        above.clone().find(is_file).unwrap_or_else(|| module.clone())
    }
}

/// The modules of a crate's source folder.
fn modules(dir: &Path) -> Source {
    let module = |file: &Path| -> Module {
        let relative = file.strip_prefix(dir).unwrap().with_extension("");
        let mut parts: Module =
            relative.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
        parts.pop_if(|last| ["mod", "lib", "main"].contains(&last.as_str()));
        parts
    };
    let text = |file: &Path| {
        let text = without_comments(&fs::read_to_string(file).unwrap());
        text.split("#[cfg(test)]\nmod tests").next().unwrap().to_owned()
    };
    let files = sources(dir);
    let is_head = |file: &&PathBuf| file.ends_with("mod.rs");
    Source {
        text: files.iter().map(|file| (module(file), text(file))).collect(),
        heads: files.iter().filter(is_head).map(|file| module(file)).collect(),
    }
}

/// Every path of a `use` tree or expression that begins at `from`: braces expanded.
fn paths(from: &str) -> Vec<Module> {
    let mut found = Vec::new();
    expand(from, &mut Vec::new(), &mut found);
    found
}

/// Expands one path, appended to `before`; returns what follows it.
fn expand<'t>(mut text: &'t str, before: &mut Module, found: &mut Vec<Module>) -> &'t str {
    let depth = before.len();
    loop {
        text = text.trim_start();
        if let Some(list) = text.strip_prefix('{') {
            text = list;
            while !text.trim_start().starts_with('}') && !text.is_empty() {
                let rest = expand(text, before, found).trim_start();
                text = rest.strip_prefix(',').unwrap_or(rest);
                if text.len() == list.len() {
                    break;
                }
            }
            text = text.trim_start().strip_prefix('}').unwrap_or(text);
            break;
        }
        let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
        if end == 0 {
            // Something else, such as a glob: what came before counts.
            found.push(before.clone());
            text = text.get(1..).unwrap_or("");
            break;
        }
        before.push(text[..end].to_owned());
        text = &text[end..];
        match text.strip_prefix("::") {
            Some(rest) => text = rest,
            None => {
                found.push(before.clone());
                // `a as b`
                if let Some(rest) = text.trim_start().strip_prefix("as ") {
                    let end = rest.find([',', '}', ';']).unwrap_or(rest.len());
                    text = &rest[end..];
                }
                break;
            }
        }
    }
    before.truncate(depth);
    text
}

/// The paths that a module uses, from the crate's root.
fn used(module: &Module, text: &str) -> Vec<Module> {
    let mut found = Vec::new();
    for word in ["super::", "crate::", "self::"] {
        for (at, _) in text.match_indices(word) {
            let before = text[..at].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                continue;
            }
            let (mut base, mut rest) = (module.clone(), &text[at..]);
            loop {
                if let Some(after) = rest.strip_prefix("super::") {
                    base.pop();
                    rest = after;
                } else if let Some(after) = rest.strip_prefix("crate::") {
                    (base, rest) = (Vec::new(), after);
                } else if let Some(after) = rest.strip_prefix("self::") {
                    rest = after;
                } else {
                    break;
                }
            }
            found.extend(paths(rest).into_iter().map(|path| [base.clone(), path].concat()));
        }
    }
    found
}

/// What modules re-export of their children: (module, name) to the child.
fn exports(modules: &BTreeMap<Module, String>) -> BTreeMap<(Module, String), Module> {
    let mut found = BTreeMap::new();
    for (module, text) in modules {
        for statement in text.split(';') {
            let Some((before, tree)) = statement.rsplit_once("use ") else { continue };
            let is_import = before.is_empty() || before.ends_with([' ', '\n', ')']);
            for path in paths(tree).iter().filter(|path| is_import && path.len() > 1) {
                let child = [module.clone(), vec![path[0].clone()]].concat();
                if modules.contains_key(&child) {
                    found.insert((module.clone(), path.last().unwrap().clone()), child);
                }
            }
        }
    }
    found
}

/// Uses of files by files of a room, without those of its head.
fn uses(source: &Source) -> BTreeMap<Module, BTreeSet<Module>> {
    let exports = exports(&source.text);
    let mut out: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
    for (module, text) in &source.text {
        for path in used(module, text) {
            // As far as modules go; names that a module re-exports lead on to its child.
            let mut at: Module = Vec::new();
            for name in &path {
                let child = [at.clone(), vec![name.clone()]].concat();
                let Some(next) = source
                    .text
                    .contains_key(&child)
                    .then_some(child)
                    .or_else(|| exports.get(&(at.clone(), name.clone())).cloned())
                else {
                    break;
                };
                at = next;
            }
            let (from, to) = (source.file(module), source.file(&at));
            let of_one_room = from.len() == 1 || from.first() == to.first();
            if from != to && of_one_room && !source.heads.contains(&to) && !to.is_empty() {
                out.entry(from).or_default().insert(to);
            }
        }
    }
    out
}

/// Files that can reach each other, group by group.
fn circles(source: &Source) -> Vec<Vec<String>> {
    let uses = uses(source);
    let reach = |from: &Module| {
        let (mut seen, mut stack) = (BTreeSet::new(), vec![from]);
        while let Some(at) = stack.pop() {
            for next in uses.get(at).into_iter().flatten() {
                if seen.insert(next) {
                    stack.push(next);
                }
            }
        }
        seen
    };
    let reached: BTreeMap<&Module, _> = uses.keys().map(|m| (m, reach(m))).collect();
    let mut found: BTreeSet<Vec<String>> = BTreeSet::new();
    for (one, all) in &reached {
        if all.contains(one) {
            let is_mutual = |two: &&&Module| all.contains(**two) && reached[**two].contains(one);
            found.insert(reached.keys().filter(is_mutual).map(|m| m.join("/")).collect());
        }
    }
    found.into_iter().collect()
}

#[test]
fn circles_between_files_do_not_come_back() {
    let mut wrong = Vec::new();
    for dir in CRATES {
        let modules = modules(&crates_dir().join(dir).join("src"));
        assert!(!modules.text.is_empty(), "{dir}: its source was not found");
        wrong.extend(circles(&modules).iter().map(|circle| format!("{dir}: {circle:?}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_counter_finds_circles_of_two_and_three_and_through_re_exports() {
    let of = |files: &[(&str, &str)]| {
        let module = |path: &str| path.split('/').map(str::to_owned).collect::<Module>();
        let text = files.iter().map(|(path, text)| (module(path), (*text).to_owned())).collect();
        circles(&Source { text, heads: BTreeSet::from([module("room")]) })
    };
    let head = ("room", "mod a;\nmod b;\npub use a::{A, Other};\npub use b::B;");
    let two = of(&[head, ("room/a", "use super::b::B;"), ("room/b", "use super::{a::A, x};")]);
    assert_eq!(two, [["room/a", "room/b"]]);
    let by_name = of(&[head, ("room/a", "use super::B;"), ("room/b", "use crate::room::{A};")]);
    assert_eq!(by_name, [["room/a", "room/b"]]);
    let three = of(&[
        head,
        ("room/a", "fn f() { super::b::g() }"),
        ("room/b", "use crate::room::c::{self as d, C};"),
        ("room/c", "use super::{Other};"),
    ]);
    assert_eq!(three, [["room/a", "room/b", "room/c"]]);
    let none = of(&[
        head,
        ("room/a", "use super::b::{B, c};"),
        ("room/b", "use other_crate::a;"),
        ("room/a/child", "use super::A; use crate::room::b::B;"),
    ]);
    assert_eq!(none, Vec::<Vec<String>>::new());
    let by_child = of(&[
        head,
        ("room/a", "mod child;"),
        ("room/a/child", "use super::A; use crate::room::b::B;"),
        ("room/b", "use super::a::A;"),
    ]);
    assert_eq!(by_child, [["room/a", "room/b"]]);
}
