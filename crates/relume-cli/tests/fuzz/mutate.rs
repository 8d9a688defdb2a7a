//! Damage by structure: values of JSON, numbers of buffers, lengths of chunks, words of text.

use serde_json::{Value, json};

use super::random::Random;
use super::seeds::{Content, Format, Seed, written};

/// Numbers that are hard to bear.
const NUMBERS: [f64; 26] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    3.0,
    7.0,
    255.0,
    65_536.0,
    134_217_728.0,
    2_147_483_648.0,
    4_294_967_295.0,
    9_007_199_254_740_993.0,
    1.8e19,
    1e12,
    1e30,
    1e38,
    1e155,
    1e300,
    -1e300,
    1e-7,
    1e-12,
    1e-38,
    1e-45,
    1e-300,
];

/// The seed with one to five damages.
pub(crate) fn mutated(seed: &Seed, random: &mut Random) -> Vec<u8> {
    let times = 1 + random.below(5);
    match &seed.content {
        Content::Text(text) => {
            let mut text = text.clone();
            for _ in 0..times {
                text = damaged_text(&text, random);
            }
            let mut bytes = text.into_bytes();
            if random.below(20) == 0 {
                damage_bytes(&mut bytes, random);
            }
            bytes
        }
        Content::Tree { json, bin } => {
            let (mut json, mut bin) = (json.clone(), bin.clone());
            for _ in 0..times {
                match random.below(3) {
                    0 => damage_numbers(&mut bin, random),
                    _ => damage_tree(&mut json, random),
                }
            }
            let mut bytes = written(seed.format, &json, &bin);
            if seed.format == Format::Glb && random.below(8) == 0 {
                damage_chunks(&mut bytes, random);
            }
            bytes
        }
    }
}

/// Every place of a tree, as a path.
fn places(value: &Value, at: &str, into: &mut Vec<String>) {
    into.push(at.to_owned());
    match value {
        Value::Array(list) => {
            for (k, v) in list.iter().enumerate() {
                places(v, &format!("{at}/{k}"), into);
            }
        }
        Value::Object(map) => {
            for (k, v) in map {
                places(v, &format!("{at}/{}", k.replace('~', "~0").replace('/', "~1")), into);
            }
        }
        _ => {}
    }
}

fn damage_tree(json: &mut Value, random: &mut Random) {
    let mut all = Vec::new();
    places(json, "", &mut all);
    let place = random.of(&all).clone();
    let other: &String = random.of(&all);
    let other = json.pointer(other).cloned().unwrap_or_default();
    let Some(value) = json.pointer_mut(&place) else { return };
    let extreme = *random.of(&NUMBERS);
    match (value, random.below(6)) {
        (value @ Value::Number(_), kind) => {
            let old = value.as_f64().unwrap_or(0.0);
            *value = match kind {
                0 => json!(old + 1.0),
                1 => json!((old as i64).wrapping_add(1)),
                2 => json!(old * (1.0 + 1e-6)),
                3 if extreme >= 0.0 => json!(extreme as u64),
                4 => json!(random.below(12)),
                _ => json!(extreme),
            };
        }
        (Value::Array(list), 0) => list.clear(),
        (Value::Array(list), 1) if !list.is_empty() => {
            let copy = random.of(list).clone();
            list.push(copy);
        }
        (Value::Array(list), 2) => {
            list.pop();
        }
        (Value::Array(list), 3) if list.len() > 1 => {
            let (a, b) = (random.below(list.len()), random.below(list.len()));
            list.swap(a, b);
        }
        (Value::Object(map), 0..=2) if !map.is_empty() => {
            let keys: Vec<String> = map.keys().cloned().collect();
            map.remove(random.of(&keys));
        }
        (Value::Object(map), 3) if !map.is_empty() => {
            let keys: Vec<String> = map.keys().cloned().collect();
            let value = map[random.of(&keys)].clone();
            map.insert(random.of(&keys).clone(), value);
        }
        (Value::String(text), 0) => text.push_str("\u{1b}[31m\u{202e}\n"),
        (Value::String(text), 1) => *text = "x".repeat(3_000),
        (value, 4) => *value = other,
        (value, _) => {
            let kinds =
                [json!(null), json!([]), json!({}), json!("word"), json!(true), json!(extreme)];
            *value = random.of(&kinds).clone();
        }
    }
}

/// Numbers of 32 bits in a buffer.
fn damage_numbers(bin: &mut [u8], random: &mut Random) {
    let words = bin.len() / 4;
    if words == 0 {
        return;
    }
    let (at, from) = (4 * random.below(words), 4 * random.below(words));
    let old = f32::from_le_bytes(bin[at..at + 4].try_into().unwrap());
    let new = match random.below(8) {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => f32::from_le_bytes(bin[from..from + 4].try_into().unwrap()),
        3 => old + 1e-6,
        4 => -old,
        5 => 0.0,
        6 => f32::from_bits(random.next() as u32),
        _ => *random.of(&NUMBERS) as f32,
    };
    bin[at..at + 4].copy_from_slice(&new.to_le_bytes());
}

/// Magic, version and lengths of a .glb file, or its end.
fn damage_chunks(bytes: &mut Vec<u8>, random: &mut Random) {
    let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let heads = [0, 4, 8, 12, 16, 20 + json, 24 + json];
    let at = *random.of(&heads);
    match random.below(4) {
        0 => bytes.truncate(random.below(bytes.len())),
        1 => bytes.extend_from_slice(&[0, 1, 2]),
        2 if at + 4 <= bytes.len() => {
            let word = *random.of(&[0_u32, 1, 3, 12, 0x7FFF_FFFF, u32::MAX]);
            bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
        }
        _ => damage_bytes(bytes, random),
    }
}

fn damage_bytes(bytes: &mut [u8], random: &mut Random) {
    if !bytes.is_empty() {
        let at = random.below(bytes.len());
        bytes[at] = random.next() as u8;
    }
}

/// Text with a word, a line or a number changed.
fn damaged_text(text: &str, random: &mut Random) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    if lines.is_empty() {
        return "1 2 3".into();
    }
    let at = random.below(lines.len());
    match random.below(12) {
        0 => {
            lines.remove(at);
        }
        1 => lines.insert(at, lines[random.below(lines.len())].clone()),
        2 => {
            let other = random.below(lines.len());
            lines.swap(at, other);
        }
        3 => {
            let (open, close) = random.of(&[("<g>", "</g>"), ("(", ")"), ("body a\n", "")]);
            let deep = *random.of(&[3, 300, 5_000]);
            lines[at] = format!("{}{}{}", open.repeat(deep), lines[at], close.repeat(deep));
        }
        4 => {
            let stray =
                *random.of(&["\u{1b}[2J", "\0", "é", "#", ",", "\"", "<", "-", "1e999", "nan"]);
            let ends: Vec<usize> = lines[at].char_indices().map(|c| c.0).collect();
            let end = if ends.is_empty() { 0 } else { *random.of(&ends) };
            lines[at].insert_str(end, stray);
        }
        _ => lines[at] = damaged_words(&lines[at], random),
    }
    lines.join("\n") + "\n"
}

/// A line with one of its words or numbers changed; whatever separates them stays.
fn damaged_words(line: &str, random: &mut Random) -> String {
    let is_word = |c: char| c.is_alphanumeric() || ".-+_".contains(c);
    let mut parts: Vec<String> = Vec::new();
    let mut last = None;
    for c in line.chars() {
        let kind = is_word(c);
        match parts.last_mut() {
            Some(part) if last == Some(kind) => part.push(c),
            _ => parts.push(c.to_string()),
        }
        last = Some(kind);
    }
    let numbers: Vec<usize> =
        (0..parts.len()).filter(|&k| parts[k].parse::<f64>().is_ok()).collect();
    let others: Vec<usize> = (0..parts.len()).filter(|&k| parts[k].starts_with(is_word)).collect();
    let from = if numbers.is_empty() || random.below(4) == 0 { &others } else { &numbers };
    if from.is_empty() {
        return line.to_owned();
    }
    let (at, other) = (*random.of(from), *random.of(from));
    let extreme = *random.of(&NUMBERS);
    parts[at] = match random.below(6) {
        0 => parts[other].clone(),
        1 => String::new(),
        2 => parts[at].parse::<f64>().map_or("x".into(), |n| format!("{}", n + 1e-6)),
        3 => "nan".into(),
        _ => format!("{extreme:e}"),
    };
    parts.concat()
}
