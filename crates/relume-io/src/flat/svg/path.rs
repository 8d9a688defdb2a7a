//! Points, and paths of straight parts.

use glam::DVec2;

use super::{Chain, Fault, fault};

/// Splits text into commands (letters) and numbers.
///
/// Numbers may touch: `1-2`, `.5.5`.
fn words(text: &str) -> Result<Vec<Word>, Fault> {
    let bytes = text.as_bytes();
    let (mut out, mut k) = (Vec::new(), 0);
    while k < bytes.len() {
        let c = bytes[k];
        if c.is_ascii_whitespace() || c == b',' {
            k += 1;
            continue;
        }
        if c.is_ascii_alphabetic() {
            out.push(Word::Command(char::from(c)));
            k += 1;
            continue;
        }
        let start = k;
        let (mut point, mut exponent) = (false, false);
        k += usize::from(c == b'-' || c == b'+');
        while let Some(&c) = bytes.get(k) {
            match c {
                b'0'..=b'9' => {}
                b'.' if !point && !exponent => point = true,
                b'e' | b'E' if !exponent => {
                    exponent = true;
                    k += usize::from(matches!(bytes.get(k + 1), Some(b'-' | b'+')));
                }
                _ => break,
            }
            k += 1;
        }
        let number = text.get(start..k).and_then(|word| word.parse::<f64>().ok());
        match number.filter(|n| n.is_finite()) {
            Some(number) => out.push(Word::Number(number)),
            None => {
                let rest: String = text.get(start..).unwrap_or("").chars().take(8).collect();
                return fault(format!("`{rest}` is not a number"), "write numbers such as 1.5");
            }
        }
    }
    Ok(out)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Word {
    Command(char),
    Number(f64),
}

/// The points of a polyline or polygon.
pub(super) fn points(text: &str) -> Result<Vec<DVec2>, Fault> {
    let numbers = numbers(text)?;
    if numbers.len() % 2 == 1 {
        return fault(format!("points has {} numbers", numbers.len()), "write x y for each point");
    }
    Ok(numbers.chunks(2).map(|p| DVec2::new(p[0], p[1])).collect())
}

/// A list of numbers.
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, Fault> {
    let number = |word| match word {
        Word::Number(number) => Ok(number),
        Word::Command(c) => fault(format!("`{c}` is not a number"), "write numbers such as 1.5"),
    };
    words(text)?.into_iter().map(number).collect()
}

/// The parts of a path.
pub(super) fn chains(text: &str) -> Result<Vec<Chain>, Fault> {
    let mut out: Vec<Chain> = Vec::new();
    let mut words = words(text)?.into_iter().peekable();
    let (mut at, mut command) = (DVec2::ZERO, None);
    while let Some(&word) = words.peek() {
        if let Word::Command(c) = word {
            words.next();
            command = Some(c);
            if matches!(c, 'Z' | 'z') {
                let Some(chain) = out.last_mut() else { return begins_with_m() };
                chain.closed = true;
                at = chain.points[0];
                command = None;
                continue;
            }
        }
        let Some(c) = command else { return begins_with_m() };
        let mut number = || match words.next() {
            Some(Word::Number(n)) => Ok(n),
            _ => {
                fault(format!("`{c}` has too few numbers"), "M and L take x y, H and V one number")
            }
        };
        let origin = if c.is_ascii_lowercase() { at } else { DVec2::ZERO };
        at = match c.to_ascii_uppercase() {
            'M' | 'L' => origin + DVec2::new(number()?, number()?),
            'H' => DVec2::new(origin.x + number()?, at.y),
            'V' => DVec2::new(at.x, origin.y + number()?),
            _ => {
                return fault(
                    format!("`{c}` is no straight line"),
                    "make it straight: M L H V Z are read; drawing programs flatten curves",
                );
            }
        };
        match (c, out.last_mut()) {
            ('M' | 'm', _) => {
                out.push(Chain { points: vec![at], closed: false });
                // More points are lines.
                command = Some(if c == 'm' { 'l' } else { 'L' });
            }
            (_, None) => return begins_with_m(),
            (_, Some(chain)) if chain.closed => {
                let start = chain.points[0];
                out.push(Chain { points: vec![start, at], closed: false });
            }
            (_, Some(chain)) => chain.points.push(at),
        }
    }
    // What is moved to and not drawn from is no part.
    out.retain(|chain| chain.points.len() > 1);
    Ok(out)
}

fn begins_with_m<T>() -> Result<T, Fault> {
    fault("its d does not begin with M", "begin each part with M x y")
}
